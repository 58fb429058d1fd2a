"""Mechanisms that points slightly off hold only just, and those that are meant to be rigid."""

from __future__ import annotations

import re

import pytest

from cutjoint.analysis.mobility import find_mobility
from cutjoint.analysis.shaky import ShakyError, describe_misfit
from cutjoint.analysis.skew import describe_geometry
from cutjoint.compile.derivation import schedule_method
from cutjoint.methods import METHODS
from cutjoint.model.read import read_model_text
from cutjoint.run.scenes import find_scene
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
        "barely rigid: at a speed of 1 of 'low.angle_rate' the rate of violation is 0.001 m/s or rad/s, most at 'high.y'; hinges"
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
    assert said(cranks.replace("at: [2, 0, 0]", "at: [2, 0.003, 0]")).startswith("barely rigid")


def test_a_mechanism_that_a_guide_drives_is_meant_to_have_no_freedom() -> None:
    """A crank and slider whose crank is guided, near its dead centre: the slider's speed hardly follows."""
    dead_centre, rail = PRESS.replace("A: [0, 0, 0.1]", "A: [0.1, 0, 0.0001]"), "at: B, axis: [1, 0, 0]"
    assert rail in dead_centre
    assert said(dead_centre.replace(rail, f"{rail}, guide: t")) == ""


@pytest.mark.parametrize("off", [1e-9, 1e-8, 1e-7, 1e-6, 1e-5])
def test_what_rounded_numbers_hold_is_refused_by_all_methods(off: float) -> None:
    """A pin slightly off neither locks three parallel cranks nor leaves them free, whatever method or length."""
    for at in (f"[2, {off}, 0]", f"[{2 + off!r}, 0, 0]"):
        text = parallel_cranks_text(3, (0.6, 0.8)).replace("at: [2, 0, 0]", f"at: {at}")
        for scale, methods in ((1.0, METHODS), (1e-4, ["recursive"]), (1e4, ["recursive"])):
            model = read_model_text(_scaled(text, scale), "cranks.yaml")
            for method in methods:
                with pytest.raises(ShakyError, match=r"cranks.yaml:\d+:\d+: '\w+': only rounded numbers lock this mechanism"):
                    schedule_method(model, find_scene(model, None), (), method=method)


@pytest.mark.parametrize("off", [0.0, 1e-12, 1e-3])
def test_what_moves_or_locks_is_not(off: float) -> None:
    assert describe_misfit(formulated(parallel_cranks_text(3, (0.6, 0.8)).replace("at: [2, 0, 0]", f"at: [2, {off}, 0]"))) == ""


def _scaled(text: str, scale: float) -> str:
    """The model with all points so much farther apart."""
    points = re.compile(r"(at|centre_of_mass): \[([^]]*)\]")
    return points.sub(lambda m: f"{m[1]}: [{', '.join(repr(scale * float(x)) for x in m[2].split(','))}]", text)
