"""No connection: a body that moves freely."""

from cutjoint.elements.joint import Ball, Direction, JointElement, Operations, Slide
from cutjoint.elements.terms import JointKind

ELEMENT = JointElement(
    kind=JointKind.FREE,
    text="everything",
    chain=(Slide("x", Direction.X), Slide("y", Direction.Y), Slide("z", Direction.Z), Ball()),
    from_inner=True,
    conditions=(),
    operations=Operations(placing=(38, 265)),
    note="A free body next to the ground carries its pole along: there "
         r"$b = \mathbf{1}$ and $d = (v \times \omega, 0)$ take the place of $X S$ and $X c$.",
)
