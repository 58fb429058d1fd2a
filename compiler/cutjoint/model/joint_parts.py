"""The shapes of joints in a model file."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import BeforeValidator, Field, StrictBool, StrictStr, model_validator

from cutjoint.model.values import Direction, Law, Number, Pair, Part, Point, shape_error


class JointSpring(Part):
    """A linear spring and damper on one of a joint's coordinates: short for a joint_force."""

    stiffness: Number = 0
    damping: Number = 0
    free_position: Number = 0
    coordinate: StrictStr | None = None


class JointLimits(Part):
    """Soft stops at the ends of a coordinate's range: short for a joint_force."""

    lower: Number | None = None
    upper: Number | None = None
    stiffness: Number
    damping: Number = 0
    coordinate: StrictStr | None = None

    @model_validator(mode="after")
    def _one_end(self) -> JointLimits:
        if self.lower is None and self.upper is None:
            raise shape_error("limits need lower, upper or both")
        return self


class JointPart(Part):
    """What all joints have."""

    bodies: Pair
    at: Point
    cut: StrictBool | None = None
    spring: JointSpring | None = None
    limits: JointLimits | None = None


class PlainJoint(JointPart):
    """A joint without directions."""

    kind: Literal["fixed", "spherical", "free"]


def _list(value: Any) -> Any:
    if isinstance(value, tuple):
        return value
    raise shape_error("needs a list of laws, one for each coordinate")


Guides = Annotated[tuple[Law, ...], BeforeValidator(_list)]


class LineJoint(JointPart):
    """A joint with one axis."""

    kind: Literal["point_on_line"]
    axis: Direction


class SlidingJoint(JointPart):
    """A joint that slides and turns, with one axis (of a planar joint: the normal)."""

    kind: Literal["cylindrical", "planar"]
    axis: Direction
    guide: Guides | None = None


class SingleJoint(JointPart):
    """A joint with one coordinate."""

    kind: Literal["revolute", "prismatic"]
    axis: Direction
    guide: Law | None = None


class ScrewJoint(JointPart):
    """A screw; ``pitch`` in m a radian."""

    kind: Literal["screw"]
    axis: Direction
    pitch: Number
    guide: Law | None = None


class UniversalJoint(JointPart):
    """A Hooke joint; ``axis`` in the base, ``axis_2`` in the follower, perpendicular."""

    kind: Literal["universal"]
    axis: Direction
    axis_2: Direction
    guide: Guides | None = None


class DistanceJoint(JointPart):
    """A massless rod from ``at`` on the base to ``to`` on the follower."""

    kind: Literal["distance"]
    to: Point


Joint: TypeAlias = Annotated[
    PlainJoint | LineJoint | SlidingJoint | SingleJoint | ScrewJoint | UniversalJoint | DistanceJoint,
    Field(discriminator="kind"),
]
