"""Runs with the closure "solved": an evaluation finds the multipliers at once, from the state alone, redundant or not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cutjoint.methods import METHODS
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Numerics
from cutjoint.run.artifact import make_simulator_run
from cutjoint.run.results import Trajectory
from cutjoint.run.settings import Options, find_closure
from tests.conftest import with_heavy
from tests.mechanisms.four_bar import exact_tip, four_bar_text
from tests.mechanisms.one_degree import four_bar, spatial
from tests.mechanisms.overconstrained import BENNETT, BRICARD, parallel_cranks_text, skew_chain_text
from tests.mechanisms.rods import rods_text
from tests.physics.simulation import compile_scene, completed, simulate

#: Dormand and Prince take six evaluations an attempt; every 32nd evaluation takes one more, and a start takes some.
EVALUATIONS = 6.5


def run(text: str, *, tolerance: float, closure: str = "solved", **settings: Any) -> Trajectory:
    model = read_model_text(text, "model.yaml")
    scene = next(iter(model.scenes.values()))
    scene = replace(scene, numerics=replace(scene.numerics, closure=closure))
    made = compile_scene(model, scene)
    return completed(simulate(made, check=False, integrator="dormand-prince", tolerance=tolerance, **settings))


def statistics(trajectory: Trajectory) -> float:
    """The evaluations of an attempted step."""
    return trajectory.evaluations / (trajectory.steps + trajectory.statistics.rejected)


@pytest.mark.parametrize("corners", [BENNETT, BRICARD], ids=["Bennett", "Bricard"])
def test_overconstrained_chains_keep_their_energy(corners: tuple[tuple[float, ...], ...]) -> None:
    """The balance of work and energy shares nothing with the integrator.

    Between steps states are off the motion by the error of a stage, where equations that depend on each other there contradict each other.
    """
    trajectory = run(skew_chain_text(corners, "{end: 1, output_step: 0.1}"), tolerance=1e-11)
    assert statistics(trajectory) < EVALUATIONS
    assert trajectory.energy is not None
    assert trajectory.energy.share < 1e-8


@pytest.mark.parametrize("windows", [1, 10])
def test_four_bars_follow_their_pendulum(windows: int) -> None:
    """Up to the first singular pose at 0.714 s."""
    text = four_bar_text(windows)
    model = read_model_text(text, "four_bar.yaml")
    scene = next(iter(model.scenes.values()))
    scene = replace(scene, end=0.6, numerics=replace(scene.numerics, closure="solved", penalty=None))
    trajectory = completed(simulate(compile_scene(model, scene), check=False, integrator="dormand-prince", tolerance=1e-10))
    tip = np.stack([trajectory.columns["tip.x"], trajectory.columns["tip.y"]], axis=1)
    assert np.abs(tip - exact_tip(windows, trajectory.t)).max() < 2e-8
    assert statistics(trajectory) < EVALUATIONS


#: Hanging cranks, which swing and never come in line.
_HANGING = (0.6, -0.8)


def cranks_text(scene: str) -> str:
    """Four cranks, of which the last two say nothing new; penalties at a bound below all masses, so that all weigh the same."""
    return (
        f"{parallel_cranks_text(4, _HANGING)}reactions: {{r: {{joint: closure_2, axes_of: crank_2}}}}\n"
        f"outputs: [pin_0.angle, pin_0.angle_rate, r.Fx, r.Fy]\n"
        f"scenes: {{run: {{{scene}, numerics: {{closure: solved, penalty: 1.0e+3}}}}}}\n"
    )


def test_redundant_reactions_follow_from_the_state() -> None:
    """After 20 s they are those of a start there, and the swing is the pendulum's.

    Multipliers that an evaluation takes over from earlier ones gather what no acceleration answers to: 1e11 N by then, and the swing is
    2e-4 rad off.
    """
    late = run(cranks_text("end: 20, output_step: 2"), tolerance=1e-9)
    angle, rate, *_ = (float(column[-1]) for column in late.columns.values())
    inertia, weight = 4 * (0.1 + 0.25) + 1, 9.81 * (4 * 0.5 + 1)
    begun = np.arctan2(_HANGING[0], -_HANGING[1])
    exact = solve_ivp(
        lambda _, s: [s[1], -weight / inertia * np.sin(s[0])], (0, 20), [begun, 0], method="DOP853", rtol=1e-12, atol=1e-12
    )
    assert abs(begun + angle - exact.y[0, -1]) < 1e-6
    assert statistics(late) < EVALUATIONS
    start = f"positions: {{pin_0.angle: {angle!r}}}, rates: {{pin_0.angle_rate: {rate!r}}}, end: 0.01, output_step: 0.01"
    there = run(cranks_text(start), tolerance=1e-9)
    for name in ("r.Fx", "r.Fy"):
        assert there.columns[name][0] == pytest.approx(late.columns[name][-1], rel=1e-6)


@pytest.mark.parametrize("seed", with_heavy(range(100), *range(1, 100)))
@pytest.mark.parametrize("draw", [four_bar, spatial])
def test_drawn_mechanisms_take_one_pass(draw: Callable[[int], str], seed: int) -> None:
    """Beside multipliers that are corrected until they stay, at a hundredth of the tolerance."""
    made = run(draw(seed), tolerance=1e-10)
    exact = run(draw(seed), tolerance=1e-12, closure="proximal")
    assert statistics(made) < EVALUATIONS
    assert max(np.abs(made.columns[name] - exact.columns[name]).max() for name in made.columns) < 2e-8


@pytest.mark.parametrize("mass", with_heavy([0.0, 1e-3, 1e-6, 1e-9], 1e-3, 1e-6))
def test_a_plate_on_light_rods_keeps_its_energy(mass: float) -> None:
    """Rods feel the plate only where all of them are closed: penalties by what each feels alone leave most of a gap open."""
    made = run(rods_text(mass=mass), tolerance=1e-10)
    exact = run(rods_text(mass=mass), tolerance=1e-12)
    assert made.evaluations < 15 * made.steps < 1500
    assert max(np.abs(made.columns[name] - exact.columns[name]).max() for name in made.columns) < 1e-8
    assert exact.energy is not None
    assert exact.energy.share < 1e-9


_CRANK, _ROD, _INERTIA, _SLIDER = 0.1, 0.3, 1e-4, 3.0


def toggle_text() -> str:
    """A light crank that drives a heavy slider, from the middle of a stroke: near dead centres its rod feels a hundred times the mass."""
    x = np.sqrt(_ROD**2 - _CRANK**2)
    return f"""cutjoint: 1
name: toggle
gravity: [0, 0, -9.81]
bodies:
  crank: {{mass: 0.01, centre_of_mass: [0, 0, {_CRANK / 2}], inertia: [{_INERTIA}, {_INERTIA}, {_INERTIA}]}}
  rod: {{mass: 0.01, centre_of_mass: [{x / 2}, 0, {_CRANK / 2}], inertia: [{_INERTIA}, {_INERTIA}, {_INERTIA}]}}
  slider: {{mass: {_SLIDER}, centre_of_mass: [{x}, 0, 0]}}
joints:
  pin: {{kind: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: [0, 1, 0]}}
  elbow: {{kind: revolute, bodies: [crank, rod], at: [0, 0, {_CRANK}], axis: [0, 1, 0]}}
  wrist: {{kind: revolute, bodies: [rod, slider], at: [{x}, 0, 0], axis: [0, 1, 0]}}
  rail: {{kind: prismatic, bodies: [ground, slider], at: [{x}, 0, 0], axis: [1, 0, 0]}}
outputs: [pin.angle]
scenes: {{turn: {{end: 0.5, output_step: 0.05, rates: {{pin.angle_rate: 6}}}}}}
"""


def toggle_motion(t: np.ndarray) -> np.ndarray:
    """The crank's turn from upright, towards the slider: M a'' + M' a'^2/2 + V' = 0 with derivatives by complex steps."""

    def rod(a: Any) -> Any:
        return np.arcsin(_CRANK * np.cos(a) / _ROD)

    def mass(a: Any) -> Any:
        slope = rod(a + 1e-20j).imag / 1e-20 if np.isrealobj(a) else -_CRANK * np.sin(a) / (_ROD * np.cos(rod(a)))
        middle = (_CRANK * np.cos(a) - _ROD / 2 * np.sin(rod(a)) * slope) ** 2 + (_CRANK / 2 * np.sin(a)) ** 2
        slider = _CRANK * np.cos(a) - _ROD * np.sin(rod(a)) * slope
        return 0.01 * (_CRANK / 2) ** 2 + _INERTIA + 0.01 * middle + _INERTIA * slope**2 + _SLIDER * slider**2

    def rate(_: float, s: np.ndarray) -> list[float]:
        by_angle = mass(s[0] + 1e-20j).imag / 1e-20
        pull = -9.81 * (0.01 + 0.01) * _CRANK / 2 * np.sin(s[0])
        return [s[1], -(by_angle * s[1] ** 2 / 2 + pull) / mass(s[0])]

    found = solve_ivp(rate, (0, float(t[-1])), [0.0, 6.0], method="DOP853", rtol=1e-13, atol=1e-13, t_eval=t)
    return np.asarray(found.y[0])


def test_passes_are_repeated_where_one_is_not_enough() -> None:
    trajectory = run(toggle_text(), tolerance=1e-11)
    assert np.abs(trajectory.columns["pin.angle"] - toggle_motion(trajectory.t)).max() < 2e-8
    assert statistics(trajectory) > EVALUATIONS


def test_integrators_choose_the_closure() -> None:
    """Equal steps of the trapezoidal rule correct multipliers from iteration to iteration, so that one correction inside is enough."""
    recursive = METHODS["recursive"]
    assert find_closure(Numerics(), recursive).name == "solved"
    assert find_closure(Numerics(dt=1e-3), recursive).name == "proximal"
    assert find_closure(Numerics(dt=1e-3, integrator="rk4"), recursive).name == "solved"
    assert find_closure(Numerics(closure="proximal"), recursive).name == "proximal"
    assert find_closure(Numerics(), METHODS["augmented"]).name == "penalty"


def test_a_run_has_the_closure_of_its_code() -> None:
    """An integrator that is asked for later does not change it."""
    model = read_model_text(toggle_text(), "toggle.yaml")
    scene = replace(model.scenes["turn"], numerics=Numerics(dt=1e-3))
    made = make_simulator_run(compile_scene(model, scene), Options(integrator="dormand-prince"))
    assert made.run_file.settings.stabilisation.closure == "proximal"
