"""The functions of an assembly: its loops closed at nodes of a coordinate, and series through what its joints do there.

A block with one degree of freedom is followed along each coordinate that may lead it, both ways from where the scene has it, until the equations
of the others come near to depending on each other.  The coordinate that gets farthest leads.  Slopes of all joints at Chebyshev nodes (or
equidistant ones on a full turn) become series, which are integrated: this keeps the digits that differentiating twice would lose.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import sympy
from numpy.polynomial import chebyshev

from cutjoint.formulate.inputs import TIME, make_charts, make_numbers, make_translator, open_parameters
from cutjoint.formulate.layout import Chart
from cutjoint.formulate.recursive.kinematics import derive_kinematics
from cutjoint.formulate.recursive.loops import derive_loops
from cutjoint.methods import PLAIN_CLOSURE
from cutjoint.model.records import GROUND, Assembly, Interval, Joint, Model, Series
from cutjoint.program.blocks import Builder
from cutjoint.program.interpret import interpret_blocks
from cutjoint.program.series import Array
from cutjoint.topology.blocks import Block
from cutjoint.topology.records import Topology, degrees

#: The default of the largest error of a function, m or rad.
TOLERANCE = 1e-10
#: The most basis functions of q, and of u.
MOST, MOST_ACROSS = 20, 20
#: Nodes at which loops are closed, along q and across it.
NODES, NODES_ACROSS = 48, 24
#: The step along a motion: the largest turn, or slide beside the block's size; and the most steps one way.
_STEP, _STEPS = 0.15, 150
#: The largest condition of the equations beside that of the start.
_WORSE, _WORST = 10.0, 1e3


class NoAssemblyError(Exception):
    """A block that functions cannot close; the text is the reason."""


@dataclass(frozen=True, kw_only=True)
class Poses:
    """Closed poses of a block: coordinates ``q`` (n, coordinates) of the tree, its Jacobian by all the block's speeds (n, m, speeds), and the
    residual (n, m)."""

    q: Array
    jacobian: Array
    residual: Array


@dataclass(frozen=True)
class BlockLoops:
    """The loops of a block as numbers; its drive is moved by a value u in place of its guide."""

    topology: Topology
    block: Block

    @cached_property
    def charts(self) -> tuple[Chart, ...]:
        """The charts of the whole tree."""
        return make_charts(self.topology)

    @cached_property
    def own(self) -> tuple[Chart, ...]:
        """The charts of the block's joints."""
        names = {joint.name for joint in self.block.joints}
        return tuple(chart for chart in self.charts if chart.joint in names)

    @cached_property
    def speeds(self) -> dict[str, int]:
        """The place of each own chart's first speed among the block's."""
        places, n = {}, 0
        for chart in self.own:
            places[chart.joint] = n
            n += len(chart.speed_names)
        return places

    @property
    def size(self) -> int:
        """The number of the block's speeds."""
        return sum(len(chart.speed_names) for chart in self.own)

    @cached_property
    def turning(self) -> Array:
        """Whether each speed of the block is one of a turn."""
        joints = {joint.name: joint for joint in self.block.joints}
        elements = [joints[c.joint].element for c in self.own]
        return np.array([name in e.angles for e in elements for name in (*e.coordinates, *([None] * 3 * e.has_ball))]) | np.array(
            [name is None for e in elements for name in (*e.coordinates, *([None] * 3 * e.has_ball))]
        )

    @cached_property
    def scales(self) -> Array:
        """A scale of each speed of the block: 1 of turns, the block's size of slides."""
        return np.where(self.turning, 1.0, size_of(self.block))

    @cached_property
    def cuts(self) -> tuple[Joint, ...]:
        """The cut joints of the block."""
        names = {joint.name for joint in self.block.joints}
        return tuple(joint for joint in self.topology.cuts if joint.name in names)

    @cached_property
    def _blocks(self):  # type: ignore[no-untyped-def]
        model, b = self.topology.model, Builder()
        above = {t.child: t for t in self.topology.tree}
        needed = {GROUND}
        for body in {end for joint in self.block.joints for end in (joint.base, joint.follower)}:
            while body not in needed:
                needed.add(body)
                body = above[body].parent
        part = replace(self.topology, tree=tuple(t for t in self.topology.tree if t.child in needed))
        k = derive_kinematics(b, make_translator(b, model), part, {c.joint: c for c in self.charts})
        loops = derive_loops(k, self.cuts, make_numbers(b, self.cuts, PLAIN_CLOSURE))
        return [loop.residual for loop in loops], [loop.rate for loop in loops]

    def design(self, count: int = 1) -> Array:
        """q of the design position, (count, coordinates)."""
        q = np.zeros((count, sum(len(c.coordinate_names) for c in self.charts)))
        for chart in self.charts:
            if chart.ball:
                q[:, chart.q + chart.scalars] = 1.0
        return q

    def evaluate(self, q: Array, u: Array) -> tuple[Array, Array]:
        """Residual (n, m) and Jacobian (n, m, speeds) at coordinates (n, coordinates) and values of the drive (n,)."""
        residuals, rates = self._blocks
        inputs = {
            "t": u[:, np.newaxis, np.newaxis], "motion": np.zeros(1), "numerics": np.ones(3),
            "parameters": np.array([p.value for p in open_parameters(self.topology.model)]),
        }
        unit = np.eye(self.size)
        for chart in self.charts:
            inputs[f"q:{chart.joint}"] = q[:, np.newaxis, chart.q : chart.q + len(chart.coordinate_names)]
            first, n = self.speeds.get(chart.joint), len(chart.speed_names)
            inputs[f"v:{chart.joint}"] = np.zeros(n) if first is None else unit[np.newaxis, :, first : first + n]
        values = interpret_blocks([*residuals, *rates], inputs, {})
        count = len(q)
        residual = [np.broadcast_to(values[x][..., 0], (count, 1, x.shape[0]))[:, 0] for x in residuals]
        jacobian = [np.broadcast_to(values[x][..., 0], (count, self.size, x.shape[0])).swapaxes(1, 2) for x in rates]
        return np.concatenate(residual, axis=1), np.concatenate(jacobian, axis=1)

    def moved(self, q: Array, step: Array) -> Array:
        """Coordinates after steps (n, speeds) of the block."""
        q = q.copy()
        for chart in self.own:
            first, ball = self.speeds[chart.joint], chart.q + chart.scalars
            q[:, chart.q : ball] += step[:, first : first + chart.scalars]
            if chart.ball:
                x, y, z = (step[:, first + chart.scalars + i] / 2 for i in range(3))
                e = q[:, ball : ball + 4].T
                turned = np.array([
                    e[0] - x * e[1] - y * e[2] - z * e[3], e[1] + x * e[0] - z * e[2] + y * e[3],
                    e[2] + y * e[0] + z * e[1] - x * e[3], e[3] + z * e[0] - y * e[1] + x * e[2],
                ])  # fmt: skip
                q[:, ball : ball + 4] = (turned / np.linalg.norm(turned, axis=0)).T
        return q

    def close(self, q: Array, u: Array, held: int | None, across: Array | None = None, enough: float = 0.0) -> Poses | None:
        """Poses near coordinates that close the loops with the speed of the number ``held`` not moved, or by steps ``across`` a direction of
        speeds, until no gap is larger than ``enough`` or it is rounding; None where one does not close."""
        best = np.inf
        for _ in range(25):
            residual, jacobian = self.evaluate(q, u)
            error = float(np.abs(residual).max(initial=0.0))
            if not np.isfinite(error):
                return None
            if error < enough or (error < 1e-12 and error >= best / 2):
                return Poses(q=q, jacobian=jacobian, residual=residual)
            residual = residual.copy()
            best = min(best, error)
            free = _without(jacobian, held)
            if across is not None:
                free = np.concatenate([free, np.broadcast_to(across / np.linalg.norm(across), (len(q), 1, self.size))], axis=1)
                residual = np.concatenate([residual, np.zeros((len(q), 1))], axis=1)
            step = -(np.linalg.pinv(free, rcond=_RANK) @ residual[:, :, np.newaxis])[:, :, 0]
            if np.abs(step).max(initial=0.0) > 3.0:
                return None
            q = self.moved(q, _with_zero(step, held))
        return None

    def slopes(self, poses: Poses, leader: int) -> Array:
        """The block's speeds by that of the number ``leader``, (n, speeds)."""
        free = _without(poses.jacobian, leader)
        found = -(np.linalg.pinv(free, rcond=_RANK) @ poses.jacobian[:, :, leader, np.newaxis])[:, :, 0]
        return _with_zero(found, leader, 1.0)

    def driven(self, poses: Poses, u: Array, leader: int) -> Array:
        """The block's speeds by the rate of the drive, the leader at rest, (n, speeds)."""
        h = 1e-6
        change = (self.evaluate(poses.q, u + h)[0] - self.evaluate(poses.q, u - h)[0]) / (2 * h)
        free = _without(poses.jacobian, leader)
        return _with_zero(-(np.linalg.pinv(free, rcond=_RANK) @ change[:, :, np.newaxis])[:, :, 0], leader)

    def rank(self, jacobian: Array) -> int:
        """The number of independent equations of one pose."""
        values = np.linalg.svd(jacobian, compute_uv=False)
        return int(np.sum(values > 1e-7 * values.max(initial=0.0)))


#: Singular values below this share of the largest belong to equations that follow from others.
_RANK = 1e-8


def _without(jacobian: Array, column: int | None) -> Array:
    return jacobian if column is None else np.delete(jacobian, column, axis=2)


def _with_zero(step: Array, column: int | None, value: float = 0.0) -> Array:
    return step if column is None else np.insert(step, column, value, axis=1)


def driven_by_time(topology: Topology, drive: Joint | None) -> Topology:
    """The topology whose drive is at the time, so that numbers for the time move it."""
    if drive is None:
        return topology
    moved = replace(drive, guide=(TIME,))
    return replace(topology, tree=tuple(replace(t, joint=moved) if t.joint.name == drive.name else t for t in topology.tree))


@dataclass(frozen=True, kw_only=True)
class Curve:
    """Closed poses of a block in the order in which it moves: ``q`` (n, coordinates), tangents ``speeds`` (n, speeds), the largest 1 beside
    the scale of each.  ``start`` is the place of the scene's pose.  A curve that ``closes`` ends at the pose with which it begins."""

    q: Array
    speeds: Array
    start: int
    closes: bool


def follow(loops: BlockLoops, u: float) -> Curve:
    """Follow a block from where the scene has it, both ways, until its equations come near to depending on each other.

    Raises:
        NoAssemblyError: the block does not close, or has another number of degrees of freedom than one.
    """
    start, rank = _start(loops, u)
    tangent, condition = _tangent(loops, start, rank, None)
    limit = min(_WORST, _WORSE * max(condition, 3.0))
    forth, closes = _march(loops, start, rank, tangent, u, limit)
    back = [] if closes else _march(loops, start, rank, -tangent, u, limit)[0]
    whole = [*((pose, -speed) for pose, speed in reversed(back)), (start, tangent), *forth]
    return Curve(
        q=np.concatenate([pose.q for pose, _ in whole]), speeds=np.array([speed for _, speed in whole]), start=len(back), closes=closes
    )  # fmt: skip


def fastest_joints(loops: BlockLoops, u: float) -> list[Joint]:
    """The joints with one coordinate, the fastest where the scene has the block first; errors as of `follow`."""
    start, rank = _start(loops, u)
    tangent = np.abs(_tangent(loops, start, rank, None)[0] / loops.scales)
    joints = {joint.name: joint for joint in loops.block.joints}
    single = [chart.joint for chart in loops.own if len(chart.speed_names) == 1]
    if not single:
        raise NoAssemblyError("no joint with one coordinate leads it")
    return [joints[name] for name in sorted(single, key=lambda name: -float(f"{tangent[loops.speeds[name]]:.2g}"))]


def _start(loops: BlockLoops, u: float) -> tuple[Poses, int]:
    """The pose in which the scene has a block, and the rank of its equations there."""
    start = loops.close(loops.design(), np.full(1, u), None)
    if start is None:
        raise NoAssemblyError("it does not close where the scene has it")
    rank = loops.rank(start.jacobian[0])
    freedom = loops.size - rank
    if freedom != 1:
        raise NoAssemblyError(f"it has {freedom} degrees of freedom beside '{loops.block.carrier}', and one is wanted")
    return start, rank


def _march(loops: BlockLoops, start: Poses, rank: int, tangent: Array, u: float, limit: float) -> tuple[list[tuple[Poses, Array]], bool]:
    """Poses one way from the start, with their tangents; and whether they come back to it."""
    found: list[tuple[Poses, Array]] = []
    poses, before = start, None
    while len(found) < _STEPS:
        closed = None
        ahead = tangent if before is None else 1.5 * tangent - 0.5 * before
        for part in (1.0, 0.25):
            closed = closed or loops.close(loops.moved(poses.q, part * _STEP * ahead[np.newaxis]), np.full(1, u), None, tangent, 1e-8)
        if closed is None:
            return found, False
        turned, condition = _tangent(loops, closed, rank, tangent)
        if condition > limit or turned @ tangent < 0.5 * (tangent @ tangent):
            return found, False
        found.append((closed, turned))
        if len(found) > 3 and _is_near(loops, closed, start, turned):
            return found, True
        poses, tangent, before = closed, turned, tangent
    return found, False


def _tangent(loops: BlockLoops, poses: Poses, rank: int, like: Array | None) -> tuple[Array, float]:
    """The motion that the equations leave free, turned like another one, and the condition of the equations."""
    scales = loops.scales
    _, values, rows = np.linalg.svd(poses.jacobian[0] * scales)
    free = rows[-1] / np.abs(rows[-1]).max()
    if like is not None and free @ (like / scales) < 0:
        free = -free
    return free * scales, float(values[0] / max(values[rank - 1], 1e-300))


def _is_near(loops: BlockLoops, pose: Poses, start: Poses, tangent: Array) -> bool:
    """Return whether a pose is within a step of another one, but for full turns."""
    del tangent
    return _apart(loops, pose.q[0], start.q[0]) < _STEP


def _apart(loops: BlockLoops, one: Array, other: Array) -> float:
    """The largest distance of two poses, full turns left out, beside the scales."""
    found = 0.0
    for chart in loops.own:
        a, b = one[chart.q : chart.q + len(chart.coordinate_names)], other[chart.q : chart.q + len(chart.coordinate_names)]
        first = loops.speeds[chart.joint]
        ways = a[: chart.scalars] - b[: chart.scalars]
        turning = loops.turning[first : first + chart.scalars]
        ways = np.where(turning, np.abs(np.exp(1j * ways) - 1), np.abs(ways) / loops.scales[first : first + chart.scalars])
        found = max(found, float(ways.max(initial=0.0)))
        if chart.ball:
            found = max(found, 2 * float(np.sqrt(max(0.0, 1 - (a[-4:] @ b[-4:]) ** 2))))
    return found


@dataclass(frozen=True, kw_only=True)
class Lead:
    """A coordinate that can lead a block: its range, with ``value`` where the scene has it, and whether it makes full turns there.
    ``travel`` is the way of the block over the range, ``curve`` its poses there in the order of the coordinate."""

    joint: Joint
    place: int
    value: float
    lower: float
    upper: float
    turns: bool
    travel: float
    curve: Array


def find_leads(loops: BlockLoops, curve: Curve) -> list[Lead]:
    """The coordinates that can lead a block, the one that gets farthest first.

    Raises:
        NoAssemblyError: there is none.
    """
    leads = []
    joints = {joint.name: joint for joint in loops.block.joints}
    for chart in loops.own:
        if len(chart.speed_names) == 1:
            lead = _lead(loops, joints[chart.joint], chart, curve)
            if lead is not None:
                leads.append(lead)
    if not leads:
        raise NoAssemblyError("no joint with one coordinate leads it")
    return sorted(leads, key=lambda lead: -lead.travel)


#: The least speed of a leading coordinate beside the fastest of all.
_SLOWEST = 0.08


def _lead(loops: BlockLoops, joint: Joint, chart: Chart, curve: Curve) -> Lead | None:
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
    turns = bool(curve.closes and good.all() and loops.turning[place])
    value = float(curve.q[curve.start, chart.q])
    if turns:
        lower, upper = value - np.pi, value + np.pi
        if abs(abs(values[-1] - values[0]) - 2 * np.pi) > 2 * _STEP:
            return None
    else:
        lower, upper = float(values.min()), float(values.max())
    if min(upper - value, value - lower) < _STEP / 8 * loops.scales[place]:
        return None
    poses = curve.q[first : last + 1]
    return Lead(
        joint=joint, place=place, value=value, lower=lower, upper=upper, turns=turns, travel=_STEP * (last - first),
        curve=poses if sign > 0 else poses[::-1],
    )  # fmt: skip


def size_of(block: Block) -> float:
    """The largest distance of two joints of a block in the design position, m; 1 where parameters give it."""
    points = [joint.at for joint in block.joints]
    try:
        numbers = np.array([[float(x) for x in point] for point in points])
    except TypeError:
        return 1.0
    return float(np.linalg.norm(numbers[:, np.newaxis] - numbers[np.newaxis], axis=2).max()) or 1.0


@dataclass(frozen=True, kw_only=True)
class Fit:
    """Series of a block's tree joints over a range of its leading coordinate."""

    functions: Mapping[str, tuple[Series, ...]]
    range: Interval
    drive_range: Interval | None
    turns: bool
    gap: float
    error: float


def fit(loops: BlockLoops, lead: Lead, u: Interval, tolerance: float = TOLERANCE) -> Fit:
    """Series to a tolerance (m, rad) on the largest range that they reach.

    Raises:
        NoAssemblyError: no range is long enough.
    """
    whole = Interval(lower=lead.lower, upper=lead.upper)
    if lead.turns:
        return _fit(loops, lead, whole, u, tolerance)
    middle = Interval(lower=u.middle, upper=u.middle)
    length = _terms(loops, lead, whole, middle, tolerance)
    while length > MOST:
        if whole.half < 0.5 * _STEP * loops.scales[lead.place]:
            raise NoAssemblyError(f"a function would need more than {MOST} terms")
        parts = ((_SHORTER, 1.0), (1.0, _SHORTER)) if length < np.inf else ((_SHORTER, _SHORTER),)
        shorter = [
            Interval(lower=lead.value + part * (whole.lower - lead.value), upper=lead.value + other * (whole.upper - lead.value))
            for part, other in parts
        ]
        length, whole = min(((_terms(loops, lead, one, middle, tolerance), one) for one in shorter), key=lambda pair: pair[0])
    return _fit(loops, lead, whole, u, tolerance)


#: The part of a side of the range that is left where functions would need too many terms.
_SHORTER = 0.85


def _terms(loops: BlockLoops, lead: Lead, interval: Interval, u: Interval, tolerance: float) -> float:
    """The length of the longest series over a range, between whole numbers by the size of what is left out."""
    try:
        _, slopes = _sampled(loops, lead, interval, u)
    except NoAssemblyError:
        return np.inf
    longest = 0.0
    for _, rates in slopes.values():
        for i in range(rates.shape[-1]):
            c = np.abs(_chebyshev(rates[:, i, np.newaxis])[:, 0]) / max(1.0, float(np.abs(rates).max()))
            left = 1e-3 * float(np.log10(c[MOST:].sum() + 1e-16))
            longest = max(longest, _length(_integral(rates[:, i, np.newaxis], interval), interval.half, tolerance) + left)
    return longest


def _fit(loops: BlockLoops, lead: Lead, interval: Interval, u: Interval, tolerance: float) -> Fit:
    across = NODES_ACROSS if u.half > 0 else 1
    nodes, samples = _sampled(loops, lead, interval, u)
    functions = {}
    for joint, (places, slopes) in samples.items():
        shape = (len(nodes), across, places.shape[-1])
        functions[joint] = tuple(
            _series(places.reshape(shape)[:, :, i], slopes.reshape(shape)[:, :, i], interval, u, lead, nodes, tolerance) for i in range(shape[2])
        )  # fmt: skip
    found = Fit(functions=functions, range=interval, drive_range=u if across > 1 else None, turns=lead.turns, gap=0.0, error=0.0)
    gap, error = _check(loops, lead, found, interval, u)
    if not gap < 1e3 * tolerance:
        raise NoAssemblyError(f"its functions leave a gap of {gap:.1g}")
    return replace(found, gap=gap, error=error)


def _sampled(loops: BlockLoops, lead: Lead, interval: Interval, u: Interval) -> tuple[Array, dict[str, tuple[Array, Array]]]:
    """The nodes, and by joint the coordinates and slopes at them, those of the drive next to each other, (nodes, k)."""
    x = np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)[::-1]
    nodes = interval.middle + interval.half * x
    if lead.turns:
        nodes = lead.value + (2 * np.arange(NODES) / NODES - 1) * np.pi
    values = np.full(1, u.middle)
    if u.half > 0:
        values = u.middle + u.half * np.cos(np.pi * (np.arange(NODES_ACROSS) + 0.5) / NODES_ACROSS)[::-1]
    grid = _grid(loops, lead, nodes, values, u.middle)
    return nodes, {chart.joint: _coordinates(loops, chart, grid, lead) for chart in loops.own if chart.joint != lead.joint.name}


def _grid(loops: BlockLoops, lead: Lead, nodes: Array, values: Array, middle: float) -> Poses:
    """Closed poses at all nodes: from the middle of the drive's range to both of its ends."""
    chart = next(c for c in loops.own if c.joint == lead.joint.name)
    begin = _guess(loops, lead, chart, nodes)
    columns: dict[int, Poses] = {}
    for part in ([i for i, u in enumerate(values) if u >= middle], [i for i, u in reversed(list(enumerate(values))) if u < middle]):
        q = begin
        for i in part:
            closed = loops.close(q, np.full(len(nodes), values[i]), lead.place)
            if closed is None:
                raise NoAssemblyError("its loops do not close over its range")
            columns[i], q = closed, closed.q
    stacked = [np.stack([getattr(columns[i], name) for i in range(len(values))], axis=1) for name in ("q", "jacobian", "residual")]
    q, jacobian, residual = (x.reshape(-1, *x.shape[2:]) for x in stacked)
    return Poses(q=q, jacobian=jacobian, residual=residual)


def _guess(loops: BlockLoops, lead: Lead, chart: Chart, nodes: Array) -> Array:
    """Poses near those at nodes of the leading coordinate: between those of the curve."""
    curve = lead.curve
    along = curve[:, chart.q]
    if lead.turns:  # on with the turn before and the one after, for nodes beyond the ends of the curve
        growth = curve[-1] - curve[0]
        turned = np.where(np.abs(growth) > np.pi, np.sign(growth) * 2 * np.pi, 0.0)
        curve = np.concatenate([curve[:-1] - turned, curve, curve[1:] + turned])
        along = curve[:, chart.q]
        keep = np.concatenate([[True], np.diff(np.maximum.accumulate(along)) > 1e-9])
        curve, along = curve[keep], along[keep]
    q = np.stack([np.interp(nodes, along, column) for column in curve.T], axis=1)
    q[:, chart.q] = nodes
    for c in loops.own:
        if c.ball:
            ball = slice(c.q + c.scalars, c.q + c.scalars + 4)
            q[:, ball] /= np.linalg.norm(q[:, ball], axis=1, keepdims=True)
    return q


def _coordinates(loops: BlockLoops, chart: Chart, poses: Poses, lead: Lead) -> tuple[Array, Array]:
    """The coordinates that series have, scalars and then Rodrigues parameters, and their slopes by q, (n, k)."""
    slopes, first = loops.slopes(poses, lead.place), loops.speeds[chart.joint]
    places = [poses.q[:, chart.q : chart.q + chart.scalars]]
    rates = [slopes[:, first : first + chart.scalars]]
    if chart.ball:
        e = poses.q[:, chart.q + chart.scalars : chart.q + chart.scalars + 4]
        if np.abs(e[:, 0]).min() < _LEAST:
            raise NoAssemblyError(f"'{chart.joint}' turns by more than its functions can")
        g = e[:, 1:] / e[:, :1]
        w = slopes[:, first + chart.scalars : first + chart.scalars + 3]
        places.append(g)
        rates.append((w - np.cross(g, w) + g * np.sum(g * w, axis=1, keepdims=True)) / 2)
    return np.concatenate(places, axis=1), np.concatenate(rates, axis=1)


#: The least cosine of half the angle of a ball.
_LEAST = 0.4


def _series(places: Array, slopes: Array, interval: Interval, u: Interval, lead: Lead, nodes: Array, tolerance: float) -> Series:
    """A series through values and slopes (nodes, nodes across)."""
    if lead.turns:
        return _turning_series(places, slopes, nodes, u, tolerance)
    whole = _integral(slopes, interval)
    x = (nodes - interval.middle) / interval.half
    whole[0] = np.mean(places - chebyshev.chebval(x, whole).T, axis=0)
    size = _length(whole, interval.half, tolerance)
    if size > MOST:
        raise NoAssemblyError(f"a function would need more than {MOST} terms")
    return Series(coefficients=_rows(_across(whole[:size], u, tolerance)))


def _integral(slopes: Array, interval: Interval) -> Array:
    """Coefficients (n + 1, m) of the integrals of slopes (n, m) at the nodes, the constants left out."""
    whole = np.zeros((len(slopes) + 1, slopes.shape[1]))
    whole[1:] = chebyshev.chebint(_chebyshev(slopes), scl=interval.half)[1:]
    return whole


def _across(whole: Array, u: Interval, tolerance: float) -> Array:
    """Coefficients (n, m) by polynomials of u, from their values (n, nodes across)."""
    if whole.shape[1] == 1:
        return whole
    found = _chebyshev(whole.T)
    size = _length(found, u.half, tolerance)
    if size > MOST_ACROSS:
        raise NoAssemblyError(f"a function would need more than {MOST_ACROSS} terms of the drive")
    return found[:size].T


def _length(c: Array, half: float, tolerance: float) -> int:
    """The least number of terms for which value, slope and bend have the tolerance, bends ten times of it, beside what they are.

    Rounding of the slopes, from which coefficients come, and of what the bends make of it, counts as nothing.
    """
    longest = 1
    rounding = 1e-15 * max(1.0, float(np.abs(chebyshev.chebder(c, scl=1 / half)).max(initial=0.0)))
    for order, share in ((0, 1.0), (1, 1.0), (2, 10.0)):
        tail = np.abs(chebyshev.chebder(c, order, scl=1 / half) if order else c).max(axis=1)
        largest = max(1.0, float(tail.max(initial=0.0)))
        noise = rounding * (len(c) ** 2 / half if order == 2 else 1.0)
        small = tail <= max(share * tolerance * largest / 3, noise)
        kept = np.flatnonzero(~small)
        longest = max(longest, (int(kept[-1]) + 1 if kept.size else 0) + order)
    return min(longest, len(c))


def _chebyshev(values: Array) -> Array:
    """Coefficients (n, m) of the polynomials through values (n, m) at the Chebyshev nodes."""
    n = len(values)
    x = np.cos(np.pi * (np.arange(n) + 0.5) / n)[::-1]
    table = chebyshev.chebvander(x, n - 1)
    found = table.T @ values * (2 / n)
    found[0] /= 2
    return np.asarray(found)


def _turning_series(places: Array, slopes: Array, nodes: Array, u: Interval, tolerance: float) -> Series:
    """A trigonometric series through values and slopes at equidistant nodes."""
    if slopes.shape[1] > 1:
        raise NoAssemblyError("it makes full turns, and a drive moves it")
    n = len(nodes)
    order = np.arange(1, n // 2)
    cosine, sine = (2 / n * f(np.outer(order, nodes)) @ slopes for f in (np.cos, np.sin))
    growth = float(np.round(slopes.mean(), 9))
    whole = np.zeros((2 * len(order) + 1, 1))
    whole[1::2], whole[2::2] = -sine / order[:, np.newaxis], cosine / order[:, np.newaxis]
    basis = np.ones((n, len(whole)))
    basis[:, 1::2], basis[:, 2::2] = np.cos(np.outer(nodes, order)), np.sin(np.outer(nodes, order))
    whole[0] = np.mean(places - growth * nodes[:, np.newaxis] - basis @ whole)
    amplitude = np.abs(whole[1::2]) + np.abs(whole[2::2])
    bent = (np.concatenate([[1.0], order**2])[:, np.newaxis] * np.concatenate([np.abs(whole[:1]), amplitude]))[:, 0]
    tail = np.cumsum(bent[::-1])[::-1]
    small = tail <= 10 * tolerance * max(1.0, float(bent[1:].max(initial=0.0)))
    harmonics = int(np.argmax(small)) if small.any() else len(small)
    if harmonics > MOST // 2 + 4:
        raise NoAssemblyError("a function would need too many harmonics")
    return Series(coefficients=_rows(whole[: 2 * max(harmonics, 2) - 1]), slope=growth)


def _rows(c: Array) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(float(x) for x in row) for row in c)


def evaluate(series: Series, q: Array, u: Array, range_: Interval, drive: Interval | None, *, turns: bool) -> Array:
    """A series at coordinates (n,) and values of the drive (n,)."""
    c = np.array(series.coefficients)
    if turns:
        order = np.arange(1, len(c) // 2 + 1)
        basis = np.ones((len(q), len(c)))
        basis[:, 1::2], basis[:, 2::2] = np.cos(np.outer(q, order)), np.sin(np.outer(q, order))
    else:
        basis = chebyshev.chebvander((q - range_.middle) / range_.half, len(c) - 1)
    across = chebyshev.chebvander((u - drive.middle) / drive.half, c.shape[1] - 1) if drive is not None else np.ones((len(q), 1))
    return np.einsum("ni,ij,nj->n", basis, c, across) + series.slope * q


def placed(loops: BlockLoops, lead_joint: str, found: Fit | Assembly, q: Array, u: Array) -> Array:
    """The tree's coordinates (n, coordinates) by the functions of a block."""
    whole = loops.design(len(q))
    for chart in loops.own:
        if chart.joint == lead_joint:
            whole[:, chart.q] = q
            continue
        values = [evaluate(s, q, u, found.range, found.drive_range, turns=found.turns) for s in found.functions[chart.joint]]
        for i in range(chart.scalars):
            whole[:, chart.q + i] = values[i]
        if chart.ball:
            g = np.stack(values[chart.scalars :], axis=1)
            root = 1 / np.sqrt(1 + np.sum(g * g, axis=1, keepdims=True))
            whole[:, chart.q + chart.scalars : chart.q + chart.scalars + 4] = np.concatenate([root, root * g], axis=1)
    return whole


def _check(loops: BlockLoops, lead: Lead, found: Fit, interval: Interval, u: Interval) -> tuple[float, float]:
    """The largest residual, and the largest error of a slope, on a grid four times finer than the nodes."""
    q = np.linspace(interval.lower, interval.upper, 4 * NODES + 1)
    across = np.linspace(u.lower, u.upper, 4 * NODES_ACROSS + 1) if found.drive_range is not None else np.full(1, u.middle)
    qs, us = (x.ravel() for x in np.meshgrid(q, across, indexing="ij"))
    gap = error = 0.0
    for first in range(0, len(qs), 1024):
        part = slice(first, first + 1024)
        whole = placed(loops, lead.joint.name, found, qs[part], us[part])
        residual, jacobian = loops.evaluate(whole, us[part])
        gap = max(gap, float(np.abs(residual).max(initial=0.0)))
        slopes = loops.slopes(Poses(q=whole, jacobian=jacobian, residual=residual), lead.place)
        for chart in loops.own:
            if chart.joint != lead.joint.name and not chart.ball:
                for i, series in enumerate(found.functions[chart.joint]):
                    fitted = _slope(series, qs[part], us[part], found)
                    error = max(error, float(np.abs(fitted - slopes[:, loops.speeds[chart.joint] + i]).max(initial=0.0)))
    return gap, error


def _slope(series: Series, q: Array, u: Array, found: Fit) -> Array:
    from cutjoint.program.series import derivative, fourier_derivative

    c = np.array(series.coefficients)
    c = fourier_derivative(c) if found.turns else derivative(c, found.range.half)
    flat = Series(coefficients=_rows(c), slope=0.0)
    return evaluate(flat, q, u, found.range, found.drive_range, turns=found.turns) + series.slope


def spanning_cuts(block: Block, leader: Joint, used: Sequence[str]) -> frozenset[str]:
    """The joints of a block that are not in the tree whose bodies need the fewest functions; ``used`` are joints on whose coordinates forces
    act."""
    weight = {j.name: 0.0 if j is leader else float(degrees(j)) * (0.25 if j.name in used else 1.0) for j in block.joints}
    distance: dict[str, float] = {}
    ends = {body for joint in block.joints for body in (joint.base, joint.follower)}
    distance = {body: 0.0 for body in ends if body not in block.bodies}
    chosen: set[str] = set()
    while len(distance) < len(ends):
        ways = [
            (distance[a] + weight[j.name], 0 if j.element.closes else -1, n, j.name, c)
            for n, j in enumerate(block.joints)
            for a, c in ((j.base, j.follower), (j.follower, j.base))
            if a in distance and c not in distance
        ]
        length, _, _, name, body = min(ways)
        distance[body] = length
        chosen.add(name)
    return frozenset(j.name for j in block.joints if j.name not in chosen)


def guide_range(model: Model, drive: Joint, end: float, laws: Mapping[object, object]) -> Interval:
    """The range of a guide in a scene, a tenth wider on both sides; one value where it stays."""
    assert drive.guide is not None
    law = sympy.sympify(drive.guide[0]).subs(laws)
    known = {p.symbol: p.value for p in model.parameters}
    law = law.subs(known)
    if not law.has(TIME):
        value = float(law)
        return Interval(lower=value, upper=value)
    times = np.linspace(0.0, end, 2001)
    values = np.array([float(law.subs(TIME, float(t))) for t in times])
    lower, upper = float(values.min()), float(values.max())
    if upper - lower == 0.0:
        return Interval(lower=lower, upper=upper)
    wider = 0.1 * (upper - lower)
    return Interval(lower=lower - wider, upper=upper + wider)
