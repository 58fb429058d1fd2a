"""Loops that neither lock a motion nor leave it free: because of small geometric errors, or because they lock it to second order only.

A pin that is 1e-8 m off one of three parallel cranks is such a number.  Whether the cranks move would depend on the tolerances of a method,
so they move as the nearest cranks that do where these are within the accuracy of the scene, and are refused where they are farther off.

A structure that loops lock to second order only has one pose, in which some speeds are free, and no motion follows them.

With Phi(q) = 0 and a free direction d, Phi_q d = 0, a motion along s d + s^2 e has w . Phi_qq(d, d) = 0 for each w with w^T Phi_q = 0.
Where that form is definite for one of these w, there is none.  Forces across such a pose would have to be infinite: neither accelerations
nor reactions are determined.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cutjoint.analysis.closing import CLOSED, Array, design_coordinates, evaluate_closures, explore, retract, speed_scales
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.methods import METHODS, join_or, names_of
from cutjoint.model.records import Model
from cutjoint.package.errors import EquationsError
from cutjoint.topology.geometry import TOLERANCE, balanced

if TYPE_CHECKING:
    from cutjoint.analysis.misfit import Misfit

#: The least eigenvalue of the second-order form as a share of the largest singular value; differences have an error of 1e-8.
_LEAST_CURVATURE = 1e-4
_DIFFERENCE = 1e-4


#: Singular values between these shares of the largest neither lock a motion, by any method, nor leave it free.
_FREE_BELOW, _LOCKED_ABOVE = 2e-11, 1e-5
_BARELY_ABOVE = 1e-3  #: a singular value below this share may be due to a misfit that can be seen
_FOUND_WITHIN = 1e-3  #: the share to which a misfit is found: one that equals the accuracy is within it


class ShakyError(EquationsError, ValueError):
    """Loops that neither lock a motion nor leave it free."""


@dataclass(frozen=True, kw_only=True)
class Shakiness:
    """The speed that is most free to first order, and the equation of a joint or gear that locks it to second order."""

    speed: str
    equation: str
    joint: str


def require_firmness(equations: RecursiveEquations, method: str) -> RecursiveEquations:
    """The equations, unless a method cannot solve them in the one pose of a structure.
    Raises ShakyError: the loops lock the design position, where the scene begins, to second order only."""
    elsewhere = equations.scene.positions or equations.scene.assemble or equations.scene.trim
    found = None if METHODS[method].supports_shaky or elsewhere else find_shakiness(equations)
    if found is None:
        return equations
    raise ShakyError(describe_shakiness(equations, found))


def mend_misfit(equations: RecursiveEquations, accuracy: float) -> tuple[str, Model | None]:
    """A message on loops that only rounded numbers lock, at the line of a joint, and the corrected model; ("", None) for other loops. It is
    a warning with a model if joints are off by at most ``accuracy`` (m, rad), else an error without one. Such loops are nearly locked in
    all poses near the design position; mechanisms that guides drive completely are exempt. A larger misfit that leaves no motion, and
    loops that barely lock all speeds, are a warning with the same model.
    """
    if not equations.closures or not equations.speeds:
        return "", None
    jacobian, sizes = evaluate_closures(equations, design_coordinates(equations))[1], speed_scales(equations)
    values = _shares(jacobian * sizes)
    rank = int(np.sum(values > _FREE_BELOW))
    guides = any(t.joint.guide is not None for t in equations.topology.tree)
    if not rank or values[rank - 1] > _LOCKED_ABOVE:
        return ("", None) if guides or rank < equations.speeds else _describe_locking(equations, values[-1])
    poses = explore(equations)
    if any(_shares(pose.jacobian * sizes)[rank - 1] > _LOCKED_ABOVE for pose in poses) or (guides and not poses[0].free.size):
        return "", None
    from cutjoint.analysis.misfit import find_misfit  # others do not wait for what this imports

    found = find_misfit(equations, _LOCKED_ABOVE, _FREE_BELOW)
    if found is None:
        return _describe_holding(equations, jacobian, sizes, rank), None
    if found.off <= (1 + _FOUND_WITHIN) * accuracy:
        words = f"within the accuracy of {accuracy:g} they move as with exact joints"
        return f"{_off(equations, found)}, which would lock the loops; {words}", found.model
    return (
        f"{_off(equations, found)}, more than the accuracy of {accuracy:g}, and locks loops that move with exact joints; "
        "write points and axes exactly, such as by expressions, give the scene an accuracy that is not finer, or move it farther off"
    ), None


def _describe_locking(equations: RecursiveEquations, least: float) -> tuple[str, Model | None]:
    """The warning on a mechanism that small errors lock, with its model; ("", None) for others. ``least``: smallest singular value."""
    from cutjoint.analysis.misfit import find_misfit
    from cutjoint.analysis.skew import describe_rigidity

    found = find_misfit(equations, _BARELY_ABOVE, _FREE_BELOW) if least < _BARELY_ABOVE else None
    if found is None:
        words = describe_rigidity(equations)
        return (f"{equations.scene.span}: the mechanism cannot move; {words}", equations.topology.model) if words else ("", None)
    words = "which locks the loops: the mechanism cannot move, as it could with exact joints"
    return f"{_off(equations, found)}, {words}", equations.topology.model


def _off(equations: RecursiveEquations, found: "Misfit") -> str:
    """The joint of a misfit at its line, and by how much it is off."""
    span = equations.topology.model.constraint_spans.get(found.joint, equations.scene.span)
    return f"{span}: '{found.joint}' is off by {found.off:.2g} {'rad' if found.turns else 'm'}"


def _describe_holding(equations: RecursiveEquations, jacobian: Array, sizes: Array, rank: int) -> str:
    """The error message for loops that nearly lock a motion and have no exact geometry nearby."""
    right = sizes * np.linalg.svd(balanced(jacobian * sizes))[2][rank - 1]
    speed = int(np.abs(right).argmax())
    opening = np.abs(jacobian @ right / right[speed])
    row = int(opening.argmax())
    joint = next(c.joint for c in equations.closures if c.first <= row < c.first + len(c.names))
    span = equations.topology.model.constraint_spans.get(joint, equations.scene.span)
    return (
        f"{span}: '{joint}': only rounded numbers lock this mechanism: at a speed of 1 of '{equations.speed_names[speed]}' the rate "
        f"of violation is {opening[row]:.2g} m/s or rad/s, most at '{equations.equation_names[row]}', too small to lock it, "
        "too large to leave it free; write points and axes exactly, such as by expressions, or farther off"
    )


def _shares(jacobian: Array) -> Array:
    """Singular values as shares of the largest, whatever the units."""
    values = np.linalg.svd(balanced(jacobian), compute_uv=False)
    return np.asarray(values / max(values.max(initial=0.0), np.finfo(float).tiny))


def describe_shakiness(equations: RecursiveEquations, found: Shakiness) -> str:
    """The error message for the design position, at the line of a joint or gear, with a remedy."""
    spans = equations.topology.model.constraint_spans
    others = join_or(f"--method {name}" for name in names_of(METHODS, lambda m: m.supports_shaky))
    return (
        f"{spans.get(found.joint, equations.scene.span)}: '{found.joint}': the loops lock this structure to second order only: in its only "
        f"pose '{found.speed}' has an instantaneous velocity, but '{found.equation}' admits no finite motion, so that accelerations "
        f"and reactions would have to be infinite; move an axis or a point, or use {others}, which tolerates small violations"
    )


def find_shakiness(equations: RecursiveEquations) -> Shakiness | None:
    """The speed and the equation of a structure that is rigid, but not to first order; None of others, and of those with guides."""
    guides = any(t.joint.guide is not None for t in equations.topology.tree)
    if guides or not 0 < equations.speeds <= len(equations.equation_names):
        return None
    q = design_coordinates(equations)
    residual, jacobian = evaluate_closures(equations, q)
    left, values, right = np.linalg.svd(jacobian)
    rank = int(np.sum(values > TOLERANCE * values.max(initial=0.0)))
    if rank == equations.speeds or np.abs(residual).max(initial=0.0) > CLOSED:
        return None
    free, across = right[rank:], left[:, rank:]
    bend = _second_order_forms(equations, q, free, across, _LEAST_CURVATURE * values.max())
    if bend is None:
        return None
    spread = np.linalg.eigvalsh(bend)
    definite = np.where((spread > 0).all(axis=1) | (spread < 0).all(axis=1), np.abs(spread).min(axis=1), 0.0)
    if not definite.max(initial=0.0) > _LEAST_CURVATURE * values.max():
        return None
    equation = int(np.argmax(np.abs(across[:, np.argmax(definite)])))
    return Shakiness(
        speed=equations.speed_names[int(np.argmax(np.abs(free).max(axis=0)))], equation=equations.equation_names[equation],
        joint=next(c.joint for c in equations.closures if c.first <= equation < c.first + len(c.names)),
    )  # fmt: skip


def _second_order_forms(equations: RecursiveEquations, q: Array, free: Array, across: Array, least: float) -> Array | None:
    """The forms w . Phi_qq(d, d) in the free directions (k, speeds), for each w, a column: (w, k, k).
    None as soon as no form is larger than ``least``, or smaller than -``least``, along all directions so far: the least eigenvalue of a
    definite form is no larger than what it is along any direction."""
    forms = np.zeros((across.shape[1], len(free), len(free)))
    for j, direction in enumerate(free):
        ahead, behind = (evaluate_closures(equations, retract(equations, q, h * direction))[1] for h in (_DIFFERENCE, -_DIFFERENCE))
        forms[:, :, j] = across.T @ (ahead - behind) @ free.T / (2 * _DIFFERENCE)
        along = np.diagonal(forms, axis1=1, axis2=2)[:, : j + 1]
        if not ((along > least).all(axis=1) | (along < -least).all(axis=1)).any():
            return None
    return np.asarray((forms + np.swapaxes(forms, 1, 2)) / 2)
