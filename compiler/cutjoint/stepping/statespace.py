"""The motion near a state."""

from __future__ import annotations

from dataclasses import dataclass

from cutjoint.stepping.values import Array


@dataclass(frozen=True, kw_only=True)
class StateSpace:
    """x' = A x + B u, y = C x + D u, of changes x of states, u of inputs and y of outputs from a state that a simulation was in.

    ``A`` (2f, 2f), ``B`` (2f, inputs), ``C`` (outputs, 2f), ``D`` (outputs, inputs) with f degrees of freedom, in SI units.  ``states``,
    ``inputs`` and ``outputs`` are names: the independent coordinates, then their rates.  ``x`` (2f) are the states about which it holds, so
    that ``simulation.states.array - near.x`` is the change.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    x: Array
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def __repr__(self) -> str:
        return f"<StateSpace: states {', '.join(self.states)}, inputs {', '.join(self.inputs) or 'none'}, {len(self.outputs)} outputs>"
