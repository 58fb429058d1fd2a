"""Cases and contenders of a comparison, and their results."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from hashlib import sha256
from math import inf, nan
from typing import Any, Protocol

from cutjoint.methods import DEFAULT_METHOD, METHODS
from cutjoint.model.records import Model, Output, Scene
from cutjoint.run.results import Array, Trajectory
from cutjoint.run.run_file import make_run_file
from cutjoint.run.settings import PLAIN_STEPS

#: Groups of contenders that are given an accuracy.
ASKED = ("accuracy", "auto")


@dataclass(frozen=True, kw_only=True)
class Case:
    """A scene of a model with what is looked at in it: the places and velocities of its heavy bodies.

    The scene's ``output_step`` is the distance in s of the times at which runs are compared; ``parameters`` are changed ones, SI units.
    ``motion`` gives the exact columns over times (s), where they are known; ``of_peers`` is the model with the cut joints that suit other
    simulators best, where these are others.  ``watched`` are the scene's own outputs that are places or angles, with the sizes of their
    units in SI, where their errors are asked for too; ``command`` begins a command line that simulates the case, "" if none does.
    """

    model: Model
    scene: Scene
    outputs: tuple[Output, ...]
    parameters: Mapping[str, float] = field(default_factory=dict)
    motion: Callable[[Array], Mapping[str, Array]] | None = None
    of_peers: Model | None = None
    watched: Mapping[str, float] = field(default_factory=dict)
    command: str = ""

    @property
    def name(self) -> str:
        """Model and scene."""
        return f"{self.model.name}/{self.scene.name}"

    def input_digest(self, simulator: str) -> str:
        """A digest of all that a simulator of this case, a method or a peer by its name, reads when it runs.
        Parameters, settings of the method (of the default one for a peer), start, roads."""
        method = simulator if simulator in METHODS else DEFAULT_METHOD
        run_file = make_run_file(self.model, self.scene, self.parameters, task="simulate", method=method, options=PLAIN_STEPS)
        return sha256(json.dumps(run_file.entries(), sort_keys=True).encode()).hexdigest()[:32]


@dataclass(frozen=True, kw_only=True)
class Errors:
    """The distance from a reference over all bodies and rows: the largest and the root mean square, in m and m/s; nan where unknown.

    ``residual`` is the largest of the constraint equations in m (or rad), ``energy`` the largest difference in kinetic energy of
    translation and in potential energy of weight, relative to the largest value that the kinetic energy has in the reference.
    ``outputs`` is the largest error of the case's watched columns, in m or rad.
    """

    position: float = nan
    velocity: float = nan
    mean_position: float = nan
    mean_velocity: float = nan
    energy: float = nan
    residual: float = nan
    outputs: float = nan


@dataclass(frozen=True, kw_only=True)
class Point:
    """A contender at one step: ``seconds`` of each repetition, its errors, or why it failed.

    ``reached`` is the time in s up to which it ran.  ``about`` has further facts of one to which an accuracy was given.
    """

    contender: str
    dt: float
    seconds: tuple[float, ...] = ()
    steps: int = 0
    iterations: int = 0
    errors: Errors = Errors()
    failure: str = ""
    reached: float = inf
    about: Mapping[str, Any] = field(default_factory=dict)


class Runner(Protocol):
    """A contender made ready for a case."""

    @property
    def configuration(self) -> Mapping[str, str]:
        """Facts to state of it: compiler, flags, digest of generated code, versions."""
        ...

    def __call__(self, dt: float, *, measured: bool = False) -> Trajectory:
        """A run whose rows are some of the case's; ``measured`` asks for the residuals of each step, which costs time."""
        ...


def _always() -> bool:
    return True


@dataclass(frozen=True, kw_only=True)
class Contender:
    """A way to run a case.  ``prepare`` compiles it and raises an error of the user's making where the case does not suit it.

    ``label`` is for legends, ``group`` what belongs together in them: "generated", "scalar", "reduced", "functions", "solvers", "generic",
    "precision", "peer", "accuracy", "auto".  ``identify`` finds, without compiling, the part of the configuration by which stored results
    are known to be of this version: digests of generated code and runtime, or a peer's version.  ``options`` are those of
    `cutjoint simulate` for a point, None or empty where it has none.  The points of one that is ``adaptive`` are tolerances, those of
    groups in ``ASKED`` accuracies.
    """

    name: str
    label: str
    group: str
    prepare: Callable[[Case], Runner]
    identify: Callable[[Case], Mapping[str, str]]
    available: Callable[[], bool] = _always
    options: Callable[[Case, float], Sequence[str]] | None = None
    adaptive: bool = False

    @property
    def is_asked(self) -> bool:
        """True if its points are accuracies (m, rad) that are asked for."""
        return self.group in ASKED
