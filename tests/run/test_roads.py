"""The disc's envelope against its definition, the profile against its shape."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence

import numpy as np
import pytest

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.compile.pipeline import compile_scene
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import RoadSegment, SegmentKind, Span
from cutjoint.run.roads import Piece, WheelRoad, disc_pieces, profile_pieces
from cutjoint.run.simulation import simulate
from tests.conftest import MODELS, needs_cpp

RADIUS = 0.364325


def height(pieces: Sequence[Piece]) -> Callable[[float], float]:
    starts = [p.start for p in pieces]
    return lambda x: pieces[max(bisect_right(starts, x) - 1, 0)].height(x)


def test_profile_of_simul1_goes_up_the_ramp_and_down_five_steps() -> None:
    road = read_model(MODELS / "iltis.yaml").scenes["simul1"].road
    z = height(profile_pieces(road.left, road.start))
    assert [z(x) for x in (0, 8, 13, 18, 19.9, 20.1, 21.6, 23.1, 24.6, 26.1, 40)] == pytest.approx(
        [0, 0, 0.625, 1.25, 1.25, 1.0, 0.75, 0.5, 0.25, 0.0, 0.0], abs=1e-12
    )


def segment(kind: SegmentKind, length: float, rise: float) -> RoadSegment:
    return RoadSegment(kind=kind, length=length, rise=rise, span=Span(file="road", line=1, column=1))


def random_road(seed: int) -> list[RoadSegment]:
    rng = np.random.default_rng(seed)
    choice = (SegmentKind.FLAT, SegmentKind.RAMP, SegmentKind.STEP)
    kinds = [choice[i] for i in rng.integers(3, size=9)]
    return [
        segment(k, 0.0 if k is SegmentKind.STEP else rng.uniform(0.1, 1.2), 0.0 if k is SegmentKind.FLAT else rng.uniform(-0.2, 0.2))
        for k in kinds
    ]


@pytest.mark.parametrize("seed", range(6))
def test_disc_envelope_is_the_largest_height_under_the_disc(seed: int) -> None:
    """h_env(x) = max over |u| <= R of h(x + u) + sqrt(R^2 - u^2) - R, the maximum found by sampling the profile and its corners."""
    segments, start = random_road(seed), 1.0
    z, envelope = height(profile_pieces(segments, start)), height(disc_pieces(segments, start, RADIUS))
    corners = [start]
    for s in segments:
        corners.append(corners[-1] + s.length)
    ends = [c + side for c in corners for side in (-1e-9, 1e-9)]
    for x in np.linspace(0.0, corners[-1] + 1.0, 60):
        under = [u for u in (*np.linspace(-RADIUS, RADIUS, 4001), *(c - x for c in ends)) if abs(u) <= RADIUS]
        expected = max(z(x + u) + math.sqrt(RADIUS**2 - u * u) - RADIUS for u in under)
        # sampling finds the maximum of a smooth arc from below, to second order of the spacing; 1e-9 beside a step adds 1e-9 of slope
        assert envelope(x) == pytest.approx(expected, abs=2e-7)


def test_disc_rolls_over_a_bump_wider_than_itself_at_its_offset_curve() -> None:
    bump = [segment(SegmentKind.COSINE, 5.0, 0.1)]
    envelope = height(disc_pieces(bump, 0.0, RADIUS))
    assert envelope(2.5) == pytest.approx(0.2, abs=1e-5)  # on the top, where the slope is zero
    assert envelope(-1.0) == 0.0


@pytest.mark.parametrize("contact", ["point", "disc"])
def test_slopes_are_those_of_the_heights(contact: str) -> None:
    """By central differences, away from where pieces meet."""
    segments = [segment(SegmentKind.RAMP, 2.0, 0.3), segment(SegmentKind.COSINE, 3.0, 0.2), segment(SegmentKind.STEP, 0.0, -0.1)]
    hills = profile_pieces(segments, 1.0) if contact == "point" else disc_pieces(segments, 1.0, RADIUS)
    flat = [Piece(kind="line", start=0.0, a=0.0, b=0.0, c=0.0)]
    road = WheelRoad(left=hills, right=flat, disc=contact == "disc")
    h, starts = 1e-5, np.array([p.start for p in hills])
    places = [x for x in np.linspace(0.5, 7.5, 211) if np.abs(starts - x).min() > 2 * h]
    assert len(places) > 150
    for x in places:
        across = [road.height(x + h, 1.0), road.height(x, 1.0), road.height(x - h, 1.0)]
        assert road.height_dx(x, 1.0) == pytest.approx((across[0] - across[2]) / (2 * h), abs=1e-6)
        assert road.slope(x, 1.0) == (0.0 if contact == "disc" else road.height_dx(x, 1.0))
        change = (road.height_dx(x + h, 1.0) - road.height_dx(x - h, 1.0)) / (2 * h)
        assert road.slope_dx(x, 1.0) == pytest.approx(0.0 if contact == "disc" else change, abs=1e-4)
        assert (road.height(x, -1.0), road.slope(x, -1.0), road.slope_dx(x, -1.0)) == (0.0, 0.0, 0.0)


@needs_cpp
def test_a_wheel_that_only_rises_feels_its_road() -> None:
    """Its place on the road is a number in the file, and the road's height there is none: the hub falls on the slope and stays at rest."""
    text = """
cutjoint: 1
name: quarter
gravity: [0, 0, -10]
bodies: {hub: {mass: 20, centre_of_mass: [1, 0, 0.4], inertia: [1, 1, 1]}}
joints: {rise: {kind: prismatic, bodies: [ground, hub], at: [1, 0, 0.4], axis: [0, 0, 1], spring: {stiffness: 0, damping: 2000}}}
forces:
  tyre:
    {kind: tyre, body: hub, centre: [1, 0, 0.4], axis: [0, 1, 0], radius: 0.3, stiffness: 2.0e+4,
     calspan: {A0: 2625, A1: 14.47, A2: 12930, A3: 2.29, A4: 18175, B1: -4.64e-5, B3: 1.216, B4: 2.18e-11, SN: 1.0274, AF1: -1.71e-5,
               AF2: 1.71e-5}}
outputs: [hub.z]
scenes: {rest: {end: 2, output_step: 1, road: {profile: [{flat: 0.5}, {step: 0.1}, {flat: 2}]}, numerics: {dt: 0.01}}}
"""
    model = read_model_text(text, "quarter.yaml")
    for how in (compile_scene, compile_interpreted):
        run = simulate(how(model, model.scenes["rest"]), error=False)
        assert run["hub.z"][-1] == pytest.approx(0.1 + 0.3 - 200 / 2.0e4, abs=1e-6)
