"""Motions without inertia, for which the condensation would divide by zero.

The joints' unknowns are eliminated from M + Phi_v^T a Phi_v, which is positive definite unless some speeds move neither a mass nor a
cut joint's equation.  A massless link between two spherical joints is the usual case: it is free to spin about its own axis.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cutjoint.analysis.closing import Array, Pose, design_coordinates, evaluate_closures, evaluate_rates, explore
from cutjoint.elements.joint import Direction, Rotation, Translation
from cutjoint.formulate.inputs import make_translator
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.formulate.recursive.kinematics import Kinematics, derive_kinematics, halves
from cutjoint.model.records import Body, Model
from cutjoint.package.errors import EquationsError
from cutjoint.program.blocks import Block, Builder
from cutjoint.topology.geometry import TOLERANCE, evaluate
from cutjoint.topology.records import TreeJoint, degrees

_PART = 1e-6  #: a share of a motion below this is none


class NoInertiaError(EquationsError, ValueError):
    """Joints have a motion without inertia."""


@dataclass(frozen=True, kw_only=True)
class IdleMotion:
    """A motion without inertia: the tree joints that take part and the names of their speeds."""

    joints: tuple[TreeJoint, ...]
    speeds: tuple[str, ...]


def require_inertia(equations: RecursiveEquations) -> None:
    """Refuse a mechanism that the condensation cannot solve.
    Raises NoInertiaError: some motion moves no mass in any pose; one line for all of the same joints."""
    found: dict[tuple[str, ...], IdleMotion] = {}
    for motion in find_idle_motions(equations):
        names = tuple(t.child for t in motion.joints)
        before = found[names].speeds if names in found else ()
        found[names] = replace(motion, speeds=before + motion.speeds)
    if found:
        raise NoInertiaError("\n".join(map(_describe, found.values())))


def _describe(motion: IdleMotion) -> str:
    joint = motion.joints[0].joint
    bodies = ", ".join(f"'{t.child}'" for t in motion.joints)
    return (
        f"{joint.span}: joint '{joint.name}': nothing resists the motion of {'body' if len(motion.joints) == 1 else 'bodies'} {bodies} "
        f"({', '.join(motion.speeds)}), so that its acceleration would be a division by zero; give it mass and inertia (a slender rod has "
        "none about itself), or take a joint that does not leave it free (a massless link between two spherical joints: make one of them "
        "universal)"
    )


def find_momentary_motions(equations: RecursiveEquations, poses: Sequence[Pose]) -> tuple[IdleMotion, ...]:
    """The motions that move no mass and no cut joint's equation in the first of the ``poses`` of `explore`, the design position.
    If the mechanism passes `require_inertia`, they lack inertia in this pose only. The usual case is a massless link in a straight line:
    the two joints that carry it are in line with the joint or mass that it moves."""
    if _every_body_resists(equations):
        return ()
    return _separate(equations, _null_space(equations, _effects(equations), poses[0].q))


def describe_momentary(model: Model, motion: IdleMotion) -> str:
    """The fault of the design position, at the lines of the bodies without mass, or at all moved bodies if each has some."""
    moved = [body for body in model.bodies if body.name in {t.child for t in motion.joints}]
    named = [body for body in moved if body.is_massless] or moved
    message = (
        f"in the design position no mass resists its motion ({', '.join(motion.speeds)}), as where a massless link is in line with what it "
        "moves, so that its acceleration is not determined; give it mass and inertia, or start from another pose"
    )
    return "\n".join(f"{body.span}: body '{body.name}': {message}" for body in named)


def find_idle_motions(equations: RecursiveEquations) -> tuple[IdleMotion, ...]:
    """The motions that move no mass and no cut joint's equation, in the design position and in all poses near it."""
    if _every_body_resists(equations):
        return ()
    effects = _effects(equations)
    if not _null_space(equations, effects, design_coordinates(equations)).size:
        return ()
    spaces = [_null_space(equations, effects, pose.q) for pose in explore(equations)]
    return _separate(equations, min(spaces, key=lambda n: n.shape[1]))


# Bodies whose own mass resists their joint


def _every_body_resists(equations: RecursiveEquations) -> bool:
    """Return whether each body's own mass resists every motion in its joint: then all motions of the mechanism have mass in every pose."""
    topology = equations.topology
    bodies = {b.name: b for b in topology.model.bodies}
    return all(_resists(topology.model, bodies[t.child], t) for t in topology.tree)


def _resists(model: Model, body: Body, t: TreeJoint) -> bool:
    if degrees(t.joint) == 0:
        return True
    (mass,) = evaluate(model, [body.mass])
    xx, yy, zz, xy, xz, yz = evaluate(model, body.inertia)
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    motions = t.joint.element.chain
    if all(isinstance(m, Translation) for m in motions):
        return bool(mass > 0)
    if len(motions) == 1 and isinstance(turn := motions[0], Rotation) and turn.direction is Direction.AXIS and not turn.is_screw:
        axis, arm = evaluate(model, t.joint.axes[0]), evaluate(model, body.centre_of_mass) - evaluate(model, t.joint.at)
        return bool(axis @ inertia @ axis + mass * np.sum(np.cross(axis, arm) ** 2) > TOLERANCE * (np.trace(inertia) + mass * arm @ arm))
    principal = np.linalg.eigvalsh(inertia)
    return bool(mass > 0 and principal[0] > TOLERANCE * principal[-1])


# Speeds that move nothing


def _effects(equations: RecursiveEquations) -> list[Block]:
    """The momentum of each body, and its angular momentum about its centre of mass in its own axes: masses resist their change."""
    b, model = Builder(), equations.topology.model
    charts = {c.joint: c for c in equations.charts}
    k = derive_kinematics(b, make_translator(b, model), equations.topology, charts)
    return [block for body in model.bodies for block in _momenta(k, body)]


def _momenta(k: Kinematics, body: Body) -> Iterable[Block]:
    b = k.builder
    xx, yy, zz, xy, xz, yz = (k.translator.scalar(x) for x in body.inertia)
    tensor = b.stack([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    _, w = halves(b, k.frames[body.name].Z)
    yield b.scale(k.translator.scalar(body.mass), k.velocity(body.name, k.point(body.name, body.centre_of_mass)))
    yield b.mul(tensor, b.mul(b.transpose(k.frames[body.name].R), w))


def _null_space(equations: RecursiveEquations, effects: Sequence[Block], q: Array) -> Array:
    """The speeds that move no mass and no cut joint's equation, as orthonormal columns; each effect counts by its own measure."""
    parts = [*evaluate_rates(equations, q, effects), evaluate_closures(equations, q)[1]]
    scaled = [p / largest for p in parts if (largest := np.abs(p).max(initial=0.0)) > 0]
    matrix = np.concatenate([np.zeros((equations.speeds, equations.speeds)), *scaled])
    _, values, turned = np.linalg.svd(matrix, full_matrices=False)
    space: Array = turned[values <= TOLERANCE * values.max(initial=0.0)].T
    return space


def _separate(equations: RecursiveEquations, space: Array) -> tuple[IdleMotion, ...]:
    """The independent motions of a null space: speeds that its projector connects move together."""
    connected = np.abs(space @ space.T) > _PART
    tree = {t.joint.name: t for t in equations.topology.tree}
    owners = [c.joint for c in equations.charts for _ in c.speed_names]
    motions, seen = [], np.zeros(len(owners), dtype=bool)
    for i in np.flatnonzero(connected.diagonal()):
        if seen[i]:
            continue
        group = connected[i]
        while (wider := connected[group].any(axis=0)).sum() > group.sum():
            group = wider
        seen |= group
        speeds = np.flatnonzero(group)
        joints = dict.fromkeys(owners[n] for n in speeds)
        motions.append(IdleMotion(joints=tuple(tree[j] for j in joints), speeds=tuple(equations.speed_names[n] for n in speeds)))
    return tuple(motions)
