"""The reported columns of a description: where each value comes from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import sympy

from cutjoint.formulate.natural.nodes import Node, Use, Uses
from cutjoint.formulate.natural.outputs import FreeBody, find_free_body, require_force, share, slide_forces
from cutjoint.formulate.recursive.kinematics import ATTITUDE
from cutjoint.model.elements.geometry import GLOBAL_AXES
from cutjoint.model.expressions.quantities import reaction_component, reported_element, unit_of
from cutjoint.model.records import Body, Gear, Joint, Marker, Output, Reaction, Scalar, Vector
from cutjoint_bench.generic.mechanism import force_source
from cutjoint_bench.generic.natural.forces import ForceElement
from cutjoint_bench.generic.natural.forms import FormTable, is_ground
from cutjoint_bench.generic.natural.masses import masses_of
from cutjoint_bench.generic.natural.rows import Row
from cutjoint_bench.generic.trees import Json, Trees


@dataclass(frozen=True, kw_only=True)
class Reports:
    """Describes outputs of a system with these equations and forces."""

    table: FormTable
    trees: Trees
    rows: Sequence[Row]
    forces: Sequence[ForceElement]

    def describe(self, output: Output) -> Json:
        """One column."""
        source = self._source(output, reported_element(self.trees.model, output))
        return {"name": output.column, "unit": unit_of(self.trees.model, output), **source}

    def _source(self, output: Output, element: Any) -> Json:
        match element:
            case Body():
                return self._motion(element.name, element.centre_of_mass, output.quantity)
            case Marker():
                return self._motion(element.body, element.point, output.quantity)
            case Reaction():
                return self._reaction(element, output.quantity)
            case Joint():
                return self._joint(element, output.quantity)
            case Gear():
                return {"kind": "gear", "equation": next(i for i, row in enumerate(self.rows) if row.element == element.name)}
        return force_source(output, element, self.trees.scene)

    def _axes(self, body: str) -> list[int] | None:
        """The numbers of a body's directions; none of a body that stands still."""
        if is_ground(self.table.layout, body):
            return None
        return [self.table.number(self.table.direction(body, axis)) for axis in GLOBAL_AXES]

    def _motion(self, body: str, point: Vector, quantity: str) -> Json:
        if quantity in ATTITUDE:
            axes = [self.table.number(self.table.direction(body, axis)) for axis in GLOBAL_AXES]
            return {"kind": "attitude", "angle": quantity, "axes": axes}
        axis, kind = "xyz".index(quantity[-1]), quantity[:-1]
        if kind == "w":
            return {"kind": "spin", "axes": self._axes(body), "axis": axis}
        kinds = {"": "position", "v": "velocity", "a": "acceleration"}
        return {"kind": kinds[kind], "form": self.table.number(self.table.point(body, point)), "axis": axis}

    # Joints

    def _joint(self, joint: Joint, quantity: str) -> Json:
        if quantity in ("wx", "wy", "wz"):
            inner, outer = self.table.layout.outwards[joint.name]
            direction = self.table.direction(inner, GLOBAL_AXES["xyz".index(quantity[-1])])
            axes = {"inner": self._axes(inner), "outer": self._axes(outer)}
            return {"kind": "relative_spin", **axes, "direction": self.table.number(direction)}
        is_rate = quantity not in joint.element.coordinates
        index = (joint.element.speeds if is_rate else joint.element.coordinates).index(quantity)
        return {**self._coordinate(joint, index), "rate": is_rate}

    def _coordinate(self, joint: Joint, index: int) -> Json:
        layout, coordinate = self.table.layout, joint.element.coordinates[index]
        if joint.guide is not None:
            return {"kind": "course", "course": self.trees.guide(joint.guide[index])}
        if (joint.name, coordinate) in layout.angles:
            return {"kind": "angle", "angle": layout.nodes.index(layout.angles[joint.name, coordinate])}
        way, axis = self.table.slide(joint, coordinate)
        return {"kind": "slide", "displacement": self.table.number(way), "axis": self.table.number(axis)}

    # Reactions

    def _reaction(self, reaction: Reaction, quantity: str) -> Json:
        """The force of a joint on its follower along a direction.

        A joint whose equations hold the way between its points pulls with their multipliers; else see formulate/natural/outputs.py.
        """
        model, layout = self.trees.model, self.table.layout
        joint = next(j for j in model.joints if j.name == reaction.joint)
        require_force(model, reaction, joint, quantity)
        _, along = reaction_component(reaction, quantity)
        direction = {"kind": "reaction", "direction": self.table.number(self.table.direction(reaction.body, along))}
        held = [(i, row) for i, row in enumerate(self.rows) if row.element == joint.name and row.pulls]
        if held:
            rows = [[i, [int(uses is row.forms[0]) for uses in row.forms]] for i, row in held]
            pushes = {force.name: sign for force, sign in slide_forces(layout, model, joint)}
            forces = [[i, [pushes[force.name], 0]] for i, force in enumerate(self.forces) if force.name in pushes]
            return {**direction, "sign": -1, "rows": rows, "masses": [], "forces": forces, "weight": 0}
        free_body = find_free_body(layout, model, reaction, joint)
        if not free_body.is_surplus:
            return {**direction, "sign": free_body.sign, **self._of_free_body(free_body)}
        rows = [
            [i, [1]] for i, row in enumerate(self.rows)
            if row.element == free_body.group and row.name in [f"{free_body.node.name}.{axis}" for axis in "xyz"]
        ]  # fmt: skip
        return {**direction, "sign": free_body.sign, "rows": rows, "masses": [], "forces": [], "weight": 0}

    def _of_free_body(self, free_body: FreeBody) -> Json:
        """Shares of all equations, masses and forces in the displacement of a node that one group moves alone."""
        shares = [(i, self._shares(row.forms, free_body)) for i, row in enumerate(self.rows)]
        pushes = [(i, self._shares(force.forms, free_body)) for i, force in enumerate(self.forces)]
        return {
            "rows": [[i, by_form] for i, by_form in shares if any(by_form)],
            "forces": [[i, by_form] for i, by_form in pushes if any(by_form)],
            "masses": self._inertia(free_body),
            "weight": self.trees.one(self._weight(free_body)),
        }

    def _shares(self, forms: tuple[Uses, ...], free_body: FreeBody) -> list[Any]:
        return self.trees.all(share(uses, free_body) for uses in forms)

    def _inertia(self, free_body: FreeBody) -> list[Any]:
        """Accelerations of nodes, each with the mass that it moves there."""
        terms: dict[Node, Scalar] = {}
        for owner, i, j, mass in masses_of(self.table.layout, self.trees.model):
            part = share((Use(1, owner.name, {i: 1}),), free_body)
            if part != 0:
                terms[j] = terms.get(j, 0) + part * mass
        return [[self.table.number_of({j: 1}), self.trees.one(mass)] for j, mass in terms.items()]

    def _weight(self, free_body: FreeBody) -> Scalar:
        """The mass whose weight rests there."""
        centres = ((body.mass, self.table.point(body.name, body.centre_of_mass)) for body in self.trees.model.bodies if body.mass != 0)
        return sum((mass * share(uses, free_body) for mass, uses in centres), sympy.Integer(0))
