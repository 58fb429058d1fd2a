"""Classes of isomorphic subtrees, found by comparing signatures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import sympy

from cutjoint.model.records import (
    GROUND,
    AxialForce,
    BodyLoad,
    Bushing,
    Force,
    Gear,
    Joint,
    JointForce,
    Model,
    PointSpring,
    Scalar,
    Tyre,
)  # fmt: skip
from cutjoint.topology.records import SubtreeClass, TreeJoint

Signature: TypeAlias = tuple[Any, ...]


def find_classes(model: Model, tree: Sequence[TreeJoint], cuts: Sequence[Joint]) -> tuple[SubtreeClass, ...]:
    """The classes with two or more members whose subtrees are not parts of larger members, largest subtrees first.

    Two subtrees are isomorphic when their joints, cut joints, gears, forces and massless bodies agree in kind and place; numbers may
    differ, and so may the bodies outside that they are attached to.
    """
    children: dict[str, list[str]] = {}
    for t in tree:
        children.setdefault(t.parent, []).append(t.child)
    members = {t.child: _subtree(t.child, children) for t in tree}
    sizes = Counter(map(len, members.values()))
    massless = {b.name: b.is_massless for b in model.bodies}
    groups: dict[Signature, list[str]] = {}
    for t in tree:
        if sizes[len(members[t.child])] > 1:  # a subtree of a size of its own has no match
            groups.setdefault(_signature(members[t.child], massless, model, tree, cuts), []).append(t.child)
    classes = []
    covered: set[str] = set()
    for roots in sorted(groups.values(), key=lambda g: (-len(members[g[0]]), g[0])):
        fresh = [r for r in roots if r not in covered]
        if len(fresh) > 1:
            elements = tuple(_elements(members[r], model, tree, cuts) for r in fresh)
            classes.append(SubtreeClass(roots=tuple(fresh), size=len(members[fresh[0]]), members=elements))
            covered.update(b for r in fresh for b in members[r])
    return tuple(classes)


def _elements(bodies: Sequence[str], model: Model, tree: Sequence[TreeJoint], cuts: Sequence[Joint]) -> tuple[str, ...]:
    """The elements of a subtree: bodies innermost first, their joints, then cut joints, gears and forces sorted as in the signature."""
    place = {b: i for i, b in enumerate(bodies)}
    joint_of = {t.child: t.joint.name for t in tree}
    child_of, ends = {t.joint.name: t.child for t in tree}, joint_ends(tree, cuts)

    def where(body: str) -> int:
        return place.get(body, -2 if body == GROUND else -1)

    closures = sorted((c for c in cuts if c.base in place or c.follower in place), key=lambda c: (c.kind, where(c.base), where(c.follower)))
    forces = sorted(
        (f for f in model.forces if any(b in place for b in force_bodies(f, ends))), key=lambda f: _force(f, where, ends)
    )
    gears = sorted((g for g in model.gears if {child_of[j] for j in g.joints} & place.keys()), key=lambda g: _gear(g, where, child_of))
    return (*bodies, *(joint_of[b] for b in bodies), *(c.name for c in closures), *(g.name for g in gears), *(f.name for f in forces))


def _subtree(body: str, children: Mapping[str, Sequence[str]]) -> tuple[str, ...]:
    """The bodies of a subtree, innermost first, then breadth by breadth."""
    bodies = [body]
    for b in bodies:
        bodies.extend(children.get(b, ()))
    return tuple(bodies)


def _signature(
    bodies: Sequence[str], massless: Mapping[str, bool], model: Model, tree: Sequence[TreeJoint], cuts: Sequence[Joint]
) -> Signature:
    place = {b: i for i, b in enumerate(bodies)}

    def where(body: str) -> int:
        return place.get(body, -2 if body == GROUND else -1)

    joints = tuple(
        (t.joint.kind, where(t.parent), place[t.child], t.reversed, t.joint.guide is not None) for t in tree if t.child in place
    )
    closures = sorted((c.kind, where(c.base), where(c.follower)) for c in cuts if c.base in place or c.follower in place)
    child_of, ends = {t.joint.name: t.child for t in tree}, joint_ends(tree, cuts)
    forces = sorted(_force(f, where, ends) for f in model.forces if any(b in place for b in force_bodies(f, ends)))
    gears = sorted(_gear(g, where, child_of) for g in model.gears if {child_of[j] for j in g.joints} & place.keys())
    return tuple(massless[b] for b in bodies), joints, tuple(closures), tuple(gears), tuple(forces)


def _gear(gear: Gear, where: Any, child_of: Mapping[str, str]) -> Signature:
    return tuple((where(child_of[c.joint]), c.name) for c in (gear.first, gear.second))


def force_bodies(force: Force, ends: Mapping[str, tuple[str, ...]]) -> tuple[str, ...]:
    """The bodies that a force acts on; ``ends`` are those of `joint_ends`."""
    if isinstance(force, PointSpring | AxialForce | Bushing):
        return force.base, force.follower
    if isinstance(force, JointForce):
        return ends[force.joint]
    return (force.body,)


def joint_ends(tree: Sequence[TreeJoint], cuts: Sequence[Joint]) -> dict[str, tuple[str, ...]]:
    """The bodies that a force on a joint's coordinate acts on: the one that a tree joint carries, base and follower of a cut joint."""
    return {**{t.joint.name: (t.child,) for t in tree}, **{cut.name: (cut.base, cut.follower) for cut in cuts}}


def _force(force: Force, where: Any, ends: Mapping[str, tuple[str, ...]]) -> tuple[str, tuple[int, ...], str]:
    shape = ""
    if isinstance(force, PointSpring | AxialForce | JointForce):
        shape = _shape(force.law) + (force.coordinate if isinstance(force, JointForce) else "")
    elif isinstance(force, Bushing):
        shape = ";".join(_shape(law) for law in force.laws)
    elif isinstance(force, BodyLoad):
        shape = ";".join(_shape(c) for c in force.components)
    else:
        assert isinstance(force, Tyre)
    return type(force).__name__, tuple(where(b) for b in force_bodies(force, ends)), shape


def _shape(law: Scalar) -> str:
    """A law with its numbers taken out."""
    placeholder = sympy.Symbol("number")
    return sympy.srepr(law.replace(lambda e: e.is_Number, lambda e: placeholder)) if law.args else type(law).__name__
