"""The shapes of values in a model file: numbers, points, directions, inertia, laws.

Only shapes are checked here; names, numbers and units are resolved later.  Members of unions are distinguished by their form, so that a
fault is reported once and in the user's words.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypeAlias, Union, get_args

import pydantic
from pydantic import Discriminator, Field, PlainValidator, StrictStr, Tag, WithJsonSchema
from pydantic_core import PydanticCustomError, core_schema

from cutjoint.model.names import MAX_NAME_LENGTH, RESERVED_EVERYWHERE, RESERVED_IN_EXPRESSIONS, name_problem

TAG = "<{}>"  #: pydantic's name for a member of a union, by its number
LOST = "\0"  #: stands for what could not be read, whose problem is reported, in names and expressions; no file can have it
MAX_COEFFICIENTS = 20
MAX_PIECES = 100
MAX_TABLE = 200  #: points of a curve
MAX_GRID = 400  #: points of a surface
MAX_FIELD = 50_000  #: heights of a road
_NAME_SCHEMA = {"type": "string", "pattern": "^[A-Za-z][A-Za-z0-9_]*$", "maxLength": MAX_NAME_LENGTH}
NAMED_AXES = ("x", "y", "z", "-x", "-y", "-z")  #: the axes of the design frame by their names, and the opposite directions
_DIRECTION = "needs three numbers, an axis such as x or -y, or {from: P, to: Q}"
#: The axes of Euler angles, in turn.
Order = Literal["xyz", "xzy", "yxz", "yzx", "zxy", "zyx", "xyx", "xzx", "yxy", "yzy", "zxz", "zyz"]
ANY = "any"  #: stands for one of the directions across the axis of an axisymmetric body
_PRINCIPAL, _WORDS = f"{_DIRECTION}, or any", (*NAMED_AXES, ANY)


class Part(pydantic.BaseModel):
    """A mapping with known keys."""

    model_config = pydantic.ConfigDict(frozen=True, extra="forbid")


def shape_error(message: str, hint: str = "") -> PydanticCustomError:
    """An error of shape, in the words that the user reads."""
    return PydanticCustomError("shape", "{text}", {"text": message, "hint": hint})


@dataclass(frozen=True, eq=False)
class ByForm:
    """An annotation of unions, whose members are distinguished by a value's type, or by a key that a mapping has.
    ``forms`` gives the member for each; ``message`` is for values of no such form."""

    forms: Mapping[type | str, Any]
    message: str

    def __get_pydantic_core_schema__(self, source: Any, handler: pydantic.GetCoreSchemaHandler) -> core_schema.CoreSchema:
        """The schema of the union, whose members have their numbers as tags."""
        members = get_args(source)
        tags = {form: TAG.format(members.index(member)) for form, member in self.forms.items()}

        def tag(value: Any) -> str | None:
            if isinstance(value, dict):
                return next((tags[key] for key in tags if isinstance(key, str) and key in value), tags.get(dict))
            return tags.get(type(value))

        tagged: Any = Union[tuple(Annotated[member, Tag(TAG.format(i))] for i, member in enumerate(members))]  # noqa: UP007
        by_tag = Discriminator(tag, custom_error_type="shape", custom_error_message=self.message)
        return handler.generate_schema(Annotated[tagged, by_tag])


@dataclass(frozen=True)
class OneOf:
    """An annotation of texts: one of the names of a catalogue."""

    names: Iterable[str]

    def __get_pydantic_core_schema__(self, source: Any, handler: pydantic.GetCoreSchemaHandler) -> core_schema.CoreSchema:
        """The schema of a Literal of the names."""
        return core_schema.literal_schema([str(name) for name in self.names])


def checked(is_right: Callable[[Any], object], message: str, hint: str = "") -> Callable[[Any], Any]:
    """A check of values, with the message for others."""

    def check(value: Any) -> Any:
        if not is_right(value):
            raise shape_error(message, hint)
        return value

    return check


_number = checked(lambda x: isinstance(x, (int, float, str)) and not isinstance(x, bool), "needs a number or an expression")


_unit = checked(lambda value: isinstance(value, str) or value == 1, "this is not a unit", "write for example N*s/m")


def _list_of(*sizes: int, words: str, hint: str) -> pydantic.BeforeValidator:
    """The check of a list that must have one of some lengths, with the message for others."""
    return pydantic.BeforeValidator(checked(lambda value: isinstance(value, tuple) and len(value) in sizes, words, hint))


_SIX = _list_of(6, words="needs six values", hint="write [along x, y, z, about x, y, z]")


def _names(reserved: Collection[str] = ()) -> pydantic.AfterValidator:
    """The check of a name that is not ``reserved``."""

    def checked(name: str) -> str:
        if found := name_problem(name, reserved):
            raise shape_error(*found)
        return name

    return pydantic.AfterValidator(checked)


Name = Annotated[StrictStr, _names(), WithJsonSchema(_NAME_SCHEMA)]
TermName = Annotated[StrictStr, _names(RESERVED_IN_EXPRESSIONS), WithJsonSchema(_NAME_SCHEMA)]
ParameterName = Annotated[StrictStr, _names(RESERVED_EVERYWHERE), WithJsonSchema(_NAME_SCHEMA)]
Number = Annotated[int | float | str, PlainValidator(_number), WithJsonSchema({"type": ["number", "string"]})]
NUMBERS = dict.fromkeys((int, float, str), Number)  #: the form of numbers and expressions in a union
Unit = Annotated[str, PlainValidator(lambda value: str(_unit(value))), WithJsonSchema({"type": ["string", "integer"]})]
Triple = Annotated[tuple[Number, ...], Field(min_length=3, max_length=3), _list_of(3, words="needs three numbers", hint="write [x, y, z]")]
Pair = Annotated[tuple[StrictStr, ...], Field(min_length=2, max_length=2), _list_of(2, words="needs two names", hint="write [one, other]")]
Six = Annotated[tuple[Number, ...], Field(min_length=6, max_length=6), _SIX]
Four = Annotated[
    tuple[Number, ...], Field(min_length=4, max_length=4),
    _list_of(4, words="needs four numbers", hint="write [w, x, y, z], the scalar first"),
]  # fmt: skip
Ends = Annotated[tuple[Number, ...], Field(min_length=2, max_length=2)]
Coefficients = Annotated[tuple[Number, ...], Field(min_length=1, max_length=MAX_COEFFICIENTS)]


class Midpoint(Part):
    """The midpoint of two points."""

    midpoint: Pair


class FromTo(Part):
    """The direction from one point to another."""

    from_: StrictStr = Field(alias="from")
    to: StrictStr


_named_axis = pydantic.AfterValidator(checked(NAMED_AXES.__contains__, _DIRECTION))
NamedAxis = Annotated[StrictStr, _named_axis, WithJsonSchema({"enum": list(NAMED_AXES)})]

Direction: TypeAlias = Annotated[
    Triple | FromTo | NamedAxis, ByForm({tuple: Triple, "from": FromTo, "to": FromTo, str: NamedAxis}, _DIRECTION)
]


class ScaledDisplacement(FromTo):
    """The vector from one point to another, or a multiple of it."""

    times: Number = 1


class Along(Part):
    """A vector of a length along a direction; opposite to it if the length is negative."""

    along: Direction
    by: Number


Addend: TypeAlias = Annotated[
    Triple | StrictStr | Midpoint | ScaledDisplacement | Along,
    ByForm(
        {
            tuple: Triple, str: StrictStr, "midpoint": Midpoint,
            **dict.fromkeys(("from", "to", "times"), ScaledDisplacement), **dict.fromkeys(("along", "by"), Along),
        },
        "needs a point or a vector: three numbers, a point's name, {from: P, to: Q} or {along: direction, by: length}",
    ),
]  # fmt: skip


class PointSum(Part):
    """A point, and vectors that lead on from it."""

    sum: Annotated[tuple[Addend, ...], Field(min_length=2, max_length=MAX_PIECES)]


Point: TypeAlias = Annotated[
    Triple | StrictStr | Midpoint | PointSum,
    ByForm(
        {tuple: Triple, str: StrictStr, "midpoint": Midpoint, "sum": PointSum},
        "needs three numbers, a point's name, {midpoint: [P, Q]} or {sum: [point, vector, ...]}",
    ),
]


class Attitude(Part):
    """The attitude of a joint's follower relative to its base, in one of three forms; ``order`` names the axes of the Euler angles in turn.
    """

    rotation_vector: Triple | None = None
    euler: Triple | None = None
    order: Order | None = None
    quaternion: Four | None = None

    @pydantic.model_validator(mode="after")
    def _one_form(self) -> Attitude:
        forms = [name for name in ("rotation_vector", "euler", "quaternion") if getattr(self, name) is not None]
        if len(forms) != 1:
            raise shape_error(f"has {' and '.join(forms) or 'no attitude'}", "write one of rotation_vector, euler and quaternion")
        if (self.euler is None) != (self.order is None):
            raise shape_error("'euler' and 'order' belong together", "write for example {euler: [yaw, pitch, roll], order: zyx}")
        return self


State: TypeAlias = Annotated[
    Number | Attitude,
    ByForm(
        {**NUMBERS, **dict.fromkeys(("rotation_vector", "euler", "order", "quaternion"), Attitude)},
        "needs a number, or of an attitude {rotation_vector: ...}, {euler: ..., order: ...} or {quaternion: ...}",
    ),
]


_axis_or_any = pydantic.AfterValidator(checked(_WORDS.__contains__, _PRINCIPAL))
_AxisOrAny = Annotated[StrictStr, _axis_or_any, WithJsonSchema({"enum": [*_WORDS]})]

PrincipalDirection: TypeAlias = Annotated[
    Triple | FromTo | _AxisOrAny, ByForm({tuple: Triple, "from": FromTo, "to": FromTo, str: _AxisOrAny}, _PRINCIPAL)
]


class Principal(Part):
    """Principal moments of inertia and two of the three principal directions, one of which may be any where the body is axisymmetric."""

    principal: Triple
    x: PrincipalDirection | None = None
    y: PrincipalDirection | None = None
    z: PrincipalDirection | None = None


class AxialInertia(Part):
    """The inertia of a shaft about its axis and none across it."""

    axial: Number
    axis: Direction


_Matrix = Annotated[
    tuple[Number, ...], Field(min_length=3, max_length=6),
    _list_of(3, 6, words="needs three or six numbers", hint="write [Ixx, Iyy, Izz] or [Ixx, Iyy, Izz, Ixy, Ixz, Iyz]"),
]  # fmt: skip


class FramedMatrix(Part):
    """An inertia matrix in a frame of which two directions are given."""

    matrix: _Matrix
    x: Direction | None = None
    y: Direction | None = None
    z: Direction | None = None


Inertia: TypeAlias = Annotated[
    _Matrix | Principal | FramedMatrix | AxialInertia,
    ByForm(
        {tuple: _Matrix, "principal": Principal, "matrix": FramedMatrix, "axial": AxialInertia, "axis": AxialInertia},
        "needs three or six numbers, {principal: [a, b, c], x: direction, y: direction} or {axial: J, axis: direction}",
    ),
]


class Polynomial(Part):
    """Coefficients from the constant up, of one variable."""

    polynomial: Coefficients
    of: StrictStr


class Branch(Part):
    """One piece of a piecewise law: a polynomial or an expression, valid below a limit."""

    below: Number | None = None
    polynomial: Coefficients | None = None
    expression: Number | None = None

    @pydantic.model_validator(mode="after")
    def _one_form(self) -> Branch:
        if (self.polynomial is None) == (self.expression is None):
            raise shape_error("a piece needs either polynomial or expression")
        return self


class Piecewise(Part):
    """Pieces in the order of rising limits; the last has no limit."""

    piecewise: Annotated[tuple[Branch, ...], Field(min_length=1, max_length=MAX_PIECES)]
    of: StrictStr


class Sum(Part):
    """The sum of several laws."""

    sum: Annotated[tuple[Law, ...], Field(min_length=1, max_length=MAX_PIECES)]


#: Names for parts of expressions, each over those above it.
Names = Annotated[dict[TermName, Number], Field(max_length=MAX_PIECES)]


class Let(Part):
    """A law with names for parts of its expressions."""

    let: Names
    law: Law


def _entry(value: Any) -> Any:
    return tuple(map(_number, value)) if isinstance(value, tuple) else _number(value)


#: A list of numbers; of the value of two variables a list of such lists.
Entries = Annotated[tuple[Annotated[Any, PlainValidator(_entry)], ...], Field(max_length=MAX_TABLE)]
FieldEntries = Annotated[tuple[Annotated[Any, PlainValidator(_entry)], ...], Field(max_length=MAX_FIELD)]


def table_schema(most: int) -> dict[str, Any]:
    """The schema of a table whose lists have that many entries or fewer."""
    entries = {"type": "array", "items": {"type": ["number", "string", "array"]}, "maxItems": most}
    return {"type": "object", "additionalProperties": {"anyOf": [entries, {"type": "string"}]}}


class Table(Part):
    """A curve through points, or a surface; the keys are ``value`` and the names of one or two variables.

    With the name of a ``file`` these may have names of its columns.
    """

    table: Annotated[dict[StrictStr, Entries], WithJsonSchema(table_schema(MAX_TABLE))]
    interpolation: Literal["cubic", "linear"] = "cubic"

    @pydantic.model_validator(mode="after")
    def _few_points(self) -> Table:
        points = sum(len(entry) for entry in self.table.get("value", ()) if isinstance(entry, tuple))
        if points > MAX_GRID:
            raise shape_error(f"needs at most {MAX_GRID} points, got {points}")
        return self


class SpringDamper(Part):
    """A linear spring and damper; ``preload`` is its force in the design position, "drawn" its length there."""

    stiffness: Number = 0
    damping: Number = 0
    preload: Number | None = None
    free_length: Number | None = None
    free_position: Number | None = None


class OneSided(Part):
    """A stop: the coordinate at which it is met, its side, its stiffness and damping."""

    at: Number
    side: Literal["below", "above"]
    stiffness: Number
    damping: Number = 0


class Stop(Part):
    """A one-sided linear spring and damper, which never pulls."""

    stop: OneSided


Law: TypeAlias = Annotated[
    Number | Polynomial | Piecewise | Sum | Let | Table | SpringDamper | Stop,
    ByForm(
        {
            **NUMBERS, "polynomial": Polynomial, "piecewise": Piecewise, "sum": Sum, "let": Let, "table": Table, "stop": Stop,
            "interpolation": Table, **dict.fromkeys(("stiffness", "damping", "preload"), SpringDamper),
        },
        "needs a number, an expression, or a mapping with polynomial, piecewise, sum, let, table, stop or stiffness",
    ),
]
Laws = Annotated[tuple[Law, ...], Field(min_length=6, max_length=6), _SIX]
Sum.model_rebuild()
Let.model_rebuild()
