"""The C interface of a compiled model, by ctypes; lanes have a library of their own, compiled on demand."""

import ctypes
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from cutjoint.compile.c_export import Standalone, lanes_break_even
from cutjoint.emit.source import environment
from cutjoint.methods import Steps
from cutjoint.run.settings import StepSettings
from cutjoint.stepping.values import Array


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


#: Kinds of quantities with names in every library; coordinates and speeds of the start belong to joints of the spanning tree.
_NAMED = ("parameter", "coordinate", "speed", "equation", "start_coordinate", "start_speed", "output")


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
    """The C interface of one model; members have the names of its header without the model's prefix.

    ``equations``, ``dofs`` and ``states`` are the numbers of equations, degrees of freedom (with derivatives) and first-order states.
    ``seed_rows`` is the number of rows of the seed matrix, ``record`` the size of a run's record.  ``has_poses``: whether poses of
    bodies and markers are available.  ``steps`` are the properties of the integrator, ``settings`` those of a simulation's start.
    ``lanes`` steps several simulations together, None if the method cannot.  ``functions`` are host functions by name.  ``begin``
    computes the coordinates and speeds of the scene's start if they depend on changed parameters; the start ``is_trimmed`` once.

    Raises:
        OSError: the file is no library.
    """

    def __init__(
        self, path: Path, model: str, size: int, *, has_inputs: bool, equations: int, dofs: int | None, states: int,
        seed_rows: int, record: int, has_poses: bool, steps: Steps, settings: StepSettings, lanes: "Lanes | None",
        functions: Mapping[str, HostFunction] | None = None, find_start: FindStart | None = None, is_trimmed: bool = False,
    ) -> None:  # fmt: skip
        self._path = Path(path)
        self._made_with = {
            "model": model, "size": size, "has_inputs": has_inputs, "equations": equations, "dofs": dofs, "states": states,
            "seed_rows": seed_rows, "record": record, "has_poses": has_poses, "steps": steps, "settings": settings,
            "functions": functions, "find_start": find_start, "is_trimmed": is_trimmed,
        }  # fmt: skip
        self.model, self.size, self.equations, self.dofs, self.states = model, size, equations, dofs, states
        self.seed_rows, self.record = seed_rows, record
        self.steps, self.settings, self.lanes, self.has_poses, self.find_start = steps, settings, lanes, has_poses, find_start
        self.is_trimmed = is_trimmed
        self._library = ctypes.CDLL(os.fspath(path))
        pointer = ctypes.POINTER(ctypes.c_double)
        sim, index, text, number = ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_double
        self._create = self._function("create", sim, ctypes.c_void_p, ctypes.c_size_t)
        self.raised: list[BaseException] = []
        self._functions = {name: function.pointer(self.raised) for name, function in (functions or {}).items()}
        if functions:
            self._find_function = self._function("find_function", index, text)
            self._set_function = self._function("set_function", index, sim, index, _CALL, ctypes.c_void_p)
        self.start = self._function("start", index, sim)
        self.step = self._function("step", index, sim)
        self.advance = self._function("advance", index, sim, number)
        self.run = self._function("run", index, sim, ctypes.c_long, ctypes.c_void_p)
        self.time = self._function("time", number, sim)
        self.outputs = self._function("outputs", pointer, sim)
        self.constraint_violation = self._function("constraint_violation", number, sim, ctypes.POINTER(ctypes.c_int))
        self.last_step = self._function("last_step", index, sim, ctypes.POINTER(StatisticsRecord))
        self.set_limit = self._function("set_limit", index, sim, index, number)
        self.set_step = self._function("set_step", index, sim, number)
        if steps.is_iterated:
            self.set_iterations = self._function("set_iterations", index, sim, index)
        if steps.adaptive:
            self.set_tolerance = self._function("set_tolerance", index, sim, number, number)
        if steps.finds_events:
            self.advance_to_event = self._function("advance_to_event", index, sim, number, ctypes.POINTER(ctypes.c_int))
            self.event_names = self._table("event_name")
        self.set_equilibrium = self._function("set_equilibrium", index, sim, index)
        if hasattr(self._library, f"{model}_set_road"):
            address = ctypes.c_void_p
            self.set_road = self._function("set_road", index, address, index, address, address, index, index)
        self.set_state = self._function("set_state", index, sim, number, ctypes.c_void_p, ctypes.c_void_p)
        self.displace = self._function("displace", index, sim, ctypes.c_void_p)
        self.constraint_jacobian = self._function("constraint_jacobian", index, sim, ctypes.c_void_p)
        if dofs is not None:
            self.choose_independent = self._function("choose_independent", index, sim)
            self.is_ill_conditioned = self._function("is_ill_conditioned", index, sim)
            self.choose_independent_speeds = self._function("choose_independent_speeds", index, sim, ctypes.POINTER(ctypes.c_int))
            self.state_name = self._function("state_name", text, sim, index)
            self.get_minimal_state = self._function("get_minimal_state", index, sim, ctypes.c_void_p)
            self.set_minimal_state = self._function("set_minimal_state", index, sim, number, ctypes.c_void_p)
            self.minimal_state_derivatives = self._function("minimal_state_derivatives", index, sim, ctypes.c_void_p)
            self.linearise = self._function("linearise", index, sim, *[ctypes.c_void_p] * 4)
            self.moves_joints = hasattr(self._library, f"{model}_linearise_rates")
            if self.moves_joints:
                self.linearise_rates = self._function("linearise_rates", index, sim, *[ctypes.c_void_p] * 4)
            self.linearise_parameters = self._function("linearise_parameters", index, sim, *[ctypes.c_void_p] * 2)
            self.step_derivatives = self._function("step_derivatives", index, sim, *[ctypes.c_void_p] * 3)
            lists = (index, ctypes.c_void_p, ctypes.c_void_p), (index, ctypes.c_void_p, ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p)
            self.forward_sensitivities = self._function("forward_sensitivities", index, sim, ctypes.c_long, *lists[0], *lists[1])
            if has_inputs:
                self.set_input_trajectories = self._function("set_input_trajectories", index, sim, index, ctypes.POINTER(TrajectoryRecord))
            self.records_events = hasattr(self._library, f"{model}_record_events")
            if self.records_events:
                places = (ctypes.POINTER(index), *[ctypes.c_void_p] * 5)
                self.record_events = self._function("record_events", index, sim, index, *places)
        if record:
            rows, three = (index, ctypes.c_void_p, ctypes.c_long), (ctypes.c_void_p,) * 3
            self.adjoint_sensitivities = self._function(
                "adjoint_sensitivities", index, sim, ctypes.c_long, *rows, index, *three, ctypes.c_size_t, *three
            )  # fmt: skip
        if has_poses:
            self.poses = self._function("poses", pointer, sim)
            if dofs is not None:
                self.equations_of_motion = self._function("equations_of_motion", index, sim, *[ctypes.c_void_p] * 2)
                self.point_jacobian = self._function("point_jacobian", index, sim, index, *[ctypes.c_void_p] * 2)
        self.reset_start = self._function("reset_start", index, sim)
        self.set_start_coordinate = self._function("set_start_coordinate", index, sim, index, number)
        self.set_start_speed = self._function("set_start_speed", index, sim, index, number)
        self.snapshot_size = self._function("snapshot_size", ctypes.c_size_t)
        self.save = self._function("save", index, sim, ctypes.c_void_p)
        self.restore = self._function("restore", index, sim, ctypes.c_void_p, ctypes.c_size_t)
        self.status_text = self._function("status_text", text, index)
        self.failure_text = self._function("failure_text", index, sim, text, ctypes.c_size_t)
        self.arrays = {name: self._function(name, pointer, sim) for name in ("coordinates", "speeds", "accelerations", "parameters")}
        self.names = {kind: self._table(f"{kind}_name") for kind in _NAMED}
        self.names["pose"] = self._table("pose_name") if has_poses else ()
        self.names["input"] = self._table("input_name") if has_inputs else ()
        kinds = ("parameter", "output", *(["input"] if has_inputs else []))
        self.units = {kind: dict(zip(self.names[kind], self._table(f"{kind}_unit"), strict=True)) for kind in kinds}
        if has_inputs:
            self.arrays["inputs"] = self._function("inputs", pointer, sim)
            self.input = self._function("input", number, sim, index)
            self.set_input = self._function("set_input", index, sim, index, number, number, number)

    def create(self, memory: int, size: int) -> int:
        """Create a simulation in memory at an address; returns it with its functions."""
        address: int = self._create(memory, size)
        for name, pointer in self._functions.items():
            self._set_function(address, self._find_function(name.encode()), pointer, None)
        return address

    def __deepcopy__(self, memo: object) -> "Library":
        return self

    def __reduce__(self) -> "tuple[Callable[..., Library], tuple[Path, Mapping[str, object]]]":
        """The library by its place; its steps of several together, which come from the model, are not compiled elsewhere."""
        return _opened, (self._path, self._made_with)

    def _function(self, name: str, result: Any, *arguments: Any) -> Callable[..., Any]:
        function = getattr(self._library, f"{self.model}_{name}")
        function.restype, function.argtypes = result, arguments
        return function  # type: ignore[no-any-return]

    def _table(self, name: str) -> tuple[str, ...]:
        at = self._function(name, ctypes.c_char_p, ctypes.c_int)
        entries: list[str] = []
        while (entry := at(len(entries))) is not None:
            entries.append(entry.decode())
        return tuple(entries)


def _opened(path: Path, arguments: Mapping[str, Any]) -> Library:
    return Library(path, **arguments, lanes=None)


#: Indices into an array, and the values of the simulations there, (simulations, indices).
Columns = tuple[Sequence[int], Array]


class Lanes:
    """Steps of several simulations together.

    ``build`` makes the library of a model with so many ``operations`` per evaluation.  Flags are those of `Library`.
    """

    def __init__(self, model: str, operations: int, build: Callable[[], Path]) -> None:
        self._model, self._operations, self._build = model, operations, build

    def reach_break_even(self, steps: int) -> bool:
        """Return whether, for so many steps of all simulations, lanes save more time than their compilation takes."""
        return lanes_break_even(self._operations, steps)

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


def with_rollout(standalone: Standalone) -> Standalone:
    """A C export with lanes whose library also steps many simulations at once."""
    template = environment().get_template("stepping/rollout.cpp.jinja")
    return standalone.with_code(template.render(p=standalone.name, P=standalone.name.upper()))
