"""Classes of isomorphic parts of a mechanism, found by comparing signatures."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import takewhile
from typing import Any, TypeAlias

import sympy

from cutjoint.model.expressions.parse import quantities_read
from cutjoint.model.records import GROUND, Force, Gear, Model, Scalar
from cutjoint.topology.body_graph import BodyGraph
from cutjoint.topology.records import SubtreeClass

Signature: TypeAlias = tuple[Any, ...]


def find_classes(model: Model, graph: BodyGraph) -> tuple[SubtreeClass, ...]:
    """The classes with two or more members whose parts do not lie in larger members: independent classes first, then the largest parts.

    A part is a subtree, or the subtrees of one carrier that cut joints and gears connect, or would without their hub.  Two parts are
    isomorphic when their joints, cut joints, gears, forces and massless bodies agree in kind and place; numbers may differ, and so may the
    bodies outside that they are attached to.  States and signals of the instance that a part's bodies stand in belong to it, and laws agree
    that read the same there.
    """
    around = _around_hubs(graph)
    return _find(model, graph, [*_linked(graph), *around, *([t.child] for t in graph.tree if [t.child] not in around)])


def find_independent_classes(model: Model, graph: BodyGraph) -> tuple[SubtreeClass, ...]:
    """Classes of isomorphic parts without the parts that cut joints and gears connect with others."""
    alone = [[t.child] for t in graph.tree if t.child not in graph.tied]
    return tuple(c for c in _find(model, graph, [*_linked(graph), *_around_hubs(graph), *alone]) if c.independent)


def _linked(graph: BodyGraph) -> Iterator[list[str]]:
    """The bodies next to one carrier whose subtrees are connected."""
    return (roots for carrier in graph.linked for roots in graph.groups(carrier) if len(roots) > 1)


def _around_hubs(graph: BodyGraph) -> list[list[str]]:
    """The roots of branches that meet at a hub."""
    return [[b for b in branch.bodies if graph.carrier.get(b) == branch.carrier] for branch in graph.branches if branch.hub]


def _find(model: Model, graph: BodyGraph, parts: Sequence[Sequence[str]]) -> tuple[SubtreeClass, ...]:
    """The classes among parts, which are given by the roots of their subtrees."""
    attached = _Attached(model, graph)
    sizes = [sum(attached.sizes[root] for root in roots) for roots in parts]
    occurring = Counter(sizes)
    groups: dict[tuple[str | None, Signature], list[_Part]] = {}
    for roots, size in zip(parts, sizes, strict=True):
        if occurring[size] > 1:  # a part of a unique size has no match
            part = attached.part(roots)
            groups.setdefault((part.carrier, part.signature), []).append(part)
    covered: set[str] = set()
    classes = []
    for (carrier, _), group in sorted(groups.items(), key=lambda g: (g[0][0] is None, -len(g[1][0].bodies), g[1][0].bodies[0])):
        fresh = [part for part in group if part.bodies[0] not in covered]
        if len(fresh) > 1:
            first = tuple(part.bodies[0] for part in fresh)
            members = tuple(part.elements for part in fresh)
            classes.append(SubtreeClass(roots=first, size=len(fresh[0].bodies), members=members, independent=carrier is not None))
            covered.update(b for part in fresh for b in part.bodies)
    return tuple(classes)


@dataclass(frozen=True, kw_only=True)
class _Part:
    """A part: its bodies, its ``elements`` in the order of the signature, and the body that carries it. Elements are bodies, tree joints,
    cut joints, gears, forces, states and signals. ``carrier`` is None if the part touches another body of unknown motion than its hub."""

    bodies: tuple[str, ...]
    elements: tuple[str, ...]
    signature: Signature
    carrier: str | None


class _Attached:
    """The elements attached to each body; ``sizes`` are the numbers of bodies of their subtrees."""

    def __init__(self, model: Model, graph: BodyGraph) -> None:
        self._graph = graph
        self._massless = {b.name: b.is_massless for b in model.bodies}
        self._joint_of = {t.child: t for t in graph.tree}
        self._child_of = {t.joint.name: t.child for t in graph.tree}
        self._cuts = _by_body(graph.cuts, lambda cut: (cut.base, cut.follower))
        self._gears = _by_body(graph.gears, self._geared)
        ends = {cut.name: (cut.base, cut.follower) for cut in graph.cuts}
        self._ends = {**{t.joint.name: (t.child,) for t in graph.tree}, **ends}  # of forces on joints' coordinates
        self._hubs = {b: branch.hub for branch in graph.branches for b in branch.bodies if graph.carrier.get(b) == branch.carrier}
        self._forces = _by_body(model.forces, lambda force: force_bodies(force, self._ends))
        self._named = (*(state.name for state in model.states), *(signal.name for signal in model.signals))
        self._shapes = self._numbered_shapes()
        self._children: dict[str, list[str]] = {}
        self.sizes = dict.fromkeys(self._joint_of, 1)
        for t in sorted(graph.tree, key=lambda t: self._shapes[t.child]):
            self._children.setdefault(t.parent, []).append(t.child)
        for t in reversed(graph.tree):
            if t.parent != GROUND:
                self.sizes[t.parent] += self.sizes[t.child]

    def _numbered_shapes(self) -> dict[str, int]:
        """A number for the shape of each body's subtree: its joints and massless bodies."""
        known: dict[Signature, int] = {}
        shapes: dict[str, int] = {}
        below: dict[str, list[int]] = {}
        for t in reversed(self._graph.tree):
            shape = (t.joint.kind, t.reversed, t.joint.guide is not None, self._massless[t.child])
            shapes[t.child] = known.setdefault((*shape, *sorted(below.get(t.child, ()))), len(known))
            below.setdefault(t.parent, []).append(shapes[t.child])
        return shapes

    def _bodies(self, roots: Sequence[str]) -> tuple[str, ...]:
        """The bodies of subtrees, innermost first, then breadth by breadth.
        Bodies next to each other stand in the order of their shapes, so that the file's order counts among those of one shape only."""
        bodies = sorted(roots, key=self._shapes.__getitem__)
        for b in bodies:
            bodies.extend(self._children.get(b, ()))
        return tuple(bodies)

    def _geared(self, gear: Gear) -> tuple[str, ...]:
        return tuple(self._child_of[name] for name in gear.joints)

    def part(self, roots: Sequence[str]) -> _Part:
        """The part that some subtrees are."""
        bodies = self._bodies(roots)
        place = {b: i for i, b in enumerate(bodies)}

        def where(body: str) -> int:
            return place.get(body, -2 if body == GROUND else -1)

        joints = [self._joint_of[b] for b in bodies]
        cuts = _sorted(self._cuts, bodies, lambda c: (c.kind, where(c.base), where(c.follower)))
        gears = _sorted(self._gears, bodies, lambda g: _gear(g, lambda joint: where(self._child_of[joint])))
        instance = _instance(bodies)
        forces = _sorted(self._forces, bodies, lambda f: _force(f, where, self._ends, instance))
        named = tuple(name for name in self._named if instance and name.startswith(instance))
        signature = (
            tuple(self._massless[b] for b in bodies),
            tuple((t.joint.kind, where(t.parent), t.reversed, t.joint.guide is not None, t.joint.armature != 0) for t in joints),
            *(tuple(key for key, _ in found) for found in (cuts, gears, forces)),
            tuple(name.removeprefix(instance) for name in named),
        )
        names = (element.name for found in (cuts, gears, forces) for _, element in found)
        touched = {t.parent for t in joints}
        touched.update(*({c.base, c.follower} for _, c in cuts), *(self._geared(g) for _, g in gears))
        return _Part(
            bodies=bodies, elements=(*bodies, *(t.joint.name for t in joints), *names, *named), signature=signature,
            carrier=self._carrier(bodies, touched - place.keys()),
        )  # fmt: skip

    def _carrier(self, bodies: Sequence[str], touched: Iterable[str]) -> str | None:
        """The body of unknown motion that carries a part; None if the part touches others than its carriers and its hub."""
        carrier = self._graph.top[self._joint_of[bodies[0]].parent]
        above = [*self._graph.path(carrier), self._hubs.get(bodies[0])]
        return carrier if all(self._graph.top[body] in above for body in touched) else None


def _by_body(elements: Iterable[Any], bodies: Any) -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = {}
    for element in elements:
        for body in dict.fromkeys(bodies(element)):
            found.setdefault(body, []).append(element)
    return found


def _sorted(by_body: Mapping[str, Sequence[Any]], bodies: Sequence[str], key: Any) -> list[tuple[Signature, Any]]:
    """The elements at some bodies with their keys, sorted by these."""
    found = {element.name: element for body in bodies for element in by_body.get(body, ())}
    return sorted(((key(element), element) for element in found.values()), key=lambda pair: pair[0])


def force_bodies(force: Force, ends: Mapping[str, tuple[str, ...]]) -> tuple[str, ...]:
    """The bodies that a force acts on; ``ends`` are those of a joint: of one in the tree the body that it carries."""
    return ends[force.joint_of] if force.joint_of else force.bodies


def _instance(bodies: Sequence[str]) -> str:
    """The innermost instance, "name.", that all bodies stand in; "" if there is none."""
    shared = takewhile(lambda parts: len(set(parts)) == 1, zip(*(name.split(".")[:-1] for name in bodies), strict=False))
    return "".join(f"{parts[0]}." for parts in shared)


def _gear(gear: Gear, where: Any) -> tuple[Any, ...]:
    places = tuple((where(end.joint), end.name) for end in gear.coordinates)
    return places if gear.law is None else (*places, _shape(gear.law))


def _force(force: Force, where: Any, ends: Mapping[str, tuple[str, ...]], instance: str) -> tuple[str, tuple[int, ...], str]:
    shape = ";".join(_reading(law, instance) or _shape(law) for law in force.expressions) + force.coordinate_of
    places = tuple(where(b) for b in force_bodies(force, ends))
    # a force between two members may have its base in either
    return type(force).__name__, tuple(sorted(places)) if min(places) < 0 else places, shape


def _reading(law: Scalar, instance: str) -> str:
    """The quantities of its instance that a law reads, by their names there; "" where it reads none.
    How it reads them is left to the folding of blocks: mirrored instances differ in signs, and those around them in what they are given."""
    read = [f"{element}.{quantity}" for element, quantity in quantities_read(law)]
    own = sorted(name.removeprefix(instance) for name in read if instance and name.startswith(instance))
    return "reads " + ",".join(own) if own else ""


@lru_cache(maxsize=4096)
def _shape(law: Scalar) -> str:
    """A law without its numbers.  One of parameters, inputs and quantities alone is a number too: a drive of one wheel, 0 of another."""
    if all(symbol.name.startswith(("p_", "@")) for symbol in law.free_symbols):
        return "number"
    placeholder = sympy.Symbol("number")
    return sympy.srepr(law.replace(lambda e: e.is_Number, lambda e: placeholder)) if law.args else type(law).__name__
