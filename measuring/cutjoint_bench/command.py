"""`cutjoint bench`."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from cutjoint.commands import options, table
from cutjoint.model.ranges import fault_of_setting
from cutjoint.model.text import read_number
from cutjoint.package.errors import RunError
from cutjoint.run.outputs import require_apart, require_folder
from cutjoint.run.result_files import write_whole
from cutjoint.topology.reading import read_model
from cutjoint_bench.cases import make_case
from cutjoint_bench.choices import choice_lines
from cutjoint_bench.contenders import choose, groups
from cutjoint_bench.cutjoint_contenders import TOLERANCES as NUMBER_TYPES
from cutjoint_bench.prebuild import prebuild
from cutjoint_bench.progress import progress_bar
from cutjoint_bench.records import Case
from cutjoint_bench.reference import TOLERANCES
from cutjoint_bench.store import Store
from cutjoint_bench.study import Plan, perform

#: Runs that would take longer (s) are not begun: they are far from the frontier.
MOST_SECONDS = 3.0


def run_bench(
    *, models: Sequence[Path], scenes: Sequence[str], methods: Sequence[str], out: Path, end: float | None, row: float | None,
    steps: Sequence[float], repetitions: int, reference: str, limits: bool, drift: bool, atlas: bool, vary: str, precisions: Sequence[str],
    parameters: Mapping[str, float], link_masses: Mapping[str, float],
) -> list[Path]:  # fmt: skip
    """Bench models and write ``bench.json`` and ``bench.html`` into a folder; what was measured there before is not measured again.

    Raises:
        ModelError, RunError: a file is wrong, or has no such scene; no contender has a name.
    """
    from cutjoint_bench.report.page import render_page

    if vary and not atlas:
        raise RunError("--vary names what an atlas varies: add --atlas")
    plan = Plan(
        cases=list(_cases(models, scenes, end=end, row=row, parameters=parameters, link_masses=link_masses, watched=True)),
        contenders=choose(methods), repetitions=repetitions, steps=steps, reference=reference, limits=limits,
        drift=drift, atlas=atlas, vary=vary, precisions=precisions, most_seconds=MOST_SECONDS,
    )  # fmt: skip
    measurements, data_file, page_file = (out / name for name in ("measurements.jsonl", "bench.json", "bench.html"))
    require_apart(
        {f"the model {path}": path for path in models},
        documents=[(f"--out {out}: file", path) for path in (measurements, data_file, page_file)],
    )
    require_folder(out)
    with progress_bar() as say:
        prebuild([plan], measurements, say)
        data = perform(plan, Store(measurements), say)
        say("drawing")
        page = render_page({"bench": data})
    return [write_whole(data_file, json.dumps(data, indent=1) + "\n"), write_whole(page_file, page)]


def _cases(models: Sequence[Path], scenes: Sequence[str], **how: Any) -> Iterator[Case]:
    """The scenes named, or all of each model; a scene need not be in every model."""
    known = {path: list(read_model(path).scenes) for path in models}
    for name in scenes:
        if not any(name in found for found in known.values()):
            raise RunError(f"no scene '{name}'; there is {', '.join(s for found in known.values() for s in found) or 'none'}")
    for path, found in known.items():
        for scene in [s for s in found if not scenes or s in scenes] if found else [None]:
            yield make_case(path, scene, **how)


def _listed(text: str) -> list[str]:
    """The parts of a list with commas; none of a list that is not given."""
    parts = [part.strip() for part in text.split(",")] if text else []
    if not all(parts):
        raise click.BadParameter(f"'{text}': write names with one comma between, such as A,B")
    return parts


def _precisions(text: str) -> list[str]:
    names = _listed(text)
    if unknown := [name for name in names if name not in NUMBER_TYPES]:
        raise click.BadParameter(f"no number type '{unknown[0]}'; there is {', '.join(NUMBER_TYPES)}")
    return names


def _seconds(text: str) -> list[float]:
    try:
        steps = [read_number(part) for part in _listed(text)]
    except (ValueError, click.BadParameter):
        raise click.BadParameter(f"'{text}': write seconds with commas between, such as 0.01,0.005") from None
    if faults := [fault for step in steps if (fault := fault_of_setting("dt", step))]:
        raise click.BadParameter(f"'{text}': {faults[0]}")
    return steps


@click.command("bench")
@click.argument("models", type=click.Path(exists=True, dir_okay=False, path_type=Path), nargs=-1, required=True)
@click.option("--scenes", default="", callback=lambda *x: _listed(x[2]), metavar="A,B", help="Scenes; all of each model otherwise.")
@click.option("--methods", default="generated,integrators,functions,reduced,accuracy,auto,peer", show_default=True,
              callback=lambda *x: _listed(x[2]), metavar="A,B",
              help=f"Contenders, or groups of them: {', '.join(groups())}.")
@click.option("--end", type=table.Setting("end", positive=True), help="End time in s; the scenes' otherwise.")
@click.option("--row", type=table.Setting("output_step"), help="Seconds between rows that are compared.")
@click.option("--steps", default="", callback=lambda *x: _seconds(x[2]), metavar="S,S", help="Steps in s to try.")
@click.option("--repetitions", type=table.Setting("repetitions"), default=5, show_default=True,
              help="Timed runs of each point.")
@click.option("--reference", type=click.Choice([*TOLERANCES, "none"]), default="quad", show_default=True,
              help="Number type in which references are integrated; extended is faster, and enough where roads have kinks.")
@click.option("--limits/--no-limits", default=True, help="Visual for the largest step of each method.")
@click.option("--drift", is_flag=True, help="Energy and momentum of mechanisms that keep them.")
@click.option("--atlas", is_flag=True, help="Where each method fails, over step and penalty, and why.")
@click.option("--vary", default="", metavar="NAME[=V,V]",
              help="A parameter, such as a stiffness or a length, that the atlas varies in place of the penalty; its values in SI units, "
              "else a hundredth to a hundred times its own.")
@click.option("--precisions", default="double", show_default=True, callback=lambda *x: _precisions(x[2]), metavar="A,B",
              help=f"Number types of the atlas: {', '.join(NUMBER_TYPES)}.")
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), default=Path("results/bench"), show_default=True,
              help="Folder of the report; an interrupted bench goes on there.")
@table.OPTIONS["changes"]
@table.OPTIONS["links"]
@options.reports_errors
def command(changes: tuple[str, ...], links: tuple[str, ...], **how: Any) -> None:
    """Measure speed and accuracy of all methods on MODELS against a reference, and write a report."""
    written = run_bench(parameters=options.read_parameters(changes), link_masses=options.read_masses(links), **how)
    for line in (*choice_lines(json.loads(written[0].read_text(encoding="utf-8"))), *map(str, written)):
        options.out.print(line, markup=False, highlight=False, soft_wrap=True)
