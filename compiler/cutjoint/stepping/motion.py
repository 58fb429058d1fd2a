"""Starts, steps and inputs of a simulation."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from dataclasses import replace
from typing import Self

import numpy as np

from cutjoint.emit.statuses import LIMITED
from cutjoint.methods import describe_steps
from cutjoint.package.renamed import accept_old_names
from cutjoint.stepping.handle import Handle
from cutjoint.stepping.library import StatisticsRecord
from cutjoint.stepping.values import Array, StepStatistics, find_place

OVER_EVENTS = f"these steps do not end at events: load the model by {describe_steps(lambda s: s.finds_events)}"


class Motion(Handle):
    """A simulation that starts, takes steps and follows inputs."""

    def reset(
        self, *, coordinates: Mapping[str, float] | None = None, speeds: Mapping[str, float] | None = None, dt: float | None = None,
        iterations: int | None = None, tolerance: float | None = None, equilibrium: bool | None = None,
    ) -> Self:  # fmt: skip
        """Start at time 0 from the scene's start, and return the simulation; settings and chosen independent coordinates stay.

        Args:
            coordinates, speeds: other initial values (SI units) of joints of the spanning tree, for this start alone.
            dt: step size (s); of adaptive integrators the interval of `step`.
            iterations: fixed number in each trapezoidal step of recursive; with rk4 of multiplier updates in each evaluation;
                0: to convergence, at most those of the scene.
            tolerance: relative and absolute error of a step of adaptive integrators; the absolute one times nominal values.
            equilibrium: whether to start at a static equilibrium; False takes the pose as given.

        Raises:
            TypeError: the integrator has no iterations, or no tolerance.
            KeyError: there is no such coordinate or speed.
            RunError: no pose has the values of the scene's `assemble`.
            SimulationError: a setting is out of its range, or no consistent state was found.
        """
        call, library = self._call, self.library
        if dt is not None:
            call(library.set_step, dt)
            self._settings = replace(self._settings, step=dt)
        if iterations is not None:
            self._require(library.steps.is_iterated, f"iterations are of {describe_steps(lambda s: s.is_iterated)}")
            call(library.set_iterations, iterations)
        if tolerance is not None:
            self._require(library.steps.adaptive, "a tolerance is of integrators that choose their steps")
            call(library.set_tolerance, tolerance, tolerance)
            self._settings = replace(self._settings, tolerance=tolerance)
        if equilibrium is not None:
            call(library.set_equilibrium, int(equilibrium))
        call(library.reset_start)
        if library.find_start is not None:
            begun = library.find_start(dict(self.parameters))
            coordinates, speeds = ({**found, **(chosen or {})} for found, chosen in zip(begun, (coordinates, speeds), strict=True))
        for kind, values, put in (("coordinate", coordinates, library.set_start_coordinate), ("speed", speeds, library.set_start_speed)):
            places = {name: i for i, name in enumerate(library.names[f"start_{kind}"])}
            for name, value in (values or {}).items():
                call(put, find_place(places, name), value)
        call(library.start)
        self._is_started = True
        if self._independent is not None:
            call(library.choose_independent_speeds, self._independent)
        return self

    def step(self) -> None:
        """Take one step: ``dt`` of `reset`, else the scene's ``output_step``, which adaptive integrators cover by one or more steps.

        Raises:
            SimulationError: the step failed, and the state stays; or there was no `reset`.
        """
        if status := self.library.step(self.address):
            self._fail(status)

    def advance(self, time: float) -> None:
        """Take steps up to a time (s), the last one shorter if needed.

        Raises:
            SimulationError: a step failed, the time has passed, or there was no `reset`.
        """
        self._call(self.library.advance, time)

    def advance_to_event(self, time: float) -> str | None:
        """Take steps up to a time (s) or the first event, and return the event's element or None.

        Raises:
            TypeError: steps do not end at events.
            SimulationError: a step failed, the time has passed, or there was no `reset`.
        """
        self._require(self.library.steps.finds_events, OVER_EVENTS)
        event = ctypes.c_int(-1)
        self._call(self.library.advance_to_event, time, ctypes.byref(event))
        return None if event.value < 0 else self.library.names["event"][event.value]

    def run(self, steps: int) -> Array:
        """Take a number of steps and return the outputs at the end of each, (steps, outputs).

        Raises:
            SimulationError: a step failed, or there was no `reset`.
        """
        rows = np.empty((steps, len(self.library.names["output"])))
        self._call(self.library.run, steps, rows.ctypes.data)
        return rows

    @property
    def last_step(self) -> StepStatistics:
        """Statistics of the last step; of adaptive integrators, of all steps of the last call.

        Raises:
            SimulationError: there was no `reset`.
        """
        record = StatisticsRecord()
        self._call(self.library.last_step, ctypes.byref(record))
        equation = None if record.equation < 0 else self.library.names["equation"][record.equation]
        return StepStatistics(**{name: getattr(record, name) for name in LIMITED}, equation=equation)

    @accept_old_names
    def set_limits(self, **limits: float) -> None:
        """Limit numbers of `last_step`: ``pivot`` from below, others from above; infinity, for ``pivot`` 0, removes a limit.

        A step beyond a limit is made and raises a `SimulationError`; the motion may continue.  Snapshots do not contain limits.

        Raises:
            KeyError: there is no such number.
            SimulationError: a limit is below 0 or no number.
        """
        places = {name: i for i, name in enumerate(LIMITED)}
        for place, limit in [(find_place(places, name), limit) for name, limit in limits.items()]:
            self._call(self.library.set_limit, place, limit)
        self._limits |= limits

    def set_input(self, name: str, value: float, rate: float = 0.0, acceleration: float = 0.0) -> None:
        """Set an input now, with derivatives (SI units) by which it continues until it is set again.

        Raises:
            KeyError: there is no such input.
            SimulationError: a number is not finite.
        """
        self._call(self.library.set_input, self.inputs.place(name), value, rate, acceleration)

    def get_input(self, name: str) -> float:
        """Value of an input at the present time, set or from the scene.

        Raises:
            KeyError: there is no such input.
            SimulationError: there was no `reset`.
        """
        self._require_start()
        return float(self.library.input(self.address, self.inputs.place(name)))
