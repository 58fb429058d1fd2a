"""Gears in relative coordinates: Phi = sum of factor times coordinate, whose Jacobian is constant, or q_a - f(q_b), with f'' in its drift.

A guided coordinate is a function of time; it has a part in the residual, its rate and its drift, and none in the Jacobian.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from cutjoint.elements.gear import NAMES, equation
from cutjoint.formulate.inputs import Numbers, gear_derivatives
from cutjoint.formulate.recursive.kinematics import Kinematics
from cutjoint.formulate.recursive.loops import Closing, stabilisation
from cutjoint.model.records import Gear
from cutjoint.program.blocks import BindingTime, Block, Builder


@dataclass(frozen=True, kw_only=True)
class GearClosure(Closing):
    """A gear's blocks, with the ``drift`` that guides and the curvature of a law add to Phi''.

    * ``row``: its Jacobian, by body whose joint has unknowns: (place among these, factor)
    * ``row_derivative``: in the same form, the derivative of the factor with respect to its coordinate, where a law has one
    """

    gear: Gear
    drift: Block
    row: Mapping[str, tuple[int, Block]]
    row_derivative: Mapping[str, tuple[int, Block]]

    @property
    def element(self) -> Gear:
        """The gear."""
        return self.gear

    def columns(self, b: Builder, body: str, size: int) -> Block:
        """The Jacobian by the unknowns of a body's joint, (1, size)."""
        if body not in self.row:
            return b.zero(1, size)
        place, factor = self.row[body]
        return b.stack([[factor if i == place else b.zero(1) for i in range(size)]])


def derive_gears(k: Kinematics, gears: tuple[Gear, ...], numbers: Numbers) -> tuple[GearClosure, ...]:
    """The blocks of every gear."""
    found = []
    for gear in gears:
        with k.builder.section("closure", gear.name, f"{equation(gear.law is not None)}, s = 2 xi w Phi' + w^2 Phi", gear.span.place):
            found.append(_derive(k, gear, numbers))
    return tuple(found)


def _derive(k: Kinematics, gear: Gear, numbers: Numbers) -> GearClosure:
    b, name = k.builder, gear.name
    motions = {m.tree_joint.joint.name: m for m in k.motions.values()}
    row, row_derivative = dict[str, tuple[int, Block]](), dict[str, tuple[int, Block]]()
    residual = rate = drift = b.zero(1)
    for coordinate, number in gear.terms:
        motion, factor = motions[coordinate.joint], k.translator.scalar(number)
        place = motion.tree_joint.joint.element.coordinates.index(coordinate.name)
        residual = b.add(residual, b.mul(factor, motion.position[place]))
        rate = b.add(rate, b.mul(factor, motion.rate[place]))
        if motion.acceleration:
            drift = b.add(drift, b.mul(factor, motion.acceleration[place]))
        else:
            row[motion.tree_joint.child] = place, factor
    if gear.law is not None:
        motion = motions[gear.second.joint]
        place = motion.tree_joint.joint.element.coordinates.index(gear.second.name)
        position, speed = motion.position[place], motion.rate[place]
        law, derivative, second = (b.neg(each) for each in gear_derivatives(gear, k.translator, position))
        residual, rate = b.add(residual, law), b.add(rate, b.mul(derivative, speed))
        drift = b.add(drift, b.mul(second, b.mul(speed, speed)))
        if motion.acceleration:
            drift = b.add(drift, b.mul(derivative, motion.acceleration[place]))
        else:
            row[motion.tree_joint.child], row_derivative[motion.tree_joint.child] = (place, derivative), (place, second)
    b.name(residual, "Phi", name, rows=NAMES)
    b.name(rate, "Phid", name, rows=NAMES)
    of_rate, of_residual = stabilisation(b, numbers)
    s = b.name(b.add(drift, b.add(b.scale(of_rate, rate), b.scale(of_residual, residual))), "s", name, rows=NAMES)
    multipliers = b.symbol(f"lambda:{name}", 1, BindingTime.ITERATION)
    return GearClosure(
        gear=gear, names=NAMES, residual=residual, rate=rate, drift=drift, s=s, multipliers=multipliers,
        row=row, row_derivative=row_derivative,
    )  # fmt: skip
