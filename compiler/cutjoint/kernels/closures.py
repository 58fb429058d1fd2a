"""Cut-joint kernels, derived by SymPy: residual, Jacobian and velocity-dependent acceleration of a loop closure.

A residual is written over a point and directions fixed in the base body (``p0`` and ``b``) and in the follower (``p`` and ``f``).  Seen
from the base, only the latter move, with the relative twist Z = Z_follower - Z_base: p' = V + W x p, f' = W x f.  So Phi' = A Z with one A
for both bodies, A_follower = A and A_base = -A, exactly.  Residuals are frame-invariant scalars, or vectors resolved in common axes whose
three components carry one penalty.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, TypeAlias

import sympy

from cutjoint.elements import joint as conditions
from cutjoint.kernels.joints import direction_of, rod_of
from cutjoint.model.records import Joint, Scalar, Vector

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
    ``base_directions`` and ``follower_directions`` are the design directions that stand for the symbols B and F. ``residual`` (m, 1),
    ``jacobian`` (m, 6), ``drift`` (m, 1) = dA/dt Z seen from the base; ``names`` has a short name for each equation."""

    names: tuple[str, ...]
    base_directions: tuple[Vector, ...]
    follower_directions: tuple[Vector, ...]
    residual: Matrix
    jacobian: Matrix
    drift: Matrix


def derive_closure(joint: Joint) -> ClosureKernel:
    """The kernel of a cut joint."""
    names, residual = _residual(joint)
    base, follower = (
        tuple(direction_of(joint, d) for d in used) for used in (joint.element.base_directions, joint.element.follower_directions)
    )
    jacobian, drift = _jacobian_and_drift(sympy.ImmutableMatrix(residual))
    return ClosureKernel(names=names, base_directions=base, follower_directions=follower, residual=residual, jacobian=jacobian, drift=drift)


@cache
def _jacobian_and_drift(residual: Matrix) -> tuple[Matrix, Matrix]:
    """The Jacobian and the drift of a residual, which joints of a kind have in common."""
    rates = dict(zip(P, V + W.cross(P), strict=True))
    for direction in F:
        rates |= dict(zip(direction, W.cross(direction), strict=True))
    velocity = _along(residual, rates)
    return velocity.jacobian(list(V) + list(W)), _along(velocity, rates)


def _along(expressions: Matrix, rates: dict[Scalar, Scalar]) -> Matrix:
    """The time derivative seen from the base, without relative acceleration."""
    return sum((expressions.diff(x) * dx for x, dx in rates.items()), sympy.zeros(*expressions.shape))


def _residual(joint: Joint) -> tuple[tuple[str, ...], Matrix]:
    element = joint.element
    if not element.closes:
        raise ValueError(f"{joint.span}: joint '{joint.name}': a {joint.kind} joint cannot be a cut joint")
    names = tuple(name for condition in element.conditions for name in condition.names)
    return names, _column(*(row for condition in element.conditions for row in _scaled_rows(joint, condition)))


def _scaled_rows(joint: Joint, condition: conditions.Condition) -> Iterator[Sequence[Scalar] | Scalar]:
    """The rows of a condition, in m: those between directions by the joint's arm."""
    between_points = condition.joins_points and not isinstance(condition, conditions.Advance)
    yield from (row if between_points or joint.arm == 1 else sympy.Float(joint.arm) * row for row in _rows(joint, condition))


def _rows(joint: Joint, condition: conditions.Condition) -> Iterator[Sequence[Scalar] | Scalar]:
    r = P - P0
    b = dict(zip(joint.element.base_directions, B, strict=False))
    f = dict(zip(joint.element.follower_directions, F, strict=False))

    def symbols_of(factor: conditions.BodyDirection | conditions.JointDisplacement) -> Matrix:
        if isinstance(factor, conditions.JointDisplacement):
            return r
        return (b if factor.end is conditions.End.BASE else f)[factor.direction]

    match condition:
        case conditions.SamePoint():
            yield r
        case conditions.SameDirection():
            yield f[condition.direction] - b[condition.direction]
        case conditions.SameAttitude():
            # half the sum of b_k x f_k: the sine of a small relative rotation, as a vector
            yield sum((b[d].cross(f[d]) for d in condition.frame), sympy.zeros(3, 1)) / 2
        case conditions.Products():
            for products in condition.sums:
                terms = (sympy.sympify(p.weight) * symbols_of(p.left).dot(symbols_of(p.right)) for p in products)
                yield sum(terms, sympy.Integer(0))
        case conditions.SameDistance():
            length = sympy.Matrix(rod_of(joint)).norm()
            yield (r.dot(r) - length**2) / (2 * length)
        case conditions.Advance():
            axis, first, second = (b[d] for d in conditions.AXIAL_FRAME)
            angle = axis.dot(r) / joint.pitch
            yield f[conditions.Direction.ACROSS_1].dot(second * sympy.cos(angle) - first * sympy.sin(angle))


def _column(*parts: Sequence[Scalar] | Scalar) -> Matrix:
    return sympy.Matrix([x for part in parts for x in (part if isinstance(part, sympy.MatrixBase) else [part])])
