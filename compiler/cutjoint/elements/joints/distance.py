"""A massless rod between two ball joints."""

from cutjoint.elements.joint import Ball, Check, Direction, Fault, JointElement, JointField, Offset, Operations, SameDistance, Turn
from cutjoint.elements.terms import JointKind

ELEMENT = JointElement(
    kind=JointKind.DISTANCE,
    text="all motions that keep the distance of two points",
    fields=(JointField("to", ", the follower's point; `at` is the base's", check=Check("at", Fault.SAME_POINT, "a distance needs two")),),
    # a ball at the inner end of the rod, a universal joint across it at the outer end
    chain=(Ball(), Offset(Direction.ROD), Turn("angle_1", Direction.ACROSS_1), Turn("angle_2", Direction.ACROSS_2)),
    from_inner=True,
    conditions=(SameDistance(),),
    operations=Operations(placing=(400, 715), closing=(180, 250, 400)),
)
