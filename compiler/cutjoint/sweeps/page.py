"""The page of a sweep, one HTML file, and pages of its runs, which the simulator of the command line repeats."""

import base64
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from html import escape
from itertools import permutations
from pathlib import Path
from types import MappingProxyType
from urllib.parse import quote

import jinja2
import numpy as np
import sympy
from numpy.typing import NDArray

from cutjoint.compile.c_export import choose_steps
from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.package.errors import RunError
from cutjoint.package.locations import templates_folder
from cutjoint.run.reading import read_model
from cutjoint.run.result_files import naming_output
from cutjoint.run.results import Trajectory
from cutjoint.run.scenes import in_scene, with_default_closure
from cutjoint.run.simulation import simulate
from cutjoint.run.simulator import SimulatorError
from cutjoint.sweeps.designs import Masses
from cutjoint.sweeps.records import Array, Kind, Objective, Study
from cutjoint.sweeps.run import Sweep
from cutjoint.view.ghost import GhostRun, read_page
from cutjoint.view.page import as_data, as_script, as_table, script_hash
from cutjoint.view.views import show_run, write_shown

#: The largest size of a page's numbers, bytes; of larger sweeps it shows a selection of runs.
_BYTES = 300_000

#: The numbers of best and worst runs of each objective, and of failed runs, that a page always contains.
_EXTREME, _FAILED = 20, 20

#: The largest and the smallest number of rows of curves over time.
_ROWS, _FEW_ROWS = 400, 20


@dataclass(frozen=True, kw_only=True)
class Replay:
    """A run that was simulated again, with the outputs that objectives take, and its ``page``."""

    page: Path
    run: Trajectory


def make_page(study: Study, done: Sweep, command: str, replays: Mapping[int, Replay] = MappingProxyType({})) -> str:
    """The page of a table with the curves of ``replays`` and links to their pages.
    ``command`` is the start of the command that makes the page of another run."""
    columns = [(v.name, "variable", v.unit) for v in study.variables] + [(o.name, "objective", o.unit) for o in study.objectives]
    numbers = [_numbers(study, done, name) for name, _, _ in columns]
    goals = {o.name: o.goal for o in study.objectives}
    scenes = {v.name for v in study.variables if v.kind is Kind.SCENE}
    shown = choose_runs(study, done, max(1, _BYTES // (4 * (len(columns) + 1))))
    failures = [(i, failure) for i, failure in enumerate(done.failures) if failure is not None]
    about = {
        "title": study.model.name, "note": _note(study, len(shown), len(failures)), "shown": len(shown), "command": command,
        "pages": f"{Path(study.file).stem}-run-",
        "replays": {str(run): quote(f"{r.page.parent.name}/{r.page.name}") for run, r in sorted(replays.items())},
        "outputs": next((list(r.run.units.items()) for r in replays.values()), []), "curves": _curves(replays),
        "failures": [{"number": number, "reason": reason} for number, reason in failures[:_FAILED]],
        "columns": [
            {"name": name, "role": role, "unit": unit, "goal": goals.get(name, ""),
             "labels": [scene.name for scene in study.scenes] if name in scenes else None}
            for name, role, unit in columns
        ],
    }  # fmt: skip
    content = shown.astype("<i4").tobytes() + b"".join(values[shown].astype("<f4").tobytes() for values in numbers)
    folder = templates_folder()
    script, loader = as_script("view/page/elements", "sweep/page"), jinja2.FileSystemLoader(folder / "sweep")
    environment = jinja2.Environment(loader=loader, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    page: str = environment.get_template("page.html.jinja").render(
        title=escape(f"{study.model.name}: {study.runs} runs"), about=as_data(about), numbers=base64.b64encode(content).decode(),
        script=script, hash=script_hash(script),
        styles=[(folder / name).read_text(encoding="utf-8") for name in ("view/page.css", "sweep/page.css")],
    )  # fmt: skip
    return page


def _curves(replays: Mapping[int, Replay]) -> dict[str, str]:
    """The outputs of runs at evenly selected rows."""
    runs = {run: replay.run for run, replay in replays.items()}
    most = min(_ROWS, max(_FEW_ROWS, _BYTES // (4 * sum(1 + len(run.columns) for run in runs.values()) or 1)))
    kept = {number: np.linspace(0, run.t.size - 1, min(run.t.size, most)).astype(np.int64) for number, run in runs.items()}
    return {str(n): as_table(run.t[kept[n]], [values[kept[n]] for values in run.columns.values()]) for n, run in sorted(runs.items())}


def _numbers(study: Study, done: Sweep, name: str) -> Array:
    """A column as numbers; scenes by their indices."""
    values = done[name]
    if values.dtype == object:
        places = {scene.name: i for i, scene in enumerate(study.scenes)}
        return np.array([places[value] for value in values], dtype=float)
    return np.asarray(values, dtype=float)


def choose_runs(study: Study, done: Sweep, most: int) -> NDArray[np.int64]:
    """The numbers of the runs that a page shows, in order.

    All if it can; else those at the ends of each objective and on the Pareto front of each two, and evenly some of the others.
    """
    if study.runs <= most:
        return np.arange(study.runs)
    values = {o.name: _numbers(study, done, o.name) for o in study.objectives}
    always: set[int] = set()
    for number in values.values():
        order = np.argsort(number, kind="stable")[: int((~np.isnan(number)).sum())]
        always.update(map(int, [*order[:_EXTREME], *order[-_EXTREME:]]))
    for one, other in permutations(study.objectives, 2):
        if one.name < other.name:
            always.update(pareto_front([one, other], [values[one.name], values[other.name]]))
    certain = sorted(always)[:most]
    others = np.setdiff1d(np.arange(study.runs), certain)
    left = others[np.linspace(0, len(others) - 1, most - len(certain)).astype(np.int64)] if most > len(certain) else others[:0]
    return np.union1d(certain, left).astype(np.int64)


def runs_to_replay(study: Study, done: Sweep, most: int) -> dict[int, int | None]:
    """The best and the worst runs of each objective, up to ``most`` each, and as many failed ones; the best come first.
    A worst run is paired with the best run, for comparison on its page; a best run has none."""
    best: dict[int, int | None] = {}
    others: dict[int, int | None] = {}
    for objective in study.objectives:
        values = done[objective.name].astype("<f4")  # in the precision of a page
        order = np.argsort(-values if objective.goal == "larger" else values, kind="stable")[: int((~np.isnan(values)).sum())]
        best.update(dict.fromkeys(map(int, order[: min(most, 1)])))
        others.update(dict.fromkeys(map(int, order[:most])))
        others.update((int(run), int(order[0])) for run in order[: -most - 1 : -1])
    failed = np.flatnonzero(~np.isnan(done["failure_time"]))
    cannot_begin = Masses(study).faults(study.values[failed])
    began = [int(run) for i, run in enumerate(failed) if i not in cannot_begin]
    return {**best, **{run: beside for run, beside in others.items() if run not in best}, **dict.fromkeys(began[:most])}


def pareto_front(objectives: Sequence[Objective], values: Sequence[Array]) -> list[int]:
    """The runs on the Pareto front: no other run is better in one of two objectives without being worse in the other."""
    first, second = (v if o.goal == "smaller" else -v for o, v in zip(objectives, values, strict=True))
    order = np.lexsort((second, first))
    order = order[~np.isnan(first[order] + second[order])]
    least = np.minimum.accumulate(second[order]) if order.size else order
    on_front = np.concatenate([[True], second[order][1:] < least[:-1]]) if order.size else np.zeros(0, dtype=bool)
    return [int(run) for run in order[on_front]]


def _note(study: Study, shown: int, failed: int) -> str:
    words = [f"{study.runs} runs", ", ".join(scene.name for scene in study.scenes)]
    if shown < study.runs:
        words.append(f"shown are {shown}: the best, the worst, the Pareto fronts, and evenly some of the others")
    if failed:
        words.append(f"{failed} failed")
    return " · ".join(words)


def replay_runs(study: Study, runs: Mapping[int, int | None], folder: Path, done: Callable[[int], None]) -> dict[int, Replay]:
    """Write the pages of runs into a folder, each over that of the run that it names; returns them by their runs.  Runs that cannot be
    shown have none.  ``done`` receives how many runs there were. Raises ModelError, ToolchainError, OutputError: as of `replay`."""
    with naming_output(folder):
        folder.mkdir(parents=True, exist_ok=True)
    replays: dict[int, Replay] = {}
    for number, (run, beside) in enumerate(runs.items()):
        done(number)
        with suppress(RunError, SimulatorError):  # --replay says what it is
            ghost = read_page(replays[beside].page, "") if beside in replays else None
            replays[run] = replay(study, run, folder / f"run-{run}.html", ghost)
    return replays


def replay(study: Study, run: int, view: Path, ghost: GhostRun | None = None) -> Replay:
    """Write the page or glTF file of a run; a page shows another one (``ghost``) too.

    Raises:
        RunError: the study has no such run, or it has nothing to show.
        ModelError, ToolchainError, SimulatorError, OutputError: as of `simulate` and `write_view`.
    """
    if not 0 <= run < study.runs:
        raise RunError(f"--replay {run}: the study has no such run; its runs are 0 to {study.runs - 1}")
    scene, values = study.scene_of(run), study.settings_of(run)
    kinds = {v.name: v.kind for v in study.variables}
    fixed = {kind: {name: sympy.Float(value, 17) for name, value in values.items() if kinds[name] is kind} for kind in Kind}
    scene = replace(
        scene, outputs=study.outputs, positions={**scene.positions, **fixed[Kind.POSITION]}, rates={**scene.rates, **fixed[Kind.RATE]}
    )
    parameters = {name: value for name, value in values.items() if kinds[name] in (Kind.PARAMETER, Kind.INPUT)}
    steps = choose_steps(scene, study.method, study.integrator)
    read = read_model(Path(study.file).parent / study.model.span.file, tunable=study.tunable)  # whose meshes are in the same folder
    model = in_scene(replace(read, code=study.model.code), scene)
    held = with_default_closure(scene, study.method, study.integrator)
    artifact = compile_scene(model, held, CompileOptions(method=study.method, flags=study.flags))
    done = simulate(
        artifact, parameters=parameters, integrator=steps.integrator, tolerance=steps.tolerance, events=steps.events, coordinates=True,
        error=False, check=False,
    )  # fmt: skip
    if done.failure is not None and not done.t.size:
        raise RunError(f"--replay {run}: it failed before its first row, so that there is nothing to show: {done.failure}")
    shown = show_run(artifact.topology.model, scene, study.method, parameters, done)
    write_shown(view, replace(shown, note=f"{shown.note}, run {run} of a sweep"), ghost=ghost)
    return Replay(page=view, run=done)
