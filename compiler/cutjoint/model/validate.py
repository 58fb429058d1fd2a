"""Checks of the whole model: unique names, physical masses, and a path from every body to the ground."""

import math
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import Any

from cutjoint.elements.forces import FORCES
from cutjoint.model.document import model_file
from cutjoint.model.document.checks import KINDS
from cutjoint.model.document.source import Path, Source
from cutjoint.model.elements.expand import Expansion, absent_properties
from cutjoint.model.elements.forces import JOINT_FORCES
from cutjoint.model.elements.friction import bristle_name
from cutjoint.model.elements.instances import find_submodels, find_uses
from cutjoint.model.elements.mass import mass_problems
from cutjoint.model.errors import Problems, nearest
from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.expressions.operations import Term
from cutjoint.model.expressions.parse import symbols_of
from cutjoint.model.expressions.scope import FAILED, Element, Scope
from cutjoint.model.files.property_file import STANDARD
from cutjoint.model.records import GROUND, Body, Force, Joint, Scene, Span

_NAME = re.compile(r"[A-Za-z]\w*")  #: a name in a text
_BRACES = re.compile(r"\{(.*?)\}")  #: an expression in braces in a text

#: The sections whose names must differ.
_SECTIONS = ("bodies", "joints", "gears", "forces", "reactions", "markers", "states", "signals", "controllers", "instances")

#: The sections of a submodel that use no parameter.
_NO_EXPRESSIONS = ("connectors", "parameters", "outputs", "accepts", "choices", "warns")


def check_names(source: Source, problems: Problems, model: model_file.Document) -> None:
    """Report names that denote two elements, in the model or in one submodel."""
    _check_unique(problems, _named(source, model, ()))
    for level in find_submodels(model):
        submodel, path = level.part, level.path
        assert isinstance(submodel, model_file.Submodel)
        connectors = [
            (connector, "connector", source.value_span((*path, "connectors", index))) for index, connector in enumerate(submodel.connectors)
        ]
        _check_unique(problems, [*connectors, *_named(source, submodel, path)])
        arguments = [
            (parameter, "parameter", source.value_span((*path, "parameters", index))) for index, parameter in enumerate(submodel.parameters)
        ]
        defaults = [(name, "parameter", source.key_span((*path, "defaults", name))) for name in submodel.defaults]
        _check_unique(problems, [*arguments, *defaults])


def check_submodels(source: Source, problems: Problems, model: model_file.Document) -> None:
    """Note parameters of submodels that no expression of theirs uses, and choices and warnings about none."""
    for level in find_submodels(model):
        submodel, path = level.part, level.path
        assert isinstance(submodel, model_file.Submodel)
        sections = {key: part for key, part in source.part(path).items() if key not in _NO_EXPRESSIONS}
        used = frozenset().union(*map(symbols_of, _texts(sections)))
        places = {name: source.value_span((*path, "parameters", index)) for index, name in enumerate(submodel.parameters)}
        places |= {name: source.key_span((*path, "defaults", name)) for name in submodel.defaults}
        for parameter, span in places.items():
            if parameter not in used:
                message = f"nothing in it uses the parameter '{parameter}'"
                problems.add(span, f"submodel '{path[-1]}'", message, "remove it here and in its instances, or use it")
        entries = [("choices", name, source.value_span((*path, "choices", index))) for index, name in enumerate(submodel.choices)]
        entries += [("warns", name, source.key_span((*path, "warns", name))) for name in submodel.warns]
        for section, name, span in entries:
            if name not in places:
                problems.add(span, f"submodel '{path[-1]}'", f"{section}: unknown parameter '{name}'", nearest(name, places, "parameters"))


def unused_parameters(source: Source, model: model_file.Document) -> Iterator[str]:
    """A sentence for each parameter of the model that no expression of the file reads."""
    left = set(model.parameters)
    outputs = source.data.get("outputs")
    expressions = tuple(output for output in (outputs if isinstance(outputs, tuple) else ()) if not isinstance(output, str))
    for text in dict.fromkeys(_texts({**source.data, "outputs": expressions})):
        if not left.isdisjoint(_NAME.findall(text)):
            left -= symbols_of(text)
    for name in (name for name in model.parameters if name in left):
        yield f"{source.key_span(('parameters', name))}: nothing uses the parameter '{name}'"


def silent_outputs(source: Source, scenes: Mapping[str, Scene], forces: Sequence[Force]) -> Iterator[str]:
    """A sentence for each scene with outputs that a wheel would measure if the scene had not switched it off."""
    for scene in scenes.values():
        off = {f.name: f.measured - f.measured_when_off for f in forces if not scene.switches.get(f.name, f.active)}
        zeros = [output.column for output in scene.outputs if output.quantity in off.get(output.element, ())]
        if zeros:
            span = source.key_span(("scenes", scene.name))
            yield f"{span}: scene '{scene.name}' has 0 for {', '.join(zeros)}, since the force is switched off; give it a law of 0 instead"


def unused_properties(source: Source, model: model_file.Document) -> Iterator[str]:
    """A sentence for the properties of each instance that its submodel does not read, but for those that change no force."""
    reported: set[Path] = set()
    for use in find_uses(model):
        if use.submodel is None or use.path in reported:
            continue
        reported.add(use.path)
        known = STANDARD.union(use.submodel.parameters, use.submodel.defaults, use.submodel.accepts)
        spans = {name: source.key_span((*use.path, "properties", name)) for name in use.instance.properties if name not in known}
        if spans:
            named = ", ".join(f"{name} (line {span.line})" for name, span in spans.items())
            yield f"{next(iter(spans.values())).file}: nothing in '{use.instance.use}' uses {named}"
        if absent := absent_properties(use.instance, use.submodel):
            file = source.key_span((*use.path, "properties", next(iter(use.instance.properties)))).file
            values = {value: [name for name in absent if absent[name] == value] for value in absent.values()}
            said = ", and ".join(f"{value:g} for {', '.join(names)}" for value, names in values.items())
            yield f"{file}: lacks coefficients, which have the format's defaults in '{use.instance.use}': {said}"


def choices_made(model: model_file.Document, scopes: Mapping[str, Scope]) -> dict[str, str]:
    """The values of submodels' choices, and of the property keys that they accept, by instance."""
    made: dict[str, list[str]] = {}
    for use in find_uses(model):
        if use.submodel is not None and (scope := scopes.get(f"{use.name}.")) is not None:
            values = {key: use.instance.properties[key] for key in use.submodel.accepts if key in use.instance.properties}
            values |= {name: _value(scope, scope.names[name]) for name in use.submodel.choices if name in scope.names}
            if values:
                made.setdefault(", ".join(f"{name} {_word(float(value))}" for name, value in values.items()), []).append(use.name)
    return {", ".join(names): text for text, names in made.items()}


def warnings_of(model: model_file.Document, scopes: Mapping[str, Scope]) -> Iterator[str]:
    """A sentence for each parameter that is not zero where its submodel warns of that, with numbers in its braces, unless these are 0."""
    found: dict[str, None] = {}
    for use in find_uses(model):
        scope = scopes.get(f"{use.name}.")
        if use.submodel is None or scope is None:
            continue
        for name, text in use.submodel.warns.items():
            value = _value(scope, scope.names[name]) if name in scope.names else 0.0
            if value == 0:
                continue
            where = Element(scope, f"submodel '{use.at[-1]}'", use.name, use.at)
            numbers = [_value(scope, where.term(each, ("warns", name), scope.names)) for each in _BRACES.findall(text)]
            if numbers and not any(numbers):
                continue
            text_of_warning = _BRACES.sub("{:.2g}", text).format(*numbers)
            state = _word(value) if value > 1 else "on"
            found[f"{scope.source.key_span(use.path)}: {name} of '{use.instance.use}' is {state}: {text_of_warning}"] = None
    yield from found


def _word(value: float) -> str:
    return "varies" if math.isnan(value) else f"{value:g}"


def _value(scope: Scope, term: Term) -> float:
    """The value of a term at the parameters' values, NaN of one that changes with time."""
    is_closed = term.value.free_symbols <= scope.values.keys() and not scope.moves(term)
    return evaluate(term.value, scope.values) if is_closed else math.nan


def _texts(data: Any) -> Iterator[str]:
    """All texts in plain data but for keys; those of tables are variables."""
    if isinstance(data, str):
        yield data
    elif isinstance(data, dict | tuple):
        if isinstance(data, dict) and isinstance(data.get("table"), dict):
            yield from data["table"]
        for part in data.values() if isinstance(data, dict) else data:
            yield from _texts(part)


def _named(source: Source, part: model_file.Elements, path: Path) -> list[tuple[str, str, Span]]:
    """Name, kind and place of all elements of a scope, the forces that joints bring included."""
    places = [
        (f"{name}_{suffix}", "force", source.key_span((*path, "joints", name, field)))
        for name, joint in part.joints.items()
        for field, suffix in JOINT_FORCES.items()
        if getattr(joint, field) is not None
    ] + [
        (bristle_name(name), "bristle", source.key_span((*path, "forces", name)))
        for name, force in part.forces.items()
        if FORCES[force.kind].element.interaction.by_load
    ]
    return places + [
        (name, KINDS[section], source.key_span((*path, section, name))) for section in _SECTIONS for name in getattr(part, section, ())
    ]


def _check_unique(problems: Problems, found: list[tuple[str, str, Span]]) -> None:
    first: dict[str, Span] = {}
    for name, kind, span in sorted(found, key=lambda item: item[2]):
        if name in first:
            message = f"duplicate name '{name}', first defined at {first[name].seen_from(span)}"
            problems.add(span, f"{kind} '{name}'", message, "rename one of them")
        first.setdefault(name, span)


def check_elements(expansion: Expansion, problems: Problems) -> None:
    """Report bodies that are not physical or that no chain of joints connects to the ground."""
    for body in expansion.elements.bodies:
        values = [evaluate(entry, expansion.scope.values) for entry in (body.mass, *body.inertia)]
        for message in mass_problems(values[0], values[1:]):
            problems.add(body.span, f"body '{body.name}'", message)
    if not joints_are_known(expansion):
        return
    check_guides(expansion.elements.joints, lambda joint, *said: problems.add(joint.span, f"joint '{joint.name}'", *said))
    for body in _unreached(expansion):
        message, hint = "no joint connects it to the ground", "add a joint, for example one of kind: free"
        problems.add(body.span, f"body '{body.name}'", message, hint)


def is_connected(expansion: Expansion) -> bool:
    """Return whether every joint could be read, and joints connect every body to the ground."""
    joints = expansion.elements.joints
    has_places = not any(x.has(FAILED) for joint in joints for vector in (joint.at, *joint.axes) for x in vector)
    return has_places and joints_are_known(expansion) and not any(_unreached(expansion))


def check_guides(joints: Collection[Joint], note: Callable[[Joint, str, str], None]) -> None:
    """Report joints in loops of prescribed motions without any degree of freedom, with a message and a hint."""
    held: dict[str, list[tuple[str, Joint]]] = {}
    prescribed = [j for j in joints if not j.cut and (j.guide is not None or j.element.is_rigid)]
    closing = [j for j in joints if j not in prescribed]
    for joint in (*prescribed, *closing):
        loop = _path(held, joint.base, joint.follower)
        guided = sorted((other for other in (*loop, joint) if other.guide is not None), key=lambda other: other.span)
        if loop and guided:
            names = ", ".join(f"'{other.name}'" for other in guided)
            message = f"it closes a loop without a degree of freedom: the motion of its bodies is prescribed by the guide of {names}"
            note(joint, message, "leave a joint of the loop unguided")
        if joint in prescribed:
            held.setdefault(joint.base, []).append((joint.follower, joint))
            held.setdefault(joint.follower, []).append((joint.base, joint))


def _path(held: dict[str, list[tuple[str, Joint]]], start: str, end: str) -> list[Joint]:
    """The joints on a path between two bodies; none without one."""
    paths: dict[str, list[Joint]] = {start: []}
    waiting = [start]
    while waiting:
        body = waiting.pop()
        for other, joint in held.get(body, []):
            if other not in paths:
                paths[other] = [*paths[body], joint]
                waiting.append(other)
    return paths.get(end, [])


def joints_are_known(expansion: Expansion) -> bool:
    """Return whether every joint could be read and joins two known bodies; if not, reachability cannot be judged."""
    directory = expansion.scope.directory
    known = directory.bodies | {GROUND}
    ends = [(joint.base, joint.follower) for joint in expansion.elements.joints]
    return not directory.broken and all({a, b} <= known and a != b for a, b in ends)


def _unreached(expansion: Expansion) -> Iterator[Body]:
    """The bodies that no chain of joints, tree or cut, connects to the ground."""
    neighbours: dict[str, set[str]] = {}
    for joint in expansion.elements.joints:
        neighbours.setdefault(joint.base, set()).add(joint.follower)
        neighbours.setdefault(joint.follower, set()).add(joint.base)
    reached, waiting = {GROUND}, [GROUND]
    while waiting:
        new = neighbours.get(waiting.pop(), set()) - reached
        reached |= new
        waiting += new
    return (body for body in expansion.elements.bodies if body.name not in reached)
