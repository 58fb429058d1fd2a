"""Everything that README and docs show of speed, accuracy and failure, from nothing: `make report`.

Each study is a plan of `cutjoint bench`; what was measured is kept beside the report, so that an interrupted run goes on.  On two cores it
takes one to two hours, a third of it before any clock runs; run it on a machine that does nothing else.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import click

from cutjoint.bench.cases import make_case
from cutjoint.bench.contenders import choose
from cutjoint.bench.exact.chain import Chain, chain_motion, write_chain
from cutjoint.bench.failures.situations import all_situations
from cutjoint.bench.kept import find_outdated
from cutjoint.bench.progress import part_of, progress_bar
from cutjoint.bench.ready import make_ready
from cutjoint.bench.records import Case
from cutjoint.bench.store import Store
from cutjoint.bench.study import Plan, perform
from cutjoint.report.bench.charts import draw_work_precision
from cutjoint.report.bench.page import render_page
from cutjoint.run.result_files import write_whole
from cutjoint.run.scenes import with_figures

ROOT = Path(__file__).resolve().parent.parent
MODELS = ROOT / "models"
IAVSD = "iavsd_inphase_5"
PAGE = ROOT / "docs" / "bench" / "bench.json"
MEASUREMENTS = ROOT / "results" / "report" / "measurements.jsonl"
PAPER = ("simul1", "simul2", "simul3", "simul1s")

#: Peers need mass in every body: the variant with link masses of the vehicle.
LINKS = {"*.leaf_link": 2.0, "*.tie_rod": 1.0}


def paper() -> Plan:
    """The paper's scenes.  Rows are 7.5 ms apart, of which its other steps are multiples now and then."""
    cases = [make_case(MODELS / "iltis.yaml", scene, row=0.0075) for scene in PAPER]
    return Plan(cases=cases, contenders=choose(["generated"]), reference="extended")


def ladder() -> Plan:
    """One of the paper's scenes, with and without lanes, in full and reduced, rung by rung."""
    case = make_case(MODELS / "iltis.yaml", "simul1", row=0.0075)
    return Plan(cases=[case], contenders=choose(["generated", "scalar", "rungs"]), reference="extended", title="lanes and reduced models")


def vehicle() -> Plan:
    """A vehicle that all tools can run, ours in the same variant."""
    case = make_case(MODELS / "iltis.yaml", IAVSD, row=0.005, parameters={"chassis_mass": 1248.0}, link_masses=LINKS)
    contenders = choose(["generated", "integrators", "reduced", "peer"])
    return Plan(cases=[case], contenders=contenders, reference="extended", title="with link masses, and peers")


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


def twins() -> Plan:
    """Other solvers of the same matrices, and the generic twins."""
    case = make_case(MODELS / "iltis.yaml", "simul1", row=0.0075)
    return Plan(cases=[case], contenders=choose(["generated", "solvers", "generic"]), reference="extended", limits=False, repetitions=3,
                shortest=0.2, title="solvers and generic twins")  # fmt: skip


def precisions() -> Plan:
    """The precision ladder of a small mechanism."""
    case = make_case(MODELS / "slider_crank.yaml", end=1.0)
    return Plan(cases=[case], contenders=choose(["precision"]), limits=False, title="number types")


def ill_conditioned() -> Plan:
    """The paper's suspicion: small steps with its penalty of 1e9 at the beginning of the bump, in all number types."""
    case = make_case(MODELS / "iltis.yaml", IAVSD, end=0.02, row=0.002)
    given = replace(case, scene=with_figures(case.scene, "augmented", {"penalty": 1e9}))
    names = [f"{method}/{kind}" for kind in ("double", "extended", "mixed", "quad") for method in ("augmented", "classical")]
    return Plan(
        cases=[given], contenders=choose(["recursive", *names]), reference="extended", limits=False, repetitions=1, most_seconds=120,
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
        path.write_text(write_chain(chain), encoding="utf-8")
        return replace(make_case(path), motion=partial(chain_motion, chain))


STUDIES: dict[str, Callable[[], Plan]] = {
    study.__name__: study
    for study in (
        paper, ladder, vehicle, verification, smooth, governor, chain, twins, precisions, ill_conditioned, failures, bumpers, situations,
    )
}


#: The studies whose charts are kept as pictures too.
PICTURES = ("vehicle", "chain", "verification", "governor")


@click.command()
@click.option("--only", type=click.Choice(list(STUDIES)), multiple=True, help="Measure these; the page keeps the others.")
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), default=PAGE.parent, show_default=True)
def main(only: tuple[str, ...], out: Path) -> None:
    """Measure what is not yet measured and write the report."""
    page = out / PAGE.name
    kept: dict[str, Any] = json.loads(page.read_text(encoding="utf-8"))["studies"] if page.exists() else {}
    plans = {name: STUDIES[name]() for name in only or STUDIES}
    with progress_bar() as say:
        make_ready(list(plans.values()), MEASUREMENTS, say)
        store = Store(MEASUREMENTS)
        for number, (name, plan) in enumerate(plans.items()):
            kept[name] = perform(plan, store, part_of(say, number, len(plans)))
            write_whole(page, as_text(kept))
        for name in (name for name in STUDIES if name in kept and only and name not in only):
            say(f"{name}: comparing what is kept with this version's code")
            kept[name]["outdated"] = find_outdated(STUDIES[name](), kept[name])
        say("drawing")
        write_page(out, {name: kept[name] for name in STUDIES if name in kept})


def as_text(studies: dict[str, Any]) -> str:
    """All figures as JSON, in the order of STUDIES."""
    return json.dumps({"studies": {name: studies[name] for name in STUDIES if name in studies}}, indent=1) + "\n"


def write_page(out: Path, studies: dict[str, Any]) -> None:
    """The page, its figures as data, and the pictures."""
    write_whole(out / PAGE.name, as_text(studies))
    write_whole(out / "bench.html", render_page(studies))
    for case in (case for name in PICTURES if name in studies for case in studies[name]["cases"]):
        write_whole(out / f"{case['model']}_{case['scene']}.svg", draw_work_precision(case))


if __name__ == "__main__":
    main()
