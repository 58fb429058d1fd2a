"""From the document to flat elements: parameters become symbols, submodels are instantiated and mirrored.

Laws of forces, rates of states, signals and controllers read quantities of elements wherever these stand.  So the elements are read
twice where one does: first to see which there are, then with the names of their quantities.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sized
from dataclasses import dataclass, fields, replace
from functools import partial
from glob import escape
from itertools import chain

from cutjoint.model import document
from cutjoint.model.dependencies import check_levels, check_loops
from cutjoint.model.elements import Elements, read_elements
from cutjoint.model.errors import Problems, Unheard, nearest
from cutjoint.model.expressions import quantities_read
from cutjoint.model.machine import Machine
from cutjoint.model.mirror import mirror_elements
from cutjoint.model.opening import Opening
from cutjoint.model.operations import Term
from cutjoint.model.parameters import read_parameters
from cutjoint.model.quantities import Element as Quantified
from cutjoint.model.records import DerivedParameter, Parameter, Scalar
from cutjoint.model.scope import FAILED_TERM, UNKNOWN, Directory, Element, Scope, element
from cutjoint.model.shape import Shaped
from cutjoint.model.source import Source

#: Elements of the model with all its instances.
MAX_ELEMENTS = 20_000


@dataclass(frozen=True)
class Expansion:
    """The parameters with numbers and those that follow from them, the model's own scope, and the flat elements."""

    parameters: tuple[Parameter, ...]
    derived: tuple[DerivedParameter, ...]
    scope: Scope
    elements: Elements


def expand(source: Source, problems: Problems, shaped: Shaped, opening: Opening) -> Expansion:
    """Read all elements of the model and of its instances; ``opening`` makes parameters of their numbers."""
    model, directory = shaped.document, _directory(shaped)
    scope = Scope(source, problems, directory, {}, {}, opening=opening)
    parameters = read_parameters(scope, model, shaped.lost_parameters)
    scope = parameters.extend(scope)
    machine = Machine(partial(_survey, scope, model))
    scope = replace(scope, own=_own(scope, model), read=machine.read)
    elements = _read(scope, model, machine)
    check_loops(elements.forces, elements.signals, problems)
    sampled = tuple(signal for controller in elements.controllers for signal in controller.signals)
    check_levels(elements.forces, (*elements.signals, *sampled), problems)
    return Expansion(parameters.given, parameters.derived, scope, elements)


def _survey(scope: Scope, model: document.Document) -> Mapping[str, Quantified]:
    """All elements by name; whatever reads quantities fails here, without a problem."""
    unheard = replace(scope, problems=Unheard(), opening=Opening(), own=_own(scope, model), read=lambda *_: FAILED_TERM)
    return _read(unheard, model, Machine(dict)).by_name()


def _own(scope: Scope, part: document.Elements) -> frozenset[str]:
    """The names of states and signals in a scope, and of what could not be read there and may be one."""
    prefix, broken = scope.prefix, scope.directory.broken
    return frozenset((*part.states, *part.signals, *(name.removeprefix(prefix) for name in broken if name.startswith(prefix))))


def _read(scope: Scope, model: document.Document, machine: Machine) -> Elements:
    """The elements of the model and of its instances; the machine knows of all signals before it is asked for one."""
    machine.expect(scope, model)
    uses = list(_uses(scope, model, machine))
    groups = [read_elements(scope, model)]
    for use in uses:
        elements = read_elements(use.scope, use.submodel)
        groups.append(mirror_elements(elements, use.mirror) if use.mirror else elements)
    return _joined(groups)


def _joined(groups: list[Elements]) -> Elements:
    """The elements of all groups, section by section."""
    return Elements(*(tuple(chain.from_iterable(getattr(group, f.name) for group in groups)) for f in fields(Elements)))


def used_submodels(model: document.Document) -> Iterator[tuple[str, document.Instance, document.Submodel]]:
    """Instances with their submodels, where they exist."""
    for name, instance in model.instances.items():
        if instance.use in model.submodels:
            yield name, instance, model.submodels[instance.use]


def _directory(shaped: Shaped) -> Directory:
    model = shaped.document
    bodies, joints = set(model.bodies), dict(model.joints)
    for name, _, submodel in used_submodels(model):
        bodies |= {f"{name}.{body}" for body in submodel.bodies}
        joints |= {f"{name}.{joint}": part for joint, part in submodel.joints.items()}
    broken = {name for name, instance in model.instances.items() if instance.use not in model.submodels}
    return Directory(frozenset(bodies), joints, shaped.removed | broken)


@dataclass(frozen=True)
class _Use:
    """An instance: the scope of its elements, its submodel, and the axis of its mirror."""

    scope: Scope
    submodel: document.Submodel
    mirror: str | None


def _uses(scope: Scope, model: document.Document, machine: Machine) -> Iterator[_Use]:
    count = _count(model)
    for name, instance in model.instances.items():
        where = element(scope, "instance", "instances", name)
        if instance.use not in model.submodels:
            if not scope.directory.misses(instance.use):
                where.fail(f"unknown submodel '{instance.use}'", nearest(instance.use, model.submodels, "submodels"), ("use",))
            continue
        submodel = model.submodels[instance.use]
        count += _count(submodel)
        if count > MAX_ELEMENTS:
            where.fail(f"the model has more than {MAX_ELEMENTS} elements", "use fewer instances")
            return
        inner = _inner(where, instance, submodel, machine)
        machine.expect(inner, submodel)
        yield _Use(inner, submodel, instance.mirror)


def _count(part: document.Elements) -> int:
    sections: tuple[Sized, ...] = (
        part.points, part.bodies, part.joints, part.gears, part.forces, part.reactions, part.markers, part.states, part.signals,
        part.controllers, part.outputs,
    )  # fmt: skip
    return sum(len(section) for section in sections)


def _inner(where: Element, instance: document.Instance, submodel: document.Submodel, machine: Machine) -> Scope:
    """The scope of an instance's elements."""
    scope, arguments = where.scope, _arguments(where, instance, submodel)
    symbols = frozenset().union(*(term.value.free_symbols for term in arguments.values()))
    inner = replace(
        scope,
        names={**scope.names, **arguments},
        path=("submodels", instance.use),
        prefix=f"{where.name}.",
        connectors=_connectors(where, instance, submodel),
        read=scope.read if instance.mirror is None or scope.read is None else partial(machine.read_image, instance.mirror),
        sensed=frozenset(symbol for symbol in symbols if quantities_read(symbol)),
    )
    return replace(inner, own=_own(inner, submodel))


def _arguments(where: Element, instance: document.Instance, submodel: document.Submodel) -> dict[str, Term]:
    """The values that the instance gives to the submodel's parameters."""
    _match_keys(where, "with", instance.with_, submodel.parameters, "parameter", instance.use)
    if instance.binding is not None:
        where.scope.opening.patterns.append(f"{escape(where.name)}.*")
    terms = {name: where.term(value, ("with", name), where.scope.reading()) for name, value in instance.with_.items()}
    given = {name: where.opened(term, None, ("with", name), is_argument=True) for name, term in terms.items()}
    return {name: given.get(name, FAILED_TERM) for name in submodel.parameters}


def _connectors(where: Element, instance: document.Instance, submodel: document.Submodel) -> dict[str, str]:
    """The full names of the bodies that the instance connects."""
    _match_keys(where, "connect", instance.connect, submodel.connectors, "connector", instance.use)
    given = {name: where.body(body, ("connect", name)) for name, body in instance.connect.items()}
    return {name: given.get(name, UNKNOWN) for name in submodel.connectors}


def _match_keys(where: Element, field: str, given: Mapping[str, Scalar], wanted: tuple[str, ...], what: str, submodel: str) -> None:
    for name in (name for name in given if name not in wanted):
        hint = nearest(name, wanted, f"{what}s") or f"it has no {what}s"
        where.fail(f"the submodel '{submodel}' has no {what} '{name}'", hint, (field, name), at_key=True)
    missing = [name for name in wanted if name not in given]
    if missing:
        where.fail(f"{field} lacks {', '.join(missing)}", f"the submodel '{submodel}' needs all its {what}s")
