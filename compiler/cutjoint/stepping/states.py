"""States and results of a simulation."""

from __future__ import annotations

import ctypes
import struct
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from cutjoint.formulate.recursive.quantities import NUMBERS_PER_POSE, digest_of_poses
from cutjoint.stepping.motion import Motion
from cutjoint.stepping.values import Array, Outputs, Poses, Values, find_place

WITHOUT_POSES = "load the model with poses=True"


class States(Motion):
    """A simulation with its present state, by names."""

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
        return self._state("coordinate")

    @property
    def speeds(self) -> Values:
        """Velocities of the coordinates, by name; `set_state` changes them.

        Raises:
            SimulationError: there was no `reset`.
        """
        return self._state("speed")

    @property
    def accelerations(self) -> Values:
        """Copy of the accelerations at the present state, by the names of the velocities.

        Raises:
            SimulationError: there was no `reset`.
        """
        self._require_start()
        names = self.library.names["speed"]
        return Values(names, np.array(self.library.accelerations(self.address)[: len(names)]))

    @property
    def poses(self) -> Poses:
        """Poses of bodies, markers and wheel contacts at the present state, as in the C reference; later calls update these arrays.

        Raises:
            TypeError: the model was loaded without poses.
            SimulationError: there was no `reset`.
        """
        self._require(self.library.has("poses"), WITHOUT_POSES)
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
        """Residual (m or rad) of the loop equation that is largest relative to its limit, and its name; 0 and None without equations.

        Raises:
            SimulationError: there was no `reset`.
        """
        self._require_start()
        equation = ctypes.c_int(-1)
        gap = float(self.library.constraint_violation(self.address, ctypes.byref(equation)))
        return gap, None if equation.value < 0 else self.library.names["equation"][equation.value]

    def _state(self, kind: str) -> Values:
        self._require_start()
        if kind not in self._states:
            view = self._view(f"{kind}s", kind)
            view.flags.writeable = False
            self._states[kind] = Values(self.library.names[kind], view)
        return self._states[kind]

    def set_state(self, time: float, coordinates: Array, speeds: Array) -> None:
        """Set time (s), coordinates and velocities, in the order of `coordinates` and `speeds`; loops are not closed.

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
        """Jacobian (equations, velocities) of the loop equations; in natural coordinates also of rigid-body constraints.

        Raises:
            SimulationError: there was no `reset`.
        """
        columns = np.empty((len(self.library.names["speed"]), self.library.equations))
        self._call(self.library.constraint_jacobian, columns.ctypes.data)
        return columns.T

    def choose_independent(self, speeds: Sequence[str] | None = None) -> None:
        """Choose the independent coordinates by the names of their ``speeds``, one for each degree of freedom.

        Without ``speeds`` it chooses those with respect to which the derivatives of the others are small.  A choice by ``speeds``
        outlasts `reset`.

        Raises:
            TypeError: the model was loaded without derivatives.
            KeyError: there is no such speed.
            ValueError: the names are not distinct, or their number is not that of the degrees of freedom.
            SimulationError: the other coordinates do not follow from these, or there was no `reset`.
        """
        dofs = self._require_dofs()
        if speeds is None:
            self._call(self.library.choose_independent)
            self._independent = None
            return
        names = self.library.names["speed"][: len(self.library.names["speed"]) - self.library.states]
        numbers = [find_place({each: i for i, each in enumerate(names)}, name) for name in speeds]
        if len(set(numbers)) != dofs or len(numbers) != dofs:
            raise ValueError(f"choose as many different speeds as degrees of freedom, {dofs}, not {', '.join(speeds)}")
        chosen = (ctypes.c_int * dofs)(*numbers)
        self._call(self.library.choose_independent_speeds, chosen)
        self._independent = chosen

    @property
    def is_ill_conditioned(self) -> bool:
        """Whether to call `choose_independent` again: the choice is ill-conditioned, or a ball joint has rotated over 1 rad.

        Raises:
            TypeError: the model was loaded without derivatives.
        """
        self._require_dofs()
        return bool(self.library.is_ill_conditioned(self.address))

    @property
    def states(self) -> Values:
        """Independent coordinates, their rates, then first-order states, by name.

        The state of a ball is its rotation relative to the pose in which the coordinates were chosen.

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
