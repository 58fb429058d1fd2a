"""The run of a model with controllers: all take communication steps and exchange values."""

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from heapq import merge
from itertools import groupby, repeat
from math import isfinite
from operator import mul
from pathlib import Path
from time import perf_counter

import numpy as np

from cutjoint.coupling.connections import Connections
from cutjoint.coupling.controller import ControllerFmu, Port
from cutjoint.coupling.process import ControllerError
from cutjoint.package.errors import RunError
from cutjoint.run.accuracy import SHORTER, STRICTER, compare
from cutjoint.run.result_files import whole_table, write_all
from cutjoint.run.results import Columns, ErrorEstimate, Trajectory
from cutjoint.run.simulator import Progress
from cutjoint.stepping.handle import SimulationError
from cutjoint.stepping.simulation import Simulation

#: The largest number of exchanges at the start to make outputs and inputs consistent.
_EXCHANGES = 20
#: Times closer than this share of a communication step are equal.
_ROUNDING = 1e-6
#: The largest number of exchanges of an FMU in a run: hours.
_MOST = 1e8


@dataclass(frozen=True, kw_only=True)
class Participant:
    """An FMU with its connections; its communication steps have the length ``step`` (s)."""

    fmu: ControllerFmu
    connections: Connections
    step: float


@dataclass(frozen=True, kw_only=True)
class Plan:
    """A run of a ``simulation``, which has not begun, with ``parties`` to ``end``, rows ``output_step`` apart (s).

    ``dt`` (s) and ``tolerance`` set the integrator's steps, the tolerance alone where the integrator has one.  A step has ``iterations``
    iterations, None for as many as it takes.  ``parameters`` and constant inputs among them are in SI units.
    """

    simulation: Simulation
    parties: tuple[Participant, ...]
    end: float
    output_step: float
    dt: float
    tolerance: float | None
    iterations: int | None
    parameters: Mapping[str, float]

    @property
    def step(self) -> float:
        """The shortest communication step, s."""
        return min(participant.step for participant in self.parties)

    @property
    def units(self) -> dict[str, str]:
        """The units of the columns: the scene's outputs, then the inputs that FMUs drive."""
        known = self.simulation.library.units
        return {**known["output"], **{name: known["input"][name] for each in self.parties for name in each.connections.driven}}


def co_simulate(plan: Plan, *, out: Path | None = None, progress: Progress | None = None, estimate: bool = True) -> Trajectory:
    """Run all to the end; the table has the scene's outputs, then the inputs that FMUs drive from that time on.

    Each takes a step of communication with what others gave at its beginning.  The trajectory's steps are the exchanges, its coordinates
    the method's own.  With ``estimate`` the run can say how wrong it is, by runs with other steps of the integrator; those of communication
    are the controllers', and stay.

    Raises:
        RunError: steps of communication are hardly meant to be as short, the start does not settle, or the FMU refuses a call.
        SimulationError: the motion of the model cannot go on.
        OutputError: the table cannot be written.
    """
    for participant in plan.parties:
        if (count := plan.end / participant.step) > _MOST:
            words = f"steps of communication of {participant.step:g} s are {count:.1e} exchanges to {plan.end:g} s"
            raise RunError(f"{participant.fmu.path}: {words}; say --communication-step, or end earlier by --end")
    run = _run(plan, out, progress)
    return replace(run, estimator=partial(_estimate, plan)) if estimate else run


def _estimate(plan: Plan, run: Trajectory) -> ErrorEstimate:
    change = SHORTER if plan.tolerance is None else STRICTER

    def rerun(times: int) -> Trajectory | None:
        factor = change.factor**times
        finer = replace(plan, dt=plan.dt * factor) if plan.tolerance is None else replace(plan, tolerance=plan.tolerance * factor)
        try:
            return _run(finer, None, None)
        except (SimulationError, ControllerError):
            return None

    return compare(run, rerun, remaining=change.remaining)[0]


def _run(plan: Plan, out: Path | None, progress: Progress | None) -> Trajectory:
    begun, rows, places = perf_counter(), [], []
    units = {"t": "s", **plan.units}
    with nullcontext() if out is None else whole_table(out, units) as table:
        if table is not None:
            write_all(table.file, (",".join(units) + "\n").encode())
        for row, coordinates in _rows(plan):
            rows.append(row)
            places.append(coordinates)
            if table is not None:
                write_all(table.file, (",".join(repr(number).removesuffix(".0") for number in row) + "\n").encode())
            if progress is not None:
                progress(row[0] / (plan.end or 1.0))
    values = np.array(rows)
    columns = {name: values[:, 1 + i] for i, name in enumerate(plan.units)}
    return Trajectory(
        t=values[:, 0], columns=Columns(columns), units=Columns(plan.units), steps=sum(1 for _ in _exchange_times(plan)), evaluations=0,
        seconds=perf_counter() - begun, undetermined=(), failure=None, table=out, coordinates=np.array(places),
    )  # fmt: skip


def _rows(plan: Plan) -> Iterator[tuple[list[float], list[float]]]:
    """The rows of a run, time, outputs and driven inputs, and the coordinates at these times."""
    simulation = Simulation(plan.simulation.library)
    with ExitStack() as opened:
        ends: list[_End] = []
        for participant in plan.parties:
            opened.callback(participant.fmu.instantiate().close)
            ends.append(_End(simulation, participant, ends))
        _begin(plan, simulation, ends)
        for time, is_row in _times(plan):
            if time > 0:
                simulation.advance(time)
            outputs, coordinates = simulation.outputs.array.tolist(), simulation.coordinates.array.tolist()
            due = [end for end in ends if end.is_due(time, plan.end)]
            for end in due:
                end.step()
            for end in due:
                end.exchange()
            if is_row:
                yield [time, *outputs, *(value for end in ends for value in end.driven_values)], coordinates


def _count(end: float, step: float) -> int:
    return int(end / step + _ROUNDING)


def _times(plan: Plan) -> Iterator[tuple[float, bool]]:
    """The times of samples and of exchanges, and whether each is a sample; times that differ by rounding are merged."""
    exchanges = ((time, False) for time in _exchange_times(plan))
    rows = ((min(i * plan.output_step, plan.end), True) for i in range(_count(plan.end, plan.output_step) + 1))
    for _, group in groupby(merge(exchanges, rows, [(plan.end, True)]), lambda item: round(item[0] / (_ROUNDING * plan.step))):
        found = list(group)
        yield found[0][0], any(is_row for _, is_row in found)


def _exchange_times(plan: Plan) -> Iterator[float]:
    steps = [participant.step for participant in plan.parties]
    times = merge(*(map(mul, repeat(step), range(1, _count(plan.end, step) + 1)) for step in steps))
    return (next(group) for _, group in groupby(times, lambda time: round(time / (_ROUNDING * plan.step))))


def _begin(plan: Plan, simulation: Simulation, ends: "list[_End]") -> None:
    """Initialise all participants with consistent values."""
    for name, value in plan.parameters.items():
        if name in simulation.parameters:
            simulation.parameters[name] = value
        else:
            simulation.set_input(name, value)
    for end in ends:
        end.controller.begin(plan.end)
    for _ in range(_EXCHANGES):
        simulation.reset(dt=plan.dt, iterations=plan.iterations, tolerance=plan.tolerance)
        before = [(end.driven_values, end.passed()) for end in ends]
        for end in ends:
            end.exchange()
        if [(end.driven_values, end.passed()) for end in ends] == before:
            for end in ends:
                end.controller.start()
            return
    paths = " and ".join(str(participant.fmu.path) for participant in plan.parties)
    raise RunError(f"{paths}: at the start outputs of FMUs and of the model change each other without end; read no accelerations")


class _End:
    """An FMU's end of the connections; ``driven_values`` are the values by which it drives the model, ``others`` all ends by number."""

    def __init__(self, simulation: Simulation, participant: Participant, others: "list[_End]") -> None:
        self.controller, self.driven_values, self._simulation, self._others = participant.fmu, list[float](), simulation, others
        self._path, self._connections, self._step = participant.fmu.path, participant.connections, participant.step
        self._steps = 0

    def is_due(self, time: float, end: float) -> bool:
        """Return whether a communication step ends at a time."""
        return self._steps < _count(end, self._step) and time >= (self._steps + 1 - _ROUNDING) * self._step

    def step(self) -> None:
        """Take the communication step that ends now."""
        self.controller.step(self._steps * self._step, self._step)
        self._steps += 1

    def exchange(self) -> None:
        """Outputs of the model and of other FMUs to the controller's inputs, its outputs to the model's inputs."""
        self._write_inputs()
        self._read_outputs()

    def passed(self) -> list[float]:
        """The values (SI units) that other FMUs pass to this one."""
        return [value for source, port, _ in self._connections.passed for value in self._others[source]._read([port])]

    def _write_inputs(self) -> None:
        values, sizes = self._simulation.outputs, self._connections.sizes
        read = [(port, values[name] * sizes[name]) for name, port in self._connections.read]
        read += [(sink, value) for (_, _, sink), value in zip(self._connections.passed, self.passed(), strict=True)]
        if read:
            self.controller.set([port for port, _ in read], [port.from_si(value) for port, value in read])

    def _read(self, ports: list[Port]) -> list[float]:
        """The values of outputs, in SI units."""
        values = [port.to_si(value) for port, value in zip(ports, self.controller.get(ports) if ports else [], strict=True)]
        for port, value in zip(ports, values, strict=True):
            if not isfinite(value):
                raise ControllerError(f"{self._path}: at {self._simulation.time:.6g} s its output '{port.name}' is {value}")
        return values

    def _read_outputs(self) -> None:
        """Set the model's inputs to the controller's outputs (zero-order hold); guides reach them at the next exchange."""
        driven, before = self._connections.driven, self.driven_values
        self.driven_values = self._read(list(driven.values()))
        has_started = self._simulation.time > 0
        for name, value, last in zip(driven, self.driven_values, before or self.driven_values, strict=True):
            if has_started and name in self._connections.steering:
                self._simulation.set_input(name, last, (value - last) / self._step)
            else:
                self._simulation.set_input(name, value)
