"""The shapes of joints and force elements in a model file, from the catalogue of their kinds."""

from collections.abc import Callable, Mapping
from keyword import iskeyword
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias, Union

from pydantic import BeforeValidator, Field, StrictBool, StrictStr, create_model, model_validator

from cutjoint.elements.force import REQUIRED, Choice, Constants, ForceElement, ForceField, Shape
from cutjoint.elements.forces import FORCES
from cutjoint.elements.joint import JointElement
from cutjoint.elements.joints import JOINTS
from cutjoint.model.document.values import Direction, Law, Laws, Names, Number, Pair, Part, Point, Six, Triple, checked, shape_error

#: The types of the fields that kinds have of their own.
_JOINT_TYPES: Mapping[str, Any] = {"axis": Direction, "axis_2": Direction, "to": Point, "pitch": Number}
_FORCE_TYPES: Mapping[Shape, Any] = {
    Shape.BODY: StrictStr, Shape.BODIES: Pair, Shape.JOINT: StrictStr, Shape.COORDINATE: StrictStr, Shape.POINT: Point,
    Shape.DIRECTION: Direction, Shape.NUMBER: Number, Shape.TRIPLE: Triple, Shape.SIX: Six, Shape.LAW: Law, Shape.LAWS: Laws,
    Shape.NAMES: Names, Shape.SWITCH: StrictBool,
}  # fmt: skip

# Joints


class JointSpring(Part):
    """A linear spring and damper on one of a joint's coordinates: short for a joint_force."""

    stiffness: Number = 0
    damping: Number = 0
    preload: Number | None = None
    free_position: Number | None = None
    coordinate: StrictStr | None = None


class BallSpring(Part):
    """A spring and a damper on all rotations of a joint: ``free_rotation`` is the follower's attitude of rest."""

    stiffness: Number = 0
    damping: Number = 0
    free_rotation: Triple | None = None


class JointLimits(Part):
    """Soft stops at the ends of a coordinate's range: short for a joint_force."""

    lower: Number | None = None
    upper: Number | None = None
    stiffness: Number
    damping: Number = 0
    coordinate: StrictStr | None = None

    @model_validator(mode="after")
    def _one_end(self) -> "JointLimits":
        if self.lower is None and self.upper is None:
            raise shape_error("limits need lower, upper or both")
        return self


class JointPart(Part):
    """The fields of all joints; each kind adds its own from the catalogue."""

    kind: str
    bodies: Pair
    at: Point
    cut: StrictBool | None = None
    spring: JointSpring | None = None
    limits: JointLimits | None = None


_list = checked(lambda value: isinstance(value, tuple), "needs a list of laws, one for each coordinate")
Guides = Annotated[tuple[Law, ...], BeforeValidator(_list)]


def _joint_shape(element: JointElement) -> type[JointPart]:
    fields: dict[str, Any] = {"kind": (Literal[str(element.kind)], ...)}
    for field in element.fields:
        fields[field.name] = (_JOINT_TYPES[field.name] | None, None) if field.optional else (_JOINT_TYPES[field.name], ...)
    if element.has_ball and not element.coordinates:
        fields["spring"] = (BallSpring | None, None)
    if element.can_be_guided:
        fields["guide"] = ((Law if len(element.coordinates) == 1 else Guides) | None, None)
    if len(element.coordinates) == 1 and element.can_be_guided:
        fields["armature"] = (Number | None, None)
    name = element.kind.title().replace("_", "")
    return create_model(f"{name}Joint", __base__=JointPart, __doc__=f"A joint that leaves free: {element.text}.", **fields)


if TYPE_CHECKING:
    Joint: TypeAlias = JointPart
else:
    Joint = Annotated[Union[tuple(map(_joint_shape, JOINTS.values()))], Field(discriminator="kind")]  # noqa: UP007


# Forces


class ForcePart(Part):
    """The fields of all forces; each kind adds its own from the catalogue."""

    if TYPE_CHECKING:
        kind: str
    active: StrictBool = True


def attribute(name: str) -> str:
    """The attribute of a part that has a field of the file."""
    return f"{name}_" if iskeyword(name) else name


def _type_of(field: ForceField) -> Any:
    match field.shape:
        case Choice():
            return Literal[field.shape.words]
        case Constants():
            constants: dict[str, Any] = dict.fromkeys(field.shape.names, (Number, ...))
            return create_model(field.shape.title, __base__=Part, __doc__=field.shape.text, **constants)
    found = _FORCE_TYPES[field.shape]
    return found | None if field.default is None else found


def _field(field: ForceField) -> tuple[Any, Any]:
    alias = field.name if iskeyword(field.name) else None
    if field.default is REQUIRED:
        return _type_of(field), Field(alias=alias)
    return _type_of(field), Field(default=field.default, alias=alias)


def _check(problem: Callable[[Any], tuple[str, ...]]) -> Callable[[ForcePart], ForcePart]:
    def check(part: ForcePart) -> ForcePart:
        found = problem(part)
        if found:
            raise shape_error(*found)
        return part

    return check


def _force_shape(element: ForceElement) -> type[ForcePart]:
    fields: dict[str, Any] = {"kind": (Literal[str(element.kind)], ...)}
    fields |= {attribute(field.name): _field(field) for field in element.fields}
    checks: dict[str, Any] = {} if element.problem is None else {"check": model_validator(mode="after")(_check(element.problem))}
    name = element.kind.title().replace("_", "")
    return create_model(name, __base__=ForcePart, __doc__=element.text, __validators__=checks, **fields)


if TYPE_CHECKING:
    Force: TypeAlias = ForcePart
else:
    Force = Annotated[Union[tuple(_force_shape(record.element) for record in FORCES.values())], Field(discriminator="kind")]  # noqa: UP007
