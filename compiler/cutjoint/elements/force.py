"""The description of a force kind: its fields in the file, its record, and the interaction by which it acts on its bodies.

Expressions come in by the builders of `Reader` and `Mirror`.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from enum import StrEnum
from typing import Any, ClassVar, Protocol, Self

from cutjoint.elements.interaction import Axis, Carrier, Frame, Interaction, Place, Point
from cutjoint.elements.terms import Scalar, Span, Vector

REQUIRED: Any = object()  #: the default of a field that must be given

# Fields in the file


class Shape(StrEnum):
    """The shape of a field's value in the file."""

    BODY = "body"
    BODIES = "bodies"  #: base and follower
    JOINT = "joint"
    COORDINATE = "coordinate"
    POINT = "point"
    DIRECTION = "direction"
    NUMBER = "number"
    TRIPLE = "triple"  #: three expressions
    SIX = "six"  #: six numbers, along three axes and about them
    LAW = "law"
    LAWS = "laws"  #: six laws, along three axes and about them
    NAMES = "names"  #: names for parts of expressions
    SWITCH = "switch"  #: true or false


@dataclass(frozen=True)
class Choice:
    """One of several words."""

    words: tuple[str, ...]


@dataclass(frozen=True)
class Constants:
    """Numbers by their names; ``title`` and ``text`` describe them in the schema."""

    title: str
    text: str
    names: tuple[str, ...]


@dataclass(frozen=True)
class ForceField:
    """A field of the kind in a model file, besides those that all forces have; with the default None it may be left out.
    ``words`` and ``unit`` describe it in the documentation."""

    name: str
    shape: Shape | Choice | Constants
    default: Any = REQUIRED
    words: str = ""
    unit: str = ""


@dataclass(frozen=True)
class Law:
    """The variables of a law with their units, except time ``t``, and the unit of its value."""

    variables: Mapping[str, str]
    unit: str

    @property
    def position(self) -> str:
        """The variable by which the stiffness is defined."""
        return next(iter(self.variables))


@dataclass(frozen=True, kw_only=True)
class Bristle:
    """A first-order state of a force, dimensionless: its symbol, its rate (1/s), and the limit of the force by N of load."""

    symbol: Scalar
    rate: Scalar
    limit: Scalar


class Reader(Protocol):
    """Makes expressions of a force's fields and reports problems in them; fields are given by their names in the file."""

    def common(self) -> Mapping[str, Any]:
        """The fields of all forces: ``name``, ``active`` and ``span``; between two ``bodies`` the full names ``base`` and ``follower``."""

    def field(self, name: str) -> Any:
        """The value of a field in the file, None if there is none."""

    def body(self, name: str) -> str:
        """The full name of a body."""

    def coordinate(self, joint: str, coordinate: str) -> tuple[str, str, str]:
        """The full name of a joint, its coordinate (by default the only one), and the unit; "" for both if they are wrong."""

    def point(self, name: str) -> Vector:
        """A point."""

    def distinct(self, start: Vector, end: Vector, *, names: tuple[str, str], hint: str) -> None:
        """Note a problem of the second field where two points coincide."""

    def direction(self, name: str) -> Vector:
        """A unit vector."""

    def across(self, direction: Vector, name: str) -> Vector:
        """The unit vector of a field's component perpendicular to a direction; an arbitrary one if the field is missing."""

    def frame(self) -> tuple[Vector, Vector, Vector]:
        """Right-handed unit vectors of which ``x``, ``y`` and ``z`` give two, the global ones if none is given."""

    def number(self, *path: str | int, unit: str) -> Scalar:
        """A number of a unit, "" for any unit; ``path`` leads to it."""

    def expression(self, name: str, *, unit: str) -> Scalar:
        """A number that may change: over time, parameters, inputs and quantities of elements."""

    def triple(self, name: str, law: Law, *, let: str) -> Vector:
        """Three expressions of a law's variables, and of the names in the field ``let``."""

    def law(self, *path: str | int, law: Law, drawn: Scalar = 0) -> Scalar:
        """A law; ``path`` leads to it, ``drawn`` is the value of its length or position in the design position."""

    def friction(self, unit: str) -> tuple[Scalar, Bristle]:
        """The friction on a coordinate in "m" or "rad" per N of load, and its bristle; reports problems in its numbers."""

    def distance(self, start: Vector, end: Vector) -> Scalar:
        """The distance of two points in the design position."""

    def variable(self, name: str) -> Scalar:
        """A variable of a law."""


@dataclass(frozen=True)
class Mirror:
    """A reflection along a global axis: ``signs`` of the three components."""

    signs: tuple[int, int, int]

    def vector(self, v: Vector) -> Vector:
        """The image of a point or a translation."""
        return (self.signs[0] * v[0], self.signs[1] * v[1], self.signs[2] * v[2])

    def rotation(self, v: Vector) -> Vector:
        """The image of an axis of rotation or a torque."""
        a, b, c = self.vector(v)
        return (-a, -b, -c)

    def frame(self, axes: tuple[Vector, Vector, Vector]) -> tuple[Vector, Vector, Vector]:
        """The image of a frame, whose axes along the mirror's are reversed once more: it stays right-handed, and global axes stay global.
        """
        x, y, z = ((sign * a, sign * b, sign * c) for sign, (a, b, c) in zip(self.signs, map(self.vector, axes), strict=True))
        return x, y, z

    def law(self, expression: Scalar) -> Scalar:
        """An expression over x y z vx vy vz and wx wy wz, as the image sees it."""
        axis = "xyz"[self.signs.index(-1)]
        return self.opposite(expression, (axis, f"v{axis}", *(f"w{other}" for other in "xyz" if other != axis)))

    @staticmethod
    def opposite(expression: Scalar, names: Sequence[str]) -> Scalar:
        """An expression with the sign of some variables changed."""
        return expression.xreplace({symbol: -symbol for symbol in expression.free_symbols if symbol.name in names})

    @staticmethod
    def reflected(law: Scalar, sign: int) -> Scalar:
        """A law over ``position`` and ``rate``, which change their sign, as its force does, if ``sign`` is -1."""
        return law if sign > 0 else -Mirror.opposite(law, ("position", "rate"))


# The record


@dataclass(frozen=True, kw_only=True)
class ForceElement:
    """A kind of force.

    ``text`` describes it in the schema. ``interaction`` is how it works on its bodies. ``laws`` names the record's fields that have
    expressions: the force is linear in them. ``forms`` are the variables and units of its laws, one for each form of the kind.
    ``quantities`` are what it reports, with units; those of a force with one law follow from the law. In an image, those in ``odd`` change
    their sign; where there are ``components``, all are those of vectors (x, Fx) and of rotations (Mx). ``problem`` returns the error in the
    fields of a part of the document, and a remedy; () for none.
    """

    kind: str
    text: str
    fields: tuple[ForceField, ...]
    interaction: Interaction
    laws: tuple[str, ...]
    forms: tuple[Law, ...] = ()
    quantities: Mapping[str, str] = field(default_factory=dict)
    odd: tuple[str, ...] = ()
    components: bool = False
    problem: Callable[[Any], tuple[str, ...]] | None = None

    @property
    def places(self) -> Iterator[Place]:
        """The points and directions of its interaction."""
        return (getattr(self.interaction, f.name) for f in fields(self.interaction))


@dataclass(frozen=True, kw_only=True)
class Force:
    """The common part of all forces' records; ``active`` says whether a force acts unless a scene switches it."""

    element: ClassVar[ForceElement]

    name: str
    active: bool
    span: Span

    @classmethod
    def read(cls, reader: Reader) -> Self:
        """The record of an element in a model file."""
        raise NotImplementedError

    @property
    def interaction(self) -> Interaction:
        """The interaction by which the force acts on its bodies."""
        return self.element.interaction

    @property
    def places(self) -> Iterator[Place]:
        """The points and directions that it has on its bodies."""
        return (place for place in self.element.places if place.of(self) is not None)

    @property
    def bodies(self) -> tuple[str, ...]:
        """The bodies that it names: base and follower, or one; none where it acts on a joint's coordinate."""
        return tuple(getattr(self, carrier) for carrier in Carrier if hasattr(self, carrier))

    @property
    def joint_of(self) -> str:
        """The joint on whose coordinate it acts, "" for none."""
        return ""

    @property
    def coordinate_of(self) -> str:
        """The coordinate of that joint, "" for none."""
        return ""

    @property
    def has_road(self) -> bool:
        """Return whether the force touches the road."""
        return self.interaction.has_road

    @property
    def by_load(self) -> bool:
        """Return whether the force depends on its joint's load, and so on all accelerations."""
        return self.interaction.by_load

    @property
    def radius(self) -> Scalar:
        """The radius of the wheel, m, of a force that touches the road."""
        raise NotImplementedError

    @property
    def needs_attitude(self) -> bool:
        """Return whether the force depends on all directions of its bodies, or works on them."""
        return self.interaction.needs_attitude

    @property
    def has_frame(self) -> bool:
        """Return whether the force has components along axes of a body, so that its points and directions alone do not determine it."""
        return any(isinstance(place, Frame) for place in self.places)

    def sole_point(self, carrier: Carrier) -> Point | None:
        """The point at which it acts on a body, if it needs nothing else of the body."""
        carried = [place for place in self.places if place.carrier is carrier]
        return carried[0] if len(carried) == 1 and isinstance(carried[0], Point) and not self.has_frame else None

    @property
    def expressions(self) -> tuple[Scalar, ...]:
        """The laws or components of the force."""
        found = (getattr(self, name) for name in self.element.laws)
        return tuple(law for laws in found for law in (laws if isinstance(laws, tuple) else (laws,)))

    @property
    def quantities(self) -> Mapping[str, str]:
        """The quantities that the force reports, with units."""
        return self.element.quantities

    @property
    def measured(self) -> frozenset[str]:
        """The quantities that follow from the motion alone, whatever the law."""
        return frozenset(name for name in self.quantities if not self.follows_law(name))

    @property
    def measured_when_off(self) -> frozenset[str]:
        """The quantities that a force has where it is switched off: those measured, without those of a wheel's road contact."""
        return frozenset() if self.has_road else self.measured

    def mirrored(self, mirror: Mirror, signs: Mapping[str, Mapping[str, int]]) -> Self:
        """The image of the force; ``signs`` has for the coordinates of joints 1 or -1, by their direction of counting in the image."""
        images: dict[str, Any] = {}
        for place in self.places:
            if not isinstance(place, Frame):
                is_rotation = isinstance(place, Axis) and place.is_rotation
                images[place.field] = (mirror.rotation if is_rotation else mirror.vector)(place.of(self))
        return replace(self, **images)

    def image_sign(self, quantity: str, sign: Callable[[str], int], of_coordinate: int) -> int:
        """The sign of a quantity in the force's image: 1 if it keeps its sign, else -1.
        ``sign`` says it of components, ``of_coordinate`` of the coordinate that it acts on."""
        return sign(quantity) if self.element.components else -1 if quantity in self.element.odd else 1

    def follows_law(self, quantity: str) -> bool:
        """Return whether a quantity follows from the law: forces, torques and their derivatives."""
        return self.quantities[quantity].startswith("N")


@dataclass(frozen=True, kw_only=True)
class LawForce(Force):
    """A force with one law over one position and its rate."""

    law: Scalar

    @property
    def variables(self) -> Law:
        """The variables of the law."""
        (form,) = self.element.forms
        return form

    @property
    def quantities(self) -> Mapping[str, str]:
        """The law's value and its derivatives by position and rate; these too, unless they are a joint's, which reports them."""
        law = self.variables
        unit = law.variables[law.position]
        measured = {} if self.joint_of else law.variables
        return {"force": law.unit, **measured, "stiffness": f"{law.unit}/{unit}", "damping": f"{law.unit}*s/{unit}"}


@dataclass(frozen=True, kw_only=True)
class OnJoint(Force):
    """A force on one scalar coordinate of a joint, named as in the joint's kind, in ``unit`` "m" or "rad"."""

    joint: str
    coordinate: str
    unit: str

    @property
    def joint_of(self) -> str:
        """The joint of the force."""
        return self.joint

    @property
    def coordinate_of(self) -> str:
        """The coordinate of the force."""
        return self.coordinate

    def image_sign(self, quantity: str, sign: Callable[[str], int], of_coordinate: int) -> int:
        """A force counts as its coordinate does."""
        return of_coordinate if quantity == "force" else 1
