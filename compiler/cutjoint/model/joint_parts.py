"""The shapes of joints in a model file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias, Union

from pydantic import BeforeValidator, Field, StrictBool, StrictStr, create_model, model_validator

from cutjoint.elements.joint import JointElement
from cutjoint.elements.joints import JOINTS
from cutjoint.model.values import Direction, Law, Number, Pair, Part, Point, shape_error


class JointSpring(Part):
    """A linear spring and damper on one of a joint's coordinates: short for a joint_force."""

    stiffness: Number = 0
    damping: Number = 0
    free_position: Number = 0
    coordinate: StrictStr | None = None


class JointLimits(Part):
    """Soft stops at the ends of a coordinate's range: short for a joint_force."""

    lower: Number | None = None
    upper: Number | None = None
    stiffness: Number
    damping: Number = 0
    coordinate: StrictStr | None = None

    @model_validator(mode="after")
    def _one_end(self) -> JointLimits:
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


def _list(value: Any) -> Any:
    if isinstance(value, tuple):
        return value
    raise shape_error("needs a list of laws, one for each coordinate")


Guides = Annotated[tuple[Law, ...], BeforeValidator(_list)]

#: The types of the fields that kinds have of their own.
_TYPES: Mapping[str, Any] = {"axis": Direction, "axis_2": Direction, "to": Point, "pitch": Number}


def _shape_of(element: JointElement) -> type[JointPart]:
    """The shape of a kind's joints."""
    fields: dict[str, Any] = {"kind": (Literal[str(element.kind)], ...)}
    for field in element.fields:
        fields[field.name] = (_TYPES[field.name] | None, None) if field.optional else (_TYPES[field.name], ...)
    if element.can_be_guided:
        fields["guide"] = ((Law if len(element.coordinates) == 1 else Guides) | None, None)
    name = element.kind.title().replace("_", "")
    return create_model(f"{name}Joint", __base__=JointPart, __doc__=f"A joint that leaves free: {element.text}.", **fields)


if TYPE_CHECKING:
    Joint: TypeAlias = JointPart
else:
    Joint = Annotated[Union[tuple(map(_shape_of, JOINTS.values()))], Field(discriminator="kind")]  # noqa: UP007
