"""The constraint equations of a description: what each is a product, turn or component of.

- ``product``: sum of weight (u . w) over up to two pairs of forms - value - course - factor angle of up to two angles,
- ``turned``: f . (b_2 cos angle - b_1 sin angle), the angle a node or a course,
- ``component``: an element of a form,
- ``angle``: an angle less its course.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import sympy

from cutjoint.elements.gear import NAMES as GEAR_NAMES
from cutjoint.elements.joint import JointDisplacement
from cutjoint.formulate.natural.constraints import row_scale, surplus_tangents
from cutjoint.formulate.natural.equations import LagrangianEquations
from cutjoint.formulate.natural.joint_rows import AngleRow, JointRow, SumRow, joint_rows
from cutjoint.formulate.natural.layout import Group, combination
from cutjoint.formulate.natural.nodes import Form, Node, NodeKind, Use, Uses
from cutjoint.model.records import Gear, Joint, Scalar
from cutjoint_bench.generic.natural.forms import FormTable
from cutjoint_bench.generic.trees import Json, Trees


@dataclass(frozen=True, kw_only=True)
class Row:
    """An equation of a body, joint or gear over forms; ``pulls`` says that it holds the way between the joint's points, its first form."""

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
        self._gears = equations.topology.model.gears
        self._table = table
        self._trees = trees

    def all(self) -> Iterator[Row]:
        for group in self._layout.groups.values():
            yield from self._body(group)
        for joint in self._joints:
            yield from (self._joint(joint, row) for row in joint_rows(self._layout, joint))
        yield from map(self._gear, self._gears)

    # Bodies

    def _body(self, group: Group) -> Iterator[Row]:
        for u, w in group.pairs:
            name = _end(u) if u == w else f"{_end(u)}*{_end(w)}"
            yield self._remaining_row(group, name, u, w)
        for node in group.surplus:
            yield from self._held(group, node)

    def _remaining_row(self, group: Group, name: str, u: Form, w: Form) -> Row:
        """A product that keeps its design value; of two ways between points over the longer one's length."""
        p, q = (_place(form) for form in (u, w))
        weight = row_scale(self._layout, u, w)
        details = {"kind": "product", "weights": [weight], "value": self._trees.one(weight * p.dot(q))}
        return Row(element=group.name, name=name, details=details, forms=((Use(1, group.name, u),), (Use(1, group.name, w),)))

    def _held(self, group: Group, node: Node) -> Iterator[Row]:
        """A shared node that the basis of a group does not have."""
        shared = Use(1, node.body, {node: 1})
        directions = surplus_tangents(self._layout, group, node)
        if directions is not None:
            for i, across in enumerate(directions, start=1):
                body_use = Use(1, group.name, combination(group, NodeKind.VECTOR, across))
                yield self._product(group.name, f"{node.name}.{i}", (shared,), (body_use,))
        else:
            gap = (shared, Use(-1, group.name, combination(group, node.kind, node.place)))
            for i, axis in enumerate("xyz"):
                yield Row(element=group.name, name=f"{node.name}.{axis}", details={"kind": "component", "axis": i}, forms=(gap,))

    def _product(self, element: str, name: str, u: Uses, w: Uses) -> Row:
        return Row(element=element, name=name, details={"kind": "product", "weights": [1.0]}, forms=(u, w))

    # Joints

    def _joint(self, joint: Joint, row: JointRow) -> Row:
        match row:
            case SumRow():
                return self._sum(joint, row)
            case AngleRow():
                forms = tuple(self._table.direction(arm.body, arm.place) for arm in (row.pointer, row.first, row.second))
                turn = {"angle": self._angle(joint, row.coordinate)} if row.guide is None else self._course(row.guide)
                return Row(element=joint.name, name=row.name, details={"kind": "turned", **turn}, forms=forms)
        details = {"kind": "angle", "angle": self._angle(joint, row.coordinate), **self._course(row.guide)}
        return Row(element=joint.name, name=row.name, details=details)

    def _sum(self, joint: Joint, row: SumRow) -> Row:
        details: Json = {"kind": "product", "weights": [self._trees.one(term.weight) for term in row.terms]}
        if row.constant is not None:
            details["value"] = self._trees.one(row.constant)
        if row.pitch is not None:
            details["angles"] = [[self._angle(joint, *joint.element.coordinates), self._trees.one(row.pitch)]]
        if row.guide is not None:
            details |= self._course(row.guide)
        way = self._table.way((joint.follower, joint.to or joint.at), (joint.base, joint.at))
        factors = [factor for term in row.terms for factor in (term.left, term.right)]
        forms = tuple(way if isinstance(f, JointDisplacement) else self._table.direction(f.body, f.place) for f in factors)
        return Row(element=joint.name, name=row.name, details=details, forms=forms, pulls=factors[0] is JointDisplacement.VECTOR)

    def _angle(self, joint: Joint, coordinate: str) -> int:
        return self._layout.nodes.index(self._layout.angles[joint.name, coordinate])

    def _course(self, guide: Scalar) -> Json:
        return {"course": self._trees.guide(guide)}

    # Gears

    def _gear(self, gear: Gear) -> Row:
        """The sum of a gear's coordinates with their factors."""
        joints = {joint.name: joint for joint in self._joints}
        forms: list[Uses] = []
        weights: list[Any] = []
        angles: list[Any] = []
        course: Json = {}
        for coordinate, factor in gear.terms:
            joint = joints[coordinate.joint]
            if (coordinate.joint, coordinate.name) in self._layout.angles:
                angles.append([self._angle(joint, coordinate.name), self._trees.one(-factor)])
            elif joint.guide is not None:
                course = self._course(-factor * joint.guide[joint.element.coordinates.index(coordinate.name)])
            else:
                weights.append(self._trees.one(factor))
                forms += self._table.slide(joint, coordinate.name)
        details = {"kind": "product", "weights": weights, "angles": angles, **course}
        return Row(element=gear.name, name=GEAR_NAMES[0], details=details, forms=tuple(forms))


def _place(form: Form) -> sympy.Matrix:
    """A form's value in the design position."""
    return sum((c * sympy.Matrix(node.place) for node, c in form.items()), sympy.zeros(3, 1))


def _end(form: Form) -> str:
    """A way by the name of its end."""
    return next(iter(form)).name
