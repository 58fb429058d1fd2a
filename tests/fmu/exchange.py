"""Instances for model exchange, and an integrator of the tests' own."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cutjoint.export.fmu.archive import Fmu

from .slaves import OK, Slave

Array = NDArray[np.float64]


class Exchange(Slave):
    """An instance for model exchange; methods that return arrays require that the call went well."""

    def __init__(self, fmu: Fmu) -> None:
        super().__init__(fmu, exchanges=True)
        self.states, self.events = len(fmu.interface.states), len(fmu.interface.indicators)
        self.rechosen, self.ended = 0, False

    def begin(self) -> Exchange:
        """Initialise, and enter continuous-time mode."""
        assert self.initialise() == OK, self.log
        assert self.update() == self.call("EnterContinuousTimeMode") == OK, self.log
        return self

    def update(self) -> int:
        """Update the discrete states once."""
        if self.fmu.version == 2:
            info = (ctypes.c_int * 8)()
            status = self.call("NewDiscreteStates", info)
            self.rechosen += info[3]
            return status
        flags = [ctypes.c_bool() for _ in range(5)]
        status = self.call("UpdateDiscreteStates", *map(ctypes.byref, flags), ctypes.byref(ctypes.c_double()))
        self.rechosen += flags[3].value
        return status

    def complete(self) -> bool:
        """Complete an integrator's step; True if it asked for an event, which then is made.  ``ended``: the simulation should end."""
        kind = ctypes.c_int if self.fmu.version == 2 else ctypes.c_bool
        wanted, ends = kind(), kind()
        assert self.call("CompletedIntegratorStep", ctypes.c_int(1), ctypes.byref(wanted), ctypes.byref(ends)) == OK, self.log
        self.ended = bool(ends.value)
        if wanted.value:
            assert self.call("EnterEventMode") == self.update() == self.call("EnterContinuousTimeMode") == OK, self.log
        return bool(wanted.value)

    def vector(self, name: str, length: int | None = None) -> Array:
        """The numbers of a function such as "GetContinuousStates"."""
        values = (ctypes.c_double * (self.states if length is None else length))()
        assert self.call(name, values, ctypes.c_size_t(len(values))) == OK, self.log
        return np.array(values)

    @property
    def x(self) -> Array:
        """The states."""
        return self.vector("GetContinuousStates")

    def put(self, time: float, x: Sequence[float] | Array) -> int:
        """Go to a time and states; whether derivatives can be had there shows later."""
        values = (ctypes.c_double * len(x))(*x)
        return self.call("SetTime", ctypes.c_double(time)) or self.call("SetContinuousStates", values, ctypes.c_size_t(len(x)))

    def derive(self, time: float, x: Array) -> Array:
        """The derivatives."""
        assert self.put(time, x) == OK, self.log
        return self.vector("GetDerivatives" if self.fmu.version == 2 else "GetContinuousStateDerivatives")

    def integrate(self, end: float, steps: int, begin: float = 0.0) -> None:
        """Classical Runge-Kutta steps, each followed by the event that it asks for."""
        h = (end - begin) / steps
        for i in range(steps):
            t, x = begin + i * h, self.x
            a = self.derive(t, x)
            b = self.derive(t + h / 2, x + h / 2 * a)
            c = self.derive(t + h / 2, x + h / 2 * b)
            d = self.derive(t + h, x + h * c)
            assert self.put(t + h, x + h / 6 * (a + 2 * b + 2 * c + d)) == OK
            self.complete()

    def directional(self, unknowns: Sequence[str], knowns: Sequence[str], seed: Sequence[float]) -> Array:
        """Directional derivatives of variables by their names."""
        (status, found) = self.ask_directional([self.references[n] for n in unknowns], [self.references[n] for n in knowns], seed)
        assert status == OK, self.log
        return found

    def ask_directional(self, unknowns: Sequence[int], knowns: Sequence[int], seed: Sequence[float]) -> tuple[int, Array]:
        """Directional derivatives by value references, with the status."""
        n, m, number = len(unknowns), len(knowns), ctypes.c_size_t
        given, found = (ctypes.c_double * len(seed))(*seed), (ctypes.c_double * n)()
        lists = ((ctypes.c_uint * n)(*unknowns), number(n), (ctypes.c_uint * m)(*knowns), number(m))
        lengths = () if self.fmu.version == 2 else (number(len(seed)),)
        more = () if self.fmu.version == 2 else (number(len(found)),)
        return self.call("GetDirectionalDerivative", *lists, given, *lengths, found, *more), np.array(found)
