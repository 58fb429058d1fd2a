"""The motion near a state: x' = A x + B u, y = C x + D u.

With N a basis of the directions that the loops leave free, displacements of the coordinates are N z, and the speeds change by N w + P z,
where P z keeps the loops closed in the displaced pose and moves the masses least.  L takes what moves the masses least out of anything:
L N = 1, L P = 0.  x = (z, w); a ball's displacement also turns with its angular velocity, W::

    z' = w + L W N z        w' = L da

da, the change of the accelerations, is by differences of fourth order of the simulation's own functions.  These are the unknowns of
`cutjoint.analysis.linearisation`, but for the lengths of the directions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cutjoint.analysis.linearisation import free_directions
from cutjoint.stepping.simulation import Simulation
from cutjoint.stepping.values import Array

#: Displacements, changes of speeds and of inputs (m, rad, m/s, rad/s, the input's unit).
_STEP = 1e-3
#: Central differences of fourth order, for a unit step.
_DIFFERENCES = {-2: 1 / 12, -1: -8 / 12, 1: 8 / 12, 2: -1 / 12}


@dataclass(frozen=True, kw_only=True)
class StateSpace:
    """``A`` (2f, 2f), ``B`` (2f, inputs), ``C`` (outputs, 2f), ``D`` (outputs, inputs) with f degrees of freedom, in SI units.

    ``basis`` N is (speeds, f), ``share`` L (f, speeds), ``coordinates`` and ``speeds`` are those of the state, ``inputs`` and ``outputs``
    names.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    basis: Array
    share: Array
    coordinates: Array
    speeds: Array
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def __repr__(self) -> str:
        return f"<StateSpace: {len(self.A)} states, inputs {', '.join(self.inputs) or 'none'}, {len(self.outputs)} outputs>"

    def state(self, simulation: Simulation) -> Array:
        """x of a state near by, of a mechanism without balls, whose coordinates have as many rates."""
        moved = (simulation.coordinates.array - self.coordinates, simulation.speeds.array - self.speeds)
        return np.concatenate([self.share @ x for x in moved])


def linearise(simulation: Simulation) -> StateSpace:
    """The motion near the present state of a simulation, which stays as it is.

    Raises:
        SimulationError: there was no `Simulation.reset`, or the loops do not close near by.
    """
    here, probe = simulation.snapshot(), simulation.copy()
    q, v, t = simulation.coordinates.array.copy(), simulation.speeds.array.copy(), simulation.time
    N = free_directions(simulation.jacobian)

    def derive(change: Callable[[float], None]) -> Array:
        """The derivatives of speeds, accelerations and outputs."""
        total = np.zeros(2 * len(v) + len(simulation.outputs))
        for steps, weight in _DIFFERENCES.items():
            probe.restore(here)
            change(steps * _STEP)
            values = np.concatenate([probe.speeds.array, probe.accelerations.array, probe.outputs.array])
            total += weight / _STEP * values
        return total

    def give(name: str) -> Callable[[float], None]:
        def change(by: float) -> None:
            probe.set_input(name, present[name] + by)
            probe.displace(np.zeros_like(v))

        return change

    present = present_inputs(simulation)
    by_z = _columns([derive(lambda h, d=d: probe.displace(h * d)) for d in N.T], v, simulation)  # type: ignore[misc]
    by_w = _columns([derive(lambda h, d=d: probe.set_state(t, q, v + h * d)) for d in N.T], v, simulation)  # type: ignore[misc]
    by_u = _columns([derive(give(name)) for name in simulation.inputs], v, simulation)
    L, f = N.T @ _least_moving(simulation, here), N.shape[1]
    A = np.block([[L @ _turning(simulation, v) @ N, np.eye(f)], [L @ by_z[1], L @ by_w[1]]])
    return StateSpace(
        A=A, B=np.vstack([np.zeros((f, len(present))), L @ by_u[1]]), C=np.hstack([by_z[2], by_w[2]]), D=by_u[2],
        basis=N, share=L, coordinates=q, speeds=v, inputs=tuple(present), outputs=tuple(simulation.outputs),
    )  # fmt: skip


def present_inputs(simulation: Simulation) -> dict[str, float]:
    """The values that inputs have now, those that follow the scene too."""
    return {name: simulation.present_input(name) for name in simulation.inputs}


def _columns(derivatives: list[Array], v: Array, simulation: Simulation) -> tuple[Array, Array, Array]:
    """Derivatives of speeds, accelerations and outputs, a column each."""
    rows = 2 * len(v) + len(simulation.outputs)
    all_of = np.array(derivatives).reshape(len(derivatives), rows).T
    return all_of[: len(v)], all_of[len(v) : 2 * len(v)], all_of[2 * len(v) :]


def _least_moving(simulation: Simulation, here: bytes) -> Array:
    """What is left of the change of each speed when the loops close again by moving the masses least, (speeds, speeds)."""
    probe, v = simulation.copy(), simulation.speeds.array.copy()
    columns = []
    for unit in np.eye(len(v)):
        probe.restore(here)
        probe.set_state(simulation.time, simulation.coordinates.array, v + unit)
        probe.displace(np.zeros_like(v))
        columns.append(probe.speeds.array - v)
    return np.array(columns).reshape(len(v), len(v)).T


def _turning(simulation: Simulation, v: Array) -> Array:
    """W: a small turn of a ball changes by omega x turn besides what omega changes by."""
    W = np.zeros((len(v), len(v)))
    for first in simulation.library.balls:
        W[first : first + 3, first : first + 3] = np.cross(v[first : first + 3], np.eye(3)).T
    return W
