"""`cutjoint simulate --batch`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from cutjoint.commands import options
from cutjoint.commands.preparing import read_request, require_own
from cutjoint.compile.prepared import Request
from cutjoint.methods import INTEGRATORS, METHODS, Events, names_of
from cutjoint.model.records import Model, Scene
from cutjoint.report.tables import batch_facts
from cutjoint.run.cases import read_cases
from cutjoint.run.errors import RunError
from cutjoint.run.failures import count_failures, describe_failures
from cutjoint.run.options import Options
from cutjoint.run.results import Batch
from cutjoint.run.settings import with_options
from cutjoint.tasks.batch import compile_scene_batch, simulate_batch


def run_batch(
    request: Request, parameters: Mapping[str, float], table: Path | None, *, threads: int | None, out: Path, steps: Path | None,
    plots: Path | None,
) -> None:  # fmt: skip
    """Run a scene once for each row of a ``table`` of parameters: their results into ``out``, and what became of them.

    Raises:
        RunError: there is no table, or what is asked for does not go with one.
        SystemExit: some of the runs failed; a message says so.
    """
    model, scene, method = read_request(request)
    if table is None:
        raise RunError("--threads goes with --batch: a single run has one")
    asked = request.options
    require_own(
        "--batch", "runs the method recursive by the trapezoidal rule", implementation=request.implementation, solver=asked.solver,
        precision=request.precision, iterations=asked.iterations,
        integrator=None if asked.integrator in names_of(INTEGRATORS, lambda i: i.batch) else asked.integrator,
        events=None if asked.events == Events.CROSSED else asked.events,
        method=None if method in names_of(METHODS, lambda m: m.batch) else method, steps=steps, plots=plots,
    )  # fmt: skip
    numerics = scene.numerics
    numerics = replace(numerics, integrator=asked.integrator or numerics.integrator, events=asked.events or numerics.events)
    scene = with_options(replace(scene, numerics=numerics), method, Options(dt=asked.dt))
    done = _run(asked, model, scene, parameters, _cases(table, model, parameters), threads, out)
    _report_failures(done, table, out)


def _cases(table: Path, model: Model, parameters: Mapping[str, float]) -> list[dict[str, float]]:
    """The cases of a table, which sets none of ``parameters``."""
    cases = read_cases(table, model)
    if twice := sorted(cases[0].keys() & parameters.keys()):
        raise RunError(f"--set {twice[0]}: the table {table} has it too; set it in one of the two")
    return cases


def _run(
    asked: Options, model: Model, scene: Scene, parameters: Mapping[str, float], cases: list[dict[str, float]], threads: int | None,
    out: Path,
) -> Batch:  # fmt: skip
    with options.progress_bar(f"compiling {model.name}"):
        artifact = compile_scene_batch(model, scene)
    with options.progress_bar(f"running {scene.name}") as progress:
        done = simulate_batch(
            artifact, [{**parameters, **case} for case in cases], dt=asked.dt, end=asked.end, tolerance=asked.tolerance,
            threads=threads, out=out, progress=progress, check=False,
        )  # fmt: skip
    console = options.console_beside(out)
    console.print(batch_facts(artifact, done))
    console.print(f"results: {out}, {len(cases)} runs", markup=False)
    return done


def _report_failures(done: Batch, table: Path, out: Path) -> None:
    for failure in describe_failures(done):
        options.err.print(f"{table}: {failure}", markup=False)
    if failed := count_failures(done):
        options.err.print(f"{failed}; column 'run.failure' of {out} says how", markup=False)
        raise SystemExit(1)
