"""Forces by their action on points, directions and angles."""

from __future__ import annotations

from dataclasses import dataclass

from cutjoint.elements.interaction import T, gets, pair
from cutjoint.model.records import Force
from cutjoint.report.explain.forces import LawPage

NOTES = (
    "A force on a point of a body works on the displacement of that point: $Q_p$ takes it, and a point that is no coordinate hands it on "
    "to the nodes that it combines, times their coefficients. A law $F$ over a scalar $s$ works on $s$: $Q$ takes $F$ times the gradient "
    "of $s$. A torque $T$ on a body works on the three directions $e_x$, $e_y$, $e_z$ of the body that are the global axes in the design "
    r"position: $Q_{e_i}$ takes $T \times e_i / 2$.",
)


@dataclass(frozen=True, kw_only=True)
class PointPage(LawPage):
    """Forces on displacements of points, directions and angles."""

    def either(self, bodies: T, points: T) -> T:
        """The text for points."""
        return points

    def pull(self, start: str, end: str, force: str) -> str:
        """Opposite forces on both points."""
        return pair(end, start, "-", force)

    def push_along(self, start: str, end: str, axis: str, way: str, force: str) -> str:
        """Opposite forces on both points, and one on the axis."""
        return rf"{pair(end, start, '+', f'{force} {axis}')}, \quad {gets(axis, '+', f'{force} {way}')}"

    def push_at(self, at: str, force: str, body: str = "") -> str:
        """A force on a point."""
        return gets(at, "+", force)

    def turn(self, torque: str, body: str = "") -> str:
        """A torque on the directions of its body."""
        on_directions = gets(f"e_{{{body} i}}" if body else "e_i", "+", r"T \times e_i / 2")
        return rf"T = {torque}, \quad {on_directions}"

    def kind_of_coordinate(self, force: Force) -> str:
        """The kind by the joint's guide and its measures."""
        joint = next(j for j in self.model.joints if j.name == force.joint_of)
        if joint.guide is not None:
            return "guided"
        return "angle" if force.coordinate_of in joint.element.measures else "slide"
