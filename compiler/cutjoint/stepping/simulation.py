"""One simulation of a model."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from cutjoint.package.renamed import with_old_members
from cutjoint.run.settings import StepSettings
from cutjoint.stepping.derivatives import Derivatives
from cutjoint.stepping.library import Library
from cutjoint.stepping.values import Array


@with_old_members
class Simulation(Derivatives):
    """A simulation of a model: `reset` finds a consistent start, `step` and `advance` continue; SI units.

    ``inputs`` and ``parameters`` may change between steps; an input that is NaN follows the scene, without a law there it has
    the parameter's value.  ``coordinates``, ``speeds`` and
    ``outputs`` are those of the present state; their arrays are read-only views, those of outputs and accelerations copies.  A parameter
    changes outputs and accelerations at once, an input with the next step.
    """

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
