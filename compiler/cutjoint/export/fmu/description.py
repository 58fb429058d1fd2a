"""modelDescription.xml and buildDescription.xml."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from cutjoint.export.fmu.units import Unit, describe_unit
from cutjoint.export.fmu.variables import Interface, Variable
from cutjoint.version import __version__

_ANGLE = "rad"

#: Elements of the model's structure, and whether outputs depend on anything there.
_UNKNOWNS = {"Output": False, "InitialUnknown": True}


@dataclass(frozen=True, kw_only=True)
class Subject:
    """What is described: the model's name, the scene's, how long its run takes and how often it reports (s), the token of the code,
    the files of the code."""

    name: str
    scene: str
    end: float
    output_step: float
    token: str
    sources: Sequence[str]


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
    variables = interface.variables
    root = Element("fmiModelDescription", {"fmiVersion": "2.0", "guid": subject.token, **_common(subject)})
    kind = SubElement(
        root, "CoSimulation", modelIdentifier=subject.name, canHandleVariableCommunicationStepSize="true",
        canInterpolateInputs=_truth(interface.inputs), maxOutputDerivativeOrder="0", canGetAndSetFMUstate="true",
        canSerializeFMUstate="true",
    )  # fmt: skip
    if subject.sources:
        files = SubElement(kind, "SourceFiles")
        for name in subject.sources:
            SubElement(files, "File", name=name)
    _add_general(root, subject, variables)
    listed = SubElement(root, "ModelVariables")
    for reference, variable in enumerate(variables):
        SubElement(SubElement(listed, "ScalarVariable", _attributes(reference, variable)), "Real", _value(variable))
    structure = SubElement(root, "ModelStructure")
    for tag, depends in _UNKNOWNS.items() if interface.outputs else ():
        unknowns = SubElement(structure, f"{tag}s")
        for reference in _outputs(variables):
            indices = " ".join(str(d + 1) for d in variables[reference].dependencies if depends)
            SubElement(unknowns, "Unknown", index=str(reference + 1), dependencies=indices)
    return _text(root)


def _write_3(subject: Subject, interface: Interface) -> str:
    variables = interface.variables
    root = Element("fmiModelDescription", {"fmiVersion": "3.0", "instantiationToken": subject.token, **_common(subject)})
    SubElement(
        root, "CoSimulation", modelIdentifier=subject.name, canHandleVariableCommunicationStepSize="true", canGetAndSetFMUState="true",
        canSerializeFMUState="true", maxOutputDerivativeOrder="0",
    )  # fmt: skip
    _add_general(root, subject, variables)
    listed = SubElement(root, "ModelVariables")
    for reference, variable in enumerate(variables):
        SubElement(listed, "Float64", {**_attributes(reference, variable), **_value(variable)})
    structure = SubElement(root, "ModelStructure")
    for tag, depends in _UNKNOWNS.items():
        for reference in _outputs(variables):
            references = " ".join(str(d) for d in variables[reference].dependencies if depends)
            SubElement(structure, tag, valueReference=str(reference), dependencies=references)
    return _text(root)


def _add_general(root: Element, subject: Subject, variables: Sequence[Variable]) -> None:
    """Units, categories of messages, and the scene's experiment."""
    _add_units(root, variables)
    categories = SubElement(root, "LogCategories")
    SubElement(categories, "Category", name="logStatusError", description="Wrong calls")
    SubElement(categories, "Category", name="logStatusDiscard", description="Motions that cannot go on")
    SubElement(
        root, "DefaultExperiment", startTime="0.0", stopTime=repr(float(subject.end)), stepSize=repr(float(subject.output_step))
    )


def _attributes(reference: int, variable: Variable) -> dict[str, str]:
    initial = "calculated" if variable.start is None else "exact"
    return {
        "name": variable.name, "valueReference": str(reference), "description": variable.description, "causality": variable.causality,
        "variability": variable.variability, **({"initial": initial} if variable.causality in ("parameter", "output") else {}),
    }  # fmt: skip


def _common(subject: Subject) -> dict[str, str]:
    return {
        "modelName": subject.name, "description": f"Model {subject.name}, scene {subject.scene}",
        "generationTool": f"cutjoint {__version__}", "license": "documentation/licenses/license.txt",
        "variableNamingConvention": "structured",
    }  # fmt: skip


def _outputs(variables: Sequence[Variable]) -> list[int]:
    return [reference for reference, variable in enumerate(variables) if variable.causality == "output"]


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
        _add_unit(definitions, unit)


def _add_unit(definitions: Element, unit: Unit) -> None:
    defined = SubElement(definitions, "Unit", name=unit.name)
    if unit.exponents:
        SubElement(defined, "BaseUnit", {base: str(power) for base, power in unit.exponents.items()})
    if unit.display:
        name, factor = unit.display
        SubElement(defined, "DisplayUnit", name=name, factor=repr(factor))


def _truth(value: object) -> str:
    return "true" if value else "false"


def _text(root: Element) -> str:
    ElementTree.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ElementTree.tostring(root, encoding="unicode")}\n'
