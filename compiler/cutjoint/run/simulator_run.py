"""The run of a simulator: its program and its run file, and the trajectory that follows, also of two parts that two programs make."""

import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from cutjoint.methods import DEFAULT_METHOD, INTEGRATORS, join_and
from cutjoint.run.outputs import require_apart
from cutjoint.run.record import RunFile, Settings
from cutjoint.run.result_files import RunTables, place_of, read_rows
from cutjoint.run.results import Columns, FailureReport, NearJump, Trajectory, columns_of, read_energy, read_locking_forces, read_statistics
from cutjoint.run.simulator import Progress, call_simulator, failure_of

#: Jumps within this share of a sample interval of a sample are reported.
_BESIDE = 0.05
#: The numbers of a summary that are added; lists of impacts and near jumps are joined.
_SUMS = frozenset((
    "steps", "rows", "bytes", "seconds", "evaluations", "iterations", "factorisations", "substeps", "pivoting_fallbacks", "rejected",
    "events", "stiff_steps", "impacts", "near_jumps",
))  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Continuation:
    """The continuation of a run that leaves the range of loop embedding, which one of the ``guards`` reports.
    ``prepare`` compiles the model with cut joints; ``initial_state`` makes its initial state from a run file and the saved state."""

    guards: tuple[str, ...]
    prepare: "Callable[[], SimulatorRun]"
    initial_state: Callable[[RunFile, Mapping[str, Any]], Mapping[str, Any]]


@dataclass(frozen=True, kw_only=True)
class SimulatorRun:
    """A program and its inputs, but for the places of results: plain data.

    ``simulator`` is the program, ``run_file`` its input, ``description`` the model's data for an interpreter (None for generated code),
    ``units`` has the unit of each column by its name.  ``goal`` is the largest error of places and angles (m, rad) that steps are to keep,
    None where steps are given; ``is_asked`` is whether scene or caller ask for it; ``targets`` are the largest errors of outputs instead.

    ``method`` is the program's, ``closes_loops`` whether it has equations of loops, ``indeterminate`` are the components of reactions that
    these do not determine, ``others`` the settings of other integrators that it has.  ``is_free`` is whether scene and
    caller leave the choice of the integrator and of what steps do at events.  ``with_coordinates`` is whether the trajectory has
    coordinates.  ``jumps`` are times (s) at which an input or a guide goes over to another formula: a row there has the values of one side.
    ``balances_energy`` is whether the program has work and energy, ``continuation`` replaces a run whose loop embeddings end, or None.
    ``by_method`` makes the run by another method, None where that takes minutes.  ``leading`` are the joints of loops whose guides move.
    ``switches`` is whether forces change their formulas.
    """

    simulator: Path
    run_file: RunFile
    description: Mapping[str, Any] | None
    units: Mapping[str, str]
    goal: float | None = None
    is_asked: bool = False
    targets: Mapping[str, float] = field(default_factory=dict)
    method: str = DEFAULT_METHOD
    closes_loops: bool = False
    indeterminate: Sequence[str] = ()
    others: Sequence[Settings] = ()
    is_free: bool = False
    with_coordinates: bool = False
    jumps: Sequence[float] = ()
    balances_energy: bool = True
    continuation: Continuation | None = field(default=None, repr=False, compare=False)
    by_method: "Callable[[str], SimulatorRun | None] | None" = field(default=None, repr=False, compare=False)
    leading: Sequence[str] = ()
    switches: bool = False

    def with_checks(self) -> "SimulatorRun":
        """The run with an energy balance, if its program has one, and with a search for jumps near samples."""
        balanced = self.balances_energy and INTEGRATORS[self.run_file.settings.integrator].balances_energy
        checked = replace(self.run_file, jumps_within=_BESIDE * self.run_file.output_step, energy=self.run_file.energy or balanced)
        return replace(self, run_file=checked)

    def begun_as(self, run: Trajectory | None) -> "SimulatorRun":
        """The run with the start that a run of the same file has found, if it has begun, in place of a search for it."""
        return self if run is None or run.start is None else replace(self, run_file=replace(self.run_file, start=run.start))

    def with_parameters(self, changes: Mapping[str, float]) -> "SimulatorRun":
        """The run with other values (SI units) of tunable parameters that nothing else in the run file follows from, and of inputs."""
        file = self.run_file
        parameters = {name: value for name, value in changes.items() if name in file.parameters}
        inputs = {name: value for name, value in changes.items() if name not in parameters}
        of_all = {**(file.inputs or {}), **inputs} if inputs else file.inputs
        return replace(self, run_file=replace(file, parameters={**file.parameters, **parameters}, inputs=of_all))


@dataclass(frozen=True, kw_only=True)
class Start:
    """How the initial speeds are determined; ``at_rest`` if neither scene nor guides prescribe any."""

    at_rest: bool
    closes_loops: bool


@dataclass(frozen=True, kw_only=True)
class Compilation:
    """The facts of a compilation, for people: operations and instructions of an evaluation, seconds, 0 for cached parts."""

    scene: str
    method: str
    implementation: str
    operations: int
    instructions: int
    compiler: str
    flags: tuple[str, ...]
    generate_seconds: float
    compile_seconds: float
    start: Start


def start(
    run: SimulatorRun, *, out: Path | None = None, steps: Path | None = None,
    progress: Progress | None = None, seconds: float | None = None,
) -> Trajectory:  # fmt: skip
    """Run a simulator to its end; ``out`` and ``steps`` are files for results, as in `simulation.simulate`.

    Raises:
        SimulatorError: a simulator could not begin, could not write a file, or took more than ``seconds``.
        OutputError: a file cannot be written.
        Interrupted, Terminated: a signal has ended the run.
    """
    require_apart({}, tables={"out": out, "steps": steps})
    requested = RunTables({"t": "s", **run.units}, out=out, steps_out=steps)
    with requested as tables, tempfile.TemporaryFile(buffering=0) if run.with_coordinates else nullcontext() as file:
        place = {} if file is None else {"coordinates_out_rows": place_of(file, "the temporary table of coordinates")}
        run_file = {**run.run_file.entries(), **tables.places, **place}
        summary = call_simulator(run.simulator, run_file, progress, seconds=seconds, description=run.description)
        ended, fallback, indeterminate = failure_of(summary), "", tuple(run.indeterminate)
        if ended is not None and file is None and (continuation := _fallback(run, ended, summary)) is not None:
            other, state = continuation.prepare(), continuation.initial_state(run.run_file, summary["kept"])
            run_file |= {"initial_state": state, "pose": "design"}
            rest = call_simulator(other.simulator, run_file, progress, seconds=seconds, description=other.description)
            summary, indeterminate = merge_summaries(summary, rest), tuple(dict.fromkeys((*indeterminate, *other.indeterminate)))
            left = join_and([f"'{independent}'" for independent in ended.guards])
            fallback = f"the loops' equations at t = {state['t']:g} s, since the functions of {left} end at t = {ended.time:.6g} s"
        rows, failure = summary.get("rows", 0), failure_of(summary)
        coordinates = None if file is None else np.zeros((0, 0))
        if file is not None and rows:
            coordinates = read_rows(file, os.fstat(file.fileno()).st_size // (8 * rows))[:, 1:]
        t, columns = columns_of(tables.rows(1 + len(run.units)), tuple(run.units), rows)
        table = tables.finish(summary.get("bytes")) if failure is None else tables.leave(str(failure))
    return Trajectory(
        t=t, columns=Columns(columns), units=Columns(run.units), steps=summary.get("steps", 0), evaluations=summary.get("evaluations", 0),
        seconds=summary.get("seconds", 0.0), undetermined=tuple(summary.get("undetermined", ())), failure=failure,
        indeterminate=indeterminate, statistics=read_statistics(summary), energy=read_energy(summary), table=table,
        near_jumps=tuple(NearJump(**each) for each in summary.get("near_jumps", ())), coordinates=coordinates,
        fallback=fallback, locking_forces=read_locking_forces(summary), start=summary.get("start"),
    )  # fmt: skip


def _fallback(run: SimulatorRun, ended: FailureReport, summary: Mapping[str, Any]) -> Continuation | None:
    """The continuation of a run outside the range of loop embedding; None if an omitted force would act too, or no state was saved."""
    continuation = run.continuation
    if continuation is None or not ended.guards or not summary.get("kept"):
        return None
    return continuation if {*ended.guards} <= {*continuation.guards} else None


def merge_summaries(first: Mapping[str, Any], second: Mapping[str, Any]) -> dict[str, Any]:
    """The summary of both parts, which ends as the second does. The defect of work and energy is at most the sum of both."""
    ends = ("message", "time", "step", "element", "residual", "advice", "guards", "kept")  # of a failure
    begun = {name: value for name, value in first.items() if name not in ends}
    return {**begun, **second, **{name: _merge_entry(name, first, second) for name in first.keys() & second.keys()}}


def _merge_entry(name: str, first: Mapping[str, Any], second: Mapping[str, Any]) -> Any:
    one, other = first[name], second[name]
    if name in _SUMS:
        return one + other
    if name == "residuals":
        return {key: _largest(one.get(key), other[key]) for key in other}
    if name == "events_by_element":
        return {key: one.get(key, 0) + other.get(key, 0) for key in sorted({*one, *other})}
    if name == "energy":
        added = {key: None if None in (one[key], other[key]) else one[key] + other[key] for key in ("exchanged", "defect")}
        return {key: _largest(one[key], other[key]) for key in other} | added
    return list(dict.fromkeys((*one, *other))) if name == "undetermined" else other


def _largest(one: float | None, other: float | None) -> float | None:  # None is a number that is not finite
    return None if one is None or other is None else max(one, other)
