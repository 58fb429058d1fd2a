"""The names of the kinds of joints and forces in a model file."""

from __future__ import annotations

from enum import StrEnum


class JointKind(StrEnum):
    """The kinds of joints, by the motions that they leave free; ``cutjoint.elements.joints`` describes each."""

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


class ForceKind(StrEnum):
    """The kinds of forces, by the way in which they act; ``cutjoint.elements.forces`` describes each."""

    POINT_SPRING = "point_spring"
    AXIAL_FORCE = "axial_force"
    BUSHING = "bushing"
    LOAD = "load"
    JOINT_FORCE = "joint_force"
    TYRE = "tyre"
