"""The connections of controllers with a model and each other: outputs of each to inputs of others."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from cutjoint.coupling.controller import ControllerFmu, Port
from cutjoint.formulate.inputs import guided_by, input_parameters
from cutjoint.model.errors import nearest
from cutjoint.model.quantities import unit_of
from cutjoint.model.records import Model, Scene
from cutjoint.model.units import measure
from cutjoint.package.errors import RunError


@dataclass(frozen=True, kw_only=True)
class Connections:
    """Ports of an FMU by the model's names.

    ``driven`` has the output that drives each input of the model, ``read`` pairs of an output of the model and the input of the FMU that
    takes it, ``sizes`` the units of these outputs in SI.  ``steering`` are driven inputs that move guides, ``passed`` has another FMU's
    number and output, and the input that takes it.  ``held`` are inputs of the FMU that stay at their start.
    """

    driven: Mapping[str, Port]
    read: tuple[tuple[str, Port], ...]
    sizes: Mapping[str, float]
    steering: frozenset[str]
    passed: tuple[tuple[int, Port, Port], ...]
    held: tuple[str, ...]


def connect(fmus: Sequence[ControllerFmu], model: Model, scene: Scene, named: Mapping[str, str]) -> tuple[Connections, ...]:
    """The connections of each FMU: of each port with the input or output of its name in the model, or of its name in ``named``, which may
    be a port of another FMU.

    Raises:
        RunError: there is no such port, input or output, a unit is of another dimension, an input has two sources, or an FMU is not
            connected.
    """
    names = [set(model_names) for model_names in (_inputs(model), _outputs(model, scene))]
    own: list[dict[str, str]] = [{} for _ in fmus]
    passed: list[list[tuple[int, Port, Port]]] = [[] for _ in fmus]
    for word, name in named.items():
        here = find_port(fmus, word, word)
        if name in names[here.port.causality == "input"] or (there := _other_port(fmus, here, word, name)) is None:
            own[here.fmu][here.port.name] = name
            continue
        source, sink = (here, there) if here.port.causality == "output" else (there, here)
        if source.port.causality == sink.port.causality:
            raise RunError(f"--connect {word}={name}: both are {sink.port.causality}s; connect an output with an input")
        _require_alike(fmus[source.fmu].path, source.port, sink.port)
        passed[sink.fmu].append((source.fmu, source.port, sink.port))
    found = tuple(_connect(i, fmus, model, scene, own[i], passed) for i in range(len(fmus)))
    drivers: dict[str, Path] = {}
    for fmu, connections in zip(fmus, found, strict=True):
        for name in connections.driven:
            if name in drivers:
                raise RunError(f"both {drivers[name]} and {fmu.path} would drive input '{name}'; connect another input of the model")
            drivers[name] = fmu.path
    return found


@dataclass(frozen=True)
class PortOf:
    """A port of the FMU of a number."""

    fmu: int
    port: Port


def find_port(fmus: Sequence[ControllerFmu], word: str, connection: str) -> PortOf:
    """The port that a word names: by its name, or as FMU:PORT, where FMU is the file's name without its ending.

    Raises:
        RunError: there is none, or several FMUs have one.
    """
    found = [PortOf(i, fmu.ports[word]) for i, fmu in enumerate(fmus) if word in fmu.ports]
    found = found or [
        PortOf(i, port) for i, fmu in enumerate(fmus) for port in fmu.ports.values() if word == f"{fmu.path.stem}:{port.name}"
    ]  # fmt: skip
    if len(found) == 1:
        return found[0]
    if found:
        both = " or ".join(f"{fmus[x.fmu].path.stem}:{x.port.name}" for x in found)
        raise RunError(f"--connect {connection}: several FMUs have '{word}'; write {both}, and give files of one name other ones")
    known = [name if len(fmus) == 1 else f"{fmu.path.stem}:{name}" for fmu in fmus for name in fmu.ports]
    whose, hint = (f"{fmus[0].path} has", "it has") if len(fmus) == 1 else ("the FMUs have", "they have")
    raise RunError(f"--connect {connection}: {whose} no such input or output; {nearest(word, known, hint)}")


def _other_port(fmus: Sequence[ControllerFmu], here: PortOf, word: str, name: str) -> PortOf | None:
    """The port of another FMU that is named, None where no FMU has it."""
    names = {x for fmu in fmus for port in fmu.ports for x in (port, f"{fmu.path.stem}:{port}")}
    if len(fmus) == 1 or name not in names:
        return None
    there = find_port(fmus, name, f"{word}={name}")
    if there.fmu == here.fmu:
        raise RunError(f"--connect {word}={name}: both are ports of {fmus[here.fmu].path}; an FMU has its own connections inside")
    return there


def _inputs(model: Model) -> dict[str, str]:
    return {p.name: p.unit for p in input_parameters(model)}


def _outputs(model: Model, scene: Scene) -> dict[str, str]:
    return {o.column: unit_of(model, o) for o in scene.outputs}


def _connect(
    number: int, fmus: Sequence[ControllerFmu], model: Model, scene: Scene, named: Mapping[str, str],
    passed: Sequence[Sequence[tuple[int, Port, Port]]],
) -> Connections:  # fmt: skip
    fmu, inputs, outputs = fmus[number], _inputs(model), _outputs(model, scene)
    driven: dict[str, Port] = {}
    for port, name in _matched(fmu, "output", inputs, named, f"input of model '{model.name}'"):
        if name in driven:
            raise RunError(f"{fmu.path}: both '{driven[name].name}' and '{port.name}' would drive input '{name}'; connect one of them")
        driven[name] = port
    given = [sink.name for _, _, sink in passed[number]]
    matched = _matched(fmu, "input", outputs, named, f"output of scene '{scene.name}'")
    read = tuple((name, port) for port, name in matched if port.name not in given or port.name in named)
    if twice := [name for name in given if given.count(name) > 1 or name in {port.name for _, port in read}]:
        raise RunError(f"{fmu.path}: input '{twice[0]}' would be driven twice; connect it once")
    if not driven and not read and not given and number not in {source for others in passed for source, _, _ in others}:
        ports = ", ".join(fmu.ports) or "none"
        raise RunError(
            f"{fmu.path}: none of its inputs and outputs ({ports}) has the name of one of the model's outputs ({', '.join(outputs)}) and "
            f"inputs ({', '.join(inputs) or 'none'}); say --connect PORT=NAME"
        )
    taken = {port.name for _, port in read} | set(given)
    return Connections(
        driven=driven, read=read, sizes={name: measure(1.0, outputs[name] or "1").value for name, _ in read},
        steering=frozenset(p.name for p in input_parameters(model) if p.name in driven and guided_by(model, p) is not None),
        passed=tuple(passed[number]),
        held=tuple(p.name for p in fmu.ports.values() if p.causality == "input" and p.name not in taken),
    )  # fmt: skip


def _matched(
    fmu: ControllerFmu, causality: str, there: Mapping[str, str], named: Mapping[str, str], what: str
) -> Iterator[tuple[Port, str]]:  # fmt: skip
    """The ports of a kind with their names in the model, and checks of both."""
    for port in (p for p in fmu.ports.values() if p.causality == causality):
        name = named.get(port.name, port.name)
        if name in there:
            _require_fit(fmu.path, port, name, there[name])
            yield port, name
        elif port.name in named:
            raise RunError(f"--connect {port.name}={name}: '{name}' is no {what}; {nearest(name, there, 'there is') or 'it has none'}")


def _require_fit(path: Path, port: Port, name: str, unit: str) -> None:
    if port.fault:
        raise RunError(f"{path}: '{port.name}' cannot be connected with '{name}': {port.fault}")
    if port.unit is not None and port.unit.powers != _powers(unit):
        raise RunError(f"{path}: '{port.name}' is in {port.unit.name} and '{name}' in {unit or '1'}, which is no unit of the same kind")


def _require_alike(path: Path, source: Port, sink: Port) -> None:
    """Check that an output can drive another FMU's input."""
    for port in (source, sink):
        if port.fault:
            raise RunError(f"{path}: '{source.name}' cannot drive '{sink.name}': '{port.name}': {port.fault}")
    if source.unit is not None and sink.unit is not None and source.unit.powers != sink.unit.powers:
        raise RunError(f"{path}: '{source.name}' is in {source.unit.name} and '{sink.name}' in {sink.unit.name}, no unit of the same kind")


def _powers(unit: str) -> tuple[object, ...]:
    """The powers of kg, m, s, A, K, mol, cd in a unit."""
    return tuple(measure(1.0, unit).dimension.exponents) if unit else (0,) * 7
