"""A ball joint."""

from cutjoint.elements.joint import Ball, JointElement, Operations, SamePoint
from cutjoint.elements.terms import JointKind

ELEMENT = JointElement(
    kind=JointKind.SPHERICAL,
    text="all turns",
    chain=(Ball(),),
    conditions=(SamePoint(),),
    operations=Operations(placing=(26, 125), closing=(115, 190, 280)),
    note="It is eliminated about its centre in global axes, where it passes on a force only.",
)
