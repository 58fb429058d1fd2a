"""A slider."""

from cutjoint.elements.joint import AXIAL_FRAME, ON_LINE, Direction, JointElement, JointField, Operations, SameAttitude, Slide
from cutjoint.elements.terms import JointKind

ELEMENT = JointElement(
    kind=JointKind.PRISMATIC,
    text="a displacement along an axis",
    fields=(JointField("axis"),),
    chain=(Slide("displacement", Direction.AXIS),),
    conditions=(ON_LINE, SameAttitude(AXIAL_FRAME)),
    operations=Operations(placing=(2, 65), closing=(565, 800, 930)),
)
