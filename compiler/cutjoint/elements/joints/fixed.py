"""A rigid connection."""

from cutjoint.elements.joint import DESIGN_FRAME, JointElement, Operations, SameAttitude, SamePoint
from cutjoint.elements.terms import JointKind

ELEMENT = JointElement(
    kind=JointKind.FIXED,
    text="nothing",
    chain=(),
    conditions=(SamePoint(), SameAttitude(DESIGN_FRAME)),
    operations=Operations(placing=(0, 14), closing=(330, 575, 650)),
)
