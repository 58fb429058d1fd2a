"""FMUs of models, and their instances by ctypes, the same way for both versions of the standard."""

from __future__ import annotations

import ctypes
import io
import zipfile
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from cutjoint.export.fmu.archive import Fmu, make_fmu
from cutjoint.model.read import read_model_text
from cutjoint.run.scenes import find_scene
from tests.conftest import MODELS
from tests.mechanisms.bouncing import bouncing_text
from tests.mechanisms.driven import DRIVEN, pushed_text
from tests.mechanisms.spinning import SPINNING
from tests.mechanisms.swaying import swaying_text

OK, DISCARD, ERROR = 0, 2, 3

_LOGGER_2 = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p, ctypes.c_char_p
)
_UPDATE = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_double, *[ctypes.c_bool] * 4, ctypes.POINTER(ctypes.c_bool), ctypes.POINTER(ctypes.c_double)
)  # fmt: skip
_LOGGER_3 = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)


class _Callbacks(ctypes.Structure):
    _fields_ = [
        ("logger", _LOGGER_2), ("allocate", ctypes.c_void_p), ("free", ctypes.c_void_p), ("finished", ctypes.c_void_p),
        ("environment", ctypes.c_void_p),
    ]  # fmt: skip


@cache
def fmu_of(
    name: str, version: int, scene: str | None = None, integrator: str | None = None, kind: str = "cs", method: str = "recursive"
) -> Fmu:
    """The FMU of a model of the repository, or of a mechanism of the tests."""
    model = read_model_text(text_of(name), f"{name}.yaml")
    return make_fmu(model, find_scene(model, scene), version=version, integrator=integrator, kind=kind, method=method)


#: Mechanisms of the tests, by names.
_TEXTS = {"driven": DRIVEN, "spinning": SPINNING, "bounce": bouncing_text(5.0, 0.3), "swaying": swaying_text(),
          "pushed": pushed_text("push - 50*max(position - 0.3, 0)")}  # fmt: skip


def text_of(name: str) -> str:
    """The text of a model of the repository, or of a mechanism of the tests."""
    return _TEXTS.get(name) or (MODELS / f"{name}.yaml").read_text(encoding="utf-8")


def write(fmu: Fmu, place: Path, **content: bool) -> Path:
    """The FMU's file, with a binary alone unless said otherwise."""
    file = place / f"{fmu.standalone.name}{fmu.version}.fmu"
    file.write_bytes(packed(fmu, **({"sources": False, "binary": True} | content)))
    return file


def packed(fmu: Fmu, **content: Any) -> bytes:
    """The FMU's archive, as the command writes it but for binaries, which have the code of the command line alone."""
    return fmu.pack(**({"target": "baseline"} | content))


def names_in(packed: bytes) -> list[str]:
    """The files of an archive."""
    return zipfile.ZipFile(io.BytesIO(packed)).namelist()


class Slave:
    """An instance; ``log`` has the messages of its logger.  Methods return statuses.

    In FMI 3 it learns whether the host handles ``events`` and lets steps end ``early``; ``update`` is called within steps with the time,
    and returns at which it wants the step to end, or None.  ``event``, ``early`` and ``last`` are what the last step said, with the time
    that it came to.
    """

    def __init__(
        self, fmu: Fmu, *, token: str | None = None, exchanges: bool = False, events: bool = False, early: bool = False,
        update: Callable[[float], float | None] | None = None, intermediate: Sequence[str] = (),
    ) -> None:  # fmt: skip
        self.fmu, self.log, self._exchanges = fmu, list[str](), exchanges
        self._host, self._update, self._intermediate = (ctypes.c_bool(events), ctypes.c_bool(early)), update, intermediate
        self.event, self.early, self.last = False, False, 0.0
        self.references = {v.name: i for i, v in enumerate(fmu.interface.variables)}
        self._library = ctypes.CDLL(str(fmu.build(target="baseline")))
        guid = (fmu.subject.token if token is None else token).encode()
        self._instantiate = self._instantiate_2 if fmu.version == 2 else self._instantiate_3
        self._c = ctypes.c_void_p(self._instantiate(guid))

    def _instantiate_2(self, guid: bytes) -> Any:
        self._logger: Any = _LOGGER_2(lambda _, name, status, category, form, text: self.log.append(text.decode()))
        self._callbacks = _Callbacks(self._logger, None, None, None, None)
        function = self._library.fmi2Instantiate
        function.restype = ctypes.c_void_p
        return function(b"slave", 0 if self._exchanges else 1, guid, b"", ctypes.byref(self._callbacks), 0, 0)

    def _instantiate_3(self, guid: bytes) -> Any:
        self._logger = _LOGGER_3(lambda _, status, category, text: self.log.append(text.decode()))
        no = ctypes.c_bool(False)
        if self._exchanges:
            function = self._library.fmi3InstantiateModelExchange
            function.restype = ctypes.c_void_p
            return function(b"slave", guid, b"", no, no, None, self._logger)
        function = self._library.fmi3InstantiateCoSimulation
        function.restype = ctypes.c_void_p
        places = (ctypes.c_uint * len(self._intermediate))(*[self.references[name] for name in self._intermediate])
        self._called: Any = _UPDATE(self._on_update) if self._update else None
        return function(b"slave", guid, b"", no, no, *self._host, places, ctypes.c_size_t(len(places)), None, self._logger, self._called)

    def _on_update(self, _: Any, time: float, *rest: Any) -> None:
        """Of the flags before the answer the first is about inputs, the last about early return."""
        assert self._update is not None
        assert rest[:3] == (False, True, True)
        assert rest[3] == self._host[1].value
        wanted = self._update(time)
        if wanted is not None:
            rest[4][0], rest[5][0] = True, wanted

    @property
    def exists(self) -> bool:
        """True if the FMU made the instance."""
        return bool(self._c)

    def call(self, name: str, *arguments: Any) -> int:
        """A function by its name without the version's prefix."""
        return int(getattr(self._library, f"fmi{self.fmu.version}{name}")(self._c, *arguments))

    def initialise(self, *, start: float = 0.0, stop: float | None = None, enter_only: bool = False) -> int:
        """Set up, enter and leave initialization mode."""
        times = (ctypes.c_double(start), ctypes.c_int(stop is not None), ctypes.c_double(stop or 0.0))
        no = (ctypes.c_int(0), ctypes.c_double(0.0))
        if self.fmu.version == 2:
            status = self.call("SetupExperiment", *no, *times) or self.call("EnterInitializationMode")
        else:
            status = self.call("EnterInitializationMode", *no, *times)
        return status if status or enter_only else self.call("ExitInitializationMode")

    def step(self, point: float, size: float) -> int:
        """A communication step."""
        here = (ctypes.c_double(point), ctypes.c_double(size), ctypes.c_int(1))
        if self.fmu.version == 2:
            return self.call("DoStep", *here)
        flags, last = [ctypes.c_bool() for _ in range(3)], ctypes.c_double()
        status = self.call("DoStep", *here, *map(ctypes.byref, flags), ctypes.byref(last))
        self.event, self.early, self.last = flags[0].value, flags[2].value, last.value
        return status

    def _values(self, function: str, references: Sequence[int], values: Any) -> int:
        count = ctypes.c_size_t(len(references))
        places = (ctypes.c_uint * len(references))(*references)
        name, more = ("Real", ()) if self.fmu.version == 2 else ("Float64", (count,))
        return self.call(f"{function}{name}", places, count, values, *more)

    def set(self, **values: float) -> int:
        """Set variables by their names, with __ for dots."""
        references = [self.references[name.replace("__", ".")] for name in values]
        return self._values("Set", references, (ctypes.c_double * len(values))(*values.values()))

    def set_reference(self, reference: int, value: float) -> int:
        """Set a variable by its value reference."""
        return self._values("Set", [reference], (ctypes.c_double * 1)(value))

    def get(self, *names: str) -> list[float]:
        """Variables by their names; all outputs without."""
        chosen = names or [v.name for v in self.fmu.interface.outputs]
        values = (ctypes.c_double * len(chosen))()
        assert self._values("Get", [self.references[name] for name in chosen], values) == OK, self.log
        return list(values)

    def get_reference(self, reference: int) -> int:
        """The status of asking for a variable by its value reference."""
        return self._values("Get", [reference], (ctypes.c_double * 1)())

    def slope(self, name: str, *derivatives: float) -> int:
        """The derivatives of an input in FMI 2, of first and higher order."""
        n = len(derivatives)
        orders, values = (ctypes.c_int * n)(*range(1, n + 1)), (ctypes.c_double * n)(*derivatives)
        return self.call("SetRealInputDerivatives", (ctypes.c_uint * n)(*[self.references[name]] * n), ctypes.c_size_t(n), orders, values)

    def _state(self, name: str) -> str:
        return name.replace("State", "state") if self.fmu.version == 2 else name

    def save(self) -> ctypes.c_void_p:
        """A state of the instance."""
        state = ctypes.c_void_p()
        assert self.call(self._state("GetFMUState"), ctypes.byref(state)) == OK, self.log
        return state

    def restore(self, state: ctypes.c_void_p | None) -> int:
        """Return to a state."""
        return self.call(self._state("SetFMUState"), state)

    def free_state(self, state: ctypes.c_void_p) -> int:
        """Give the memory of a state back."""
        return self.call(self._state("FreeFMUState"), ctypes.byref(state))

    def serialise(self, state: ctypes.c_void_p) -> bytes:
        """The bytes of a state."""
        size = ctypes.c_size_t()
        assert self.call(self._state("SerializedFMUStateSize"), state, ctypes.byref(size)) == OK, self.log
        data = ctypes.create_string_buffer(size.value)
        assert self.call(self._state("SerializeFMUState"), state, data, size) == OK, self.log
        return data.raw

    def deserialise(self, data: bytes) -> tuple[int, ctypes.c_void_p]:
        """A state of bytes."""
        state, name = ctypes.c_void_p(), "DeSerialize" if self.fmu.version == 2 else "Deserialize"
        buffer = ctypes.create_string_buffer(data, len(data))
        return self.call(self._state(f"{name}FMUState"), buffer, ctypes.c_size_t(len(data)), ctypes.byref(state)), state

    def free(self) -> None:
        """Free the instance, once."""
        getattr(self._library, f"fmi{self.fmu.version}FreeInstance")(self._c)
        self._c = ctypes.c_void_p()


def started(fmu: Fmu, **host: Any) -> Slave:
    """An instance in step mode, or in event mode if its host handles events."""
    slave = Slave(fmu, **host)
    assert slave.initialise() == OK, slave.log
    return slave


def advanced(slave: Slave, steps: int, size: float, begin: float = 0.0) -> list[list[float]]:
    """The outputs after each of so many communication steps."""
    rows = []
    for i in range(steps):
        assert slave.step(begin + i * size, size) == OK, slave.log
        rows.append(slave.get())
    return rows
