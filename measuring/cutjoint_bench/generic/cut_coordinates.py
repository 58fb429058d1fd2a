"""Coordinates of cut joints in the description of a generic solver."""

from __future__ import annotations

from typing import Any

from cutjoint.elements.joint import Direction
from cutjoint.kernels.joints import direction_of, slide_axis
from cutjoint.model.records import COORDINATES, Joint
from cutjoint.topology.measured import angles_around
from cutjoint.topology.records import Topology
from cutjoint.topology.spanning_tree import joints_around
from cutjoint_bench.generic.trees import Trees


def describe_cut_coordinate(trees: Trees, topology: Topology, cut: Joint, coordinate: str) -> dict[str, Any]:
    """The measure of a coordinate, see runtime/include/cutjoint/generic/cut_coordinate.hpp."""
    is_angle = coordinate in cut.element.angles
    axis = direction_of(cut, Direction.AXIS) if is_angle else slide_axis(cut, coordinate)
    return {
        "joint": cut.name, "base": cut.base, "follower": cut.follower, "point": trees.all(cut.at), "axis": trees.all(axis),
        "angle": is_angle,
        "turns": _turns(topology, cut) if is_angle and not cut.element.is_screw else None,
        "pitch": None if cut.pitch is None else trees.one(cut.pitch),
    }  # fmt: skip


def _turns(topology: Topology, cut: Joint) -> list[dict[str, Any]] | None:
    """The turns that add up to an angle; None where they do not."""
    turns, body_of = angles_around(cut, joints_around(topology.tree, cut)), {t.joint.name: t.child for t in topology.tree}
    return None if turns is None else [
        {"body": body_of[t.joint.name], "coordinate": COORDINATES[t.joint.kind].index(t.coordinate), "sign": t.sign} for t in turns
    ]  # fmt: skip
