"""The run file that a simulator reads, as a record."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any


@dataclass(frozen=True, kw_only=True)
class Stabilisation:
    """The stabilisation of cut joints in the recursive equations, which start every run; ``penalty`` is None if it follows from masses."""

    closure: str
    penalty: float | None
    damping_ratio: float
    frequency: float


@dataclass(frozen=True, kw_only=True)
class Settings:
    """The settings of a run as its simulator reads them.

    The run computes a ``penalty`` of None; ``solver`` is None for a method or an integrator without a linear solver.  ``events`` is
    whether steps end at events, None where they cannot.  With ``fixed_cost`` each step has ``iterations`` iterations, else so many at
    most.  ``absolute_tolerance`` and ``spectral_radius`` are None of integrators that do not read them.
    """

    integrator: str
    solver: str | None
    dt: float
    penalty: float | None
    tolerance: float
    iterations: int
    multiplier_updates: int
    fixed_cost: bool
    events: bool | None
    absolute_tolerance: float | None
    spectral_radius: float | None
    stabilisation: Stabilisation

    def entries(self) -> dict[str, Any]:
        """The entries of a run file that are settings; None (null in the file) stands for computed or unused ones."""
        numerics = asdict(self)
        return {name: numerics.pop(name) for name in ("integrator", "solver", "stabilisation")} | {"numerics": numerics}

    @classmethod
    def of(cls, data: Mapping[str, Any]) -> "Settings":
        """The settings from the output of `asdict`."""
        return cls(**{**data, "stabilisation": Stabilisation(**data["stabilisation"])})


@dataclass(frozen=True, kw_only=True)
class RunFile:
    """The run file of a ``task``, in SI units.

    Attributes:
        parameters: the tunable ones.
        inputs: each input over time; None without inputs.
        positions, rates: initial values by "joint.component"; ``near`` names positions that are only preferred.
        roads: by tyres, the pieces of both tracks, and whether the contact is a disc; ``surface`` is common to all, or None.
        out: the table, "" for none.
        begin: time and state from which the run continues; None for a new start.
        energy: whether the run integrates work and energy.
        jumps_within: report jumps within this time (s) of a sample, or None.
        start: the start that an earlier run of the file with other steps has found, or None.

    `run_file.make_run_file` makes one.  Callers add entries of their tasks to `entries()`.
    """

    task: str
    parameters: Mapping[str, float]
    inputs: Mapping[str, Any] | None
    settings: Settings
    end: float
    output_step: float
    pose: str
    positions: Mapping[str, float]
    rates: Mapping[str, float]
    roads: Mapping[str, Mapping[str, Any]]
    out: str
    energy: bool = False
    jumps_within: float | None = None
    initial_state: Mapping[str, Any] | None = None
    surface: Mapping[str, Any] | None = None
    near: tuple[str, ...] = ()
    start: Mapping[str, Any] | None = None

    def entries(self) -> dict[str, Any]:
        """The file as plain data for JSON, without what it does not have."""
        found: dict[str, Any] = {}
        for name, x in vars(self).items():
            left_out = x is None or x is False or (isinstance(x, tuple) and not x)
            found |= x.entries() if name == "settings" else {} if left_out else {name: x}
        return found

    def with_settings(self, **changes: Any) -> "RunFile":
        """The file with other values of some of its settings."""
        return replace(self, settings=replace(self.settings, **changes))

    def with_tolerance(self, factor: float) -> "RunFile":
        """The file with its step tolerances multiplied by a factor."""
        absolute = self.settings.absolute_tolerance
        return self.with_settings(tolerance=factor * self.settings.tolerance, absolute_tolerance=absolute and factor * absolute)

    @classmethod
    def of(cls, data: Mapping[str, Any]) -> "RunFile":
        """The file from the output of `asdict`."""
        return cls(**{**data, "settings": Settings.of(data["settings"]), "near": tuple(data["near"])})
