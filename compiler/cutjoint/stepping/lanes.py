"""Simulations of one model side by side, by a library of their own, which is compiled when it is asked for."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from cutjoint.compile.folders import Standalone, lanes_break_even
from cutjoint.emit.source import environment
from cutjoint.stepping.values import Array

#: Places of an array, and the values that simulations have there, (simulations, places).
Columns = tuple[Sequence[int], Array]


class Lanes:
    """Steps of several simulations together.

    ``build`` makes the library, of a model whose evaluations have so many ``operations``; its simulations are those of `Library` with the
    same flags.
    """

    def __init__(self, model: str, operations: int, build: Callable[[], Path]) -> None:
        self._model, self._operations, self._build = model, operations, build

    def pay(self, steps: int) -> bool:
        """Return whether lanes save more in so many steps of all simulations than they take to compile."""
        return lanes_break_even(self._operations, steps)

    @cached_property
    def _functions(self) -> tuple[Any, int, int]:
        """The function, the bytes of memory that it takes, and those of a snapshot."""
        library = ctypes.CDLL(os.fspath(self._build()))
        function, *sizes = (getattr(library, f"{self._model}_{name}") for name in ("rollout", "rollout_bytes", "snapshot_size"))
        pointer, number = ctypes.c_void_p, ctypes.c_long
        function.restype = ctypes.c_int
        for size in sizes:
            size.restype = ctypes.c_size_t
        function.argtypes = (pointer, number, number, pointer, ctypes.c_int, pointer, pointer, ctypes.c_int, pointer, pointer, pointer)
        return function, sizes[0](), sizes[1]()

    def compile(self) -> None:
        """Compile the library, or find it in the cache.

        Raises:
            ToolchainError: the compiler failed.
        """
        _ = self._functions

    def play(self, snapshots: Sequence[bytes], parameters: Columns, inputs: Columns, rows: Array) -> None:
        """Steps of simulations from snapshots into ``rows`` (simulations, steps, outputs), up to those that fail.

        Raises:
            ValueError: some bytes are no snapshot of the model.
        """
        function, size, whole = self._functions
        memory, begins = np.zeros(size // 8 + 1), (ctypes.c_char_p * len(snapshots))(*snapshots)
        given = [(np.array(places, dtype=np.intc), np.ascontiguousarray(values)) for places, values in (parameters, inputs)]
        (p, p_values), (i, i_values) = given
        is_one = all(len(each) == whole for each in snapshots) and function(
            memory.ctypes.data, len(snapshots), rows.shape[1], begins, len(p), p.ctypes.data, p_values.ctypes.data, len(i), i.ctypes.data,
            i_values.ctypes.data, rows.ctypes.data,
        )  # fmt: skip
        if not is_one:
            raise ValueError(f"these bytes are no snapshot of '{self._model}'")


def with_rollout(alone: Standalone) -> Standalone:
    """A folder with lanes whose library also takes the steps of many simulations."""
    return alone.with_code(environment().get_template("stepping/rollout.cpp.jinja").render(p=alone.name, P=alone.name.upper()))
