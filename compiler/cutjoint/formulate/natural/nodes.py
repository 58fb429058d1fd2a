"""Points and unit vectors, the material of natural coordinates, and their linear combinations."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import TypeAlias

from cutjoint.model.records import GROUND, Scalar, Vector
from cutjoint.program.blocks import Block, Builder

_ROUNDING = 1e-13  #: a coefficient smaller than this against the others is rounding


class NodeKind(StrEnum):
    """The kind of a node: a point in m, a direction, or the angle of a joint in rad."""

    POINT = "point"
    VECTOR = "vector"
    ANGLE = "angle"


@dataclass(frozen=True)
class NodeName:
    """The name of a node: ``which`` of an element's points and directions.
    ``group`` and ``number`` are those of its rigid group, where another node has the plain name. As text ``group.element.which_number``."""

    element: str
    which: str = ""
    group: str = ""
    number: int = 1

    def __str__(self) -> str:
        return ".".join(filter(None, (self.group, self.element, self.which))) + (f"_{self.number}" if self.number > 1 else "")


def record(builder: Builder, block: Block, symbol: str, *names: NodeName | str) -> None:
    """Record a block as a quantity of nodes, by their titles, and of elements, by their names."""
    titles = [name if isinstance(name, NodeName) else NodeName(name) for name in names]
    parts = (part for title in titles for part in (title.element, title.group))
    builder.record(block, symbol, *parts, which=tuple(which for title in titles for which in (title.which, title.number)))


@dataclass(frozen=True, eq=False, kw_only=True)
class Node:
    """A point or direction of one or more bodies, or a joint's angle; equal only to itself.
    ``place`` is its value in the design position (global axes), ``body`` one that carries it. A node of the ground is constant, a node
    with ``parts`` is that linear combination of others of its body, any other is a coordinate: three, or one of an angle."""

    title: NodeName
    kind: NodeKind
    body: str
    place: Vector
    parts: "Form | None" = None

    @property
    def name(self) -> str:
        """The node's title as text; no other node has it."""
        return str(self.title)

    @property
    def is_coordinate(self) -> bool:
        """Return whether the node is an unknown of its own."""
        return self.parts is None and self.body != GROUND

    @property
    def size(self) -> int:
        """The number of its scalars."""
        return 1 if self.kind is NodeKind.ANGLE else 3

    def __repr__(self) -> str:
        return f"<{self.kind} {self.name}>"


#: A linear combination of nodes with scalar coefficients.
Form: TypeAlias = Mapping[Node, Scalar]

@dataclass(frozen=True)
class Use:
    """A form with a sign, as the bodies of one rigid group have it: what they share with others stands for them there."""

    sign: int
    group: str
    form: Form


#: A sum of forms, each as one group has it.
Uses: TypeAlias = tuple[Use, ...]


def combine(*terms: tuple[Scalar, Form]) -> dict[Node, Scalar]:
    """The sum of forms with factors, without cancelled terms."""
    result: dict[Node, Scalar] = {}
    for factor, form in terms:
        for node, coefficient in form.items():
            result[node] = result.get(node, 0) + factor * coefficient
    return {node: c for node, c in result.items() if not is_zero(c)}


def total(uses: Uses) -> Form:
    """The sum of uses."""
    return combine(*((use.sign, use.form) for use in uses)) if len(uses) > 1 else uses[0].form


def is_zero(value: Scalar) -> bool:
    """Return whether a coefficient of order one is zero but for rounding."""
    if not isinstance(value, int | float):
        if not value.is_number:
            return False
        value = float(value)
    return bool(abs(value) < _ROUNDING)


def difference(a: Form, b: Form) -> dict[Node, Scalar]:
    """a - b."""
    return combine((1, a), (-1, b))
