"""Surfaces of roads against closed forms, differences and the densities that they are made for."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import kv

from cutjoint.run.road_field import LENGTH, ROUGHNESS, STEP, Field, cos_sin_of_turns, rough_field, split_mix, uniform

X, Y = np.linspace(-1.0, 2.0, 13), np.linspace(-0.9, 1.5, 9)
INSIDE = [(float(x), float(y)) for x in np.linspace(-0.95, 1.95, 7) for y in np.linspace(-0.85, 1.45, 6)]


def field(heights: np.ndarray, **more: bool) -> Field:
    return Field(start=(X[0], Y[0]), step=(X[1] - X[0], Y[1] - Y[0]), heights=heights, **more)


@pytest.mark.parametrize("bilinear", [False, True])
def test_a_plane_is_itself_up_to_its_edges(bilinear: bool) -> None:
    plane = field(0.2 + 0.3 * X[:, None] - 0.1 * Y, bilinear=bilinear)
    for x, y in INSIDE:
        assert plane.derivative(x, y) == pytest.approx(0.2 + 0.3 * x - 0.1 * y, abs=1e-14)
        assert (plane.derivative(x, y, 1), plane.derivative(x, y, 0, 1)) == pytest.approx((0.3, -0.1), abs=1e-13)


def test_a_paraboloid_is_itself_within_its_outermost_cells() -> None:
    bowl = field(X[:, None] ** 2 - 0.5 * Y**2 + X[:, None] * Y)
    for x, y in ((x, y) for x, y in INSIDE if X[1] <= x <= X[-2] and Y[1] <= y <= Y[-2]):
        assert bowl.derivative(x, y) == pytest.approx(x * x - 0.5 * y * y + x * y, abs=1e-13)
        assert (bowl.derivative(x, y, 1), bowl.derivative(x, y, 0, 1)) == pytest.approx((2 * x + y, x - y), abs=1e-12)
        assert [bowl.derivative(x, y, *by) for by in ((2, 0), (1, 1), (0, 2))] == pytest.approx([2, 1, -1], abs=1e-11)


@pytest.mark.parametrize("wraps", [False, True])
def test_slopes_are_those_of_the_heights_and_continuous(wraps: bool) -> None:
    hills, h = field(np.random.default_rng(3).normal(size=(13, 9)), wraps=wraps), 1e-6
    for x, y in np.random.default_rng(4).uniform(-3, 4, size=(200, 2)):
        for i, j in ((0, 0), (1, 0), (0, 1)):
            by_x = (hills.derivative(x + h, y, i, j) - hills.derivative(x - h, y, i, j)) / (2 * h)
            by_y = (hills.derivative(x, y + h, i, j) - hills.derivative(x, y - h, i, j)) / (2 * h)
            assert (hills.derivative(x, y, i + 1, j), hills.derivative(x, y, i, j + 1)) == pytest.approx((by_x, by_y), abs=1e-6)
    for x in (*X, X[0] - 0.25, X[-1] + 0.25):  # grid lines, and the ends of the cells beyond the edges
        for by in ((0, 0), (1, 0), (0, 1)):
            assert hills.derivative(x - 1e-9, 0.1, *by) == pytest.approx(hills.derivative(x + 1e-9, 0.1, *by), abs=1e-6)


@pytest.mark.parametrize("wraps", [False, True])
def test_heights_over_a_grid_are_those_of_places(wraps: bool) -> None:
    hills = field(np.random.default_rng(3).normal(size=(13, 9)), wraps=wraps)
    x, y = np.linspace(-3, 4, 7), np.linspace(-2, 3, 5)
    assert hills.heights_on_grid(x, y) == pytest.approx(np.array([[hills.derivative(a, b) for b in y] for a in x]), abs=1e-14)


def test_the_height_stays_beyond_the_edge() -> None:
    hills = field(np.random.default_rng(3).normal(size=(13, 9)))
    assert hills.derivative(50.0, Y[2]) == pytest.approx(hills.heights[-1, 2], abs=1e-14)
    assert (hills.derivative(50.0, Y[2], 1), hills.derivative(-50.0, 90.0)) == pytest.approx((0.0, hills.heights[0, -1]), abs=1e-14)


def test_words_are_those_of_splitmix64() -> None:
    """The published words for the seed 1234567."""
    assert split_mix(1234567, 3).tolist() == [6457827717110365317, 3203168211198807973, 9817491932198370423]


def test_cosine_and_sine_are_those_of_numpy() -> None:
    turns = np.linspace(-3, 3, 10_001)
    for own, other in zip(cos_sin_of_turns(turns), (np.cos(2 * np.pi * turns), np.sin(2 * np.pi * turns)), strict=True):
        assert np.abs(own - other).max() < 5e-15  # NumPy's angle of three turns is rounded by 4e-15


def test_a_rough_road_is_its_sum_of_plane_waves() -> None:
    """Waves of n cycles a metre along x share G (n/0.1)^-2 alike, and the sines of their directions are even; phases are the seed's."""
    seed, width, waves = 9, 1.0, 32
    surface, n = rough_field(ROUGHNESS["B"], seed, width), np.arange(2, 290) / (LENGTH * STEP)
    directions, phases = uniform(seed, 2 * n.size * waves).reshape(2, n.size, waves)
    sine = np.sqrt(1 - (n / 5) ** 2)[:, None] * (2 * (np.arange(waves) + directions) / waves - 1)
    across = n[:, None] * np.tan(np.arcsin(sine))
    amplitude = np.sqrt(2 * ROUGHNESS["B"] * (n / 0.1) ** -2 / (LENGTH * STEP) / waves)[:, None]
    for i, j in ((0, 0), (5, 20), (1111, 3), (2047, 13)):
        x, y = surface.start[0] + i * STEP, surface.start[1] + j * STEP
        asked = np.sum(amplitude * np.cos(2 * np.pi * (n[:, None] * x + across * y + phases)))
        assert surface.heights[i, j] == pytest.approx(asked, abs=1e-12)


@pytest.mark.heavy
def test_both_tracks_of_rough_roads_have_the_density_of_their_class_and_its_coherence() -> None:
    """Means over 100 seeds; of the coherence of tracks that are d apart the closed form is 2 pi n d K1(2 pi n d)."""
    d, tracks = 1.5, []
    for seed in range(100):
        surface = rough_field(ROUGHNESS["C"], seed, d)
        tracks.append(np.fft.rfft(surface.heights[:, [0, -1]], axis=0))
    left, right = np.moveaxis(np.array(tracks), -1, 0) / LENGTH
    n = np.arange(left.shape[1]) / (LENGTH * STEP)
    bands = [(0.02, 0.06), (0.06, 0.2), (0.2, 0.7), (0.7, 2.8)]
    for low, high in bands:
        at = (n >= low) & (n <= high)
        asked = ROUGHNESS["C"] * (n[at] / 0.1) ** -2
        for track in (left, right):
            found = 2 * (np.abs(track[:, at]) ** 2).mean(axis=0) * LENGTH * STEP
            assert abs(10 * np.log10((found / asked).mean())) < 1
        across = 2 * (left[:, at] * right[:, at].conj()).real.mean(axis=0) * LENGTH * STEP
        x = 2 * np.pi * n[at] * d
        assert (across / asked).mean() == pytest.approx((x * kv(1, x)).mean(), abs=0.1)
    assert np.abs(left[:, n > 2.84]).max() < 1e-12
