"""Models without the forces that do not act: the motion is the full model's, or the run stops where a force would act."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy

from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import generate
from cutjoint.methods import METHODS
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import Model, Output, Scene
from cutjoint.package.errors import RunError
from cutjoint.reduce.guards import guard_forces, guardable, speculate, zero_region
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import FailureReport, Trajectory
from cutjoint.run.simulation import simulate
from cutjoint_bench.generic.artifact import compile_generic
from tests.conftest import MODELS, needs_cpp, with_heavy
from tests.physics.simulation import compile_scene, completed

pytestmark = needs_cpp

#: A weight on a spring, above a floor (a damped stop) and below a slack rope, with a pendulum that may meet a wall.
TEXT = """
cutjoint: 1
name: hammer
gravity: [0, 0, -9.81]
bodies:
  weight: {mass: 2, inertia: [1, 1, 1], centre_of_mass: [0, 0, 0]}
  arm: {mass: 0.1, inertia: [0.01, 0.01, 0.01], centre_of_mass: [0.3, 0, 0]}
joints:
  slide: {kind: prismatic, bodies: [ground, weight], at: [0, 0, 0], axis: [0, 0, 1]}
  pin: {kind: revolute, bodies: [weight, arm], at: [0, 0, 0], axis: [0, 1, 0]}
parameters:
  depth: {value: 0.4, unit: m, binding: param}
forces:
  spring: {kind: joint_force, joint: slide, law: {stiffness: 200, damping: 1, free_position: 0}}
  floor:
    kind: axial_force
    bodies: [ground, weight]
    origin: [0, 0, 0]
    point: [0, 0, 0]
    axis: [0, 0, 1]
    law: {stop: {at: "-depth", side: below, stiffness: 1.0e+4, damping: 20}}
  rope:
    kind: point_spring
    bodies: [ground, weight]
    from: [0, 0, 1]
    to: [0, 0, 0]
    law: "where(length > 1.39, 5000*(length - 1.39), 0)"
  wall: {kind: joint_force, joint: pin, law: "where(position > 3.3, -30*(position - 3.3), 0)"}
  pad: {kind: joint_force, joint: pin, law: "where(position > 5, 1, 0)", active: false}
  sleeve: {kind: bushing, bodies: [ground, arm], at: [0, 0, 0], stiffness: [1, 1, 1, 1, 1, 1], active: false}
outputs: [slide.displacement, slide.displacement_rate, pin.angle, floor.force, floor.travel, rope.force, rope.length, wall.force]
scenes:
  swing: {end: 0.7, positions: {pin.angle: 0.2}, numerics: {dt: 0.001, solver_tolerance: 1.0e-10}}
  turn: {end: 1, positions: {pin.angle: 0.2}, rates: {pin.angle_rate: 8}, numerics: {dt: 0.001, solver_tolerance: 1.0e-10}}
  low: {end: 0.1, positions: {slide.displacement: -0.395}, numerics: {dt: 0.001, solver_tolerance: 1.0e-10}}
"""

OUT = ("floor", "rope", "wall")


each_method = pytest.mark.parametrize("method", METHODS)


@cache
def hammer() -> Model:
    return read_model_text(TEXT, "hammer.yaml")


def without(*names: str) -> Model:
    return guard_forces(hammer(), hammer().scenes["swing"], names).model


@cache
def compiled(method: str, out: tuple[str, ...] = OUT) -> Artifact:
    return compile_scene(without(*out), hammer().scenes["swing"], CompileOptions(method=method))


def run(method: str, scene: str, out: tuple[str, ...] = OUT, **how: Any) -> Trajectory:
    return simulate(replace(compiled(method, out), scene=hammer().scenes[scene]), **how, check=False)


def test_which_forces_can_be_guarded() -> None:
    assert guardable(hammer(), hammer().scenes["swing"]) == OUT
    assert guardable(hammer(), replace(hammer().scenes["swing"], switches={"pad": True, "rope": False})) == ("floor", "wall", "pad")


def test_a_force_that_acts_on_the_border_of_its_case_stays() -> None:
    """A guard trips beyond the border, on which a force that begins with a jump acts already."""
    x = sympy.Symbol("x", real=True)
    assert zero_region(sympy.Piecewise((1, x >= 5), (0, True))) is None
    assert zero_region(sympy.Piecewise((0, x < 5), (1, True))) is None
    for law in (sympy.Piecewise((1, x > 5), (0, True)), sympy.Piecewise((x - 5, x >= 5), (0, True))):
        assert zero_region(law) == (5 - x,)


def test_an_outcome_says_what_was_done_and_why_not_more() -> None:
    model, scene = hammer(), replace(hammer().scenes["swing"], switches={"sleeve": True})
    outcome = guard_forces(model, scene, ("wall", "spring", "pad", "sleeve"))
    assert [f.name for f in outcome.model.forces] == ["spring", "floor", "rope", "pad", "sleeve"]
    assert outcome.model.force_elements == model.forces
    line = next(i for i, text in enumerate(TEXT.splitlines(), 1) if "wall: {" in text)
    assert [(n.element, n.text, n.span.line) for n in outcome.done] == [("wall", "is taken out, guarded by 3.3 - position >= 0", line)]
    assert {n.element: n.text for n in outcome.left} == {
        "spring": "stays: its law has no case in which it is zero",
        "pad": "stays: it is switched off",
        "sleeve": "stays: it has no law over one position",
    }


def test_passes_one_after_the_other_give_the_model_of_one() -> None:
    model, scene = hammer(), hammer().scenes["swing"]
    one_by_one = guard_forces(guard_forces(model, scene, ("wall",)).model, scene, ("floor", "rope")).model
    assert one_by_one == guard_forces(model, scene).model


@pytest.mark.parametrize("method", with_heavy(METHODS, "augmented", "classical"))
def test_a_model_whose_guards_hold_moves_as_the_full_one(method: str) -> None:
    """A force that was taken out reports no force, but still the places of its parts."""
    full, reduced = completed(run(method, "swing", ())), completed(run(method, "swing"))
    for column in full.columns:
        assert reduced[column] == pytest.approx(full[column], abs=1e-10), column
    assert compiled(method).program.operations(iteration(method)) < compiled(method, ()).program.operations(iteration(method))


def iteration(method: str) -> str:
    return compiled(method).iteration


@each_method
def test_a_guard_trips_in_the_step_in_which_the_force_begins_to_act(method: str) -> None:
    full, stopped = completed(run(method, "turn", ())), run(method, "turn")
    first = int(np.argmax(full["wall.force"] != 0))
    assert 10 < first < len(full.t) - 1
    failure = stopped.failure
    assert failure is not None
    assert failure.guards == ("wall",)
    assert failure.element == "wall"
    assert abs(failure.step - first) <= 1
    assert failure.time == pytest.approx(1e-3 * failure.step)
    assert 0 < failure.residual < 0.02  # rad, what a step goes beyond the border
    line = next(i for i, text in enumerate(TEXT.splitlines(), 1) if "wall: {" in text)
    assert failure.message == f"the guard of 'wall' (hammer.yaml:{line}) is violated: the force would act"
    assert stopped.t[-1] == pytest.approx(failure.time - 1e-3)  # the violated step is no part of the results
    for column in full.columns:
        assert stopped[column] == pytest.approx(full[column][: len(stopped.t)], abs=1e-10), column


@each_method
def test_a_force_that_acts_at_the_start_stops_the_run_there(method: str) -> None:
    failure = run(method, "low").failure
    assert failure is not None
    assert (failure.guards, failure.step, failure.time) == (("rope",), 0, 0.0)
    assert failure.residual == pytest.approx(0.005)


def test_margins_follow_parameters() -> None:
    """The floor is where the run's parameters say."""
    failure = run("recursive", "swing", parameters={"depth": 0.15}).failure
    assert failure is not None
    assert failure.guards == ("floor",)
    full = completed(run("recursive", "swing", (), parameters={"depth": 0.15}))
    assert abs(failure.step - int(np.argmax(full["floor.force"] != 0))) <= 1


@each_method
def test_speculation_puts_back_what_acts(method: str) -> None:
    full = completed(run(method, "turn", ()))
    runs = []

    def attempt(model: Model, _: Scene) -> Trajectory:
        out = tuple(guard.force.name for guard in model.guards)
        runs.append(out)
        return run(method, "turn", out)

    outcome, trajectory = speculate(hammer(), hammer().scenes["turn"], attempt)
    assert runs == [OUT, ("floor", "rope")]
    assert [n.element for n in outcome.done] == ["floor", "rope"]
    assert trajectory is not None
    for column in full.columns:
        assert completed(trajectory)[column] == pytest.approx(full[column], abs=1e-9), column


def test_after_a_run_that_fails_otherwise_all_forces_stay() -> None:
    fail = FailureReport(message="no equilibrium", time=0.0, step=0, element="slide", residual=1.0, advice="")
    counts = []

    @dataclass
    class Attempt:
        failure: FailureReport | None

    def attempt(model: Model, _: Scene) -> Attempt:
        counts.append(len(model.guards))
        return Attempt(fail if model.guards else None)

    outcome, result = speculate(hammer(), hammer().scenes["swing"], attempt)
    assert (counts, result, outcome.done) == ([3], None, ())


def test_the_generic_solver_refuses_guards() -> None:
    with pytest.raises(RunError, match="the generic solver knows neither guards nor columns of reduced models"):
        compile_generic(without("floor", "wall"), hammer().scenes["swing"])


def test_generated_code_names_its_guards() -> None:
    _, _, source = generate(without(*OUT), hammer().scenes["swing"], ())
    floor = next(i for i, text in enumerate(TEXT.splitlines(), 1) if "floor:" in text)
    assert f'{{"floor", "hammer.yaml:{floor}"}}' in source.files["description.cpp"]
    heading = f"// guard: floor\n  //   the law is zero while the margin is not negative\n  //   hammer.yaml:{floor}\n"
    assert heading in source.files["guard.cpp"]
    _, _, plain = generate(hammer(), hammer().scenes["swing"], ())
    assert "guard" not in "".join(plain.files.values())


def test_guards_of_forces_that_a_scene_switches_off_are_not_checked() -> None:
    scene = replace(hammer().scenes["turn"], switches={"wall": False})
    equations, _, _ = generate(without(*OUT), scene, ())
    assert list(equations.function("guard").results) == ["margin:floor", "margin:rope"]


def iltis(scene: str, is_guarded: bool) -> Artifact:
    model = read_model(MODELS / "iltis.yaml")
    wheels = ("front_left", "front_right", "rear_left", "rear_right")
    chosen = model.scenes[scene]
    bumpers = tuple(Output(element=f"{wheel}.bumper", quantity="force", span=chosen.span) for wheel in wheels)
    chosen = replace(chosen, outputs=(*chosen.outputs, *bumpers))
    return compile_scene(guard_forces(model, chosen).model if is_guarded else model, chosen)


def test_the_car_s_bumpers_stay_out_of_reach_on_a_smooth_bump() -> None:
    full, reduced = iltis("iavsd_inphase_5", False), iltis("iavsd_inphase_5", True)
    assert reduced.program.operations("evaluate") < full.program.operations("evaluate")
    expected, found = completed(simulate(full)), completed(simulate(reduced))
    assert not any(expected[column].any() for column in expected.columns if "bumper" in column)
    for column in expected.columns:
        assert found[column] == pytest.approx(expected[column], rel=1e-9, abs=1e-9), column


def test_the_car_s_bumpers_act_where_steps_lead_down() -> None:
    full, stopped = completed(simulate(iltis("simul1s", False))), simulate(iltis("simul1s", True), check=False)
    acting = np.any([full[column] != 0 for column in full.columns if "bumper" in column], axis=0)
    failure = stopped.failure
    assert failure is not None
    assert failure.guards == ("front_left.bumper", "front_right.bumper")
    assert abs(failure.step - int(np.argmax(acting))) <= 1
    assert re.search(r"'front_(left|right)\.bumper' \(iltis\.yaml:\d+\) is violated", failure.message)
