"""The motion of a block with one degree of freedom, and the coordinates that can be its independent one.

A block is traced in both directions from its pose in the scene, until its equations become ill-conditioned.  A coordinate is
independent on the part of this curve around the start on which it is monotone, and not much slower than the fastest one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from cutjoint.analysis.closing import Array
from cutjoint.analysis.embedding.block_loops import BlockLoops, NoEmbeddingError, Poses
from cutjoint.formulate.layout import Chart
from cutjoint.model.records import Joint
from cutjoint.package.errors import plural
from cutjoint.topology.blocks import Block
from cutjoint.topology.geometry import TOLERANCE
from cutjoint.topology.records import degrees

NO_INDEPENDENT = "no joint with one coordinate can be independent in it"  #: the reason that a block cannot be embedded
#: The step along a motion, the largest rotation or the largest displacement by the block's size; and the most steps in one direction.
STEP, STEPS = 0.15, 150
_WORSE, _WORST = 10.0, 1e3  #: the largest condition of the equations relative to that of the start, and absolutely
_ALIKE = 1e-7  #: the largest residual, and rate of one at unit speeds, of a motion that is copied from another block
_SLOWEST = 0.08  #: the least speed of an independent coordinate as a share of the largest of all


@dataclass(frozen=True, kw_only=True)
class Curve:
    """Closed poses of a block in the order of its motion; ``start`` is the index of the scene's pose.
    ``q`` (n, coordinates); tangents ``speeds`` (n, speeds), the largest 1 in units of its scale; a curve that ``closes`` is periodic."""

    q: Array
    speeds: Array
    start: int
    closes: bool


#: Blocks that were followed, and how they move.
Traced: TypeAlias = list[tuple[BlockLoops, Curve]]


def trace(loops: BlockLoops, u: float, known: Traced) -> Curve:
    """Trace a block from its pose in the scene in both directions until its equations become ill-conditioned.
    An equal or mirrored block reuses the ``known`` curve; new curves are added there. Raises NoEmbeddingError: the block does not close,
    or has another number of degrees of freedom than one."""
    start, rank = _start(loops, u)
    alike = (_copied_from(loops, other, curve, u, mirrored) for other, curve in known for mirrored in (False, True))
    found = next((curve for curve in alike if curve is not None), None) or _trace_branch(loops, start, rank, u)
    known.append((loops, found))
    return found


def _copied_from(loops: BlockLoops, other: BlockLoops, curve: Curve, u: float, mirrored: bool) -> Curve | None:
    """The curve of another block, ``mirrored`` in y if so, for this one, if it closes this block's loops from their present pose."""
    kinds = [[(chart.scalars, chart.ball) for chart in block.own] for block in (loops, other)]
    if kinds[0] != kinds[1]:
        return None
    q, speeds = loops.design(len(curve.q)), np.zeros_like(curve.speeds)
    for own, theirs in zip(loops.own, other.own, strict=True):
        n, m = len(own.coordinate_names), len(own.speed_names)
        signs = np.array([1.0] * own.scalars + ([1.0, -1.0, 1.0, -1.0] if mirrored else [1.0] * 4) * own.ball)
        mirror = np.array([1.0] * own.scalars + ([-1.0, 1.0, -1.0] if mirrored else [1.0] * 3) * own.ball)
        first, there = loops.speeds[own.joint], other.speeds[theirs.joint]
        q[:, own.q : own.q + n] = signs * curve.q[:, theirs.q : theirs.q + n]
        speeds[:, first : first + m] = mirror * curve.speeds[:, there : there + m]
    residual, jacobian = loops.evaluate(q, np.full(len(q), u))
    drift = np.abs(np.einsum("nij,nj->ni", jacobian, speeds)).max(initial=0.0)
    begins = np.abs(q[curve.start] - loops.design()[0]).max() < _ALIKE
    return replace(curve, q=q, speeds=speeds) if begins and max(np.abs(residual).max(initial=0.0), drift) < _ALIKE else None


def _trace_branch(loops: BlockLoops, start: Poses, rank: int, u: float) -> Curve:
    tangent, condition = _tangent(loops, start, rank, None)
    limit = min(_WORST, _WORSE * max(condition, 3.0))
    forth, closes = _march(loops, start, rank, tangent, u, limit)
    back = [] if closes else _march(loops, start, rank, -tangent, u, limit)[0]
    whole = [*((pose, -speed) for pose, speed in reversed(back)), (start, tangent), *forth]
    q, speeds = np.concatenate([pose.q for pose, _ in whole]), np.array([speed for _, speed in whole])
    if not closes:
        return Curve(q=q, speeds=speeds, start=len(back), closes=False)
    half = len(q) // 2  # the second half leads up to the start
    q = np.concatenate([q[half:] - full_turns(q), q[:half]])
    return Curve(q=q, speeds=np.concatenate([speeds[half:], speeds[:half]]), start=len(q) - half, closes=True)


def full_turns(q: Array) -> Array:
    """The full turns by which coordinates differ at the end of a curve that closes."""
    return np.asarray(2 * np.pi * np.round((q[-1] - q[0]) / (2 * np.pi)))


def fastest_joints(loops: BlockLoops, u: float) -> list[Joint]:
    """The joints with one coordinate, the fastest where the scene has the block first; errors as of `trace`."""
    start, rank = _start(loops, u)
    tangent = np.abs(_tangent(loops, start, rank, None)[0] / loops.scales)
    joints = {joint.name: joint for joint in loops.block.joints}
    single = [chart.joint for chart in loops.own if len(chart.speed_names) == 1]
    if not single:
        raise NoEmbeddingError(NO_INDEPENDENT)
    return [joints[name] for name in sorted(single, key=lambda name: -float(f"{tangent[loops.speeds[name]]:.2g}"))]


def _start(loops: BlockLoops, u: float) -> tuple[Poses, int]:
    """The pose in which the scene has a block, and the rank of its equations there."""
    start = loops.close(loops.design(), np.full(1, u), None)
    if start is None:
        raise NoEmbeddingError("it does not close where the scene has it")
    values = np.linalg.svd(start.jacobian[0], compute_uv=False)
    rank = int(np.sum(values > TOLERANCE * values.max(initial=0.0)))
    freedom = loops.size - rank
    if freedom != 1:
        raise NoEmbeddingError(f"it has {plural(freedom, 'degree')} of freedom relative to '{loops.block.carrier}' instead of one")
    return start, rank


def _march(loops: BlockLoops, start: Poses, rank: int, tangent: Array, u: float, limit: float) -> tuple[list[tuple[Poses, Array]], bool]:
    """Poses in one direction from the start, with their tangents; and whether they return to it."""
    found: list[tuple[Poses, Array]] = []
    poses, before = start, None
    while len(found) < STEPS:
        closed = None
        ahead = tangent if before is None else 1.5 * tangent - 0.5 * before
        for part in (1.0, 0.25):
            closed = closed or loops.close(loops.moved(poses.q, part * STEP * ahead[np.newaxis]), np.full(1, u), None, tangent, 1e-8)
        if closed is None:
            return found, False
        turned, condition = _tangent(loops, closed, rank, tangent)
        if condition > limit or turned @ tangent < 0.5 * (tangent @ tangent):
            return found, False
        found.append((closed, turned))
        if len(found) > 3 and _apart(loops, closed.q[0], start.q[0]) < STEP:
            return found, True
        poses, tangent, before = closed, turned, tangent
    return found, False


def _tangent(loops: BlockLoops, poses: Poses, rank: int, like: Array | None) -> tuple[Array, float]:
    """The unit motion that the equations leave free, with the sign of ``like``, and the condition number of the equations."""
    scales = loops.scales
    _, values, rows = np.linalg.svd(poses.jacobian[0] * scales)
    free = rows[-1] / np.abs(rows[-1]).max()
    if like is not None and free @ (like / scales) < 0:
        free = -free
    return free * scales, float(values[0] / max(values[rank - 1], 1e-300))


def _apart(loops: BlockLoops, one: Array, other: Array) -> float:
    """The largest distance of two poses in units of the scales, without full turns."""
    found = 0.0
    for chart in loops.own:
        a, b = one[chart.q : chart.q + len(chart.coordinate_names)], other[chart.q : chart.q + len(chart.coordinate_names)]
        first = loops.speeds[chart.joint]
        differences = a[: chart.scalars] - b[: chart.scalars]
        own = slice(first, first + chart.scalars)
        differences = np.where(loops.is_rotation[own], np.abs(np.exp(1j * differences) - 1), np.abs(differences) / loops.scales[own])
        found = max(found, float(differences.max(initial=0.0)))
        if chart.ball:
            found = max(found, 2 * max(0.0, 1 - float(a[-4:] @ b[-4:]) ** 2) ** 0.5)
    return found


@dataclass(frozen=True, kw_only=True)
class Independent:
    """A coordinate that can be independent in a block, with its range and its ``value`` in the scene.
    ``travel`` is over the range, ``curve`` has its poses there in the order of the coordinate; it ``closes`` after a full turn."""

    joint: Joint
    place: int
    value: float
    lower: float
    upper: float
    is_periodic: bool
    travel: float
    curve: Array
    closes: bool


def find_independent(loops: BlockLoops, curve: Curve) -> list[Independent]:
    """The coordinates that can be independent in a block, the one with the longest travel first. Raises NoEmbeddingError: there is none."""
    candidates = []
    joints = {joint.name: joint for joint in loops.block.joints}
    for chart in loops.own:
        if len(chart.speed_names) == 1:
            independent = _lead(loops, joints[chart.joint], chart, curve)
            if independent is not None:
                candidates.append(independent)
    if not candidates:
        raise NoEmbeddingError(NO_INDEPENDENT)
    return sorted(candidates, key=lambda independent: -independent.travel)


def _lead(loops: BlockLoops, joint: Joint, chart: Chart, curve: Curve) -> Independent | None:
    place = loops.speeds[chart.joint]
    speed = curve.speeds[:, place] / loops.scales[place]
    sign = np.sign(speed[curve.start])
    good = sign * speed > _SLOWEST
    if not good[curve.start]:
        return None
    first = last = curve.start
    while first > 0 and good[first - 1]:
        first -= 1
    while last < len(good) - 1 and good[last + 1]:
        last += 1
    values = curve.q[first : last + 1, chart.q]
    is_periodic = bool(curve.closes and good.all() and loops.is_rotation[place])
    value = float(curve.q[curve.start, chart.q])
    if is_periodic:
        lower, upper = value - np.pi, value + np.pi
        if abs(abs(values[-1] - values[0]) - 2 * np.pi) > 2 * STEP:
            return None
    else:
        lower, upper = float(values.min()), float(values.max())
    if min(upper - value, value - lower) < STEP / 8 * loops.scales[place]:
        return None
    poses = curve.q[first : last + 1]
    return Independent(
        joint=joint, place=place, value=value, lower=lower, upper=upper, is_periodic=is_periodic, travel=STEP * (last - first),
        curve=poses if sign > 0 else poses[::-1], closes=is_periodic,
    )  # fmt: skip


def spanning_cuts(block: Block, independent: Joint, used: Sequence[str]) -> frozenset[str]:
    """The joints of a block that are not in the tree whose bodies need the fewest functions.
    ``used``: joints on whose coordinates forces act."""
    weight = {j.name: 0.0 if j is independent else float(degrees(j)) * (0.25 if j.name in used else 1.0) for j in block.joints}
    ends = {body for joint in block.joints for body in (joint.base, joint.follower)}
    distance = {body: 0.0 for body in ends if body not in block.bodies}
    chosen: set[str] = set()
    while len(distance) < len(ends):
        differences = [
            (distance[a] + weight[j.name], 0 if j.element.closes else -1, n, j.name, c)
            for n, j in enumerate(block.joints)
            for a, c in ((j.base, j.follower), (j.follower, j.base))
            if a in distance and c not in distance
        ]
        length, _, _, name, body = min(differences)
        distance[body] = length
        chosen.add(name)
    return frozenset(j.name for j in block.joints if j.name not in chosen)
