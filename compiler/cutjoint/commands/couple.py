"""`cutjoint couple`."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from cutjoint.commands import options, table
from cutjoint.commands.preparing import read_request
from cutjoint.compile.prepared import Request
from cutjoint.coupling.connections import connect, open_system
from cutjoint.coupling.controller import CALL_LIMIT, ControllerFmu, open_controller
from cutjoint.coupling.run import Participant, Plan, co_simulate
from cutjoint.formulate.inputs import input_parameters, tunable_parameters
from cutjoint.methods import DEFAULT_INTEGRATOR, INTEGRATORS, Implementation, describe_steps, join_or, names_of
from cutjoint.model.errors import nearest
from cutjoint.model.records import Model, Scene
from cutjoint.package.errors import RunError, plural
from cutjoint.report import tables
from cutjoint.run.inputs import require_unit
from cutjoint.run.outputs import require_apart
from cutjoint.run.result_files import write_error
from cutjoint.run.results import Trajectory
from cutjoint.run.settings import Options, require_settings, with_options
from cutjoint.stepping.handle import SimulationError
from cutjoint.stepping.load import load_scene
from cutjoint.stepping.simulation import Simulation


@table.command("couple")
def command(
    model: Path, fmus: tuple[Path, ...], scene: str | None, connections: tuple[str, ...], communication: float | None, limit: float | None,
    method: str | None, tolerance: float | None, integrator: str | None, events: str | None, dt: float | None, end: float | None,
    iterations: int | None, tunable: tuple[str, ...], changes: tuple[str, ...], out: Path, error: bool, plots: Path | None,
    view: Path | None, functions: Path | None,
) -> None:  # fmt: skip
    """Run one scene of MODEL with FMUs for co-simulation, or with a system of them (.ssp).

    Outputs of the FMUs drive the inputs of the same names; inputs of the FMUs read the outputs of the scene."""
    read_files = {"the model": model, **{"the FMU" if len(fmus) == 1 else f"the FMU {fmu}": fmu for fmu in fmus}}
    require_apart(read_files, tables={"--out": out}, plots=plots, documents=[("--view", view)])
    parameters = options.read_parameters(changes)
    requested = Options(dt=dt, end=end, tolerance=tolerance, iterations=iterations, integrator=integrator, events=events)
    read, chosen, by = read_request(Request(model=model, scene=scene, method=method, tunable=tunable, functions=functions))
    with ExitStack() as opened_fmus:
        system = opened_fmus.enter_context(open_system(fmus, _named(connections), read.name))
        seconds = CALL_LIMIT if limit is None else limit
        controllers = [opened_fmus.enter_context(open_controller(fmu, seconds)) for fmu in system.fmus]
        connected = connect(controllers, read, chosen, system.named, is_whole=system.is_whole)
        pairs = zip(controllers, connected, strict=True)
        parties = [Participant(fmu=fmu, connections=ports, step=_step(fmu, communication)) for fmu, ports in pairs]
        plan = _plan(requested, read, chosen, by, parameters, parties)
        try:
            with options.progress_bar(f"running {chosen.name}") as progress:
                run = co_simulate(plan, out=out, progress=progress, estimate=error)
        except SimulationError as failure:
            options.err.print(f"{model}: scene '{chosen.name}': {options.describe_error(failure)}")
            raise SystemExit(1) from None
        _report(plan, read, chosen, run, out, error)
        faults = [fault for fmu in controllers if (fault := fmu.fault)]
    if view is not None:
        from cutjoint.view.views import show_run, write_shown

        shown = show_run(read, replace(chosen, end=plan.end), by, parameters, run)
        options.message_console(out).print(f"view: {write_shown(view, shown)}")
    if plots is not None:
        from cutjoint.report.plots import plot_run

        pictures = plot_run(run, f"{read.name}, {chosen.name}", plots, chosen.plots, display=read.display)
        options.message_console(out).print(f"plots: {', '.join(map(str, pictures))}")
    if faults:
        options.err.print("\n".join(f"{fault}; the table is whole" for fault in faults))
        raise SystemExit(1)


def _plan(
    requested: Options, model: Model, scene: Scene, method: str, parameters: Mapping[str, float], parties: Sequence[Participant]
) -> Plan:  # fmt: skip
    require_settings(dt=requested.dt, end=requested.end, tolerance=requested.tolerance, iterations=requested.iterations)
    _require_free(model, parameters, parties)
    if not scene.outputs:
        raise RunError(f"{scene.span}: scene '{scene.name}' has no outputs; a table needs some")
    with options.progress_bar(f"compiling {model.name}"):
        simulation = _load(model, scene, method, requested)
    settings, steps = simulation.library.settings, simulation.library.steps
    if requested.tolerance is not None and not steps.adaptive:
        able = join_or(names_of(INTEGRATORS, lambda i: i.adaptive))
        raise RunError(f"--solver-tolerance: beside an FMU only {able} has one; use it, or --dt")
    if requested.iterations is not None and not steps.is_iterated:
        raise RunError(f"--iterations: only {describe_steps(lambda s: s.is_iterated)} has them")
    return Plan(
        simulation=simulation, parties=tuple(parties), end=scene.end if requested.end is None else requested.end,
        output_step=scene.output_step, iterations=requested.iterations, parameters=parameters,
        dt=settings.step if requested.dt is None else requested.dt,
        tolerance=(settings.tolerance if requested.tolerance is None else requested.tolerance) if steps.adaptive else None,
    )  # fmt: skip


def _step(fmu: ControllerFmu, communication: float | None) -> float:
    step = communication or fmu.default_step
    if step is None or not step > 0:
        raise RunError(f"{fmu.path}: the FMU has no default step size; set --communication-step")
    return step


def _load(model: Model, scene: Scene, method: str, requested: Options) -> Simulation:
    """The simulation with the integrator and the events of a run by the same options."""
    integrator = DEFAULT_INTEGRATOR if requested.integrator is None and requested.iterations is not None else requested.integrator
    scene = with_options(scene, method, Options(dt=requested.dt))
    numerics = replace(scene.numerics, events=requested.events or scene.numerics.events)
    return load_scene(model, replace(scene, numerics=numerics), method=method, integrator=integrator)


def _named(connections: tuple[str, ...]) -> dict[str, str]:
    """The names in the model by ports; names of the model have no equals sign, those of ports may."""
    named: dict[str, str] = {}
    for connection in connections:
        port, _, name = connection.rpartition("=")
        if not port or not name:
            raise RunError(f"--connect {connection}: write PORT=NAME")
        if named.setdefault(port, name) != name:
            raise RunError(f"--connect {connection}: '{port}' is connected with '{named[port]}'; write one of the two")
    return named


def _require_free(model: Model, parameters: Mapping[str, float], parties: Sequence[Participant]) -> None:
    known = {p.name: p for p in (*tunable_parameters(model), *input_parameters(model))}
    for name, value in parameters.items():
        if name not in known:
            raise RunError(f"--set {name}: model '{model.name}' has no such tunable parameter or input; {nearest(name, known, 'it has')}")
        for fmu, driven in ((participant.fmu, participant.connections.driven) for participant in parties):
            if name in driven:
                raise RunError(f"--set {name}: output '{driven[name].name}' of {fmu.path} drives this input; leave out one of the two")
        require_unit(known[name], value)


def _report(plan: Plan, model: Model, scene: Scene, run: Trajectory, out: Path, error: bool) -> None:
    console = options.message_console(out)
    beside = ", ".join(f"{participant.fmu.path.name}, FMI {participant.fmu.version}" for participant in plan.parties)
    console.print(tables.facts(f"scene {scene.name} with {beside}", _facts(plan, model, run)))
    if error:
        console.print(tables.error_facts(run.error))
    write_error(out, run.error if error else None, Implementation.GENERATED)
    console.print(f"results: {out}, {plural(len(run.columns), 'output')}, {plural(run.t.size, 'row')}")


def _facts(plan: Plan, model: Model, run: Trajectory) -> list[tuple[str, str]]:
    driven = {name for participant in plan.parties for name in participant.connections.driven}
    left = ", ".join(p.name for p in input_parameters(model) if p.name not in driven)
    return [
        *(fact for participant in plan.parties for fact in _facts_of(participant, plan)), *([("follow the scene", left)] if left else []),
        ("run", f"{run.seconds:.4f} s for {plan.end:g} s: {tables.real_time(plan.end, run.seconds)}"),
    ]  # fmt: skip


def _facts_of(participant: Participant, plan: Plan) -> list[tuple[str, str]]:
    connected, which = participant.connections, f" {participant.fmu.path.name}" if len(plan.parties) > 1 else ""
    from_others = [f"{plan.parties[i].fmu.path.stem}:{source.name} as {sink.name}" for i, source, sink in connected.passed]
    read = [*(f"{name} as {port.name}" for name, port in connected.read), *from_others]
    return [
        (f"communication{which}", f"{int(plan.end / participant.step + 1e-6)} steps of {participant.step:g} s"),
        *([("driven", ", ".join(f"{name} by {port.name}" for name, port in connected.driven.items()))] if connected.driven else []),
        *([("read", ", ".join(read))] if read else []),
        *([("stay at their start", f"{', '.join(connected.constant)} of the FMU{which}")] if connected.constant else []),
    ]  # fmt: skip
