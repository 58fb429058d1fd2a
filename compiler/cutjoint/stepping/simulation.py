"""Simulations that Python code starts and steps."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from cutjoint.package.renamed import with_old_members
from cutjoint.run.settings import StepSettings
from cutjoint.stepping.derivatives import Derivatives
from cutjoint.stepping.library import Library
from cutjoint.stepping.values import Array


@with_old_members
class Simulation(Derivatives):
    """A simulation of a model in SI units: `reset` finds a consistent start, `step` and `advance` continue.

    ``inputs`` and ``parameters`` may change between steps.  Parameters affect outputs at once, and accelerations too, but with trapezoidal
    and generalised-alpha from the next step on, as inputs do.  An input set to NaN follows the scene's law, else has its default ``value``.
    ``coordinates`` and ``speeds`` are read-only views of the present state; ``outputs`` and accelerations are copies.
    """

    def copy(self) -> Simulation:
        """Copy the simulation with its state; without a `reset` only its parameters and inputs."""
        return _rebuilt(*self.__reduce__()[1])

    def __reduce__(self) -> tuple[Callable[..., Simulation], tuple[Library, bytes | None, Array, Array, dict[str, float], StepSettings]]:
        snapshot = self.snapshot() if self._is_started else None
        arrays = self.parameters.array.copy(), self.inputs.array.copy()
        return _rebuilt, (self.library, snapshot, *arrays, self._limits, self._settings)


def _rebuilt(
    library: Library, snapshot: bytes | None, parameters: Array, inputs: Array, limits: Mapping[str, float], settings: StepSettings
) -> Simulation:  # fmt: skip
    made = Simulation(library)
    made._settings = settings
    made.parameters.array[:], made.inputs.array[:] = parameters, inputs
    made.set_limits(**limits)
    if snapshot is not None:
        made.restore(snapshot)
    return made
