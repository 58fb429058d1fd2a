"""The library of a batch: runs of one scene in SIMD lanes, which differ by parameters, inputs and starts."""

import ctypes
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import nan
from pathlib import Path
from typing import Any

import numpy as np

from cutjoint.compile.c_export import Standalone
from cutjoint.formulate.inputs import input_parameters
from cutjoint.run.record import Settings

#: The values that each output has of a run.
KINDS = ("end", "minimum", "maximum")
#: The calls of the C interface that its code needs, by which it compiles the sooner.
_CALLS = ("set_parameter", "set_input", "set_start_coordinate", "set_start_speed", "start")


def with_batch(standalone: Standalone) -> Standalone:
    """A C export with lanes whose library also runs batches; its source has no start, length of steps or closure settings of the scene."""
    held = replace(standalone.run_file.settings.stabilisation, penalty=None, damping_ratio=1.0, frequency=1.0)
    blank = standalone.run_file.with_settings(dt=1.0, penalty=None, tolerance=1.0, stabilisation=held)
    file = replace(blank, positions={}, rates={}, end=1.0, output_step=1.0)
    standalone = replace(standalone, run_file=file, calls=_CALLS)
    return standalone.with_code("tasks/batch.cpp.jinja", inputs=standalone.parts.mechanism.inputs)


def names_of_runs(standalone: Standalone) -> dict[str, Sequence[str]]:
    """The names of the values that a run has in the library, by parts of run files."""
    start = standalone.parts.mechanism
    parameters, inputs = ([p.name for p in found] for found in (start.parameters, input_parameters(start.topology.model)))
    return {"parameters": parameters, "inputs": inputs, "positions": start.coordinate_names, "rates": start.speed_names}


@dataclass(frozen=True, kw_only=True)
class BatchLibrary:
    """The runs of a ``model`` by a library at a ``path``; ``names`` are those of `names_of_runs`, of so many ``outputs``."""

    path: Path
    model: str
    names: Mapping[str, Sequence[str]]
    outputs: int

    @cached_property
    def _functions(self) -> tuple[Any, int]:
        """The function that makes runs, and the bytes of its memory."""
        library, pointer, long = ctypes.CDLL(os.fspath(self.path)), ctypes.c_void_p, ctypes.c_long
        function, size = getattr(library, f"{self.model}_batch"), getattr(library, f"{self.model}_batch_bytes")
        function.restype, size.restype = None, ctypes.c_size_t
        function.argtypes = (pointer, long, long, long, *[pointer] * 7)
        return function, size()

    def run(
        self, parts: Sequence[Mapping[str, Any]], steps: tuple[int, int], settings: Settings, stop: Any, *, is_first: bool
    ) -> tuple[list[dict[str, Any]], float]:  # fmt: skip
        """Make runs with ``parts`` of run files. Return results as of a simulator, of runs that fail none with a status, and seconds.
        ``steps`` are their number and how many there are between rows. ``stop``, a C integer, ends runs once it is set. With ``is_first``,
        the first one has its undetermined speeds."""
        (function, size), runs, speeds = self._functions, len(parts), self.names["rates"]
        places = [(of, name) for of, names in self.names.items() for name in names]
        values = np.array([[part.get(of, {}).get(name, nan) for of, name in places] for part in parts], dtype=float)
        held = settings.stabilisation
        numbers = settings.dt, settings.tolerance, held.damping_ratio, held.frequency, nan if held.penalty is None else held.penalty
        results, evaluations = np.full((runs, len(KINDS), self.outputs), np.nan), np.full(runs, -1, dtype=np.int64)
        memory, undetermined, seconds = np.zeros(size // 8 + 1), np.zeros(len(speeds) + 1, dtype=np.uint8), ctypes.c_double()
        function(
            memory.ctypes.data, runs, *steps, (ctypes.c_double * 5)(*numbers), values.ctypes.data, ctypes.addressof(stop),
            results.ctypes.data, evaluations.ctypes.data, undetermined.ctypes.data if is_first else None, ctypes.addressof(seconds),
        )  # fmt: skip
        plain = results.astype(object)
        plain[~np.isfinite(results)] = None
        found: list[dict[str, Any]] = [
            {"status": "done", "evaluations": number, **dict(zip(KINDS, each, strict=True))} if number >= 0 else {}
            for number, each in zip(evaluations.tolist(), plain.tolist(), strict=True)
        ]
        if is_first:
            found[0]["undetermined"] = tuple(name for name, is_free in zip(speeds, undetermined, strict=False) if is_free)
        return found, seconds.value
