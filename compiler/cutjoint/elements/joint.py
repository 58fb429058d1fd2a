"""The description of a joint kind: fields in the file, chain of elementary motions (tree joint), conditions (cut joint).

A record has no formula of any method.  Coordinates, speeds, units, mirror images and the order in which a reversed joint undoes its
motions follow from the chain; residuals, shared points and equations of natural coordinates follow from the conditions.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from fractions import Fraction
from functools import cached_property
from typing import ClassVar, TypeAlias

SPIN = ("wx", "wy", "wz")  #: the speeds of a ball
ATTITUDE = ("e0", "e1", "e2", "e3")  #: the unit quaternion of a ball's attitude, scalar first

# Directions


class Direction(StrEnum):
    """A direction of a joint in the design position, by its meaning."""

    AXIS = "axis"  #: the joint's axis, of a universal joint that of the base
    AXIS_2 = "axis_2"  #: a universal joint's axis of the follower
    NORMAL = "normal"  #: across both axes of a universal joint, axis x axis_2
    ROD = "rod"  #: from the base's point to the follower's, not of unit length
    ACROSS_1 = "across_1"  #: the first of two unit vectors across the axis or the rod
    ACROSS_2 = "across_2"  #: the second: axis, across_1 and across_2 are right-handed
    X = "x"  #: the axes of the design frame
    Y = "y"
    Z = "z"


#: A joint's axis with two directions across it, and the design frame.
AXIAL_FRAME = (Direction.AXIS, Direction.ACROSS_1, Direction.ACROSS_2)
DESIGN_FRAME = (Direction.X, Direction.Y, Direction.Z)

# Elementary motions


@dataclass(frozen=True)
class Translation:
    """A displacement along a direction."""

    coordinate: str
    direction: Direction


@dataclass(frozen=True)
class Rotation:
    """A rotation about a direction by a share of a coordinate; ``is_screw``: with a displacement by the joint's pitch, m/rad.
    The shares of a coordinate in several rotations of a chain add up to one."""

    coordinate: str
    direction: Direction
    is_screw: bool = False
    share: Fraction = Fraction(1)


@dataclass(frozen=True)
class Ball:
    """A rotation about a point: a quaternion, and three components of the angular velocity in the axes of the body before it."""


@dataclass(frozen=True)
class Offset:
    """A rigid step along a direction, as long as it."""

    direction: Direction


Motion: TypeAlias = Translation | Rotation | Ball | Offset

# Conditions


class End(StrEnum):
    """The body at one end of a joint, as the carrier of a direction."""

    BASE = "base"
    FOLLOWER = "follower"


@dataclass(frozen=True)
class BodyDirection:
    """A direction fixed in one of the joint's bodies."""

    end: End
    direction: Direction


class JointDisplacement(StrEnum):
    """The displacement from the base's point of a joint to the follower's."""

    VECTOR = "displacement"


@dataclass(frozen=True)
class Product:
    """A weight times the scalar product of two vectors."""

    left: BodyDirection | JointDisplacement
    right: BodyDirection
    weight: Fraction = Fraction(1)


@dataclass(frozen=True)
class SamePoint:
    """The joint's points of both bodies coincide: three equations."""

    names: tuple[str, ...] = ("x", "y", "z")
    joins_points: ClassVar[bool] = True


@dataclass(frozen=True)
class SameDirection:
    """A direction of the base equals one of the follower: three equations, two of them independent."""

    direction: Direction
    names: tuple[str, ...] = ("axis_x", "axis_y", "axis_z")
    joins_points: ClassVar[bool] = False


@dataclass(frozen=True)
class SameAttitude:
    """A frame of the base equals one of the follower: half the sum of the vector products of its axes."""

    frame: tuple[Direction, Direction, Direction]
    names: tuple[str, ...] = ("turn_x", "turn_y", "turn_z")
    joins_points: ClassVar[bool] = False


@dataclass(frozen=True, kw_only=True)
class Products:
    """Sums of products are zero, a sum for each name; ``base`` and ``follower`` are the directions fixed in these bodies."""

    names: tuple[str, ...]
    sums: tuple[tuple[Product, ...], ...]
    base: tuple[Direction, ...] = ()
    follower: tuple[Direction, ...] = ()

    @property
    def joins_points(self) -> bool:
        """Return whether the vector between the joint's points is in the products, not only directions."""
        return any(p.left is JointDisplacement.VECTOR for products in self.sums for p in products)


@dataclass(frozen=True)
class SameDistance:
    """The joint's points keep the distance that they have in the design position."""

    names: tuple[str, ...] = ("length",)
    joins_points: ClassVar[bool] = True


@dataclass(frozen=True)
class Advance:
    """The displacement along the axis is the pitch times the angle about it."""

    names: tuple[str, ...] = ("advance",)
    joins_points: ClassVar[bool] = True


Condition: TypeAlias = SamePoint | SameDirection | SameAttitude | Products | SameDistance | Advance


def _on_base(direction: Direction) -> BodyDirection:
    return BodyDirection(End.BASE, direction)


#: The follower's point stays on the base's axis.
ON_LINE = Products(
    names=("across_1", "across_2"), base=AXIAL_FRAME,
    sums=tuple((Product(JointDisplacement.VECTOR, _on_base(d)),) for d in (Direction.ACROSS_1, Direction.ACROSS_2)),
)  # fmt: skip

#: The follower's point stays in the plane across the base's axis.
IN_PLANE = Products(names=("height",), base=(Direction.AXIS,), sums=((Product(JointDisplacement.VECTOR, _on_base(Direction.AXIS)),),))

#: The base's axis and the follower's second one stay perpendicular.
PERPENDICULAR = Products(
    names=("angle",), base=(Direction.AXIS,), follower=(Direction.AXIS_2,),
    sums=((Product(_on_base(Direction.AXIS), BodyDirection(End.FOLLOWER, Direction.AXIS_2)),),),
)  # fmt: skip

#: No rotation of the follower about the axis: the products of its two transverse directions with the base's other ones are equal.
NO_AXIAL_ROTATION = Products(
    names=("twist",), base=(Direction.ACROSS_1, Direction.ACROSS_2), follower=(Direction.ACROSS_1, Direction.ACROSS_2),
    sums=((
        Product(BodyDirection(End.FOLLOWER, Direction.ACROSS_1), _on_base(Direction.ACROSS_2), Fraction(1, 2)),
        Product(BodyDirection(End.FOLLOWER, Direction.ACROSS_2), _on_base(Direction.ACROSS_1), Fraction(-1, 2)),
    ),),
)  # fmt: skip

# Angles


@dataclass(frozen=True, kw_only=True)
class Measure:
    """The definition of an angle: from ``first`` towards ``second``, both fixed in the body ``carrier``, to ``pointer`` of the other body.
    """

    carrier: End
    first: Direction
    second: Direction
    pointer: Direction


#: An angle about the axis that both bodies share.
ABOUT_AXIS = Measure(carrier=End.BASE, first=Direction.ACROSS_1, second=Direction.ACROSS_2, pointer=Direction.ACROSS_1)

# The record


class Fault(StrEnum):
    """A relation between two fields that makes the second one invalid."""

    SAME_POINT = "are the same point"
    OPPOSITE = "are opposite"
    NOT_PERPENDICULAR = "are not perpendicular"


@dataclass(frozen=True)
class Check:
    """The ``fault`` that a field and the one before it, ``other_field``, must not have, with a ``hint`` for the user."""

    other_field: str
    fault: Fault
    hint: str = ""


@dataclass(frozen=True)
class JointField:
    """A field of the kind in a model file, besides those that all joints have, with ``words`` for the documentation and its ``check``."""

    name: str
    words: str = ""
    optional: bool = False
    check: Check | None = None


@dataclass(frozen=True, kw_only=True)
class Operations:
    """Predicted operations, the means counted in the programs of random mechanisms. ``placing``: pose, velocity and motion subspace of the
    outer body of a tree joint, next to the ground and on a body that moves. ``closing``: residual, Jacobian, penalty mass and force and
    correction of the multipliers of a cut joint: to the ground, in one branch, between two branches."""

    placing: tuple[int, int]
    closing: tuple[int, int, int] = (0, 0, 0)


@dataclass(frozen=True, kw_only=True)
class JointElement:
    """A kind of joint.

    ``text`` describes its degrees of freedom. ``chain`` moves the follower relative to the base; a reversed joint moves the base by the
    opposite motions, unless ``from_inner`` says that its motions count from the body nearer to the ground, whichever that is. With
    ``axis_is_bisector`` its axis is the bisector of the two axes in the file. ``conditions`` are the equations of the cut joint, none for a
    joint that closes nothing. ``measures`` define its angles in natural coordinates; angles without a measure are not available there.
    """

    kind: str
    text: str
    chain: tuple[Motion, ...]
    conditions: tuple[Condition, ...]
    operations: Operations
    fields: tuple[JointField, ...] = ()
    from_inner: bool = False
    axis_is_bisector: bool = False
    measures: Mapping[str, Measure] = field(default_factory=dict)

    # Consequences of the chain

    @property
    def scalar_motions(self) -> Iterator[Translation | Rotation]:
        """The translations and rotations of the chain."""
        return (m for m in self.chain if isinstance(m, Translation | Rotation))

    @cached_property
    def coordinates(self) -> tuple[str, ...]:
        """The scalar coordinates.  The attitude of a ball is a quaternion and has none."""
        return tuple(dict.fromkeys(m.coordinate for m in self.scalar_motions))

    @cached_property
    def speeds(self) -> tuple[str, ...]:
        """The rates of the coordinates, then the angular velocity of a ball."""
        return (*map(rate_name, self.coordinates), *(SPIN if self.has_ball else ()))

    @cached_property
    def units(self) -> Mapping[str, str]:
        """The units of coordinates and speeds."""
        units = {m.coordinate: "m" if isinstance(m, Translation) else "rad" for m in self.scalar_motions}
        rates = {rate_name(name): f"{unit}/s" for name, unit in units.items()}
        return {**units, **rates, **(dict.fromkeys(SPIN, "rad/s") if self.has_ball else {})}

    @cached_property
    def angles(self) -> tuple[str, ...]:
        """The coordinates that are angles."""
        return tuple(name for name in self.coordinates if self.units[name] == "rad")

    @cached_property
    def measurable(self) -> tuple[str, ...]:
        """The coordinates that follow from the motions of both bodies, so that a cut joint has them too.
        They are displacements and rotations about an axis."""
        if self.from_inner:
            return ()
        return tuple(name for name in self.coordinates if self.units[name] == "m" or self.measures.get(name) == ABOUT_AXIS)

    @property
    def is_measured(self) -> bool:
        """Return whether natural coordinates can have all angles of the joint."""
        return self.angles == tuple(self.measures)

    @cached_property
    def has_ball(self) -> bool:
        """Return whether a ball is among the joint's motions."""
        return any(isinstance(m, Ball) for m in self.chain)

    @property
    def is_ball(self) -> bool:
        """Return whether the joint is a ball and nothing else."""
        return self.chain == (Ball(),)

    @property
    def shares_coordinates(self) -> bool:
        """Return whether several motions of the joint's chain have a coordinate in common."""
        return len(self.coordinates) < len(list(self.scalar_motions))

    @property
    def has_attitude(self) -> bool:
        """Return whether the joint's ball alone gives the attitude of its follower relative to its base."""
        return self.has_ball and not any(isinstance(m, Rotation) for m in self.chain)

    @property
    def is_free(self) -> bool:
        """Return whether the joint constrains nothing."""
        return len(self.speeds) == 6

    @property
    def keeps_attitude(self) -> bool:
        """Return whether the joint's follower never rotates relative to its base."""
        return not any(isinstance(m, Rotation | Ball) for m in self.chain)

    @property
    def is_rigid(self) -> bool:
        """Return whether the joint has no degree of freedom."""
        return not self.chain

    @property
    def can_be_guided(self) -> bool:
        """Return whether functions of time can prescribe the joint's whole motion."""
        return bool(self.coordinates) and not self.has_ball

    def chain_from_inner(self, is_reversed: bool) -> tuple[Motion, ...]:
        """The chain of motions from the inner body on; the order of motions about one direction is free."""
        directions = {getattr(m, "direction", None) for m in self.chain}
        return self.chain[::-1] if is_reversed and not self.from_inner and len(directions) > 1 else self.chain

    def slide_direction(self, coordinate: str) -> Direction:
        """The direction along which a displacement counts."""
        return next(m.direction for m in self.scalar_motions if m.coordinate == coordinate)

    # Consequences of the conditions

    @property
    def closes(self) -> bool:
        """Return whether the joint can be a cut joint."""
        return bool(self.conditions)

    @property
    def shares_point(self) -> bool:
        """Return whether the joint's bodies have a common point that natural coordinates share; rigidly joined bodies are one instead."""
        return any(isinstance(c, SamePoint) for c in self.conditions) and not self.is_rigid

    @property
    def shared_direction(self) -> Direction | None:
        """The direction that both bodies have in common, if there is one."""
        return next((c.direction for c in self.conditions if isinstance(c, SameDirection)), None)

    @property
    def constrains_one_rotation(self) -> bool:
        """Return whether the joint constrains a point and, by products of directions, one rotation."""
        return self.shares_point and any(isinstance(c, Products) and not c.joins_points for c in self.conditions)

    @property
    def is_screw(self) -> bool:
        """Return whether the joint's displacement follows from its angle."""
        return any(isinstance(c, Advance) for c in self.conditions)

    @property
    def base_directions(self) -> tuple[Direction, ...]:
        """The directions of the base in the equations of the cut joint."""
        return tuple(dict.fromkeys(d for c in self.conditions for d in _body_directions(c)[0]))

    @property
    def follower_directions(self) -> tuple[Direction, ...]:
        """The directions of the follower in the equations of the cut joint."""
        return tuple(dict.fromkeys(d for c in self.conditions for d in _body_directions(c)[1]))

    # Consequences of the directions

    @property
    def axis_mirrors_as_rotation(self) -> bool:
        """Return whether the axis of the mirror image is the image of an axis of rotation, so that positive angles stay positive."""
        return any(isinstance(m, Rotation) and m.direction in (Direction.AXIS, Direction.AXIS_2) for m in self.chain)


def rate_name(coordinate: str) -> str:
    """The name of a coordinate's rate."""
    return f"v{coordinate}" if coordinate in DESIGN_FRAME else f"{coordinate}_rate"


def _body_directions(condition: Condition) -> tuple[tuple[Direction, ...], tuple[Direction, ...]]:
    match condition:
        case SameDirection():
            return (condition.direction,), (condition.direction,)
        case SameAttitude():
            return condition.frame, condition.frame
        case Products():
            return condition.base, condition.follower
        case Advance():
            return AXIAL_FRAME, (Direction.AXIS, Direction.ACROSS_1)
    return (), ()
