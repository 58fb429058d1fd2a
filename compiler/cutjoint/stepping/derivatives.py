"""Derivatives of steps and runs of a simulation."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import isinf, isnan
from typing import Any

import numpy as np

from cutjoint.emit.statuses import STATUSES
from cutjoint.package.renamed import renamed
from cutjoint.stepping.handle import require_list, require_whole
from cutjoint.stepping.library import TrajectoryRecord
from cutjoint.stepping.linear import Linear
from cutjoint.stepping.motion import OVER_EVENTS
from cutjoint.stepping.trajectories import Columns, InputTrajectory, InputTrajectoryLike, make_trajectories
from cutjoint.stepping.values import (
    AdjointSensitivities,
    Array,
    EventSensitivities,
    ForwardSensitivities,
    StateSensitivities,
    StepDerivatives,
    Values,
    find_number,
    weigh_each,
)

#: The largest number of records of a run.
_MOST_RECORDS = 1 << 24

#: Starts whose coordinates differ by less (SI units) are the same.
_AT_START = 1e-9


class Derivatives(Linear):
    """A simulation with derivatives of its steps, forward and adjoint."""

    def step_derivatives(self) -> StepDerivatives:
        """Take one step; its derivatives with respect to the states before it, inputs (zero-order hold) and parameters.

        Outputs of controllers and inputs that follow the scene stay constant.

        Raises:
            TypeError: the model was loaded without derivatives.
            SimulationError: the step failed, ended at an event or was taken in parts, and the state stays; or there was no `reset`.
        """
        states = self.states
        n, inputs, parameters = len(states), *(self.library.names[kind] for kind in ("input", "parameter"))
        by_state, by_input, by_parameter = matrices = [np.zeros((n, width)) for width in (n, len(inputs), len(parameters))]
        self._call(self.library.step_derivatives, *(matrix.ctypes.data for matrix in matrices))
        return StepDerivatives(
            by_state=by_state, by_input=by_input, by_parameter=by_parameter, start=states.array, end=self.states.array,
            states=tuple(states), inputs=inputs, parameters=parameters,
        )  # fmt: skip

    def forward_sensitivities(
        self, steps: int, outputs: Sequence[str], by: Sequence[str], *, every: int = 1, initial_sensitivities: Array | None = None,
        events: int = 0, inputs: Mapping[str, InputTrajectoryLike] | None = None,
    ) -> ForwardSensitivities:  # fmt: skip
        """Take a number of steps, with the derivatives of outputs with respect to parameters, inputs and initial states.

        Each step is differentiated as it was taken, over events too.

        Args:
            outputs: names of outputs.
            by: names of parameters, of inputs (a constant shift), and of ``states`` at the beginning.
            every: steps between samples.
            initial_sensitivities: (states, by) derivatives of the initial states with respect to parameters; default: none.
            events: number of events to record.
            inputs: input trajectories for this run: arrays (zero-order hold) or tables as of `simulate`.  Such an input in ``by``
                expands to all its values ``name[0]``, ``name[1]``, ...; ``name.rate`` to the rates of its table.

        Raises:
            TypeError: the model was loaded without derivatives, or ``events`` > 0 and steps do not end at events.
            KeyError: there is no such output, parameter or input, or the coordinate is not independent.
            ValueError: ``every`` does not divide the steps, steps are negative, or ``events`` > 0 and ``by`` is empty.
            SimulationError: a step failed, an event has no derivative, or there was no `reset`; the state before the step stays.
        """
        states = self.states
        require_list("by", by)
        require_whole("events", events, 0)
        if events:
            self._require(self.library.steps.finds_events, OVER_EVENTS)
            if not by:
                raise ValueError("events > 0 needs at least one name in `by`: events are recorded with their derivatives")
        chosen = self._chosen(steps, outputs, every)
        trajectories = self._trajectories(inputs, steps)
        columns = Columns.of(by, trajectories)
        places = {name: i for i, name in enumerate((*self.library.names["input"], *self.library.names["parameter"], *states))}
        numbers = np.full(len(columns.names), -1, dtype=np.intc)
        matrix = np.zeros((self.library.seed_rows, len(numbers)))
        for column, name in columns.plain.items():
            place = self._place_of(places, name)
            if name in states:
                matrix[states.place(name), column] = 1.0
            else:
                numbers[column] = place
        if initial_sensitivities is not None:
            matrix[: len(states)] += self._begun(initial_sensitivities, states, columns.names)
        start, rows = self.time, steps // every + 1
        values, derivatives = np.empty((rows, len(chosen))), np.empty((rows, len(chosen), len(numbers)))
        tell = self._record_events(events, len(numbers), len(chosen))
        changes = columns.changes(trajectories)  # a name keeps the arrays whose addresses the call takes
        self._follow(trajectories, changes=changes)
        self._call(
            self.library.forward_sensitivities, steps, len(numbers), numbers.ctypes.data, matrix.ctypes.data, len(chosen),
            chosen.ctypes.data, every, values.ctypes.data, derivatives.ctypes.data,
        )  # fmt: skip
        return ForwardSensitivities(
            times=np.linspace(start, self.time, rows), values=values, derivatives=derivatives, outputs=tuple(outputs), by=columns.names,
            events=tell() if events else None,
        )  # fmt: skip

    def adjoint_sensitivities(
        self, steps: int, outputs: Sequence[str], by: Sequence[str], weights: Array | str | Callable[[Array, Array], Array], *,
        every: int = 1, initial_sensitivities: Array | None = None, inputs: Mapping[str, InputTrajectoryLike] | None = None,
    ) -> AdjointSensitivities:  # fmt: skip
        """Take a number of steps, with the derivatives of objectives by any number of parameters, inputs and initial states.

        Each objective takes the time of 10 to 30 runs (small mechanisms), however many names ``by`` has.

        Args:
            outputs, by, every, inputs: as of `forward_sensitivities`.
            weights: w (objectives, samples, outputs): objectives are sum(w*y) for samples y, derivatives sum(w*dy/dp); or a function
                (times, values) -> w, for a cost J(y) with w = dJ/dy; or "end", "integral", "mean", "rms", "maximum", "minimum" of
                each output.

        Raises:
            TypeError: the model was loaded without ``adjoint``.
            KeyError: there is no such output, parameter or input, or the coordinate is not independent.
            ValueError: ``every`` does not divide the steps, steps are negative, weights have another shape, or an objective has
                no derivative.
            SimulationError: a step failed or an event has no derivative (the state is that at the beginning); or there
                was no `reset`.
        """
        self._require(self.library.record > 0, "load the model with adjoint=True")
        require_list("by", by)
        states, chosen = self.states, self._chosen(steps, outputs, every)
        rows, size = steps // every + 1, (len(states), len(self.library.names["input"]), len(self.library.names["parameter"]))
        names = (*states, *self.library.names["input"], *self.library.names["parameter"])
        places = {name: i for i, name in enumerate(names)}
        trajectories = self._trajectories(inputs, steps)
        columns = Columns.of(by, trajectories)
        numbers = [self._place_of(places, name) for name in columns.plain.values()]
        start = self.time
        if isinstance(weights, str):
            weights = partial(weigh_each, renamed(weights), outputs=outputs)
        if callable(weights):
            begun = self.snapshot()
            run = self.forward_sensitivities(steps, outputs, [], every=every, inputs=inputs)
            weights = weights(run.times, run.values)
            self.restore(begun)
        weighed = np.ascontiguousarray(weights, dtype=np.float64)
        if weighed.ndim != 3 or weighed.shape[1:] != (rows, len(chosen)):
            raise ValueError(f"weights are {weighed.shape}, not (objectives, {rows}, {len(chosen)})")
        values, derivatives = np.empty((rows, len(chosen))), [np.empty((len(weighed), each)) for each in size]
        by_pieces = [np.empty((len(weighed), *trajectory.numbers.shape)) for trajectory in trajectories]
        records = 2 * (steps + rows)
        while True:
            tape, begun = np.empty((records, self.library.record)), self.snapshot()
            self._follow(trajectories, derivatives=by_pieces)
            status = self.library.adjoint_sensitivities(
                self.address, steps, len(chosen), chosen.ctypes.data, every, len(weighed), weighed.ctypes.data, values.ctypes.data,
                tape.ctypes.data, records, *(each.ctypes.data for each in derivatives),
            )  # fmt: skip
            if status != STATUSES["too_many_steps"].number or records > _MOST_RECORDS:
                break
            self.restore(begun)
            records *= 2
        if status:
            self._fail(status)
        times = np.linspace(start, self.time, rows)
        by_all = np.zeros((len(weighed), len(columns.names)))
        by_all[:, list(columns.plain)] = np.hstack(derivatives)[:, numbers]
        for i, by_piece in enumerate(by_pieces):
            for part, knots in columns.parts(i):
                by_all[:, part] = knots.apply_transposed(by_piece)
        return AdjointSensitivities(
            times=times, values=values, objectives=np.tensordot(weighed, values, 2),
            derivatives=by_all if initial_sensitivities is None else by_all + derivatives[0] @ self._begun(initial_sensitivities, states,
                columns.names),
            outputs=tuple(outputs), by=columns.names,
        )  # fmt: skip

    def initial_state_sensitivities(self, outputs: Sequence[str], by: Sequence[str]) -> StateSensitivities:
        """Derivatives of the scene's start with respect to parameters and inputs, and those of ``outputs``.

        The present state has to be that start.  Derivatives of states are fourth-order differences, those of outputs exact.

        Raises:
            TypeError: the model was loaded without derivatives.
            KeyError: there is no such output, parameter or input.
            ValueError: the present state is not the start, the start is trimmed, or not smooth in a parameter or input.
            SimulationError: no start was found, or the pose is singular.
        """
        require_list("by", by)
        if self.library.is_trimmed:
            raise ValueError("the start is trimmed; find_trim(..., by=[...]) has its derivatives")
        here, q = self.snapshot(), self.coordinates.array.copy()
        found = self.reset().coordinates.array.copy()
        self.restore(here)
        if np.abs(found - q).max(initial=0.0) > _AT_START:
            raise ValueError("the present state is not the scene's start; reset the simulation, without coordinates of your own")

        def begun(_: float) -> Array:
            start = self.reset()
            time, q, v = start.time, start.coordinates.array.copy(), start.speeds.array.copy()
            self.restore(here)
            self.set_state(time, q, v)
            return self.states.array.copy()

        states = np.zeros((len(self.states), len(by)))
        for i, name in enumerate(by):
            states[:, i] = self._differentiate(name, begun)
        values, derivatives = self.forward_sensitivities(0, outputs, by, initial_sensitivities=states).end
        return StateSensitivities(values=values, derivatives=derivatives, states=states, outputs=tuple(outputs), by=tuple(by))

    def _trajectories(self, inputs: Mapping[str, InputTrajectoryLike] | None, steps: int) -> tuple[InputTrajectory, ...]:
        return make_trajectories(self.library.names["input"], inputs or {}, self.time, steps, self.settings.step)

    def _follow(
        self, trajectories: Sequence[InputTrajectory], *, changes: Sequence[Array | None] = (), derivatives: Sequence[Array] = ()
    ) -> None:  # fmt: skip
        """Set the input trajectories of the next run, with their derivatives along its seeds, or arrays that receive derivatives."""
        if not trajectories:
            return
        records = (TrajectoryRecord * len(trajectories))()
        for i, (record, trajectory) in enumerate(zip(records, trajectories, strict=True)):
            change = changes[i] if changes else None
            record.input, record.jumps, record.pieces = trajectory.place, trajectory.jumps, len(trajectory.times)
            record.times, record.coefficients = trajectory.times.ctypes.data, trajectory.numbers.ctypes.data
            record.seeds = None if change is None else change.ctypes.data
            record.derivatives = derivatives[i].ctypes.data if derivatives else None
        self._call(self.library.set_input_trajectories, len(trajectories), records)

    def _record_events(self, most: int, seeds: int, outputs: int) -> Callable[[], EventSensitivities]:
        """Let the next run record at most ``most`` events; returns a function that makes the record after the run."""
        found, which = ctypes.c_int(0), np.empty(most, dtype=np.intc)
        arrays = [np.empty(shape) for shape in ((most,), (most, seeds), (most, outputs), (most, outputs, seeds))]
        if most and self.library.has("record_events"):
            self._call(self.library.record_events, most, ctypes.byref(found), which.ctypes.data, *(each.ctypes.data for each in arrays))

        def make() -> EventSensitivities:
            number = min(found.value, most)
            times, derivatives_of_times, values, derivatives = (each[:number] for each in arrays)
            return EventSensitivities(
                names=tuple(self.library.names["event"][i] for i in which[:number]), times=times,
                derivatives_of_times=derivatives_of_times, values=values, derivatives=derivatives,
            )  # fmt: skip

        return make

    @staticmethod
    def _begun(initial_sensitivities: Array, states: Values, by: Sequence[str]) -> Array:
        if (shape := np.shape(initial_sensitivities)) != (len(states), len(by)):
            raise ValueError(f"initial_sensitivities: it is {shape}, not ({len(states)}, {len(by)}), states and numbers")
        return np.asarray(initial_sensitivities, dtype=np.float64)

    def _place_of(self, places: Mapping[str, int], name: str) -> int:
        """The index of a quantity with respect to which a run is differentiated."""
        if name not in places and name in (*self.library.names["coordinate"], *self.library.names["speed"]):
            chosen = ", ".join([*self.states][: self._require_dofs()])
            raise KeyError(f"'{name}' is no independent coordinate now ({chosen} are): call choose_independent() with its rate first")
        return find_number(places, name)

    def _chosen(self, steps: int, outputs: Sequence[str], every: int) -> Any:
        for what, number, least in (("steps", steps, 0), ("every", every, 1)):
            require_whole(what, number, least)
        if steps % every:
            raise ValueError(f"every: {every} does not divide the {steps} steps")
        require_list("outputs", outputs)
        for kind, numbers in (("parameter", self.parameters), ("input", self.inputs)):
            for name, value in numbers.items():
                if isinf(value) or (isnan(value) and kind == "parameter"):
                    raise ValueError(f"{kind} '{name}' is {value}; give it a finite number")
        return np.array([self.outputs.place(name) for name in outputs], dtype=np.intc)
