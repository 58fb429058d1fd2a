"""From the document to flat elements: parameters become symbols, submodels are instantiated and mirrored.

Laws of forces, rates of states, signals and controllers may read quantities of elements defined anywhere. Then elements are read twice:
first to list them, then with the names of their quantities.
"""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import partial
from glob import escape
from itertools import chain

from cutjoint.methods import join_or
from cutjoint.model.document import model_file
from cutjoint.model.document.checks import Shaped
from cutjoint.model.document.source import Source
from cutjoint.model.elements.build import Elements, read_elements, read_points
from cutjoint.model.elements.geometry import read_point
from cutjoint.model.elements.instances import MAX_ELEMENTS, Use, count_elements, find_uses
from cutjoint.model.elements.mirror import mirror_elements
from cutjoint.model.errors import IgnoredProblems, Problems, nearest
from cutjoint.model.expressions.dependencies import check_loops
from cutjoint.model.expressions.functions import read_functions
from cutjoint.model.expressions.machine import Machine
from cutjoint.model.expressions.operations import Term
from cutjoint.model.expressions.parameters import read_parameters
from cutjoint.model.expressions.parse import quantities_read
from cutjoint.model.expressions.quantities import Element as Quantified
from cutjoint.model.expressions.scope import FAILED_TERM, UNKNOWN, Directory, Element, Scope
from cutjoint.model.expressions.tunable import TunableNumbers
from cutjoint.model.files.property_file import MASSES, default_of
from cutjoint.model.records import DerivedParameter, Parameter, Vector


@dataclass(frozen=True)
class Expansion:
    """Parameters, flat elements and scopes of a model with its instances.
    Outputs are read in the scopes, which are by prefix; the model's own is apart. Derived parameters follow from others."""

    parameters: tuple[Parameter, ...]
    derived: tuple[DerivedParameter, ...]
    scope: Scope
    elements: Elements
    reporting: Mapping[str, Scope]


def expand(source: Source, problems: Problems, shaped: Shaped, tunables: TunableNumbers) -> Expansion:
    """Read all elements of the model and of its instances; ``tunables`` makes parameters of their numbers."""
    model, directory = shaped.document, _directory(shaped)
    functions = read_functions(source, problems, model)
    scope = Scope(source, problems, directory, {}, {}, tunables=tunables, functions=functions)
    parameters = read_parameters(scope, model, shaped.lost_parameters)
    scope = parameters.extend(scope)
    machine = Machine(partial(_survey, scope, model))
    scope = replace(scope, own=_own(scope, model), read=machine.read, terms=machine.terms)
    elements = _read(scope, model, machine)
    check_loops(elements.forces, elements.signals, problems)
    reporting = {prefix: replace(each, read=partial(machine.read, reported=True)) for prefix, each in machine.scopes.items()}
    return Expansion(parameters.independent, parameters.derived, scope, elements, reporting)


def _survey(scope: Scope, model: model_file.Document) -> Mapping[str, Quantified]:
    """All elements by name; expressions that read quantities fail here without a report."""
    unheard = replace(scope, problems=IgnoredProblems(), tunables=TunableNumbers(), own=_own(scope, model), read=lambda *_: FAILED_TERM)
    return _read(unheard, model, Machine(dict)).by_name()


def _own(scope: Scope, part: model_file.Elements) -> frozenset[str]:
    """The names of states and signals in a scope, and of elements that could not be read and may be one."""
    prefix, broken = scope.prefix, scope.directory.broken
    return frozenset((*part.states, *part.signals, *(name.removeprefix(prefix) for name in broken if name.startswith(prefix))))


def _read(scope: Scope, model: model_file.Document, machine: Machine) -> Elements:
    """The elements of the model and of its instances; the machine knows all signals before one is read."""
    machine.expect(scope, model)
    inner: dict[str, list[_Scoped]] = {}
    for use in _uses(scope, model, machine):
        inner.setdefault(use.use.owner, []).append(use)
    own = read_elements(scope, model)
    return _joined([own, *(_group(use, inner) for use in inner.get("", ()))])


def _group(of: "_Scoped", inner: "Mapping[str, list[_Scoped]]") -> Elements:
    """The elements of an instance and of those inside it, in its mirror; ``inner`` are the instances by the one around them."""
    own = read_elements(of.scope, of.submodel)
    elements = _joined([own, *(_group(use, inner) for use in inner.get(of.use.name, ()))])
    return mirror_elements(elements, of.use.instance.mirror) if of.use.instance.mirror else elements


def _joined(groups: list[Elements]) -> Elements:
    return Elements(*(tuple(chain.from_iterable(getattr(group, f.name) for group in groups)) for f in fields(Elements)))


def _directory(shaped: Shaped) -> Directory:
    model = shaped.document
    bodies, joints, broken = set(model.bodies), dict(model.joints), set(shaped.removed)
    for use in find_uses(model):
        if use.submodel is None:
            broken.add(use.name)
            continue
        bodies |= {f"{use.name}.{body}" for body in use.submodel.bodies}
        joints |= {f"{use.name}.{joint}": part for joint, part in use.submodel.joints.items()}
    return Directory(frozenset(bodies), joints, frozenset(broken), frozenset((*model.states, *model.signals)), frozenset(model.points))


@dataclass(frozen=True)
class _Scoped:
    """An instance with its submodel and the scope of its elements."""

    use: Use
    submodel: model_file.Submodel
    scope: Scope


def _uses(scope: Scope, model: model_file.Document, machine: Machine) -> Iterator[_Scoped]:
    """All instances, each before its inner ones."""
    count, scopes = count_elements(model), {"": scope}
    for use in find_uses(model):
        outer = scopes.get(use.owner)
        if outer is None:
            continue
        where = Element(outer, f"instance '{use.name}'", use.name, use.path)
        if use.submodel is None:
            _fail_use(where, use)
            continue
        count += 1 + count_elements(use.submodel)
        if count > MAX_ELEMENTS:
            where.fail(f"the model has more than {MAX_ELEMENTS} elements", "use fewer instances")
            return
        inner = _inner(where, use, _around(use, scopes))
        scopes[use.name] = inner
        machine.expect(inner, use.submodel)
        yield _Scoped(use, use.submodel, inner)


def _fail_use(where: Element, use: Use) -> None:
    """Report a submodel that does not exist or that contains itself."""
    name = use.instance.use
    if use.fault:
        where.fail(f"the submodel '{name}' {use.fault}", "remove this instance, or use another submodel", ("use",))
    elif not where.scope.directory.misses(name) and not where.scope.directory.misses(where.scope.prefix + name):
        known = sorted({submodel for level in use.around for submodel in level.part.submodels})
        where.fail(f"unknown submodel '{name}'", nearest(name, known, "submodels"), ("use",))


def _around(use: Use, scopes: Mapping[str, Scope]) -> Scope:
    """The scope of the part of the document that has the instance's submodel: of the model, or of the instance around it."""
    place, owner = use.at[:-2], use.owner
    while scopes[owner].path != place:
        owner = owner.rpartition(".")[0]
    return scopes[owner]


def _inner(where: Element, use: Use, around: Scope) -> Scope:
    """The scope of an instance's elements; names are looked up in the submodel, then in the scopes ``around`` it."""
    assert use.submodel is not None
    instance, mirror = use.instance, use.instance.mirror
    if not _check_accepted(where, instance, use.submodel):  # the numbers and their consequences have another meaning
        around = replace(around, problems=IgnoredProblems())
        where = replace(where, scope=replace(where.scope, problems=IgnoredProblems()))
    arguments = _arguments(where, use, use.submodel)
    symbols = frozenset().union(*(term.value.free_symbols for term in arguments.values()))
    own = {*use.submodel.states, *use.submodel.signals}
    _match_keys(where, "connect", instance.connect, use.submodel.connectors, "connector", instance.use)
    bodies = {name: where.body(body, ("connect", name)) for name, body in instance.connect.items()}
    inner = replace(
        around,
        names={**{name: term for name, term in around.names.items() if name not in own}, **arguments},
        path=use.at,
        prefix=f"{where.name}.",
        connectors={name: bodies.get(name, UNKNOWN) for name in use.submodel.connectors},
        instance_points=_points(where, use),
        sensed=around.sensed | {symbol for symbol in symbols if quantities_read(symbol)},
        mirrors=where.scope.mirrors if mirror is None else (mirror, *where.scope.mirrors),
    )
    return replace(inner, own=_own(inner, use.submodel))


def _arguments(where: Element, use: Use, submodel: model_file.Submodel) -> dict[str, Term]:
    """The values that the instance, its properties or the submodel give to the submodel's parameters."""
    instance = use.instance
    known = (*submodel.parameters, *submodel.defaults)
    properties = {name: value for name, value in instance.properties.items() if name in known and name not in instance.with_}
    absent = absent_properties(instance, submodel)
    others = properties.keys() | absent.keys()
    _match_keys(where, "with", instance.with_, known, "parameter", instance.use, needed=submodel.parameters, others=others)
    if instance.binding is not None:
        where.scope.tunables.instances.append(f"{escape(where.name)}.*")
    values = {("with", name): value for name, value in instance.with_.items()}
    values |= {("properties", name): value for name, value in {**properties, **absent}.items()}
    names = where.scope.reading()
    terms = {keys: where.term(value, keys, names) for keys, value in values.items()}
    arguments = {keys[1]: where.tunable(term, None, keys, is_argument=True) for keys, term in terms.items()}
    return {name: arguments.get(name, FAILED_TERM) for name in submodel.parameters} | _with_defaults(where, use, arguments)


def _with_defaults(where: Element, use: Use, arguments: Mapping[str, Term]) -> dict[str, Term]:
    """The parameters that have defaults: numbers, or expressions over the parameters without, and over defaults before them."""
    assert use.submodel is not None
    inner = replace(where, path=use.at, label=f"submodel '{use.at[-1]}'")
    known = {name: arguments.get(name, FAILED_TERM) for name in use.submodel.parameters}
    for name, value in use.submodel.defaults.items():
        keys = ("defaults", name)
        known[name] = arguments[name] if name in arguments else inner.tunable(inner.term(value, keys, known), None, keys, is_argument=True)
    return {name: known[name] for name in use.submodel.defaults}


def absent_properties(instance: model_file.Instance, submodel: model_file.Submodel) -> dict[str, float]:
    """The coefficients that an instance's properties lack, with the format's defaults, where the submodel is made for such files."""
    if not instance.properties or not submodel.accepts:
        return {}
    names = (name for name in submodel.parameters if name not in instance.properties and name not in instance.with_)
    return {name: value for name in names if (value := default_of(name)) is not None}


def _check_accepted(where: Element, instance: model_file.Instance, submodel: model_file.Submodel) -> bool:
    """Return whether the submodel accepts the kind of properties; others are reported."""
    sound = True
    for key, accepted in submodel.accepts.items():
        value = instance.properties.get(key)
        if value is not None and value not in accepted:
            message = f"{key} is {value:g}, and the submodel '{instance.use}' is made for {join_or(map(str, accepted))}"
            where.fail(message, "use another submodel, or another file", ("properties", key), at_key=True)
            sound = False
    return sound


def _points(where: Element, use: Use) -> dict[str, Vector]:
    """The points of the submodel that the instance gives, by those around the instance."""
    assert use.submodel is not None
    points = use.instance.points
    if not points:
        return {}
    _match_keys(where, "points", points, tuple(use.submodel.points), "point", use.instance.use, needed=())
    around = read_points(replace(where.scope, problems=IgnoredProblems()), use.around[-1].part)
    inner = replace(where, scope=replace(where.scope, points=around))
    return {name: read_point(inner, point, ("points", name)) for name, point in points.items()}


def _match_keys(
    where: Element, field: str, present: Collection[str], wanted: tuple[str, ...], what: str, submodel: str, *,
    needed: tuple[str, ...] | None = None, others: Collection[str] = (),
) -> None:  # fmt: skip
    """Report names that are given and not ``wanted``, and ``needed`` ones (by default all) that are neither given nor among ``others``."""
    for name in (name for name in present if name not in wanted):
        hint = nearest(name, wanted, f"{what}s") or f"it has no {what}s"
        where.fail(f"the submodel '{submodel}' has no {what} '{name}'", hint, (field, name), at_key=True)
    missing = [name for name in (wanted if needed is None else needed) if name not in present and name not in others]
    if missing:
        lacking = f"{field} and properties lack" if others else f"{field} lacks"
        hint = f"the submodel '{submodel}' needs all its {what}s"
        if others and MASSES.issuperset(missing):
            hint = f"the file leaves them to you: write {', '.join(f'{name}: ...' for name in missing)} into {field}"
        where.fail(f"{lacking} {', '.join(missing)}", hint)
