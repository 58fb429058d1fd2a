"""A screw."""

from cutjoint.elements.joint import ABOUT_AXIS, ON_LINE, Advance, Direction, JointElement, JointField, Operations, SameDirection, Turn
from cutjoint.elements.terms import JointKind

ELEMENT = JointElement(
    kind=JointKind.SCREW,
    text="a turn about an axis that advances along it",
    fields=(JointField("axis"), JointField("pitch", " (m a radian)")),
    chain=(Turn("angle", Direction.AXIS, advances=True),),
    conditions=(ON_LINE, SameDirection(Direction.AXIS), Advance()),
    measures={"angle": ABOUT_AXIS},
    operations=Operations(placing=(25, 195), closing=(590, 960, 1050)),
)
