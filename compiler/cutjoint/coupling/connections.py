"""The connections of a controller with a model: its outputs to the model's inputs, and the model's outputs to its inputs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from cutjoint.coupling.controller import ControllerFmu, Port
from cutjoint.formulate.inputs import guided_by, input_parameters
from cutjoint.model.errors import nearest
from cutjoint.model.quantities import unit_of
from cutjoint.model.records import Model, Scene
from cutjoint.model.units import measure
from cutjoint.run.errors import RunError


@dataclass(frozen=True, kw_only=True)
class Connections:
    """Ports of an FMU by the model's names.

    ``driven`` has the output that drives each input of the model, ``read`` pairs of an output of the model and the input of the FMU that
    takes it, ``sizes`` the units of these outputs in SI.  ``steering`` are driven inputs that move guides, ``left`` inputs that
    follow the scene, ``held`` inputs of the FMU that stay at their start.
    """

    driven: Mapping[str, Port]
    read: tuple[tuple[str, Port], ...]
    sizes: Mapping[str, float]
    steering: frozenset[str]
    left: tuple[str, ...]
    held: tuple[str, ...]


def connect(fmu: ControllerFmu, model: Model, scene: Scene, named: Mapping[str, str]) -> Connections:
    """Connect each port with the input or output of its name in the model, or of its name in ``named``.

    Raises:
        RunError: there is no such port, input or output, a unit is of another dimension, an input has two sources, or nothing is
            connected.
    """
    inputs = {p.name: p.unit for p in input_parameters(model)}
    outputs = {o.column: unit_of(model, o) for o in scene.outputs}
    if unknown := [name for name in named if name not in fmu.ports]:
        raise RunError(f"--connect {unknown[0]}: {fmu.path} has no such input or output; {nearest(unknown[0], fmu.ports, 'it has')}")
    driven: dict[str, Port] = {}
    for port, name in _matched(fmu, "output", inputs, named, f"input of model '{model.name}'"):
        if name in driven:
            raise RunError(f"{fmu.path}: both '{driven[name].name}' and '{port.name}' would drive input '{name}'; connect one of them")
        driven[name] = port
    read = tuple((name, port) for port, name in _matched(fmu, "input", outputs, named, f"output of scene '{scene.name}'"))
    if not driven and not read:
        ports = ", ".join(fmu.ports) or "none"
        raise RunError(
            f"{fmu.path}: none of its inputs and outputs ({ports}) has the name of one of the model's outputs ({', '.join(outputs)}) and "
            f"inputs ({', '.join(inputs) or 'none'}); say --connect PORT=NAME"
        )
    taken = {port.name for _, port in read}
    return Connections(
        driven=driven, read=read, sizes={name: measure(1.0, outputs[name] or "1").value for name, _ in read},
        left=tuple(name for name in inputs if name not in driven),
        steering=frozenset(p.name for p in input_parameters(model) if p.name in driven and guided_by(model, p) is not None),
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
            raise RunError(f"--connect {port.name}={name}: '{name}' is no {what}; {nearest(name, there, 'there is')}")


def _require_fit(path: Path, port: Port, name: str, unit: str) -> None:
    if port.fault:
        raise RunError(f"{path}: '{port.name}' cannot be connected with '{name}': {port.fault}")
    if port.unit is not None and port.unit.powers != _powers(unit):
        raise RunError(f"{path}: '{port.name}' is in {port.unit.name} and '{name}' in {unit or '1'}, which is no unit of the same kind")


def _powers(unit: str) -> tuple[object, ...]:
    """The powers of kg, m, s, A, K, mol, cd in a unit."""
    return tuple(measure(1.0, unit).dimension.exponents) if unit else (0,) * 7
