"""Force laws over the motion of a force element's own points and directions: shared by all formulations.

A formulation says how the points move and where the forces go; what the force is, stands here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import reduce

import sympy

from cutjoint.formulate.layout import Slot
from cutjoint.formulate.records import Function
from cutjoint.formulate.translate import Translator
from cutjoint.model.records import Force, Guard, Model, Scalar, Scene
from cutjoint.program.blocks import Block, Builder

LENGTH, RATE = sympy.Symbol("length", real=True), sympy.Symbol("rate", real=True)
TRAVEL, POSITION = sympy.Symbol("travel", real=True), sympy.Symbol("position", real=True)

#: The variables of a load's components: place and velocity of its point, angular velocity of its body.
PLACE = sympy.symbols("x y z vx vy vz wx wy wz", real=True)


#: The lateral force of a tyre, in the margins of its guard.
SIDE = sympy.Symbol("side", real=True)


def is_active(force: Force, scene: Scene) -> bool:
    """Return whether the scene has the force switched on."""
    return scene.switches.get(force.name, force.active)


def guards_of(model: Model, scene: Scene) -> tuple[Guard, ...]:
    """The guards of forces that the scene has switched on."""
    return tuple(guard for guard in model.guards if is_active(guard.force, scene))


def smallest_margin(b: Builder, translator: Translator, guard: Guard, values: Mapping[Scalar, Block]) -> Block:
    """The smallest margin of a guard; ``values`` are those of its law's variables."""
    known = translator.with_values(values)
    return reduce(lambda one, other: b.call("where", b.call("lt", one, other), one, other), (known.scalar(m) for m in guard.margins))


def guard_function(margins: Mapping[str, Block]) -> tuple[Function, ...]:
    """The function ``guard``: q, v -> the smallest margin of each guarded force, by name; none if there is no guard."""
    arguments = ("const Real* q", "const Real* v", "Real* margin")
    results = {f"margin:{name}": margin for name, margin in margins.items()}
    return (Function(name="guard", arguments=arguments, results=results),) if margins else ()


def margin_slots(model: Model, scene: Scene) -> dict[str, Slot]:
    """The places of the guards' margins."""
    names = [guard.force.name for guard in guards_of(model, scene)]
    return {f"margin:{name}": Slot(array="margin", offset=i, names=("margin",)) for i, name in enumerate(names)}


def law_of(translator: Translator, law: Scalar, values: Mapping[Scalar, Block], position: Scalar) -> dict[str, Block]:
    """A law's value and its partial derivatives by position and rate."""
    known = translator.with_values(values)
    return {
        "force": known.scalar(law),
        "stiffness": known.scalar(sympy.diff(law, position)),
        "damping": known.scalar(sympy.diff(law, RATE)),
    }


def stretch(b: Builder, way: Block, speed: Block) -> tuple[Block, dict[Scalar, Block]]:
    """Direction (3, 1) of the way (3, 1) between two points, its length, and the length's rate when the way's is ``speed``."""
    length = b.call("sqrt", b.dot(way, way))
    n = b.scale(b.call("div", b.number(1.0), length), way)
    return n, {LENGTH: length, RATE: b.dot(n, speed)}


def line_force(b: Builder, translator: Translator, law: Scalar, way: Block, speed: Block) -> tuple[Block, dict[str, Block]]:
    """The force (3, 1) on the follower's point at ``way`` (3, 1) from the base's, whose rate is ``speed``; and its quantities."""
    n, values = stretch(b, way, speed)
    pull = law_of(translator, law, values, LENGTH)
    return b.neg(b.scale(pull["force"], n)), {**pull, **reported_variables(values)}


def reported_variables(values: Mapping[Scalar, Block]) -> dict[str, Block]:
    """The motion that a law depends on, as reported quantities; a coordinate is its joint's."""
    return {} if POSITION in values else {symbol.name: block for symbol, block in values.items()}


def six_laws(
    b: Builder, translator: Translator, expressions: Sequence[Scalar], places: tuple[Block, Block], rates: tuple[Block, Block],
    by_turn: Block,
) -> tuple[Block, Block, dict[str, Block]]:
    """Force and torque (3, 1) on the follower in the axes of six laws along and about them, and their quantities.

    ``places`` are displacement and rotation, ``rates`` their rates, ``by_turn`` (3, 3) the rotation's Jacobian by the relative
    angular velocity.
    """
    laws = [
        translator.with_values({POSITION: b.element(places[i // 3], i % 3), RATE: b.element(rates[i // 3], i % 3)}).scalar(law)
        for i, law in enumerate(expressions)
    ]
    pull, torque = b.column(laws[:3]), b.mul(b.transpose(by_turn), b.column(laws[3:]))
    columns = {"F": pull, "M": torque, "d": places[0], "r": places[1]}
    quantities = {f"{name}{axis}": b.element(block, i) for name, block in columns.items() for i, axis in enumerate("xyz")}
    return pull, torque, quantities
