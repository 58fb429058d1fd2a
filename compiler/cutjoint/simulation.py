"""Simulations that a program holds: stepping from Python, on the C interface of a compiled model."""

from __future__ import annotations

import ctypes
import difflib
import os
from collections.abc import Callable, Iterator, Mapping, MutableMapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cutjoint.locations import AnyPath
from cutjoint.model.read import read_model
from cutjoint.pipeline import generate
from cutjoint.run.scenes import find_scene
from cutjoint.standalone import make_standalone
from cutjoint.toolchain.build import FLAGS

Array = NDArray[np.float64]

#: Characters of what a library says of a failure.
_TEXT = 600


class SimulationError(Exception):
    """A start or a step that failed; ``status`` is that of the C interface, above 0 for a motion that cannot go on."""

    def __init__(self, text: str, status: int) -> None:
        super().__init__(text)
        self.status = status

    def __reduce__(self) -> tuple[type[SimulationError], tuple[str, int]]:
        return type(self), (str(self), self.status)


class Library:
    """The C interface of one model, by the names of its header without the model's.

    Raises:
        OSError: the file is no library.
    """

    def __init__(self, path: Path, model: str, size: int, *, has_inputs: bool) -> None:
        self.model, self.size = model, size
        self._library = ctypes.CDLL(os.fspath(path))
        pointer = ctypes.POINTER(ctypes.c_double)
        sim, index, text, number = ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_double
        self.create = self._function("create", sim, ctypes.c_void_p, ctypes.c_size_t)
        self.start = self._function("start", index, sim)
        self.step = self._function("step", index, sim)
        self.advance = self._function("advance", index, sim, number)
        self.play = self._function("play", index, sim, ctypes.c_long, ctypes.c_void_p)
        self.time = self._function("time", number, sim)
        self.outputs = self._function("outputs", pointer, sim)
        self.set_step = self._function("set_step", index, sim, number)
        self.set_iterations = self._function("set_iterations", index, sim, index)
        self.set_equilibrium = self._function("set_equilibrium", index, sim, index)
        self.set_state = self._function("set_state", index, sim, number, ctypes.c_void_p, ctypes.c_void_p)
        self.give_coordinate = self._function("give_coordinate", index, sim, index, number)
        self.give_speed = self._function("give_speed", index, sim, index, number)
        self.snapshot_size = self._function("snapshot_size", ctypes.c_size_t)
        self.save = self._function("save", index, sim, ctypes.c_void_p)
        self.restore = self._function("restore", index, sim, ctypes.c_void_p)
        self.status_text = self._function("status_text", text, index)
        self.explain = self._function("explain", index, sim, text, ctypes.c_size_t)
        self.arrays = {name: self._function(name, pointer, sim) for name in ("coordinates", "speeds", "accelerations", "parameters")}
        self.names = {kind: self._table(f"{kind}_name") for kind in ("parameter", "coordinate", "speed", "output")}
        self.names["input"] = self._table("input_name") if has_inputs else ()
        kinds = ("parameter", "output", *(["input"] if has_inputs else []))
        self.units = {kind: dict(zip(self.names[kind], self._table(f"{kind}_unit"), strict=True)) for kind in kinds}
        if has_inputs:
            self.arrays["inputs"] = self._function("inputs", pointer, sim)
            self.set_input = self._function("set_input", index, sim, index, number, number, number)

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


def find_place(places: Mapping[str, int], name: str) -> int:
    """The place of a name.

    Raises:
        KeyError: there is none.
    """
    try:
        return places[name]
    except KeyError:
        near = difflib.get_close_matches(name, places, n=1)
        hint = f"; did you mean '{near[0]}'?" if near else f"; there is {', '.join(places) or 'none'}"
        raise KeyError(f"no '{name}'{hint}") from None


class Values(MutableMapping[str, float]):
    """Numbers by name, in the memory of a simulation: ``array`` is a view of them, in SI units."""

    def __init__(self, names: Sequence[str], array: Array, units: Mapping[str, str] | None = None) -> None:
        self.array, self.units = array, units
        self._places = {name: i for i, name in enumerate(names)}

    def __getitem__(self, name: str) -> float:
        return float(self.array[find_place(self._places, name)])

    def __setitem__(self, name: str, value: float) -> None:
        self.array[find_place(self._places, name)] = value

    def __delitem__(self, name: str) -> None:
        raise TypeError("numbers of a simulation cannot be deleted")

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)

    def __repr__(self) -> str:
        return f"<{', '.join(f'{name}: {self[name]:.6g}' for name in list(self)[:8])}{', ...' if len(self) > 8 else ''}>"


class Simulation:
    """One simulation of a model: `reset` finds a consistent start, `step` and `advance` go on.

    ``inputs`` and ``parameters`` may change between steps; an input that is NaN follows the scene.  ``coordinates``, ``speeds`` and
    ``outputs`` are those of the present state.  All are views of the simulation's own memory, in SI units.
    """

    def __init__(self, library: Library) -> None:
        self._library = library
        size = library.size
        self._memory = np.zeros(size // 8)
        self._sim = library.create(self._memory.ctypes.data, size)
        self.parameters = Values(library.names["parameter"], self._view("parameters", "parameter"), library.units["parameter"])
        self.inputs = Values(library.names["input"], self._view("inputs", "input"), library.units.get("input"))
        self._is_started = False

    def __repr__(self) -> str:
        return f"<Simulation of '{self._library.model}' at {self.time:.6g} s>"

    def _view(self, array: str, kind: str) -> Array:
        names = self._library.names[kind]
        return np.ctypeslib.as_array(self._library.arrays[array](self._sim), (len(names),)) if names else np.zeros(0)

    def reset(
        self, *, coordinates: Mapping[str, float] | None = None, speeds: Mapping[str, float] | None = None, dt: float | None = None,
        iterations: int | None = None, equilibrium: bool | None = None,
    ) -> Simulation:  # fmt: skip
        """Start at time 0, and return the simulation: from what the scene gives, and ``coordinates`` and ``speeds`` (SI units) besides.

        ``dt`` is the length of steps (s), ``iterations`` their fixed number in each (0: as many as it takes).  What is given stays given.

        Raises:
            KeyError: there is no such coordinate or speed.
            SimulationError: a setting is out of its range, or no consistent state was found.
        """
        call, library = self._call, self._library
        if dt is not None:
            call(library.set_step, dt)
        if iterations is not None:
            call(library.set_iterations, iterations)
        if equilibrium is not None:
            call(library.set_equilibrium, int(equilibrium))
        for kind, given, give in (("coordinate", coordinates, library.give_coordinate), ("speed", speeds, library.give_speed)):
            places = {name: i for i, name in enumerate(library.names[kind])}
            for name, value in (given or {}).items():
                call(give, find_place(places, name), value)
        call(library.start)
        self._is_started = True
        return self

    def step(self) -> None:
        """Take one step.

        Raises:
            SimulationError: the step failed, and the state stays; or there was no `reset`.
        """
        if status := self._library.step(self._sim):
            self._fail(status)

    def advance(self, time: float) -> None:
        """Take steps up to a time (s); the last one is shorter where it must be.

        Raises:
            SimulationError: a step failed, the time has passed, or there was no `reset`.
        """
        self._call(self._library.advance, time)

    def play(self, steps: int) -> Array:
        """Take so many steps; returns the outputs at the end of each, (steps, outputs).

        Raises:
            SimulationError: a step failed, or there was no `reset`.
        """
        rows = np.empty((steps, len(self._library.names["output"])))
        self._call(self._library.play, steps, rows.ctypes.data)
        return rows

    @property
    def time(self) -> float:
        """The present time (s)."""
        return float(self._library.time(self._sim))

    @property
    def outputs(self) -> Values:
        """The outputs of the scene at the present state.

        Raises:
            SimulationError: there was no `reset`.
        """
        self._require_start()
        self._library.outputs(self._sim)
        return self._outputs

    @cached_property
    def _outputs(self) -> Values:
        names = self._library.names["output"]
        array = np.ctypeslib.as_array(self._library.outputs(self._sim), (len(names),)) if names else np.zeros(0)
        return Values(names, array, self._library.units["output"])

    @property
    def coordinates(self) -> Values:
        """Coordinates of the joints of the spanning tree; `set_state` changes them.

        Raises:
            SimulationError: there was no `reset`.
        """
        return self._state("coordinates", "coordinate")

    @property
    def speeds(self) -> Values:
        """Their speeds; `set_state` changes them.

        Raises:
            SimulationError: there was no `reset`.
        """
        return self._state("speeds", "speed")

    @property
    def accelerations(self) -> Values:
        """The rates of the speeds, by the names of these.

        Raises:
            SimulationError: there was no `reset`.
        """
        return self._state("accelerations", "speed")

    def _state(self, array: str, kind: str) -> Values:
        self._require_start()
        view = self._view(array, kind)
        view.flags.writeable = False
        return Values(self._library.names[kind], view)

    def set_input(self, name: str, value: float, rate: float = 0.0, acceleration: float = 0.0) -> None:
        """Give an input now, and the derivatives (SI units and s) by which it goes on until it is given again, as a guide needs them.

        Raises:
            KeyError: there is no such input.
            SimulationError: a number is not finite.
        """
        place = find_place({each: i for i, each in enumerate(self._library.names["input"])}, name)
        self._call(self._library.set_input, place, value, rate, acceleration)

    def set_state(self, time: float, coordinates: Array, speeds: Array) -> None:
        """Go on from a time (s), coordinates and speeds as they are, in the order of those of the simulation.

        Raises:
            ValueError: an array has another length.
            SimulationError: a number is not finite, an acceleration has no finite value, or there was no `reset`.
        """
        q, v = (np.ascontiguousarray(x, dtype=np.float64) for x in (coordinates, speeds))
        lengths = tuple(len(self._library.names[kind]) for kind in ("coordinate", "speed"))
        if (q.shape, v.shape) != ((lengths[0],), (lengths[1],)):
            raise ValueError(f"there are {lengths[0]} coordinates and {lengths[1]} speeds, not {q.shape} and {v.shape}")
        self._call(self._library.set_state, time, q.ctypes.data, v.ctypes.data)

    def snapshot(self) -> bytes:
        """Everything that later steps follow from: after `restore` they are the same bit by bit.

        Raises:
            SimulationError: there was no `reset`.
        """
        room = ctypes.create_string_buffer(self._library.snapshot_size())
        self._call(self._library.save, ctypes.addressof(room))
        return room.raw

    def restore(self, snapshot: bytes) -> None:
        """Go on from a snapshot of this or another simulation of the same model and scene.

        Raises:
            ValueError: the bytes are none.
        """
        room = ctypes.create_string_buffer(snapshot, len(snapshot))
        if len(snapshot) != self._library.snapshot_size() or self._library.restore(self._sim, ctypes.addressof(room)):
            raise ValueError(f"these bytes are no snapshot of '{self._library.model}'")
        self._is_started = True

    def copy(self) -> Simulation:
        """Another simulation in the same state, or a fresh one where there was no `reset`."""
        other = Simulation(self._library)
        if self._is_started:
            other.restore(self.snapshot())
        else:
            other.parameters.array[:] = self.parameters.array
        return other

    def _require_start(self) -> None:
        if not self._is_started:
            raise SimulationError("the simulation has not been started; call reset()", -3)

    def _call(self, function: Callable[..., int], *arguments: object) -> None:
        if status := function(self._sim, *arguments):
            self._fail(status)

    def _fail(self, status: int) -> None:
        text = self._library.status_text(status)
        if status > 0:
            room = ctypes.create_string_buffer(_TEXT)
            self._library.explain(self._sim, room, _TEXT)
            text = room.value
        hint = "" if self._is_started else "; call reset()"
        raise SimulationError(f"{self._library.model}, at {self.time:.6g} s: {text.decode()}{hint if status < 0 else ''}", status)


def load(path: AnyPath, *, scene: str | None = None, flags: Sequence[str] = FLAGS) -> Simulation:
    """Compile a model file for a scene, the only one if none is named, or find it in the cache; `Simulation.reset` comes next.

    Steps are those of the recursive method with the trapezoidal rule, as long as the scene says.

    Raises:
        ModelError, TopologyError, NoInertiaError, GuideError, RunError: the model or the scene is wrong.
        ToolchainError: a tool is not installed, or the compiler failed.
    """
    model = read_model(path)
    chosen = find_scene(model, scene)
    equations, program, source = generate(model, chosen, chosen.outputs)
    standalone = make_standalone(equations.mechanism, program, source)
    return Simulation(Library(standalone.build_library(flags), standalone.name, standalone.size, has_inputs=bool(equations.inputs)))


def rollout(
    simulation: Simulation, steps: int, *, parameters: Mapping[str, Sequence[float]] | None = None,
    snapshots: Sequence[bytes] | None = None, threads: int | None = None,
) -> Array:  # fmt: skip
    """Many simulations from a state or several: the outputs of each at the end of each step, (simulations, steps, outputs).

    ``parameters`` have a value for each simulation, ``snapshots`` a state; where there are none all start as ``simulation`` stands, which
    itself stays.  They run in ``threads`` (as many as there are processors).  Where a step fails, the rows from there on are NaN.

    Raises:
        ValueError: the numbers of simulations differ, or there is nothing to tell it by.
        KeyError: there is no such parameter.
        SimulationError: there was no `Simulation.reset`.
    """
    values = {name: [float(v) for v in column] for name, column in (parameters or {}).items()}
    counts = {len(column) for column in values.values()} | ({len(snapshots)} if snapshots is not None else set())
    if len(counts) != 1:
        raise ValueError(f"parameters and snapshots need one and the same number of simulations, not {sorted(counts)}")
    common = simulation.snapshot()
    rows = np.full((counts.pop(), steps, len(simulation.outputs)), np.nan)

    def run(i: int) -> None:
        one = Simulation(simulation._library)
        one.restore(common if snapshots is None else snapshots[i])
        for name, column in values.items():
            one.parameters[name] = column[i]
        one._library.play(one._sim, steps, rows[i].ctypes.data)

    with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        list(pool.map(run, range(len(rows))))
    return rows
