"""The shapes of force elements in a model file."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import Field, StrictBool, StrictStr, model_validator

from cutjoint.model.values import Direction, Law, Laws, Names, Number, Pair, Part, Point, Six, Triple, shape_error


class ForcePart(Part):
    """What all forces have."""

    active: StrictBool = True


class PointSpring(ForcePart):
    """A force between two points, along the line through them."""

    kind: Literal["point_spring"]
    bodies: Pair
    from_: Point = Field(alias="from")
    to: Point
    law: Law


class AxialForce(ForcePart):
    """A force along an axis of the base."""

    kind: Literal["axial_force"]
    bodies: Pair
    origin: Point
    point: Point
    axis: Direction
    law: Law


class Bushing(ForcePart):
    """Six springs between two bodies at a point, in a frame of the base: along its axes and about them."""

    kind: Literal["bushing"]
    bodies: Pair
    at: Point
    x: Direction | None = None
    y: Direction | None = None
    z: Direction | None = None
    stiffness: Six | None = None
    damping: Six | None = None
    laws: Laws | None = None

    @model_validator(mode="after")
    def _laws_or_numbers(self) -> Bushing:
        if (self.laws is None) == (self.stiffness is None and self.damping is None):
            raise shape_error("needs either laws, or stiffness and damping")
        return self


class Load(ForcePart):
    """A force or a torque on one body."""

    kind: Literal["load"]
    body: StrictStr
    at: Point | None = None
    force: Triple | None = None
    torque: Triple | None = None
    let: Names = Field(default={})
    axes: Literal["global", "body"] = "global"
    moving_only: StrictBool = False

    @model_validator(mode="after")
    def _force_or_torque(self) -> Load:
        if (self.force is None) == (self.torque is None):
            raise shape_error("needs either force or torque", "write two loads for both")
        if (self.force is None) != (self.at is None):
            raise shape_error("a force needs 'at', a torque has no point")
        return self


class JointForce(ForcePart):
    """A force on one of a joint's coordinates, on its only one if none is named."""

    kind: Literal["joint_force"]
    joint: StrictStr
    coordinate: StrictStr | None = None
    law: Law


class Calspan(Part):
    """Constants of the Calspan tyre."""

    A0: Number
    A1: Number
    A2: Number
    A3: Number
    A4: Number
    B1: Number
    B3: Number
    B4: Number
    SN: Number
    AF1: Number
    AF2: Number


class Tyre(ForcePart):
    """A wheel on the road."""

    kind: Literal["tyre"]
    body: StrictStr
    centre: Point
    axis: Direction
    radius: Number
    stiffness: Number
    spin_inertia: Number = 0
    calspan: Calspan


Force: TypeAlias = Annotated[PointSpring | AxialForce | Bushing | Load | JointForce | Tyre, Field(discriminator="kind")]
