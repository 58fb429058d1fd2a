"""The functions of an embedded loop: series for its dependent joints over a range of the independent coordinate.

Loops are closed at Chebyshev nodes, or at equidistant ones on a full turn. The series interpolate the derivatives of all joints and are
integrated: differentiating twice would lose digits. The range is as long as the number of terms allows.
"""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.polynomial import chebyshev

from cutjoint.analysis.closing import Array
from cutjoint.analysis.embedding.block_loops import BlockLoops, NoEmbeddingError, Poses
from cutjoint.analysis.embedding.independent import STEP, Independent, full_turns
from cutjoint.formulate.layout import Chart
from cutjoint.formulate.recursive.embedding.open_geometry import driven_by_time, joints_of, without_embedded_loops
from cutjoint.model.records import EmbeddedLoop, Interval, LoopFunctions, Series
from cutjoint.program.series import (
    chebyshev_integral,
    chebyshev_series,
    derivative,
    fourier_derivative,
    fourier_integral,
    harmonics,
    set_constants,
)
from cutjoint.topology.blocks import Block
from cutjoint.topology.records import Topology

MOST_ACROSS, NODES_ACROSS = 20, 24  #: the most terms of a function by u, and the nodes across q at which loops are closed
#: The spare terms of functions that are found anew with other geometry, and may then need more, and the nodes that such a search has beyond
#: the longest function's terms: with n nodes the coefficient of order 2n - k adds to that of order k.
SPARE, SPARE_NODES = 2, 4
#: The ranges that functions reached, by the curves of the independent coordinate: equal and mirrored blocks share them.
Ranges: TypeAlias = dict[tuple[float, ...], Interval]
_SHORTER = 0.85  #: the part of a side of the range that is left where functions would need too many terms
_LEAST_SIDE = 0.05  #: the smallest share of the whole range that a side may have
_LEAST = 0.4  #: the least cosine of half the angle of a ball
_ORDERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))  #: the orders of derivatives by q and u that motions have
_ALLOWED = 10.0  #: the allowed violation as a multiple of the tolerance of a function: several functions and arms contribute
#: The number of random coordinates at which functions are compared with closed loops, and the distance of neighbours as a share of half the
#: range.
_RANDOM, _NEIGHBOUR = 1000, 1e-4
_SAMPLES = 40  #: the number of points at which derivatives are evaluated


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """The wanted functions: ``tolerance`` (m, rad), most ``terms`` on a range (a full turn may have more), ``spare`` terms to add."""

    tolerance: float
    terms: int
    spare: int = 0

    @property
    def nodes(self) -> int:
        """The number of nodes along q on a range."""
        return 2 * self.terms

    @property
    def harmonics(self) -> int:
        """The most harmonics on a full turn."""
        return max(48, self.terms)

    @property
    def nodes_around(self) -> int:
        """The number of nodes on a full turn."""
        return 5 * self.harmonics // 2


def fit(loops: BlockLoops, independent: Independent, u: Interval, wanted: Wanted, known: Ranges) -> LoopFunctions:
    """Series that meet the tolerance on the largest possible range, which is added to the ``known`` ones.

    Raises:
        NoEmbeddingError: no range is long enough.
    """
    if loops.open:
        wanted = replace(wanted, terms=wanted.terms - SPARE, spare=SPARE)
    key = *(round(x, 9) for x in (independent.lower, independent.upper, independent.value)), *(u.lower, u.upper)
    if (found := known.get(key)) is not None:
        with suppress(NoEmbeddingError):
            return _fit(loops, replace(independent, is_periodic=independent.is_periodic and found.half > 3), found, u, wanted)
    functions = _fit_longest(loops, independent, u, wanted)
    known[key] = functions.range
    return functions


def _fit_longest(loops: BlockLoops, independent: Independent, u: Interval, wanted: Wanted) -> LoopFunctions:
    whole = Interval(lower=independent.lower, upper=independent.upper)
    if independent.is_periodic:
        with suppress(NoEmbeddingError):
            return _fit(loops, independent, whole, u, wanted)
        independent = replace(independent, is_periodic=False)
    middle = Interval(lower=u.middle, upper=u.middle)
    length = _terms(loops, independent, whole, middle, wanted)
    while length > wanted.terms:
        if whole.half < 0.5 * STEP * loops.scales[independent.place]:
            raise NoEmbeddingError(f"a function would need more than {wanted.terms} terms")
        shorter = _shorter(whole, independent.value, length > wanted.nodes)
        lengths = [_terms(loops, independent, one, middle, wanted) for one in shorter]
        length = min(lengths)
        whole = shorter[lengths.index(length)]
    while True:
        try:
            return _fit(loops, independent, whole, u, wanted)
        except NoEmbeddingError:
            lower, upper = (independent.value + _SHORTER * (end - independent.value) for end in (whole.lower, whole.upper))
            whole = Interval(lower=lower, upper=upper)
            if u.half == 0 or whole.half < 0.5 * STEP * loops.scales[independent.place]:
                raise


def _shorter(whole: Interval, value: float, unresolved: bool) -> list[Interval]:
    """Shorter ranges about a value: one side is shortened, or, if the functions do not distinguish the sides, the longer one."""
    sides = value - whole.lower, whole.upper - value
    found = [
        Interval(lower=value - (_SHORTER if first else 1.0) * sides[0], upper=value + (1.0 if first else _SHORTER) * sides[1])
        for first in (True, False)
        if sides[0 if first else 1] >= (max(sides) if unresolved else _LEAST_SIDE * sum(sides))
    ]
    return found[:1] if unresolved else found


def _terms(loops: BlockLoops, independent: Independent, interval: Interval, u: Interval, wanted: Wanted) -> float:
    """The length of the longest series over a range, interpolated between whole numbers by the truncation error."""
    try:
        _, derivatives = _sampled(loops, independent, interval, u, wanted)
    except NoEmbeddingError:
        return np.inf
    longest = 0.0
    for _, rates in derivatives.values():
        for i in range(rates.shape[-1]):
            c = np.abs(chebyshev_series(rates[:, i, np.newaxis])[:, 0]) / max(1.0, float(np.abs(rates).max()))
            left = 1e-3 * float(np.log10(float(c[wanted.terms:].sum()) + 1e-16))
            whole = chebyshev_integral(rates[:, i, np.newaxis], interval.half)
            longest = max(longest, _length(whole, interval.half, wanted.tolerance) + left)
    return longest


def _fit(loops: BlockLoops, independent: Independent, interval: Interval, u: Interval, wanted: Wanted) -> LoopFunctions:
    across = NODES_ACROSS if u.half > 0 else 1
    nodes, samples = _sampled(loops, independent, interval, u, wanted)
    series = {}
    for joint, (places, derivatives) in samples.items():
        shape = (len(nodes), across, places.shape[-1])
        place, derivative = places.reshape(shape), derivatives.reshape(shape)
        series[joint] = tuple(_series(place[..., i], derivative[..., i], interval, u, independent, nodes, wanted) for i in range(shape[2]))
    periodic = independent.is_periodic
    found = LoopFunctions(series=series, range=interval, drive_range=u, is_periodic=periodic, violation=0.0, violation_rate=0.0)
    violation, violation_rate = _violations(loops, independent, found, wanted)
    if not violation < _ALLOWED * wanted.tolerance or not violation_rate < _ALLOWED * wanted.tolerance * _largest_derivative(found):
        raise NoEmbeddingError(f"its functions leave a violation of {violation:.1g}, with the rate {violation_rate:.1g}")
    terms = max((len(s.coefficients) for each in series.values() for s in each), default=1)
    enough = len(nodes) if independent.is_periodic else min(len(nodes), terms + SPARE_NODES)
    found = replace(found, violation=violation, violation_rate=violation_rate, open=loops.open)
    return replace(found, nodes=enough, allowed=_ALLOWED * wanted.tolerance)


def _sampled(
    loops: BlockLoops, independent: Independent, interval: Interval, u: Interval, wanted: Wanted
) -> tuple[Array, dict[str, tuple[Array, Array]]]:  # fmt: skip
    """The nodes, and by joint the coordinates and derivatives at them, those of the drive next to each other, (nodes, k)."""
    nodes = _nodes(interval, wanted.nodes_around if independent.is_periodic else wanted.nodes, is_periodic=independent.is_periodic)
    values = np.full(1, u.middle)
    if u.half > 0:
        values = u.middle + u.half * np.cos(np.pi * (np.arange(NODES_ACROSS) + 0.5) / NODES_ACROSS)[::-1]
    grid = _grid(loops, independent, nodes, values, u.middle)
    others = (chart for chart in loops.own if chart.joint != independent.joint.name)
    return nodes, {chart.joint: _coordinates(loops, chart, grid, independent.place) for chart in others}


def _nodes(interval: Interval, count: int, *, is_periodic: bool) -> Array:
    """Chebyshev nodes on a range, or equidistant ones on a full turn about its middle."""
    if is_periodic:
        return np.asarray(interval.middle + (2 * np.arange(count) / count - 1) * np.pi)
    return np.asarray(interval.middle + interval.half * np.cos(np.pi * (np.arange(count) + 0.5) / count)[::-1])


def _grid(loops: BlockLoops, independent: Independent, nodes: Array, values: Array, middle: float) -> Poses:
    """Closed poses at all nodes: from the middle of the drive's range to both of its ends."""
    chart = next(c for c in loops.own if c.joint == independent.joint.name)
    begin = _guess(loops, independent, chart, nodes)
    columns: dict[int, Poses] = {}
    for part in ([i for i, u in enumerate(values) if u >= middle], [i for i, u in reversed(list(enumerate(values))) if u < middle]):
        q = begin
        for i in part:
            closed = loops.close(q, np.full(len(nodes), values[i]), independent.place)
            if closed is None:
                raise NoEmbeddingError("its loops do not close over its range")
            columns[i], q = closed, closed.q
    stacked = [np.stack([getattr(columns[i], name) for i in range(len(values))], axis=1) for name in ("q", "jacobian", "residual")]
    q, jacobian, residual = (x.reshape(-1, *x.shape[2:]) for x in stacked)
    return Poses(q=q, jacobian=jacobian, residual=residual)


def _guess(loops: BlockLoops, independent: Independent, chart: Chart, nodes: Array) -> Array:
    """Initial guesses of the poses at nodes, interpolated between those of the curve."""
    curve = independent.curve
    along = curve[:, chart.q]
    if independent.closes:  # continued by the revolutions before and after, for nodes beyond the ends of the curve
        turned = full_turns(curve)
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


def _coordinates(loops: BlockLoops, chart: Chart, poses: Poses, independent: int) -> tuple[Array, Array]:
    """The coordinates of series, scalars and then Rodrigues parameters, and their derivatives by the speed ``independent``, (n, k)."""
    derivatives, first = loops.derivatives(poses, independent), loops.speeds[chart.joint]
    places = [poses.q[:, chart.q : chart.q + chart.scalars]]
    rates = [derivatives[:, first : first + chart.scalars]]
    if chart.ball:
        e = poses.q[:, chart.q + chart.scalars : chart.q + chart.scalars + 4]
        if np.abs(e[:, 0]).min() < _LEAST:
            raise NoEmbeddingError(f"'{chart.joint}' rotates by more than its functions represent")
        g = e[:, 1:] / e[:, :1]
        w = derivatives[:, first + chart.scalars : first + chart.scalars + 3]
        places.append(g)
        rates.append((w - np.cross(g, w) + g * np.sum(g * w, axis=1, keepdims=True)) / 2)
    return np.concatenate(places, axis=1), np.concatenate(rates, axis=1)


def _series(
    places: Array, derivatives: Array, interval: Interval, u: Interval, independent: Independent, nodes: Array, wanted: Wanted
) -> Series:
    """A series through values and derivatives (nodes, nodes across)."""
    if independent.is_periodic:
        return _fourier_series(places, derivatives, nodes, wanted)
    whole = chebyshev_integral(derivatives, interval.half)
    set_constants(whole, places, (nodes - interval.middle) / interval.half)
    size = _length(whole, interval.half, wanted.tolerance)
    if size > wanted.terms:
        raise NoEmbeddingError(f"a function would need more than {wanted.terms} terms")
    return Series(coefficients=_rows(_across(whole[: size + wanted.spare], u, interval.half, wanted.tolerance)))


def _across(whole: Array, u: Interval, half: float, tolerance: float) -> Array:
    """Coefficients (n, m) by polynomials of u, from their values (n, nodes across)."""
    if whole.shape[1] == 1:
        return whole
    found = chebyshev_series(whole.T)
    size = _length(found, 1.0, tolerance)  # derivatives by the drive, relative to half of its range: it moves about as far in a second
    if size > MOST_ACROSS:
        raise NoEmbeddingError(f"a function would need more than {MOST_ACROSS} terms of the drive")
    return _trimmed(found[:size].T, half, tolerance)


def _trimmed(c: Array, half: float, tolerance: float) -> Array:
    """Coefficients (n, m), zero where their effect on value, first derivatives and a tenth of second derivatives is below the tolerance."""
    k, j = (np.arange(size, dtype=float) for size in c.shape)
    along = (np.ones_like(k), k**2 / half, k**2 * (k**2 - 1) / (3 * half**2))
    across = (np.ones_like(j), j**2, j**2 * (j**2 - 1) / 3)
    largest = np.max([0.1 ** max(p + q - 1, 0) * np.outer(along[p], across[q]) for p, q in _ORDERS], axis=0)
    left = np.cumsum((np.abs(c) * largest)[::-1], axis=0)[::-1]
    return np.where(left > tolerance / c.shape[1], c, 0.0)


def _length(c: Array, half: float, tolerance: float) -> int:
    """The least number of terms with value and derivative within the tolerance, and the second derivative within ten times that.
    The truncation error is bounded by the largest values 1, k^2 and k^2 (k^2 - 1)/3 of polynomial k and its derivatives. Coefficients at
    the level of rounding of the derivatives count as zero."""
    longest, k = 1, np.arange(len(c), dtype=float)
    rounding = 1e-15 * half * max(1.0, float(np.abs(chebyshev.chebder(c, scl=1 / half)).max(initial=0.0))) / np.maximum(k, 1.0)
    sizes = np.abs(c).max(axis=1)
    sizes[sizes <= rounding] = 0.0
    for order, share, largest in ((0, 1.0, np.ones(len(c))), (1, 1.0, k**2 / half), (2, 10.0, k**2 * (k**2 - 1) / (3 * half**2))):
        left = np.cumsum((sizes * largest)[::-1])[::-1]
        size = float(np.abs(chebyshev.chebder(c, order, scl=1 / half) if order else c).max(initial=0.0))
        small = left <= share * tolerance * max(1.0, size)
        longest = max(longest, int(np.argmax(small)) if small.any() else len(c))
    return longest


def _fourier_series(places: Array, derivatives: Array, nodes: Array, wanted: Wanted) -> Series:
    if derivatives.shape[1] > 1:
        raise NoEmbeddingError("it makes full turns and has a drive")
    growth = float(np.round(derivatives.mean())) + 0.0  # full turns; displacements return
    whole = fourier_integral(places, derivatives, nodes, growth)
    order = np.arange(1, len(nodes) // 2)
    amplitude = np.abs(whole[1::2]) + np.abs(whole[2::2])
    bent = (np.concatenate([[1.0], order**2])[:, np.newaxis] * np.concatenate([np.abs(whole[:1]), amplitude]))[:, 0]
    tail = np.cumsum(bent[::-1])[::-1]
    small = tail <= 10 * wanted.tolerance * max(1.0, float(bent[1:].max(initial=0.0)))
    harmonics = int(np.argmax(small)) if small.any() else len(small)
    if harmonics > wanted.harmonics:
        raise NoEmbeddingError("a function would need too many harmonics")
    return Series(coefficients=_rows(whole[: 2 * max(harmonics, 2) - 1 + 2 * wanted.spare]), growth=growth)


def _rows(c: Array) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(float(x) for x in row) for row in c)


def evaluate(series: Series, functions: LoopFunctions, q: Array, u: Array, order: int = 0) -> Array:
    """A series, or its derivative of that ``order`` by q, at coordinates (n,) and values of the drive (n,)."""
    c, growth = np.array(series.coefficients), series.growth * (q if order == 0 else float(order == 1))
    for _ in range(order):
        c = fourier_derivative(c) if functions.is_periodic else derivative(c, functions.range.half)
    x = (q - functions.range.middle) / functions.range.half
    basis = harmonics(q, len(c)) if functions.is_periodic else np.asarray(chebyshev.chebvander(x, len(c) - 1))
    across, drive = np.ones((len(q), 1)), functions.drive_range
    if drive is not None and drive.half > 0:
        across = np.asarray(chebyshev.chebvander((u - drive.middle) / drive.half, c.shape[1] - 1))
    return np.asarray(np.einsum("ni,ij,nj->n", basis, c, across) + growth)


def place(loops: BlockLoops, independent: str, functions: LoopFunctions, q: Array, u: Array) -> tuple[Array, Array]:
    """The tree's coordinates (n, coordinates) by the functions of a block, and the block's speeds (n, speeds) at q' = 1."""
    whole, rates = loops.design(len(q)), np.zeros((len(q), loops.size))
    for chart in loops.own:
        first = loops.speeds[chart.joint]
        if chart.joint == independent:
            whole[:, chart.q], rates[:, first] = q, 1.0
            continue
        values, derivatives = (
            np.stack([evaluate(s, functions, q, u, order) for s in functions.series[chart.joint]], axis=1) for order in range(2)
        )  # fmt: skip
        ball = chart.q + chart.scalars
        whole[:, chart.q : ball], rates[:, first : first + chart.scalars] = values[:, : chart.scalars], derivatives[:, : chart.scalars]
        if chart.ball:
            g, turned = values[:, chart.scalars :], derivatives[:, chart.scalars :]
            share = 1 / (1 + np.sum(g * g, axis=1, keepdims=True))
            whole[:, ball : ball + 4] = np.sqrt(share) * np.concatenate([np.ones((len(q), 1)), g], axis=1)
            rates[:, first + chart.scalars : first + chart.scalars + 3] = 2 * share * (turned + np.cross(g, turned))
    return whole, rates


def _violations(loops: BlockLoops, independent: Independent, functions: LoopFunctions, wanted: Wanted) -> tuple[float, float]:
    """The largest residual, and the largest rate of one at q' = 1, on a grid four times finer than the nodes."""
    nodes = wanted.nodes_around if functions.is_periodic else wanted.nodes
    q, u = np.linspace(functions.range.lower, functions.range.upper, 4 * nodes + 1), functions.drive_range
    across = np.zeros(1) if u is None else np.linspace(u.lower, u.upper, 4 * NODES_ACROSS + 1) if u.half > 0 else np.full(1, u.middle)
    qs, us = (x.ravel() for x in np.meshgrid(q, across, indexing="ij"))
    violation = violation_rate = 0.0
    for first in range(0, len(qs), 1024):
        part = slice(first, first + 1024)
        whole, rates = place(loops, independent.joint.name, functions, qs[part], us[part])
        residual, jacobian = loops.evaluate(whole, us[part])
        violation = max(violation, float(np.abs(residual).max(initial=0.0)))
        violation_rate = max(violation_rate, float(np.abs(np.einsum("nij,nj->ni", jacobian, rates)).max(initial=0.0)))
    return violation, violation_rate


def accuracy(loops: BlockLoops, independent: Independent, functions: LoopFunctions, u: Interval) -> tuple[float, float]:
    """Largest differences of first and second derivatives by q from those of closed loops, at random coordinates.
    Of speeds and accelerations at q' = 1 (1/s)."""
    random, key = np.random.default_rng(0), _NEIGHBOUR * functions.range.half
    q = functions.range.middle + (functions.range.half - key) * random.uniform(-1, 1, _RANDOM)
    values = u.middle + u.half * random.uniform(-1, 1, _RANDOM)
    derivatives = []
    for step in (-key, 0.0, key):
        whole, made = place(loops, independent.joint.name, functions, q + step, values)
        closed = loops.close(whole, values, independent.place)
        if closed is None:
            raise NoEmbeddingError("its loops do not close over its range")
        derivatives.append(made - loops.derivatives(closed, independent.place))
    return float(np.abs(derivatives[1]).max()), float(np.abs(derivatives[2] - derivatives[0]).max() / (2 * key))


def _largest_derivative(functions: LoopFunctions) -> float:
    """The largest derivative of a function over the range, or 1 if that is larger."""
    q = np.linspace(functions.range.lower, functions.range.upper, _SAMPLES)
    u = np.full(_SAMPLES, functions.drive_range.middle if functions.drive_range is not None else 0.0)
    derivatives = [evaluate(s, functions, q, u, 1) for found in functions.series.values() for s in found]
    return max([1.0, *(float(np.abs(derivative).max()) for derivative in derivatives)])


def refit(topology: Topology, embedded_loop: EmbeddedLoop, parameters: Mapping[str, float]) -> LoopFunctions:
    """The functions of a loop with tunable geometry for other ``parameters`` (SI units), as core/mechanism/loop_fits.hpp fits them.
    They are its own if the loops do not close over the range."""
    model, functions, moved = topology.model, embedded_loop.functions, embedded_loop.drive
    model = replace(model, parameters=tuple(replace(p, value=parameters.get(p.name, p.value)) for p in model.parameters))
    block = Block(carrier=embedded_loop.carrier, bodies=embedded_loop.bodies, joints=joints_of(model, embedded_loop), drives=())
    loops = BlockLoops(driven_by_time(without_embedded_loops(replace(topology, model=model)), moved), block)
    independent, interval = loops.speeds[embedded_loop.independent], functions.range
    nodes = _nodes(interval, functions.nodes, is_periodic=functions.is_periodic)
    u = np.full(len(nodes), functions.drive_range.middle if functions.drive_range is not None else 0.0)
    poses = loops.close(place(loops, embedded_loop.independent, functions, nodes, u)[0], u, independent)
    if poses is None:
        return functions
    series = {}
    for chart in loops.own:
        if chart.joint == embedded_loop.independent:
            continue
        found = []
        whole_values, whole_derivatives = _coordinates(loops, chart, poses, independent)
        for i, one in enumerate(functions.series[chart.joint]):
            values, derivatives = whole_values[:, i : i + 1], whole_derivatives[:, i : i + 1]
            if functions.is_periodic:
                whole = fourier_integral(values, derivatives, nodes, one.growth)
            else:
                whole = chebyshev_integral(derivatives, interval.half)
                set_constants(whole, values, (nodes - interval.middle) / interval.half)
            found.append(replace(one, coefficients=_rows(whole[: len(one.coefficients)])))
        series[chart.joint] = tuple(found)
    return replace(functions, series={joint: series[joint] for joint in functions.series})
