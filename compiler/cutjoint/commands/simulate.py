"""`cutjoint simulate`: a cached run imports no module that derives or compiles."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cutjoint.commands import options
from cutjoint.compile.prepared import PreparedRun, Request, find_cached_run
from cutjoint.methods import (
    AUTO,
    CLOSURES,
    DEFAULT_PRECISION,
    INTEGRATORS,
    METHODS,
    PRECISIONS,
    SOLVERS,
    Events,
    Implementation,
    names_of,
)
from cutjoint.report import tables
from cutjoint.run.accuracy import run_accurately
from cutjoint.run.failures import describe_failure, describe_rest
from cutjoint.run.options import Options
from cutjoint.run.outputs import require_apart
from cutjoint.run.result_files import write_error
from cutjoint.run.results import Trajectory

if TYPE_CHECKING:
    from cutjoint.commands.preparing import FinishedRun


@click.command("simulate")
@options.model
@options.scene
@click.option("--method", type=click.Choice([AUTO, *METHODS]), help="Formulation, or auto to pick one that keeps the tolerance; "
              "by default the scene's, else recursive.")
@click.option("--tolerance", type=options.Setting("tolerance"), help="Of method auto in m and rad, of a step of "
              "dormand-prince and sdirk4 relative and absolute, else of the iteration in a step; the scene's otherwise.")
@click.option("--implementation", type=click.Choice([AUTO, *(x.value for x in Implementation)]), default=AUTO, show_default=True,
              envvar="CUTJOINT_IMPLEMENTATION", help="Code made for the model; the same program interpreted, for which nothing is "
              "compiled; or a generic simulator of cutjoint-bench, whose equations are written by hand. auto is generated, but on a "
              "terminal interpreted where compiling takes more than 2 s, until compiled code is there. $CUTJOINT_IMPLEMENTATION says it "
              "for all runs.")
@click.option("--solver", type=click.Choice(list(SOLVERS)),
              help="Linear solver of the Lagrangian methods, by default emitted, of the generic twin a library's; "
              "cholmod, klu and umfpack are for comparison.")
@click.option("--integrator", type=click.Choice(names_of(INTEGRATORS, lambda i: i.in_files)),
              help="rk4 and dormand-prince take the method recursive, sdirk4 and generalised-alpha recursive-newton; by default "
              "the scene's, else trapezoidal where dt is given, and otherwise the method's own with steps that follow from the accuracy.")
@click.option("--events", type=click.Choice([x.value for x in Events]),
              help="Whether steps of recursive and recursive-newton end where forces change their formulas; the scene's otherwise, else "
              "crossed by trapezoidal and generalised-alpha, located by the others.")
@click.option("--precision", type=click.Choice(list(PRECISIONS)), default=DEFAULT_PRECISION, show_default=True,
              help="Number type of the run.")
@click.option("--closure", type=click.Choice(list(CLOSURES)),
              help="How the recursive method holds its cut joints; the scene's otherwise.")
@options.dt
@options.end
@options.iterations
@options.opened
@options.changes
@click.option("--batch", type=click.Path(exists=True, dir_okay=False, path_type=Path),
              help="CSV file of parameters and constant inputs, a row for each run (SI units): many runs side by side; --out has a row for "
              "each, with end, smallest and largest value of each output over the scene's rows.")
@click.option("--threads", type=options.Setting("threads"), help="Of a batch; as many as processors otherwise.")
@click.option("--with", "controller", type=click.Path(exists=True, dir_okay=False, path_type=Path),
              help="Co-simulation FMU that runs beside the model: its outputs drive the inputs of the same names, and it reads outputs.")
@click.option("--connect", "connections", metavar="PORT=NAME", multiple=True,
              help="Of --with: an input or output of the FMU, and the output or input of the model that it belongs to, where names differ.")
@click.option("--communication-step", "communication", type=options.Setting("dt"),
              help="Of --with: time in s between exchanges of values; that of the FMU's default experiment otherwise.")
@click.option("--call-limit", "limit", type=options.Setting("dt"),
              help="Of --with: time in s that a call of the FMU may take; 60 s otherwise.")
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), required=True, help="CSV file; units go beside it.")
@click.option("--steps", type=click.Path(dir_okay=False, path_type=Path), help="CSV file for iterations and residuals of each step.")
@click.option("--error/--no-error", default=True,
              help="Whether other runs show how wrong this one is: of those that have converged, one in 200 at most is off by more than "
              "three times as much. Without, steps have one tolerance.")
@click.option("--plots", type=click.Path(file_okay=False, path_type=Path), help="Folder for plots of the run.")
@options.view("that replays the run in a browser")
@click.option("--over", type=click.Path(exists=True, dir_okay=False, path_type=Path),
              help="Page of another run, of this or another model, which the page of --view then has as a ghost.")
@options.reports_errors
def command(
    model: Path, scene: str | None, method: str | None, tolerance: float | None, implementation: str, solver: str | None,
    integrator: str | None, events: str | None, precision: str, closure: str | None, dt: float | None, end: float | None,
    iterations: int | None, opened: tuple[str, ...], changes: tuple[str, ...], batch: Path | None, threads: int | None,
    controller: Path | None, connections: tuple[str, ...], communication: float | None, limit: float | None, out: Path, steps: Path | None,
    error: bool, plots: Path | None, view: Path | None, over: Path | None,
) -> None:  # fmt: skip
    """Compile MODEL when needed, run one scene, and write its outputs."""
    require_apart(
        {"the model": model, "the table of parameters": batch, "the page of another run": over, "the FMU": controller},
        tables={"--out": out, "--steps": steps}, plots=plots, documents=[("--view", view)],
    )  # fmt: skip
    parameters = options.read_parameters(changes)
    asked = Options(
        dt=dt, end=end, tolerance=tolerance, iterations=iterations, solver=solver, integrator=integrator, events=events
    )  # fmt: skip
    request = Request(
        model=model, scene=scene, method=method, closure=closure, opened=opened, implementation=implementation, precision=precision,
        options=asked,
    )  # fmt: skip
    if controller is not None or connections or communication is not None or limit is not None:
        from cutjoint.commands.coupled import Coupled, run_coupled

        coupled = Coupled(path=controller, connections=connections, step=communication, limit=limit)
        beside = {"batch": batch, "threads": threads, "steps": steps, "view": view, "over": over}
        run_coupled(request, parameters, coupled, beside, out=out, error=error, plots=plots)
        return
    if view is not None or over is not None:
        from cutjoint.commands.replaying import require_replay

        require_replay(request, parameters, view, over, batch)
    if batch is not None or threads is not None:
        from cutjoint.commands.batches import run_batch

        run_batch(request, parameters, batch, threads=threads, out=out, steps=steps, plots=plots)
        return

    def play(prepared: PreparedRun, watch: Callable[[], None] = lambda: None) -> Trajectory:
        def follow(share: float) -> None:
            watch()
            progress(share)

        with options.progress_bar(f"running {prepared.compilation.scene}") as progress:
            plan = replace(prepared.run, with_coordinates=view is not None)
            return run_accurately(plan, out=out, steps=steps, progress=follow, estimate=error, go_over=method is None, advise=True)

    prepared = find_cached_run(request, parameters)
    if prepared is not None:
        run, played = play(prepared), None
    else:
        prepared, run, played = _derive_and_play(request, parameters, play)
    console = options.console_beside(out, steps)
    console.print(tables.facts(f"model {prepared.model}", prepared.counts))
    console.print(tables.run_facts(prepared.compilation, run))
    if elsewhere := tables.rows_elsewhere(prepared.run):
        console.print(elsewhere, markup=False)
    if run.failure is None:
        if error:
            console.print(tables.error_facts(run.error))
        write_error(out, run.error if error else None, prepared.compilation.implementation)
        console.print(f"results: {out}, {len(run.columns)} columns, {run.t.size} rows", markup=False)
    if plots is not None:
        console.print(f"plots: {', '.join(str(p) for p in _plot(prepared, run, plots))}", markup=False)
    if view is not None and run.t.size:
        from cutjoint.commands.replaying import write_replay

        console.print(f"view: {write_replay(request, played, view, over, parameters, prepared.run, run)}", markup=False)
    if run.failure is not None:
        where = describe_failure(run.failure, prepared.compilation.scene, prepared.places, model, parameters)
        options.err.print(f"{where}; {describe_rest(run.table)}", markup=False)
        raise SystemExit(1)


def _derive_and_play(
    request: Request, parameters: Mapping[str, float], play: Callable[..., Trajectory]
) -> tuple[PreparedRun, Trajectory, FinishedRun]:  # fmt: skip
    """Compile the model, or let method auto measure what to compile."""
    from cutjoint.commands.preparing import FinishedRun, prepare_and_play, read_request

    model, scene, method = read_request(request)
    if method != AUTO:
        return *prepare_and_play(request, model, scene, method, parameters, play), FinishedRun(model, scene, method, parameters)
    from cutjoint.commands.picking import pick_and_play

    return pick_and_play(request, model, scene, parameters, play)


def _plot(prepared: PreparedRun, run: Trajectory, folder: Path) -> list[Path]:
    from cutjoint.report.plots import plot_run

    return plot_run(run, f"{prepared.model}, {prepared.compilation.scene}", folder)
