"""Surfaces of roads: heights on a grid, between them a surface with continuous slopes; rough ones by ISO 8608.

Between the places of the grid a surface is a product of cubics in Hermite's form, with central differences as slopes and one-sided ones at
the edges.  Beyond an edge its slope across the edge runs out over one cell, and its height stays from there on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import floor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cutjoint.model.records import HeightTable, Patch, Road, RoughSurface

#: The spectral density of heights at 0.1 cycles a metre, m^3: the geometric means of ISO 8608.
ROUGHNESS = {"A": 16e-6, "B": 64e-6, "C": 256e-6, "D": 1024e-6, "E": 4096e-6}
#: The band of a rough road, cycles a metre along it.
BAND = (0.011, 2.83)
#: The distance of places of a rough road, m, and their number along it, after which it repeats: 102.4 m.
STEP, LENGTH = 0.05, 2048
#: The fewest places of a wave in any direction.
_FINEST = 4
#: The number of waves, in as many directions, for each number of cycles along the road.
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

    def over(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
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
        """The places of an axis about one between them, and the weights of their heights."""
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
    """The shares of both ends' heights and of their slopes in a cubic, or in its derivative."""
    if order == 0:
        return (1 - t) ** 2 * (1 + 2 * t), t * t * (3 - 2 * t), t * (1 - t) ** 2, t * t * (t - 1)
    if order == 1:
        return 6 * t * (t - 1), 6 * t * (1 - t), (1 - t) * (1 - 3 * t), t * (3 * t - 2)
    return 12 * t - 6, 6 - 12 * t, 6 * t - 4, 6 * t - 2


@dataclass(frozen=True, kw_only=True)
class Surface:
    """A surface as all wheels meet it, as in runtime/include/cutjoint/core/surface.hpp: a field of heights, None for none, and patches of
    friction."""

    field: Field | None
    patches: Sequence[Patch]

    def described(self) -> dict[str, Any]:
        """The entry of a run file."""
        patches = [{"x": list(p.x), "y": list(p.y), "friction": p.friction, "edge": p.edge} for p in self.patches]
        return {"field": None if self.field is None else self.field.described(), "patches": patches}

    def height(self, x: float, y: float, by_x: int, by_y: int) -> float:
        """The height at a place, m, or its derivative of orders 0 to 2."""
        return 0.0 if self.field is None else self.field.derivative(x, y, by_x, by_y)

    def friction(self, x: float, y: float, by_x: int, by_y: int) -> float:
        """The factor of friction at a place, or its derivative of order 1 by x or y."""
        value, slope = 1.0, 0.0
        for patch in self.patches:
            share, its_slope = _share(patch, x, y, 0, 0), _share(patch, x, y, by_x, by_y)
            slope += its_slope * (patch.friction - value) - share * slope
            value += share * (patch.friction - value)
        return slope if by_x + by_y else value


def _share(patch: Patch, x: float, y: float, by_x: int, by_y: int) -> float:
    """The share of a patch at a place, or its derivative: it rises by a cubic over the width of its edge."""

    def rise(way: float, order: int) -> float:
        t = min(max(way / patch.edge + 0.5, 0.0), 1.0)
        return 6 * t * (1 - t) / patch.edge if order else t * t * (3 - 2 * t)

    places = ((patch.x, x, by_x), (patch.y, y, by_y))
    along, across = (rise(place - ends[0], order) - rise(place - ends[1], order) for ends, place, order in places)
    return along * across


@lru_cache(maxsize=4)
def surface_of(road: Road) -> Surface | None:
    """The surface of a scene's road, None where it has neither heights nor friction."""
    field: Field | None
    match road.surface:
        case HeightTable() as table:
            field = Field(start=table.start, step=table.step, heights=np.array(table.heights), bilinear=table.bilinear)
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
        for part, values in zip(parts, turned(places[:, None] * across[:, wave] + random[1, :, wave]), strict=True):
            part[:, first : first + cycles.size] += size * values
    heights = _transformed(parts[0], parts[1])[0]
    if level:
        along = np.minimum(np.arange(length), length - np.arange(length)) * step
        share = np.clip((along * along + places[:, None] * places[:, None] - level * level) / (15 * level * level), 0.0, 1.0)
        heights = heights * (share * share * (3 - 2 * share))
    return Field(start=(0.0, -half * step), step=(step, step), heights=heights.T, wraps=True)


def uniform(seed: int, count: int) -> NDArray[np.float64]:
    """The first numbers of SplitMix64 for a seed, in [0, 1), by 53 bits each."""
    return (split_mix(seed, count) >> np.uint64(11)).astype(np.float64) * 2.0**-53


def split_mix(seed: int, count: int) -> NDArray[np.uint64]:
    """The first words of SplitMix64 for a seed; each follows from seed and index alone."""
    z = np.uint64(seed) + np.arange(1, count + 1, dtype=np.uint64) * _WORD
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


def turned(turns: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Cosine and sine of angles in turns, to 1e-15, by sums and products alone."""
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
    cosine, sine = turned(np.arange(n // 2) / n)
    u, v = c * cosine - d * sine, c * sine + d * cosine
    return np.concatenate([a + u, a - u], axis=-1), np.concatenate([b + v, b - v], axis=-1)
