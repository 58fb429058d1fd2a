"""The results of a simulator."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from math import nan, pi
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from cutjoint.model.errors import nearest
from cutjoint.package.extensions import MissingPackageError, find_package
from cutjoint.package.renamed import accept_old_names, with_old_members
from cutjoint.run.binary_tables import BINARY, read_columns
from cutjoint.run.outputs import OutputError
from cutjoint.run.settings import StepSettings

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from xarray import Dataset

    from cutjoint.analysis.trims import Trimmed

T = TypeVar("T")

Array: TypeAlias = NDArray[np.float64]


#: The name of the time column of a table.
TIME = "t"
#: Euler angles of bodies, which jump by a turn.
WRAPPED = (".yaw", ".roll")
#: The beginning of untried advice.
UNTRIED = "try: "
#: The number of columns that a `repr` names.
_NAMED = 6


class Columns(dict[str, T]):
    """Values by the names of columns.

    Raises:
        KeyError: there is no such column; the message suggests the closest name, or lists some.
    """

    def __missing__(self, column: str) -> T:
        raise KeyError(f"no column '{column}'; {nearest(str(column), self, 'there is')}")


def _listed(columns: Iterable[str]) -> str:
    """The first of the columns, and how many more there are."""
    names = list(columns)
    more = [f"{len(names) - _NAMED} more"] if len(names) > _NAMED else []
    return ", ".join([*names[:_NAMED], *more]) or "none"


def distance_of(column: str, one: Array, other: Array) -> Array:
    """How far two series of a column are apart, each sample; roll and yaw of a body at most half a turn."""
    apart = np.abs(one - other)
    return np.abs(apart - 2 * pi * np.rint(apart / (2 * pi))) if column.endswith(WRAPPED) else apart


@with_old_members
@dataclass(frozen=True, kw_only=True)
class FailureReport:
    """Why a run stopped: ``time`` (s), the ``element`` with the worst residual, and an ``advice`` or "".

    ``guards`` names omitted forces that would act there, if that is the reason; the residual is then the violation of their margin.
    """

    message: str
    time: float
    step: int
    element: str
    residual: float
    advice: str
    guards: tuple[str, ...] = ()

    @property
    def summary(self) -> str:
        """The message with its time and the element with the worst residual."""
        is_state = self.advice.startswith("the rate of this state")
        unit = " m/s^2 or rad/s^2" if self.message.startswith("no static equilibrium") and not is_state else ""
        return f"{self.message} at t = {self.time:.6g} s (step {self.step}); worst at '{self.element}' with {self.residual:.3g}{unit}"

    def __str__(self) -> str:
        return f"{self.summary}; {self.advice}" if self.advice else self.summary


@dataclass(frozen=True, kw_only=True)
class Residuals:
    """The largest residuals of the equations and of their first and second derivatives over a run; NaN if not evaluated."""

    position: float = nan
    velocity: float = nan
    acceleration: float = nan


@dataclass(frozen=True, kw_only=True)
class EnergyBalance:
    """Energy balance of a run, J; NaN where a number is not finite.

    Attributes:
        kinetic: largest kinetic energy T.
        exchanged: integral of the absolute power of forces, guides and drives.
        defect: largest difference between the change of T and the work done.
        of_unit_speed: largest T, scaled to a largest speed of 1 m/s or rad/s.
    """

    kinetic: float
    exchanged: float
    defect: float
    of_unit_speed: float

    @property
    def share(self) -> float:
        """The defect relative to the largest energy."""
        size = self.kinetic + self.exchanged
        return self.defect / size if size > 0 else 0.0


@dataclass(frozen=True, kw_only=True)
class Impact:
    """A jump of guides' rates at a time (s): the ``element`` whose law jumps, and the ``work`` (J) of the guides' impulses."""

    time: float
    element: str
    work: float


@dataclass(frozen=True, kw_only=True)
class NearJump:
    """A ``column`` that jumps by ``size`` near the sample at a ``time`` (s), ``after`` seconds later, negative if earlier."""

    time: float
    column: str
    after: float
    size: float


@dataclass(frozen=True, kw_only=True)
class RunStatistics:
    """Statistics of a run's steps.

    The recursive method has no linear ``solver`` (""), and ``residuals`` only if they were measured or the energy balance was computed.
    ``penalty`` is that of the augmented method.  ``pivoting_fallbacks`` counts matrices that needed pivoting instead of a fixed order,
    ``substeps`` the substeps of recursive-newton after failed iterations.  ``rejected`` steps were repeated with a shorter step.  The
    length of ``stiff_steps`` was limited by stability.  Only explicit integrators and ``radau5`` count these two.  ``events`` are mode
    changes at which steps ended, also by element.  ``impacts`` are caused by jumps of guides' rates, ordered by time.
    """

    solver: str = ""
    penalty: float = nan
    iterations: int = 0
    factorisations: int = 0
    pivoting_fallbacks: int = 0
    substeps: int = 0
    residuals: Residuals = Residuals()
    rejected: int = 0
    stiff_steps: int = 0
    events: int = 0
    events_by_element: Mapping[str, int] = field(default_factory=dict)
    impacts: tuple[Impact, ...] = ()


@with_old_members
@dataclass(frozen=True, kw_only=True)
class ErrorEstimate:
    """Error estimates of a run's outputs, from runs with other steps.

    ``max_error`` is the largest error of each column over all samples, in its unit; infinite if no other run reached the end.
    ``converged``: differences fall as steps are refined, and the ``goal``, or the ``targets`` of outputs, are met if there are any.  At
    most 1 of 200 converged estimates is below a third of the error.  Errors of laws, masses and geometry are not included.

    ``warnings`` name faults that refined steps do not show: an energy defect that the steps do not explain, violated loops.  ``rough``
    outputs have errors above a tenth of their largest value, or errors that do not fall.  Accelerations and forces may be rough although
    positions meet the goal.
    """

    max_error: Mapping[str, float]
    units: Mapping[str, str]
    converged: bool
    warnings: tuple[str, ...] = ()
    rough: tuple[str, ...] = ()
    goal: float | None = None
    targets: Mapping[str, float] = field(default_factory=dict)

    def __getitem__(self, column: str) -> float:
        return self.max_error[column]

    def __iter__(self) -> Iterator[str]:
        return iter(self.max_error)

    def __repr__(self) -> str:
        worst = ", ".join(f"{name} {value:.1e}" for name, value in sorted(self.max_error.items(), key=lambda x: -x[1])[:_NAMED])
        converged = "converged" if self.converged else "not converged"
        return f"<ErrorEstimate, {converged}: {len(self.max_error)} columns, largest {worst or 'none'}>"


@with_old_members
@dataclass(frozen=True, kw_only=True, repr=False)
class Trajectory(Columns[Array]):
    """The samples of a run: a mapping from column names, "t" first, to arrays (samples,), and its statistics.

    ``t`` is the time (s), ``columns`` are the outputs, ``units`` theirs; ``seconds`` is the time that the steps took. ``undetermined``
    are independent speeds that neither scene nor loops determine at the start. ``indeterminate`` are reactions that redundant loop
    equations leave open: values are those with the smallest multipliers of cut joints. ``failure`` is None if the run reached its end.
    ``table`` is the result file, if there is one. ``fallback`` names the settings that replaced others, and why, or is "". ``estimator``
    estimates errors; None if that is impossible. ``energy`` is None unless requested. ``near_jumps`` are samples close to a jump, left
    out of error estimates. ``coordinates`` (samples, coordinates) are those of the method; None unless requested. ``locking_forces`` are
    forces that lock coordinates of a start in static equilibrium (see `MechanismState`), released at t = 0. ``start`` is what further runs
    with other steps begin with, None if the run has not begun.
    """

    t: Array
    columns: Mapping[str, Array]
    units: Mapping[str, str]
    steps: int
    evaluations: int
    seconds: float
    undetermined: tuple[str, ...]
    failure: FailureReport | None
    indeterminate: tuple[str, ...] = ()
    statistics: RunStatistics = RunStatistics()
    energy: EnergyBalance | None = None
    near_jumps: tuple[NearJump, ...] = field(default=(), repr=False)
    coordinates: Array | None = field(default=None, repr=False, compare=False)
    table: Path | None = None
    fallback: str = ""
    locking_forces: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    estimator: "Callable[[Trajectory], ErrorEstimate] | None" = field(default=None, repr=False, compare=False)
    start: Mapping[str, Any] | None = field(default=None, repr=False, compare=False)

    def __post_init__(self) -> None:
        self.update({TIME: self.t, **self.columns})

    def __repr__(self) -> str:
        reached = f"t = {self.t[-1]:g} s" if self.t.size else "no row"
        end = "" if self.failure is None else f"; failed: {self.failure.message}"
        columns = f"{len(self.columns)} columns ({_listed(self.columns)})"
        return f"<Trajectory to {reached}: {self.t.size} rows, {columns}, {self.steps} steps{end}>"

    def _repr_html_(self) -> str:
        """A table for notebooks: unit, first, last, smallest and largest value of each column."""
        return f"<p>{escape(repr(self))}</p>{_html_table(self)}"

    @accept_old_names
    def plot(self, *names: str, over: str = TIME, compare: "Mapping[str, Trajectory]" = MappingProxyType({})) -> "Figure":
        """Plot columns, all by default, with a panel for each unit; ``over`` is the time or another column.
        ``compare`` are other runs, by the names of their lines.

        Raises:
            KeyError: there is no such column.
        """
        from cutjoint.run.figures import Line, draw, labelled

        runs = {"": self, **compare}
        lines = [
            Line(x=run[over], y=run[name], label=f"{name}, {label}" if label else name, unit=self.unit_of(name))
            for name in names or self.columns for label, run in runs.items() if name in run or run is self
        ]  # fmt: skip
        return draw(lines, x_label=labelled(over, self.unit_of(over)))

    def unit_of(self, column: str) -> str:
        """The unit of a column; s for the time."""
        return "s" if column == TIME else self.units[column]

    def to_xarray(self) -> "Dataset":
        """The columns as an xarray data set over the coordinate "t", with units as attributes "units".

        Raises:
            MissingPackageError: xarray is not installed.
        """
        words = "to_xarray needs the package xarray, which is not installed; pip install 'cutjoint[data]'"
        xarray = find_package("xarray", otherwise=MissingPackageError(words))
        arrays = {name: (TIME, column, {"units": self.units[name]}) for name, column in self.columns.items()}
        return xarray.Dataset(arrays, coords={TIME: (TIME, self.t, {"units": "s"})})

    @cached_property
    def error(self) -> ErrorEstimate:
        """Error estimates of the outputs, from a few additional runs; computed once.

        Raises:
            ValueError: the run is not one that can be taken again.
        """
        if self.estimator is None:
            raise ValueError("only a run that simulate has returned can be taken again with other steps")
        return self.estimator(self)


@with_old_members
@dataclass(frozen=True, kw_only=True)
class Batch:
    """The results of a batch of runs.

    ``cases`` are the parameters of each run (SI units).  ``end``, ``minimum`` and ``maximum`` are arrays (runs,) for each column: the last
    value and the range; NaN if a run did not start.  ``evaluations`` are counted for each run; ``failures`` are None for runs that reached
    their end.  ``undetermined`` is that of the first run, see `Trajectory`.  ``seconds`` is the time of the steps, summed over threads;
    ``elapsed`` is the wall time (s).  ``settings`` are the step settings, ``side_by_side`` is whether runs share SIMD lanes.
    """

    cases: tuple[Mapping[str, float], ...]
    end: Mapping[str, Array]
    minimum: Mapping[str, Array]
    maximum: Mapping[str, Array]
    units: Mapping[str, str]
    evaluations: tuple[int, ...]
    failures: tuple[FailureReport | None, ...]
    undetermined: tuple[str, ...]
    seconds: float
    elapsed: float
    settings: StepSettings
    side_by_side: bool

    def __repr__(self) -> str:
        failed = sum(failure is not None for failure in self.failures)
        sets = f"over {_listed(self.names)}"
        return f"<Batch of {len(self.cases)} runs, {failed} failed, {sets}: {len(self.units)} columns ({_listed(self.units)})>"

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters that the runs set."""
        return tuple(self.cases[0]) if self.cases else ()


@with_old_members
@dataclass(frozen=True, kw_only=True)
class MechanismState:
    """A state of a mechanism: values and units by ``element.quantity``; NaN if a quantity is undefined there.

    ``undetermined`` are independent speeds that neither scene nor loops determine; minimum-norm values are used. ``locking_forces`` has the
    force and unit for each coordinate that the scene locks. ``neutral`` names coordinates and first-order states that nothing restores; the
    state is in equilibrium at other values of them too. ``trim`` is the result of the scene's trim.
    """

    values: Mapping[str, float]
    units: Mapping[str, str]
    undetermined: tuple[str, ...] = ()
    locking_forces: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    neutral: tuple[str, ...] = ()
    trim: "Trimmed | None" = None

    def __getitem__(self, column: str) -> float:
        return self.values[column]

    def __repr__(self) -> str:
        return f"<MechanismState of {len(self.values)} quantities ({_listed(self.values)})>"


def _html_table(run: Trajectory) -> str:
    known = run.__dict__.get("error")
    headings = ["", "unit", "first", "last", "smallest", "largest", *([] if known is None else ["error at most"])]
    rows = [_html_row("th", headings)]
    for name, column in run.items() if run.t.size else ():
        values = [column[0], column[-1], column.min(), column.max()]
        values += [] if known is None or name == TIME else [known[name]]
        rows.append(_html_row("td", [name, run.unit_of(name), *(f"{value:.6g}" for value in values)]))
    return f"<table>{''.join(rows)}</table>"


def _html_row(cell: str, texts: Iterable[str]) -> str:
    return f"<tr>{''.join(f'<{cell}>{escape(text)}</{cell}>' for text in texts)}</tr>"


def read_locking_forces(summary: Mapping[str, Any]) -> dict[str, tuple[float, str]]:
    """The forces, with units, that lock coordinates of a pose, from a summary; forces at the level of rounding are left out."""
    found: Mapping[str, float] = summary.get("locking_forces", {})
    least = 1e-9 * max(map(abs, found.values()), default=0.0)
    named = {name: name.rpartition(".")[2] for name, force in found.items() if abs(force) > least}
    return {
        name.removesuffix(rate) + (rate[1:] if rate in ("vx", "vy", "vz") else rate.removesuffix("_rate")):
        (found[name], "N" if rate.startswith(("v", "displacement")) else "N*m") for name, rate in named.items()
    }  # fmt: skip


def read_statistics(summary: Mapping[str, Any]) -> RunStatistics:
    """The statistics that a simulator's summary reports."""
    plain = {name: summary[name] for name in RunStatistics.__dataclass_fields__ if name in summary}
    impacts = tuple(Impact(**_numbers(each)) for each in summary.get("impacts", ()))
    return RunStatistics(**{**plain, "residuals": Residuals(**_numbers(summary.get("residuals", {}))), "impacts": impacts})


def _numbers(entries: Mapping[str, Any]) -> dict[str, Any]:
    """Entries of a summary; null stands for a number that is not finite."""
    return {name: nan if value is None else value for name, value in entries.items()}


def read_energy(summary: Mapping[str, Any]) -> EnergyBalance | None:
    """The energy balance of a simulator's summary, if it has one."""
    balance = summary.get("energy")
    return None if balance is None else EnergyBalance(**_numbers(balance))


def read_table(path: Path) -> tuple[Array, dict[str, Array]]:
    """Read time and columns of a result table: Parquet, Arrow or NumPy by its suffix, else CSV with one header row."""
    if path.suffix in BINARY:
        columns = read_columns(path)
        return columns.pop(TIME), columns
    header, *lines = path.read_text(encoding="utf-8").splitlines() or [TIME]
    names = header.split(",")
    rows = np.loadtxt(lines, delimiter=",", ndmin=2) if lines else np.zeros((0, len(names)))
    return rows[:, 0], {name: rows[:, i] for i, name in enumerate(names) if i > 0}


def columns_of(table: Array, names: Sequence[str], rows: int) -> tuple[Array, dict[str, Array]]:
    """Time and named columns of a run's ``table`` (rows, 1 + names), which must have ``rows`` rows.
    Raises OutputError: the table has lost rows since they were written."""
    if len(table) != rows:
        raise OutputError(f"{rows} rows were written and {len(table)} are there; has another program changed the table?")
    t, *columns = np.ascontiguousarray(table.T)
    return t, dict(zip(names, columns, strict=True))
