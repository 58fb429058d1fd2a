"""`cutjoint simulate` with method auto, which runs its candidates; imported only on demand."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from cutjoint.commands import options
from cutjoint.commands.preparing import Execute, FinishedRun, compile_request, prepare
from cutjoint.compile.prepared import PreparedRun, Request
from cutjoint.methods import AUTO, DEFAULT_PRECISION, Implementation, Loops
from cutjoint.model.records import Model, Scene
from cutjoint.package.errors import RunError
from cutjoint.reduce.choose import FULL, Candidate, choose, chosen_model
from cutjoint.report.tasks import choice_tables
from cutjoint.run.inputs import with_constant_inputs
from cutjoint.run.results import Trajectory
from cutjoint.run.scenes import with_loops
from cutjoint.run.settings import Options, accuracy_of, require_settings


def pick_and_run(
    request: Request, model: Model, scene: Scene, parameters: Mapping[str, float], execute: Execute
) -> tuple[PreparedRun, Trajectory, FinishedRun]:  # fmt: skip
    """Let method auto choose model, scene, method and steps."""
    requested = request.options
    require_settings(end=requested.end)
    scene = scene if requested.end is None else replace(scene, end=requested.end)
    scene, parameters = with_constant_inputs(model, scene, parameters)
    _require_free_choice(
        implementation=request.implementation, solver=requested.solver, integrator=requested.integrator, events=requested.events,
        precision=request.precision, dt=requested.dt, iterations=requested.iterations,
        loops=request.loops, **{"accuracy-of": requested.targets or None},
    )  # fmt: skip
    chosen, reduced, settings = _pick(model, scene, _accuracy(requested), parameters)
    ran = FinishedRun(reduced, settings, chosen.method, parameters, chosen.variant)
    prepared, run = _execute(request, ran, execute)
    if run.failure is not None and run.failure.guards and scene.on_violation == "restart":
        options.err.print(f"{run.failure}; repeated with the full model")
        full = with_loops(replace(scene, numerics=settings.numerics), Loops.EXACT)
        ran = FinishedRun(model, full, chosen.method, parameters, FULL)
        prepared, run = _execute(request, ran, execute)
    return prepared, run, ran


def _execute(request: Request, ran: FinishedRun, execute: Execute) -> tuple[PreparedRun, Trajectory]:
    prepared = prepare(compile_request(request, ran.model, ran.scene, ran.method), Options(), ran.parameters)
    return prepared, execute(prepared)


def _accuracy(requested: Options) -> float | None:
    """The requested accuracy; method auto has no other tolerance, and earlier versions called it so."""
    if requested.tolerance is None or requested.accuracy is not None:
        return requested.accuracy
    options.err.print(f"method auto has no solver tolerance; taken as --accuracy {requested.tolerance:g}")
    return requested.tolerance


def _pick(model: Model, scene: Scene, accuracy: float | None, parameters: Mapping[str, float]) -> tuple[Candidate, Model, Scene]:
    """The model, scene and method that method auto chooses; it prints its choice and the reason."""
    wanted = replace(scene, method=AUTO, accuracy=None if scene.targets else accuracy or accuracy_of(scene))
    with options.progress_bar("choosing method and steps for the accuracy"):
        choice = choose(model, wanted, parameters=parameters)
    options.out.print_each(choice_tables(choice, wanted))
    return choice.chosen, *chosen_model(choice)


def _require_free_choice(**requested: Any) -> None:
    """Check that no option sets what method auto chooses."""
    usual = {"implementation": (AUTO, Implementation.GENERATED), "precision": (DEFAULT_PRECISION,)}
    for name in (name for name, value in requested.items() if value not in usual.get(name, (None,))):
        raise RunError(f"--{name} cannot be combined with method auto, which chooses it; use --method")
