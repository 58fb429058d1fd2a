"""From the document to flat elements: parameters become symbols, submodels are instantiated and mirrored."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sized
from dataclasses import dataclass, replace
from glob import escape

from cutjoint.model import document
from cutjoint.model.elements import Elements, read_elements
from cutjoint.model.errors import Problems, nearest
from cutjoint.model.mirror import mirror_elements
from cutjoint.model.opening import Opening
from cutjoint.model.operations import Term
from cutjoint.model.parameters import read_parameters
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
    groups = [read_elements(scope, model), *_instances(scope, model)]
    return Expansion(parameters.given, parameters.derived, scope, _joined(groups))


def _joined(groups: list[Elements]) -> Elements:
    return Elements(
        tuple(body for group in groups for body in group.bodies),
        tuple(joint for group in groups for joint in group.joints),
        tuple(force for group in groups for force in group.forces),
        tuple(reaction for group in groups for reaction in group.reactions),
        tuple(marker for group in groups for marker in group.markers),
        tuple(gear for group in groups for gear in group.gears),
    )


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


def _instances(scope: Scope, model: document.Document) -> Iterator[Elements]:
    count = _count(model)
    for name, instance in model.instances.items():
        where = element(scope, "instance", "instances", name)
        if instance.use not in model.submodels:
            if not scope.directory.misses(instance.use):
                where.fail(f"unknown submodel '{instance.use}'", nearest(instance.use, model.submodels, "submodels"), ("use",))
            continue
        count += _count(model.submodels[instance.use])
        if count > MAX_ELEMENTS:
            where.fail(f"the model has more than {MAX_ELEMENTS} elements", "use fewer instances")
            return
        yield _instance(where, instance, model.submodels[instance.use])


def _count(part: document.Elements) -> int:
    sections: tuple[Sized, ...] = (
        part.points, part.bodies, part.joints, part.gears, part.forces, part.reactions, part.markers, part.outputs,
    )  # fmt: skip
    return sum(len(section) for section in sections)


def _instance(where: Element, instance: document.Instance, submodel: document.Submodel) -> Elements:
    scope = replace(
        where.scope,
        names={**where.scope.names, **_arguments(where, instance, submodel)},
        path=("submodels", instance.use),
        prefix=f"{where.name}.",
        connectors=_connectors(where, instance, submodel),
    )
    elements = read_elements(scope, submodel)
    return mirror_elements(elements, instance.mirror) if instance.mirror else elements


def _arguments(where: Element, instance: document.Instance, submodel: document.Submodel) -> dict[str, Term]:
    """The values that the instance gives to the submodel's parameters."""
    _match_keys(where, "with", instance.with_, submodel.parameters, "parameter", instance.use)
    if instance.binding is not None:
        where.scope.opening.patterns.append(f"{escape(where.name)}.*")
    terms = {name: where.term(value, ("with", name), where.scope.names) for name, value in instance.with_.items()}
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
