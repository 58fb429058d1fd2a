"""Mechanisms that points slightly off hold only just, and those that are meant to be rigid."""

from __future__ import annotations

import pytest

from cutjoint.analysis.mobility import find_mobility
from cutjoint.analysis.skew import describe_geometry
from tests.analysis.formulated import formulated
from tests.conftest import MODELS
from tests.mechanisms.overconstrained import parallel_cranks_text

PRESS = (MODELS / "press.yaml").read_text(encoding="utf-8")
DOOR = """\
cutjoint: 1
name: door
gravity: [0, 0, -9.81]
bodies: {door: {mass: 10, centre_of_mass: [0.5, 0, 0.5], inertia: [1, 1, 1]}}
joints:
  low: {kind: revolute, bodies: [ground, door], at: [0, 0, 0], axis: [0, 0, 1]}
  high: {kind: revolute, bodies: [ground, door], at: [OFF, 0, 1], axis: [0, 0, 1]}
scenes: {swing: {end: 1}}
"""


def said(text: str) -> str:
    equations = formulated(text)
    return describe_geometry(equations, find_mobility(equations))


def test_hinges_that_are_nearly_on_one_line_are_named() -> None:
    """A door turned at 1 rad/s about one hinge moves the other by their distance across the axis."""
    assert said(DOOR.replace("OFF", "0.001")).startswith(
        "rigid only just: at a speed of 1 at 'low.angle_rate' the loops open by 0.001 m/s or rad/s, most at 'high.y'; hinges"
    )


def test_a_small_door_is_held_by_as_much_of_its_size() -> None:
    small = DOOR.replace("OFF, 0, 1]", "OFF, 0, 0.01]")
    assert said(small.replace("OFF", "0.001")) == ""
    assert "1e-05 m/s" in said(small.replace("OFF", "0.00001"))


@pytest.mark.parametrize("off", ["0", "0.1"])
def test_hinges_on_one_line_or_far_off_are_as_they_were_meant(off: str) -> None:
    assert said(DOOR.replace("OFF", off)) == ""


def test_a_crank_that_is_nearly_as_long_as_two_others() -> None:
    """Three equal cranks carry a coupler; one of another length holds it, by its difference."""
    cranks = parallel_cranks_text(3, (0.6, 0.8))
    assert said(cranks) == ""
    assert said(cranks.replace("at: [2, 0, 0]", "at: [2, 0.003, 0]")).startswith("rigid only just")


def test_a_mechanism_that_a_guide_drives_is_meant_to_have_no_freedom() -> None:
    """A crank and slider whose crank is guided, near its dead centre: the slider's speed hardly follows."""
    dead_centre, rail = PRESS.replace("A: [0, 0, 0.1]", "A: [0.1, 0, 0.0001]"), "at: B, axis: [1, 0, 0]"
    assert rail in dead_centre
    assert said(dead_centre.replace(rail, f"{rail}, guide: t")) == ""
