"""Force laws over the motion of a force element's own points and directions: shared by all formulations.

A formulation says how the points move and where the forces go; what the force is, stands here.
"""

from __future__ import annotations

from collections.abc import Mapping

import sympy

from cutjoint.formulate.translate import Translator
from cutjoint.model.records import Bushing, Force, PointSpring, Scalar, Scene
from cutjoint.program.blocks import Block, Builder

LENGTH, RATE = sympy.Symbol("length", real=True), sympy.Symbol("rate", real=True)
TRAVEL, POSITION = sympy.Symbol("travel", real=True), sympy.Symbol("position", real=True)

#: The variables of a load's components: place and velocity of its point, angular velocity of its body.
PLACE = sympy.symbols("x y z vx vy vz wx wy wz", real=True)


def is_active(force: Force, scene: Scene) -> bool:
    """Whether the scene has the force switched on."""
    return scene.switches.get(force.name, force.active)


def law_of(translator: Translator, law: Scalar, values: Mapping[Scalar, Block], position: Scalar) -> dict[str, Block]:
    """A law's value and its partial derivatives by position and rate."""
    known = translator.with_values(values)
    return {
        "force": known.scalar(law),
        "stiffness": known.scalar(sympy.diff(law, position)),
        "damping": known.scalar(sympy.diff(law, RATE)),
    }


def spring_pull(b: Builder, translator: Translator, force: PointSpring, way: Block, speed: Block) -> tuple[Block, dict[str, Block]]:
    """The force (3, 1) on the follower's point at ``way`` (3, 1) from the base's, whose rate is ``speed``; and its quantities."""
    length = b.call("sqrt", b.dot(way, way))
    n = b.scale(b.call("div", b.number(1.0), length), way)
    rate = b.dot(n, speed)
    law = law_of(translator, force.law, {LENGTH: length, RATE: rate}, LENGTH)
    return b.neg(b.scale(law["force"], n)), {**law, "length": length, "rate": rate}


def bushing_laws(
    b: Builder, translator: Translator, force: Bushing, places: tuple[Block, Block], rates: tuple[Block, Block], by_turn: Block
) -> tuple[Block, Block, dict[str, Block]]:
    """Force and torque (3, 1) on the follower in the bushing's axes, and its quantities.

    ``places`` are displacement and rotation, ``rates`` their rates, ``by_turn`` (3, 3) the rotation's Jacobian by the relative
    angular velocity.
    """
    laws = [
        translator.with_values({POSITION: b.element(places[i // 3], i % 3), RATE: b.element(rates[i // 3], i % 3)}).scalar(law)
        for i, law in enumerate(force.laws)
    ]
    pull, torque = b.column(laws[:3]), b.mul(b.transpose(by_turn), b.column(laws[3:]))
    columns = {"F": pull, "M": torque, "d": places[0], "r": places[1]}
    quantities = {f"{name}{axis}": b.element(block, i) for name, block in columns.items() for i, axis in enumerate("xyz")}
    return pull, torque, quantities
