"""A homokinetic joint with a fixed centre: both shafts turn about their own axes at one rate, at any angle between them.

So the follower turns beside the base about axes across the shafts' bisector and never about the bisector (Hunt 1973, "Constant-velocity
shaft couplings: a general theory", ASME J. Eng. Ind. 95).  Two universal joints in series that share the bend equally do that: half a
turn about a first direction, a turn about a second one, the other half about the first, all across the bisector of the design position.
"""

from fractions import Fraction

from cutjoint.elements.joint import NO_TWIST, Check, Direction, Fault, JointElement, JointField, Operations, SamePoint, Turn
from cutjoint.elements.terms import JointKind

_HALF = Turn("angle_1", Direction.ACROSS_1, share=Fraction(1, 2))

ELEMENT = JointElement(
    kind=JointKind.CONSTANT_VELOCITY,
    text="bends of two shafts that turn about their axes at one rate",
    fields=(
        JointField("axis", " of the base's shaft"),
        JointField(
            "axis_2", " of the follower's, `axis` if left out", optional=True,
            check=Check("axis", Fault.OPPOSITE, "let both point from the base to the follower"),
        ),
    ),
    axis_is_bisector=True,
    chain=(_HALF, Turn("angle_2", Direction.ACROSS_2), _HALF),
    conditions=(SamePoint(), NO_TWIST),
    operations=Operations(placing=(155, 405), closing=(265, 405, 485)),
)
