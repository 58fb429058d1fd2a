"""A ball in a slot."""

from cutjoint.elements.joint import ON_LINE, Ball, Direction, JointElement, JointField, Operations, Slide
from cutjoint.elements.terms import JointKind

ELEMENT = JointElement(
    kind=JointKind.POINT_ON_LINE,
    text="a displacement along an axis of the base and all turns",
    fields=(JointField("axis", " of the base, on which the follower's point moves"),),
    chain=(Slide("displacement", Direction.AXIS), Ball()),
    conditions=(ON_LINE,),
    operations=Operations(placing=(80, 280), closing=(225, 390, 525)),
)
