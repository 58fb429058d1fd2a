"""A co-simulation FMU, read by FMPy, and its instances."""

import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cutjoint.coupling.process import ControllerError, SlaveProcess
from cutjoint.package.errors import RunError
from cutjoint.package.extensions import find_package
from cutjoint.toolchain.temporary import temporary_folder

#: The longest duration of a call of an FMU, s.
CALL_LIMIT = 60.0


@dataclass(frozen=True, kw_only=True)
class Unit:
    """A unit of an FMU: ``powers`` of kg, m, s, A, K, mol, cd; SI value = ``factor`` times the FMU's value + ``offset``."""

    name: str
    powers: tuple[int, ...]
    factor: float
    offset: float


@dataclass(frozen=True, kw_only=True)
class Port:
    """An input or output of an FMU.  ``unit`` is None where the FMU does not define it, and values are then in SI units; ``fault`` says why
    it cannot be connected, "" if it can."""

    name: str
    reference: int
    causality: str
    unit: Unit | None
    fault: str

    def to_si(self, value: float) -> float:
        """A value of the FMU in SI units."""
        return value if self.unit is None else self.unit.factor * value + self.unit.offset

    def from_si(self, value: float) -> float:
        """A value in the FMU's unit, from SI units."""
        return value if self.unit is None else (value - self.unit.offset) / self.unit.factor


class ControllerFmu:
    """An opened FMU: its ``ports`` by name, ``default_step`` (s) of its default experiment, None if it has none.

    It has one instance at a time: `instantiate`, `begin`, `set` and `get`, `start`, then `step` after `step`, `close`.  Values are in the
    FMU's units. Raises ControllerError: the binary cannot be loaded, the FMU refuses a call, or does not come back from it.
    """

    def __init__(self, path: Path, description: Any, process: SlaveProcess) -> None:
        self.path, self._description, self._process = path, description, process
        self._call, self.close = process.call, process.close
        units = {unit.name: unit for unit in description.unitDefinitions}
        variables = [v for v in description.modelVariables if v.causality in ("input", "output")]
        self.ports = {v.name: _port(v, units) for v in variables}
        experiment = description.defaultExperiment
        self.default_step = None if experiment is None or experiment.stepSize is None else float(experiment.stepSize)

    @property
    def fault(self) -> str:
        """The error while an instance was terminated; "" without one."""
        return self._process.fault

    @property
    def version(self) -> str:
        """2 or 3."""
        return str(self._description.fmiVersion)[0]

    def instantiate(self) -> "ControllerFmu":
        """Make a new instance; the previous one must be closed."""
        self._call("it cannot be instantiated", "instantiate")
        return self

    def begin(self, end: float) -> None:
        """Initialise for a run from time 0 to ``end`` (s)."""
        self._call("it cannot begin", "begin", end)

    def start(self) -> None:
        """End the initialisation."""
        self._call("it cannot begin", "start")

    def set(self, ports: Sequence[Port], values: Sequence[float]) -> None:
        """Set inputs."""
        self._call(f"inputs {', '.join(p.name for p in ports)} cannot be given", "set", [p.reference for p in ports], list(values))

    def get(self, ports: Sequence[Port]) -> list[float]:
        """The values of outputs."""
        found = self._call(f"outputs {', '.join(p.name for p in ports)} cannot be read", "get", [p.reference for p in ports])
        return [float(value) for value in found]

    def step(self, time: float, size: float) -> None:
        """A communication step (s) from a time (s)."""
        if self._call(f"the step from {time:.6g} s failed", "step", time, size):
            raise ControllerError(f"{self.path}: it ends the simulation at {time + size:.6g} s")


@contextmanager
def open_controller(path: Path, seconds: float = CALL_LIMIT) -> Iterator[ControllerFmu]:
    """Open a co-simulation FMU of FMI 2 or 3, whose calls may take so many ``seconds``; its files lie in a temporary folder meanwhile.
    Raises RunError: FMPy is not installed, the file is no FMU, or the FMU has no co-simulation or no binary for this machine."""
    fmpy = find_package("fmpy", otherwise=RunError("FMUs need FMPy: install cutjoint[fmu]"))
    if not path.is_file():
        raise RunError(f"{path}: this is no file; an FMU is a ZIP archive")
    with temporary_folder() as folder:
        try:
            fmpy.extract(str(path), unzipdir=str(folder))
            description = fmpy.read_model_description(str(folder))
        except zipfile.BadZipFile:
            raise RunError(f"{path}: this is no FMU, which is a ZIP archive") from None
        except Exception as error:  # of FMPy, which has no class for them
            raise RunError(f"{path}: this is no FMU that can be read: {error}") from None
        _require_co_simulation(path, folder, description, fmpy)
        process = SlaveProcess(path, folder, seconds)
        try:
            yield ControllerFmu(path, description, process)
        finally:
            process.kill()


def _require_co_simulation(path: Path, folder: Path, description: Any, fmpy: Any) -> None:
    version = str(description.fmiVersion)
    if version[0] not in ("2", "3"):
        raise RunError(f"{path}: FMI {version} is not one of FMI 2 and 3")
    if description.coSimulation is None:
        kinds = {"model exchange": description.modelExchange, "scheduled execution": description.scheduledExecution}
        has = " and ".join(name for name, found in kinds.items() if found is not None) or "nothing"
        raise RunError(f"{path}: the FMU has no co-simulation but {has}; export it for co-simulation")
    wanted = fmpy.platform_tuple if version[0] == "3" else fmpy.platform
    name = f"{description.coSimulation.modelIdentifier}{fmpy.sharedLibraryExtension}"
    if not (folder / "binaries" / wanted / name).is_file():
        there = sorted(x.name for x in (folder / "binaries").glob("*")) or ["none"]
        advice = f"'fmpy compile {path}' builds one from its sources" if (folder / "sources").is_dir() else "ask its maker for one"
        raise RunError(f"{path}: the FMU has no binary for {wanted} (it has {', '.join(there)}); {advice}")


def _port(variable: Any, units: Mapping[str, Any]) -> Port:
    fault = "" if variable.type in ("Real", "Float64") else f"its type is {variable.type}, and only real numbers are connected"
    if variable.dimensions:
        fault = "it is an array, and only single numbers are connected"
    name = variable.unit or (variable.declaredType.unit if variable.declaredType is not None else None) or ""
    return Port(
        name=variable.name, reference=variable.valueReference, causality=variable.causality, unit=_unit(units.get(name)), fault=fault
    )  # fmt: skip


def _unit(unit: Any) -> Unit | None:
    if unit is None or unit.baseUnit is None:
        return None
    base = unit.baseUnit
    powers = tuple(int(getattr(base, name) or 0) for name in ("kg", "m", "s", "A", "K", "mol", "cd"))
    return Unit(name=unit.name, powers=powers, factor=float(base.factor or 1.0), offset=float(base.offset or 0.0))
