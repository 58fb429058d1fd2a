"""A fit once its file is read: plain records, numbers in SI units."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from cutjoint.model.records import Model, Output, Scalar, Scene, Span

Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A parameter of the fit; ``size`` is the change of it that counts as large, ``deviation`` infinite without a prior."""

    name: str
    symbol: Scalar
    unit: str
    start: float
    low: float
    high: float
    mean: float
    deviation: float
    size: float
    span: Span


@dataclass(frozen=True, kw_only=True)
class Signal:
    """A measured output: an expression of the model, and ``values`` at ``times`` (s) from the start.
    A ``deviation`` of NaN is to be estimated."""

    text: str
    unit: str
    value: Scalar
    times: Array
    values: Array
    deviation: float
    gain: Scalar
    bias: Scalar
    delay: Scalar
    missing: int = 0


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """One run, or ``rows`` of poses, of a model in a scene.  ``starts`` are expressions of the parameters and of the ``columns``, the
    values (rows,) of each symbol; ``inputs`` are tables over time.  ``clock`` is how the file counts times: column, time of the start (s)
    and unit (s); ``notes`` say how data were treated."""

    name: str
    model: Model
    scene: Scene
    outputs: tuple[Output, ...]
    signals: tuple[Signal, ...]
    starts: Mapping[str, Scalar]
    columns: Mapping[Scalar, Array]
    inputs: Mapping[str, Mapping[str, object]]
    clock: tuple[str, float, float]
    is_pose: bool
    at_rest: bool
    validation: bool
    dt: float
    span: Span
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Design:
    """An experiment that gets other ``inputs``: names in the model, start, bounds and unit; ``limits`` are signals with bounds.
    ``frequency`` (Hz) is that of the first harmonic, 0: of one period in the run."""

    experiment: Experiment
    inputs: Mapping[str, tuple[str, float, float, float, float]]
    limits: Sequence[tuple[Signal, float, float]]
    frequency: float
    harmonics: int
    runs: int


@dataclass(frozen=True, kw_only=True)
class Study:
    """A fit: parameters, ``ties`` of numbers of models to them, experiments, and the number of ``windows``.
    ``digest`` is that of all that was read."""

    file: str
    digest: str
    method: str
    integrator: str | None
    parameters: tuple[Parameter, ...]
    ties: Mapping[str, Scalar]
    experiments: tuple[Experiment, ...]
    loss: str
    starts: int
    seed: int
    resamples: int
    profiles: bool
    windows: int
    design: Design | None = None

    @property
    def tries(self) -> tuple[str, ...]:
        """The kinds of fits that are many: they go into tables beside the result."""
        return ("starts",) * (self.starts > 1) + ("bootstrap",) * (self.resamples > 0) + ("profiles",) * self.profiles
