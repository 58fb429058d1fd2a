"""A hinge."""

from cutjoint.elements.joint import ABOUT_AXIS, Direction, JointElement, JointField, Operations, SameDirection, SamePoint, Turn
from cutjoint.elements.terms import JointKind

ELEMENT = JointElement(
    kind=JointKind.REVOLUTE,
    text="a turn about an axis",
    fields=(JointField("axis"),),
    chain=(Turn("angle", Direction.AXIS),),
    conditions=(SamePoint(), SameDirection(Direction.AXIS)),
    measures={"angle": ABOUT_AXIS},
    operations=Operations(placing=(20, 115), closing=(200, 325, 390)),
)
