"""A torque proportional to the rotation of two bodies out of their relative attitude of rest, with damping of their relative rotation.

D has the follower's axes in the base's, counted from the attitude of rest: 1 there.  Its rotation vector theta, the angle times the axis,
has a length of at most pi.  It follows from the unit quaternion e of D with e_0 >= 0, and that from a column p = 4 e_i e of sums of D's
elements, of an i that is not near 0 (Shepperd 1978)::

    theta = 2 atan(s) p_v / |p_v|,  s = |p_v| / p_0;          near rest  theta = 2 (1 - s^2/3 + s^4/5 - ...) p_v / p_0

The torque -k theta is what the potential k |theta|^2 / 2 gives, since D turns theta into itself.  At half a turn theta changes its sign:
the potential has an edge there, at its largest value, and the torque pushes on.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from typing import TYPE_CHECKING, ClassVar

from cutjoint.elements.interaction import Carrier, Frame, Interaction, Mechanics

if TYPE_CHECKING:
    from cutjoint.elements.forces.joint_force import BallSpring
    from cutjoint.program.blocks import Block, Builder

#: The square of s = tan(|theta|/2) below which a series takes the place of atan, exact to 1e-16 there, and its coefficients from the last.
_NEAR, _SERIES = 1e-3, (1 / 9, -1 / 7, 1 / 5, -1 / 3, 1.0)


@dataclass(frozen=True, kw_only=True)
class AttitudeForce(Interaction):
    """A torque over the rotation vector between ``frame``, the axes of rest fixed in the base, and the follower's axes."""

    frame: Frame
    needs_attitude: ClassVar[bool] = True
    equation: ClassVar[str] = "theta = rotation vector of the follower's axes beside those of rest;  follower gets -k theta - d (w_f - w_b)"

    def act(self, force: BallSpring, m: Mechanics) -> dict[str, Block]:
        """The torque on the follower, and its reaction on the base."""
        b, theta = m.b, m.b.letter(self._turned(force, m), r"\theta")
        stiffness, damping = (m.scalar(law, {}) for law in force.expressions)
        back = b.scale(stiffness, m.from_body(Carrier.FOLLOWER, theta)) if force.stiffness != 0 else b.zero(3)
        drag = b.scale(damping, b.sub(m.spin(Carrier.FOLLOWER), m.spin(Carrier.BASE))) if force.damping != 0 else b.zero(3)
        torque = b.neg(b.add(back, drag))
        m.apply_torque(Carrier.FOLLOWER, torque)
        m.apply_torque(Carrier.BASE, b.neg(torque))
        columns = {"M": m.in_body(Carrier.FOLLOWER, torque), "r": theta}
        potential = b.mul(b.number(0.5), b.mul(stiffness, b.dot(theta, theta)))
        return {"potential": potential, **{f"{name}{axis}": b.element(c, i) for name, c in columns.items() for i, axis in enumerate("xyz")}}

    def values(self, force: BallSpring, m: Mechanics) -> dict[str, Block]:
        """The rotation vector."""
        theta = self._turned(force, m)
        return {f"r{axis}": m.b.element(theta, i) for i, axis in enumerate("xyz")}

    def _turned(self, force: BallSpring, m: Mechanics) -> Block:
        """theta (3, 1) in the follower's axes."""
        b, S = m.b, m.rotation(self.frame).axes
        R = [[m.scalar(component, {}) for component in axis] for axis in force.axes]  # an axis of rest in each row
        # S is over the axes of rest of both bodies: D = S R^T has the follower's own
        return rotation_vector(b, [[b.total([b.mul(S[i][k], R[k][j]) for k in range(3)]) for j in range(3)] for i in range(3)])


def rotation_vector(b: Builder, D: list[list[Block]]) -> Block:
    """The rotation vector (3, 1), at most half a turn, of a rotation by its rows of scalars."""
    one, trace = b.number(1.0), b.add(b.add(D[0][0], D[1][1]), D[2][2])
    skew = [b.sub(D[k][j], D[j][k]) for j, k in ((1, 2), (2, 0), (0, 1))]
    columns = [[b.add(one, trace), *skew]]
    for i in range(3):
        own = b.add(one, b.sub(b.add(D[i][i], D[i][i]), trace))
        columns.append([skew[i], *(own if i == j else b.add(D[i][j], D[j][i]) for j in range(3))])
    y_is_large, x_is_large = b.call("le", D[2][2], D[1][1]), b.call("and", *(b.call("le", D[i][i], D[0][0]) for i in (1, 2)))
    is_large = (b.call("le", b.zero(1), trace), x_is_large, y_is_large)  # e_0^2 is 1/4 or more; the largest of the others
    first, *rest = (reduce(lambda p, chosen: _where(b, chosen[0], chosen[1], p), zip(is_large[::-1], entry[2::-1], strict=True), entry[3])
                    for entry in zip(*columns, strict=True))  # fmt: skip
    squares = b.total([b.mul(x, x) for x in rest])
    is_near = b.call("lt", squares, b.mul(b.number(_NEAR), b.mul(first, first)))
    inverse = b.call("div", one, _where(b, is_near, first, one))
    square = b.mul(squares, b.mul(inverse, inverse))
    series = reduce(lambda total, c: b.add(b.number(c), b.mul(square, total)), _SERIES[1:], b.number(_SERIES[0]))
    near = b.mul(b.mul(b.number(2.0), inverse), series)
    length = b.call("sqrt", _where(b, is_near, one, squares))
    twice = _where(b, b.call("lt", first, b.zero(1)), b.number(-2.0), b.number(2.0))
    far = b.mul(twice, b.call("div", b.call("atan2", length, b.call("abs", first)), length))
    return b.scale(_where(b, is_near, near, far), b.column(rest))


def _where(b: Builder, condition: Block, yes: Block, no: Block) -> Block:
    return b.call("where", condition, yes, no)
