"""Connections between controllers and a model, from names or from a system description.

Systems are those of System Structure and Parameterization 1.0 (Modelica Association, 2019).
"""

import re
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from cutjoint.coupling.controller import ControllerFmu, Port
from cutjoint.formulate.inputs import guided_by, input_parameters
from cutjoint.model.errors import nearest
from cutjoint.model.expressions.quantities import unit_of
from cutjoint.model.expressions.units import measure
from cutjoint.model.records import Model, Scene
from cutjoint.package.errors import RunError
from cutjoint.package.extensions import find_package
from cutjoint.toolchain.temporary import temporary_folder

#: The suffix of a system's archive, the structure file in it, and its namespace.
SYSTEM, _STRUCTURE, _SPACE = ".ssp", "SystemStructure.ssd", "{http://ssp-standard.org/SSP1/SystemStructureDescription}"
#: Largest sizes in bytes: of the structure, of an FMU.
_LARGEST_STRUCTURE, _LARGEST_FMU = 1 << 24, 1 << 30
_FMU = "application/x-fmu-sharedlibrary"


@dataclass(frozen=True, kw_only=True)
class Connections:
    """Ports of an FMU by the model's names.

    * ``driven``: the output that drives each input of the model; ``steering``: driven inputs that move guides
    * ``read``: pairs of an output of the model and the FMU's input; ``sizes``: the units of these outputs in SI
    * ``passed``: another FMU's number and output, and the input that reads it; ``constant``: inputs that keep their start value
    """

    driven: Mapping[str, Port]
    read: tuple[tuple[str, Port], ...]
    sizes: Mapping[str, float]
    steering: frozenset[str]
    passed: tuple[tuple[int, Port, Port], ...]
    constant: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class System:
    """FMUs, and the names to which their ports are connected, as of `connect`; ``is_whole`` if nothing else is."""

    fmus: Sequence[Path]
    named: Mapping[str, str]
    is_whole: bool = False


@contextmanager
def open_system(files: Sequence[Path], named: Mapping[str, str], model: str) -> Iterator[System]:
    """Open FMUs, or the FMUs of a system archive; the component with the model's name stands for the model.
    The FMUs are extracted to a temporary folder, by the names of their components. Raises RunError: the archive stands beside other files
    or connections, is damaged, or has what a run beside a model does not know."""
    if not any(file.suffix == SYSTEM for file in files):
        yield System(fmus=files, named=named)
        return
    if len(files) > 1 or named:
        raise RunError(f"{files[0]}: a system contains its FMUs and connections; pass only the system, without --connect")
    with temporary_folder() as folder:
        try:
            with zipfile.ZipFile(files[0]) as archive:
                system = _read_system(files[0], archive, model, Path(folder))
        except (OSError, zipfile.BadZipFile, KeyError) as error:
            raise RunError(f"{files[0]}: no system can be read from it: {str(error).strip(chr(34))}") from None
        yield system


def _read_system(path: Path, archive: zipfile.ZipFile, model: str, folder: Path) -> System:
    root = _parsed(path, _content(archive, _STRUCTURE, _LARGEST_STRUCTURE))
    inner = root.find(f"{_SPACE}System")
    if inner is None:
        raise RunError(f"{path}: {_STRUCTURE} has no system")
    _require_plain(path, inner, "the system")
    components = {str(each.get("name")): each for each in inner.iterfind(f"{_SPACE}Elements/*")}
    if model not in components:
        raise RunError(f"{path}: the system has no component '{model}', as the model is named; {nearest(model, components, 'it has')}")
    fmus = [_extracted(path, archive, each, name, folder) for name, each in components.items() if name != model]
    named: dict[str, str] = {}
    for each in inner.iterfind(f"{_SPACE}Connections/*"):
        port, name = _connection(path, each, components, model)
        if named.setdefault(port, name) != name:
            raise RunError(f"{path}: '{port}' is connected with '{named[port]}' and with '{name}'; a port has one")
    return System(fmus=fmus, named=named, is_whole=True)


def _parsed(path: Path, content: bytes) -> Any:
    """The root of a structure; entities are not expanded and nothing is loaded."""
    etree = find_package("lxml.etree", otherwise=RunError("systems of FMUs need FMPy: install cutjoint[fmu]"))  # which brings lxml
    try:
        root = etree.fromstring(content, etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False))
    except etree.XMLSyntaxError as error:
        raise RunError(f"{path}: {_STRUCTURE}: {error}") from None
    if root.getroottree().docinfo.internalDTD is not None:
        raise RunError(f"{path}: {_STRUCTURE} has a document type, which no system needs")
    if root.tag != f"{_SPACE}SystemStructureDescription":
        raise RunError(f"{path}: {_STRUCTURE} is no system structure of SSP 1.0")
    return root


def _content(archive: zipfile.ZipFile, name: str, most: int) -> bytes:
    if archive.getinfo(name).file_size > most:
        raise OSError(f"'{name}' has more than {most} bytes")
    return archive.read(name)


def _require_plain(path: Path, element: Any, whose: str) -> None:
    """Check that no element changes values in a way that runs do not support."""
    if any(element.find(f"{_SPACE}{tag}") is not None for tag in ("ParameterBindings", "SignalDictionaries")):
        raise RunError(f"{path}: {whose} has parameter bindings or signal dictionaries, which are not read; put values into the FMUs")


def _extracted(path: Path, archive: zipfile.ZipFile, element: Any, name: str, folder: Path) -> Path:
    """The FMU of a component, in a file of its name."""
    whose, source = f"component '{name}'", unquote(str(element.get("source") or ""))
    _require_plain(path, element, whose)
    if element.tag != f"{_SPACE}Component" or element.get("type", _FMU) != _FMU or element.get("implementation") == "ModelExchange":
        raise RunError(f"{path}: {whose} is no FMU for co-simulation")
    if not re.fullmatch(r"\w[\w .-]*", name):
        raise RunError(f"{path}: {whose}: name it by letters, digits and underscores")
    if not source.startswith("resources/") or ".." in source.split("/") or source not in archive.namelist():
        raise RunError(f"{path}: {whose}: its source '{source}' is no file in resources/ of the system")
    file = folder / f"{name}.fmu"
    file.write_bytes(_content(archive, source, _LARGEST_FMU))
    return file


def _connection(path: Path, element: Any, components: Mapping[str, Any], model: str) -> tuple[str, str]:
    """The port of an FMU, and the name to which it is connected."""
    ends = [(str(element.get(f"{end}Element") or ""), str(element.get(f"{end}Connector"))) for end in ("start", "end")]
    words = " to ".join(f"{owner}.{connector}" for owner, connector in ends)
    if element.tag != f"{_SPACE}Connection" or len(element) or element.get("suppressUnitConversion") == "true":
        raise RunError(f"{path}: the connection {words} transforms its values; use plain connections")
    for owner, _ in ends:
        if owner not in components:
            raise RunError(f"{path}: the connection {words}: no component is named '{owner}'; connect components only")
    (start, source), (end, sink) = ends
    if start == end:
        raise RunError(f"{path}: the connection {words} is within one component")
    if start == model:
        return f"{end}:{sink}", source
    return (f"{start}:{source}", sink) if end == model else (f"{end}:{sink}", f"{start}:{source}")


def connect(
    fmus: Sequence[ControllerFmu], model: Model, scene: Scene, named: Mapping[str, str], *, is_whole: bool = False
) -> tuple[Connections, ...]:
    """The connections of each FMU, of ports with inputs and outputs of the model of the same names, or of their names in ``named``.
    A name in ``named`` may be a port of another FMU. If ``whole``, only ports in ``named`` are connected. Raises RunError: there is no such
    port, input or output, a unit is of another dimension, an input has two sources, or an FMU is not connected."""
    names = [set(model_names) for model_names in (_inputs(model), _outputs(model, scene))]
    own: list[dict[str, str]] = [{} for _ in fmus]
    passed: list[list[tuple[int, Port, Port]]] = [[] for _ in fmus]
    for word, name in named.items():
        here = number, port = find_port(fmus, word, word)
        if name in names[port.causality == "input"] or (there := _other_port(fmus, number, word, name)) is None:
            own[number][port.name] = name
            continue
        (giver, source), (taker, sink) = (here, there) if port.causality == "output" else (there, here)
        if source.causality == sink.causality:
            raise RunError(f"--connect {word}={name}: both are {sink.causality}s; connect an output with an input")
        _require_alike(fmus[giver].path, source, sink)
        passed[taker].append((giver, source, sink))
    found = tuple(_connect(i, fmus, model, scene, own[i], passed, is_whole) for i in range(len(fmus)))
    drivers: dict[str, Path] = {}
    for fmu, connections in zip(fmus, found, strict=True):
        for name in connections.driven:
            if name in drivers:
                raise RunError(f"both {drivers[name]} and {fmu.path} would drive input '{name}'; connect another input of the model")
            drivers[name] = fmu.path
    return found


def find_port(fmus: Sequence[ControllerFmu], word: str, connection: str) -> tuple[int, Port]:
    """The number of an FMU and its port that a word names: by its name, or as FMU:PORT, FMU being the file's stem.
    Raises RunError: there is none, or several FMUs have one."""
    found = [(i, fmu.ports[word]) for i, fmu in enumerate(fmus) if word in fmu.ports]
    found = found or [(i, port) for i, fmu in enumerate(fmus) for port in fmu.ports.values() if word == f"{fmu.path.stem}:{port.name}"]
    if len(found) == 1:
        return found[0]
    if found:
        both = " or ".join(f"{fmus[i].path.stem}:{port.name}" for i, port in found)
        raise RunError(f"--connect {connection}: several FMUs have '{word}'; write {both}, and rename files of the same name")
    known = [name if len(fmus) == 1 else f"{fmu.path.stem}:{name}" for fmu in fmus for name in fmu.ports]
    whose, hint = (f"{fmus[0].path} has", "it has") if len(fmus) == 1 else ("the FMUs have", "they have")
    raise RunError(f"--connect {connection}: {whose} no such input or output; {nearest(word, known, hint)}")


def _other_port(fmus: Sequence[ControllerFmu], here: int, word: str, name: str) -> tuple[int, Port] | None:
    """The named port of another FMU; None if no FMU has it."""
    names = {x for fmu in fmus for port in fmu.ports for x in (port, f"{fmu.path.stem}:{port}")}
    if len(fmus) == 1 or name not in names:
        return None
    there = find_port(fmus, name, f"{word}={name}")
    if there[0] == here:
        raise RunError(f"--connect {word}={name}: both are ports of {fmus[here].path}; connections within an FMU are not supported")
    return there


def _inputs(model: Model) -> dict[str, str]:
    return {p.name: p.unit for p in input_parameters(model)}


def _outputs(model: Model, scene: Scene) -> dict[str, str]:
    return {o.column: unit_of(model, o) for o in scene.outputs}


def _connect(
    number: int, fmus: Sequence[ControllerFmu], model: Model, scene: Scene, named: Mapping[str, str],
    passed: Sequence[Sequence[tuple[int, Port, Port]]], is_whole: bool,
) -> Connections:  # fmt: skip
    fmu, inputs, outputs = fmus[number], _inputs(model), _outputs(model, scene)
    driven: dict[str, Port] = {}
    for port, name in _matched(fmu, "output", inputs, named, f"input of model '{model.name}'", is_whole):
        if name in driven:
            raise RunError(f"{fmu.path}: both '{driven[name].name}' and '{port.name}' would drive input '{name}'; connect one of them")
        driven[name] = port
    sinks = [sink.name for _, _, sink in passed[number]]
    matched = _matched(fmu, "input", outputs, named, f"output of scene '{scene.name}'", is_whole)
    read = tuple((name, port) for port, name in matched if port.name not in sinks or port.name in named)
    if twice := [name for name in sinks if sinks.count(name) > 1 or name in {port.name for _, port in read}]:
        raise RunError(f"{fmu.path}: input '{twice[0]}' would be driven twice; connect it once")
    if not driven and not read and not sinks and number not in {source for others in passed for source, _, _ in others}:
        ports = ", ".join(fmu.ports) or "none"
        raise RunError(
            f"{fmu.path}: none of its inputs and outputs ({ports}) has the name of one of the model's outputs ({', '.join(outputs)}) and "
            f"inputs ({', '.join(inputs) or 'none'}); say --connect PORT=NAME"
        )
    taken = {port.name for _, port in read} | set(sinks)
    return Connections(
        driven=driven, read=read, sizes={name: measure(1.0, outputs[name] or "1").value for name, _ in read},
        steering=frozenset(p.name for p in input_parameters(model) if p.name in driven and guided_by(model, p) is not None),
        passed=tuple(passed[number]), constant=tuple(p.name for p in fmu.ports.values() if p.causality == "input" and p.name not in taken),
    )  # fmt: skip


def _matched(
    fmu: ControllerFmu, causality: str, there: Mapping[str, str], named: Mapping[str, str], what: str, is_whole: bool
) -> Iterator[tuple[Port, str]]:  # fmt: skip
    """The ports of a kind with their names in the model, and checks of both."""
    for port in (p for p in fmu.ports.values() if p.causality == causality):
        if is_whole and port.name not in named:
            continue
        name = named.get(port.name, port.name)
        if name in there:
            _require_fit(fmu.path, port, name, there[name])
            yield port, name
        elif port.name in named:
            raise RunError(f"--connect {port.name}={name}: '{name}' is no {what}; {nearest(name, there, 'there is') or 'it has none'}")


def _require_fit(path: Path, port: Port, name: str, unit: str) -> None:
    if port.fault:
        raise RunError(f"{path}: '{port.name}' cannot be connected with '{name}': {port.fault}")
    if port.unit is not None and port.unit.powers != (tuple(measure(1.0, unit).dimension.exponents) if unit else (0,) * 7):
        raise RunError(f"{path}: '{port.name}' is in {port.unit.name} and '{name}' in {unit or '1'}, which is no unit of the same kind")


def _require_alike(path: Path, source: Port, sink: Port) -> None:
    for port in (source, sink):
        if port.fault:
            raise RunError(f"{path}: '{source.name}' cannot drive '{sink.name}': '{port.name}': {port.fault}")
    if source.unit is not None and sink.unit is not None and source.unit.powers != sink.unit.powers:
        raise RunError(f"{path}: '{source.name}' is in {source.unit.name} and '{sink.name}' in {sink.unit.name}, no unit of the same kind")
