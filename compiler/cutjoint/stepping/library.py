"""The C interface of a compiled model, by ctypes; lanes have a library of their own, compiled on demand."""

import ctypes
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from cutjoint.methods import Steps
from cutjoint.run.settings import StepSettings
from cutjoint.stepping.values import Array
from cutjoint.toolchain.temporary import temporary_folder


class StatisticsRecord(ctypes.Structure):
    """The record of C."""

    _fields_ = (
        *((name, ctypes.c_double) for name in ("violation", "violation_rate", "change", "pivot")), ("iterations", ctypes.c_long),
        ("evaluations", ctypes.c_long), ("equation", ctypes.c_int),
    )  # fmt: skip


class TrajectoryRecord(ctypes.Structure):
    """The input trajectory of the C interface."""

    _fields_ = (
        ("input", ctypes.c_int), ("jumps", ctypes.c_int), ("pieces", ctypes.c_long),
        *((name, ctypes.c_void_p) for name in ("times", "coefficients", "seeds", "derivatives")),
    )  # fmt: skip


#: Kinds of quantities with names; coordinates and speeds of the start belong to joints of the spanning tree.
_NAMED = ("parameter", "input", "coordinate", "speed", "equation", "start_coordinate", "start_speed", "output", "event", "pose")

#: A function of a C header in a line of its own: result, name, arguments; a number: name, value.
_FUNCTION, _NUMBER = r"^(?:const )?(\w+\*?) {}_(\w+)\((.*)\);$", r"^#define {}_(\w+) (\d+)$"

#: C's numbers; results that are arrays or text.
_NUMBERS: Mapping[str, Any] = {"int": ctypes.c_int, "long": ctypes.c_long, "size_t": ctypes.c_size_t, "double": ctypes.c_double}
_DOUBLES = ctypes.POINTER(ctypes.c_double)
_RESULTS = {**_NUMBERS, "double*": _DOUBLES, "pose*": _DOUBLES, "char*": ctypes.c_char_p}

#: A callback of the C interface.
_CALL = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.POINTER(ctypes.c_double), ctypes.c_void_p, ctypes.c_void_p, ctypes.POINTER(ctypes.c_double)
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class HostFunction:
    """A model's function implemented in Python: a pointer to a C function, or a callable that fills arrays.

    A callable gets ``arguments``, ``memory`` (bytes; none without one), ``results`` and ``partials`` (results, arguments) to fill;
    partials are None if they are not needed.  An update has no results: there ``results`` is the new memory in bytes.
    """

    arguments: int
    memory: int
    results: int
    call: Callable[..., object]

    def pointer(self, raised: list[BaseException]) -> Any:
        """The C function; an exception is stored, and the results are then NaN."""
        if hasattr(self.call, "argtypes"):
            return ctypes.cast(self.call, _CALL)  # type: ignore[arg-type]

        def call(_: object, arguments: Any, memory: int | None, results: int, partials: Any) -> None:
            length, kind = (self.results, ctypes.c_double) if self.results else (self.memory, ctypes.c_ubyte)
            found = np.ctypeslib.as_array((kind * length).from_address(results))
            kept = None if memory is None else np.frombuffer(ctypes.string_at(memory, self.memory), np.uint8)
            derivatives = np.ctypeslib.as_array(partials, (self.results, self.arguments)) if partials else None
            try:
                self.call(np.ctypeslib.as_array(arguments, (self.arguments,)), kept, found, derivatives)
            except BaseException as error:  # raised again by the call of the simulation
                raised.append(error)
                found[:] = np.nan if self.results else found

        return _CALL(call)


#: From tunable parameters to coordinates and speeds by name, SI units.
FindStart: TypeAlias = Callable[[Mapping[str, float]], tuple[Mapping[str, float], Mapping[str, float]]]


class Library:
    """The C interface of one model: its functions are members, with the names of the C header without the model's prefix.

    ``size`` (bytes), ``equations``, ``dofs`` (None without derivatives), ``states`` (of first order), ``seed_rows`` (of a seed matrix) and
    ``record`` (of a run) are numbers of the ``header``.  ``steps`` are the properties of the integrator, ``settings`` those of a
    simulation's start.  ``lanes`` steps several simulations together, None if the method cannot.  ``functions`` are host functions by
    name.  ``find_start`` computes the coordinates and speeds of the scene's start if they depend on changed parameters, but for
    what the simulation finds itself where the start ``is_trimmed``.

    Raises:
        OSError: the file is no library.
    """

    def __init__(
        self, path: Path, model: str, header: str, *, steps: Steps, settings: StepSettings, lanes: "Lanes | None",
        functions: Mapping[str, HostFunction] | None = None, find_start: FindStart | None = None, is_trimmed: bool = False,
    ) -> None:  # fmt: skip
        more = {"steps": steps, "settings": settings, "functions": functions, "find_start": find_start, "is_trimmed": is_trimmed}
        self._made_with = Path(path).read_bytes(), Path(path), model, header, more
        declared = re.findall(_FUNCTION.format(model), header, re.MULTILINE)
        self._declared = {name: (result, arguments) for result, name, arguments in declared}
        numbers = {name: int(number) for name, number in re.findall(_NUMBER.format(model.upper()), header, re.MULTILINE)}
        self._library = ctypes.CDLL(os.fspath(path))
        self.model, self.size, self.equations, self.dofs = model, numbers["SIZE"], numbers["EQUATIONS"], numbers.get("DEGREES_OF_FREEDOM")
        self.states = numbers.get("STATES", 0) - 2 * (self.dofs or 0)
        self.seed_rows, self.record = numbers.get("SEED_ROWS", 0), numbers.get("TAPE_RECORD", 0)
        self.steps, self.settings, self.lanes, self.find_start, self.is_trimmed = steps, settings, lanes, find_start, is_trimmed
        self.raised: list[BaseException] = []
        self._functions = {name: function.pointer(self.raised) for name, function in (functions or {}).items()}
        self.names = {kind: self._table(f"{kind}_name") for kind in _NAMED}
        units = {kind: self._table(f"{kind}_unit") for kind in ("parameter", "input", "output")}
        self.units = {kind: dict(zip(self.names[kind], of_kind, strict=True)) for kind, of_kind in units.items()}

    def has(self, function: str) -> bool:
        """Return whether the interface has a function."""
        return function in self._declared

    def __getattr__(self, name: str) -> Callable[..., Any]:
        """A function of the interface, with the types that the header declares; addresses are pointers of any type."""
        if name not in self.__dict__.get("_declared", ()):
            raise AttributeError(name)
        result, arguments = self._declared[name]
        function: Callable[..., Any] = getattr(self._library, f"{self.model}_{name}")
        function.restype = _RESULTS.get(result.removeprefix(f"{self.model}_"), ctypes.c_void_p)  # type: ignore[attr-defined]
        types = [argument.rpartition(" ")[0] for argument in arguments.split(", ") if argument != "void"]
        function.argtypes = [_NUMBERS.get(each, ctypes.c_void_p) for each in types]  # type: ignore[attr-defined]
        setattr(self, name, function)
        return function

    def create_simulation(self, memory: int, size: int) -> int:
        """Create a simulation in memory at an address; returns it with its functions."""
        address: int = self.create(memory, size)
        for name, pointer in self._functions.items():
            self.set_function(address, self.find_function(name.encode()), pointer, None)
        return address

    def __deepcopy__(self, memo: object) -> "Library":
        return self

    def __reduce__(self) -> "tuple[Callable[..., Library], tuple[bytes, Path, str, str, Mapping[str, object]]]":
        """The library with its content; its steps of several together, which come from the model, are not compiled elsewhere."""
        return _opened, self._made_with

    def _table(self, name: str) -> tuple[str, ...]:
        """The texts by index that a function returns; none without it."""
        entries: list[str] = []
        while self.has(name) and (entry := getattr(self, name)(len(entries))) is not None:
            entries.append(entry.decode())
        return tuple(entries)


def _opened(content: bytes, path: Path, model: str, header: str, more: Mapping[str, Any]) -> Library:
    with temporary_folder() as folder:
        if not path.is_file():  # on another machine
            path = folder / path.name
            path.write_bytes(content)
        return Library(path, model, header, **more, lanes=None)


#: Indices into an array, and the values of the simulations there, (simulations, indices).
Columns = tuple[Sequence[int], Array]


class Lanes:
    """Steps of several simulations together.

    ``build`` makes the library of a model with so many ``operations`` per evaluation.  Flags are those of `Library`.
    """

    def __init__(self, model: str, operations: int, build: Callable[[], Path]) -> None:
        self._model, self.operations, self._build = model, operations, build

    @cached_property
    def _functions(self) -> tuple[Any, int, int]:
        """The function, the size of its memory and that of a snapshot, in bytes."""
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

    def run(self, snapshots: Sequence[bytes], parameters: Columns, inputs: Columns, rows: Array) -> None:
        """Run simulations from snapshots and write outputs into ``rows`` (simulations, steps, outputs), up to those that fail.

        Raises:
            ValueError: some bytes are no snapshot of the model.
        """
        function, size, whole = self._functions
        memory, begins = np.zeros(size // 8 + 1), (ctypes.c_char_p * len(snapshots))(*snapshots)
        columns = [(np.array(places, dtype=np.intc), np.ascontiguousarray(values)) for places, values in (parameters, inputs)]
        (p, p_values), (i, i_values) = columns
        is_one = all(len(each) == whole for each in snapshots) and function(
            memory.ctypes.data, len(snapshots), rows.shape[1], begins, len(p), p.ctypes.data, p_values.ctypes.data, len(i), i.ctypes.data,
            i_values.ctypes.data, rows.ctypes.data,
        )  # fmt: skip
        if not is_one:
            raise ValueError(f"these bytes are no snapshot of '{self._model}'")
