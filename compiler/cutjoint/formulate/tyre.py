"""The tyre: vertical spring on the road's height, lateral and aligning force of the Calspan model.

The road is met under the wheel centre.  n is the local road normal, e_x the rolling direction and e_y the lateral direction (left) in
the road plane, e_z the wheel plane's way from the ground to the centre.  The force acts where the wheel plane's e_z meets the road.  A
standing wheel is a spring along n under its centre: no slip, no lateral force, no offset of the contact by camber.

The wheel rolls at the rate v/R about its axis without a coordinate of its own.  Its angular momentum h = I v/R e turns with the body,
which takes the moment -I v/R e', e' the rate of the axis.
Source: Frik, Leister, Schwartz (Vehicle System Dynamics 22, suppl., 1993).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from cutjoint.formulate.translate import Translator
from cutjoint.model.records import Tyre
from cutjoint.program.blocks import Block, Builder

#: Rolling speed below which a wheel counts as standing, m/s.
STANDING = 0.1


@dataclass(frozen=True, kw_only=True)
class Wheel:
    """The motion of a wheel: its centre from the world's origin and that point's velocity, its axis and that direction's rate, (3, 1)."""

    centre: Block
    velocity: Block
    axis: Block
    axis_rate: Block


@dataclass(frozen=True, kw_only=True)
class Contact:
    """The road's force (3, 1) on the wheel at ``arm`` (3, 1) from its centre, and the moment (3, 1) of road and spin."""

    arm: Block
    force: Block
    moment: Block
    quantities: dict[str, Block]


def tyre_force(b: Builder, translator: Translator, tyre: Tyre, wheel: Wheel) -> Contact:
    """The contact of one wheel."""
    x, y, z = (b.element(wheel.centre, i) for i in range(3))
    axis = wheel.axis
    slope = b.call("road_slope", x, y, table=tyre.name)
    clearance = b.sub(z, b.call("road_height", x, y, table=tyre.name))
    n_z = b.call("div", b.number(1.0), b.call("sqrt", b.add(b.number(1.0), b.mul(slope, slope))))
    n = b.column([b.neg(b.mul(slope, n_z)), b.zero(1), n_z])
    across = b.cross(axis, n)
    e_x = b.scale(_inverse(b, b.call("sqrt", b.dot(across, across))), across)
    e_y, e_z = b.cross(n, e_x), b.cross(e_x, axis)
    constants = {name: translator.scalar(value) for name, value in tyre.constants.items()}
    deflection = b.sub(constants["radius"], clearance)
    load = _where_positive(b, deflection, b.mul(b.mul(constants["stiffness"], deflection), n_z))
    rolling, drift = b.dot(e_x, wheel.velocity), b.dot(e_y, wheel.velocity)
    moves = b.call("lt", b.number(STANDING), rolling)
    slip = b.call("where", moves, b.call("atan", b.call("div", drift, rolling)), b.zero(1))
    camber = b.call("atan", b.call("div", b.dot(n, axis), b.dot(n, e_z)))
    side, aligning = calspan(b, constants, load, slip, camber) if tyre.lateral else (b.zero(1), b.zero(1))
    side, aligning = (b.call("where", moves, value, b.zero(1)) for value in (side, aligning))
    momentum = b.mul(constants["spin_inertia"], b.call("div", rolling, constants["radius"]))
    height = b.mul(clearance, n_z)
    rolling_arm = b.scale(b.call("div", height, b.dot(n, e_z)), e_z)
    standing_arm = b.scale(height, n)
    return Contact(
        arm=b.neg(_choose(b, moves, rolling_arm, standing_arm)),
        force=b.add(b.scale(load, n), b.scale(side, e_y)),
        moment=b.sub(b.scale(aligning, n), b.scale(momentum, wheel.axis_rate)),
        quantities={"Fz": load, "Fy": side, "Mz": aligning, "slip": slip, "camber": camber, "deflection": deflection},
    )


def calspan(b: Builder, c: Mapping[str, Block], load: Block, slip: Block, camber: Block) -> tuple[Block, Block]:
    """Lateral force and aligning moment of the Calspan model, zero without load."""
    capped = b.call("where", b.call("lt", load, c["A2"]), load, c["A2"])
    share = b.call("div", b.sub(c["A2"], capped), c["A2"])
    cornering = b.add(c["A0"], b.mul(b.mul(c["A1"], capped), share))
    thrust = b.call("div", b.mul(b.mul(c["A3"], b.sub(c["A4"], capped)), capped), c["A4"])
    friction = b.add(b.add(b.mul(c["B1"], load), c["B3"]), b.mul(c["B4"], b.mul(load, load)))
    limit = b.mul(b.mul(friction, c["SN"]), load)
    grips = b.call("lt", b.zero(1), limit)
    demand = b.neg(b.add(b.mul(cornering, slip), b.mul(thrust, camber)))
    a = b.call("div", demand, b.call("where", grips, limit, b.number(1.0)))
    size = b.call("abs", a)
    inside = b.mul(a, b.add(b.sub(b.number(1.0), b.mul(b.number(1 / 3), size)), b.mul(b.number(1 / 27), b.mul(a, a))))
    sliding = b.call("where", b.call("lt", a, b.zero(1)), b.number(-1.0), b.number(1.0))
    side = b.mul(limit, b.call("where", b.call("lt", size, b.number(3.0)), inside, sliding))
    side = b.call("where", grips, side, b.zero(1))
    trail = b.add(b.mul(c["AF1"], load), b.mul(c["AF2"], b.call("abs", side)))
    return side, b.mul(trail, side)


def _choose(b: Builder, condition: Block, yes: Block, no: Block) -> Block:
    """One of two columns."""
    return b.column([b.call("where", condition, b.element(yes, i), b.element(no, i)) for i in range(yes.shape[0])])


def _inverse(b: Builder, x: Block) -> Block:
    return b.call("div", b.number(1.0), x)


def _where_positive(b: Builder, x: Block, value: Block) -> Block:
    return b.call("where", b.call("lt", b.zero(1), x), value, b.zero(1))
