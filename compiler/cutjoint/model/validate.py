"""Checks of the whole model: unique names, physical masses, and a way from every body to the ground."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import permutations

import numpy as np

from cutjoint.model import document
from cutjoint.model.errors import Problems
from cutjoint.model.evaluate import evaluate
from cutjoint.model.expand import Expansion
from cutjoint.model.records import GROUND, Body, Joint, Span
from cutjoint.model.scope import Scope
from cutjoint.model.shape import KINDS
from cutjoint.model.source import Path, Source

#: Relative error allowed in the conditions on inertia.
TOLERANCE = 1e-9

#: The sections whose names must differ.
_SECTIONS = ("bodies", "joints", "forces", "reactions", "markers", "instances")


def check_names(source: Source, problems: Problems, model: document.Document) -> None:
    """Note names that stand for two elements, in the model or in one submodel."""
    _check_unique(source, problems, _named(source, model, ()))
    for name, submodel in model.submodels.items():
        path = ("submodels", name)
        connectors = [
            (connector, "connector", source.value_span((*path, "connectors", index)))
            for index, connector in enumerate(submodel.connectors)
        ]
        _check_unique(source, problems, [*connectors, *_named(source, submodel, path)])
        arguments = [
            (parameter, "parameter", source.value_span((*path, "parameters", index)))
            for index, parameter in enumerate(submodel.parameters)
        ]
        _check_unique(source, problems, arguments)


def _named(source: Source, part: document.Elements, path: Path) -> list[tuple[str, str, Span]]:
    """Name, kind and place of all elements of a scope."""
    return [
        (name, KINDS[section], source.key_span((*path, section, name)))
        for section in _SECTIONS
        for name in getattr(part, section, ())
    ]


def _check_unique(source: Source, problems: Problems, found: list[tuple[str, str, Span]]) -> None:
    first: dict[str, Span] = {}
    for name, kind, span in sorted(found, key=lambda item: item[2]):
        if name in first:
            line = first[name].line
            problems.add(
                span,
                f"{kind} '{name}'",
                f"duplicate name '{name}', first defined at line {line}",
                "rename one of them",
            )
        first.setdefault(name, span)


def check_elements(expansion: Expansion, problems: Problems) -> None:
    """Note bodies that are not physical or that no chain of joints connects to the ground."""
    for body in expansion.elements.bodies:
        for message in _mass_problems(expansion.scope, body):
            problems.add(body.span, f"body '{body.name}'", message)
    if not _joints_are_known(expansion):
        return
    reached = _reached(expansion.elements.joints)
    for body in expansion.elements.bodies:
        if body.name not in reached:
            message, hint = "no joint connects it to the ground", "add a joint, for example one of kind: free"
            problems.add(body.span, f"body '{body.name}'", message, hint)


def _joints_are_known(expansion: Expansion) -> bool:
    """Whether every joint could be read and joins two known bodies; if not, reachability cannot be judged."""
    directory = expansion.scope.directory
    known = directory.bodies | {GROUND}
    ends = [(joint.base, joint.follower) for joint in expansion.elements.joints]
    return not directory.broken and all({a, b} <= known and a != b for a, b in ends)


def _reached(joints: tuple[Joint, ...]) -> set[str]:
    """The bodies that joints, tree or cut, connect to the ground."""
    neighbours: dict[str, set[str]] = {}
    for joint in joints:
        neighbours.setdefault(joint.base, set()).add(joint.follower)
        neighbours.setdefault(joint.follower, set()).add(joint.base)
    reached, waiting = {GROUND}, [GROUND]
    while waiting:
        new = neighbours.get(waiting.pop(), set()) - reached
        reached |= new
        waiting += new
    return reached


def _mass_problems(scope: Scope, body: Body) -> Iterator[str]:
    mass = evaluate(body.mass, scope.values)
    if mass < 0:
        yield f"the mass is negative: {mass:g} kg"
    xx, yy, zz, xy, xz, yz = (evaluate(entry, scope.values) for entry in body.inertia)
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if not np.isfinite(matrix).all():
        return
    moments = [float(moment) for moment in np.linalg.eigvalsh(matrix)]
    bound = TOLERANCE * max(map(abs, moments))
    shown = ", ".join(f"{moment:g}" for moment in moments)
    if min(moments) < -bound:
        yield f"a principal moment of inertia is negative: {shown} kg m2"
    elif any(a > b + c + bound for a, b, c in permutations(moments)):
        yield f"a principal moment of inertia is larger than the sum of the other two: {shown} kg m2"
    if mass == 0 and max(moments) > 0 and not math.isnan(mass):
        yield "it has inertia but no mass"
