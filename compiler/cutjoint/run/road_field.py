"""Surfaces of roads: heights on a grid, between them a surface with continuous slopes; heights along a line; rough ones by ISO 8608.

Between the places of the grid a surface is a product of cubics in Hermite's form, with central differences as slopes and one-sided ones at
the edges.  Beyond an edge its slope across the edge runs out over one cell, and its height stays from there on.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import floor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cutjoint.model.files.opencrg import cross_sections
from cutjoint.model.records import CurvedGrid, HeightTable, Patch, Road, RoughSurface

#: Spectral density of heights at 0.1 cycles per metre, m^3: geometric means of the classes of ISO 8608.
ROUGHNESS = {"A": 16e-6, "B": 64e-6, "C": 256e-6, "D": 1024e-6, "E": 4096e-6}
#: Spatial frequencies of a rough road along its length, cycles per metre.
BAND = (0.011, 2.83)
#: Grid interval of a rough road, m, and the number of grid points along it, after which it repeats: 102.4 m.
STEP, LENGTH = 0.05, 2048
#: The smallest number of grid points per wavelength in any direction.
_FINEST = 4
#: The number of waves, each in its own direction, for each frequency along the road.
_DIRECTIONS = 32

_WORD = np.uint64(0x9E3779B97F4A7C15)


@dataclass(frozen=True, kw_only=True, eq=False)
class Field:
    """A surface through ``heights`` (along x, along y), m, the first at ``start`` (x, y), others at distances ``step``, m.

    It repeats along x if it ``wraps``, and is linear in x and y between its places if it is ``bilinear``.
    """

    start: tuple[float, float]
    step: tuple[float, float]
    heights: NDArray[np.float64]
    wraps: bool = False
    bilinear: bool = False

    def derivative(self, x: float, y: float, by_x: int = 0, by_y: int = 0) -> float:
        """The height at a place, m, or its derivative of orders 0 to 2 by x and y."""
        rows, along = self._weights(0, x, by_x)
        columns, across = self._weights(1, y, by_y)
        return float(along @ self.heights[np.ix_(rows, columns)] @ across)

    def heights_on_grid(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        """The heights (n, m) above places x (n,) and y (m,), m."""
        shares = []
        for axis, places in enumerate((x, y)):
            share = np.zeros((len(places), self.heights.shape[axis]))
            for row, place in zip(share, places, strict=True):
                at, weights = self._weights(axis, float(place), 0)
                np.add.at(row, at, weights)
            shares.append(share)
        return shares[0] @ self.heights @ shares[1].T

    def described(self) -> dict[str, Any]:
        """The entries of a run file."""
        return {
            "start": list(self.start), "step": list(self.step), "counts": list(self.heights.shape), "wraps": self.wraps,
            "bilinear": self.bilinear, "heights": self.heights.ravel().tolist(),
        }  # fmt: skip

    def _weights(self, axis: int, place: float, order: int) -> tuple[list[int], NDArray[np.float64]]:
        """The grid points of an axis that influence a point, and the weights of their heights."""
        count, step = self.heights.shape[axis], self.step[axis]
        wraps, u = self.wraps and axis == 0, (place - self.start[axis]) / step
        if not wraps and not -1 <= u <= count:
            if order:
                return [0] * 4, np.zeros(4)
            u = min(max(u, -1.0), float(count))
        k = floor(u)
        at = [i % count if wraps else min(max(i, 0), count - 1) for i in (k - 1, k, k + 1, k + 2)]
        weights = np.zeros(4)
        if self.bilinear:
            weights[1:3] = ((1 - (u - k), u - k), (-1.0, 1.0), (0.0, 0.0))[order]
            return at, weights / step**order
        first, second, begins, ends = _hermite(u - k, order)
        weights[1:3] = first, second
        for node, share in ((k, begins), (k + 1, ends)):
            low, high = (node - 1, node + 1) if wraps else (max(node - 1, 0), min(node + 1, count - 1))
            if wraps or 0 <= node < count:
                weights[high - k + 1] += share / (high - low)
                weights[low - k + 1] -= share / (high - low)
        return at, weights / step**order


def _hermite(t: float, order: int) -> Sequence[float]:
    """Weights of the heights and slopes at both ends of a cubic, or of its derivative."""
    if order == 0:
        return (1 - t) ** 2 * (1 + 2 * t), t * t * (3 - 2 * t), t * (1 - t) ** 2, t * t * (t - 1)
    if order == 1:
        return 6 * t * (t - 1), 6 * t * (1 - t), (1 - t) * (1 - 3 * t), t * (3 * t - 2)
    return 12 * t - 6, 6 - 12 * t, 6 * t - 4, 6 * t - 2


#: Cross sections per leaf of the search tree for the nearest one.
_IN_LEAF = 8
#: The largest number of drawn grid points along and across a curved road.
_DRAWN = 200
_Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class CurvedField:
    """A surface along a line, as in runtime core/roads/surface.hpp."""

    grid: CurvedGrid

    @cached_property
    def line(self) -> _Array:
        """For each cross section (n, 9): position, heading (cosine, sine), distance to the next, skew, height, banking.
        The skew is forward per metre to the left, and its change up to the next."""
        x, y, z, banking = np.array(self.grid.sections).T
        return np.column_stack([x, y, cross_sections(x, y), z, banking])

    @cached_property
    def _heights(self) -> _Array:
        return np.array(self.grid.heights)

    def derivative(self, x: float, y: float, by_x: int = 0, by_y: int = 0) -> float:
        """The height at a place, m, or its derivative of orders 0 to 2, both together, by x and y."""
        return float(self.at(np.array([x]), np.array([y]), by_x, by_y)[0])

    def heights_on_grid(self, x: _Array, y: _Array) -> _Array:
        """The heights (n, m) above places x (n,) and y (m,), m."""
        along, across = np.meshgrid(x, y, indexing="ij")
        return self.at(along.ravel(), across.ravel()).reshape(len(x), len(y))

    def at(self, x: _Array, y: _Array, by_x: int = 0, by_y: int = 0) -> _Array:
        """The heights (n,) at points, m, or their derivatives."""
        begin, along, beside, c, s, length, lean, spread = self._located(x, y)
        way = 1 / (length + spread * beside)
        t = (along - lean * beside) * way
        turn = -(lean + spread * t) * way
        value, u, v, uv, uu = self._grid_derivatives(begin + t, beside)
        if not by_x + by_y:
            return value
        first = u * way, v + u * turn
        if by_x + by_y == 1:
            return c * first[0] - s * first[1] if by_x else s * first[0] + c * first[1]
        mixed = (uv + uu * turn) * way - u * spread * way**2
        twice = uu * way**2, 2 * uv * turn + uu * turn**2 - 2 * u * spread * turn * way
        a, b = {2: ((c, -s), (c, -s)), 1: ((c, -s), (s, c)), 0: ((s, c), (s, c))}[by_x]
        return a[0] * b[0] * twice[0] + (a[0] * b[1] + a[1] * b[0]) * mixed + a[1] * b[1] * twice[1]

    def described(self) -> dict[str, Any]:
        """The entries of a run file."""
        grid = self.grid
        return {
            "sections": self.line.ravel().tolist(), "across": list(grid.across), "heights": self._heights.ravel().tolist(),
            "step": grid.step, "boxes": self._boxes().ravel().tolist(), "borders": list(grid.borders), "offsets": list(grid.offsets),
            "smooth": list(grid.smooth), "closed": list(grid.closed),
        }  # fmt: skip

    def drawn(self) -> Field:
        """The heights around the line on a uniform grid along x and y."""
        ends = [(a.min(), a.max()) for a in self.line[:, :2].T]
        reach = max(map(abs, self.grid.across))
        places = [np.linspace(a - reach, b + reach, min(_DRAWN, 2 + int(4 * (b - a + 2 * reach)))) for a, b in ends]
        (x, y), heights = places, self.heights_on_grid(*places)
        return Field(start=(float(x[0]), float(y[0])), step=(float(x[1] - x[0]), float(y[1] - y[0])), heights=heights, bilinear=True)

    def _boxes(self) -> _Array:
        """A tree of boxes about cross sections, each from and to x and y, the root first."""
        leaves = 1
        while leaves * _IN_LEAF < len(self.line):
            leaves *= 2
        far = np.finfo(float).max ** 0.25
        boxes = np.tile([far, -far, far, -far], (2 * leaves - 1, 1))
        for leaf in range(-(-len(self.line) // _IN_LEAF)):
            x, y = self.line[leaf * _IN_LEAF : (leaf + 1) * _IN_LEAF, :2].T
            boxes[leaves - 1 + leaf] = x.min(), x.max(), y.min(), y.max()
        for node in range(leaves - 1, 0, -1):
            pair = boxes[2 * node - 1 : 2 * node + 1]
            boxes[node - 1] = pair[:, 0].min(), pair[:, 1].max(), pair[:, 2].min(), pair[:, 3].max()
        return boxes

    def _located(self, x: _Array, y: _Array) -> tuple[_Array, ...]:
        """For each point, the segment of the line by its starting station, and the local coordinates.
        Also the axes' cosine and sine, and the segment's length, skew and its change."""
        line, last = self.line, len(self.line) - 1
        nearest = np.empty(len(x), dtype=int)
        for i in range(0, len(x), 512):
            nearest[i : i + 512] = np.argmin((x[i : i + 512, None] - line[:, 0]) ** 2 + (y[i : i + 512, None] - line[:, 1]) ** 2, axis=1)
        k = np.clip(nearest - 1, 0, last - 1)
        sides = {1: self._side_of_piece(k, x, y) > 0, -1: self._side_of_piece(k, x, y) < 0}
        for way, moves in sides.items():
            moving = moves.copy()
            while (moving := moving & (way * self._side_of_piece(k, x, y) > 0) & (k + way >= 0) & (k + way < last)).any():
                k[moving] += way
        past = self._side_of_piece(k, x, y)
        end, begin, length = np.where(past < 0, 0, last), self.grid.closed[0], self.grid.closed[1]
        straight = (past < 0) & (k == 0) | (past > 0) & (k == last - 1)  # elsewhere it is rounding at a cross section
        if length:
            u = end + self._line_coordinates(end, x, y)[0] / self.grid.step
            end = np.where((past < 0) & (u < begin) | (past > 0) & (u > begin + length), last - end, end)
        k = np.where(straight, end, k)
        lean = np.where(straight[:, None], (self.grid.step, 0.0, 0.0), line[k, 4:7]).T
        return (k.astype(float), *self._line_coordinates(k, x, y), line[k, 2], line[k, 3], *lean)

    def _line_coordinates(self, k: NDArray[np.int_], x: _Array, y: _Array) -> tuple[_Array, _Array]:
        dx, dy, c, s = x - self.line[k, 0], y - self.line[k, 1], self.line[k, 2], self.line[k, 3]
        return dx * c + dy * s, dy * c - dx * s

    def _side_of_piece(self, k: NDArray[np.int_], x: _Array, y: _Array) -> _Array:
        """1 for points ahead of a segment of the line, -1 for points behind it, else 0."""
        (along, beside), (length, lean, spread) = self._line_coordinates(k, x, y), self.line[k, 4:7].T
        return np.where(along > length + (lean + spread) * beside, 1.0, np.where(along < lean * beside, -1.0, 0.0))

    def _grid_derivatives(self, u: _Array, v: _Array) -> tuple[_Array, ...]:
        """The heights at stations along the line and distances across it, with their derivatives."""
        grid, across, last = self.grid, np.array(self.grid.across), len(self.line) - 1
        if grid.closed[1]:
            u = np.mod(u - grid.closed[0], grid.closed[1]) + grid.closed[0]
        u, turn_u = _bordered(u, last, grid.borders[0])
        v, turn_v = _bordered(v - across[0], across[-1] - across[0], grid.borders[1])
        v = v + across[0]
        off = ((u < 0) | (u > last), (v < across[0]) | (v > across[-1]))
        k = np.clip(np.floor(u), 0, last - 1).astype(int)
        j = np.clip(np.searchsorted(across, v, side="right") - 1, 0, len(across) - 2)
        t, w = np.clip(u - k, 0, 1), np.clip(v, across[0], across[-1])
        low, high = (self._heights[k, j + i] + self.line[k, 7] + w * self.line[k, 8] for i in (0, 1))
        low_next, high_next = (self._heights[k + 1, j + i] + self.line[k + 1, 7] + w * self.line[k + 1, 8] for i in (0, 1))
        share, gap = (w - across[j]) / (across[j + 1] - across[j]), across[j + 1] - across[j]
        here, there = low + share * (high - low), low_next + share * (high_next - low_next)
        slopes = (high - low) / gap + self.line[k, 8], (high_next - low_next) / gap + self.line[k + 1, 8]
        parts = [here + t * (there - here), there - here, slopes[0] + t * (slopes[1] - slopes[0]), slopes[1] - slopes[0], np.zeros(len(u))]
        for axis, gone in enumerate(off):
            for order in (1 + axis, 3):
                parts[order] = np.where(gone, 0.0, parts[order])
        for gone, mode, offset in zip(off, grid.borders, grid.offsets, strict=True):
            if mode == 1:
                parts = [np.where(gone, offset if order == 0 else 0.0, part) for order, part in enumerate(parts)]
            parts[0] = parts[0] + np.where(gone & (mode == 2), offset, 0.0)
        for reach, way, level, sign in zip(grid.smooth, (u, last - u), self.line[[0, -1], 7], (1, -1), strict=True):
            if reach:
                parts = _faded(parts, way * grid.step / reach, level, sign * grid.step / reach)
        return parts[0], turn_u * parts[1], turn_v * parts[2], turn_u * turn_v * parts[3], parts[4]


def _bordered(places: _Array, length: float, mode: int) -> tuple[_Array, _Array]:
    """Places that are repeated or reflected, and -1 for those that run backwards, else 1."""
    outside = (places < 0) | (places > length)
    if mode < 3:
        return places, np.ones(len(places))
    if mode == 3:
        return np.where(outside, np.mod(places, length), places), np.ones(len(places))
    into = np.where(outside, np.mod(places, 2 * length), places)
    return np.where(into > length, 2 * length - into, into), np.where(into > length, -1.0, 1.0)


def _faded(parts: list[_Array], share: _Array, level: float, slope: float) -> list[_Array]:
    """Heights and derivatives, blended into a constant level where the share of a distance becomes zero."""
    near, w = share < 1, np.maximum(share, 0.0)
    rises, above = slope * (share > 0), parts[0] - level
    _, u, v, uv, uu = parts
    faded = level + w * above, w * u + rises * above, w * v, w * uv + rises * v, w * uu + 2 * rises * u
    return [np.where(near, new, old) for new, old in zip(faded, parts, strict=True)]


@dataclass(frozen=True, kw_only=True)
class Surface:
    """A surface of a road, as in runtime core/roads/surface.hpp: a field of heights, or None, and patches of friction."""

    field: Field | CurvedField | None
    patches: Sequence[Patch]

    def described(self) -> dict[str, Any]:
        """The entry of a run file."""
        patches = [{"x": list(p.x), "y": list(p.y), "friction": p.friction, "edge": p.edge} for p in self.patches]
        return {"field": None if self.field is None else self.field.described(), "patches": patches}

    def height(self, x: float, y: float, by_x: int, by_y: int) -> float:
        """The height at a point, m, or its derivative of orders 0 to 2."""
        return 0.0 if self.field is None else self.field.derivative(x, y, by_x, by_y)

    def friction(self, x: float, y: float, by_x: int, by_y: int) -> float:
        """The friction factor at a point, or its first derivative by x or y."""
        value, slope = 1.0, 0.0
        for patch in self.patches:
            share, its_slope = _share(patch, x, y, 0, 0), _share(patch, x, y, by_x, by_y)
            slope += its_slope * (patch.friction - value) - share * slope
            value += share * (patch.friction - value)
        return slope if by_x + by_y else value


def _share(patch: Patch, x: float, y: float, by_x: int, by_y: int) -> float:
    """The weight of a patch at a point, or its derivative; it rises by a cubic over the width of the edge."""

    def rise(way: float, order: int) -> float:
        t = min(max(way / patch.edge + 0.5, 0.0), 1.0)
        return 6 * t * (1 - t) / patch.edge if order else t * t * (3 - 2 * t)

    places = ((patch.x, x, by_x), (patch.y, y, by_y))
    along, across = (rise(place - ends[0], order) - rise(place - ends[1], order) for ends, place, order in places)
    return along * across


@lru_cache(maxsize=4)
def surface_of(road: Road) -> Surface | None:
    """The surface of a scene's road; None if it has neither heights nor friction patches."""
    field: Field | CurvedField | None
    match road.surface:
        case HeightTable() as table:
            field = Field(start=table.start, step=table.step, heights=np.array(table.heights), bilinear=table.bilinear)
        case CurvedGrid() as grid:
            field = CurvedField(grid=grid)
        case RoughSurface() as rough:
            field = rough_field(ROUGHNESS[rough.grade], rough.seed, rough.width)
        case None:
            field = None
    return Surface(field=field, patches=road.patches) if road.parts else None


def rough_field(
    roughness: float, seed: int, width: float, *, band: tuple[float, float] = BAND, step: float = STEP, length: int = LENGTH,
    level: float = 0.0,
) -> Field:  # fmt: skip
    """A rough surface that is ``width`` (m) across and about y = 0, with a ``roughness`` in m^3.

    It is a sum of plane waves of an isotropic surface whose density along x is ``roughness`` (n / 0.1)^-2 in a ``band`` of cycles a metre.
    Places are ``step`` (m) apart, ``length`` of them, a power of two, along x.  Directions and phases are SplitMix64's numbers of the seed.
    Within a distance ``level`` (m) of the origin it is level, and has its heights from four times that on.
    Only sums, products, quotients and roots of floats make it: all machines have the same bits, and so have pages
    (`templates/view/page/ground.js`).
    """
    cycles, finest = np.arange(1, length // 2) / (length * step), 1 / (_FINEST * step)
    cycles = cycles[(cycles >= band[0]) & (cycles <= band[1])]
    random = uniform(seed, 2 * cycles.size * _DIRECTIONS).reshape(2, cycles.size, _DIRECTIONS)
    largest = np.sqrt(1 - (cycles / finest) * (cycles / finest))[:, None]
    sine = largest * (2 * (np.arange(_DIRECTIONS) + random[0]) / _DIRECTIONS - 1)
    across = cycles[:, None] * sine / np.sqrt(1 - sine * sine)
    size = np.sqrt(2 * roughness * (0.1 / cycles) * (0.1 / cycles) / (length * step) / _DIRECTIONS)
    half = int(np.ceil(width / 2 / step))
    places = np.arange(-half, half + 1) * step
    parts = np.zeros((2, places.size, length))
    first = round(float(cycles[0]) * length * step)
    for wave in range(_DIRECTIONS):
        for part, values in zip(parts, cos_sin_of_turns(places[:, None] * across[:, wave] + random[1, :, wave]), strict=True):
            part[:, first : first + cycles.size] += size * values
    heights = _transformed(parts[0], parts[1])[0]
    if level:
        along = np.minimum(np.arange(length), length - np.arange(length)) * step
        share = np.clip((along * along + places[:, None] * places[:, None] - level * level) / (15 * level * level), 0.0, 1.0)
        heights = heights * (share * share * (3 - 2 * share))
    return Field(start=(0.0, -half * step), step=(step, step), heights=heights.T, wraps=True)


def uniform(seed: int, count: int) -> NDArray[np.float64]:
    """The first numbers of SplitMix64 for a seed, in [0, 1), with 53 bits each."""
    return (split_mix(seed, count) >> np.uint64(11)).astype(np.float64) * 2.0**-53


def split_mix(seed: int, count: int) -> NDArray[np.uint64]:
    """The first words of SplitMix64 for a seed; each follows from seed and index alone."""
    z = np.uint64(seed) + np.arange(1, count + 1, dtype=np.uint64) * _WORD
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


def cos_sin_of_turns(turns: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Cosine and sine of angles in revolutions, to 1e-15, by sums and products alone."""
    quarter = np.floor(4 * turns + 0.5)
    r = (turns - quarter / 4) * (2 * np.pi)
    cosine, sine = np.zeros_like(r), np.zeros_like(r)
    for k in range(8, -1, -1):
        cosine = 1 - r * r / ((2 * k + 1) * (2 * k + 2)) * cosine if k < 8 else np.ones_like(r)
        sine = 1 - r * r / ((2 * k + 2) * (2 * k + 3)) * sine if k < 8 else np.ones_like(r)
    sine, turn = r * sine, quarter % 4
    cosines, sines = (cosine, -sine, -cosine, sine), (sine, cosine, -sine, -cosine)
    cases = [turn == k for k in range(4)]
    return np.select(cases, cosines), np.select(cases, sines)


def _transformed(real: NDArray[np.float64], imaginary: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The sums over k of c_k e^(2 pi i k j / n) along the last axis, n a power of two."""
    n = real.shape[-1]
    if n == 1:
        return real, imaginary
    (a, b), (c, d) = (_transformed(real[..., i::2], imaginary[..., i::2]) for i in (0, 1))
    cosine, sine = cos_sin_of_turns(np.arange(n // 2) / n)
    u, v = c * cosine - d * sine, c * sine + d * cosine
    return np.concatenate([a + u, a - u], axis=-1), np.concatenate([b + v, b - v], axis=-1)
