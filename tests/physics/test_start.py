"""Starts: given values, values that follow, and impossible ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cutjoint.methods import METHODS
from cutjoint.model.read import read_model_text
from cutjoint.run.scenes import find_scene
from cutjoint.stepping.load import load_scene
from tests.conftest import MODELS, with_heavy
from tests.mechanisms.four_bar import four_bar_text
from tests.physics.simulation import compile_model, compile_text, completed, simulate

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


#: A plate on a ball carries a rod that ends on a slide; another plate, whose joints have the ground as follower, and a bead on a wire.
ATTITUDES = """
cutjoint: 1
name: plates
gravity: [0, 0, -9.81]
bodies:
  plate: {mass: 2, centre_of_mass: [0.5, 0, 0], inertia: [0.1, 0.2, 0.2]}
  rod: {mass: 1, centre_of_mass: [1, 0, 1], inertia: [0.2, 0.2, 0.01]}
  slider: {mass: 1, centre_of_mass: [1, 0, 2], inertia: [0.1, 0.1, 0.1]}
  hung: {mass: 1, centre_of_mass: [0, 1, -1], inertia: [0.1, 0.2, 0.25]}
  loose: {mass: 1, centre_of_mass: [0, 2, 0], inertia: [0.1, 0.2, 0.25]}
  bead: {mass: 1, centre_of_mass: [0, 3, 0], inertia: [0.1, 0.2, 0.25]}
joints:
  foot: {kind: spherical, bodies: [ground, plate], at: [0, 0, 0]}
  knee: {kind: spherical, bodies: [plate, rod], at: [1, 0, 0]}
  head: {kind: spherical, bodies: [rod, slider], at: [1, 0, 2], cut: true}
  slide: {kind: prismatic, bodies: [ground, slider], at: [1, 0, 2], axis: [0, 0, 1]}
  hook: {kind: spherical, bodies: [hung, ground], at: [0, 1, 0]}
  drift: {kind: free, bodies: [ground, loose], at: [0, 2, 0]}
  wire: {kind: point_on_line, bodies: [bead, ground], at: [0, 3, 0], axis: [1, 0, 0]}
markers:
  tip: {body: plate, at: [1, 0, 0]}
outputs: [tip.x, tip.y, tip.z, rod.x, rod.y, rod.z, slide.displacement, hung.x, hung.y, hung.z, loose.roll, loose.pitch, loose.yaw, loose.x,
          bead.x, bead.roll, bead.pitch, bead.yaw, plate.roll, plate.pitch, plate.yaw]
scenes:
  turned:
    end: 0.002
    output_step: 1 ms
    numerics: {dt: 1 ms}
    positions:
      foot.attitude: {euler: [0.3, 0.2, -0.1], order: yzx}
      hook.attitude: {rotation_vector: [0.4, -0.3, 0.8]}
      drift.attitude: {quaternion: [0.8, 0, 0.6, 0]}
      drift.x: 0.5
      wire.attitude: {euler: [0.4, 0.3, 0.2], order: zyx}
      wire.displacement: 0.25
"""


@pytest.mark.parametrize("method", with_heavy(tuple(METHODS), *(m for m in METHODS if m != "recursive")))
def test_attitudes_are_of_followers_beside_their_bases(method: str, tmp_path: Path) -> None:
    """Beside SciPy's rotations, whichever way the tree passes a ball; a loop closes around what is given."""
    (tmp_path / "model.yaml").write_text(ATTITUDES, encoding="utf-8")
    run = completed(simulate(compile_model(tmp_path / "model.yaml", method=method), error=False))

    def first(element: str, names: str) -> np.ndarray:
        return np.array([run[f"{element}.{name}"][0] for name in names.split()])

    plate = Rotation.from_euler("YZX", [0.3, 0.2, -0.1])
    tip = plate.apply([1, 0, 0])
    assert first("tip", "x y z") == pytest.approx(tip, abs=1e-12)
    assert first("plate", "yaw pitch roll") == pytest.approx(plate.as_euler("ZYX"), abs=1e-12)
    head = np.array([1, 0, 2 + run["slide.displacement"][0]])
    assert np.linalg.norm(head - tip) == pytest.approx(2, abs=1e-12)
    assert first("rod", "x y z") == pytest.approx((head + tip) / 2, abs=1e-12)
    hung = Rotation.from_rotvec([0.4, -0.3, 0.8]).inv()
    assert first("hung", "x y z") == pytest.approx(np.array([0, 1, 0]) + hung.apply([0, 0, -1]), abs=1e-12)
    assert first("loose", "yaw pitch roll") == pytest.approx(Rotation.from_quat([0, 0.6, 0, 0.8]).as_euler("ZYX"), abs=1e-12)
    assert run["loose.x"][0] == pytest.approx(0.5, abs=1e-12)
    bead = Rotation.from_euler("ZYX", [0.4, 0.3, 0.2]).inv()
    assert first("bead", "yaw pitch roll") == pytest.approx(bead.as_euler("ZYX"), abs=1e-12)


def test_attitudes_near_which_a_start_is_sought_are_those_of_followers_too(tmp_path: Path) -> None:
    """Positions that only lead a start to its place: what closes no loop is where they have it, and a loop closes by all of its joints."""
    given = "[foot.attitude, hook.attitude, drift.attitude, drift.x, wire.attitude, wire.displacement]"
    (tmp_path / "model.yaml").write_text(ATTITUDES + f"    near: {given}\n", encoding="utf-8")
    run = completed(simulate(compile_model(tmp_path / "model.yaml"), error=False))
    hung, bead = Rotation.from_rotvec([0.4, -0.3, 0.8]).inv(), Rotation.from_euler("ZYX", [0.4, 0.3, 0.2]).inv()
    assert [run[f"hung.{axis}"][0] for axis in "xyz"] == pytest.approx(np.array([0, 1, 0]) + hung.apply([0, 0, -1]), abs=1e-12)
    assert [run[f"bead.{angle}"][0] for angle in ("yaw", "pitch", "roll")] == pytest.approx(bead.as_euler("ZYX"), abs=1e-12)
    assert run["loose.x"][0] == pytest.approx(0.5, abs=1e-12)
    tip = np.array([run[f"tip.{axis}"][0] for axis in "xyz"])
    assert np.linalg.norm(np.array([1, 0, 2 + run["slide.displacement"][0]]) - tip) == pytest.approx(2, abs=1e-12)
    kept = Rotation.from_euler("YZX", [0.3, 0.2, -0.1]).apply([1, 0, 0])
    assert 1e-3 < np.linalg.norm(tip - kept) < 0.5  # the shortest way turns the foot too


LEG = """
cutjoint: 1
name: leg
gravity: [0, 0, -9.81]
bodies:
  thigh: {mass: 1, centre_of_mass: [0, 0, 0.85], inertia: [0.0075, 0.0075, 0.0001]}
  shank: {mass: 0.6, centre_of_mass: [0, 0, 0.55], inertia: [0.0045, 0.0045, 0.0001]}
  crank: {mass: 0.1, centre_of_mass: [0.03, 0, 1], inertia: [0.00001, 0.00003, 0.00003]}
  coupler: {mass: 0.15, centre_of_mass: [0.06, 0, 0.85], inertia: [0.0011, 0.0011, 0.0001]}
joints:
  hip: {kind: revolute, bodies: [ground, thigh], at: [0, 0, 1], axis: y}
  knee: {kind: revolute, bodies: [thigh, shank], at: [0, 0, 0.7], axis: y}
  shaft: {kind: revolute, bodies: [ground, crank], at: [0, 0, 1], axis: y}
  pin: {kind: revolute, bodies: [crank, coupler], at: [0.06, 0, 1], axis: y}
  end: {kind: spherical, bodies: [coupler, shank], at: [0.06, 0, 0.7]}
outputs: [hip.angle, knee.angle, shaft.angle]
scenes: {still: {end: 0.1}}
"""


def test_given_coordinates_keep_the_assembly_of_the_design_position() -> None:
    """A parallelogram's crank turns as the shank does; from far away the shortest way led to the crossed one."""
    model = read_model_text(LEG, "leg.yaml")
    sim = load_scene(model, find_scene(model, None))
    for hip, knee in np.random.default_rng(3).uniform([-1.5, -1.4], [1.5, 1.4], (40, 2)):
        sim.reset(coordinates={"hip.angle": hip, "knee.angle": knee})
        assert sim.coordinates["shaft.angle"] == pytest.approx(hip + knee, abs=1e-8)


def test_a_choice_of_independent_coordinates_outlasts_a_reset() -> None:
    model = read_model_text(LEG, "leg.yaml")
    sim = load_scene(model, find_scene(model, None), linearise=True).reset()
    for names in (["hip.angle", "shaft.angle"], ["knee.angle", "shaft.angle"]):
        sim.choose_independent([f"{name}_rate" for name in names])
        sim.reset(coordinates={"hip.angle": 0.1})
        assert list(sim.states)[:2] == names


def test_given_coordinates_beside_assembled_places_keep_the_assembly_too() -> None:
    text = LEG.replace("end: 0.1", "end: 0.1, positions: {hip.angle: -0.6, knee.angle: 1.2}, assemble: {shaft.angle: 0.6}")
    model = read_model_text(text, "leg.yaml")
    sim = load_scene(model, find_scene(model, None)).reset()
    assert sim.coordinates["shaft.angle"] == pytest.approx(0.6, abs=1e-9)


@pytest.mark.parametrize("ratio", [-30, 100])
def test_a_geared_motor_turns_far_to_rest(ratio: float, tmp_path: Path) -> None:
    """The steps of the search were limited by the motor's angle: "no static equilibrium" from a ratio of 10 on."""
    text = f"""
cutjoint: 1
name: geared
gravity: [0, 0, -9.81]
bodies:
  arm: {{mass: 2, centre_of_mass: [0.4, 0, 0], inertia: [0.01, 0.05, 0.05]}}
  motor: {{mass: 0.5, centre_of_mass: [0, 0.2, 0], inertia: [0.0001, 0.0001, 0.0001]}}
joints:
  hinge: {{kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: y}}
  shaft: {{kind: revolute, bodies: [ground, motor], at: [0, 0.2, 0], axis: y}}
gears: {{box: {{joints: [shaft, hinge], ratio: {ratio}}}}}
forces: {{spring: {{kind: joint_force, joint: hinge, law: "-3*(position - 0.1)"}}}}
outputs: [hinge.angle, shaft.angle]
scenes: {{rest: {{end: 0.01, pose: equilibrium}}}}
"""
    run = completed(simulate(compile_text(tmp_path, text)))
    angle = run["hinge.angle"][0]
    assert 2 * 9.81 * 0.4 * np.cos(angle) == pytest.approx(3 * (angle - 0.1), abs=1e-6)
    assert run["shaft.angle"][0] == pytest.approx(ratio * angle, rel=1e-9)
