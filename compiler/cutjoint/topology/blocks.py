"""Blocks: biconnected components of the body graph, and the body that carries each.

Bodies connected by guided and fixed joints count as one, since their relative motion is known.  A block is attached to one of these, its
carrier.  No loop passes through another one, so that a block's equations contain motions relative to the carrier only.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from cutjoint.model.records import GROUND, Joint
from cutjoint.topology.records import Topology, TreeJoint, bodies_inwards, degrees, grouped, joints_inwards


@dataclass(frozen=True, kw_only=True)
class Block:
    """A block: its ``joints``, the ``bodies`` that move relative to the ``carrier``, and its ``drives``.
    Drives are guided joints that move ends of the block's joints relative to each other."""

    carrier: str
    bodies: tuple[str, ...]
    joints: tuple[Joint, ...]
    drives: tuple[Joint, ...]


def find_blocks(topology: Topology) -> tuple[Block, ...]:
    """The blocks of a model, in the order of its joints."""
    model = topology.model
    known = grouped((GROUND, *(b.name for b in model.bodies)), ((j.base, j.follower) for j in model.joints if not degrees(j)))
    edges = [(joint, known[joint.base], known[joint.follower]) for joint in model.joints if degrees(joint)]
    place = {joint.name: i for i, joint in enumerate(model.joints)}
    parts = [part for part in _biconnected(edges, known[GROUND]) if len(part) > 1]
    return tuple(_block(topology, known, part) for part in sorted(parts, key=lambda part: min(place[j.name] for j in part)))


def _biconnected(edges: Sequence[tuple[Joint, str, str]], root: str) -> Iterator[list[Joint]]:
    """The biconnected components of a graph as lists of joints (Hopcroft, Tarjan, Communications of the ACM 16, 1973)."""
    at: dict[str, list[tuple[Joint, str]]] = {}
    for joint, one, other in edges:
        at.setdefault(one, []).append((joint, other))
        at.setdefault(other, []).append((joint, one))
    depth, low, path = {root: 0}, {root: 0}, [(root, "", iter(at.get(root, ())))]
    joints: list[Joint] = []
    seen: set[str] = set()
    while path:
        body, arrived, left = path[-1]
        for joint, other in left:
            if joint.name in seen:
                continue
            seen.add(joint.name)
            joints.append(joint)
            if other in depth:
                low[body] = min(low[body], depth[other])
            else:
                depth[other] = low[other] = len(path)
                path.append((other, joint.name, iter(at.get(other, ()))))
                break
        else:
            path.pop()
            if path:
                inner = path[-1][0]
                low[inner] = min(low[inner], low[body])
                if low[body] >= depth[inner]:
                    first = next(i for i, joint in enumerate(joints) if joint.name == arrived)
                    yield joints[first:]
                    del joints[first:]


def _block(topology: Topology, known: Mapping[str, str], joints: Sequence[Joint]) -> Block:
    """A block of joints; bodies of known motion relative to the carrier do not belong to it."""
    above = {t.child: t for t in topology.tree}
    parts = {known[body] for joint in joints for body in (joint.base, joint.follower)}
    base = min(parts, key=lambda part: min(len(bodies_inwards(above, b)) for b, p in known.items() if p == part))
    touched = sorted({body for joint in joints for body in (joint.base, joint.follower) if known[body] == base})
    carrier = _common(above, touched)
    paths = [t.joint for body in touched for t in joints_inwards(above, body)[: bodies_inwards(above, body).index(carrier)]]
    inner = [b for b, part in known.items() if part in parts - {base}]
    drives = tuple(dict.fromkeys(joint for joint in paths if joint.guide is not None))
    return Block(
        carrier=carrier, bodies=tuple(t.child for t in topology.tree if t.child in inner),
        joints=tuple(j for j in topology.model.joints if j in joints), drives=drives,
    )  # fmt: skip


def _common(above: Mapping[str, TreeJoint], bodies: Sequence[str]) -> str:
    """The deepest common ancestor of the bodies."""
    shared = set.intersection(*(set(bodies_inwards(above, body)) for body in bodies))
    return next(body for body in bodies_inwards(above, bodies[0]) if body in shared)
