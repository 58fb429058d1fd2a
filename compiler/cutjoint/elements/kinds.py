"""The joint kinds that code tells apart by name."""

from __future__ import annotations

from enum import StrEnum


class JointKind(StrEnum):
    """Kinds that passes, exporters or pictures treat in a way of their own; ``cutjoint.elements.joints`` lists and describes all."""

    FIXED = "fixed"
    REVOLUTE = "revolute"
    PRISMATIC = "prismatic"
    CYLINDRICAL = "cylindrical"
    SCREW = "screw"
    UNIVERSAL = "universal"
    CONSTANT_VELOCITY = "constant_velocity"
    PLANAR = "planar"
    SPHERICAL = "spherical"
    POINT_ON_LINE = "point_on_line"
    DISTANCE = "distance"
    FREE = "free"
