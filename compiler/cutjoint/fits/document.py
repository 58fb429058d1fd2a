"""The shape of the study file of a fit, as pydantic classes; names, numbers and units are resolved in `reading`."""

from typing import Annotated, Literal, TypeAlias

from pydantic import Field, StrictBool, StrictInt, StrictStr, model_validator

from cutjoint.methods import DEFAULT_METHOD, INTEGRATORS, METHODS, Formulation
from cutjoint.model.document.values import MAX_PIECES, Number, OneOf, Part, Unit, shape_error
from cutjoint.sweeps.document import Seed


class Prior(Part):
    """What is known of a parameter before: a normal distribution."""

    mean: Number
    deviation: Number


class Fitted(Part):
    """A parameter of the fit: its start value, by default that of the model, bounds, prior and size."""

    start: Number | None = None
    from_: Number | None = Field(default=None, alias="from")
    to: Number | None = None
    prior: Prior | None = None
    size: Number | None = None


#: The name of a column, or its number in a file without names.
Column: TypeAlias = Annotated[StrictStr | StrictInt, Field(union_mode="left_to_right")]


class Measured(Part):
    """A measured column: ``gain`` times the output ``delay`` earlier, plus ``bias``, with noise of a standard ``deviation``."""

    column: Column | None = None
    unit: Unit | None = None
    deviation: Number | None = None
    gain: Number | None = None
    bias: Number | None = None
    delay: Number | None = None


class Moved(Part):
    """A joint whose coordinate follows a column, and a column of its ``rate`` in the unit per second."""

    column: Column | None = None
    rate: Column | None = None
    unit: Unit | None = None


class Driven(Part):
    """An input of the model that follows a column, of another file, with its own column of ``time``, if ``data`` names one."""

    column: Column | None = None
    unit: Unit | None = None
    data: StrictStr | None = None
    time: Column | None = None
    interpolation: Literal["linear", "cubic"] = "linear"


class Experiment(Part):
    """A file of measurements, and the run or the poses that it is of."""

    data: StrictStr
    model: StrictStr | None = None
    scene: StrictStr | None = None
    time: Column = "t"
    time_unit: Unit | None = None
    from_: Number | None = Field(default=None, alias="from")
    to: Number | None = None
    poses: StrictBool = False
    rest: StrictBool = False
    start: dict[StrictStr, Number] = Field(default={})
    motion: dict[StrictStr, Moved] = Field(default={})
    bandwidth: Number | None = None
    inputs: dict[StrictStr, Driven] = Field(default={})
    signals: Annotated[dict[StrictStr, Measured], Field(min_length=1, max_length=MAX_PIECES)]
    validation: StrictBool = False

    @model_validator(mode="after")
    def _of_one_kind(self) -> "Experiment":
        if self.poses and (self.rest or self.inputs or self.motion or not self.start):
            said = "poses have coordinates in 'start', no inputs, no 'motion' and no 'rest'"
            raise shape_error(said, "write for example start: {pin.angle: encoder}")
        return self


class Design(Part):
    """An experiment with other inputs, within limits, from which the parameters follow better."""

    experiment: StrictStr
    inputs: Annotated[dict[StrictStr, tuple[Number, Number]], Field(min_length=1, max_length=MAX_PIECES)]
    limits: dict[StrictStr, tuple[Number, Number]] = Field(default={})
    frequency: Number | None = None
    harmonics: Annotated[StrictInt, Field(ge=2, le=100)] = 5
    runs: Annotated[StrictInt, Field(ge=1, le=1_000_000)] = 300


class Starts(Part):
    """Further starts of the fit, spread over the bounds."""

    count: Annotated[StrictInt, Field(ge=1, le=10_000)]
    seed: Seed = 0


class Document(Part, title="cutjoint fit"):
    """A fit."""

    cutjoint_fit: Literal[1]
    model: StrictStr | None = None
    method: Annotated[str, OneOf(tuple(m for m, x in METHODS.items() if x.formulation is not Formulation.NATURAL))] = DEFAULT_METHOD
    integrator: Annotated[str, OneOf(tuple(INTEGRATORS))] | None = None
    dt: Number | None = None
    parameters: Annotated[dict[StrictStr, Fitted], Field(min_length=1, max_length=MAX_PIECES)]
    ties: dict[StrictStr, Number] = Field(default={})
    inertias: tuple[StrictStr, ...] = ()
    experiments: Annotated[dict[StrictStr, Experiment], Field(min_length=1, max_length=MAX_PIECES)]
    design: Design | None = None
    loss: Literal["linear", "soft_l1", "huber", "cauchy", "arctan"] = "linear"
    starts: Starts | None = None
    bootstrap: Starts | None = None
    profiles: StrictBool = False
    windows: Annotated[StrictInt, Field(ge=1, le=20)] = 5
