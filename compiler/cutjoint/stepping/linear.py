"""Derivatives of a simulation at one state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from cutjoint.stepping.handle import require_list
from cutjoint.stepping.state_space import StateSpace
from cutjoint.stepping.states import WITHOUT_POSES, States
from cutjoint.stepping.values import (
    DIFFERENCE_STEPS,
    Array,
    EigenvalueSensitivities,
    StateSensitivities,
    difference,
    find_eigenvalues,
    find_number,
    find_place,
    is_non_smooth,
)

#: Rates of states (SI units) below the first count as rest.  Singular values below the second share of the largest count as zero.
_AT_REST, _SINGULAR = 1e-3, 1e-11

#: Steps of differences: relative to the number, and in its unit if the number is zero.
_SHARE, _SHARE_OF_NOUGHT = 1e-3, 1e-4


class Linear(States):
    """A simulation with its linear model and the quantities derived from it."""

    def linearise(self) -> StateSpace:
        """Linear model about the present state: dx' = A dx + B du, dy = C dx + D du.

        Raises:
            TypeError: the model was loaded without derivatives.
            SimulationError: the pose is singular, an acceleration has no finite derivative, or there was no `reset`.
        """
        states = self.states
        n, inputs, outputs = len(states), *(self.library.names[kind] for kind in ("input", "output"))
        A, B, C, D = matrices = [np.zeros((r, c)) for r in (n, len(outputs)) for c in (n, len(inputs))]
        self._call(self.library.linearise, *(matrix.ctypes.data for matrix in matrices))
        rates = [np.zeros_like(of) for of in (B, B, D, D)]
        if self.library.has("linearise_rates"):
            self._call(self.library.linearise_rates, *(matrix.ctypes.data for matrix in rates))
        B_rate, B_acceleration, D_rate, D_acceleration = rates
        return StateSpace(
            A=A, B=B, B_rate=B_rate, B_acceleration=B_acceleration, C=C, D=D, D_rate=D_rate, D_acceleration=D_acceleration,
            x=states.array, states=tuple(states), inputs=inputs, outputs=outputs,
            units={**self.library.units["input"], **self.library.units["output"]}, y=self.outputs.array,
        )  # fmt: skip

    def equilibrium_sensitivities(self, outputs: Sequence[str], by: Sequence[str]) -> StateSensitivities:
        """Derivatives of the present static equilibrium with respect to parameters and inputs, and those of ``outputs``.

        They follow from the implicit function theorem.  If equilibria form a continuum, as of a car on a
        plane, it is the nearest one.

        Raises:
            TypeError: the model was loaded without derivatives.
            KeyError: there is no such output, parameter or input.
            ValueError: the mechanism is not at rest, or has no equilibrium near by for a changed value.
            SimulationError: the pose is singular, or there was no `reset`.
        """
        require_list("by", by)
        require_list("outputs", outputs)
        near = self.linearise()
        parameters = self.library.names["parameter"]
        E, F = np.zeros((len(near.states), len(parameters))), np.zeros((len(near.outputs), len(parameters)))
        self._call(self.library.linearise_parameters, E.ctypes.data, F.ctypes.data)
        places = {name: i for i, name in enumerate((*near.inputs, *parameters))}
        numbers = [find_number(places, name) for name in by]
        rates = np.zeros(len(near.states))
        self._call(self.library.minimal_state_derivatives, rates.ctypes.data)
        if not np.abs(rates).max(initial=0.0) <= _AT_REST:
            raise ValueError(
                f"the mechanism moves: a state changes by {np.abs(rates).max():.3g} (SI units) in a second; begin at rest, or "
                "take `initial_state_sensitivities`, on the command line --objective start, of a start that moves"
            )
        forcing = np.hstack([near.B, E])[:, numbers]
        states = np.asarray(-np.linalg.lstsq(near.A, forcing, rcond=_SINGULAR)[0], dtype=np.float64)
        left, size = np.abs(near.A @ states + forcing).max(axis=0), np.abs(forcing).max(axis=0)
        for name, rest in zip(by, left > 1e-6 * size, strict=True):
            if rest:
                raise ValueError(f"with another '{name}' the mechanism rests in no pose near this one")
        chosen = [self.outputs.place(name) for name in outputs]
        derivatives = (near.C @ states + np.hstack([near.D, F])[:, numbers])[chosen]
        values = self.outputs.array[chosen]
        return StateSensitivities(values=values, derivatives=derivatives, states=states, outputs=tuple(outputs), by=tuple(by))

    def eigenvalue_sensitivities(self, by: Sequence[str], modes: Sequence[int] | None = None) -> EigenvalueSensitivities:
        """Eigenvalues of the linear model at the present state, and their derivatives with respect to parameters and inputs.

        At a static equilibrium the change of the pose is included; elsewhere the states are fixed.  The derivative of the matrix is by
        fourth-order differences of exact matrices.

        Args:
            modes: indices of modes by magnitude; default: all with a nonzero eigenvalue.

        Raises:
            TypeError: the model was loaded without derivatives.
            KeyError: there is no such parameter, input or mode.
            ValueError: an eigenvalue repeats, or the state is a non-smooth point of a force, so that there is no derivative; or as of
                `equilibrium_sensitivities`.
            SimulationError: the pose is singular, or there was no `reset`.
        """
        require_list("by", by)
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
        """Fourth-order difference of a function of the model by a parameter or input, at a constant state where that function is smooth."""
        here, numbers = self.snapshot(), self.parameters if name in self.parameters else self.inputs
        places = {each: i for i, each in enumerate((*self.parameters, *self.inputs))}
        value = self.parameters[name] if find_place(places, name) < len(self.parameters) else self.get_input(name)

        def find_at(change: float) -> Array:
            try:
                numbers[name] = value + change
                return find(change)
            finally:
                self.restore(here)

        for share in (1.0, 1 / 16, 1 / 256):  # narrower where differences of two widths disagree
            h = share * (_SHARE * abs(value) or _SHARE_OF_NOUGHT)
            found = [find_at(steps * h) for steps in DIFFERENCE_STEPS]
            if not is_non_smooth(found, h):
                return difference(found, h)
        raise ValueError(
            f"by '{name}' there is no derivative: what changes with it jumps or is not smooth at this state, as where a damper has other "
            "rates for bump and rebound; make that law smooth here, or choose a nearby state"
        )

    def equations_of_motion(self) -> tuple[Array, Array]:
        """Mass matrix M (n, n) and generalised force (n,) of M z'' = force for the n independent coordinates z; SI units.

        The force includes gravity, velocity products, and all other forces, with the present inputs; loops are eliminated.

        Raises:
            TypeError: the model was loaded without derivatives or without poses.
            SimulationError: the pose is singular, or there was no `reset`.
        """
        dofs = self._require_dofs()
        self._require(self.library.has("poses"), WITHOUT_POSES)
        mass, force = np.zeros((dofs, dofs)), np.zeros(dofs)
        self._call(self.library.equations_of_motion, mass.ctypes.data, force.ctypes.data)
        return mass, force

    def point_jacobian(self, name: str, point: Sequence[float] | None = None) -> Array:
        """Jacobian J (6, n) at the present state: [velocity; angular velocity] = J z' of a point, global axes, guides at rest.

        z are the independent coordinates.  A wrench [F; T] at the point adds J^T [F; T] to the force of `equations_of_motion`.

        Args:
            name: a body or marker.
            point: (3,) m, in the design position; default: a body's centre of mass, a marker's point.

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
