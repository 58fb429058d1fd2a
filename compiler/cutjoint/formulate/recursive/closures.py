"""Cut-joint kernels, derived by SymPy: residual, Jacobian and velocity-dependent acceleration of a loop closure.

A residual is written over what is fixed in the base body (its point ``p0`` and directions ``b``) and what is fixed in the
follower (its point ``p`` and directions ``f``).  Seen from the base, only the latter move, with the relative twist
Z = Z_follower - Z_base: p' = V + W x p, f' = W x f.  So Phi' = A Z with one A for both bodies, A_follower = A and A_base = -A, exactly.
Residuals are frame-invariant scalars, or vectors resolved in common axes whose three components carry one penalty.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, TypeAlias

import sympy

from cutjoint.formulate.directions import tangents
from cutjoint.model.records import Joint, JointKind, Scalar, Vector

Matrix: TypeAlias = Any


def _symbols(name: str) -> Matrix:
    return sympy.Matrix(sympy.symbols(f"{name}_x {name}_y {name}_z", real=True))


P, P0 = _symbols("p"), _symbols("p0")
V, W = _symbols("V"), _symbols("W")
F = tuple(_symbols(f"f{i}") for i in range(3))
B = tuple(_symbols(f"b{i}") for i in range(3))


@dataclass(frozen=True, kw_only=True)
class ClosureKernel:
    """A cut joint's equations.

    ``base_directions`` and ``follower_directions`` are the design directions that stand for the symbols B and F.  ``residual`` (m, 1),
    ``jacobian`` (m, 6), ``drift`` (m, 1) = dA/dt Z seen from the base; ``names`` has a short name for each equation.
    """

    names: tuple[str, ...]
    base_directions: tuple[Vector, ...]
    follower_directions: tuple[Vector, ...]
    residual: Matrix
    jacobian: Matrix
    drift: Matrix


def derive_closure(joint: Joint) -> ClosureKernel:
    """The kernel of a cut joint."""
    names, base, follower, residual = _residual(joint)
    jacobian, drift = _jacobian_and_drift(sympy.ImmutableMatrix(residual))
    return ClosureKernel(
        names=names, base_directions=base, follower_directions=follower, residual=residual, jacobian=jacobian, drift=drift
    )  # fmt: skip


@cache
def _jacobian_and_drift(residual: Matrix) -> tuple[Matrix, Matrix]:
    """Those of a residual, which joints of a kind have in common."""
    rates = _rates()
    velocity = _along(residual, rates)
    return velocity.jacobian(list(V) + list(W)), _along(velocity, rates)


def _rates() -> dict[Scalar, Scalar]:
    rates = dict(zip(P, V + W.cross(P), strict=True))
    for direction in F:
        rates |= dict(zip(direction, W.cross(direction), strict=True))
    return rates


def _along(expressions: Matrix, rates: dict[Scalar, Scalar]) -> Matrix:
    """The time derivative seen from the base, without relative acceleration."""
    return sum((expressions.diff(x) * dx for x, dx in rates.items()), sympy.zeros(*expressions.shape))


_XYZ = ("x", "y", "z")
_AXIS = ("axis_x", "axis_y", "axis_z")
_TURN = ("turn_x", "turn_y", "turn_z")


def _residual(joint: Joint) -> tuple[tuple[str, ...], tuple[Vector, ...], tuple[Vector, ...], Matrix]:
    gap, aligned = P - P0, F[0] - B[0]
    axes = joint.axes
    match joint.kind:
        case JointKind.SPHERICAL:
            return _XYZ, (), (), gap
        case JointKind.REVOLUTE:
            return (*_XYZ, *_AXIS), axes, axes, _column(gap, aligned)
        case JointKind.UNIVERSAL:
            return (*_XYZ, "angle"), (axes[0],), (axes[1],), _column(gap, F[0].dot(B[0]))
        case JointKind.FIXED:
            frame = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
            return (*_XYZ, *_TURN), frame, frame, _column(gap, _turn())
        case JointKind.DISTANCE:
            length = (sympy.Matrix(joint.to) - sympy.Matrix(joint.at)).norm()
            return ("length",), (), (), sympy.Matrix([(gap.dot(gap) - length**2) / (2 * length)])
    return _along_an_axis(joint, gap)


def _along_an_axis(joint: Joint, gap: Matrix) -> tuple[tuple[str, ...], tuple[Vector, ...], tuple[Vector, ...], Matrix]:
    """The kinds that slide or turn about one axis; the directions are that axis and two across it."""
    axis = joint.axes[0]
    frame = (axis, *(tuple(t) for t in tangents(joint, axis)))
    aligned = F[0] - B[0]
    across = [B[1].dot(gap), B[2].dot(gap)]
    names = ("across_1", "across_2")
    match joint.kind:
        case JointKind.POINT_ON_LINE:
            return names, frame, (), _column(*across)
        case JointKind.CYLINDRICAL:
            return (*names, *_AXIS), frame, frame[:1], _column(*across, aligned)
        case JointKind.PRISMATIC:
            return (*names, *_TURN), frame, frame, _column(*across, _turn())
        case JointKind.PLANAR:
            return ("height", *_AXIS), frame[:1], frame[:1], _column(B[0].dot(gap), aligned)
        case JointKind.SCREW:
            angle = B[0].dot(gap) / joint.pitch
            advance = F[1].dot(B[2] * sympy.cos(angle) - B[1] * sympy.sin(angle))
            return (*names, *_AXIS, "advance"), frame, frame[:2], _column(*across, aligned, advance)
    raise ValueError(f"{joint.span}: joint '{joint.name}': a {joint.kind} joint cannot be a cut joint")


def _turn() -> Matrix:
    """Half the sum of b_k x f_k: the sine of a small relative rotation, as a vector."""
    return sum((b.cross(f) for b, f in zip(B, F, strict=True)), sympy.zeros(3, 1)) / 2


def _column(*parts: Sequence[Scalar] | Scalar) -> Matrix:
    return sympy.Matrix([x for part in parts for x in (part if isinstance(part, sympy.MatrixBase) else [part])])
