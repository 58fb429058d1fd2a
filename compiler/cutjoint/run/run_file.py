"""What a simulator is told: the run file, plain data for JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from math import inf, isfinite
from typing import Any

import sympy

from cutjoint.formulate.inputs import open_parameters
from cutjoint.methods import ADAPTIVE, EXPLICIT
from cutjoint.model.evaluate import evaluate
from cutjoint.model.quantities import JOINT_QUANTITIES
from cutjoint.model.ranges import fault_of, fault_of_setting, fault_of_state
from cutjoint.model.records import Binding, Model, Numerics, Scalar, Scene, Tyre
from cutjoint.model.steps import StepsError, count_steps
from cutjoint.run.roads import road_pieces


class RunError(ValueError):
    """A run was asked for that the model cannot do."""


def parameter_values(model: Model, changes: Mapping[str, float]) -> dict[str, float]:
    """The open parameters with their values after ``changes`` (SI units).

    Raises:
        RunError: a change names no open parameter, or has no finite value.
    """
    values = {p.name: p.value for p in open_parameters(model)}
    for name, value in changes.items():
        if name not in values:
            raise RunError(_unknown(model, name, sorted(values)))
        if fault := fault_of(value):
            raise RunError(f"parameter '{name}': {fault}")
        values[name] = value
    return values


def require_figures(
    *, dt: float | None = None, end: float | None = None, at: float | None = None, penalty: float | None = None,
    tolerance: float | None = None, iterations: int | None = None, threads: int | None = None,
) -> None:  # fmt: skip
    """Check figures that are asked for in place of a scene's or the usual ones, for which None stands; a penalty may be without bound.

    Raises:
        RunError: one of them is not finite, or no run has it.
    """
    asked = {
        "dt": dt, "end": end, "at": at, "penalty": None if penalty == inf else penalty, "tolerance": tolerance,
        "iterations": iterations, "threads": threads,
    }  # fmt: skip
    for name, value in asked.items():
        if value is not None and (fault := fault_of_setting(name, value)):
            raise RunError(f"{name}: {fault}")


def _unknown(model: Model, name: str, known: list[str]) -> str:
    for p in model.parameters:
        if p.name == name:
            return f"{p.span}: parameter '{name}' has binding {p.binding}; write 'binding: param' to change it without recompiling"
    return f"model '{model.name}' has no parameter '{name}'; it has {', '.join(known) or 'none'}"


def make_run_file(
    model: Model, scene: Scene, changes: Mapping[str, float], *, task: str, out: str = "", method: str = "recursive", solver: str = "",
    integrator: str = "trapezoidal", events: bool | None = None, fixed_cost: int | None = None,
) -> dict[str, Any]:  # fmt: skip
    """The run file of a task: "simulate", "realtime", "equilibrium" or "evaluate"; of Lagrangian methods also "factor", of batches "batch".

    ``solver`` names the linear solver of a Lagrangian method, by default the emitted one.  The ``integrator`` "reference" takes steps as
    long as ``tolerance`` allows between rows that are ``dt`` apart, "dormand-prince" and "sdirk4" such steps without regard to rows, of
    which each has its place, and the explicit ones have no stabilisation.  ``events`` tells whether steps end at events, where the method
    can do both.  ``fixed_cost`` is the number of iterations that each step of the recursive method has then, whatever they leave.
    "steps_out" may be added, where iterations and residuals of each step go, "tangents_out", where the recursive method's Jacobians at
    each row do, and "states", of which "evaluate" evaluates; a batch needs "cases", what each run has of its own, and "threads".
    ``numerics`` are the method's figures, a penalty of None is left to the simulator; ``stabilisation`` those of the cut joints of the
    recursive equations, which start every run.

    Raises:
        RunError: a change names no open parameter, has no finite value, or leaves the start or a road without a finite value; a setting
            is out of its range; the run has no steps, or too many.
    """
    parameters = parameter_values(model, changes)
    figures = _figures(scene.numerics, method)
    if events is not None:
        figures["events"] = events
    if fixed_cost is not None:
        figures |= {"iterations": fixed_cost, "fixed_cost": True}
    if integrator in EXPLICIT:
        figures["penalty"] = _explicit_penalty(scene.numerics)
    if integrator in ("rk4", "dormand-prince", "sdirk4", "sdirk4-fixed"):
        figures["absolute_tolerance"] = _absolute_tolerance(scene.numerics.of_method(method))
    if integrator == "generalised-alpha":
        figures["spectral_radius"] = scene.numerics.spectral_radius
    if integrator in ADAPTIVE:
        figures["dt"] = min(scene.output_step, scene.end or scene.output_step)
    stabilisation = _stabilisation(scene.numerics.of_method("recursive"), method)
    for settings in (figures, stabilisation):
        _require_settings(scene, settings)
    if task in ("simulate", "realtime", "batch"):
        _require_steps(scene, figures, task)
    return {
        "task": task,
        "parameters": parameters,
        "numerics": figures,
        "stabilisation": stabilisation,
        "end": scene.end,
        "output_step": scene.output_step,
        "pose": scene.pose,
        **following(model, scene, parameters, tuple(_sources(model, scene))),
        "out": out,
        **({"integrator": integrator} if integrator != "trapezoidal" else {}),
        **({"solver": solver} if solver else {}),
    }


def changing(model: Model, scene: Scene) -> tuple[str, ...]:
    """Which parts of a run file follow from open parameters, besides "parameters"."""
    symbols = {p.symbol for p in open_parameters(model)}
    of_part = {name: sympy.Tuple(*expressions.values()).free_symbols for name, expressions in _sources(model, scene).items()}
    return tuple(name for name, used in of_part.items() if used & symbols)


def following(model: Model, scene: Scene, parameters: Mapping[str, float], parts: Sequence[str]) -> dict[str, Any]:
    """Parts of a run file that may follow from parameters: "positions", "rates", "roads".

    Raises:
        RunError: with these parameters one of them has no finite value.
    """
    value, sources = Evaluator(model, parameters), _sources(model, scene)
    made: dict[str, Any] = {part: {of: value(e, _place(model, scene, part, of)) for of, e in sources[part].items()} for part in parts}
    for part in made.keys() & {"positions", "rates"}:
        _require_states(model, scene, part, made[part])
    if "roads" in made:
        roads = {radius: _road(scene, radius) for radius in made["roads"].values()}
        made["roads"] = {tyre: roads[radius] for tyre, radius in made["roads"].items()}
    return made


def _sources(model: Model, scene: Scene) -> dict[str, Mapping[str, Scalar]]:
    """The expressions that these parts come from; of a road the wheel's radius."""
    radii = {f.name: f.constants["radius"] for f in model.forces if isinstance(f, Tyre)}
    return {"positions": scene.positions, "rates": scene.rates, "roads": radii}


def _require_states(model: Model, scene: Scene, part: str, values: Mapping[str, float]) -> None:
    """Check coordinates or speeds of a start."""
    kinds = {joint.name: joint.kind for joint in model.joints}
    for name, value in values.items():
        joint, _, component = name.rpartition(".")
        if fault := fault_of_state(value, is_angle=JOINT_QUANTITIES[kinds[joint]][component] == "rad"):
            raise RunError(f"{_place(model, scene, part, name)}: {fault}")


def _place(model: Model, scene: Scene, part: str, of: str) -> str:
    """Where the expression stands that a part comes from."""
    if part != "roads":
        return f"{scene.span}: scene '{scene.name}': {part}: '{of}'"
    return f"{next(f.span for f in model.forces if f.name == of)}: tyre '{of}': radius"


def _require_settings(scene: Scene, settings: Mapping[str, Any]) -> None:
    """Check the settings that a simulator is given; an expression of dt may have no value at the step of this run."""
    for name, value in settings.items():
        if isinstance(value, float | int) and not isinstance(value, bool) and (fault := fault_of_setting(name, value)):
            law = scene.numerics.by_step.get(name)
            raise RunError(f"{scene.span}: scene '{scene.name}': {name}{'' if law is None else f' = {law}'}: {fault}")


def _require_steps(scene: Scene, figures: Mapping[str, Any], task: str) -> None:
    try:
        count_steps(figures["dt"], scene.end, scene.output_step, row_each=task == "realtime")
    except StepsError as error:
        raise RunError(f"{scene.span}: scene '{scene.name}': {error}") from None


#: Iterations of a step in which the augmented method corrects its multipliers, unless it is given: it ends with what is left of them.
AUGMENTED_UPDATES = 20


def _figures(numerics: Numerics, method: str) -> dict[str, float | None]:
    """The figures of a method; the augmented one has no penalty and no number of corrections but its own."""
    own, given = numerics.of_method(method), numerics.methods.get(method, {})
    figures: dict[str, float | None] = {
        name: getattr(own, name) for name in ("dt", "penalty", "tolerance", "iterations", "multiplier_updates")
    }
    figures["penalty"] = _bound(own.penalty)
    if method in ("augmented", "recursive-newton"):
        figures["penalty"] = given.get("penalty")
        figures["multiplier_updates"] = given.get("multiplier_updates", AUGMENTED_UPDATES)
    return figures


def _stabilisation(own: Numerics, method: str) -> dict[str, Any]:
    """Figures of the recursive equations' cut joints; the start of a Lagrangian method has the closure "penalty"."""
    if method == "recursive" and own.closure == "proximal":
        return {"closure": own.closure, "penalty": _bound(own.penalty)}
    penalty = Numerics.penalty if own.penalty == inf else own.penalty
    return {"penalty": penalty, "damping_ratio": own.damping_ratio, "frequency": own.frequency}


def _bound(penalty: float) -> float | None:
    return None if penalty == inf else penalty


#: The largest penalty of explicit integrators, unless one is given for the method: multipliers are corrected until nothing of it is left,
#: and a larger one would leave fewer digits of the accelerations.
EXPLICIT_PENALTY = 1e6


def _explicit_penalty(numerics: Numerics) -> float:
    return numerics.methods.get("recursive", {}).get("penalty", min(numerics.of_method("recursive").penalty, EXPLICIT_PENALTY))


def _absolute_tolerance(own: Numerics) -> float:
    """The absolute error that a step may have: as a share of 1 (m, rad, m/s, rad/s) the relative one, if none is given."""
    return own.tolerance if own.absolute_tolerance is None else own.absolute_tolerance


class Evaluator:
    """Numbers from expressions over parameters; inputs have their default values."""

    def __init__(self, model: Model, changed: Mapping[str, float]) -> None:
        taken = [p for p in model.parameters if p.binding is not Binding.INPUT]
        self._names = {p.symbol: p.name for p in taken}
        self._values = {p.symbol: changed.get(p.name, p.value) for p in taken}

    def __call__(self, expression: Scalar, what: str = "an expression") -> float:
        """The value of an expression, which messages call ``what``.

        Raises:
            RunError: it has none, or none that is finite.
        """
        if not hasattr(expression, "free_symbols"):
            return float(expression)
        value = evaluate(expression, self._values)
        if not isfinite(value):
            used = sorted((self._names[s], self._values[s]) for s in expression.free_symbols if s in self._names)
            raise RunError(f"{what} has no finite value with {', '.join(f'{n} = {v:g}' for n, v in used)}; set other values")
        return value


def _road(scene: Scene, radius: float) -> dict[str, Any]:
    tracks = {side: [asdict(p) for p in pieces] for side, pieces in road_pieces(scene.road, radius).items()}
    return {**tracks, "disc": scene.road.contact == "disc"}
