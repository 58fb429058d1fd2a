"""Joints that stand alike in the body graph, before anything is cut: by their kind, and by the joints and forces around them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cutjoint.model.records import GROUND, Model
from cutjoint.topology.elimination import degrees

#: The largest distance, in joints, of a difference that tells joints apart.
RADIUS = 8


def number_alike(model: Model) -> Mapping[str, int]:
    """A number for each joint by its name, the same for joints whose surroundings have one shape up to RADIUS joints away.

    Bodies that guided joints carry count as the bodies that carry them, so that a steered axle is like another.
    """
    merged = _merged(model)
    massless = {body.name for body in model.bodies if body.is_massless}
    forces: dict[str, list[str]] = {}
    for force in model.forces:
        for body in force.bodies:
            forces.setdefault(merged[body], []).append(type(force).__name__)
    bodies: dict[str, Any] = {b: (b == merged[GROUND], b in massless, tuple(sorted(forces.get(b, ())))) for b in merged.values()}
    joints: dict[str, Any] = {j.name: (j.kind, j.guide is not None) for j in model.joints}
    ends = {j.name: (merged[j.base], merged[j.follower]) for j in model.joints}
    for _ in range(RADIUS):
        bodies, joints = _numbered(bodies), _numbered(joints)
        seen: dict[str, list[tuple[int, int, int]]] = {}
        for name, (base, follower) in ends.items():
            seen.setdefault(base, []).append((joints[name], 0, bodies[follower]))
            seen.setdefault(follower, []).append((joints[name], 1, bodies[base]))
        joints = {name: (joints[name], bodies[base], bodies[follower]) for name, (base, follower) in ends.items()}
        bodies = {body: (number, tuple(sorted(seen.get(body, ())))) for body, number in bodies.items()}
    return _numbered(joints)


def _numbered(shapes: Mapping[str, Any]) -> dict[str, int]:
    known: dict[Any, int] = {}
    return {name: known.setdefault(shape, len(known)) for name, shape in shapes.items()}


def _merged(model: Model) -> dict[str, str]:
    """Each body's representative among those that guided joints connect with it."""
    merged = {GROUND: GROUND, **{b.name: b.name for b in model.bodies}}
    for joint in model.joints:
        if degrees(joint) == 0 and merged[joint.base] != merged[joint.follower]:
            old, new = merged[joint.follower], merged[joint.base]
            merged = {body: new if one == old else one for body, one in merged.items()}
    return merged
