"""Expressions as trees in the descriptions (JSON) for the generic solvers, which interpret a model at run time.

A tree is a number, ``["p", i]`` for parameter i, ``["u", i]`` for number i of the inputs (three of each), ``["t"]``, ``["motion"]`` (0
where the mechanism is held at rest, else 1), a variable of the law by name, or ``[operation, tree, ...]`` with the operations of the block
IR.  Parameters of binding const are numbers.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, TypeAlias

import sympy

from cutjoint.formulate.inputs import INPUT_ORDERS, INPUTS, TIME, guide_rates, input_functions, input_parameters, make_translator
from cutjoint.formulate.translate import Translator
from cutjoint.model.expressions.parse import variable
from cutjoint.model.records import BodyLoad, Force, Model, Scalar, Scene, Tyre
from cutjoint.program.blocks import BindingTime, Block, Builder

Json: TypeAlias = dict[str, Any]

#: Variables of the laws.
VARIABLES = ("length", "travel", "position", "rate", "x", "y", "z", "vx", "vy", "vz", "wx", "wy", "wz")


@dataclass(frozen=True)
class Trees:
    """Writes SymPy expressions of a model in a scene as trees, by way of the block IR's scalars."""

    translator: Translator
    model: Model
    scene: Scene

    @classmethod
    def of(cls, model: Model, scene: Scene) -> Trees:
        """The trees of a model in a scene."""
        builder = Builder()
        variables = {variable(n): builder.symbol(n, 1, BindingTime.ITERATION) for n in VARIABLES}
        return cls(make_translator(builder, model).with_values(variables), model, scene)

    def one(self, expression: Scalar) -> Any:
        """One expression."""
        return _tree(self.translator.scalar(expression))

    def all(self, expressions: Iterable[Scalar]) -> list[Any]:
        """Several expressions."""
        return [self.one(e) for e in expressions]

    def guide(self, guide: Scalar) -> list[Any]:
        """A guided coordinate and its first two rates."""
        position, *rates = self.all(guide_rates(guide, self.model))
        return [position, *map(in_motion, rates)]

    def inputs(self) -> list[Json]:
        """The inputs, each with its law in the scene and the law's first and second derivative."""
        laws = input_functions(self.model, self.scene)
        return [
            {
                "name": p.name, "unit": p.unit, "default": p.value,
                "law": self.all(sympy.diff(laws[p.symbol], TIME, order) for order in range(len(INPUT_ORDERS))),
            }
            for p in input_parameters(self.model)
        ]  # fmt: skip

    def law(self, law: Scalar, position: str) -> Json:
        """A law with its partial derivatives by a position and its rate."""
        by_position, by_rate = (sympy.diff(law, variable(name)) for name in (position, "rate"))
        return {"force": self.one(law), "stiffness": self.one(by_position), "damping": self.one(by_rate)}

    def constants(self, tyre: Tyre) -> Json:
        """The constants of a tyre by name."""
        return {name: self.one(value) for name, value in tyre.constants.items()}

    def loads(self, load: BodyLoad) -> list[Any]:
        """The components of a load, zero at rest if it acts in motion only."""
        return self.only_moving(load, self.all(load.components))

    @staticmethod
    def only_moving(load: BodyLoad, trees: list[Any]) -> list[Any]:
        """Trees of a load, zero at rest if it acts in motion only."""
        return [in_motion(tree) for tree in trees] if load.moving_only else trees


def in_motion(tree: Any) -> Any:
    """Zero where the mechanism is held at rest."""
    return ["mul", ["motion"], tree]


def _tree(block: Block) -> Any:
    data: Any = block.data
    match block.op:
        case "const":
            return data[0][0]
        case "symbol":
            return ["p", 0] if data == "parameters" else [data]
        case "take":  # of the column of parameters, or of that of inputs
            return ["u" if block.args[0].data == INPUTS else "p", data[0][0]]
        case "call":
            return [data[0], *map(_tree, block.args)]
        case "add" | "sub" | "mul" | "neg":
            return [block.op, *map(_tree, block.args)]
    raise ValueError(f"{block!r} is not a scalar expression")


#: The first quantities of a force with one law, as the generic solvers write them.
_FIRST = ("force", "stiffness", "damping")


def quantity_names(force: Force) -> list[str]:
    """The quantities that a force reports, in the order in which the generic solvers write them."""
    return sorted(force.quantities, key=lambda name: _FIRST.index(name) if name in _FIRST else len(_FIRST))
