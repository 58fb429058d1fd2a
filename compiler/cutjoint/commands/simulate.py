"""`cutjoint simulate`: a cached run imports no module that derives or compiles."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cutjoint.commands import options, table
from cutjoint.compile.prepared import PreparedRun, Request, find_cached_run
from cutjoint.methods import AUTO, DEFAULT_METHOD, INTEGRATORS, METHODS, Implementation, Loops, join_or
from cutjoint.package.errors import EquationsError, RunError, plural
from cutjoint.report import tables
from cutjoint.run.accuracy import run_accurately
from cutjoint.run.binary_tables import require_writer
from cutjoint.run.failures import describe_failure, describe_rest
from cutjoint.run.outputs import require_apart
from cutjoint.run.result_files import write_error
from cutjoint.run.results import Trajectory
from cutjoint.run.settings import Options
from cutjoint.run.simulator import watched
from cutjoint.run.simulator_run import SimulatorRun

if TYPE_CHECKING:
    from cutjoint.commands.preparing import FinishedRun
    from cutjoint.report.plots import Others


#: The method whose integrator takes over stiff runs.
IMPLICIT_METHOD = METHODS[DEFAULT_METHOD].alternatives[0]


@table.command("simulate")
def command(
    model: Path, scene: str | None, method: str | None, accuracy: float | None, targets: tuple[str, ...], tolerance: float | None,
    implementation: str, solver: str | None, integrator: str | None, events: str | None, precision: str, closure: str | None, loops: str,
    dt: float | None, end: float | None, iterations: int | None, tunable: tuple[str, ...], changes: tuple[str, ...], out: Path | None,
    steps: Path | None, error: bool, verbose: bool, plots: Path | None, compare: tuple[Path, ...], display: tuple[str, ...],
    view: Path | None, ghost_page: Path | None, functions: Path | None,
) -> None:  # fmt: skip
    """Compile MODEL when needed, run one scene, and write its outputs."""
    require_apart(
        {"the model": model, "the page of another run": ghost_page, **{f"the table {path}": path for path in compare}},
        tables={"--out": out, "--steps": steps}, plots=plots, documents=[("--view", view)],
    )  # fmt: skip
    if out is not None:
        require_writer(out)
    others = _read_others(compare, plots)
    _require_display(display, plots, view)
    parameters = options.read_parameters(changes)
    requested = Options(
        dt=dt, end=end, tolerance=tolerance, iterations=iterations, solver=solver, integrator=integrator, events=events, accuracy=accuracy,
        targets=options.read_parameters(targets, "--accuracy-of"), once=not error,
    )  # fmt: skip
    request = Request(
        model=model, scene=scene, method=method, closure=closure, tunable=tunable, implementation=implementation, precision=precision,
        loops=loops, functions=functions, options=requested,
    )  # fmt: skip
    if view is not None or ghost_page is not None:
        from cutjoint.commands.replay import require_replay

        require_replay(request, parameters, view, ghost_page)

    is_settled = method is not None or closure is not None

    def execute(prepared: PreparedRun, watch: Callable[[], None] = lambda: None) -> Trajectory:
        def follow(share: float) -> None:
            watch()
            progress(share)

        tell = partial(_report_slow_run, prepared.run, may_switch=prepared.run.is_free and not is_settled and options.is_watched())
        with options.progress_bar(f"running {prepared.compilation.scene}") as progress, watched(tell):
            plan = replace(prepared.run, with_coordinates=view is not None)
            return run_accurately(plan, out=out, steps=steps, progress=follow, estimate=error, allow_switch=method is None, advise=True)

    try:
        prepared, run, ran = _find_and_run(request, parameters, execute)
    except _SwitchMethod as slow:
        is_settled = True
        prepared, run, ran = _switch_method(request, parameters, execute, str(slow))
        request = replace(request, method=prepared.run.method)
    console = options.message_console(out, steps)
    if run.failure is None:
        with options.progress_bar("estimating the error") if error else nullcontext():
            if out is not None:
                write_error(out, run.error if error else None, prepared.compilation.implementation)
        size = f"{plural(len(run.columns), 'output')}, {plural(run.t.size, 'row')}"
        console.print(f"results: {size}, not written; --out FILE writes them" if out is None else f"results: {out}, {size}")
        if error:
            console.print(tables.error_facts(run.error))
    if elsewhere := tables.describe_output_times(prepared.run):
        console.print(elsewhere)
    if verbose:
        console.print(tables.facts(f"model {prepared.model}", prepared.counts))
        console.print(tables.run_facts(prepared.compilation, run))
    else:
        console.print_each(f"{name}: {value}" for name, value in tables.reported_facts(prepared.counts, prepared.compilation, run))
        console.print(tables.summary_line(prepared.compilation, run))
    if display:
        from cutjoint.run.display import unused_units

        if unused := unused_units(run.units.values(), display):
            console.print(f"--display: no output of this run has the quantity of {', '.join(unused)}")
    if plots is not None and run.t.size:
        from cutjoint.report.plots import plot_run

        title = f"{prepared.model}, {prepared.compilation.scene}"
        console.print(f"plots: {', '.join(map(str, plot_run(run, title, plots, prepared.plots, others, display or prepared.display)))}")
    if view is not None and run.t.size:
        from cutjoint.commands.replay import write_replay

        console.print(f"view: {write_replay(request, ran, view, ghost_page, parameters, prepared.run, run, display)}")
    if run.failure is not None:
        where = describe_failure(run.failure, prepared.compilation.scene, prepared.places, model, parameters)
        options.err.print(f"{where}; {describe_rest(run.table)}")
        raise SystemExit(1)
    if error and prepared.run.is_asked and prepared.run.goal is not None and not run.error.converged:
        most = [" ".join(filter(None, (f"{most:g}", run.error.units[name], "of", name))) for name, most in run.error.targets.items()]
        limits = f"may exceed {join_or(most)}" if most else f"of positions and angles may exceed {run.error.goal:g} m or rad"
        options.err.print(f"accuracy not reached: errors {limits}")
        raise SystemExit(1)


class _SwitchMethod(Exception):  # noqa: N818 -- no error
    """A run that takes long because stability limits its steps, while another method has an implicit integrator."""


def _report_slow_run(plan: SimulatorRun, slow: Mapping[str, Any], *, may_switch: bool) -> None:
    """Print how far a run has come in ten seconds, what limits its steps, and a remedy; or have it switch methods (``may_switch``)."""
    settings, steps = plan.run_file.settings, slow["steps"]
    words = f"after 10 s at t = {slow['time']:.4g} s of {plan.run_file.end:g} s, {steps} steps by {settings.integrator}"
    if slow.get("stiff_steps", 0) > tables.STIFF * steps:
        if may_switch:
            raise _SwitchMethod(f"{words}, limited by stability, not accuracy")
        words += f": limited by stability, not accuracy; use --method {IMPLICIT_METHOD}, whose integrator is implicit"
    elif INTEGRATORS[settings.integrator].adaptive:
        words += ": limited by the accuracy; a larger --accuracy needs fewer"
    else:
        words += f" of {settings.dt:g} s: a larger --dt needs fewer"
    options.err.print(words)


def _switch_method(
    request: Request, parameters: Mapping[str, float], execute: Callable[..., Trajectory], words: str
) -> tuple[PreparedRun, Trajectory, FinishedRun | None]:  # fmt: skip
    """The run by the method with an implicit integrator; the original run if that does not support the model, or fails."""
    options.err.print(f"{words}; switching to the method {IMPLICIT_METHOD}")
    try:
        prepared, run, ran = _find_and_run(replace(request, method=IMPLICIT_METHOD), parameters, execute)
        reason = "" if run.failure is None else str(run.failure)
    except (EquationsError, RunError) as error:
        reason = str(error)
    if not reason:
        return prepared, replace(run, fallback=f"the method {IMPLICIT_METHOD}, {words}"), ran
    options.err.print(f"{IMPLICIT_METHOD}: {reason}; continuing with {DEFAULT_METHOD}")
    return _find_and_run(request, parameters, execute)


def _find_and_run(
    request: Request, parameters: Mapping[str, float], execute: Callable[..., Trajectory]
) -> tuple[PreparedRun, Trajectory, FinishedRun | None]:  # fmt: skip
    prepared = find_cached_run(request, parameters)
    run = None if prepared is None else execute(prepared)
    if prepared is None or run is None or (run.failure is not None and run.failure.guards):
        from cutjoint.commands.preparing import FinishedRun, assemble_and_run, prepare_and_run, read_request

        model, scene, method = read_request(request)
        has_functions = method != AUTO and METHODS[method].functions and request.implementation != Implementation.GENERIC
        if scene.numerics.loops == Loops.EMBEDDED and has_functions:
            return assemble_and_run(request, model, scene, method, parameters, execute)
        if method != AUTO:
            return *prepare_and_run(request, model, scene, method, parameters, execute), FinishedRun(model, scene, method, parameters)
        from cutjoint.commands.picking import pick_and_run

        return pick_and_run(request, model, scene, parameters, execute)
    return prepared, run, None


def _read_others(compare: tuple[Path, ...], plots: Path | None) -> Others:
    """The tables of other runs, which the plots show too."""
    if not compare:
        return {}
    if plots is None:
        raise RunError("--compare: its runs are drawn in plots; add --plots FOLDER")
    from cutjoint.report.plots import read_others

    return read_others(compare)


def _require_display(display: tuple[str, ...], plots: Path | None, view: Path | None) -> None:
    if not display:
        return
    if plots is None and view is None:
        raise RunError("--display: plots and pages have these units; add --plots FOLDER or --view FILE")
    from cutjoint.run.display import read_units

    read_units(display)
