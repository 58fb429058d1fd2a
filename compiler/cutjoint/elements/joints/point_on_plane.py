"""A ball on a plate."""

from cutjoint.elements.joint import IN_PLANE, Ball, Direction, JointElement, JointField, Operations, Slide

ELEMENT = JointElement(
    kind="point_on_plane",
    text="two displacements across an axis of the base and all turns",
    fields=(JointField("axis", " of the base, the normal of the plane in which the follower's point moves"),),
    chain=(Slide("displacement_1", Direction.ACROSS_1), Slide("displacement_2", Direction.ACROSS_2), Ball()),
    conditions=(IN_PLANE,),
    operations=Operations(placing=(80, 330), closing=(140, 250, 385)),
)
