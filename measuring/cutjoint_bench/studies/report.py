"""Everything that README and docs show of speed, accuracy and failure, from nothing: `make report`.

Each study is a plan of `cutjoint bench`; what was measured is kept beside the report, so that an interrupted run goes on.  On two cores it
takes one to two hours, a third of it before any clock runs; run it on a machine that does nothing else.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import click

from cutjoint.model.records import Model
from cutjoint.run.result_files import write_whole
from cutjoint.run.scenes import with_settings
from cutjoint_bench.cases import make_case
from cutjoint_bench.contenders import choose
from cutjoint_bench.exact.chain import Chain, chain_motion, write_chain
from cutjoint_bench.failures.situations import all_situations
from cutjoint_bench.outdated import find_outdated
from cutjoint_bench.prebuild import prebuild
from cutjoint_bench.progress import Say, part_of, progress_bar
from cutjoint_bench.records import Case
from cutjoint_bench.report.charts import draw_work_precision
from cutjoint_bench.report.page import NO_MAPS, render_page
from cutjoint_bench.report.summary import summarise
from cutjoint_bench.store import Store
from cutjoint_bench.studies.checkout import DOCS, MODELS, RESULTS, SUMMARY
from cutjoint_bench.study import Plan, perform

IAVSD = "iavsd_inphase_5"
MEASUREMENTS = RESULTS / "report" / "measurements.jsonl"
PAPER = ("simul1", "simul2", "simul3", "simul1s")

#: Peers need mass in every body: the variant with link masses of the vehicle.
LINKS = {"*.leaf_link": 2.0, "*.tie_rod": 1.0}


def paper() -> Plan:
    """The paper's scenes.  Rows are 7.5 ms apart, of which its other steps are multiples now and then."""
    cases = [make_case(MODELS / "iltis.yaml", scene, row=0.0075) for scene in PAPER]
    return Plan(cases=cases, contenders=choose(["generated"]), reference="extended")


def reductions() -> Plan:
    """One of the paper's scenes, with and without lanes, in full and reduced, model by model, by each integrator."""
    case = make_case(MODELS / "iltis.yaml", "simul1", row=0.0075)
    contenders = choose(["generated", "scalar", "reductions", "integrators", "reduced", "functions"])
    return Plan(cases=[case], contenders=contenders, reference="extended", title="lanes, reduced models and integrators")


def vehicle() -> Plan:
    """A vehicle that all tools can run, ours in the same variant."""
    case = make_case(MODELS / "iltis.yaml", IAVSD, row=0.005, parameters={"chassis_mass": 1248.0}, link_masses=LINKS)
    case = replace(case, of_peers=_cut_at(case.model, "leaf_ball", instead_of="leaf_hinge"))
    contenders = choose(["generated", "integrators", "reduced", "functions", "peer"])
    return Plan(cases=[case], contenders=contenders, reference="extended", title="with link masses, and peers")


def _cut_at(model: Model, joint: str, *, instead_of: str) -> Model:
    """A model whose parts are cut at another joint: three equations of a ball, which are independent, for the five of a hinge."""
    cut = {joint: True, instead_of: False}
    joints = tuple(replace(j, cut=cut.get(j.name.rpartition(".")[2], j.cut)) for j in model.joints)
    return replace(model, joints=joints)


def verification() -> Plan:
    """The verification problems, with peers."""
    cases = [make_case(MODELS / f"{name}.yaml") for name in ("pendulum", "four_bar", "andrews", "slider_crank")]
    return Plan(cases=cases, contenders=choose(["generated", "integrators", "peer"]), drift=True, shortest=0.005)


def smooth() -> Plan:
    """The N-four-bar with gravity upwards: it sways about the upright and stays away from its singular poses."""
    case = _chain(Chain(windows=2, gravity=9.81))
    return Plan(cases=[case], contenders=choose(["generated", "integrators"]), title="away from singular poses")


def governor() -> Plan:
    """The flyball governor, whose stiff spring would keep a reference of 113 bits busy for an hour."""
    contenders = choose(["generated", "integrators", "peer"])
    return Plan(cases=[make_case(MODELS / "flyball.yaml")], contenders=contenders, reference="extended", drift=True)


def chain() -> Plan:
    """Forty windows of the N-four-bar, with peers."""
    return Plan(cases=[_chain(Chain(windows=40))], contenders=choose(["generated", "integrators", "peer"]), title="and peers")


def solvers() -> Plan:
    """Other solvers of the same matrices, and the generic solvers."""
    case = make_case(MODELS / "iltis.yaml", "simul1", row=0.0075)
    return Plan(cases=[case], contenders=choose(["generated", "solvers", "generic"]), reference="extended", limits=False, repetitions=3,
                shortest=0.2, title="solvers and generic solvers")  # fmt: skip


def precisions() -> Plan:
    """The number types of a small mechanism."""
    case = make_case(MODELS / "slider_crank.yaml", end=1.0)
    return Plan(cases=[case], contenders=choose(["precision"]), limits=False, title="number types")


def ill_conditioned() -> Plan:
    """The paper's suspicion: small steps with its penalty of 1e9 at the beginning of the bump, in all number types."""
    case = make_case(MODELS / "iltis.yaml", IAVSD, end=0.02, row=0.002)
    with_penalty = replace(case, scene=with_settings(case.scene, "augmented", {"penalty": 1e9}))
    names = [f"{method}/{kind}" for kind in ("double", "extended", "mixed", "quad") for method in ("augmented", "classical")]
    return Plan(
        cases=[with_penalty], contenders=choose(["recursive", *names]), reference="extended", limits=False, repetitions=1, most_seconds=120,
        steps=[2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5], title="small steps with a penalty of 1e9, by number type",
    )  # fmt: skip


def failures() -> Plan:
    """The atlas of a mechanism with a singular pose."""
    return Plan(cases=[make_case(MODELS / "slider_crank.yaml", end=1.0)], contenders=[], atlas=True)


def bumpers() -> Plan:
    """The atlas of the vehicle over the stiffness of its bumpers, up to the second of the steps down, where they are hit."""
    case = make_case(MODELS / "iltis.yaml", "simul1s", end=4.8, row=0.01)
    return Plan(cases=[case], contenders=[], reference="extended", atlas=True, vary="bumper_stiffness")


def situations() -> Plan:
    """Hard situations with known outcomes."""
    return Plan(cases=[], contenders=[], situations=list(all_situations()))


def _chain(chain: Chain) -> Case:
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"chain_{chain.windows}.yaml"
        path.write_text(write_chain(chain, penalty=False), encoding="utf-8")
        return replace(make_case(path), motion=partial(chain_motion, chain))


STUDIES: dict[str, Callable[[], Plan]] = {
    study.__name__: study
    for study in (
        vehicle, chain, verification, governor, smooth, reductions, paper, solvers, precisions, ill_conditioned, failures, bumpers,
        situations,
    )
}


#: The studies whose charts are kept as pictures too.
PICTURES = ("vehicle", "chain", "verification", "governor")


#: Bytes that the page in docs has at most.
LARGEST = 500_000


@click.command()
@click.option("--only", type=click.Choice(list(STUDIES)), multiple=True, help="Measure these; the page keeps the others.")
@click.option("--draw", is_flag=True, help="Measure nothing: draw what bench.json has.")
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), default=MEASUREMENTS.parent, show_default=True,
              help="Folder of bench.json, all that was measured, and bench.html, with all charts.")
@click.option("--docs", type=click.Path(file_okay=False, path_type=Path), default=DOCS, show_default=True,
              help="Folder of the summary, a page without drifts' charts and maps, and the charts that docs show.")
def main(only: tuple[str, ...], draw: bool, out: Path, docs: Path) -> None:
    """Measure what is not yet measured and write the report."""
    data = out / "bench.json"
    kept: dict[str, Any] = json.loads(data.read_text(encoding="utf-8"))["studies"] if data.exists() else {}
    with progress_bar() as say:
        if not draw:
            _measure(only, kept, data, say)
        say("drawing")
        studies = {name: kept[name] for name in STUDIES if name in kept}
        write_whole(data, as_text(studies))
        write_whole(out / "bench.html", render_page(studies))
        if missing := [name for name in STUDIES if name not in studies]:
            click.echo(f"{docs} is left as it is, since these studies are not in {data}: {', '.join(missing)}")
        else:
            write_docs(docs, studies)
    if unexpected := [f"{row['name']}, {row['method']} at {1e3 * row['dt']:g} ms: {row['outcome']}" for row in _unexpected(studies)]:
        raise click.ClickException("these situations did not end as expected:\n" + "\n".join(unexpected))


def _unexpected(studies: dict[str, Any]) -> Iterator[dict[str, Any]]:
    return (row for data in studies.values() for row in data["situations"] if not row["as_expected"])


def _measure(only: tuple[str, ...], kept: dict[str, Any], data: Path, say: Say) -> None:
    """Put what is measured into ``kept``, and into a file after each study."""
    plans = {name: STUDIES[name]() for name in only or STUDIES}
    prebuild(list(plans.values()), MEASUREMENTS, say)
    store = Store(MEASUREMENTS)
    for number, (name, plan) in enumerate(plans.items()):
        kept[name] = perform(plan, store, part_of(say, number, len(plans)))
        write_whole(data, as_text(kept))
    for name in (name for name in STUDIES if name in kept and only and name not in only):
        say(f"{name}: comparing what is kept with this version's code")
        kept[name]["outdated"] = find_outdated(STUDIES[name](), kept[name])


def as_text(studies: dict[str, Any]) -> str:
    """All figures as JSON, in the order of STUDIES."""
    return json.dumps({"studies": {name: studies[name] for name in STUDIES if name in studies}}, indent=1) + "\n"


def write_docs(docs: Path, studies: dict[str, Any]) -> None:
    """The summary, the page, and the charts of time over error that docs show.

    Raises:
        click.ClickException: the page is too large for git.
    """
    pictured = [case for name in PICTURES if name in studies for case in studies[name]["cases"]]
    files = {(case["name"], case["title"]): f"{case['model']}_{case['scene']}.svg" for case in pictured}
    page = render_page(studies, NO_MAPS)
    if (size := len(page.encode())) > LARGEST:
        raise click.ClickException(f"the page for {docs} has {size} bytes: leave something out, such as tables of configurations")
    write_whole(docs / "bench.html", page)
    write_whole(docs / SUMMARY.name, json.dumps(summarise(studies), indent=1, ensure_ascii=False) + "\n")
    for case in pictured:
        write_whole(docs / files[case["name"], case["title"]], draw_work_precision(case))


if __name__ == "__main__":
    main()
