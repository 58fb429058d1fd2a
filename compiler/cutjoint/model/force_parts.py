"""The shapes of force elements in a model file, from the catalogue of force kinds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from keyword import iskeyword
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias, Union

from pydantic import Field, StrictBool, StrictStr, create_model, model_validator

from cutjoint.elements.force import REQUIRED, Choice, Constants, ForceElement, ForceField, Shape
from cutjoint.elements.forces import FORCES
from cutjoint.model.values import Direction, Law, Laws, Names, Number, Pair, Part, Point, Six, Triple, shape_error


class ForcePart(Part):
    """The fields of all forces; each kind adds its own from the catalogue."""

    if TYPE_CHECKING:
        kind: str
    active: StrictBool = True


_TYPES: Mapping[Shape, Any] = {
    Shape.BODY: StrictStr, Shape.BODIES: Pair, Shape.JOINT: StrictStr, Shape.COORDINATE: StrictStr, Shape.POINT: Point,
    Shape.DIRECTION: Direction, Shape.NUMBER: Number, Shape.TRIPLE: Triple, Shape.SIX: Six, Shape.LAW: Law, Shape.LAWS: Laws,
    Shape.NAMES: Names, Shape.SWITCH: StrictBool,
}  # fmt: skip


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
    found = _TYPES[field.shape]
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


def _shape_of(element: ForceElement) -> type[ForcePart]:
    """The shape of a kind's forces."""
    fields: dict[str, Any] = {"kind": (Literal[str(element.kind)], ...)}
    fields |= {attribute(field.name): _field(field) for field in element.fields}
    checks: dict[str, Any] = {} if element.problem is None else {"check": model_validator(mode="after")(_check(element.problem))}
    name = element.kind.title().replace("_", "")
    return create_model(name, __base__=ForcePart, __doc__=element.text, __validators__=checks, **fields)


if TYPE_CHECKING:
    Force: TypeAlias = ForcePart
else:
    Force = Annotated[Union[tuple(_shape_of(record.element) for record in FORCES.values())], Field(discriminator="kind")]  # noqa: UP007
