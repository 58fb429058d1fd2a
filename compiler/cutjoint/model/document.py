"""The shape of a model file, as pydantic classes: the single source of its checks and of its JSON Schema.

Field names are the file's keys.  Only shapes are checked here; names, numbers and units are resolved later.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

from pydantic import Field, StrictBool, StrictInt, StrictStr, Tag, model_validator

from cutjoint.model import records
from cutjoint.model.values import (
    Direction,
    Inertia,
    Law,
    Name,
    Number,
    Pair,
    ParameterName,
    Part,
    Point,
    Triple,
    Unit,
    shape_error,
    told_by,
)


class Body(Part):
    """A rigid body."""

    mass: Number | None = None
    centre_of_mass: Point | None = None
    inertia: Inertia | None = None
    massless: StrictBool = False

    @model_validator(mode="after")
    def _mass_or_massless(self) -> Body:
        if self.massless and (self.mass is not None or self.inertia is not None):
            raise shape_error("a massless body has no mass and no inertia", "remove them, or 'massless'")
        if not self.massless and (self.mass is None or self.centre_of_mass is None):
            raise shape_error("needs mass and centre_of_mass", "add them, or write massless: true")
        return self


class JointPart(Part):
    """What all joints have."""

    bodies: Pair
    at: Point
    cut: StrictBool | None = None


class PlainJoint(JointPart):
    """A joint without directions."""

    kind: Literal["fixed", "spherical", "free"]


class AxisJoint(JointPart):
    """A joint with one axis (of a planar joint: the normal)."""

    kind: Literal["cylindrical", "planar", "point_on_line"]
    axis: Direction


class GuidableJoint(JointPart):
    """A joint with one coordinate, which may be prescribed."""

    kind: Literal["revolute", "prismatic"]
    axis: Direction
    guide: Law | None = None


class ScrewJoint(JointPart):
    """A screw; ``pitch`` in m a radian."""

    kind: Literal["screw"]
    axis: Direction
    pitch: Number
    guide: Law | None = None


class UniversalJoint(JointPart):
    """A Hooke joint; ``axis`` in the base, ``axis_2`` in the follower, perpendicular."""

    kind: Literal["universal"]
    axis: Direction
    axis_2: Direction


class DistanceJoint(JointPart):
    """A massless rod from ``at`` on the base to ``to`` on the follower."""

    kind: Literal["distance"]
    to: Point


Joint: TypeAlias = Annotated[
    PlainJoint | AxisJoint | GuidableJoint | ScrewJoint | UniversalJoint | DistanceJoint,
    Field(discriminator="kind"),
]


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


class Load(ForcePart):
    """A force or a torque on one body."""

    kind: Literal["load"]
    body: StrictStr
    at: Point | None = None
    force: Triple | None = None
    torque: Triple | None = None
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
    """A force on a joint's coordinate."""

    kind: Literal["joint_force"]
    joint: StrictStr
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
    calspan: Calspan


Force: TypeAlias = Annotated[PointSpring | AxialForce | Load | JointForce | Tyre, Field(discriminator="kind")]


class Reaction(Part):
    """A component of a cut joint's force."""

    joint: StrictStr
    body: StrictStr
    direction: Direction


class Marker(Part):
    """A point of a body to watch."""

    body: StrictStr
    at: Point


class Elements(Part):
    """What a model and a submodel both may hold."""

    points: dict[Name, Point] = Field(default={})
    bodies: dict[Name, Body] = Field(default={})
    joints: dict[Name, Joint] = Field(default={})
    forces: dict[Name, Force] = Field(default={})
    reactions: dict[Name, Reaction] = Field(default={})
    markers: dict[Name, Marker] = Field(default={})
    outputs: tuple[StrictStr, ...] = ()


class Submodel(Elements):
    """Elements to be used several times."""

    connectors: tuple[Name, ...] = ()
    parameters: tuple[ParameterName, ...] = ()


class Instance(Part):
    """One use of a submodel."""

    use: StrictStr
    connect: dict[StrictStr, StrictStr] = Field(default={})
    with_: dict[StrictStr, Number] = Field(default={}, alias="with")
    mirror: Literal["x", "y", "z"] | None = None


class Parameter(Part):
    """A named number."""

    value: Number
    unit: Unit | None = None
    binding: Literal["const", "param", "input"] = "const"


ParameterEntry: TypeAlias = Annotated[
    Annotated[Number, Tag("<number>")] | Annotated[Parameter, Tag("<mapping>")],
    told_by(
        {
            **dict.fromkeys((int, float, str), "<number>"),
            **dict.fromkeys(("value", "unit", "binding"), "<mapping>"),
        },
        "needs a number or {value: ..., unit: ..., binding: ...}",
    ),
]


# Scenes.


class Flat(Part):
    """Level road."""

    flat: Number


class Ramp(Part):
    """Straight slope."""

    ramp: Number
    rise: Number


class Step(Part):
    """A vertical step."""

    step: Number


class Cosine(Part):
    """One wave, amplitude*(1 - cos(2 pi x / length))."""

    cosine: Number
    amplitude: Number


Segment: TypeAlias = Annotated[
    Annotated[Flat, Tag("<flat>")]
    | Annotated[Ramp, Tag("<ramp>")]
    | Annotated[Step, Tag("<step>")]
    | Annotated[Cosine, Tag("<cosine>")],
    told_by(
        {key: f"<{key}>" for key in ("flat", "ramp", "step", "cosine")},
        "needs {flat: length}, {ramp: length, rise: height}, {step: height} or {cosine: length, amplitude: height}",
    ),
]


class Road(Part):
    """Height of the road over x."""

    contact: Literal["point", "disc"] = "point"
    start: Number = 0
    profile: tuple[Segment, ...] | None = None
    left: tuple[Segment, ...] | None = None
    right: tuple[Segment, ...] | None = None

    @model_validator(mode="after")
    def _one_form(self) -> Road:
        if self.profile is not None and (self.left is not None or self.right is not None):
            raise shape_error("'profile' stands for both tracks", "write either profile, or left and right")
        return self


_NUMERICS = records.Numerics()


class Numerics(Part):
    """Figures of the numerical method."""

    dt: Number = _NUMERICS.dt
    penalty: Number = _NUMERICS.penalty
    damping_ratio: Number = _NUMERICS.damping_ratio
    frequency: Number = _NUMERICS.frequency
    tolerance: Number = _NUMERICS.tolerance
    iterations: StrictInt = _NUMERICS.iterations
    multiplier_updates: StrictInt = _NUMERICS.multiplier_updates


class Scene(Part):
    """What is done with the model."""

    end: Number
    output_step: Number | None = None
    pose: Literal["design", "equilibrium"] = "design"
    positions: dict[StrictStr, Number] = Field(default={})
    rates: dict[StrictStr, Number] = Field(default={})
    inputs: dict[StrictStr, Law] = Field(default={})
    switches: dict[StrictStr, StrictBool] = Field(default={})
    road: Road = Road()
    numerics: Numerics = Numerics()
    outputs: tuple[StrictStr, ...] | None = None


class Document(Elements):
    """A model file."""

    cutjoint: Literal[1]
    name: Name
    gravity: Triple
    parameters: dict[ParameterName, ParameterEntry] = Field(default={})
    submodels: dict[Name, Submodel] = Field(default={})
    instances: dict[Name, Instance] = Field(default={})
    scenes: dict[Name, Scene] = Field(default={})


def write_json_schema(path: Path) -> None:
    """Write the JSON Schema of model files to ``path``, for editors."""
    path.write_text(json_schema(), encoding="utf-8")


def json_schema() -> str:
    """The JSON Schema of model files as text."""
    schema = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **Document.model_json_schema(),
        "title": "cutjoint model",
    }
    return json.dumps(schema, indent=2) + "\n"
