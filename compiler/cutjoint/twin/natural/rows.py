"""The constraint equations of a description: what each is a product, turn or component of.

- ``product``: weight (u . w) - value - course - factor angle,
- ``turned``: f . (b_2 cos angle - b_1 sin angle), the angle a node or a course,
- ``component``: an element of a form,
- ``angle``: an angle less its course.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import sympy

from cutjoint.formulate.directions import tangents
from cutjoint.formulate.natural.constraints import held_across, kept_weight, slide_axis
from cutjoint.formulate.natural.layout import Group, combination
from cutjoint.formulate.natural.needs import ANGLES, angle_axes
from cutjoint.formulate.natural.nodes import Form, Node, NodeKind, Use, Uses
from cutjoint.formulate.natural.records import LagrangianEquations
from cutjoint.model.records import COORDINATES, Joint, JointKind, Scalar
from cutjoint.twin.natural.forms import FormTable
from cutjoint.twin.trees import Json, Trees


@dataclass(frozen=True, kw_only=True)
class Row:
    """An equation of a body or joint over forms; ``pulls`` says that it holds the way between the joint's points, its first form."""

    element: str
    name: str
    details: Json
    forms: tuple[Uses, ...] = ()
    pulls: bool = False


def rows_of(equations: LagrangianEquations, table: FormTable, trees: Trees) -> list[Row]:
    """The equations in their order."""
    maker = _Rows(equations, table, trees)
    known = {(row.element, row.name): row for row in maker.all()}
    return [known[c.element, name] for c in equations.constraints for name in c.names]


class _Rows:
    def __init__(self, equations: LagrangianEquations, table: FormTable, trees: Trees) -> None:
        self._layout = equations.layout
        self._joints = equations.topology.model.joints
        self._table = table
        self._trees = trees

    def all(self) -> Iterator[Row]:
        for group in self._layout.groups.values():
            yield from self._body(group)
        for joint in self._joints:
            yield from self._open(joint)
            yield from self._measured(joint)
            if joint.guide is not None:
                yield from self._guided(joint, joint.guide)

    # Bodies

    def _body(self, group: Group) -> Iterator[Row]:
        for u, w in group.pairs:
            name = _end(u) if u == w else f"{_end(u)}*{_end(w)}"
            yield self._kept(group, name, u, w)
        for node in group.surplus:
            yield from self._held(group, node)

    def _kept(self, group: Group, name: str, u: Form, w: Form) -> Row:
        """A product that keeps its design value; of two ways between points over the longer one's length."""
        p, q = (_place(form) for form in (u, w))
        weight = kept_weight(self._layout, u, w)
        details = {"kind": "product", "weight": weight, "value": self._trees.one(weight * p.dot(q))}
        return Row(element=group.name, name=name, details=details, forms=((Use(1, group.name, u),), (Use(1, group.name, w),)))

    def _held(self, group: Group, node: Node) -> Iterator[Row]:
        """A shared node that the basis of a group does not have."""
        shared = Use(1, node.body, {node: 1})
        directions = held_across(self._layout, group, node)
        if directions is not None:
            for i, across in enumerate(directions, start=1):
                own = Use(1, group.name, combination(group, NodeKind.VECTOR, across))
                yield self._product(group.name, f"{node.name}.{i}", (shared,), (own,))
        else:
            gap = (shared, Use(-1, group.name, combination(group, node.kind, node.place)))
            for i, axis in enumerate("xyz"):
                yield Row(element=group.name, name=f"{node.name}.{axis}", details={"kind": "component", "axis": i}, forms=(gap,))

    def _product(self, element: str, name: str, u: Uses, w: Uses, *, pulls: bool = False, **more: object) -> Row:
        return Row(element=element, name=name, details={"kind": "product", "weight": 1.0, **more}, forms=(u, w), pulls=pulls)

    # Joints

    def _way(self, joint: Joint) -> Uses:
        return self._table.way((joint.follower, joint.to or joint.at), (joint.base, joint.at))

    def _across(self, joint: Joint, name: str, axis: tuple[Scalar, ...], **more: object) -> Row:
        """A displacement along a direction of the base."""
        x, y, z = axis
        return self._product(joint.name, name, self._way(joint), self._table.direction(joint.base, (x, y, z)), pulls=True, **more)

    def _open(self, joint: Joint) -> Iterator[Row]:
        match joint.kind:
            case JointKind.UNIVERSAL:
                axes = self._table.direction(joint.base, joint.axes[0]), self._table.direction(joint.follower, joint.axes[1])
                yield self._product(joint.name, "angle", *axes)
            case JointKind.PRISMATIC | JointKind.CYLINDRICAL | JointKind.POINT_ON_LINE | JointKind.SCREW:
                for i, tangent in enumerate(tangents(joint, joint.axes[0]), start=1):
                    yield self._across(joint, f"across_{i}", tuple(tangent))
            case JointKind.PLANAR:
                yield self._across(joint, "height", joint.axes[0])
            case JointKind.DISTANCE:
                assert joint.to is not None
                length = (sympy.Matrix(joint.to) - sympy.Matrix(joint.at)).norm()
                details = {"kind": "product", "weight": self._trees.one(1 / (2 * length)), "value": self._trees.one(length / 2)}
                yield Row(element=joint.name, name="length", details=details, forms=(self._way(joint),) * 2, pulls=True)
        if joint.kind is JointKind.SCREW:
            turn = {"angle": self._angle(joint, "angle"), "factor": self._trees.one(joint.pitch)}
            yield self._across(joint, "advance", joint.axes[0], **turn)

    def _angle(self, joint: Joint, coordinate: str) -> int:
        return self._layout.nodes.index(self._layout.angles[joint.name, coordinate])

    def _turned(self, joint: Joint, name: str, coordinate: str, turn: Json) -> Row:
        body, b_1, b_2, other, f = angle_axes(joint, coordinate)
        forms = (self._table.direction(other, f), self._table.direction(body, b_1), self._table.direction(body, b_2))
        return Row(element=joint.name, name=name, details={"kind": "turned", **turn}, forms=forms)

    def _measured(self, joint: Joint) -> Iterator[Row]:
        """What the angles that are coordinates measure."""
        for element, coordinate in self._layout.angles:
            if element == joint.name:
                yield self._turned(joint, coordinate, coordinate, {"angle": self._angle(joint, coordinate)})

    def _guided(self, joint: Joint, guides: tuple[Scalar, ...]) -> Iterator[Row]:
        for coordinate, guide in zip(COORDINATES[joint.kind], guides, strict=True):
            name, course = f"{coordinate}_guide", {"course": self._trees.guide(guide)}
            if joint.kind is JointKind.SCREW:
                details = {"kind": "angle", "angle": self._angle(joint, coordinate), **course}
                yield Row(element=joint.name, name=name, details=details)
            elif coordinate in ANGLES.get(joint.kind, ()):
                yield self._turned(joint, name, coordinate, course)
            else:
                yield self._across(joint, name, slide_axis(joint, coordinate), **course)


def _place(form: Form) -> sympy.Matrix:
    """A form's value in the design position."""
    return sum((c * sympy.Matrix(node.place) for node, c in form.items()), sympy.zeros(3, 1))


def _end(form: Form) -> str:
    """A way by the name of its end."""
    return next(iter(form)).name
