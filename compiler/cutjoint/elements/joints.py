"""The joint kinds: their records, and the list of them all."""

from collections.abc import Mapping
from fractions import Fraction

from cutjoint.elements.joint import (
    ABOUT_AXIS,
    AXIAL_FRAME,
    DESIGN_FRAME,
    IN_PLANE,
    NO_AXIAL_ROTATION,
    ON_LINE,
    PERPENDICULAR,
    Advance,
    Ball,
    Check,
    Direction,
    End,
    Fault,
    JointElement,
    JointField,
    Measure,
    Offset,
    Operations,
    Rotation,
    SameAttitude,
    SameDirection,
    SameDistance,
    SamePoint,
    Translation,
)
from cutjoint.elements.terms import JointKind

# A rigid connection.
_FIXED = JointElement(
    kind=JointKind.FIXED,
    text="nothing",
    chain=(),
    conditions=(SamePoint(), SameAttitude(DESIGN_FRAME)),
    operations=Operations(placing=(0, 14), closing=(330, 575, 650)),
)

# A hinge.
_REVOLUTE = JointElement(
    kind=JointKind.REVOLUTE,
    text="a rotation about an axis",
    fields=(JointField("axis"),),
    chain=(Rotation("angle", Direction.AXIS),),
    conditions=(SamePoint(), SameDirection(Direction.AXIS)),
    measures={"angle": ABOUT_AXIS},
    operations=Operations(placing=(20, 115), closing=(200, 325, 390)),
)

# A slider.
_PRISMATIC = JointElement(
    kind=JointKind.PRISMATIC,
    text="a displacement along an axis",
    fields=(JointField("axis"),),
    chain=(Translation("displacement", Direction.AXIS),),
    conditions=(ON_LINE, SameAttitude(AXIAL_FRAME)),
    operations=Operations(placing=(2, 65), closing=(565, 800, 930)),
)

# A screw.
_SCREW = JointElement(
    kind=JointKind.SCREW,
    text="a rotation about an axis that advances along it",
    fields=(JointField("axis"), JointField("pitch", " (m a radian)")),
    chain=(Rotation("angle", Direction.AXIS, is_screw=True),),
    conditions=(ON_LINE, SameDirection(Direction.AXIS), Advance()),
    measures={"angle": ABOUT_AXIS},
    operations=Operations(placing=(25, 195), closing=(590, 960, 1050)),
)

# A slider that turns.
_CYLINDRICAL = JointElement(
    kind=JointKind.CYLINDRICAL,
    text="a displacement along an axis and a rotation about it",
    fields=(JointField("axis"),),
    chain=(Translation("displacement", Direction.AXIS), Rotation("angle", Direction.AXIS)),
    conditions=(ON_LINE, SameDirection(Direction.AXIS)),
    measures={"angle": ABOUT_AXIS},
    operations=Operations(placing=(30, 160), closing=(410, 510, 595)),
)

# A Hooke joint.
_UNIVERSAL = JointElement(
    kind=JointKind.UNIVERSAL,
    text="rotations about an axis of the base and a perpendicular axis of the follower",
    fields=(
        JointField("axis", " of the base"),
        JointField("axis_2", " of the follower, perpendicular", check=Check("axis", Fault.NOT_PERPENDICULAR)),
    ),
    chain=(Rotation("angle_1", Direction.AXIS), Rotation("angle_2", Direction.AXIS_2)),
    conditions=(SamePoint(), PERPENDICULAR),
    measures={
        "angle_1": Measure(carrier=End.BASE, first=Direction.AXIS_2, second=Direction.NORMAL, pointer=Direction.AXIS_2),
        "angle_2": Measure(carrier=End.FOLLOWER, first=Direction.AXIS, second=Direction.NORMAL, pointer=Direction.AXIS),
    },
    operations=Operations(placing=(115, 270), closing=(240, 305, 395)),
)

# A homokinetic joint with a fixed centre: both shafts turn about their own axes at one rate, at any angle between them.  So the follower
# rotates relative to the base about axes perpendicular to the shafts' bisector and never about the bisector (Hunt 1973, "Constant-velocity
# shaft couplings: a general theory", ASME J. Eng. Ind. 95).  Two universal joints in series that share the angle equally do that: half a
# rotation about a first direction, one about a second, the other half about the first, all normal to the bisector in the design position.
_HALF = Rotation("angle_1", Direction.ACROSS_1, share=Fraction(1, 2))
_CONSTANT_VELOCITY = JointElement(
    kind=JointKind.CONSTANT_VELOCITY,
    text="bending of two shafts that rotate about their axes at one rate",
    fields=(
        JointField("axis", " of the base's shaft"),
        JointField(
            "axis_2",
            " of the follower's, `axis` if left out",
            optional=True,
            check=Check("axis", Fault.OPPOSITE, "let both point from the base to the follower"),
        ),
    ),
    axis_is_bisector=True,
    chain=(_HALF, Rotation("angle_2", Direction.ACROSS_2), _HALF),
    conditions=(SamePoint(), NO_AXIAL_ROTATION),
    operations=Operations(placing=(155, 405), closing=(265, 405, 485)),
)

# A contact of planes.
_PLANAR = JointElement(
    kind=JointKind.PLANAR,
    text="two displacements perpendicular to an axis and a rotation about it",
    fields=(JointField("axis", ", the normal"),),
    chain=(
        Translation("displacement_1", Direction.ACROSS_1), Translation("displacement_2", Direction.ACROSS_2),
        Rotation("angle", Direction.AXIS),
    ),
    conditions=(IN_PLANE, SameDirection(Direction.AXIS)),
    measures={"angle": ABOUT_AXIS},
    operations=Operations(placing=(60, 240), closing=(355, 335, 470)),
)

# A ball joint.
_SPHERICAL = JointElement(
    kind=JointKind.SPHERICAL,
    text="all rotations",
    chain=(Ball(),),
    conditions=(SamePoint(),),
    operations=Operations(placing=(26, 125), closing=(115, 190, 280)),
)

# A ball in a slot.
_POINT_ON_LINE = JointElement(
    kind=JointKind.POINT_ON_LINE,
    text="a displacement along an axis of the base and all rotations",
    fields=(JointField("axis", " of the base, on which the follower's point moves"),),
    chain=(Translation("displacement", Direction.AXIS), Ball()),
    conditions=(ON_LINE,),
    operations=Operations(placing=(80, 280), closing=(225, 390, 525)),
)

# A ball on a plate.
_POINT_ON_PLANE = JointElement(
    kind="point_on_plane",
    text="two displacements perpendicular to an axis of the base and all rotations",
    fields=(JointField("axis", " of the base, the normal of the plane in which the follower's point moves"),),
    chain=(Translation("displacement_1", Direction.ACROSS_1), Translation("displacement_2", Direction.ACROSS_2), Ball()),
    conditions=(IN_PLANE,),
    operations=Operations(placing=(80, 330), closing=(140, 250, 385)),
)

# Two directions that stay parallel, wherever their bodies are.
_PARALLEL_AXES = JointElement(
    kind="parallel_axes",
    text="three displacements and a rotation about an axis",
    fields=(JointField("axis", ", which both bodies carry"),),
    chain=(
        Translation("displacement_1", Direction.ACROSS_1), Translation("displacement_2", Direction.ACROSS_2),
        Translation("displacement_3", Direction.AXIS), Rotation("angle", Direction.AXIS),
    ),
    conditions=(SameDirection(Direction.AXIS),),
    measures={"angle": ABOUT_AXIS},
    operations=Operations(placing=(85, 265), closing=(80, 145, 145)),
)  # fmt: skip

# A massless rod between two ball joints.
_DISTANCE = JointElement(
    kind=JointKind.DISTANCE,
    text="all motions that keep the distance of two points",
    fields=(JointField("to", ", the follower's point; `at` is the base's", check=Check("at", Fault.SAME_POINT, "a distance needs two")),),
    # a ball at the inner end of the rod, a universal joint across it at the outer end
    chain=(Ball(), Offset(Direction.ROD), Rotation("angle_1", Direction.ACROSS_1), Rotation("angle_2", Direction.ACROSS_2)),
    from_inner=True,
    conditions=(SameDistance(),),
    operations=Operations(placing=(400, 715), closing=(180, 250, 400)),
)

# No connection: a body that moves freely.
_FREE = JointElement(
    kind=JointKind.FREE,
    text="everything",
    chain=(Translation("x", Direction.X), Translation("y", Direction.Y), Translation("z", Direction.Z), Ball()),
    from_inner=True,
    conditions=(),
    operations=Operations(placing=(38, 265)),
)

#: The record of each kind by its name, in the order of the documentation.
JOINTS: Mapping[str, JointElement] = {
    element.kind: element
    for element in (
        _FIXED, _REVOLUTE, _PRISMATIC, _SCREW, _CYLINDRICAL, _UNIVERSAL, _CONSTANT_VELOCITY, _PLANAR, _SPHERICAL, _POINT_ON_LINE,
        _POINT_ON_PLANE, _PARALLEL_AXES, _DISTANCE, _FREE,
    )
}  # fmt: skip
