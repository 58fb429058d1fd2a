"""The settings of a run: options of the caller, the scene, the method and the integrator, merged and checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import ceil
from typing import TYPE_CHECKING

from cutjoint.methods import (
    CLOSURES,
    DEFAULT_INTEGRATOR,
    DEFAULT_SOLVER,
    IMPLEMENTATIONS,
    INTEGRATORS,
    METHODS,
    START,
    Closure,
    Events,
    Implementation,
    Integrator,
    Method,
    join_and,
    join_or,
    names_of,
)
from cutjoint.model.ranges import MOST_STEPS, SOLVER_TOLERANCE, fault_of_setting
from cutjoint.package.errors import RunError
from cutjoint.run.record import Settings, Stabilisation
from cutjoint.run.scenes import with_settings

if TYPE_CHECKING:
    from cutjoint.model.records import Numerics, Scene

#: Default target error of positions and angles (m, rad), if the scene gives none.
GOAL = 1e-4

#: Tolerances of steps without refinement: for the default goal, and the smallest.
_USUAL_TOLERANCE, _LEAST_TOLERANCE = 1e-7, 1e-11

#: The largest rounding error of the number of steps in a sample interval.
_WHOLE = 1e-6


@dataclass(frozen=True, kw_only=True)
class StepSettings:
    """The steps of a host: ``integrator``, ``step`` (s, the longest of adaptive ones), ``tolerance``, and whether steps end at ``events``.
    """

    integrator: str
    step: float
    tolerance: float
    events: bool

    @classmethod
    def of(cls, settings: Settings) -> StepSettings:
        """The steps of a run's settings."""
        return cls(integrator=settings.integrator, step=settings.dt, tolerance=settings.tolerance, events=bool(settings.events))

    def __str__(self) -> str:
        length = "of at most" if INTEGRATORS[self.integrator].adaptive else "of"
        return f"{self.integrator}, steps {length} {self.step:g} s, tolerance {self.tolerance:g}"


def require_settings(**requested: float | None) -> None:
    """Check settings that a caller gives; None stands for those that are not given.
    Raises RunError: one of them is not finite, or no run has it."""
    for name, value in requested.items():
        if value is not None and (fault := fault_of_setting(name, value)):
            raise RunError(f"{SOLVER_TOLERANCE if name == 'tolerance' else name}: {fault}")


def with_options(scene: Scene, method: str, options: Options, *, has_rows: bool = True) -> Scene:
    """The scene with the times, the penalty and the tolerance that a caller gives for a method.

    Of a run that ``has_rows`` the scene's own steps fit into these; a ``dt`` of the caller stays. Raises RunError: no run has one of them.
    """
    own = {"dt": options.dt, "penalty": options.penalty, "tolerance": options.tolerance}
    require_settings(**own, end=options.end, iterations=options.iterations)
    if has_rows and options.dt is None:
        own["dt"] = _fitting(scene, scene.numerics.of_method(method).dt)
    changed = with_settings(scene, method, {name: value for name, value in own.items() if value is not None})
    return changed if options.end is None else replace(changed, end=options.end)


def _fitting(scene: Scene, dt: float | None) -> float | None:
    """The largest step up to ``dt`` (s) that divides the sample interval; None if ``dt`` divides it or is longer."""
    row = min(scene.output_step, scene.end or scene.output_step)
    if dt is None or not 1 < row / dt < MOST_STEPS or abs(row / dt - round(row / dt)) <= _WHOLE:
        return None
    return row / ceil(row / dt)


def find_settings(scene: Scene, method: Method, implementation: Implementation, options: Options) -> Settings:
    """The settings of a run of a scene (`with_options`) by a method; settings of the caller come before settings of the scene.
    Raises RunError: what is asked for does not go together, or a setting is out of its range."""
    numerics, closure = scene.numerics, find_closure(scene.numerics, method, implementation)
    integrator = find_integrator(numerics, method, implementation, options)
    events = find_events(numerics, method, implementation, integrator, options.events)
    if options.iterations is not None:
        _require_fixed_cost(method, integrator, closure, events)
    chosen, start, own = numerics.of_method(method.name), numerics.of_method(START), numerics.methods.get(method.name, {})
    updates = own.get("multiplier_updates", chosen.multiplier_updates if method.default_updates is None else method.default_updates)
    # as a share of 1 (m, rad, m/s, rad/s) the relative one, if none is given
    absolute = chosen.tolerance if chosen.absolute_tolerance is None else chosen.absolute_tolerance
    settings = Settings(
        integrator=integrator.name, solver=_solver(method, implementation, options.solver) if integrator.uses_solver else None,
        dt=_step(scene, chosen.dt, integrator), tolerance=chosen.tolerance,
        penalty=chosen.penalty if closure.penalty_of_each_cut else _penalty(numerics, method, integrator),
        iterations=chosen.iterations if options.iterations is None else options.iterations, fixed_cost=options.iterations is not None,
        multiplier_updates=int(updates), events=events,
        absolute_tolerance=absolute if "absolute_tolerance" in integrator.settings else None,
        spectral_radius=chosen.spectral_radius if "spectral_radius" in integrator.settings else None,
        stabilisation=Stabilisation(
            closure=closure.name, penalty=start.penalty, damping_ratio=start.damping_ratio, frequency=start.frequency
        ),
    )  # fmt: skip
    _require_ranges(scene, settings)
    return settings


def find_integrator(numerics: Numerics, method: Method, implementation: Implementation, options: Options) -> Integrator:
    """The integrator of a run; a scene's is meant for the methods that it takes, others have the method's own.
    Raises RunError: there is none of the name, it does not take the method, or it does not hold the scene's cut joints."""
    requested = options.integrator
    wanted = numerics.integrator if requested is None else requested
    if wanted is None:
        return _own_integrator(numerics, method, implementation, options)
    if wanted not in INTEGRATORS.names():
        raise RunError(f"no integrator '{wanted}'; there is {', '.join(INTEGRATORS.names())}")
    integrator = INTEGRATORS[wanted]
    if not integrator.supports(method, implementation):
        if requested is None:
            return _own_integrator(numerics, method, implementation, options)
        of = join_or(integrator.methods)
        if method.name not in integrator.methods:
            raise RunError(f"the integrator {wanted} is for the method {of}, not for {method.name}; choose another method or integrator")
        raise RunError(f"the integrator {wanted} needs generated code of the method {of}")
    if method.closure(numerics.closure, implementation, usual=integrator.closure).name not in integrator.closures:
        raise RunError(f"the integrator {wanted} has its own closures: use closure: {join_or(integrator.closures)}")
    return integrator


def find_closure(numerics: Numerics, method: Method, implementation: Implementation = Implementation.GENERATED) -> Closure:
    """The closure that a scene names, else that of its integrator."""
    usual = None
    if numerics.closure is None and method.closures and not implementation.is_generic:
        usual = find_integrator(numerics, method, implementation, Options()).closure
    return method.closure(numerics.closure, implementation, usual=usual)


def find_goal(scene: Scene, method: str, integrator: str, options: Options) -> float | None:
    """The largest error of places and angles (m, rad) of a run whose steps follow from it; None where anything says how steps are."""
    settings, chosen = scene.numerics.of_method(method), INTEGRATORS[integrator]
    if options.accuracy is not None or options.targets:
        _require_accuracy(options)
        return accuracy_of(scene) if options.accuracy is None else options.accuracy
    if chosen.adaptive:
        is_free = settings.tolerance == type(settings).tolerance and settings.absolute_tolerance is None and options.tolerance is None
    else:
        is_free = integrator in INTEGRATORS and options.iterations is None
    if not is_free or settings.dt is not None or options.dt is not None:
        return None
    return accuracy_of(scene)


def _require_accuracy(options: Options) -> None:
    others = {"dt": options.dt, "solver_tolerance": options.tolerance, "iterations": options.iterations}
    require_settings(accuracy=options.accuracy)
    if superfluous := [name for name, value in others.items() if value is not None]:
        raise RunError(f"accuracy: it determines the steps; remove {join_and(superfluous)} or the accuracy")
    if options.once:
        raise RunError("accuracy: it needs the runs that estimate the error; remove --no-error (error=False) or the accuracy")
    if options.targets and options.accuracy is not None:
        raise RunError("accuracy: steps follow from errors of positions or from those of named outputs; remove one of the two")


def accuracy_of(scene: Scene) -> float:
    """The largest error of positions and angles (m, rad) that a scene allows."""
    return GOAL if scene.accuracy is None else scene.accuracy


def find_tolerance(scene: Scene, method: str, integrator: str) -> float | None:
    """The tolerance of a host's steps: a host runs once, where `simulate` repeats the run until it meets its goal. None if the scene sets
    steps.

    By the same steps `simulate` ends a run that keeps the usual goal at once.
    """
    goal = find_goal(scene, method, integrator, Options())
    return None if goal is None or not INTEGRATORS[integrator].adaptive else max(_USUAL_TOLERANCE * min(1.0, goal / GOAL), _LEAST_TOLERANCE)


def _step(scene: Scene, dt: float | None, integrator: Integrator) -> float:
    """The step size (s): for adaptive integrators the sample interval, else the given one, or by default one that divides it."""
    from cutjoint.model.records import STEP

    row = min(scene.output_step, scene.end or scene.output_step)
    if integrator.adaptive:
        return row
    return row / max(1, ceil(row / STEP - 1e-9)) if dt is None else dt


def _own_integrator(numerics: Numerics, method: Method, implementation: Implementation, options: Options) -> Integrator:
    """Without a length or a cost of steps, the first integrator of the method that holds the error of each; else equal steps."""
    closure = method.closure(numerics.closure, implementation).name
    if numerics.of_method(method.name).dt is None and options.iterations is None:
        for integrator in INTEGRATORS.values():
            if integrator.adaptive and closure in integrator.closures and integrator.supports(method, implementation):
                return integrator
    return INTEGRATORS[DEFAULT_INTEGRATOR]


def find_events(
    numerics: Numerics, method: Method, implementation: Implementation, integrator: Integrator, requested: str | None
) -> bool | None:
    """Return whether the steps of a run end at events; None if they cannot, whatever the scene's ``events`` are.
    Raises RunError: what is asked for is none of Events, or cannot be."""
    if requested is not None and requested not in list(Events):
        raise RunError(f"no events '{requested}'; there is {', '.join(Events)}")
    can = method.events and not implementation.is_generic
    if requested == Events.LOCATED and not can:
        raise RunError(f"events are located by generated code of the methods {join_and(names_of(METHODS, lambda m: m.events))}")
    if requested == Events.LOCATED and integrator.events is None:
        raise RunError(f"the integrator {integrator.name} steps across events: use events: crossed")
    if not can or integrator.events is None:
        return None
    return (requested or numerics.events or integrator.events) == Events.LOCATED


def _require_fixed_cost(method: Method, integrator: Integrator, closure: Closure, events: bool | None) -> None:
    if not (method.fixed_cost and integrator.fixed_cost and closure.fixed_cost):
        raise RunError(
            f"a fixed number of iterations needs the method {join_or(names_of(METHODS, lambda m: m.fixed_cost))} with the integrator "
            f"{join_or(names_of(INTEGRATORS, lambda i: i.fixed_cost))} and closure: {join_or(names_of(CLOSURES, lambda c: c.fixed_cost))}"
        )
    if events:
        raise RunError("a fixed number of iterations needs events: crossed: a step that ends at an event is taken in parts")


def _solver(method: Method, implementation: Implementation, requested: str | None) -> str | None:
    if not method.has_system or requested:
        return requested if method.has_system else None
    return IMPLEMENTATIONS.load(implementation).solvers.get(method.name, DEFAULT_SOLVER) if implementation.is_generic else DEFAULT_SOLVER


def _penalty(numerics: Numerics, method: Method, integrator: Integrator) -> float | None:
    """The penalty of a method; a penalty given for that method is not bounded."""
    penalty = numerics.methods.get(method.name, {}).get("penalty")
    if penalty is not None or method.default_updates is not None:
        return penalty
    penalty = numerics.of_method(method.name).penalty
    return penalty if penalty is None or integrator.largest_penalty is None else min(penalty, integrator.largest_penalty)


def _require_ranges(scene: Scene, settings: Settings) -> None:
    """Check the settings of a simulator; expressions of dt may be undefined for the step of this run."""
    for part in (settings, settings.stabilisation):
        for name, value in vars(part).items():
            if isinstance(value, float | int) and not isinstance(value, bool) and (fault := fault_of_setting(name, value)):
                law = scene.numerics.by_step.get(name)
                raise RunError(f"{scene.span}: scene '{scene.name}': {name}{'' if law is None else f' = {law}'}: {fault}")


@dataclass(frozen=True, kw_only=True)
class Options:
    """Settings that a caller gives in place of the scene's; None for what the scene, the method and the integrator have.

    ``dt`` and ``end`` are in s.  ``accuracy`` is the largest error of places and angles (m, rad), from which steps follow; ``targets``
    are those of outputs by name instead, in SI units or quantities of `read_parameters`.  ``tolerance``,
    the solver's, is the relative error of an adaptive integrator's step, else the relative change of the accelerations at which the
    iteration of a step ends.  ``iterations`` is the number that each step has, so that all cost the same.
    ``solver`` is the linear solver, ``integrator`` one of INTEGRATORS, ``events`` one of Events. ``once`` is whether there may be one run
    only, without those that show its error.
    """

    dt: float | None = None
    end: float | None = None
    penalty: float | None = None
    tolerance: float | None = None
    iterations: int | None = None
    solver: str | None = None
    integrator: str | None = None
    events: str | None = None
    accuracy: float | None = None
    targets: Mapping[str, float] = field(default_factory=dict)
    once: bool = False


#: Fixed steps by the default integrator, which ignore events, whatever the scene says; also for tasks without steps.
PLAIN_STEPS = Options(integrator=DEFAULT_INTEGRATOR, events=Events.CROSSED)
