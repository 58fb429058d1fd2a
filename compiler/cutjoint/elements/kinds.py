"""The names of the joint kinds in a model file."""

from __future__ import annotations

from enum import StrEnum


class JointKind(StrEnum):
    """What a joint leaves free; ``cutjoint.elements.joints`` has what each kind is."""

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
