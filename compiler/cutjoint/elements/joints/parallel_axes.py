"""Two directions that stay parallel, wherever their bodies are."""

from cutjoint.elements.joint import ABOUT_AXIS, Direction, JointElement, JointField, Operations, SameDirection, Slide, Turn

ELEMENT = JointElement(
    kind="parallel_axes",
    text="three displacements and a turn about an axis",
    fields=(JointField("axis", ", which both bodies carry"),),
    chain=(
        Slide("displacement_1", Direction.ACROSS_1), Slide("displacement_2", Direction.ACROSS_2),
        Slide("displacement_3", Direction.AXIS), Turn("angle", Direction.AXIS),
    ),
    conditions=(SameDirection(Direction.AXIS),),
    measures={"angle": ABOUT_AXIS},
    operations=Operations(placing=(85, 265), closing=(80, 145, 145)),
)  # fmt: skip
