"""A ball or a point of a body on a plane or a cylinder of another, with a force there by expressions.

With the displacement w from the surface's point p_b to the centre c, the surface's normal n and the distance l from c to the surface::

    plane      l = n . w                       cylinder   d = |w - a (a . w)|,  n = +-(w - a (a . w))/d,  l = +-(d - R)
    deflection = r - l                         deflection' = -n . u,   u = v_c - v_b - w_b x w
    v = u - l (w_f - w_b) x n                  vx = e_x . v,  vy = e_y . v,  e_y = n x e_x,  turn = n . (w_f - w_b)

v is the velocity of the follower's material over the base's at c - l n, where the force acts on both, and only where the deflection is
positive.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from cutjoint.elements.interaction import Arrow, Axis, Carrier, Interaction, Mechanics, Point, VisualContext

if TYPE_CHECKING:
    from cutjoint.elements import forces
    from cutjoint.program.blocks import Block


@dataclass(frozen=True, kw_only=True)
class _Surface:
    """The surface under a centre: the displacement from the surface's point, normal, tangent of the first component, distance."""

    displacement: Block
    n: Block
    e_x: Block
    distance: Block


@dataclass(frozen=True, kw_only=True)
class Touch(Interaction):
    """A ``centre`` on a plane through ``start`` with direction ``normal``. Without ``normal``: on a cylinder about ``along``."""

    start: Point
    centre: Point
    along: Axis
    normal: Axis
    needs_attitude: ClassVar[bool] = True
    holds_bodies: ClassVar[bool] = False
    equation: ClassVar[str] = "deflection = r - l,  v = u - l (w_f - w_b) x n,  force by its components where the surface is met"

    def act(self, force: forces.Contact, m: Mechanics) -> dict[str, Block]:
        """The force on the follower where it meets the surface, and its reaction on the base there."""
        b, (at, values) = m.b, self._contact(force, m)
        touches = b.call("lt", b.zero(1), values["deflection"])
        components = [b.call("where", touches, m.scalar(component, values), b.zero(1)) for component in force.force]
        contact_force = b.total([b.scale(x, e) for x, e in zip(components, (at.e_x, b.cross(at.n, at.e_x), at.n), strict=True)])
        arm = b.neg(b.scale(at.distance, at.n))
        m.apply_force_at_offset(self.centre, arm, contact_force, b.zero(3))
        m.apply_force_at_offset(self.start, b.add(at.displacement, arm), b.neg(contact_force), b.zero(3))
        return dict(zip(("Fx", "Fy", "Fz"), components, strict=True)) | values

    def values(self, force: forces.Contact, m: Mechanics) -> dict[str, Block]:
        """The variables of the law: the motion of the contact."""
        return self._contact(force, m)[1]

    def _contact(self, force: forces.Contact, m: Mechanics) -> tuple[_Surface, dict[str, Block]]:
        b, displacement, turning = m.b, m.displacement(self.start, self.centre), m.spin(Carrier.BASE)
        at = self._meet(force, m, b.letter(displacement.x, "w"))
        relative_velocity = b.letter(b.sub(displacement.v, b.cross(turning, displacement.x)), "u")
        spin = b.sub(m.spin(Carrier.FOLLOWER), turning)
        v = b.letter(b.sub(relative_velocity, b.scale(b.letter(at.distance, "l"), b.cross(spin, b.letter(at.n, "n")))), "v")
        return at, {
            "deflection": b.sub(m.scalar(force.ball, {}), at.distance),
            "deflection_rate": b.neg(b.dot(at.n, relative_velocity)),
            "vx": b.dot(at.e_x, v),
            "vy": b.dot(b.cross(at.n, at.e_x), v),
            "turn": b.dot(at.n, spin),
        }

    def _meet(self, force: forces.Contact, m: Mechanics, displacement: Block) -> _Surface:
        b, e_x = m.b, m.direction(self.along).x
        if force.normal is not None:
            n = m.direction(self.normal).x
            return _Surface(displacement=displacement, n=n, e_x=e_x, distance=b.dot(n, displacement))
        across = b.sub(displacement, b.scale(b.dot(e_x, displacement), e_x))
        d = b.call("sqrt", b.dot(across, across))
        n, distance = b.scale(b.call("div", b.number(1.0), d), across), b.sub(d, m.scalar(force.cylinder, {}))
        return _Surface(displacement=displacement, n=b.neg(n), e_x=e_x, distance=b.neg(distance)) if force.inside else _Surface(
            displacement=displacement, n=n, e_x=e_x, distance=distance
        )

    def swapped(self, force: forces.Contact) -> Mapping[str, Any]:
        """Base and follower are different shapes."""
        return {}

    def arrow(self, force: forces.Contact, context: VisualContext) -> Arrow:
        """The normal force on a plane."""
        return None if force.normal is None else context.apply_force_along(self.centre, self.normal, "Fz")
