"""A slider that turns."""

from cutjoint.elements.joint import ABOUT_AXIS, ON_LINE, Direction, JointElement, JointField, Operations, SameDirection, Slide, Turn
from cutjoint.elements.terms import JointKind

ELEMENT = JointElement(
    kind=JointKind.CYLINDRICAL,
    text="a displacement along an axis and a turn about it",
    fields=(JointField("axis"),),
    chain=(Slide("displacement", Direction.AXIS), Turn("angle", Direction.AXIS)),
    conditions=(ON_LINE, SameDirection(Direction.AXIS)),
    measures={"angle": ABOUT_AXIS},
    operations=Operations(placing=(30, 160), closing=(410, 510, 595)),
)
