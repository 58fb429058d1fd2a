"""Starts: what is given, what follows, and what cannot be."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.conftest import MODELS
from tests.mechanisms.four_bar import four_bar_text
from tests.physics.simulation import compile_text, completed, simulate

PENDULUM = """
cutjoint: 1
name: pendulum
gravity: [0, 0, -9.81]
bodies:
  bob: {mass: 1, centre_of_mass: [0, 0, -1], inertia: [0.1, 0.1, 0.1]}
joints:
  pin: {kind: revolute, bodies: [ground, bob], at: [0, 0, 0], axis: [0, 1, 0]}
forces:
  spring: {kind: point_spring, bodies: [ground, bob], from: [0, 0, 1], to: [0, 0, -1], law: "LAW"}
outputs: [pin.angle]
scenes:
  rest: {end: 0.01}
"""


def test_speeds_that_nobody_gave_are_named(tmp_path: Path) -> None:
    """One crank's rate determines the four-bar; without it one degree of freedom is left."""
    given = completed(simulate(compile_text(tmp_path, four_bar_text(2)), end=0.01))
    assert given.undetermined == ()
    text = four_bar_text(2)
    free = completed(simulate(compile_text(tmp_path, text[: text.index("    rates:")] + text[text.index("    numerics:") :]), end=0.01))
    assert len(free.undetermined) == 1
    assert free.undetermined[0].endswith(".pin.angle_rate")
    assert free["crank_0.pin.angle_rate"][0] == 0.0


def test_the_iltis_has_nine_speeds_besides_the_one_that_its_scene_gives(tmp_path: Path) -> None:
    run = completed(simulate(compile_text(tmp_path, (MODELS / "iltis.yaml").read_text(), "simul1"), end=0.0075))
    assert len(run.undetermined) == 9
    assert "chassis_free.vx" not in run.undetermined


def test_contradictory_speeds_end_with_the_equation_that_they_break(tmp_path: Path) -> None:
    text = four_bar_text(2).replace("crank_1.pin.angle_rate: -1", "crank_1.pin.angle_rate: -2")
    run = simulate(compile_text(tmp_path, text), end=0.01, check=False)
    assert run.failure is not None
    assert run.failure.message == "the given speeds contradict the loops"
    assert run.failure.element in ("closure_1.x", "closure_1.y", "closure_2.x", "closure_2.y")
    assert run.failure.residual > 0.1


def test_a_loop_that_cannot_close_says_by_how_much_and_where(tmp_path: Path) -> None:
    text = four_bar_text(1).replace("    rates:", "    positions: {crank_0.pin.angle: 1.5, crank_1.pin.angle: -1.5}\n    rates:")
    run = simulate(compile_text(tmp_path, text), end=0.01, check=False)
    assert run.failure is not None
    assert run.failure.message == "the loop cannot close from the given coordinates"
    assert run.failure.element.startswith("closure_1.")
    assert run.failure.residual > 0.5


@pytest.mark.parametrize(("law", "what"), [("1/(length - 2)", "the divisor"), ("sqrt(1 - length)", "the argument of sqrt")])
def test_a_law_without_a_value_at_the_start_is_reported(tmp_path: Path, law: str, what: str) -> None:
    run = simulate(compile_text(tmp_path, PENDULUM.replace("LAW", law)), check=False)
    assert run.failure is not None
    assert run.failure.message.endswith(f" has no finite value: {what} leaves its domain")
    assert run.failure.element == "spring"
    assert run.failure.time == 0
