"""The shape of a model file, as pydantic classes: the single source of its checks and of its JSON Schema.

Field names are the file's keys.  Only shapes are checked here; names, numbers and units are resolved later.
"""

from __future__ import annotations

import json
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import AfterValidator, BeforeValidator, Field, StrictBool, StrictInt, StrictStr, WithJsonSchema, model_validator

from cutjoint.methods import AUTO, CLOSURES, DEFAULT_INTEGRATOR, INTEGRATORS, METHODS, Events, Loops, join_or
from cutjoint.model import records
from cutjoint.model.document.body_parts import Body
from cutjoint.model.document.element_parts import Force, Joint
from cutjoint.model.document.values import (
    MAX_FIELD,
    NUMBERS,
    ByForm,
    Direction,
    Ends,
    FieldEntries,
    Law,
    Name,
    Number,
    OneOf,
    ParameterName,
    Part,
    Point,
    State,
    Table,
    TermName,
    Triple,
    Unit,
    checked,
    shape_error,
    table_schema,
)
from cutjoint.package.errors import plural

MAX_GEARED = 12  #: the most joints of a gear
_Ratio: TypeAlias = Annotated[
    Number | tuple[Number, ...], ByForm({**NUMBERS, tuple: tuple[Number, ...]}, "needs a number, or one for each joint but the first")
]
#: An expression, or a table over quantities.
Lookup: TypeAlias = Annotated[
    Number | Table, ByForm({**NUMBERS, **dict.fromkeys(("table", "interpolation"), Table)}, "needs an expression, or {table: {...}}")
]
#: Values by name, or a file that has them.
_PROPERTIES_SCHEMA = {"anyOf": [{"type": "string"}, {"type": "object", "additionalProperties": {"type": ["number", "string"]}}]}
_NUMERICS = records.Numerics()
_List = Annotated[tuple[Name, ...], Field(min_length=1)]
_Units = Annotated[dict[Name, Unit], Field(min_length=1)]
_Names: TypeAlias = Annotated[
    _List | _Units, ByForm({tuple: _List, list: _List, dict: _Units}, "needs a list of names, or names with their units")
]
_joints = checked(lambda value: isinstance(value, tuple) and len(value) > 1, "needs two names", "write [one, other]")


class Gear(Part):
    """The first joint's coordinate is the ratio times the second one's, or a law of it; joint.coordinate where a joint has several.

    For more joints ``ratio`` has a number for each but the first, and the products are added.
    """

    joints: Annotated[tuple[StrictStr, ...], Field(min_length=2, max_length=MAX_GEARED), BeforeValidator(_joints)]
    ratio: _Ratio | None = None
    law: Law | None = None

    @model_validator(mode="after")
    def _has_one_relation(self) -> Gear:
        if (self.ratio is None) == (self.law is None):
            raise shape_error("needs 'ratio' or 'law', one of them", "write ratio: 2, or law: a function of position")
        ratios = self.ratio if isinstance(self.ratio, tuple) else (self.ratio,)
        if len(ratios) != len(self.joints) - 1:
            raise shape_error(f"has {plural(len(ratios), 'ratio')} of {len(self.joints)} joints", "write one for each joint but the first")
        return self


class Reaction(Part):
    """The force and moment of a joint on its follower: along a direction of a body, or along all axes of the body."""

    joint: StrictStr
    axes_of: StrictStr
    direction: Direction | None = None


class Marker(Part):
    """A point of a body to watch."""

    body: StrictStr
    at: Point


class FirstOrderState(Part):
    """A first-order state: its value at the start of a run, its rate of change, its nominal size, and the bounds that it stays in."""

    start: Number
    rate: Lookup
    nominal: Number | None = None
    bounds: Ends | None = None


class SampledSignal(Part):
    """A value that a controller computes at its samples, and its value before the first sample."""

    value: Number
    start: Number = 0


class Memory(Part):
    """A memory of a controller: its value before the first sample, and its next value at each sample."""

    start: Number
    next: Number


class FunctionMemory(Part):
    """The memory of a function, which its update writes at each sample from these arguments."""

    function: StrictStr
    arguments: tuple[Number, ...]


MemoryEntry: TypeAlias = Annotated[
    Memory | FunctionMemory,
    ByForm(
        {**dict.fromkeys(("function", "arguments"), FunctionMemory), dict: Memory},
        "needs {start: ..., next: ...}, or {function: ..., arguments: [...]}",
    ),
]


SampledSignalEntry: TypeAlias = Annotated[
    Number | SampledSignal,
    ByForm({**NUMBERS, **dict.fromkeys(("value", "start"), SampledSignal)}, "needs an expression or {value: ..., start: ...}"),
]


class Controller(Part):
    """Values that are computed at equal intervals and constant in between; ``delay`` is the delay of its signals for others."""

    every: Number
    offset: Number = 0
    delay: Number = 0
    signals: dict[TermName, SampledSignalEntry] = Field(default={})
    memory: dict[TermName, MemoryEntry] = Field(default={})


class OutputExpression(Part):
    """A column of the results by an expression, in a unit."""

    value: Number
    unit: Unit | None = None


def _with_value(value: Any) -> Any:
    return {"value": value} if isinstance(value, int | float | str) and not isinstance(value, bool) else value


#: The expression alone, or with a unit.
Expressed = Annotated[OutputExpression, BeforeValidator(_with_value, json_schema_input_type=Number | OutputExpression)]


def _one_name(output: dict[str, OutputExpression]) -> dict[str, OutputExpression]:
    if len(output) != 1:
        raise shape_error(f"an output has one name, not {len(output)}", "write an item for each: - name: {value: ..., unit: ...}")
    return output


_NamedOutput = Annotated[dict[Name, Expressed], AfterValidator(_one_name)]
OutputEntry: TypeAlias = Annotated[
    StrictStr | _NamedOutput,
    ByForm({str: StrictStr, dict: _NamedOutput}, "needs element.quantity, or name: {value: expression, unit: ...}"),
]


class Elements(Part):
    """The sections that a model and a submodel share."""

    points: dict[Name, Point] = Field(default={})
    bodies: dict[Name, Body] = Field(default={})
    joints: dict[Name, Joint] = Field(default={})
    gears: dict[Name, Gear] = Field(default={})
    forces: dict[Name, Force] = Field(default={})
    reactions: dict[Name, Reaction] = Field(default={})
    markers: dict[Name, Marker] = Field(default={})
    states: dict[TermName, FirstOrderState] = Field(default={})
    signals: dict[TermName, Lookup] = Field(default={})
    controllers: dict[TermName, Controller] = Field(default={})
    outputs: tuple[OutputEntry, ...] = ()


class Instance(Part):
    """One use of a submodel; ``points`` are where points of the submodel are in this one."""

    use: StrictStr
    connect: dict[StrictStr, StrictStr] = Field(default={})
    with_: dict[StrictStr, Number] = Field(default={}, alias="with")
    points: dict[StrictStr, Point] = Field(default={})
    properties: Annotated[dict[StrictStr, Number], WithJsonSchema(_PROPERTIES_SCHEMA)] = Field(default={})
    mirror: Literal["x", "y", "z"] | None = None
    binding: Literal["param"] | None = None


class Submodel(Elements):
    """Elements to be used several times, or ``include``, the file that has them instead.

    ``defaults`` are parameters that instances may leave out, ``accepts`` has keys of their properties with the values that it is made for.
    ``choices`` are parameters whose values `cutjoint check` reports, ``warns`` has sentences about parameters that are not zero.
    """

    include: StrictStr | None = None
    connectors: tuple[Name, ...] = ()
    parameters: tuple[ParameterName, ...] = ()
    defaults: dict[ParameterName, Number] = Field(default={})
    accepts: dict[StrictStr, tuple[StrictInt, ...]] = Field(default={})
    choices: tuple[ParameterName, ...] = ()
    warns: dict[ParameterName, StrictStr] = Field(default={})
    submodels: dict[Name, Submodel] = Field(default={})
    instances: dict[Name, Instance] = Field(default={})


class Parameter(Part):
    """A named number."""

    value: Number
    unit: Unit | None = None
    binding: Literal["const", "param", "input"] = "const"


ParameterEntry: TypeAlias = Annotated[
    Number | Parameter,
    ByForm(
        {**NUMBERS, **dict.fromkeys(("value", "unit", "binding"), Parameter)}, "needs a number or {value: ..., unit: ..., binding: ...}"
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
    Flat | Ramp | Step | Cosine,
    ByForm(
        {"flat": Flat, "ramp": Ramp, "step": Step, "cosine": Cosine},
        "needs {flat: length}, {ramp: length, rise: height}, {step: height} or {cosine: length, amplitude: height}",
    ),
]


class Heights(Part):
    """Heights on an even grid: lists of ``x`` and ``y``, and as ``value`` one of heights over y for each x.

    With the name of a ``file`` these may have names of its columns.
    """

    table: Annotated[dict[Literal["x", "y", "value"], FieldEntries], WithJsonSchema(table_schema(MAX_FIELD))]
    interpolation: Literal["cubic", "linear"] = "cubic"


class Rough(Part):
    """A rough road of a class of ISO 8608."""

    iso8608: Literal["A", "B", "C", "D", "E"]
    seed: Annotated[StrictInt, Field(ge=0, lt=2**63)] = 1
    width: Number = 4


class Sections(Part):
    """Heights along a line, linear between their places.  A file in OpenCRG becomes one where its line is not that of x, or with options.

    ``sections`` have for each cross section its place ``x``, ``y``, the line's height ``z`` and ``banking``, and as ``value`` heights
    at places ``across``.  Cross sections are a ``step`` apart.  ``border``, ``offset`` and ``smooth`` are OpenCRG's modes, heights
    beyond the edges and smoothing zones; a line that is ``closed`` begins at the first number and has the second as its length, in steps.
    """

    sections: Annotated[dict[Literal["x", "y", "z", "banking", "across", "value"], FieldEntries], WithJsonSchema(table_schema(MAX_FIELD))]
    step: Number
    border: Ends = (2, 2)
    offset: Ends = (0, 0)
    smooth: Ends = (0, 0)
    closed: Ends = (0, 0)
    interpolation: Literal["linear"] = "linear"


RoadSurface: TypeAlias = Annotated[
    Heights | Rough | Sections,
    ByForm(
        {"table": Heights, "iso8608": Rough, "sections": Sections},
        "needs {table: {file: road.csv}} or {iso8608: class, seed: number}",
    ),
]


class Patch(Part):
    """A rectangle with another friction, over whose ``edge`` it changes."""

    x: Ends
    y: Ends
    value: Number
    edge: Number = 0.1


class Road(Part):
    """Height of the road over x, of its surface over x and y, and its friction."""

    contact: Literal["point", "disc"] = "point"
    start: Number = 0
    profile: tuple[Segment, ...] | None = None
    left: tuple[Segment, ...] | None = None
    right: tuple[Segment, ...] | None = None
    surface: RoadSurface | None = None
    friction: tuple[Patch, ...] = ()

    @model_validator(mode="after")
    def _one_form(self) -> Road:
        if self.profile is not None and (self.left is not None or self.right is not None):
            raise shape_error("'profile' stands for both tracks", "write either profile, or left and right")
        if self.surface is not None and self.contact == "disc":
            raise shape_error("a disc rolls over profiles alone, not over a surface", "write contact: point, or remove the surface")
        return self


class MethodNumerics(Part):
    """Settings that one method has instead of the scene's."""

    dt: Number | None = None
    penalty: Number | None = None
    solver_tolerance: Number | None = None
    iterations: StrictInt | None = None
    multiplier_updates: StrictInt | None = None


class Numerics(Part):
    """Settings of the numerical method; ``methods`` changes some of them for one method."""

    closure: Annotated[str, OneOf(tuple(CLOSURES))] | None = None
    dt: Number | None = None
    penalty: Number | None = None
    damping_ratio: Number = _NUMERICS.damping_ratio
    frequency: Number = _NUMERICS.frequency
    solver_tolerance: Number = _NUMERICS.tolerance
    iterations: StrictInt = _NUMERICS.iterations
    multiplier_updates: StrictInt = _NUMERICS.multiplier_updates
    integrator: Annotated[str, OneOf(tuple(INTEGRATORS))] | None = None
    events: Annotated[str, OneOf(Events)] | None = None
    absolute_tolerance: Number | None = None
    spectral_radius: Number = _NUMERICS.spectral_radius
    loops: Annotated[str, OneOf(Loops)] = _NUMERICS.loops
    loop_tolerance: Number = _NUMERICS.loop_tolerance
    loop_terms: StrictInt = _NUMERICS.loop_terms
    methods: dict[Annotated[str, OneOf(METHODS)], MethodNumerics] = Field(default={})


class Plot(Part):
    """A picture: columns ``y`` of the table over the column ``x``."""

    y: Annotated[tuple[StrictStr, ...], Field(min_length=1)]
    x: StrictStr = "t"


class Trim(Part):
    """A steady start: ``find`` are unknowns in addition to the free coordinates and states.
    ``hold``: values of expressions; ``unsteady``: speeds and states that may change; ``bounds``: those of unknowns."""

    find: tuple[StrictStr, ...] = ()
    hold: dict[StrictStr, Number] = Field(default={})
    unsteady: tuple[StrictStr, ...] = ()
    bounds: dict[StrictStr, Ends] = Field(default={})


#: The target error of positions and angles, or those of outputs by their names.
_ByOutput = Annotated[dict[StrictStr, Number], Field(min_length=1)]
Accuracy: TypeAlias = Annotated[Number | _ByOutput, ByForm({**NUMBERS, dict: _ByOutput}, "needs a number, or output: number")]


class Scene(Part):
    """One run of the model: its end, start, inputs, switches, driven joints, road and numerics."""

    end: Number
    output_step: Number | None = None
    pose: Literal["design", "equilibrium"] = "design"
    positions: dict[StrictStr, State] = Field(default={})
    near: tuple[StrictStr, ...] = ()
    assemble: dict[StrictStr, Number] = Field(default={})
    trim: Trim | None = None
    rates: dict[StrictStr, Number] = Field(default={})
    states: dict[StrictStr, Number] = Field(default={})
    inputs: dict[StrictStr, Law] = Field(default={})
    switches: dict[StrictStr, StrictBool] = Field(default={})
    lock: tuple[StrictStr, ...] = ()
    drive: dict[StrictStr, Law] = Field(default={})
    release: tuple[StrictStr, ...] = ()
    road: Road = Road()
    numerics: Numerics = Numerics()
    method: Annotated[str, OneOf((AUTO, *METHODS))] | None = None
    accuracy: Accuracy | None = None
    budget: Number | None = None
    on_violation: Literal["stop", "restart"] | None = None
    outputs: tuple[OutputEntry, ...] | None = None
    plots: dict[Name, Plot] = Field(default={})

    @model_validator(mode="after")
    def _goes_with_its_method(self) -> Scene:
        if self.budget is not None and self.method != AUTO:
            raise shape_error("'budget' belongs to 'method: auto'", "write method: auto too")
        integrator = INTEGRATORS[self.numerics.integrator or DEFAULT_INTEGRATOR]
        if self.method not in (None, *integrator.methods, *((AUTO,) if integrator.name == DEFAULT_INTEGRATOR else ())):
            message = f"the integrator {integrator.name} belongs to the method {join_or(integrator.methods)}"
            raise shape_error(message, "leave 'method' or 'integrator' away")
        return self


class SuppliedFunction(Part):
    """A function whose code is not in the model: the user supplies it as C++.

    ``unit`` is that of its value, ``results`` are names where it has several, ``memory`` is the size of its memory, in bytes.
    """

    arguments: _Names
    results: _Names | None = None
    unit: Unit | None = None
    partials: StrictBool = False
    memory: StrictInt | None = None

    @model_validator(mode="after")
    def _has_one_or_several_results(self) -> SuppliedFunction:
        if self.results is not None and self.unit is not None:
            raise shape_error("'unit' is that of one result, and 'results' has several", "write their units there: results: {force: N}")
        return self


class Document(Elements, title="cutjoint model"):
    """A model file."""

    cutjoint: Literal[1]
    name: Name
    gravity: Triple
    display: tuple[Unit, ...] = ()
    parameters: dict[ParameterName, ParameterEntry] = Field(default={})
    functions: dict[TermName, SuppliedFunction] = Field(default={})
    submodels: dict[Name, Submodel] = Field(default={})
    instances: dict[Name, Instance] = Field(default={})
    scenes: dict[Name, Scene] = Field(default={})


def json_schema(part: type[Part] = Document) -> str:
    """The JSON Schema of model files, or of another document, as text."""
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", **part.model_json_schema()}
    return json.dumps(schema, indent=2) + "\n"
