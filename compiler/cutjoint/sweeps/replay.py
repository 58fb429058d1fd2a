"""Runs of a sweep once more, by the simulator of the command line, to be seen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import sympy

from cutjoint.compile.folders import choose_steps
from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.package.errors import RunError
from cutjoint.run.result_files import naming_output
from cutjoint.run.scenes import held_as_usual, in_scene
from cutjoint.run.simulation import simulate
from cutjoint.run.simulator import SimulatorError
from cutjoint.sweeps.records import Kind, Study
from cutjoint.topology.reading import read_model
from cutjoint.view.views import show_run, write_shown


def replay_runs(study: Study, runs: Sequence[int], folder: Path, done: Callable[[int], None]) -> dict[int, Path]:
    """Write the pages of runs into a folder; returns them by their runs.  Runs that cannot be shown have none.  ``done`` is told how
    many runs there were.

    Raises:
        ModelError, ToolchainError, OutputError: as of `replay`.
    """
    with naming_output(folder):
        folder.mkdir(parents=True, exist_ok=True)
    pages = {}
    for number, run in enumerate(runs):
        done(number)
        with suppress(RunError, SimulatorError):  # --replay says what it is
            pages[run] = replay(study, run, folder / f"run-{run}.html")
    return pages


def replay(study: Study, run: int, view: Path) -> Path:
    """Write the page or glTF file of a run.

    Raises:
        RunError: the study has no such run, or it has nothing to show.
        ModelError, ToolchainError, SimulatorError, OutputError: as of `simulate` and `write_view`.
    """
    if not 0 <= run < study.runs:
        raise RunError(f"--replay {run}: the study has no such run; its runs are 0 to {study.runs - 1}")
    scene, values = study.scene_of(run), study.settings_of(run)
    kinds = {v.name: v.kind for v in study.variables}
    given = {kind: {name: sympy.Float(value, 17) for name, value in values.items() if kinds[name] is kind} for kind in Kind}
    scene = replace(
        scene, outputs=study.outputs, positions={**scene.positions, **given[Kind.POSITION]}, rates={**scene.rates, **given[Kind.RATE]}
    )
    parameters = {name: value for name, value in values.items() if kinds[name] in (Kind.PARAMETER, Kind.INPUT)}
    steps = choose_steps(scene, study.method, study.integrator)
    read = read_model(Path(study.file).parent / study.model.span.file, opened=study.opened)  # whose meshes are beside it
    model = in_scene(replace(read, code=study.model.code), scene)
    held = held_as_usual(scene, study.method, study.integrator)
    artifact = compile_scene(model, held, CompileOptions(method=study.method, flags=study.flags))
    done = simulate(
        artifact, parameters=parameters,
        integrator=steps.integrator, tolerance=steps.tolerance, events=steps.events, coordinates=True, error=False, check=False,
    )  # fmt: skip
    if done.failure is not None and not done.t.size:
        raise RunError(f"--replay {run}: it failed before its first row, so that there is nothing to show: {done.failure}")
    shown = show_run(artifact.topology.model, scene, study.method, parameters, done)
    return write_shown(view, replace(shown, note=f"{shown.note}, run {run} of a sweep"))
