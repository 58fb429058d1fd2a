"""A rotating wheel on the road: the motion of its contact, and forces and moments there by expressions.

The road is met under the wheel centre, as in `road_contact`.  With the wheel's axis y, the road's normal n and the distance l from the
centre c to the road in the wheel's plane::

    deflection = R - l            deflection' = -(n . v + l (n . y) (n . y') / c_e) / c_e,   c_e = n . e_z
    vx = e_x . v                  vy = e_y . (v - l w x e_z)
    spin = y . w                  turn = n . (w - spin y)

The rate of the deflection is that on a plane road.  Forces act where l ends, and only where the deflection is positive.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from cutjoint.elements.interaction import Mechanics
from cutjoint.elements.interactions.road_contact import Ground, WheelContact, meet_road

if TYPE_CHECKING:
    from cutjoint.elements import forces
    from cutjoint.program.blocks import Block


@dataclass(frozen=True, kw_only=True)
class RollingContact(WheelContact):
    """A wheel on the road whose body rotates with it."""

    rotates: ClassVar[bool] = True
    equation: ClassVar[str] = "forces and moments of the contact by its motion, where the wheel's plane meets the road"

    def act(self, force: forces.Wheel, m: Mechanics) -> dict[str, Block]:
        """The road acts on the wheel at the contact."""
        b, (road, values) = m.b, self._contact(force, m)
        touches = b.call("lt", b.zero(1), values["deflection"])
        components = [b.call("where", touches, m.scalar(component, values), b.zero(1)) for component in (*force.force, *force.moment)]
        directions = (road.e_x, road.e_y, road.n)
        parts = components[:3], components[3:]
        applied, moment = (b.total([b.scale(x, e) for x, e in zip(part, directions, strict=True)]) for part in parts)
        m.apply_force_at_offset(self.centre, b.neg(b.scale(values["loaded_radius"], road.e_z)), applied, moment)
        return dict(zip(("Fx", "Fy", "Fz", "Mx", "My", "Mz"), components, strict=True)) | values

    def values(self, force: forces.Wheel, m: Mechanics) -> dict[str, Block]:
        """The motion of the contact."""
        return self._contact(force, m)[1]

    def _contact(self, force: forces.Wheel, m: Mechanics) -> tuple[Ground, dict[str, Block]]:
        b, centre, axis, (w, wheel_rate) = m.b, m.point(self.centre), m.direction(self.axis), m.spin_and_relative_rate(self.centre.carrier)
        road = meet_road(m, force, centre.x, axis.x)
        n, y, spin = road.n, road.axis, b.dot(road.axis, w)
        inclination, per_upright = b.dot(n, y), b.call("div", b.number(1.0), b.letter(road.upright, "u"))
        distance = b.mul(b.mul(road.clearance, road.n_z), per_upright)
        tilt = b.mul(inclination, per_upright)
        sinking = b.add(b.dot(n, centre.v), b.mul(distance, b.mul(tilt, b.dot(n, axis.v))))
        return road, {
            "deflection": b.sub(m.scalar(force.free_radius, {}), distance),
            "deflection_rate": b.neg(b.mul(sinking, per_upright)),
            "loaded_radius": distance,
            "vx": b.dot(road.e_x, centre.v),
            "vy": b.dot(road.e_y, b.sub(centre.v, b.scale(distance, b.cross(w, road.e_z)))),
            "spin": b.add(spin, wheel_rate),
            "camber": b.call("atan", tilt),
            "turn": b.sub(b.dot(n, w), b.mul(spin, inclination)),
            "road_friction": road.friction,
        }
