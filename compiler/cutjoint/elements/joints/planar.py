"""A contact of planes."""

from cutjoint.elements.joint import ABOUT_AXIS, IN_PLANE, Direction, JointElement, JointField, Operations, SameDirection, Slide, Turn
from cutjoint.elements.terms import JointKind

ELEMENT = JointElement(
    kind=JointKind.PLANAR,
    text="two displacements across an axis and a turn about it",
    fields=(JointField("axis", ", the normal"),),
    chain=(Slide("displacement_1", Direction.ACROSS_1), Slide("displacement_2", Direction.ACROSS_2), Turn("angle", Direction.AXIS)),
    conditions=(IN_PLANE, SameDirection(Direction.AXIS)),
    measures={"angle": ABOUT_AXIS},
    operations=Operations(placing=(60, 240), closing=(355, 335, 470)),
)
