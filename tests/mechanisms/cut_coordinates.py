"""Forces on the coordinates of cut joints, and outputs of these, wherever they can be measured."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from cutjoint.elements.joint import rate_name
from cutjoint.model.expressions.parse import variable
from cutjoint.model.records import Joint, JointForce, Model, Output
from cutjoint.topology.build import build_topology
from cutjoint.topology.measured import angles_around
from cutjoint.topology.records import Topology
from cutjoint.topology.spanning_tree import joints_around


def measured(topology: Topology) -> Iterator[tuple[Joint, str, bool]]:
    """Cut joint, coordinate, and whether its value is known beside its rate."""
    for cut in topology.cuts:
        for coordinate in cut.element.measurable:
            counted = cut.element.is_screw or angles_around(cut, joints_around(topology.tree, cut)) is not None
            yield cut, coordinate, coordinate not in cut.element.angles or counted


def outputs_of_cuts(topology: Topology) -> tuple[Output, ...]:
    """All that is measured."""
    return tuple(
        Output(element=cut.name, quantity=quantity, span=cut.span)
        for cut, coordinate, whole in measured(topology) for quantity in (*((coordinate,) if whole else ()), rate_name(coordinate))
    )  # fmt: skip


def with_forces_on_cuts(model: Model) -> Model:
    """The model with a spring, a damper and a constant force on each measured coordinate; its cuts are kept."""
    topology = build_topology(model)
    cuts = {cut.name for cut in topology.cuts}
    position, rate = variable("position"), variable("rate")
    forces = [
        JointForce(
            name=f"on_{cut.name}_{coordinate}", joint=cut.name, coordinate=coordinate, unit=cut.element.units[coordinate],
            active=True, span=cut.span,
            law=7 - 2 * rate - 3 * rate**3 - (11 * position if whole else 0),
        ) for cut, coordinate, whole in measured(topology)
    ]  # fmt: skip
    joints = tuple(replace(joint, cut=True) if joint.name in cuts else joint for joint in model.joints)
    return replace(model, joints=joints, forces=(*model.forces, *forces))
