"""A mechanism linearised about a state: mass, damping and stiffness are the exact tangent of its balance with other weights."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from cutjoint.analysis.closing import Array, retract
from cutjoint.analysis.linearisation import Linearisation, free_directions
from cutjoint.formulate.implicit.records import ImplicitEquations

#: Plain data by name: a state with t, q, v, vdot and lambda; what is asked of it; results.
Point: TypeAlias = dict[str, Any]
#: The functions of the equations at points, see runtime/include/cutjoint/lagrangian/examine.hpp.
Evaluate: TypeAlias = Callable[[Sequence[Point]], Sequence[Mapping[str, Any]]]

_STEP = 1e-3
#: Central differences of fourth order, for a unit step.
_DIFFERENCES = {-2: 1 / 12, -1: -8 / 12, 1: 8 / 12, 2: -1 / 12}


def linearise(equations: ImplicitEquations, state: Mapping[str, Any], evaluate: Evaluate, *, at_rest: bool) -> Linearisation:
    """The equations linearised about a state, which is one ``at_rest`` or of a motion with its accelerations and multipliers."""
    n, m = equations.start.speeds, len(equations.equation_names)
    here = {**state, "motion": 0.0 if at_rest else 1.0, "penalty": 0.0, "w": [0.0] * m}
    plain = {**here, "weights": _weights(0.0, 0.0)}
    results = evaluate([plain, *({**plain, "w": list(row)} for row in np.eye(m))])
    J = np.array([result["force"] for result in results[1:]]).reshape(m, n)
    here["lambda"] = _balancing(state["lambda"], J, results[0]["force_residual"])
    tangents = [{**here, "weights": _weights(*which)} for which in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))]
    M, C, K = (_dense(equations, result["tangent"], n) for result in evaluate(tangents))
    v = np.asarray(state["v"])
    return Linearisation(
        names=coordinate_names(equations), M=M, C=C - M, K=K - M, W=_turning(equations, v), J=J,
        G=_rate_changes(equations, tangents[0], J, evaluate) if m and v.any() and not at_rest else np.zeros((m, n)),
        q=np.asarray(state["q"]), at_rest=at_rest,
    )  # fmt: skip


def _weights(damping: float, stiffness: float) -> dict[str, float]:
    return {"damping": damping, "stiffness": stiffness, "constraint": 0.0}


def _balancing(multipliers: Sequence[float], J: Array, residual: Sequence[float]) -> list[float]:
    """The multipliers that balance the accelerations: those of a step leave to its penalty what it closes the loops by."""
    if not len(multipliers):
        return []
    return list(np.asarray(multipliers) - np.linalg.lstsq(J.T, np.asarray(residual), rcond=None)[0])


def coordinate_names(equations: ImplicitEquations) -> tuple[str, ...]:
    """A name for the coordinate of each speed; of a quaternion, the names of the angular velocity stand for small turns."""
    charts = equations.start.charts
    return tuple(f"{c.joint}.{name}" for c in charts for name in (*c.coordinate_names[: c.scalars], *c.speed_names[c.scalars :]))


def _dense(equations: ImplicitEquations, tangent: Sequence[float], n: int) -> Array:
    matrix = np.zeros((n, n))
    for name, slot in equations.slots.items():
        if slot.array == "tangent":
            row, column = map(int, name.removeprefix("tangent:").split(","))
            matrix[row, column] = tangent[slot.offset]
    return matrix


def _turning(equations: ImplicitEquations, v: Array) -> Array:
    """W: a small turn of a ball, in the axes of its angular velocity omega, changes by omega x turn besides what omega changes by."""
    W = np.zeros((len(v), len(v)))
    for c in equations.start.charts:
        if c.ball:
            first = c.v + c.scalars
            W[first : first + 3, first : first + 3] = np.cross(v[first : first + 3], np.eye(3)).T
    return W


def _rate_changes(equations: ImplicitEquations, here: Point, J: Array, evaluate: Evaluate) -> Array:
    """G in the directions that the loops leave free, zero across them: by differences, as the rates have no tangent of their own."""
    free = free_directions(J)
    results = iter(evaluate(list(_neighbours(equations, here, free))))
    columns = [sum(factor / _STEP * np.asarray(next(results)["rate"]) for factor in _DIFFERENCES.values()) for _ in free.T]
    return np.asarray(np.array(columns).reshape(free.shape[1], len(J)).T @ free.T)


def _neighbours(equations: ImplicitEquations, here: Point, directions: Array) -> Iterator[Point]:
    for direction in directions.T:
        for steps in _DIFFERENCES:
            yield {**here, "q": list(retract(equations.start, np.asarray(here["q"]), steps * _STEP * direction))}
