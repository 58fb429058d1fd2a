"""A Hooke joint."""

from cutjoint.elements.joint import (
    PERPENDICULAR,
    Check,
    Direction,
    End,
    Fault,
    JointElement,
    JointField,
    Measure,
    Operations,
    SamePoint,
    Turn,
)
from cutjoint.elements.terms import JointKind

ELEMENT = JointElement(
    kind=JointKind.UNIVERSAL,
    text="turns about an axis of the base and an axis of the follower across it",
    fields=(
        JointField("axis", " of the base"),
        JointField("axis_2", " of the follower, perpendicular", check=Check("axis", Fault.NOT_PERPENDICULAR)),
    ),
    chain=(Turn("angle_1", Direction.AXIS), Turn("angle_2", Direction.AXIS_2)),
    conditions=(SamePoint(), PERPENDICULAR),
    measures={
        "angle_1": Measure(carrier=End.BASE, first=Direction.AXIS_2, second=Direction.NORMAL, pointer=Direction.AXIS_2),
        "angle_2": Measure(carrier=End.FOLLOWER, first=Direction.AXIS, second=Direction.NORMAL, pointer=Direction.AXIS),
    },
    operations=Operations(placing=(115, 270), closing=(240, 305, 395)),
)
