"""One simulation of a model."""

from __future__ import annotations

import ctypes
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from math import isinf, isnan
from numbers import Integral
from typing import Any

import numpy as np

from cutjoint.emit.statuses import LIMITED, STATUSES
from cutjoint.formulate.recursive.quantities import NUMBERS_PER_POSE, digest_of_poses
from cutjoint.package.errors import CutjointError
from cutjoint.package.renamed import renamed, with_old_members, with_old_words
from cutjoint.run.settings import StepSettings
from cutjoint.stepping.library import Library, StatisticsRecord, TrajectoryRecord
from cutjoint.stepping.trajectories import Columns, InputTrajectory, InputTrajectoryLike, make_trajectories
from cutjoint.stepping.values import (
    STEPS_BESIDE,
    AdjointSensitivities,
    Array,
    EigenvalueSensitivities,
    EventSensitivities,
    ForwardSensitivities,
    Outputs,
    Poses,
    StateSensitivities,
    StateSpace,
    StepDerivatives,
    StepStatistics,
    Values,
    difference,
    find_eigenvalues,
    find_place,
    is_non_smooth,
    weigh_each,
)

_WITHOUT_ADJOINT = "load the model with adjoint=True"
_NOT_LINEARISED = "load the model with linearise=True"
_WITHOUT_STEP_DERIVATIVES = (
    "derivatives of steps are of method recursive, or of recursive-newton with integrator trapezoidal, radau5 or radau5-fixed"
)
_WITHOUT_POSES = "load the model with poses=True"
_OVER_EVENTS = "steps of the trapezoidal rule go over events: load the model with rk4, or method recursive-newton with radau5-fixed"

#: How many records a run may take.
_MOST_RECORDS = 1 << 24

#: Rates of states (SI units) that count as rest, and singular values, as a share of the largest, of directions in which a pose may go on.
_AT_REST, _SINGULAR = 1e-3, 1e-11

#: A distance of coordinates (SI units) of two starts by the same numbers.
_AT_START = 1e-9

#: The step of a difference, as a share of the number, and in its unit of nought.
_SHARE, _SHARE_OF_NOUGHT = 1e-3, 1e-4

#: Shares of that step which are tried where differences of two widths do not agree.
_NARROWER = (1.0, 1 / 16, 1 / 256)

#: Characters of what a library says of a failure.
_TEXT = 600


class SimulationError(CutjointError):
    """A start or a step that failed; ``status`` is that of the C interface, above 0 for a motion that cannot go on."""

    def __init__(self, text: str, status: int) -> None:
        super().__init__(text)
        self.status = status

    def __reduce__(self) -> tuple[type[SimulationError], tuple[str, int]]:
        return type(self), (str(self), self.status)


@with_old_members
class Simulation:
    """A simulation of a model: `reset` finds a consistent start, `step` and `advance` continue; SI units.

    ``inputs`` and ``parameters`` may change between steps; an input that is NaN follows the scene.  ``coordinates``, ``speeds`` and
    ``outputs`` are those of the present state; their arrays are views, except those of outputs and accelerations.
    """

    def __init__(self, library: Library) -> None:
        self.library = library
        size = library.size
        self._memory = np.zeros(size // 8)
        self.address = library.create(self._memory.ctypes.data, size)
        self.parameters = Values(library.names["parameter"], self._view("parameters", "parameter"), library.units["parameter"])
        self.inputs = Values(library.names["input"], self._view("inputs", "input"), library.units.get("input"))
        self._is_started = False
        self._limits: dict[str, float] = {}
        self._settings = library.settings

    def __repr__(self) -> str:
        return f"<Simulation of '{self.library.model}' at {self.time:.6g} s>"

    @property
    def settings(self) -> StepSettings:
        """Settings of the steps: those of the scene, or those that `reset` was given."""
        return self._settings

    def _view(self, array: str, kind: str) -> Array:
        names = self.library.names[kind]
        return np.ctypeslib.as_array(self.library.arrays[array](self.address), (len(names),)) if names else np.zeros(0)

    def reset(
        self, *, coordinates: Mapping[str, float] | None = None, speeds: Mapping[str, float] | None = None, dt: float | None = None,
        iterations: int | None = None, tolerance: float | None = None, equilibrium: bool | None = None,
    ) -> Simulation:  # fmt: skip
        """Start at time 0 from the scene's start, and return the simulation; settings given here stay.

        Args:
            coordinates, speeds: other initial values (SI units) of joints of the spanning tree, for this start alone.
            dt: step size (s); of adaptive integrators the interval of `step`.
            iterations: fixed number in each step of the trapezoidal rule of recursive; 0: as many as it takes.
            tolerance: relative and absolute error of a step of adaptive integrators (SI units).
            equilibrium: whether to start at a static equilibrium; False takes the pose as given.

        Raises:
            TypeError: the integrator has no iterations, or no tolerance.
            KeyError: there is no such coordinate or speed.
            RunError: no pose has what the scene assembles.
            SimulationError: a setting is out of its range, or no consistent state was found.
        """
        call, library = self._call, self.library
        if dt is not None:
            call(library.set_step, dt)
            self._settings = replace(self._settings, step=dt)
        if iterations is not None:
            self._require(library.steps.is_iterated, "iterations are of the trapezoidal rule of method recursive")
            call(library.set_iterations, iterations)
        if tolerance is not None:
            self._require(library.steps.adaptive, "a tolerance is of integrators that choose their steps")
            call(library.set_tolerance, tolerance, tolerance)
            self._settings = replace(self._settings, tolerance=tolerance)
        if equilibrium is not None:
            call(library.set_equilibrium, int(equilibrium))
        call(library.reset_start)
        if library.begin is not None:
            begun = library.begin(dict(self.parameters))
            coordinates, speeds = ({**found, **(given or {})} for found, given in zip(begun, (coordinates, speeds), strict=True))
        for kind, given, give in (("coordinate", coordinates, library.set_start_coordinate), ("speed", speeds, library.set_start_speed)):
            places = {name: i for i, name in enumerate(library.names[f"start_{kind}"])}
            for name, value in (given or {}).items():
                call(give, find_place(places, name), value)
        call(library.start)
        self._is_started = True
        return self

    def step(self) -> None:
        """Take one step.

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
            TypeError: the integrator goes over events: it is the trapezoidal rule.
            SimulationError: a step failed, the time has passed, or there was no `reset`.
        """
        self._require(self.library.steps.finds_events, _OVER_EVENTS)
        event = ctypes.c_int(-1)
        self._call(self.library.advance_to_event, time, ctypes.byref(event))
        return None if event.value < 0 else self.library.event_names[event.value]

    def run(self, steps: int) -> Array:
        """Take a number of steps and return the outputs at the end of each, (steps, outputs).

        Raises:
            SimulationError: a step failed, or there was no `reset`.
        """
        rows = np.empty((steps, len(self.library.names["output"])))
        self._call(self.library.run, steps, rows.ctypes.data)
        return rows

    @property
    def time(self) -> float:
        """The present time (s)."""
        return float(self.library.time(self.address))

    @property
    def outputs(self) -> Outputs:
        """Outputs of the scene at the present state, by name; ``array`` copies them.

        Raises:
            SimulationError: there was no `reset`.
        """
        self._require_start()
        return self._outputs

    @cached_property
    def _outputs(self) -> Outputs:
        names, evaluate, address = self.library.names["output"], self.library.outputs, self.address
        memory = np.ctypeslib.as_array(evaluate(address), (len(names),)) if names else np.zeros(0)
        return Outputs(names, memory, self.library.units["output"], lambda: evaluate(address))

    @property
    def coordinates(self) -> Values:
        """Coordinates of the joints of the spanning tree, by name; `set_state` changes them.

        Of the method augmented: natural coordinates, points (m) and unit vectors in global axes, and angles (rad).

        Raises:
            SimulationError: there was no `reset`.
        """
        self._require_start()
        return self._coordinates

    @cached_property
    def _coordinates(self) -> Values:
        return self._state("coordinates", "coordinate")

    @property
    def speeds(self) -> Values:
        """Velocities of the coordinates, by name; `set_state` changes them.

        Raises:
            SimulationError: there was no `reset`.
        """
        self._require_start()
        return self._speeds

    @cached_property
    def _speeds(self) -> Values:
        return self._state("speeds", "speed")

    @property
    def accelerations(self) -> Values:
        """Copy of the accelerations at the present state, by the names of the velocities.

        Raises:
            SimulationError: there was no `reset`.
        """
        self._require_start()
        names = self.library.names["speed"]
        return Values(names, np.array(self.library.arrays["accelerations"](self.address)[: len(names)]))

    @property
    def poses(self) -> Poses:
        """Poses of bodies, markers and wheel contacts at the present state; earlier arrays are updated too.

        Raises:
            TypeError: the model was loaded without poses.
            SimulationError: there was no `reset`.
        """
        self._require(self.library.has_poses, _WITHOUT_POSES)
        self._require_start()
        self.library.poses(self.address)
        return self._poses

    def pose_datagram(self) -> bytes:
        """Datagram for ``cutjoint view --live``: digest, time and poses, little-endian.

        Raises:
            TypeError, SimulationError: as of ``poses``.
        """
        poses = self.poses
        head = struct.pack("<Qd", digest_of_poses(self.library.model, poses.names), self.time)
        return head + poses.array.astype("<f8").tobytes()

    @cached_property
    def _poses(self) -> Poses:
        names = self.library.names["pose"]
        return Poses(names, np.ctypeslib.as_array(self.library.poses(self.address), (len(names), NUMBERS_PER_POSE)))

    @property
    def constraint_violation(self) -> tuple[float, str | None]:
        """Largest violation (m or rad) of a loop equation as a share of its limit, and its name; 0 and None without equations.

        Raises:
            SimulationError: there was no `reset`.
        """
        self._require_start()
        equation = ctypes.c_int(-1)
        gap = float(self.library.constraint_violation(self.address, ctypes.byref(equation)))
        return gap, None if equation.value < 0 else self.library.names["equation"][equation.value]

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

    @with_old_words
    def set_limits(self, **limits: float) -> None:
        """Limit statistics of `last_step`: a minimum of the pivot, maxima of the others; infinity, for the pivot 0, is none.

        A step beyond a limit is made and raises a `SimulationError`; the motion may continue.  Snapshots do not contain limits.

        Raises:
            KeyError: there is no such number.
            SimulationError: a limit is below 0 or no number.
        """
        places = {name: i for i, name in enumerate(LIMITED)}
        for place, limit in [(find_place(places, name), limit) for name, limit in limits.items()]:
            self._call(self.library.set_limit, place, limit)
        self._limits |= limits

    def _state(self, array: str, kind: str) -> Values:
        view = self._view(array, kind)
        view.flags.writeable = False
        return Values(self.library.names[kind], view)

    def set_input(self, name: str, value: float, rate: float = 0.0, acceleration: float = 0.0) -> None:
        """Set an input now, with derivatives (SI units) by which it continues until it is set again.

        Raises:
            KeyError: there is no such input.
            SimulationError: a number is not finite.
        """
        place = find_place({each: i for i, each in enumerate(self.library.names["input"])}, name)
        self._call(self.library.set_input, place, value, rate, acceleration)

    def get_input(self, name: str) -> float:
        """Value of an input at the present time, set or from the scene.

        Raises:
            KeyError: there is no such input.
            SimulationError: there was no `reset`.
        """
        self._require_start()
        return float(self.library.input(self.address, find_place({each: i for i, each in enumerate(self.library.names["input"])}, name)))

    def set_state(self, time: float, coordinates: Array, speeds: Array) -> None:
        """Continue from a time (s), coordinates and velocities as they are, in the order of the simulation.

        Raises:
            ValueError: an array has another length.
            SimulationError: a number is not finite, an acceleration has no finite value, or there was no `reset`.
        """
        q, v = (np.ascontiguousarray(x, dtype=np.float64) for x in (coordinates, speeds))
        lengths = tuple(len(self.library.names[kind]) for kind in ("coordinate", "speed"))
        if (q.shape, v.shape) != ((lengths[0],), (lengths[1],)):
            raise ValueError(f"there are {lengths[0]} coordinates and {lengths[1]} speeds, not {q.shape} and {v.shape}")
        self._call(self.library.set_state, time, q.ctypes.data, v.ctypes.data)

    def displace(self, displacements: Array) -> None:
        """Move the coordinates by small displacements, one for each velocity (rotations for balls), and close the loops again.

        Raises:
            ValueError: there is another number of speeds.
            SimulationError: the loops do not close there, a number is not finite, or there was no `reset`.
        """
        by = np.ascontiguousarray(displacements, dtype=np.float64)
        if by.shape != (count := len(self.library.names["speed"]),):
            raise ValueError(f"there are {count} speeds, not {by.shape}")
        self._call(self.library.displace, by.ctypes.data)

    @property
    def constraint_jacobian(self) -> Array:
        """Jacobian (equations, velocities) of the loop equations; of natural coordinates also of the bodies' equations.

        Raises:
            SimulationError: there was no `reset`.
        """
        columns = np.empty((len(self.library.names["speed"]), self.library.equations))
        self._call(self.library.constraint_jacobian, columns.ctypes.data)
        return columns.T

    def choose_independent(self, speeds: Sequence[str] | None = None) -> None:
        """Choose the independent coordinates by the names of their ``speeds``, one for each degree of freedom.

        Without ``speeds`` those are chosen that the others follow slowly.

        Raises:
            TypeError: the model was loaded without derivatives.
            KeyError: there is no such speed.
            ValueError: there are others than one different name for each degree of freedom.
            SimulationError: the other coordinates do not follow from these, or there was no `reset`.
        """
        dofs = self._require_dofs()
        if speeds is None:
            self._call(self.library.choose_independent)
            return
        names = self.library.names["speed"]
        numbers = [find_place({each: i for i, each in enumerate(names)}, name) for name in speeds]
        if len(set(numbers)) != dofs or len(numbers) != dofs:
            raise ValueError(f"there are {dofs} degrees of freedom, and so many different speeds to choose, not {', '.join(speeds)}")
        self._call(self.library.choose_independent_speeds, (ctypes.c_int * dofs)(*numbers))

    @property
    def is_ill_conditioned(self) -> bool:
        """Whether `choose_independent` should be called again: a ball has rotated far, or dependent coordinates move fast.

        Raises:
            TypeError: the model was loaded without derivatives.
        """
        self._require_dofs()
        return bool(self.library.is_ill_conditioned(self.address))

    @property
    def states(self) -> Values:
        """Independent coordinates, their rates, then first-order states, by name.

        A ball has its rotation from the pose in which they were chosen.

        Raises:
            TypeError: the model was loaded without derivatives.
            SimulationError: there was no `reset`.
        """
        numbers = np.zeros(2 * self._require_dofs() + self.library.states)
        self._call(self.library.get_minimal_state, numbers.ctypes.data)
        numbers.flags.writeable = False
        return Values([self.library.state_name(self.address, i).decode() for i in range(len(numbers))], numbers)

    def set_states(self, states: Array, time: float | None = None) -> None:
        """Continue from ``states`` (SI units) at a time (s), by default the present one.

        Dependent coordinates and velocities follow from closed loops.

        Raises:
            TypeError: the model was loaded without derivatives.
            ValueError: there is another number of states.
            SimulationError: loops do not close there, a number is not finite, or there was no `reset`.
        """
        x = np.ascontiguousarray(states, dtype=np.float64)
        if x.shape != (count := 2 * self._require_dofs() + self.library.states,):
            raise ValueError(f"there are {count} states, not {x.shape}")
        self._call(self.library.set_minimal_state, self.time if time is None else time, x.ctypes.data)

    def linearise(self) -> StateSpace:
        """Linear model about the present state: x' = A x + B u, y = C x + D u.

        Raises:
            TypeError: the model was loaded without derivatives.
            SimulationError: the pose is singular, an acceleration has no finite derivative, or there was no `reset`.
        """
        states = self.states
        n, inputs, outputs = len(states), *(self.library.names[kind] for kind in ("input", "output"))
        A, B, C, D = matrices = [np.zeros((r, c)) for r in (n, len(outputs)) for c in (n, len(inputs))]
        self._call(self.library.linearise, *(matrix.ctypes.data for matrix in matrices))
        rates = [np.zeros_like(of) for of in (B, B, D, D)]
        if self.library.moves_joints:
            self._call(self.library.linearise_rates, *(matrix.ctypes.data for matrix in rates))
        B_rate, B_acceleration, D_rate, D_acceleration = rates
        return StateSpace(
            A=A, B=B, B_rate=B_rate, B_acceleration=B_acceleration, C=C, D=D, D_rate=D_rate, D_acceleration=D_acceleration,
            x=states.array, states=tuple(states), inputs=inputs, outputs=outputs,
        )  # fmt: skip

    def equilibrium_sensitivities(self, outputs: Sequence[str], by: Sequence[str]) -> StateSensitivities:
        """Derivatives of the present static equilibrium by parameters and inputs, and those of ``outputs``.

        They follow from the implicit function theorem.  Of a continuum of equilibria, as of a car that may stand anywhere, it is the
        nearest one.

        Raises:
            TypeError: the model was loaded without derivatives.
            KeyError: there is no such output, parameter or input.
            ValueError: the mechanism is not at rest, or rests in no pose near by with another number.
            SimulationError: the pose is singular, or there was no `reset`.
        """
        _require_list("by", by)
        _require_list("outputs", outputs)
        near = self.linearise()
        parameters = self.library.names["parameter"]
        E, F = np.zeros((len(near.states), len(parameters))), np.zeros((len(near.outputs), len(parameters)))
        self._call(self.library.linearise_parameters, E.ctypes.data, F.ctypes.data)
        places = {name: i for i, name in enumerate((*near.inputs, *parameters))}
        numbers = [find_place(places, name) for name in by]
        rates = np.zeros(len(near.states))
        self._call(self.library.minimal_state_derivatives, rates.ctypes.data)
        if not np.abs(rates).max(initial=0.0) <= _AT_REST:
            raise ValueError(
                f"the mechanism moves: a state changes by {np.abs(rates).max():.3g} (SI units) in a second; begin at rest, or "
                "take `initial_state_sensitivities`, on the command line --objective start, of a start that moves"
            )
        pushed = np.hstack([near.B, E])[:, numbers]
        states = np.asarray(-np.linalg.lstsq(near.A, pushed, rcond=_SINGULAR)[0], dtype=np.float64)
        left, size = np.abs(near.A @ states + pushed).max(axis=0), np.abs(pushed).max(axis=0)
        for name, rest in zip(by, left > 1e-6 * size, strict=True):
            if rest:
                raise ValueError(f"with another '{name}' the mechanism rests in no pose near this one")
        chosen = [self.outputs.place(name) for name in outputs]
        derivatives = (near.C @ states + np.hstack([near.D, F])[:, numbers])[chosen]
        values = self.outputs.array[chosen]
        return StateSensitivities(values=values, derivatives=derivatives, states=states, outputs=tuple(outputs), by=tuple(by))

    def initial_state_sensitivities(self, outputs: Sequence[str], by: Sequence[str]) -> StateSensitivities:
        """Derivatives of the scene's start by parameters and inputs, and those of ``outputs``.

        The present state has to be that start.  States are differentiated by fourth-order differences of starts, outputs exactly.

        Raises:
            TypeError: the model was loaded without derivatives, or its steps have none.
            KeyError: there is no such output, parameter or input.
            ValueError: the present state is not the start, or it has a kink at a number.
            SimulationError: no start was found, or the pose is singular.
        """
        _require_list("by", by)
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

    def eigenvalue_sensitivities(self, by: Sequence[str], modes: Sequence[int] | None = None) -> EigenvalueSensitivities:
        """Eigenvalues of the linear model at the present state, and their derivatives by parameters and inputs.

        At a static equilibrium the change of the pose is included; elsewhere the states stay.  The derivative of the matrix is by
        fourth-order differences of exact matrices.

        Args:
            modes: indices of modes by magnitude; default: all with a nonzero eigenvalue.

        Raises:
            TypeError: the model was loaded without derivatives.
            KeyError: there is no such parameter, input or mode.
            ValueError: an eigenvalue repeats, or a force has a kink at the state, so that there is no derivative; or as of
                `equilibrium_sensitivities`.
            SimulationError: the pose is singular, or there was no `reset`.
        """
        _require_list("by", by)
        near = self.linearise()
        rates = np.zeros(len(near.states))
        self._call(self.library.minimal_state_derivatives, rates.ctypes.data)
        is_at_rest = np.abs(rates).max(initial=0.0) <= _AT_REST
        ways = self.equilibrium_sensitivities([], by).states if is_at_rest else np.zeros((len(near.states), len(by)))

        def matrix(way: Array, change: float) -> Array:
            self.set_states(near.x + change * way)
            return self.linearise().A

        changes = [self._differentiate(name, partial(matrix, way)) for name, way in zip(by, ways.T, strict=True)]
        values, derivatives = find_eigenvalues(near.A, changes, modes)
        return EigenvalueSensitivities(values=values, derivatives=derivatives, by=tuple(by))

    def _differentiate(self, name: str, find: Callable[[float], Array]) -> Array:
        """The difference of fourth order of what is found where a number, a parameter or an input, has changed; the state stays.

        Raises:
            ValueError: it has a kink, or jumps, at the number.
        """
        here, numbers = self.snapshot(), self.parameters if name in self.parameters else self.inputs
        places = {each: i for i, each in enumerate((*self.parameters, *self.inputs))}
        value = self.parameters[name] if find_place(places, name) < len(self.parameters) else self.get_input(name)

        def beside(change: float) -> Array:
            try:
                numbers[name] = value + change
                return find(change)
            finally:
                self.restore(here)

        for share in _NARROWER:
            h = share * (_SHARE * abs(value) or _SHARE_OF_NOUGHT)
            found = [beside(steps * h) for steps in STEPS_BESIDE]
            if not is_non_smooth(found, h):
                return difference(found, h)
        raise ValueError(
            f"by '{name}' there is no derivative: what changes with it jumps or has a kink at this state, as where a damper has other "
            "rates for bump and rebound; make that law smooth here, or take a state beside it"
        )

    def step_derivatives(self) -> StepDerivatives:
        """Take one step, and differentiate its end by its beginning, by inputs (zero-order hold) and by parameters.

        Outputs of controllers and inputs that follow the scene stay constant.

        Raises:
            TypeError: the model was loaded without derivatives, or its steps have none.
            SimulationError: the step failed, ended at an event or was taken in parts, and the state stays; or there was no `reset`.
        """
        states = self.states
        self._require(self.library.derives_steps, _WITHOUT_STEP_DERIVATIVES)
        n, inputs, parameters = len(states), *(self.library.names[kind] for kind in ("input", "parameter"))
        by_state, by_input, by_parameter = matrices = [np.zeros((n, width)) for width in (n, len(inputs), len(parameters))]
        self._call(self.library.step_derivatives, *(matrix.ctypes.data for matrix in matrices))
        return StepDerivatives(
            by_state=by_state, by_input=by_input, by_parameter=by_parameter, start=states.array, end=self.states.array,
            states=tuple(states), inputs=inputs, parameters=parameters,
        )  # fmt: skip

    def forward_sensitivities(
        self, steps: int, outputs: Sequence[str], by: Sequence[str], *, every: int = 1, initial_sensitivities: Array | None = None,
        events: int = 0,
        inputs: Mapping[str, InputTrajectoryLike] | None = None,
    ) -> ForwardSensitivities:  # fmt: skip
        """Take a number of steps, with the derivatives of outputs by parameters, inputs and initial states.

        Each step is differentiated as it was taken, over events too.

        Args:
            outputs: names of outputs.
            by: names of parameters, of inputs (a constant shift), and of ``states`` at the beginning.
            every: steps between samples.
            initial_sensitivities: (states, by) derivatives of the initial states by parameters; default: none.
            events: number of events to record.
            inputs: input trajectories for this run: arrays (zero-order hold) or tables as of `simulate`.  Such an input in ``by``
                stands for all its values, ``name[0]`` on; ``name.rate`` for the rates of its table.

        Raises:
            TypeError: the model was loaded without derivatives, its steps have none, or go over events that are asked for.
            KeyError: there is no such output, parameter, input or state.
            ValueError: ``every`` does not divide the steps, there are fewer than none, or events are asked for by nothing.
            SimulationError: a step failed, an event has no derivative, or there was no `reset`; the state before the step stays.
        """
        states = self.states
        self._require(self.library.derives_steps, _WITHOUT_STEP_DERIVATIVES)
        _require_list("by", by)
        _require_whole("events", events, 0)
        if events:
            self._require(self.library.steps.finds_events, _OVER_EVENTS)
            if not by:
                raise ValueError("events are told with their derivatives: name numbers by which they change")
        chosen = self._chosen(steps, outputs, every)
        trajectories = self._trajectories(inputs, steps)
        columns = Columns.of(by, trajectories)
        places = {name: i for i, name in enumerate((*self.library.names["input"], *self.library.names["parameter"], *states))}
        numbers = np.full(len(columns.names), -1, dtype=np.intc)
        matrix = np.zeros((self.library.seed_rows, len(numbers)))
        for column, name in columns.plain.items():
            place = find_place(places, name)
            if name in states:
                matrix[states.place(name), column] = 1.0
            else:
                numbers[column] = place
        if initial_sensitivities is not None:
            matrix[: len(states)] += self._begun(initial_sensitivities, states, columns.names)
        start, rows = self.time, steps // every + 1
        values, derivatives = np.empty((rows, len(chosen))), np.empty((rows, len(chosen), len(numbers)))
        tell = self._record_events(events, len(numbers), len(chosen))
        changes = columns.changes(trajectories)
        self._follow(trajectories, changes=changes)
        self._call(
            self.library.forward_sensitivities, steps, len(numbers), numbers.ctypes.data, matrix.ctypes.data, len(chosen),
            chosen.ctypes.data,
            every, values.ctypes.data, derivatives.ctypes.data,
        )  # fmt: skip
        at = tell() if events else None
        times = np.linspace(start, self.time, rows)
        return ForwardSensitivities(times=times, values=values, derivatives=derivatives, outputs=tuple(outputs), by=columns.names,
            events=at)

    def _trajectories(self, inputs: Mapping[str, InputTrajectoryLike] | None, steps: int) -> tuple[InputTrajectory, ...]:
        """The courses of inputs of a run of so many steps from now on."""
        return make_trajectories(self.library.names["input"], inputs or {}, self.time, steps, self.settings.step)

    def _follow(
        self, trajectories: Sequence[InputTrajectory], *, changes: Sequence[Array | None] = (), derivatives: Sequence[Array] = ()
    ) -> None:  # fmt: skip
        """Let the next run follow courses, with their changes along its directions, or room for slopes."""
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

    def _record_events(self, most: int, directions: int, outputs: int) -> Callable[[], EventSensitivities]:
        """Let the next run tell its events, ``most`` at most; returns the maker of their record behind it."""
        found, which = ctypes.c_int(0), np.empty(most, dtype=np.intc)
        told = [np.empty(shape) for shape in ((most,), (most, directions), (most, outputs), (most, outputs, directions))]
        if most and self.library.records_events:
            self._call(self.library.record_events, most, ctypes.byref(found), which.ctypes.data, *(each.ctypes.data for each in told))

        def make() -> EventSensitivities:
            number = min(found.value, most)
            times, derivatives_of_times, values, derivatives = (each[:number] for each in told)
            names = tuple(self.library.event_names[i] for i in which[:number])
            return EventSensitivities(names=names, times=times, derivatives_of_times=derivatives_of_times, values=values,
                derivatives=derivatives)

        return make

    def adjoint_sensitivities(
        self, steps: int, outputs: Sequence[str], by: Sequence[str], weights: Array | str | Callable[[Array, Array], Array], *,
        every: int = 1, initial_sensitivities: Array | None = None, inputs: Mapping[str, InputTrajectoryLike] | None = None,
    ) -> AdjointSensitivities:  # fmt: skip
        """Take a number of steps, with the derivatives of objectives by any number of parameters, inputs and initial states.

        The cost is some runs for each objective, however many names ``by`` has.

        Args:
            outputs, by, every, inputs: as of `forward_sensitivities`.
            weights: (objectives, samples, outputs), whose sums with the samples are the objectives; or a function of times and
                values that returns them; or "end", "integral", "mean", "rms", "maximum" or "minimum" of each output.

        Raises:
            TypeError: the model was loaded without ``adjoint``.
            KeyError: there is no such output, parameter, input or state.
            ValueError: ``every`` does not divide the steps, or there are fewer than none, weights have another shape, or an objective has
                no derivative.
            SimulationError: a step failed, or an event has no derivative, and the state is that at the beginning; or there was no
                `reset`.
        """
        self._require(self.library.record > 0, _WITHOUT_ADJOINT)
        _require_list("by", by)
        states, chosen = self.states, self._chosen(steps, outputs, every)
        rows, size = steps // every + 1, (len(states), len(self.library.names["input"]), len(self.library.names["parameter"]))
        names = (*states, *self.library.names["input"], *self.library.names["parameter"])
        places = {name: i for i, name in enumerate(names)}
        trajectories = self._trajectories(inputs, steps)
        columns = Columns.of(by, trajectories)
        numbers = [find_place(places, name) for name in columns.plain.values()]
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
                by_all[:, part] = knots.gather(by_piece)
        return AdjointSensitivities(
            times=times, values=values, objectives=np.tensordot(weighed, values, 2),
            derivatives=by_all if initial_sensitivities is None else by_all + derivatives[0] @ self._begun(initial_sensitivities, states,
                columns.names),
            outputs=tuple(outputs), by=columns.names,
        )  # fmt: skip

    @staticmethod
    def _begun(initial_sensitivities: Array, states: Values, by: Sequence[str]) -> Array:
        """The changes of states at the beginning of a run."""
        if np.shape(initial_sensitivities) != (len(states), len(by)):
            raise ValueError(
                f"initial_sensitivities: it is {np.shape(initial_sensitivities)}, not ({len(states)}, {len(by)}), states and numbers"
            )
        return np.asarray(initial_sensitivities, dtype=np.float64)

    def _chosen(self, steps: int, outputs: Sequence[str], every: int) -> Any:
        """The numbers of outputs in rows of a run."""
        for what, number, least in (("steps", steps, 0), ("every", every, 1)):
            _require_whole(what, number, least)
        if steps % every:
            raise ValueError(f"{steps} steps are no multiple of {every}, behind which there is a row each")
        _require_list("outputs", outputs)
        for kind, numbers in (("parameter", self.parameters), ("input", self.inputs)):
            for name, value in numbers.items():
                if isinf(value) or (isnan(value) and kind == "parameter"):
                    raise ValueError(f"{kind} '{name}' is {value}; give it a finite number")
        return np.array([self.outputs.place(name) for name in outputs], dtype=np.intc)

    def equations_of_motion(self) -> tuple[Array, Array]:
        """Mass matrix M (f, f) and force (f,) of M z'' = force for the f independent coordinates z; SI units.

        The force includes everything that acts, and velocity products.

        Raises:
            TypeError: the model was loaded without derivatives or without poses.
            SimulationError: the pose is singular, or there was no `reset`.
        """
        dofs = self._require_dofs()
        self._require(self.library.has_poses, _WITHOUT_POSES)
        mass, force = np.zeros((dofs, dofs)), np.zeros(dofs)
        self._call(self.library.equations_of_motion, mass.ctypes.data, force.ctypes.data)
        return mass, force

    def point_jacobian(self, name: str, point: Sequence[float] | None = None) -> Array:
        """Jacobian (6, f) of a point of a body by the rates of the independent coordinates, guides at rest.

        Three rows of the velocity, three of the angular velocity, in global axes.  A wrench (F, T) there adds J^T (F, T) to the force of
        `equations_of_motion`.

        Args:
            name: a body or marker.
            point: (3,) m, in the design position; default: the point of its pose.

        Raises:
            TypeError: the model was loaded without derivatives or without poses.
            KeyError: no body or marker has that name.
            ValueError: the point has not three numbers.
            SimulationError: the pose is singular, or there was no `reset`.
        """
        dofs = self._require_dofs()
        poses = self.poses
        place = poses.place(name)
        at = np.array(poses.point[place] if point is None else point, dtype=float)
        if at.shape != (3,):
            raise ValueError(f"point: {at.shape} numbers are no point; give three, where it is in the design position (m)")
        jacobian = np.zeros((6, dofs))
        self._call(self.library.point_jacobian, place, at.ctypes.data, jacobian.ctypes.data)
        return jacobian

    def _require_dofs(self) -> int:
        dofs = self.library.dofs
        self._require(dofs is not None, _NOT_LINEARISED)
        return int(dofs or 0)

    def snapshot(self) -> bytes:
        """Complete state as bytes; after `restore` the same steps follow bit for bit.

        Raises:
            SimulationError: there was no `reset`.
        """
        room = ctypes.create_string_buffer(self.library.snapshot_size())
        self._call(self.library.save, ctypes.addressof(room))
        return room.raw

    def restore(self, snapshot: bytes) -> None:
        """Continue from a snapshot of this or another simulation of the same model and scene.

        Raises:
            ValueError: the bytes are none.
        """
        room = ctypes.create_string_buffer(snapshot, len(snapshot))
        if self.library.restore(self.address, ctypes.addressof(room), len(snapshot)):
            raise ValueError(f"these bytes are no snapshot of '{self.library.model}'")
        self._is_started = True

    def copy(self) -> Simulation:
        """Copy the simulation with its state; without a `reset` only its parameters and inputs."""
        return _rebuilt(*self.__reduce__()[1])

    def __copy__(self) -> Simulation:
        return self.copy()

    def __deepcopy__(self, memo: object) -> Simulation:
        return self.copy()

    def __reduce__(self) -> tuple[Callable[..., Simulation], tuple[Library, bytes | None, Array, Array, dict[str, float], StepSettings]]:
        snapshot = self.snapshot() if self._is_started else None
        arrays = self.parameters.array.copy(), self.inputs.array.copy()
        return _rebuilt, (self.library, snapshot, *arrays, self._limits, self._settings)

    @staticmethod
    def _require(able: bool, advice: str) -> None:
        if not able:
            raise TypeError(advice)

    def _require_start(self) -> None:
        if not self._is_started:
            raise SimulationError("the simulation has not been started; call reset()", -3)

    def _call(self, function: Callable[..., int], *arguments: object) -> None:
        if status := function(self.address, *arguments):
            self._fail(status)

    def _fail(self, status: int) -> None:
        if self.library.raised:
            raise self.library.raised.pop(0)
        text = self.library.status_text(status)
        if status > 0:
            room = ctypes.create_string_buffer(_TEXT)
            self.library.failure_text(self.address, room, _TEXT)
            text = room.value
        hint = "" if self._is_started else "; call reset()"
        raise SimulationError(f"{self.library.model}, at {self.time:.6g} s: {text.decode()}{hint if status < 0 else ''}", status)


def _require_whole(what: str, number: object, least: int) -> None:
    if not isinstance(number, Integral):
        raise TypeError(f"{what}: {number!r} is no whole number")
    if int(number) < least:
        raise ValueError(f"{what}: {number} is below {least}")


def _require_list(what: str, names: object) -> None:
    if isinstance(names, str):
        raise TypeError(f"{what}: '{names}' is one name; give a list, [{names!r}]")


def _rebuilt(
    library: Library, snapshot: bytes | None, parameters: Array, inputs: Array, limits: Mapping[str, float], settings: StepSettings
) -> Simulation:  # fmt: skip
    """A simulation that stands where another stood."""
    made = Simulation(library)
    made._settings = settings
    made.parameters.array[:], made.inputs.array[:] = parameters, inputs
    made.set_limits(**limits)
    if snapshot is not None:
        made.restore(snapshot)
    return made
