"""The run of a model with a controller: both take steps of communication, and exchange values between them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from itertools import groupby
from math import isfinite
from pathlib import Path
from time import perf_counter

import numpy as np

from cutjoint.coupling.connections import Connections
from cutjoint.coupling.controller import Controller, ControllerFmu
from cutjoint.coupling.process import ControllerError
from cutjoint.run.accuracy import SHORTER, STRICTER, compare
from cutjoint.run.errors import RunError
from cutjoint.run.result_files import Stream, TableFile, open_table, write_all
from cutjoint.run.results import Columns, ErrorEstimate, Trajectory
from cutjoint.run.simulator import Progress
from cutjoint.stepping.simulation import Simulation, SimulationError

#: Exchanges at the start until outputs and inputs go together.
_EXCHANGES = 20
#: Times that are nearer than this share of a step of communication are one.
_ROUNDING = 1e-6


@dataclass(frozen=True, kw_only=True)
class Plan:
    """A run of a ``simulation``, which has not begun, with an FMU to ``end``, rows ``output_step`` and communication ``step`` apart (s).

    ``dt`` (s) and ``tolerance`` set the integrator's steps, the tolerance alone where the integrator has one.  A step has ``iterations``
    iterations, None for as many as it takes.  ``parameters`` and constant inputs among them are in SI units.
    """

    simulation: Simulation
    fmu: ControllerFmu
    connections: Connections
    step: float
    end: float
    output_step: float
    dt: float
    tolerance: float | None
    iterations: int | None
    parameters: Mapping[str, float]

    @property
    def units(self) -> dict[str, str]:
        """The units of the columns: the scene's outputs, then the inputs that the FMU drives."""
        known = self.simulation.library.units
        return {**known["output"], **{name: known["input"][name] for name in self.connections.driven}}


def co_simulate(plan: Plan, *, out: Path | None = None, progress: Progress | None = None, estimate: bool = True) -> Trajectory:
    """Run both to the end; the table has the scene's outputs, then the inputs that the FMU drives from that time on.

    Both take a step of communication with what the other gave at its beginning.  The trajectory's steps are those of communication.  With
    ``estimate`` the run can say how wrong it is, by runs of both with other steps of the integrator; those of communication are the
    controller's, and stay.

    Raises:
        RunError: the start does not settle, or the FMU refuses a call.
        SimulationError: the motion of the model cannot go on.
        OutputError: the table cannot be written.
    """
    run = _run(plan, out, progress)
    return replace(run, estimator=partial(_estimate, plan)) if estimate else run


def _estimate(plan: Plan, run: Trajectory) -> ErrorEstimate:
    change = SHORTER if plan.tolerance is None else STRICTER

    def again(times: int) -> Trajectory | None:
        factor = change.factor**times
        finer = replace(plan, dt=plan.dt * factor) if plan.tolerance is None else replace(plan, tolerance=plan.tolerance * factor)
        try:
            return _run(finer, None, None)
        except (SimulationError, ControllerError):
            return None

    return compare(run, again, left=change.left).estimate


def _run(plan: Plan, out: Path | None, progress: Progress | None) -> Trajectory:
    """A run by the settings of a plan."""
    begun, rows = perf_counter(), []
    with _table(out, plan.units) as table:
        for row in _rows(plan):
            rows.append(row)
            if table is not None:
                write_all(table.file, (",".join(map(_text, row)) + "\n").encode())
            if progress is not None:
                progress(row[0] / (plan.end or 1.0))
    values = np.array(rows)
    columns = {name: values[:, 1 + i] for i, name in enumerate(plan.units)}
    return Trajectory(
        t=values[:, 0], columns=Columns(columns), units=Columns(plan.units), steps=_count(plan.end, plan.step), evaluations=0,
        seconds=perf_counter() - begun, undetermined=(), failure=None, table=out,
    )  # fmt: skip


def _text(number: float) -> str:
    """The shortest digits that mean the number."""
    return repr(number).removesuffix(".0")


@contextmanager
def _table(out: Path | None, units: Mapping[str, str]) -> Iterator[TableFile | Stream | None]:
    """The table of a run with its header, whole where nothing goes wrong."""
    if out is None:
        yield None
        return
    table = open_table(out, {"t": "s", **units})
    try:
        write_all(table.file, (",".join(["t", *units]) + "\n").encode())
        yield table
    except BaseException as error:
        if left := table.leave(str(error) or "interrupted"):
            error.add_note(f"the rows up to then are in {left}")
        raise
    table.finish()


def _rows(plan: Plan) -> Iterator[list[float]]:
    """The rows of a run: time, outputs, driven inputs."""
    simulation, controller = Simulation(plan.simulation.library), plan.fmu.instantiate()
    exchange = _Exchange(simulation, controller, plan)
    try:
        _begin(plan, simulation, controller, exchange)
        due = 1
        for time, is_row in _times(plan):
            if time > 0:
                simulation.advance(time)
            outputs = simulation.outputs.array.tolist()
            if due <= _count(plan.end, plan.step) and time >= (due - _ROUNDING) * plan.step:
                controller.step((due - 1) * plan.step, plan.step)
                exchange.give()
                exchange.take()
                due += 1
            if is_row:
                yield [time, *outputs, *exchange.given]
    finally:
        controller.close()


def _count(end: float, step: float) -> int:
    """Whole steps to the end."""
    return int(end / step + _ROUNDING)


def _times(plan: Plan) -> Iterator[tuple[float, bool]]:
    """The times of rows and of exchanges, and whether there is a row; times that rounding tells apart are one."""
    exchanges = {i * plan.step: False for i in range(1, _count(plan.end, plan.step) + 1)}
    rows = dict.fromkeys((*(i * plan.output_step for i in range(_count(plan.end, plan.output_step) + 1)), plan.end), True)
    for _, group in groupby(sorted((exchanges | rows).items()), lambda item: round(item[0] / (_ROUNDING * plan.step))):
        found = list(group)
        yield found[0][0], any(is_row for _, is_row in found)


def _begin(plan: Plan, simulation: Simulation, controller: Controller, exchange: _Exchange) -> None:
    """Start both, with values that go together."""
    for name, value in plan.parameters.items():
        if name in simulation.parameters:
            simulation.parameters[name] = value
        else:
            simulation.set_input(name, value)
    controller.begin(plan.end)
    for _ in range(_EXCHANGES):
        simulation.reset(dt=plan.dt, iterations=plan.iterations, tolerance=plan.tolerance)
        before = list(exchange.given)
        exchange.give()
        exchange.take()
        if exchange.given == before:
            controller.start()
            return
    raise RunError(f"{plan.fmu.path}: at the start its outputs and those of the model change each other without end; read no accelerations")


class _Exchange:
    """Values of the model to the controller, and back; ``given`` are those that drive the model."""

    def __init__(self, simulation: Simulation, controller: Controller, plan: Plan) -> None:
        self._simulation, self._controller = simulation, controller
        self._path, self._connections, self._step = plan.fmu.path, plan.connections, plan.step
        self.given: list[float] = []

    def give(self) -> None:
        """The model's outputs to the controller's inputs."""
        read = self._connections.read
        if read:
            values, sizes = self._simulation.outputs, self._connections.sizes
            self._controller.set([port for _, port in read], [port.from_si(values[name] * sizes[name]) for name, port in read])

    def take(self) -> None:
        """The controller's outputs to the model's inputs, which hold them; guides go there until the next exchange."""
        driven, before = self._connections.driven, self.given
        ports = list(driven.values())
        self.given = [port.to_si(value) for port, value in zip(ports, self._controller.get(ports) if ports else [], strict=True)]
        goes_on = self._simulation.time > 0
        for (name, port), value, last in zip(driven.items(), self.given, before or self.given, strict=True):
            if not isfinite(value):
                raise ControllerError(f"{self._path}: at {self._simulation.time:.6g} s its output '{port.name}' is {value}")
            if goes_on and name in self._connections.steering:
                self._simulation.set_input(name, last, (value - last) / self._step)
            else:
                self._simulation.set_input(name, value)
