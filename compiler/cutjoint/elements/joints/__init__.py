"""The joint kinds, each in a file of its own: the list of them all."""

from collections.abc import Mapping

from cutjoint.elements.joint import JointElement
from cutjoint.elements.joints import (
    constant_velocity,
    cylindrical,
    distance,
    fixed,
    free,
    parallel_axes,
    planar,
    point_on_line,
    point_on_plane,
    prismatic,
    revolute,
    screw,
    spherical,
    universal,
)

#: The record of each kind by its name, in the order of the documentation.
JOINTS: Mapping[str, JointElement] = {
    module.ELEMENT.kind: module.ELEMENT
    for module in (
        fixed, revolute, prismatic, screw, cylindrical, universal, constant_velocity, planar, spherical, point_on_line,
        point_on_plane, parallel_axes, distance, free,
    )
}  # fmt: skip
