"""The equations of a joint that shared nodes do not imply, as data for the constraints and for `explain`."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TypeAlias

import sympy

from cutjoint.elements.joint import Advance, BodyDirection, Condition, Direction, End, JointDisplacement, Products, SameDistance
from cutjoint.formulate.natural.layout import Layout
from cutjoint.kernels.joints import direction_of, rod_of
from cutjoint.model.records import Joint, Scalar, Vector


@dataclass(frozen=True, kw_only=True)
class Arm:
    """A body-fixed direction in the design position, and its role in the joint."""

    body: str
    place: Vector
    body_direction: BodyDirection


@dataclass(frozen=True, kw_only=True)
class Term:
    """A weight times the product of two vectors: directions, or the displacement between the joint's points."""

    left: Arm | JointDisplacement
    right: Arm | JointDisplacement
    weight: Scalar = field(default_factory=lambda: sympy.Integer(1))


@dataclass(frozen=True, kw_only=True)
class SumRow:
    """A sum of products, less a constant, less ``pitch`` times the joint's angle where there is one, less a guide."""

    name: str
    terms: tuple[Term, ...]
    constant: Scalar | None = None
    pitch: Scalar | None = None
    guide: Scalar | None = None


@dataclass(frozen=True, kw_only=True)
class AngleRow:
    """pointer . (second cos angle - first sin angle) of a coordinate that is a node, or that a guide prescribes."""

    name: str
    coordinate: str
    first: Arm
    second: Arm
    pointer: Arm
    guide: Scalar | None = None


@dataclass(frozen=True, kw_only=True)
class GuidedNode:
    """A coordinate that is a node, less its guide."""

    name: str
    coordinate: str
    guide: Scalar


JointRow: TypeAlias = SumRow | AngleRow | GuidedNode


def joint_rows(layout: Layout, joint: Joint) -> tuple[JointRow, ...]:
    """The equations of a joint in their order: those of its conditions, of its angles that are nodes, of its guide."""
    conditions = joint.element.conditions if joint.name not in layout.idle else ()
    measured = (coordinate for element, coordinate in layout.angles if element == joint.name)
    return (
        *(row for condition in conditions for row in _rows(joint, condition)),
        *(_angle_row(joint, coordinate, coordinate, None) for coordinate in measured),
        *(_guided(joint, coordinate, guide) for coordinate, guide in zip(joint.element.coordinates, joint.guide or (), strict=False)),
    )


def _rows(joint: Joint, condition: Condition) -> Iterator[JointRow]:
    match condition:
        case Products():
            for name, products in zip(condition.names, condition.sums, strict=True):
                terms = (Term(left=_factor(joint, p.left), right=_arm(joint, p.right), weight=sympy.sympify(p.weight)) for p in products)
                yield SumRow(name=name, terms=tuple(terms))
        case SameDistance():
            length = sympy.Matrix(rod_of(joint)).norm()
            square = Term(left=JointDisplacement.VECTOR, right=JointDisplacement.VECTOR, weight=1 / (2 * length))
            yield SumRow(name="length", terms=(square,), constant=length / 2)
        case Advance():
            yield SumRow(name="advance", terms=(_along(joint, Direction.AXIS),), pitch=joint.pitch)


def _along(joint: Joint, direction: Direction) -> Term:
    return Term(left=JointDisplacement.VECTOR, right=_arm(joint, BodyDirection(End.BASE, direction)))


def _factor(joint: Joint, factor: BodyDirection | JointDisplacement) -> Arm | JointDisplacement:
    return factor if isinstance(factor, JointDisplacement) else _arm(joint, factor)


def _arm(joint: Joint, body_direction: BodyDirection) -> Arm:
    body = joint.base if body_direction.end is End.BASE else joint.follower
    return Arm(body=body, place=direction_of(joint, body_direction.direction), body_direction=body_direction)


def angle_arms(joint: Joint, coordinate: str) -> tuple[Arm, Arm, Arm]:
    """An angle's directions: it is counted from the first towards the second, both of one body, to the third, of the other body."""
    measure = joint.element.measures[coordinate]
    other = End.FOLLOWER if measure.carrier is End.BASE else End.BASE
    first, second = (_arm(joint, BodyDirection(measure.carrier, d)) for d in (measure.first, measure.second))
    return first, second, _arm(joint, BodyDirection(other, measure.pointer))


def _angle_row(joint: Joint, name: str, coordinate: str, guide: Scalar | None) -> AngleRow:
    first, second, pointer = angle_arms(joint, coordinate)
    return AngleRow(name=name, coordinate=coordinate, first=first, second=second, pointer=pointer, guide=guide)


def _guided(joint: Joint, coordinate: str, guide: Scalar) -> JointRow:
    name = f"{coordinate}_guide"
    if joint.element.is_screw:
        return GuidedNode(name=name, coordinate=coordinate, guide=guide)
    if coordinate in joint.element.measures:
        return _angle_row(joint, name, coordinate, guide)
    return SumRow(name=name, terms=(_along(joint, joint.element.slide_direction(coordinate)),), guide=guide)
