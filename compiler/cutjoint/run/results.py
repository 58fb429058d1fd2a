"""The results of a simulator."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from math import nan
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from cutjoint.model.errors import nearest
from cutjoint.package.extensions import MissingPackageError
from cutjoint.package.renamed import accept_old_names, with_old_members
from cutjoint.run.binary_tables import WRITERS, read_columns
from cutjoint.run.outputs import OutputError
from cutjoint.run.settings import StepSettings

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from xarray import Dataset

    from cutjoint.analysis.trims import Trimmed

T = TypeVar("T")

Array: TypeAlias = NDArray[np.float64]


#: The name of the time among the columns of a table.
TIME = "t"
#: The beginning of untried advice.
UNTRIED = "try: "
#: The number of columns in a `repr`.
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
    def _unit(self) -> str:
        return " m/s^2 or rad/s^2" if self.message.startswith("no static equilibrium") else ""

    @property
    def what(self) -> str:
        """The message with its time and the element with the worst residual."""
        return f"{self.message} at t = {self.time:.6g} s (step {self.step}); worst at '{self.element}' with {self.residual:.3g}{self._unit}"

    def __str__(self) -> str:
        return f"{self.what}; {self.advice}" if self.advice else self.what


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
    """The statistics of a run's steps besides evaluations.

    The recursive method has no linear ``solver`` (""), and residuals only where its steps were measured or energy was balanced.
    ``penalty`` is that of the augmented method; ``pivoting_fallbacks`` counts the matrices for which a fixed pivot order had to give way to
    pivoting, ``substeps`` the parts that steps of recursive-newton were taken in where the iteration did not reach their end at once.
    ``rejected`` are attempts of steps that were taken again shorter, ``stiff_steps`` steps with a length limited by stability: numbers of
    explicit integrators and of ``radau5``.  ``events`` are the changes of formula at which steps ended, by element in
    ``events_by_element``.  ``impacts`` are caused by jumps of guides' rates, in the order of time.
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
    """Errors of a run's outputs, by other runs of the same.

    ``max_error`` has the largest error of each column over all rows, in its unit of ``units``; infinite where no second run reached the
    end. ``converged`` are runs whose differences fall from coarser steps to finer ones; of those, no more than one in two hundred tells
    less than a third of an error.  Where steps follow from an accuracy, the ``goal`` (None elsewhere), they are those whose places and
    angles keep it.  Laws, masses and places are taken as they are given.

    ``warnings`` tell of faults that errors of the steps do not show: work and energy that differ by more than the steps explain, loops that
    stay open.  ``rough`` are outputs that are off by more than a tenth of their largest value, or come no nearer with finer steps;
    accelerations and forces may be, where places keep an accuracy.
    """

    max_error: Mapping[str, float]
    units: Mapping[str, str]
    converged: bool
    warnings: tuple[str, ...] = ()
    rough: tuple[str, ...] = ()
    goal: float | None = None

    def __getitem__(self, column: str) -> float:
        return self.max_error[column]

    def __repr__(self) -> str:
        worst = ", ".join(f"{name} {value:.1e}" for name, value in sorted(self.max_error.items(), key=lambda x: -x[1])[:_NAMED])
        converged = "converged" if self.converged else "not converged"
        return f"<ErrorEstimate, {converged}: {len(self.max_error)} columns, largest {worst or 'none'}>"


@with_old_members
@dataclass(frozen=True, kw_only=True, repr=False)
class Trajectory(Columns[Array]):
    """A table of a run, which is a mapping from the names of its columns, "t" first, to arrays (rows,), and how the run went.

    ``t`` (s) is the time, ``columns`` are the outputs over it, ``units`` those of each output.

    ``seconds`` is the time of the steps alone; ``undetermined`` are independent speeds that neither scene nor loops determine at the
    start, ``indeterminate`` the columns of reactions that redundant equations of loops leave open (of all solutions they are the one with
    the smallest multipliers of cut joints), ``failure`` is None when the run reached its end.  ``table`` is the file that has the rows, if
    there is one.  ``fallback`` says which settings took over, and why, "" if none did.  ``estimator`` finds how wrong the run is, None
    where nothing can.  ``energy`` is the balance of work and energy, None where none was asked for.  ``near_jumps`` are rows next to a
    jump of a column, left out of the error.  ``coordinates`` are the
    method's own at the times of the rows (rows, coordinates), None where nobody asked for them.  ``held`` is that of a `MechanismState`,
    of a start in static equilibrium: these forces are released at t = 0.
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
    held: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    estimator: "Callable[[Trajectory], ErrorEstimate] | None" = field(default=None, repr=False, compare=False)

    def __post_init__(self) -> None:
        self.update({TIME: self.t, **self.columns})

    def __repr__(self) -> str:
        reached = f"t = {self.t[-1]:g} s" if self.t.size else "no row"
        end = "" if self.failure is None else f"; failed: {self.failure.message}"
        columns = f"{len(self.columns)} columns ({_listed(self.columns)})"
        return f"<Trajectory to {reached}: {self.t.size} rows, {columns}, {self.steps} steps{end}>"

    def _repr_html_(self) -> str:
        """A table for notebooks: of each column the unit, the first and the last value, the smallest and the largest one."""
        return f"<p>{escape(repr(self))}</p>{_html_table(self)}"

    @accept_old_names
    def plot(self, *names: str, over: str = TIME, compare: "Mapping[str, Trajectory]" = MappingProxyType({})) -> "Figure":
        """A figure of columns, of all without ``names``: a panel for each unit, ``over`` the time or another column; ``compare`` are other
        runs by names for their lines.

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
        """The unit of a column, s of the time."""
        return "s" if column == TIME else self.units[column]

    def to_xarray(self) -> "Dataset":
        """The columns as a data set of xarray over the coordinate "t", each with its unit as the attribute "units".

        Raises:
            MissingPackageError: xarray is not installed.
        """
        try:
            from xarray import Dataset
        except ImportError:
            raise MissingPackageError("to_xarray needs the package xarray, which is not installed; pip install 'cutjoint[data]'") from None
        arrays = {name: (TIME, column, {"units": self.units[name]}) for name, column in self.columns.items()}
        return Dataset(arrays, coords={TIME: (TIME, self.t, {"units": "s"})})

    @cached_property
    def error(self) -> ErrorEstimate:
        """The errors of the outputs: asking for them takes some more runs, which are kept.

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

    ``cases`` are the parameters that each run sets (SI units).  ``end``, ``minimum`` and ``maximum`` have (runs,) values of each column:
    of the last row, and over all rows; nan where a run did not start.  ``evaluations`` are those that each run needed, ``failures`` is
    None for a run that reached its end.  ``undetermined`` are as in a `Trajectory`, of the first run.  ``seconds`` is the time of the steps
    alone, summed over threads, ``elapsed`` (s) that of all.  ``settings`` are how the runs step, ``side_by_side`` is whether they do so
    together.
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


@dataclass(frozen=True, kw_only=True)
class MechanismState:
    """A state of a mechanism: the value and unit of each quantity by ``element.quantity``; nan where a quantity has no value there.

    ``undetermined`` are independent speeds that neither scene nor loops determine, which are as small as they can be.  ``held`` has the
    force along each coordinate that the scene's positions hold at rest, with its unit.  ``trim`` is what the scene's trim has found.
    """

    values: Mapping[str, float]
    units: Mapping[str, str]
    undetermined: tuple[str, ...] = ()
    held: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    trim: "Trimmed | None" = None

    def __getitem__(self, column: str) -> float:
        return self.values[column]

    def __repr__(self) -> str:
        return f"<MechanismState of {len(self.values)} quantities ({_listed(self.values)})>"


def _html_table(run: Trajectory) -> str:
    """A row of HTML for each column of a run, with its error where that is known."""
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
    """The force with its unit along each coordinate that holds a pose at rest, by a summary, which names their rates; but for rounding."""
    found: Mapping[str, float] = summary.get("held", {})
    least = 1e-9 * max(map(abs, found.values()), default=0.0)
    named = {name: name.rpartition(".")[2] for name, force in found.items() if abs(force) > least}
    return {
        name.removesuffix(rate) + (rate[1:] if rate in ("vx", "vy", "vz") else rate.removesuffix("_rate")):
        (found[name], "N" if rate.startswith(("v", "displacement")) else "N*m") for name, rate in named.items()
    }  # fmt: skip


def read_statistics(summary: Mapping[str, Any]) -> RunStatistics:
    """The statistics that a simulator's summary reports."""
    residuals = {name: nan if value is None else value for name, value in summary.get("residuals", {}).items()}
    plain = {name: summary[name] for name in RunStatistics.__dataclass_fields__ if name in summary}
    impacts = tuple(_impact(each) for each in summary.get("impacts", ()))
    return RunStatistics(**{**plain, "residuals": Residuals(**residuals), "impacts": impacts})


def _impact(summary: Mapping[str, Any]) -> Impact:
    work = summary["work"]
    return Impact(time=summary["time"], element=summary["element"], work=nan if work is None else work)


def read_energy(summary: Mapping[str, Any]) -> EnergyBalance | None:
    """The balance that a simulator's summary reports, if it does."""
    balance = summary.get("energy")
    return None if balance is None else EnergyBalance(**{name: nan if value is None else value for name, value in balance.items()})


def read_near_jumps(summary: Mapping[str, Any]) -> tuple[NearJump, ...]:
    """The jumps beside rows that a simulator's summary reports."""
    return tuple(NearJump(**each) for each in summary.get("near_jumps", ()))


def read_table(path: Path) -> tuple[Array, dict[str, Array]]:
    """Time and columns of a table of a run: Parquet, Arrow or NumPy by its ending, else a CSV with one header row."""
    if path.suffix in WRITERS:
        columns = read_columns(path)
        return columns.pop(TIME), columns
    header, *lines = path.read_text(encoding="utf-8").splitlines() or [TIME]
    names = header.split(",")
    rows = np.loadtxt(lines, delimiter=",", ndmin=2) if lines else np.zeros((0, len(names)))
    return rows[:, 0], {name: rows[:, i] for i, name in enumerate(names) if i > 0}


def columns_of(table: Array, names: Sequence[str], rows: int) -> tuple[Array, dict[str, Array]]:
    """Time and columns of these names of a run's ``table`` (rows, 1 + names), which has to have so many rows.

    Raises:
        OutputError: the table has lost rows since they were written.
    """
    if len(table) != rows:
        raise OutputError(f"{rows} rows were written and {len(table)} are there; has another program changed the table?")
    t, *columns = np.ascontiguousarray(table.T)
    return t, dict(zip(names, columns, strict=True))
