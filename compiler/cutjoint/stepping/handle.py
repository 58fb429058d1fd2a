"""Calls of the library of one simulation."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from numbers import Integral

import numpy as np

from cutjoint.package.errors import CutjointError
from cutjoint.run.settings import StepSettings
from cutjoint.stepping.library import Library
from cutjoint.stepping.values import Array, Values

#: The largest length of a library's error message.
_TEXT = 600


class SimulationError(CutjointError):
    """A start or a step that failed; ``status`` is that of the C interface, above 0 if the motion cannot continue."""

    def __init__(self, text: str, status: int) -> None:
        super().__init__(text)
        self.status = status

    def __reduce__(self) -> tuple[type[SimulationError], tuple[str, int]]:
        return type(self), (str(self), self.status)


class Handle:
    """The memory of one simulation in a library, and the calls with it."""

    def __init__(self, library: Library) -> None:
        self.library = library
        size = library.size
        self._memory = np.zeros(size // 8)
        self.address = library.create_simulation(self._memory.ctypes.data, size)
        self.parameters = Values(library.names["parameter"], self._view("parameters", "parameter"), library.units["parameter"])
        self.inputs = Values(library.names["input"], self._view("inputs", "input"), library.units["input"])
        self._states: dict[str, Values] = {}  # views of the memory, once they are asked for
        self._is_started = False
        self._independent: ctypes.Array[ctypes.c_int] | None = None  # the speeds that the user chose
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
        return np.ctypeslib.as_array(getattr(self.library, array)(self.address), (len(names),)) if names else np.zeros(0)

    @property
    def time(self) -> float:
        """The present time (s)."""
        return float(self.library.time(self.address))

    def snapshot(self) -> bytes:
        """Complete state, parameters and inputs as bytes; after `restore` the same steps follow bit for bit.

        Raises:
            SimulationError: there was no `reset`.
        """
        room = ctypes.create_string_buffer(self.library.snapshot_size())
        self._call(self.library.save, ctypes.addressof(room))
        return room.raw

    def restore(self, snapshot: bytes) -> None:
        """Continue from a snapshot of this or another simulation of the same model and scene.

        Raises:
            ValueError: the bytes are no snapshot of this model and version.
        """
        room = ctypes.create_string_buffer(snapshot, len(snapshot))
        if self.library.restore(self.address, ctypes.addressof(room), len(snapshot)):
            raise ValueError(f"these bytes are no snapshot of '{self.library.model}'")
        self._is_started = True

    @staticmethod
    def _require(able: bool, advice: str) -> None:
        if not able:
            raise TypeError(advice)

    def _require_start(self) -> None:
        if not self._is_started:
            raise SimulationError("the simulation has not been started; call reset()", -3)

    def _require_dofs(self) -> int:
        dofs = self.library.dofs
        self._require(dofs is not None, "load the model with linearise=True")
        return int(dofs or 0)

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


def require_whole(what: str, number: object, least: int) -> None:
    if not isinstance(number, Integral):
        raise TypeError(f"{what}: {number!r} is no whole number")
    if int(number) < least:
        raise ValueError(f"{what}: {number} is below {least}")


def require_list(what: str, names: object) -> None:
    if isinstance(names, str):
        raise TypeError(f"{what}: '{names}' is one name; give a list, [{names!r}]")
