"""Stepping from Python."""

from __future__ import annotations

import pickle
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import cutjoint
from cutjoint.compile import c_export as standalone
from cutjoint.model.read import read_model
from cutjoint.run.scenes import find_case
from cutjoint.stepping.load import load_scene
from tests.conftest import MODELS, needs_cpp
from tests.mechanisms.driven import pushed_text

from .c_exports import ALONE

pytestmark = needs_cpp

PRESS = MODELS / "press.yaml"


@pytest.fixture(params=ALONE)
def method(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def press(method: str) -> cutjoint.Simulation:
    return cutjoint.load(PRESS, method=method, integrator="trapezoidal")


def test_steps_are_those_of_the_command_line_bit_by_bit(press: cutjoint.Simulation, method: str) -> None:
    run = cutjoint.simulate(PRESS, method=method, integrator="trapezoidal", events="crossed", error=False, end=0.1)
    press.reset()
    for t, x in zip(run.t, run["slider.x"], strict=True):
        press.advance(t)
        assert (press.time, press.outputs["slider.x"]) == (t, x)


LEANING = """
cutjoint: 1
name: leaning
gravity: [0, 0, -9.81]
bodies: {mass: {mass: 2, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}}
joints: {slide: {kind: prismatic, bodies: [ground, mass], at: [0, 0, 0], axis: z}}
forces: {spring: {kind: joint_force, joint: slide, law: -1000*position - 10*rate + 50*tilt}}
states: {tilt: {start: 0, rate: -tilt*(tilt - 1)*(tilt - 2)}}
outputs: [slide.displacement, tilt.value]
scenes: {rest: {end: 1, output_step: 0.01, pose: equilibrium, states: {tilt: 1.9}}}
"""


def test_given_states_count_once_a_pose_at_rest_is_found(tmp_path: Path) -> None:
    """The mass rests with the tilt at 0, where the search begins, though from 1.9 it would find rest at 2."""
    (tmp_path / "leaning.yaml").write_text(LEANING, encoding="utf-8")
    sim = cutjoint.load(tmp_path / "leaning.yaml").reset()
    assert dict(sim.outputs) == pytest.approx({"slide.displacement": -2 * 9.81 / 1000, "tilt.value": 1.9}, abs=1e-9)


def test_step_advance_and_play_are_the_same(press: cutjoint.Simulation) -> None:
    press.reset(dt=1e-3)
    start = press.snapshot()
    played = press.run(20)
    press.restore(start)
    for _ in range(20):
        press.step()
    assert np.array_equal(press.outputs.array, played[-1])
    press.restore(start)
    press.advance(0.02)
    assert np.array_equal(press.outputs.array, played[-1])
    press.advance(0.0205)
    assert press.time == 0.0205


def test_steps_may_change_their_length(press: cutjoint.Simulation) -> None:
    press.reset(dt=1e-3).run(3)
    press.library.set_step(press.address, 5e-4)
    press.step()
    press.step()
    assert press.time == 0.003 + 2 * 5e-4
    other = press.copy()
    press.step()
    other.step()
    assert press.time == other.time == 0.003 + 3 * 5e-4


def test_values_are_views_by_name(press: cutjoint.Simulation) -> None:
    press.reset()
    assert np.shares_memory(press.coordinates.array, press.coordinates.array)
    before, outputs = press.outputs.array, press.outputs
    held = before.copy()
    press.step()
    assert np.array_equal(before, held)  # of the moment
    assert outputs["slider.x"] == press.outputs["slider.x"]
    assert not np.array_equal(press.outputs.array, before)
    assert press.outputs.units == {"pin.angle": "rad", "slider.x": "m", "slider.vx": "m/s", "spring.force": "N"}
    assert list(press.coordinates) == [re.sub(r"_rate$|v(?=[xyz]$)", "", name) for name in press.speeds]
    with pytest.raises(KeyError, match="no 'stifness'; did you mean 'stiffness'"):
        press.parameters["stifness"] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        press.speeds["pin.angle_rate"] = 3.0


def test_parameters_change_between_steps(press: cutjoint.Simulation, method: str) -> None:
    stiff = {"stiffness": 3000.0}
    known = cutjoint.simulate(PRESS, method=method, integrator="trapezoidal", events="crossed", error=False, end=0.1, parameters=stiff)
    press.parameters["stiffness"] = 3000.0
    press.reset().advance(0.1)
    assert press.outputs["slider.x"] == known["slider.x"][-1]
    stretch, rate = 0.8 - press.outputs["slider.x"] - 0.48, -press.outputs["slider.vx"]
    for stiffness in (3000.0, 6000.0):
        press.parameters["stiffness"] = stiffness
        assert press.outputs["spring.force"] == pytest.approx(stiffness * stretch + 20 * rate, rel=1e-9)


def test_a_state_is_set(method: str) -> None:
    model, scene = find_case(read_model(PRESS), None)
    strict = replace(scene, numerics=replace(scene.numerics, tolerance=1e-8))  # what the iteration leaves is below the bound beneath
    press, other = (load_scene(model, strict, method=method, integrator="trapezoidal").reset() for _ in range(2))
    press.advance(0.05)
    other.set_state(press.time, press.coordinates.array, press.speeds.array)
    assert other.time == press.time
    assert np.array_equal(other.coordinates.array, press.coordinates.array)
    zero = 1e-9 if method in ("augmented", "classical") else 1e-12  # accelerations of natural coordinates round, beside hundreds
    assert other.accelerations.array == pytest.approx(press.accelerations.array, rel=1e-5, abs=zero)
    with pytest.raises(ValueError, match="coordinates and"):
        other.set_state(0.0, np.zeros(1), np.zeros(2))


def test_copies_are_apart(press: cutjoint.Simulation) -> None:
    press.reset().advance(0.05)
    other = press.copy()
    other.step()
    assert (press.time, other.time) == (0.05, pytest.approx(0.05 + 1e-3))
    with pytest.raises(ValueError, match="no snapshot of 'press'"):
        press.restore(b"nothing")


def test_what_cannot_go_on_is_reported(press: cutjoint.Simulation) -> None:
    with pytest.raises(cutjoint.SimulationError, match=r"the simulation has not been started; call reset\(\)"):
        press.step()
    with pytest.raises(cutjoint.SimulationError, match="has not been started"):
        _ = press.outputs
    with pytest.raises(cutjoint.SimulationError, match="the time to advance to has passed") as error:
        press.reset().advance(-1.0)
    assert error.value.status == -6
    assert pickle.loads(pickle.dumps(error.value)).status == -6
    with pytest.raises(cutjoint.SimulationError, match="not finite, or out of its range"):
        press.reset(dt=-1.0)
    with pytest.raises(cutjoint.SimulationError, match=r"cannot close.*'.*' \(press.yaml:\d+.*check the joints"):
        press.reset(coordinates={"pin.angle": 0.0, "rail.displacement": 5.0})
    assert press.reset().coordinates["pin.angle"] == 0.0  # what did not close is forgotten


def test_a_host_is_reported_what_a_stiff_model_takes() -> None:
    """And the method that the advice names goes on with the same steps."""
    explicit, implicit = (
        cutjoint.load(PRESS, method=method, integrator="trapezoidal") for method in ("recursive", "recursive-newton")
    )
    for sim in (explicit, implicit):
        sim.reset(dt=1e-3).parameters["stiffness"] = 1e8
    with pytest.raises(cutjoint.SimulationError, match="try: a smaller dt, or compiling with the method recursive-newton"):
        explicit.run(20)
    assert implicit.run(20).shape[0] == 20


def test_coordinates_and_speeds_hold_for_one_start(press: cutjoint.Simulation) -> None:
    first = press.reset().snapshot()
    assert press.reset(coordinates={"pin.angle": 0.3}, speeds={"pin.angle_rate": 2.0}).coordinates["pin.angle"] == pytest.approx(0.3)
    assert press.speeds["pin.angle_rate"] == pytest.approx(2.0)
    assert press.reset().snapshot() == first


def test_natural_coordinates_begin_with_those_of_the_tree() -> None:
    sim = cutjoint.load(PRESS, method="augmented").reset(coordinates={"pin.angle": 0.3}, speeds={"pin.angle_rate": 2.0})
    elbow = 0.1 * np.array([np.sin(0.3), np.cos(0.3)])
    assert [sim.coordinates[f"elbow.{axis}"] for axis in "xz"] == pytest.approx(elbow, abs=1e-12)
    assert [sim.speeds[f"elbow.v{axis}"] for axis in "xz"] == pytest.approx([2 * elbow[1], -2 * elbow[0]], abs=1e-12)
    with pytest.raises(KeyError, match=r"no 'elbow\.x'; there is pin\.angle, rail\.displacement, wrist\.angle"):
        sim.reset(coordinates={"elbow.x": 0.1})
    with pytest.raises(cutjoint.SimulationError, match=r"cannot close.*: '\w+\.\w+' \(press\.yaml:\d+\)"):
        sim.reset(coordinates={"pin.angle": 0.0, "rail.displacement": 5.0})
    sim.reset().parameters["stiffness"] = -1e9
    with pytest.raises(cutjoint.SimulationError, match=r"a pivot of the tangent is not positive: 'elbow\.vx' \(press\.yaml:12\)"):
        sim.step()


def test_natural_coordinates_satisfy_the_equations_again() -> None:
    sim = cutjoint.load(PRESS, method="augmented").reset()
    sim.displace(np.full(len(sim.speeds), 1e-3))
    elbow, wrist = (np.array([sim.coordinates[f"{name}.{axis}"] for axis in "xyz"]) for name in ("elbow", "wrist"))
    assert (np.linalg.norm(elbow), np.linalg.norm(wrist - elbow)) == pytest.approx((0.1, np.hypot(0.1, 0.3)), abs=1e-12)
    assert sim.constraint_jacobian @ sim.speeds.array == pytest.approx(np.zeros(13), abs=1e-10)
    assert np.linalg.matrix_rank(sim.constraint_jacobian) == 12


def test_rollout_is_what_each_would_do_alone(press: cutjoint.Simulation) -> None:
    press.reset(dt=1e-3).advance(0.01)
    values = [1000.0, 2000.0, 5000.0]
    rows = cutjoint.rollout(press, 30, parameters={"stiffness": values}, threads=2)
    assert rows.shape == (3, 30, 4)
    assert press.time == 0.01
    for value, own in zip(values, rows, strict=True):
        one = press.copy()
        one.parameters["stiffness"] = value
        assert np.array_equal(one.run(30), own)
    with pytest.raises(ValueError, match="same number of simulations"):
        cutjoint.rollout(press, 3, parameters={"stiffness": values}, snapshots=[press.snapshot()])
    with pytest.raises(ValueError, match="number of simulations unknown"):
        cutjoint.rollout(press, 3)
    assert np.array_equal(cutjoint.rollout(press, 30, parameters={"stiffness": 1000.0})[0], rows[0])


def test_rollout_with_inputs_of_each_step(tmp_path: Path) -> None:
    path = tmp_path / "pushed.yaml"
    path.write_text(pushed_text(), encoding="utf-8")
    sim = cutjoint.load(path).reset(dt=0.01)
    pushes = np.random.default_rng(1).normal(size=(5, 30))
    rows = cutjoint.rollout(sim, 30, inputs={"push": pushes}, threads=2)
    for course, found in zip(pushes, rows, strict=True):
        one = sim.copy()
        for push, row in zip(course, found, strict=True):
            one.inputs["push"] = push
            one.step()
            assert one.outputs.array.tolist() == row.tolist()
    with pytest.raises(ValueError, match=r"input 'push': an array \(5, 30\) is none of \(simulations,\) and \(simulations, 20\)"):
        cutjoint.rollout(sim, 20, inputs={"push": pushes})
    with pytest.raises(ValueError, match=r"parameter 'mass': an array \(1, 2\) has not one value for each simulation"):
        cutjoint.rollout(sim, 20, parameters={"mass": [[1.0, 2.0]]})


def test_rollout_in_lanes_of_what_is_linearised_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(standalone, "_COMPILING", -1e9)
    press = cutjoint.load(MODELS / "press.yaml", linearise=True).reset()
    rows = cutjoint.rollout(press, 5, parameters={"stiffness": [1000.0, 2000.0]})
    press.parameters["stiffness"] = 2000.0
    np.testing.assert_allclose(press.run(5), rows[1], rtol=1e-9, atol=1e-9)


def test_rollout_in_lanes_is_what_each_would_do_alone(press: cutjoint.Simulation, monkeypatch: pytest.MonkeyPatch) -> None:
    """From other states with other settings, each the same bit by bit whatever goes beside it; one that fails has no rows from there on."""
    monkeypatch.setattr(standalone, "_COMPILING", -1e9)
    snapshots, values = [], [1000.0 + 300.0 * k for k in range(21)]
    for k, _ in enumerate(values):
        fixed = {"iterations": 0 if k % 7 else 4} if press.library.steps.is_iterated else {}
        press.reset(dt=1e-3 if k % 5 else 2e-3, **fixed).advance(0.01 * k)
        snapshots.append(press.snapshot())
    values[4] = np.nan
    rows = cutjoint.rollout(press, 30, parameters={"stiffness": values}, snapshots=snapshots, threads=2)
    assert np.isnan(rows[4]).all()
    for k in (0, 1, 2, 4, 5, 19, 20):
        one = press.copy()
        one.restore(snapshots[k])
        one.parameters["stiffness"] = values[k]
        alone = cutjoint.rollout(press, 30, parameters={"stiffness": [values[k]]}, snapshots=[snapshots[k]], threads=1)
        assert np.array_equal(alone[0], rows[k], equal_nan=True)
        if k != 4:
            np.testing.assert_allclose(one.run(30), rows[k], rtol=1e-9, atol=1e-9)
    for wrong in (bytes(len(snapshots[0])), snapshots[1][:-8]):
        with pytest.raises(ValueError, match="these bytes are no snapshot of 'press'"):
            cutjoint.rollout(press, 30, snapshots=[snapshots[0], wrong])
    with pytest.raises(KeyError, match="no 'stifness'; did you mean 'stiffness'"):
        cutjoint.rollout(press, 30, parameters={"stifness": values})
