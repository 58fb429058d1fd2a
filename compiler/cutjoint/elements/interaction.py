"""The vocabulary of interactions: the points and directions of a force on its bodies, and its mechanics, for every method.

An interaction is a file of `elements/interactions/`. It defines by the functions of `Mechanics` what a force measures and where it acts,
and by shapes and `VisualContext` its visuals. Methods, `explain` and the viewer interpret it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, TypeAlias

from cutjoint.elements.terms import Scalar

if TYPE_CHECKING:
    from cutjoint.elements.force import Force
    from cutjoint.program.blocks import Block, Builder

# Places on bodies


class Carrier(StrEnum):
    """The field of a record that names the body in which a place is fixed."""

    BASE = "base"
    FOLLOWER = "follower"
    BODY = "body"


@dataclass(frozen=True)
class Place:
    """A point or direction fixed in one of a force's bodies: the record's field that has it in the design position."""

    carrier: Carrier
    field: str

    def body(self, force: Force) -> str:
        """The body in which the place is fixed."""
        return str(getattr(force, self.carrier))

    def of(self, force: Force) -> Any:
        """The components of the place, None where the force has none."""
        return getattr(force, self.field)


@dataclass(frozen=True)
class Point(Place):
    """A point."""


@dataclass(frozen=True)
class Axis(Place):
    """A direction; with ``is_rotation`` one that mirrors as an axis of rotation."""

    is_rotation: bool = False


@dataclass(frozen=True)
class Frame(Place):
    """Three directions, right-handed: components of laws are in the frame fixed in ``carrier``, and the other body has a copy of it."""

    def bodies(self, force: Force) -> tuple[str, str]:
        """The body in whose frame laws count, and the other one."""
        (other,) = (body for body in force.bodies if body != self.body(force))
        return self.body(force), other


# Mechanics


class Motion(Protocol):
    """A quantity and its rate, (3, 1) or (1, 1)."""

    @property
    def x(self) -> Block: ...

    @property
    def v(self) -> Block: ...


class Rotation(Motion, Protocol):
    """Small rotations (3, 1) in a frame, their rates, and their Jacobian (3, 3) by the relative angular velocity in that frame.
    S = E^T G are the axes that one body carries in those of the other, by rows of scalars."""

    @property
    def axes(self) -> Sequence[Sequence[Block]]: ...

    @property
    def by_rotation(self) -> Block: ...


class Mechanics(Protocol):
    """The motions of a force's points and directions, and the functions that apply forces to its bodies, for one method. Vectors (3, 1) are
    resolved in the method's axes."""

    @property
    def b(self) -> Builder:
        """The algebra of blocks."""

    @property
    def road(self) -> frozenset[str]:
        """The parts "surface" and "friction" that the scene's road has in addition to its tracks."""

    def scalar(self, expression: Scalar, values: Mapping[str, Block]) -> Block:
        """An expression of named variables."""

    def law(self, law: Scalar, values: Mapping[str, Block], position: str) -> dict[str, Block]:
        """The value of a law as ``force``, and its partial derivatives by position and rate as ``stiffness`` and ``damping``."""

    def in_motion(self, value: Block) -> Block:
        """A value that is zero while the equilibrium is sought."""

    def point(self, at: Point) -> Motion:
        """The place of a point from the world's origin in global axes, and its velocity in those of the method."""

    def displacement(self, start: Point, end: Point) -> Motion:
        """The displacement from one point to another."""

    def direction(self, axis: Axis) -> Motion:
        """A direction."""

    def spin(self, carrier: Carrier) -> Block:
        """The angular velocity of a body."""

    def spin_and_relative_rate(self, carrier: Carrier) -> tuple[Block, Block]:
        """The angular velocity of a body, and the rate of a wheel about its axis relative to that body."""

    def in_body(self, carrier: Carrier, vector: Block) -> Block:
        """The components of a vector in a body's axes."""

    def in_global(self, vector: Block) -> Block:
        """The components of a vector in global axes."""

    def from_global(self, components: Block) -> Block:
        """The vector of components in global axes."""

    def from_body(self, carrier: Carrier, components: Block) -> Block:
        """The vector of components in a body's axes."""

    def along(self, start: Point, end: Point, direction: Axis | Frame) -> Motion:
        """The components of the vector between two points along directions fixed in the start's body."""

    def rotation(self, frame: Frame) -> Rotation:
        """Half the sum of e_k x g_k, the axes of a frame fixed in either body of a force, in the frame."""

    def coordinate(self) -> dict[str, Block]:
        """The ``position``, where it is known, and the ``rate`` of the joint's coordinate on which the force works."""

    def apply_force_pair(self, start: Point, end: Point, force: Block) -> None:
        """A force on the end along the line between two points, and its reaction on the start."""

    def apply_force_along(self, start: Point, end: Point, direction: Axis | Frame, force: Block) -> None:
        """A force on the end by its components along directions of the start's body, which has the reaction on the same line."""

    def apply_force(self, at: Point, force: Block) -> None:
        """A force on a point."""

    def apply_force_at_offset(self, at: Point, arm: Block, force: Block, moment: Block) -> None:
        """A force at ``arm`` from a point of a body, and a moment on the body."""

    def apply_torque(self, carrier: Carrier, torque: Block) -> None:
        """A torque on a body."""

    def apply_frame_torque(self, frame: Frame, torque: Block) -> None:
        """A torque on the small rotations in a frame, and its reaction."""

    def apply_joint_force(self, force: Block) -> None:
        """A force on the joint's coordinate."""

    def apply_joint_friction(self, law: Block) -> None:
        """A force on the joint's coordinate, by N of the joint's load."""


# Looks


@dataclass(frozen=True)
class Coil:
    """A spring between two points, or along ``axis`` through the end, of the length from start to end."""

    start: Point
    end: Point
    axis: Axis | None = None


@dataclass(frozen=True)
class Ring:
    """A ring around a frame's third direction."""

    at: Point
    frame: Frame


@dataclass(frozen=True)
class Wheel:
    """A wheel on the road; ``rotates`` if its body does, else it is drawn as if it rolled."""

    at: Point
    axis: Axis
    rotates: bool = False


Visual: TypeAlias = Coil | Ring | Wheel
#: The point of application of a force, and the force, (times, 3) each; None if a run's outputs lack it.
Arrow: TypeAlias = tuple[Any, Any] | None


class VisualContext(Protocol):
    """Arrows of a force's quantities over time; None where a run's outputs do not have them."""

    def apply_force_pair(self, start: Point, end: Point, quantity: str) -> Arrow:
        """A tension on the end, towards the start."""

    def apply_force_along(self, at: Point, axis: Axis, quantity: str) -> Arrow:
        """A force on a point along an axis."""

    def components(self, at: Point, axes: Frame | Carrier | None) -> Arrow:
        """Fx, Fy and Fz on a point in a frame, in a body's axes or in global ones."""

    def lift(self, at: Point, below: Scalar, quantity: str) -> Arrow:
        """An upward force on the place at a depth below a point."""


# Interactions


@dataclass(frozen=True, kw_only=True)
class Interaction(ABC):
    """The mechanics of a force on its bodies; its fields are its points and directions there.

    ``equation`` is the comment in generated code, ``equation_of_points`` that of natural coordinates where it differs.
    ``needs_attitude``: it depends on all directions of its bodies or works on them; ``can_be_guarded`` that a law over one
    position or a point's is all of it, ``holds_bodies`` that its points hold bodies, ``has_road`` that it meets the road, which has a track
    for each such force in the runtime.  ``by_load``: the force is a law times the load of a joint.
    """

    equation: ClassVar[str]
    equation_of_points: ClassVar[str] = ""
    needs_attitude: ClassVar[bool] = False
    can_be_guarded: ClassVar[bool] = False
    holds_bodies: ClassVar[bool] = True
    has_road: ClassVar[bool] = False
    by_load: ClassVar[bool] = False

    @abstractmethod
    def act(self, force: Any, m: Mechanics) -> dict[str, Block]:
        """Act on the bodies; the quantities that the force reports."""

    def values(self, force: Any, m: Mechanics) -> dict[str, Block]:
        """The variables of the force's law by name, for guards and for laws that read them."""
        raise NotImplementedError

    def swapped(self, force: Any) -> Mapping[str, Any]:
        """The fields of the force's places after its bodies change parts, {} where that makes another force of it."""
        return {}

    def visuals(self) -> tuple[Visual, ...]:
        """The shapes that are drawn."""
        return ()

    def arrow(self, force: Any, context: VisualContext) -> Arrow:
        """The force on the follower or body, as an arrow."""
        return None
