"""A study once its file is read: plain records, numbers in SI units."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from math import inf
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from cutjoint.model.expressions.units import Dimension
from cutjoint.model.records import Model, Output, Scalar, Scene, Span

Array: TypeAlias = NDArray[np.float64]
Counts: TypeAlias = NDArray[np.int64]


class Kind(StrEnum):
    """The kind of quantity that a variable of a study changes."""

    SCENE = "scene"
    PARAMETER = "parameter"
    INPUT = "input"
    POSITION = "position"
    RATE = "rate"


@dataclass(frozen=True, kw_only=True)
class Variable:
    """A column of a study's design; values of scenes are their indices."""

    name: str
    kind: Kind
    unit: str
    span: Span


@dataclass(frozen=True, kw_only=True)
class TaskRequest:
    """A task other than a run with options by name, numbers in SI units."""

    task: str
    options: tuple[tuple[str, object], ...] = ()


@dataclass(frozen=True, kw_only=True)
class Objective:
    """A number of each run: a reduction of a series in a window of time (s); ``at`` is what percentile and crossing have besides.

    In its ``unit`` it is ``factor`` times its number in SI units; ``limits`` are those of the yield.  Where a task is ``asked``, it is one
    of the result named ``of``.
    """

    name: str
    reduction: str
    series: int
    at: float = 0.0
    direction: str = "any"
    begin: float = -inf
    end: float = inf
    goal: str = "smaller"
    limits: tuple[float, float] | None = None
    unit: str = ""
    factor: float = 1.0
    asked: TaskRequest | None = None
    of: str = ""


@dataclass(frozen=True, kw_only=True)
class Series:
    """An expression of time, tunable parameters and outputs, with symbols named as `expressions` has it; ``text`` as it was written."""

    text: str
    value: Scalar
    unit: str
    dimension: Dimension | None = None


@dataclass(frozen=True, kw_only=True)
class Study:
    """A study: a model, its scenes, ``values`` (runs, variables) of the variables, and what becomes of each run.

    ``outputs`` are those that the series take.  ``trajectories`` are series that are kept over time, each ``every`` rows.  ``digest``
    is that of all that the file asks for, without the model.
    """

    file: str
    model: Model
    scenes: tuple[Scene, ...] = ()
    method: str = ""
    integrator: str | None = None
    tunable: tuple[str, ...] = ()
    flags: tuple[str, ...] = ()
    variables: tuple[Variable, ...]
    values: Array
    outputs: tuple[Output, ...] = ()
    series: tuple[Series, ...] = ()
    objectives: tuple[Objective, ...]
    trajectories: tuple[int, ...] = ()
    every: int = 1
    design: Mapping[str, object] = field(default_factory=dict)
    span: Span
    digest: str = ""

    @property
    def runs(self) -> int:
        """The number of runs."""
        return len(self.values)

    def settings_of(self, run: int) -> dict[str, float]:
        """The values of a run's variables by name."""
        return dict(zip((v.name for v in self.variables), map(float, self.values[run]), strict=True))

    def scene_of(self, run: int) -> Scene:
        """The scene of a run."""
        first = self.variables[:1]
        return self.scenes[int(self.values[run, 0]) if first and first[0].kind is Kind.SCENE else 0]
