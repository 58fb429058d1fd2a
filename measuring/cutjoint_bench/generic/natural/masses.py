"""The elements of all groups' mass matrices."""

from __future__ import annotations

from collections.abc import Iterator

from cutjoint.formulate.natural.assembly import mass_matrix
from cutjoint.formulate.natural.layout import Group, Layout
from cutjoint.formulate.natural.nodes import Node
from cutjoint.model.records import Model, Scalar


def masses_of(layout: Layout, model: Model) -> Iterator[tuple[Group, Node, Node, Scalar]]:
    """Each group's mass matrix by pairs of its basis."""
    bodies = {body.name: body for body in model.bodies}
    for group in layout.groups.values():
        for (i, j), mass in mass_matrix(group, [bodies[name] for name in group.bodies]).items():
            yield group, i, j, mass
