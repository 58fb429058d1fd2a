"""modelDescription.xml and buildDescription.xml.

Units of variables are as FMI has them: exponents of the base units, the radian among these, and degrees to display.
"""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from cutjoint.export.fmu.variables import Interface, Variable
from cutjoint.model.expressions.units import measure
from cutjoint.package.locations import __version__

_ANGLE = "rad"

#: The purposes of an FMU, by the names of `cutjoint export --kind`: co-simulation, model exchange.
KINDS: Mapping[str, tuple[bool, bool]] = {"cs": (True, False), "me": (False, True), "both": (True, True)}
#: The names in FMI 3 of the abilities of co-simulation that stops at events.
_STOPS = ("hasEventMode", "mightReturnEarlyFromDoStep", "providesIntermediateUpdate", "canReturnEarlyAfterIntermediateUpdate")
#: As FMI names and orders them; the radian comes last.
BASE_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
_FACTOR = re.compile(r"(?P<sign>/?)\s*(?P<name>[A-Za-z]+|1)(?:(?:\^|\*\*)(?P<power>-?[0-9]+))?")
_RADIANS = ("rad", "radian", "radians")
#: Names of angles that an exponent of the radian stands for.
_ANGLES = (*_RADIANS, "mrad", "deg", "degree", "degrees")


@dataclass(frozen=True, kw_only=True)
class Subject:
    """The subject of the descriptions.

    It has the names of the model and the scene, the end of its run and the distance of its rows (s), the token and the files of the code,
    one of `KINDS`, whether co-simulation has event mode, early return and intermediate updates, and its steps in words, "" without
    co-simulation.
    """

    name: str
    scene: str
    end: float
    output_step: float
    token: str
    sources: Sequence[str]
    kind: str
    stops_at_events: bool
    steps: str


def write_description(subject: Subject, interface: Interface, version: int) -> str:
    """modelDescription.xml for FMI ``version``, 2 or 3."""
    return (_write_2 if version == 2 else _write_3)(subject, interface)


def write_build_description(subject: Subject) -> str:
    """sources/buildDescription.xml of FMI 3."""
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = SubElement(root, "BuildConfiguration", modelIdentifier=subject.name)
    files = SubElement(configuration, "SourceFileSet", language="C++20", compilerOptions="-fno-math-errno -fno-tree-slp-vectorize")
    for name in subject.sources:
        SubElement(files, "SourceFile", name=name)
    SubElement(configuration, "Library", name="m")
    return _text(root)


def _write_2(subject: Subject, interface: Interface) -> str:
    root = Element("fmiModelDescription", {"fmiVersion": "2.0", "guid": subject.token, **_common(subject)})
    if interface.indicators:
        root.set("numberOfEventIndicators", str(len(interface.indicators)))
    states = {"canGetAndSetFMUstate": "true", "canSerializeFMUstate": "true"}
    simulates, exchanges = KINDS[subject.kind]
    if exchanges:
        able = {"providesDirectionalDerivative": "true"}
        _add_sources(SubElement(root, "ModelExchange", {"modelIdentifier": subject.name, **states, **able}), subject)
    if simulates:
        able = {"canHandleVariableCommunicationStepSize": "true", "canInterpolateInputs": "true" if interface.inputs else "false"}
        able["maxOutputDerivativeOrder"] = "0"
        _add_sources(SubElement(root, "CoSimulation", {"modelIdentifier": subject.name, **able, **states}), subject)
    _add_variables(root, subject, interface, 2)
    structure = SubElement(root, "ModelStructure")
    for tag, unknowns in _structure(interface, ("Outputs", "Derivatives", "InitialUnknowns")):
        group = SubElement(structure, tag)
        for reference, known in unknowns:
            SubElement(group, "Unknown", index=str(reference + 1), dependencies=" ".join(str(d + 1) for d in known))
    return _text(root)


def _add_sources(kind: Element, subject: Subject) -> None:
    if subject.sources:
        files = SubElement(kind, "SourceFiles")
        for name in subject.sources:
            SubElement(files, "File", name=name)


def _write_3(subject: Subject, interface: Interface) -> str:
    variables = interface.variables
    root = Element("fmiModelDescription", {"fmiVersion": "3.0", "instantiationToken": subject.token, **_common(subject)})
    states = {"canGetAndSetFMUState": "true", "canSerializeFMUState": "true"}
    simulates, exchanges = KINDS[subject.kind]
    if exchanges:
        able = {"needsCompletedIntegratorStep": "true", "providesDirectionalDerivatives": "true", "providesAdjointDerivatives": "true"}
        SubElement(root, "ModelExchange", {"modelIdentifier": subject.name, **states, **able})
    if simulates:
        able = {"canHandleVariableCommunicationStepSize": "true", **states, "maxOutputDerivativeOrder": "0"}
        stops = dict.fromkeys(_STOPS if subject.stops_at_events else (), "true")
        SubElement(root, "CoSimulation", {"modelIdentifier": subject.name, **able, **stops})
    _add_variables(root, subject, interface, 3)
    structure = SubElement(root, "ModelStructure")
    for tag, unknowns in _structure(interface, ("Output", "ContinuousStateDerivative", "InitialUnknown")):
        for reference, known in unknowns:
            SubElement(structure, tag, valueReference=str(reference), dependencies=" ".join(map(str, known)))
    for i in range(len(interface.indicators)):
        SubElement(structure, "EventIndicator", valueReference=str(len(variables) - len(interface.indicators) + i))
    return _text(root)


def _structure(interface: Interface, tags: tuple[str, str, str]) -> Iterator[tuple[str, list[tuple[int, tuple[int, ...]]]]]:
    """The groups that are not empty, by their tags: outputs, derivatives, unknowns of the start, each with its dependencies."""
    outputs, derivatives, start = tags
    numbered = list(enumerate(interface.variables))
    found = [(i, v) for i, v in numbered if v.causality == "output"]
    derived = [(i, v) for i, v in numbered if v.derives is not None]
    states = [(i, v) for i, v in numbered if i in {v.derives for _, v in derived}]
    groups = {
        outputs: [(i, v.following) for i, v in found], derivatives: [(i, v.following) for i, v in derived],
        start: [(i, v.dependencies) for i, v in (*found, *states, *derived)],
    }  # fmt: skip
    return ((tag, group) for tag, group in groups.items() if group)


def _add_variables(root: Element, subject: Subject, interface: Interface, version: int) -> None:
    """Units, categories of messages, the scene's experiment, and all variables."""
    variables = interface.variables
    _add_units(root, variables)
    categories = SubElement(root, "LogCategories")
    SubElement(categories, "Category", name="logStatusError", description="Wrong calls")
    SubElement(categories, "Category", name="logStatusDiscard", description="Motions that cannot continue")
    SubElement(root, "DefaultExperiment", startTime="0.0", stopTime=repr(float(subject.end)), stepSize=repr(float(subject.output_step)))
    listed = SubElement(root, "ModelVariables")
    first = len(variables) - len(interface.indicators) - 2 * len(interface.states)
    for reference, variable in enumerate(variables):
        about, value = _attributes(reference, variable), _value(variable)
        if version == 2:
            real = SubElement(SubElement(listed, "ScalarVariable", about), "Real", value)
        else:
            real = SubElement(listed, "Float64", {**about, **value})
        if variable.derives is not None:
            real.set("derivative", str(variable.derives + (version == 2)))  # FMI 2 counts from 1
        if version == 3 and subject.stops_at_events and variable.causality == "output":
            real.set("intermediateUpdate", "true")
        if first <= reference < first + len(interface.states):
            real.set("reinit", "true")


def _attributes(reference: int, variable: Variable) -> dict[str, str]:
    initial = "calculated" if variable.start is None else "exact"
    return {
        "name": variable.name, "valueReference": str(reference), "description": variable.description, "causality": variable.causality,
        "variability": variable.variability, **({"initial": initial} if variable.causality in ("parameter", "output", "local") else {}),
    }  # fmt: skip


def _common(subject: Subject) -> dict[str, str]:
    described = (f"Model {subject.name}", f"scene {subject.scene}", subject.steps)
    return {
        "modelName": subject.name, "description": ", ".join(filter(None, described)), "generationTool": f"cutjoint {__version__}",
        "license": "documentation/licenses/license.txt", "variableNamingConvention": "structured",
    }  # fmt: skip


def _value(variable: Variable) -> dict[str, str]:
    """Unit and start of a variable; what is an angle is displayed in degrees."""
    unit = describe_unit(variable.unit)
    of_unit = {} if unit is None else {"unit": unit.name}
    if unit is not None and unit.display and set(unit.exponents) <= {_ANGLE, "s"}:
        of_unit["displayUnit"] = unit.display[0]
    return {**of_unit, **({} if variable.start is None else {"start": repr(variable.start)})}


def _add_units(root: Element, variables: Iterable[Variable]) -> None:
    units = {unit.name: unit for v in variables if (unit := describe_unit(v.unit)) is not None}
    definitions = SubElement(root, "UnitDefinitions")
    for unit in units.values():
        defined = SubElement(definitions, "Unit", name=unit.name)
        if unit.exponents:
            of_si = {} if unit.factor == 1.0 else {"factor": repr(unit.factor)}
            SubElement(defined, "BaseUnit", {**{base: str(power) for base, power in unit.exponents.items()}, **of_si})
        if unit.display:
            SubElement(defined, "DisplayUnit", name=unit.display[0], factor=repr(unit.display[1]))


def _text(root: Element) -> str:
    ElementTree.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ElementTree.tostring(root, encoding="unicode")}\n'


@dataclass(frozen=True, kw_only=True)
class Unit:
    """A unit: exponents of the base units, if whole, and its factor; with radians also the unit to display and its factor."""

    name: str
    exponents: Mapping[str, int]
    factor: float
    display: tuple[str, float] | None


def describe_unit(name: str) -> Unit | None:
    """The unit of that name, in one spelling; None for plain numbers."""
    if name in ("", "1"):
        return None
    name = re.sub(r"\s*([*/])\s*", r"\1", name.replace("**", "^").replace("Nms", "N*m*s").replace("Nm", "N*m")).replace(" ", "*")
    found, turns = measure(1.0, name), _power_of(name, _ANGLES)
    dimension = found.dimension
    powers = dict(zip(BASE_UNITS, (*dimension.exponents, Fraction(turns)), strict=True))
    whole = all(power.denominator == 1 for power in powers.values())
    shown = _power_of(name, _RADIANS)
    display = (re.sub(r"\brad\b", "deg", name), math.degrees(1.0) ** shown) if shown else None
    exponents = {base: int(power) for base, power in powers.items() if power} if whole else {}
    return Unit(name=name, exponents=exponents, factor=found.value, display=display)


def _power_of(name: str, angles: Sequence[str]) -> int:
    found = (m for m in _FACTOR.finditer(name) if m["name"] in angles)
    return sum(int(m["power"] or 1) * (-1 if m["sign"] else 1) for m in found)
