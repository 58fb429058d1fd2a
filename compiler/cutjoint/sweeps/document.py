"""The shape of a study file, as pydantic classes; names, numbers and units are resolved in `reading`."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import ConfigDict, Field, StrictInt, StrictStr, create_model, model_validator

from cutjoint.methods import DEFAULT_METHOD, INTEGRATORS, METHODS
from cutjoint.model.document.values import MAX_PIECES, NUMBERS, ByForm, Name, Number, OneOf, Part, Unit, shape_error

#: The largest number of runs of a study.
MOST_RUNS = 10**8

Count = Annotated[StrictInt, Field(ge=1, le=MOST_RUNS)]
Seed = Annotated[StrictInt, Field(ge=0, le=2**63 - 1)]


class Between(Part):
    """A range of numbers; ``count`` of them in a grid, spaced evenly or by equal ratios."""

    from_: Number = Field(alias="from")
    to: Number
    count: Annotated[StrictInt, Field(ge=2, le=MOST_RUNS)] | None = None
    scale: Literal["linear", "log"] = "linear"


#: The distributions of variables.
DISTRIBUTIONS = ("normal", "uniform", "triangular")


class Spread(Part):
    """A distribution about a mean, by default the model's value.
    A standard deviation of a normal one, which ``from`` and ``to`` may cut off, or half the width of a uniform or triangular one."""

    model_config = ConfigDict(json_schema_extra={"oneOf": [{"required": [name]} for name in DISTRIBUTIONS]})

    normal: Number | None = None
    uniform: Number | None = None
    triangular: Number | None = None
    mean: Number | None = None
    from_: Number | None = Field(default=None, alias="from")
    to: Number | None = None

    @property
    def kind(self) -> str:
        """The kind of distribution."""
        return next(name for name in DISTRIBUTIONS if getattr(self, name) is not None)

    @model_validator(mode="after")
    def _one_kind(self) -> "Spread":
        if len(self.model_fields_set & {*DISTRIBUTIONS}) != 1:
            raise shape_error(f"needs one of {', '.join(DISTRIBUTIONS)}", "write for example {normal: 0.1 mm}")
        if self.normal is None and not (self.from_ is None and self.to is None):
            raise shape_error("'from' and 'to' cut off a normal distribution alone", "remove them")
        return self


_Numbers = Annotated[tuple[Number, ...], Field(min_length=1)]
Values: TypeAlias = Annotated[
    Number | _Numbers | Between | Spread,
    ByForm(
        {**NUMBERS, tuple: _Numbers, **dict.fromkeys(DISTRIBUTIONS, Spread), **dict.fromkeys(("from", "to"), Between)},
        "needs a number, a list of numbers, {from: ..., to: ...} or {normal: ...}",
    ),
]


class LatinHypercube(Part):
    """Points of which each variable has one in each of equal parts of its range."""

    latin_hypercube: Count
    seed: Seed = 0


class Sobol(Part):
    """Points of a scrambled Sobol sequence."""

    sobol: Count
    seed: Seed = 0


class SobolIndices(Part):
    """Points from which the share of each variable in an objective's variance follows: twice so many, and as many for each variable."""

    sobol_indices: Count
    seed: Seed = 0

    @model_validator(mode="after")
    def _power_of_two(self) -> "SobolIndices":
        if (n := self.sobol_indices) & (n - 1):
            raise shape_error(f"{n} points are no power of two", f"write {1 << n.bit_length() - 1} or {1 << n.bit_length()}")
        return self


class Tolerances(Part):
    """Random points of distributions; in addition the means and a step to either side of each, for first-order derivatives."""

    tolerances: Annotated[StrictInt, Field(ge=2, le=MOST_RUNS)]
    seed: Seed = 0
    correlations: tuple[tuple[StrictStr, StrictStr, float], ...] = ()


class Csv(Part):
    """Rows of a table: names of variables above columns of numbers (SI units)."""

    csv: StrictStr


class Listed(Part):
    """Values of all variables, one row for each run."""

    list: Annotated[tuple[dict[StrictStr, Number], ...], Field(min_length=1)]


Design: TypeAlias = Annotated[
    Literal["grid"] | LatinHypercube | Sobol | SobolIndices | Tolerances | Csv | Listed,
    ByForm(
        {str: Literal["grid"], "latin_hypercube": LatinHypercube, "sobol": Sobol, "sobol_indices": SobolIndices, "tolerances": Tolerances,
         "csv": Csv, "list": Listed},
        "needs the word grid (with a list or a count for each parameter), {latin_hypercube: runs}, {sobol: runs}, {sobol_indices: points}, "
        "{tolerances: runs}, {csv: file} or {list: [...]}",
    ),
]

#: The reductions of an expression over time; each is a key of the file.
REDUCTIONS = (
    "end", "minimum", "maximum", "range", "mean", "rms", "deviation", "integral", "percentile", "crossing", "frequency", "amplitude",
)  # fmt: skip


def _optional(name: str, about: str, of: Mapping[str, Any]) -> Any:
    """A class of keys that may be missing, by their names and types; that of ``from_`` is from."""
    fields: dict[str, Any] = {key: (kind | None, Field(default=None, alias=key.removesuffix("_"))) for key, kind in of.items()}
    return create_model(name, __base__=Part, __doc__=about, **fields)


_MEASURES = dict.fromkeys(("travel", "steer_travel"), Number)
Kinematics = _optional("Kinematics", "Options of the kinematics of an axle, as of the command.", {
    "axle": StrictStr, "over": Literal["travel", "roll", "steer"], **_MEASURES, "points": Annotated[StrictInt, Field(ge=3)],
    "steer": StrictStr, "radius": Number, "share": Number,
})  # fmt: skip
Modes = _optional("Modes", "Options of modes, as of the command.", {"at": Number})
Response = _optional("Response", "Options of a frequency response, as of the command.", {
    "input": StrictStr, "output": StrictStr, "at": Number, "from_": Number, "to": Number,
})  # fmt: skip
Inverse = _optional("Inverse", "Options of inverse dynamics, as of the command.", {
    "drives": Annotated[tuple[StrictStr, ...], Field(min_length=1)],
})  # fmt: skip
Equilibrium = _optional("Equilibrium", "Options of the static equilibrium or trimmed start: none.", {})
TaskOptions = _optional("TaskOptions", "A task and its options; each is a key of the file.", {
    "kinematics": Kinematics, "modes": Modes, "response": Response, "inverse": Inverse, "equilibrium": Equilibrium,
})  # fmt: skip

#: The tasks besides runs whose results can be objectives.
TASKS = tuple(TaskOptions.model_fields)

_Task = Annotated[str, OneOf(TASKS)]
TaskForm: TypeAlias = Annotated[
    _Task | TaskOptions,  # type: ignore[valid-type]
    ByForm({str: _Task, dict: TaskOptions}, f"needs one of {', '.join(TASKS)}, or {{kinematics: {{axle: front}}}}"),
]

#: Additional reductions for results of tasks.
OF_TASKS = ("value", "slope")


class Objective(_optional("Reduced", "", {**dict.fromkeys(REDUCTIONS, Number), **dict.fromkeys(OF_TASKS, StrictStr)})):  # type: ignore[misc]
    """A number of each run: one reduction of an expression over outputs in a window of time, or of a result of another task."""

    of: TaskForm | None = None
    at: Number | None = None
    direction: Literal["up", "down", "any"] | None = None
    from_: Number | None = Field(default=None, alias="from")
    to: Number | None = None
    goal: Literal["smaller", "larger"] | None = None
    limits: tuple[Number, Number] | None = None
    unit: Unit | None = None

    @model_validator(mode="after")
    def _one_reduction(self) -> "Objective":
        reductions = [name for name in (*REDUCTIONS, *OF_TASKS) if getattr(self, name) is not None]
        if len(reductions) != 1:
            raise shape_error(f"has {' and '.join(reductions) or 'no reduction'}", f"write one of {', '.join(REDUCTIONS)}")
        if reductions[0] in OF_TASKS and self.of is None:
            raise shape_error(f"'{reductions[0]}' belongs to the result of a task", f"name it: of: {' or '.join(TASKS)}")
        if isinstance(self.of, TaskOptions) and len(self.of.model_fields_set) != 1:
            raise shape_error("'of' needs one task", "write for example of: {kinematics: {axle: front}}")
        if (self.at is not None) != (reductions[0] in ("percentile", "crossing")):
            words = "percentile and crossing need 'at'" if self.at is None else "'at' belongs to percentile and crossing"
            raise shape_error(words, "write for example {percentile: x, at: 95}")
        if self.direction is not None and self.crossing is None:
            raise shape_error("'direction' belongs to crossing", "leave it out")
        return self

    @property
    def reduction(self) -> str:
        """The name of the reduction."""
        return next(name for name in (*REDUCTIONS, *OF_TASKS) if getattr(self, name) is not None)

    @property
    def task(self) -> tuple[str, Part] | None:
        """The task whose result it takes, with the options."""
        if not isinstance(self.of, TaskOptions):
            return None if self.of is None else (self.of, Part())
        name = next(iter(self.of.model_fields_set))
        return name, getattr(self.of, name) or Part()


class Trajectories(Part):
    """Expressions whose values over time stand in the table, each ``every`` rows and the last."""

    outputs: Annotated[tuple[StrictStr, ...], Field(min_length=1, max_length=MAX_PIECES)]
    every: Annotated[StrictInt, Field(ge=1)] = 1


class Document(Part, title="cutjoint study"):
    """A study."""

    cutjoint_study: Literal[1]
    model: StrictStr
    scenes: Annotated[tuple[StrictStr, ...], Field(min_length=1)] | None = None
    tunable: tuple[StrictStr, ...] = ()
    method: Annotated[str, OneOf(METHODS)] = DEFAULT_METHOD
    integrator: Annotated[str, OneOf(tuple(INTEGRATORS))] | None = None
    dt: Number | None = None
    end: Number | None = None
    output_step: Number | None = None
    solver_tolerance: Number | None = None
    flags: StrictStr | None = None
    parameters: dict[StrictStr, Values] = Field(default={})
    positions: dict[StrictStr, Values] = Field(default={})
    rates: dict[StrictStr, Values] = Field(default={})
    design: Design = "grid"
    objectives: Annotated[dict[Name, Objective], Field(max_length=MAX_PIECES)] = Field(default={})
    trajectories: Trajectories | None = None

    @model_validator(mode="after")
    def _has_results(self) -> "Document":
        if not self.objectives and self.trajectories is None:
            raise shape_error("there are no objectives and no trajectories", "write for example objectives: {peak: {maximum: body.z}}")
        return self
