"""Everything that README and docs show of speed, accuracy and failure, from nothing: `make report`.

Each study is a plan of `cutjoint bench`; what was measured is kept beside the report, so that an interrupted run goes on.  On two cores it
takes about an hour; run it on a machine that does nothing else.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import click
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from cutjoint.bench.cases import make_case
from cutjoint.bench.contenders import choose
from cutjoint.bench.exact.chain import Chain, chain_motion, write_chain
from cutjoint.bench.failures.situations import try_situations
from cutjoint.bench.records import Case
from cutjoint.bench.store import Store
from cutjoint.bench.study import Plan, perform
from cutjoint.report.bench.charts import draw_work_precision
from cutjoint.report.bench.page import render_page

ROOT = Path(__file__).resolve().parent.parent
MODELS = ROOT / "models"
IAVSD = "iavsd_inphase_5"
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
    contenders = choose(["generated", "reduced", "peer"])
    return Plan(cases=[case], contenders=contenders, reference="extended", title="with link masses, and peers")


def verification() -> Plan:
    """The verification problems, with peers."""
    cases = [make_case(MODELS / f"{name}.yaml") for name in ("pendulum", "four_bar", "andrews", "slider_crank")]
    return Plan(cases=cases, contenders=choose(["generated", "peer"]), drift=True)


def governor() -> Plan:
    """The flyball governor, whose stiff spring would keep a reference of 113 bits busy for an hour."""
    return Plan(cases=[make_case(MODELS / "flyball.yaml")], contenders=choose(["generated", "peer"]), reference="extended")


def chain() -> Plan:
    """Forty windows of the N-four-bar, with peers."""
    return Plan(cases=[_chain(40)], contenders=choose(["generated", "peer"]), title="and peers")


def twins() -> Plan:
    """Other solvers of the same matrices, and the generic twins."""
    case = make_case(MODELS / "iltis.yaml", "simul1", row=0.0075)
    return Plan(cases=[case], contenders=choose(["generated", "solvers", "generic"]), reference="extended", limits=False,
                title="solvers and generic twins")  # fmt: skip


def precisions() -> Plan:
    """The precision ladder."""
    case = make_case(MODELS / "slider_crank.yaml", end=1.0)
    return Plan(cases=[case], contenders=choose(["precision"]), limits=False, title="number types")


def failures() -> Plan:
    """The atlas of a mechanism with a singular pose and of one with stiff bumpers."""
    return Plan(cases=[make_case(MODELS / "slider_crank.yaml", end=1.0)], contenders=[], atlas=True)


def _chain(windows: int) -> Case:
    chain = Chain(windows=windows)
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"chain_{windows}.yaml"
        path.write_text(write_chain(chain), encoding="utf-8")
        return replace(make_case(path), motion=partial(chain_motion, chain))


STUDIES: dict[str, Callable[[], Plan]] = {
    study.__name__: study for study in (paper, ladder, vehicle, verification, governor, chain, twins, precisions, failures)
}  # fmt: skip


#: The studies whose charts are kept as pictures too.
PICTURES = ("vehicle", "chain", "verification", "governor")


@click.command()
@click.option("--only", type=click.Choice([*STUDIES, "situations"]), multiple=True, help="Of these alone.")
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), default=ROOT / "docs" / "bench", show_default=True)
def main(only: tuple[str, ...], out: Path) -> None:
    """Measure what is not yet measured and write the report."""
    store = Store(ROOT / "results" / "report" / "measurements.jsonl")
    with Progress(SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn(), console=Console(stderr=True)) as progress:
        task = progress.add_task("", total=None)

        def say(text: str) -> None:
            progress.update(task, description=text)

        studies = {name: perform(STUDIES[name](), store, say) for name in STUDIES if not only or name in only}
        data = merge(studies.values())
        if not only or "situations" in only:
            data["situations"] = try_situations(store, say)
    out.mkdir(parents=True, exist_ok=True)
    (out / "bench.json").write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    (out / "bench.html").write_text(render_page(data), encoding="utf-8")
    for case in (case for name in PICTURES if name in studies for case in studies[name]["cases"]):
        (out / f"{case['model']}_{case['scene']}.svg").write_text(draw_work_precision(case), encoding="utf-8")


def merge(parts: Iterable[dict[str, Any]]) -> dict[str, Any]:
    """The studies' results as one."""
    merged: dict[str, Any] = {"machine": {}, "cases": [], "drifts": [], "atlases": [], "situations": []}
    for part in parts:
        merged["machine"] = part["machine"]
        for name in ("cases", "drifts", "atlases"):
            merged[name] += part[name]
    return merged


if __name__ == "__main__":
    main()
