"""A wheel on the road: vertical spring on the road's height, lateral and aligning force of the Calspan model.

The road is met under the wheel centre. n is the local road normal, e_x the rolling direction and e_y the lateral direction (left) in the
road plane, e_z the direction in the wheel plane from the ground to the centre. The force acts where the wheel plane's e_z meets the road. A
standing wheel is a spring along n under its centre: no slip, no lateral force, no offset of the contact by camber.

The wheel rolls at the rate v/R about its axis without a coordinate of its own. Its angular momentum h = I v/R e rotates with the body, on
which the moment -I v/R e' acts, e' the rate of the axis. Source: Frik, Leister, Schwartz (Vehicle System Dynamics 22, suppl., 1993).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from cutjoint.elements.interaction import Arrow, Axis, Interaction, Mechanics, Motion, Point, Visual, VisualContext, Wheel

if TYPE_CHECKING:
    from cutjoint.elements.forces.on_road import OnRoad
    from cutjoint.elements.forces.tyre import Tyre
    from cutjoint.elements.terms import Scalar
    from cutjoint.program.blocks import Block, Builder

STANDING = 0.1  #: rolling speed below which a wheel counts as standing, m/s


@dataclass(frozen=True, kw_only=True)
class WheelContact(Interaction):
    """A wheel on the road, which has a track of its own in the runtime; ``rotates`` if its body does."""

    centre: Point
    axis: Axis
    needs_attitude: ClassVar[bool] = True
    has_road: ClassVar[bool] = True
    rotates: ClassVar[bool]

    def visuals(self) -> tuple[Visual, ...]:
        return (Wheel(self.centre, self.axis, self.rotates),)

    def arrow(self, force: Any, context: VisualContext) -> Arrow:
        """The load on the wheel, from the road under its centre."""
        return context.lift(self.centre, force.radius, "Fz")


@dataclass(frozen=True, kw_only=True)
class RoadContact(WheelContact):
    """A wheel that rolls without a coordinate of its own."""

    rotates: ClassVar[bool] = False
    equation: ClassVar[str] = "Fz = k (R - dz)/sqrt(1 + slope^2);  Fy, Mz by the Calspan model"

    def act(self, force: Tyre, m: Mechanics) -> dict[str, Block]:
        """The road acts on the wheel at the contact, and on its attitude by the spin's angular momentum and the road's moment."""
        contact = self._contact(force, m)
        m.apply_force_at_offset(self.centre, contact.arm, contact.force, contact.moment)
        return contact.quantities

    def values(self, force: Tyre, m: Mechanics) -> dict[str, Block]:
        """The lateral force."""
        return {"side": self._contact(force, m).quantities["Fy"]}

    def _contact(self, force: Tyre, m: Mechanics) -> Contact:
        return touch_road(m, force, m.point(self.centre), m.direction(self.axis))


@dataclass(frozen=True, kw_only=True)
class Contact:
    """The road's force (3, 1) on the wheel at ``arm`` (3, 1) from its centre, and the moment (3, 1) of road and spin."""

    arm: Block
    force: Block
    moment: Block
    quantities: dict[str, Block]


@dataclass(frozen=True, kw_only=True)
class Ground:
    """The road under a wheel: normal n with vertical component ``n_z``, rolling direction ``e_x``, lateral direction ``e_y``.
    ``e_z`` points up in the wheel's plane, ``axis`` is the wheel's, ``upright`` is n . e_z;
    ``clearance`` (m) is the vertical one of the centre, ``friction`` a factor."""

    n: Block
    n_z: Block
    e_x: Block
    e_y: Block
    e_z: Block
    axis: Block
    clearance: Block
    friction: Block
    upright: Block

    def camber(self, b: Builder) -> Block:
        """The inclination of the wheel against the road, rad, positive if its top is inclined to the right."""
        return b.call("atan", b.call("div", b.dot(self.n, self.axis), b.dot(self.n, self.e_z)))

    def distance(self, b: Builder) -> Block:
        """The displacement from the road to the centre along ``e_z``, m."""
        return b.call("div", b.mul(self.clearance, self.n_z), b.dot(self.n, self.e_z))


def meet_road(m: Mechanics, wheel: OnRoad, place: Block, axis: Block) -> Ground:
    """The road under a wheel by the places of its centre and axis, that of the scene with the wheel's own."""
    b = m.b
    x, y, z = (b.element(place, i) for i in range(3))

    def lookup(name: str) -> Block:
        return b.call(name, x, y, table=wheel.name)

    height, slope, bank = lookup("road_height"), lookup("road_slope"), None
    if "surface" in m.road:
        height, slope = b.add(height, lookup("road_surface")), b.add(slope, lookup("road_surface_x"))
        bank = lookup("road_surface_y")
    slope = b.letter(_with(m, b.add, slope, wheel.terrain_slope), "h_x")
    clearance = b.letter(b.sub(z, _with(m, b.add, height, wheel.terrain_height)), "c")
    steep = b.add(b.number(1.0), b.mul(slope, slope))
    if wheel.terrain_bank is not None:
        own = m.scalar(wheel.terrain_bank, {})
        bank = own if bank is None else b.add(bank, own)
    bank = None if bank is None else b.letter(bank, "h_y")
    n_z = b.letter(b.call("div", b.number(1.0), b.call("sqrt", steep if bank is None else b.add(steep, b.mul(bank, bank)))), "n_z")
    friction = lookup("road_friction") if "friction" in m.road else b.number(1.0)
    n = m.from_global(b.column([b.neg(b.mul(slope, n_z)), b.zero(1) if bank is None else b.neg(b.mul(bank, n_z)), n_z]))
    across = b.cross(axis, b.letter(n, "n"))
    upright = b.call("sqrt", b.dot(across, across))  # n . (e_x x a) = e_x . (a x n)
    e_x = b.letter(b.scale(b.call("div", b.number(1.0), upright), across), "e_x")
    return Ground(
        n=n, n_z=n_z, e_x=e_x, e_y=b.letter(b.cross(n, e_x), "e_y"), e_z=b.letter(b.cross(e_x, axis), "e_z"), axis=axis,
        clearance=clearance, friction=_with(m, b.mul, friction, wheel.friction), upright=upright,
    )  # fmt: skip


def touch_road(m: Mechanics, tyre: Tyre, centre: Motion, wheel_axis: Motion) -> Contact:
    """The contact of one wheel, by the motions of its centre and axis."""
    b, (place, velocity), (axis, axis_rate) = m.b, (centre.x, centre.v), (wheel_axis.x, wheel_axis.v)
    road = meet_road(m, tyre, place, axis)
    n, n_z, e_x, e_y, e_z = road.n, road.n_z, road.e_x, road.e_y, road.e_z
    constants = {name: m.scalar(value, {}) for name, value in tyre.constants.items()}
    constants["SN"] = b.mul(constants["SN"], road.friction)
    deflection = b.sub(constants["radius"], road.clearance)
    pressed = b.mul(b.mul(constants["stiffness"], deflection), n_z)
    load = b.call("where", b.call("lt", b.zero(1), deflection), pressed, b.zero(1))
    rolling, drift = b.letter(b.dot(e_x, velocity), "v_x"), b.letter(b.dot(e_y, velocity), "v_y")
    moves = b.call("lt", b.number(STANDING), rolling)
    slip = b.call("where", moves, b.call("atan", b.call("div", drift, rolling)), b.zero(1))
    camber = road.camber(b)
    side, aligning = calspan(b, constants, load, slip, camber) if tyre.lateral else (b.zero(1), b.zero(1))
    side, aligning = (b.call("where", moves, value, b.zero(1)) for value in (side, aligning))
    momentum = b.mul(constants["spin_inertia"], b.call("div", rolling, constants["radius"]))
    rolling_arm = b.scale(road.distance(b), e_z)
    standing_arm = b.scale(b.mul(road.clearance, n_z), n)
    return Contact(
        arm=b.neg(_choose(b, moves, rolling_arm, standing_arm)),
        force=b.add(b.scale(load, n), b.scale(side, e_y)),
        moment=b.sub(b.scale(aligning, n), b.scale(momentum, axis_rate)),
        quantities={"Fz": load, "Fy": side, "Mz": aligning, "slip": slip, "camber": camber, "deflection": deflection},
    )


def _with(m: Mechanics, combine: Callable[[Block, Block], Block], of_road: Block, own: Scalar | None) -> Block:
    """A quantity of the road combined with that of the wheel's own terrain."""
    return of_road if own is None else combine(of_road, m.scalar(own, {}))


def calspan(b: Builder, c: Mapping[str, Block], load: Block, slip: Block, camber: Block) -> tuple[Block, Block]:
    """Lateral force and aligning moment of the Calspan model, zero without load."""
    capped = b.letter(b.call("where", b.call("lt", load, c["A2"]), load, c["A2"]), "F_c")
    share = b.call("div", b.sub(c["A2"], capped), c["A2"])
    cornering = b.letter(b.add(c["A0"], b.mul(b.mul(c["A1"], capped), share)), r"C_\alpha")
    thrust = b.letter(b.call("div", b.mul(b.mul(c["A3"], b.sub(c["A4"], capped)), capped), c["A4"]), r"C_\gamma")
    friction = b.add(b.add(b.mul(c["B1"], load), c["B3"]), b.mul(c["B4"], b.mul(load, load)))
    limit = b.letter(b.mul(b.mul(friction, c["SN"]), load), r"F_{max}")
    grips = b.call("lt", b.zero(1), limit)
    demand = b.neg(b.add(b.mul(cornering, slip), b.mul(thrust, camber)))
    a = b.letter(b.call("div", demand, b.call("where", grips, limit, b.number(1.0))), "a")
    size = b.call("abs", a)
    inside = b.mul(a, b.add(b.sub(b.number(1.0), b.mul(b.number(1 / 3), size)), b.mul(b.number(1 / 27), b.mul(a, a))))
    sliding = b.call("where", b.call("lt", a, b.zero(1)), b.number(-1.0), b.number(1.0))
    side = b.mul(limit, b.call("where", b.call("lt", size, b.number(3.0)), inside, sliding))
    side = b.call("where", grips, side, b.zero(1))
    trail = b.add(b.mul(c["AF1"], load), b.mul(c["AF2"], b.call("abs", side)))
    return side, b.mul(trail, side)


def _choose(b: Builder, condition: Block, yes: Block, no: Block) -> Block:
    return b.column([b.call("where", condition, b.element(yes, i), b.element(no, i)) for i in range(yes.shape[0])])
