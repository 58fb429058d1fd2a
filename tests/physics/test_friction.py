"""Friction by the load of a joint, against closed forms and equations by hand."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cutjoint.compile.options import CompileOptions
from cutjoint.formulate.implicit.equations import formulate_implicit
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.methods import METHODS
from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model_text
from cutjoint.run.failures import FailedRunError
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from cutjoint.tasks.states import find_modes
from cutjoint.topology.build import build_topology
from tests.formulate.test_implicit import verify_tangent
from tests.formulate.test_signals import WithStates
from tests.physics.simulation import compile_model, compile_scene, completed

#: A block of 2 kg: gravity presses it on its slide with 18 N and pulls along it with 8 N.
BLOCK = """
cutjoint: 1
name: block
gravity: [4, 0, -9]
bodies:
  block: {{mass: 2, centre_of_mass: [0, 0, 0]}}
joints:
  slide: {{kind: prismatic, bodies: [ground, block], at: [0, 0, 0], axis: [1, 0, 0]}}
forces:
  rub: {{kind: joint_friction, joint: slide, coefficient: {coefficient}}}
  shake: {{kind: joint_force, joint: slide, law: {shake}}}
outputs: [block.x, block.vx, rub.force, rub.load]
scenes:
  go: {{end: {end}, output_step: 0.1}}
"""

PENDULUM = """
cutjoint: 1
name: pendulum
gravity: [0, 0, -9.81]
bodies:
  bob: {mass: 2, centre_of_mass: [0, 0, -0.5], inertia: [0.01, 0.01, 0.01]}
joints:
  pin: {kind: revolute, bodies: [ground, bob], at: [0, 0, 0], axis: [0, -1, 0]}
forces:
  rub: {kind: joint_friction, joint: pin, coefficient: 0.2, static: 0.3, stribeck_speed: 0.05, radius: 0.05, preload: 3}
outputs: [pin.angle, pin.angle_rate, rub.force, rub.load]
scenes:
  swing: {end: 1.5, output_step: 0.05, rates: {pin.angle_rate: 4}}
"""

#: A flywheel whose weight rests on the thrust bearing of its upright shaft.
FLYWHEEL = """
cutjoint: 1
name: flywheel
gravity: [0, 0, -9.81]
bodies: {wheel: {mass: 4, centre_of_mass: [0, 0, 0.2], inertia: [0.2, 0.2, 0.3]}}
joints: {shaft: {kind: revolute, bodies: [ground, wheel], at: [0, 0, 0], axis: [0, 0, 1]}}
forces: {rub: {kind: joint_friction, joint: shaft, coefficient: 0.2, radius: 0.05, thrust_radius: 0.03}}
outputs: [shaft.angle_rate, rub.force, rub.load]
scenes: {spin: {end: 2, output_step: 0.5, rates: {shaft.angle_rate: 10}}}
"""

#: A uniform rod whose end slides on a line, at an angle of tangent 2: no motion is sure above a coefficient of 4/3.
ROD = """
cutjoint: 1
name: rod
gravity: [0, 0, -9.81]
bodies:
  shoe: {{mass: 1.0e-6, centre_of_mass: [0, 0, 0]}}
  rod: {{mass: 1, centre_of_mass: [{x}, 0, 2], inertia: [1, 5/3, 1]}}
joints:
  slide: {{kind: prismatic, bodies: [ground, shoe], at: [0, 0, 0], axis: [1, 0, 0]}}
  pin: {{kind: revolute, bodies: [shoe, rod], at: [0, 0, 0], axis: [0, 1, 0]}}
forces:
  rub: {{kind: joint_friction, joint: slide, coefficient: {coefficient}}}
outputs: [slide.displacement, rub.load]
scenes:
  slide: {{end: 1.0e-3, output_step: 1.0e-4, rates: {{slide.displacement_rate: 1}}}}
"""

#: A crank, a coupler and a rocker in one plane: moments across their axes and forces along them are of no consequence and so not known.
FOUR_BAR = """
cutjoint: 1
name: four_bar
gravity: [0, 0, -9.81]
bodies:
  crank: {{mass: 1, centre_of_mass: [0, 0, 0.5], inertia: [0.1, 0.1, 0.1]}}
  coupler: {{mass: 1, centre_of_mass: [1, 0, 1], inertia: [0.1, 0.1, 0.1]}}
  rocker: {{mass: 1, centre_of_mass: [2, 0, 0.5], inertia: [0.1, 0.1, 0.1]}}
joints:
  A: {{kind: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: [0, 1, 0]}}
  B: {{kind: revolute, bodies: [crank, coupler], at: [0, 0, 1], axis: [0, 1, 0]}}
  C: {{kind: revolute, bodies: [coupler, rocker], at: [2, 0, 1.2], axis: [0, 1, 0], cut: {cut}}}
  D: {{kind: revolute, bodies: [ground, rocker], at: [2, 0, 0], axis: [0, 1, 0]}}
forces:
  at_A: {{kind: joint_friction, joint: A, coefficient: 0.2, radius: 0.02{more}}}
  at_C: {{kind: joint_friction, joint: C, coefficient: 0.2, radius: 0.02}}
outputs: [A.angle, at_A.load, at_C.load]
scenes:
  swing: {{end: 0.5, output_step: 0.05, rates: {{A.angle_rate: 1}}}}
"""


#: Joints of several kinds one behind the other, closed by a cut joint with a turn and a slide of its own, all with friction.
SPATIAL = """
cutjoint: 1
name: spatial
gravity: [1, 2, -9.81]
bodies:
  a: {mass: 1, centre_of_mass: [0.3, 0.1, 0], inertia: [0.1, 0.2, 0.3]}
  b: {mass: 2, centre_of_mass: [0.8, 0.1, 0.2], inertia: [0.2, 0.2, 0.1]}
  c: {mass: 1.5, centre_of_mass: [1.2, 0.3, 0.2], inertia: [0.1, 0.3, 0.2]}
joints:
  ball: {kind: spherical, bodies: [ground, a], at: [0, 0, 0]}
  cross: {kind: universal, bodies: [a, b], at: [0.6, 0.1, 0], axis: [1, 0, 0], axis_2: [0, 1, 0]}
  tube: {kind: cylindrical, bodies: [b, c], at: [1, 0.2, 0.1], axis: [1, 1, 0]}
  close: {kind: cylindrical, bodies: [ground, c], at: [1.4, 0.3, 0.3], axis: [0, 1, 0.5], cut: true}
forces:
  first: {kind: joint_friction, joint: cross, coordinate: angle_1, coefficient: 0.1, radius: 0.05, arm: 0.3, thrust_radius: 0.04}
  second: {kind: joint_friction, joint: cross, coordinate: angle_2, coefficient: 0.2, radius: 0.03}
  slide: {kind: joint_friction, joint: tube, coordinate: displacement, coefficient: 0.15, arm: 0.2}
  turn: {kind: joint_friction, joint: tube, coordinate: angle, coefficient: 0.1, radius: 0.1, thrust_radius: 0.1}
  shut: {kind: joint_friction, joint: close, coordinate: displacement, coefficient: 0.1, static: 0.2, stribeck_speed: 0.5, arm: 0.4}
  held: {kind: joint_friction, joint: close, coordinate: angle, coefficient: 0.1, radius: 0.05}
scenes:
  go: {end: 1, output_step: 0.1}
"""

#: Methods that have friction, with integrators whose steps are as long as errors allow.
RULES = {"recursive": "dormand-prince", "recursive-newton": "radau5"}


def run(folder: Path, text: str, method: str = "recursive", **settings: float) -> Trajectory:
    path = folder / "model.yaml"
    path.write_text(text, encoding="utf-8")
    return simulate(compile_model(path, method=method), integrator=RULES[method], error=False, **settings)


def test_friction_that_nothing_loads_is_that_of_a_constant_force(tmp_path: Path) -> None:
    """A block of 2 kg on which gravity pulls with 8 N along its slide, and 18 N across it that do not count."""
    text = BLOCK.replace("coefficient: {coefficient}", "coefficient: 1, preload: {coefficient}, carried: false")
    held, slides = (completed(run(tmp_path, text.format(coefficient=x, shake=0, end=1), tolerance=1e-10)).columns for x in (9, 3))
    assert np.abs(held["block.vx"][5:]).max() < 1e-6
    assert slides["block.vx"][-1] - slides["block.vx"][5] == pytest.approx(0.5 * (8 - 3) / 2, abs=1e-9)
    assert slides["rub.force"][-1] == pytest.approx(-3, abs=1e-9)
    assert np.abs(slides["rub.load"] - 3).max() == 0


def test_friction_that_nothing_loads_needs_no_measure_of_a_load(tmp_path: Path) -> None:
    text = BLOCK.replace("coefficient: {coefficient}", "coefficient: 1, preload: 3, arm: 0.1, carried: false").format(shake=0, end=1)
    with pytest.raises(ModelError, match="arm belongs to load-dependent friction"):
        read_model_text(text, "block.yaml")


@pytest.mark.parametrize("method", RULES)
@pytest.mark.parametrize("shake", ["0", "2*sin(20*pi*t)"])
def test_held_block_does_not_creep(tmp_path: Path, shake: str, method: str) -> None:
    columns = completed(run(tmp_path, BLOCK.format(coefficient=1.2, shake=f'"{shake}"', end=20), method, tolerance=1e-10)).columns
    x = columns["block.x"]  # once in each period of the load
    assert np.abs(x[20:] - x[20]).max() < 18e-9
    assert np.abs(columns["rub.load"] - 18).max() < 1e-9


@pytest.mark.parametrize("method", RULES)
def test_sliding_block_has_the_acceleration_of_coulomb(tmp_path: Path, method: str) -> None:
    columns = completed(run(tmp_path, BLOCK.format(coefficient=0.3, shake=0, end=1), method, tolerance=1e-9)).columns
    assert columns["block.vx"][-1] - columns["block.vx"][5] == pytest.approx(0.5 * (4 - 0.3 * 9), abs=1e-6)
    assert columns["rub.force"][-1] == pytest.approx(-0.3 * 18, abs=1e-5)


@pytest.mark.parametrize("method", RULES)
def test_a_block_slides_far_above_its_stribeck_speed(tmp_path: Path, method: str) -> None:
    """At 100 times that speed, where the share of sticking friction is zero."""
    text = BLOCK.format(coefficient="0.3, static: 0.5, stribeck_speed: 0.01", shake=0, end=1)
    text = text.replace("end: 1,", "end: 1, rates: {slide.displacement_rate: 1},")
    columns = completed(run(tmp_path, text, method, tolerance=1e-9)).columns
    assert columns["block.vx"][-1] - columns["block.vx"][5] == pytest.approx(0.5 * (4 - 0.3 * 9), abs=1e-6)


def law(rate: float, s: float) -> tuple[float, float]:
    """Force by load and the rate of s, by hand."""
    v = 0.05 * rate
    g = (0.2 + 0.1 * np.exp(-((v / 0.05) ** 2))) / 0.3
    u = s / g
    w = max(0.0, 2 * u * u - 1)
    a = w * w / (1 + w * w) * (1 + np.tanh(u * v / 1e-5))
    force = -0.05 * 0.3 * g * (u + (1 - u * u) / 2 * np.tanh(v / 0.01))
    return force, v / 1e-4 * (1 - a) / (1 + 4 * a * u * v / 1e-4 * 1e-3)


@pytest.mark.parametrize("method", RULES)
def test_pendulum_follows_equations_by_hand(tmp_path: Path, method: str) -> None:
    def motion(angle: float, rate: float, s: float) -> tuple[float, float, float]:
        force, change = law(rate, s)
        load = 20.0
        for _ in range(12):  # the force by load is at most 0.015 m: this contracts to rounding
            turn = (force * load - 2 * 9.81 * 0.5 * np.sin(angle)) / (0.01 + 2 * 0.25)
            load = 3 + 2 * np.hypot(9.81 * np.cos(angle) + 0.5 * rate**2, 9.81 * np.sin(angle) + 0.5 * turn)
        return turn, change, load

    def derive(t: float, y: np.ndarray) -> list[float]:
        turn, change, _ = motion(*y)
        return [y[1], turn, change]

    done = completed(run(tmp_path, PENDULUM, method, tolerance=1e-10))
    columns = done.columns
    exact = solve_ivp(derive, (0, 1.5), [0, 4, 0], t_eval=done.t, rtol=1e-10, atol=1e-11, method="Radau").y
    assert np.abs(columns["pin.angle"] - exact[0]).max() < 1e-6
    assert np.abs(columns["rub.load"] - [motion(*y)[2] for y in exact.T]).max() < 1e-3
    energy = 0.51 / 2 * columns["pin.angle_rate"] ** 2 - 2 * 9.81 * 0.5 * np.cos(columns["pin.angle"])
    assert energy[-1] < energy[0] - 0.2


@pytest.mark.parametrize(("coefficient", "sign", "stops"), [(1.3, 1, False), (1.4, 1, True), (1.3, -1, False), (1.4, -1, True)])
def test_rod_of_painleve_is_refused_by_name(tmp_path: Path, coefficient: float, sign: int, stops: bool) -> None:
    text = ROD.format(coefficient=coefficient, x=sign)
    if not stops:
        completed(run(tmp_path, text, tolerance=1e-6))
        return
    with pytest.raises(FailedRunError, match=r"'rub'.*the load of the joint"):
        run(tmp_path, text, tolerance=1e-6)


@pytest.mark.parametrize("method", [name for name in METHODS if name not in RULES])
def test_other_methods_refuse_it(method: str) -> None:
    model = read_model_text(BLOCK.format(coefficient=0.3, shake=0, end=1), "block.yaml")
    with pytest.raises(ModelError, match=r"block\.yaml:10:3: force 'rub'.*--method recursive"):
        compile_scene(model, model.scenes["go"], CompileOptions(method=method))


def test_loads_of_a_loop_do_not_depend_on_the_cut(tmp_path: Path) -> None:
    texts = [FOUR_BAR.format(cut=cut, more="") for cut in ("true", "false")]
    runs = [completed(run(tmp_path, text, method, tolerance=1e-9)) for text in texts for method in RULES]
    for other in runs[1:]:
        for name in ("A.angle", "at_A.load", "at_C.load"):
            assert np.abs(runs[0].columns[name] - other.columns[name]).max() < 2e-3 * np.abs(runs[0].columns[name]).max(), name


def test_load_that_redundancy_leaves_open_is_refused(tmp_path: Path) -> None:
    """A moment across the axis of A, in a mechanism whose masses lie beside the plane of its motion."""
    text = FOUR_BAR.format(cut="true", more=", arm: 0.05").replace("[1, 0, 1]", "[1, 0.1, 1]")
    with pytest.raises(ModelError, match=r"force 'at_A'.*redundant equations"):
        run(tmp_path, text)
    with pytest.raises(ModelError, match=r"force 'at_A'.*redundant equations"):
        run(tmp_path, FOUR_BAR.format(cut="true", more=", arm: 0.05").replace("gravity: [0, 0,", "gravity: [0, 1,"))


def test_load_across_a_plane_of_symmetry_is_none(tmp_path: Path) -> None:
    with_arm, without = (completed(run(tmp_path, FOUR_BAR.format(cut="true", more=more), tolerance=1e-9)) for more in (", arm: 0.05", ""))
    assert with_arm.columns["at_A.load"] == pytest.approx(without.columns["at_A.load"], rel=1e-6)


#: All axes across one plane, which leaves loads across it open.
SLIDER_CRANK = """
cutjoint: 1
name: rail
gravity: [0, 0, -9.81]
points: {A: [0, 0, 0], B: [0, 0, 0.1], C: [0.3, 0, 0]}
bodies:
  crank: {mass: 1, centre_of_mass: {midpoint: [A, B]}, inertia: [0.01, 0.01, 0.01]}
  rod: {mass: 0.5, centre_of_mass: {midpoint: [B, C]}, inertia: [0.001, 0.004, 0.004]}
  slider: {mass: 0.8, centre_of_mass: C, inertia: [0.001, 0.001, 0.001]}
joints:
  a: {kind: revolute, bodies: [ground, crank], at: A, axis: y}
  b: {kind: revolute, bodies: [crank, rod], at: B, axis: y}
  c: {kind: revolute, bodies: [rod, slider], at: C, axis: y}
  rail: {kind: prismatic, bodies: [ground, slider], at: C, axis: x}
forces: {drag: {kind: joint_friction, joint: rail, coefficient: 0.3}}
outputs: [slider.x, a.angle, drag.load]
scenes: {run: {end: 0.3, output_step: 0.01, rates: {a.angle_rate: 20}}}
"""


@pytest.mark.parametrize("load", ['force: [0, "where(t < 0.1, 30, 0)", 0]', "force: [0, 30, 0], moving_only: true"])
def test_load_across_the_plane_at_times_is_refused(load: str, tmp_path: Path) -> None:
    side = f"side: {{kind: load, body: slider, at: C, {load}}}, drag:"
    with pytest.raises(ModelError, match=r"force 'drag'.*redundant equations"):
        run(tmp_path, SLIDER_CRANK.replace("drag:", side))


def in_the_plane(angle: float, rate: float, s: float) -> tuple[float, float, float, float]:
    """The crank's acceleration, the bristle's rate, the rail's force and the slider's place, by bodies and pins in the plane of x and z."""
    b = 0.1 * np.array([np.sin(angle), np.cos(angle)])
    rod = np.array([np.sqrt(0.1 - b[1] ** 2), -b[1]])
    turns = np.array([rate, -b[0] * rate / rod[0], 0.0])
    v = b[1] * rate + rod[1] * turns[1]
    rows, gains = np.zeros((8, 9)), np.zeros(8)
    for pin, ends in enumerate((((0, -b / 2, 1),), ((0, b / 2, 1), (1, -rod / 2, -1)), ((1, rod / 2, 1), (2, 0 * rod, -1)))):
        for body, arm, sign in ends:
            rows[2 * pin : 2 * pin + 2, 3 * body : 3 * body + 3] = sign * np.array([[1, 0, arm[1]], [0, 1, -arm[0]]])
            gains[2 * pin : 2 * pin + 2] += sign * turns[body] ** 2 * arm
    rows[6, 7] = rows[7, 8] = 1
    w = max(0.0, 2 * s * s - 1)
    a = w * w / (1 + w * w) * (1 + np.tanh(s * v / 1e-5))
    by_load = -0.3 * (s + (1 - s * s) / 2 * np.tanh(v / 0.01))
    masses = [1, 1, 0.01, 0.5, 0.5, 0.004, 0.8, 0.8, 0.001]
    weight = -9.81 * np.array([0, 1, 0, 0, 0.5, 0, 0, 0.8, 0])
    for side in (1, -1):
        matrix = np.block([[np.diag(masses), rows.T], [rows, np.zeros((8, 8))]])
        matrix[6, 9 + 6] -= side * by_load
        found = np.linalg.solve(matrix, np.concatenate([weight, gains]))
        if side * found[9 + 6] >= 0:
            break
    return found[2], v / 1e-4 * (1 - a) / (1 + 4 * a * s * v / 1e-4 * 1e-3), abs(found[9 + 6]), b[0] + rod[0]


@pytest.mark.parametrize("method", RULES)
def test_plane_slider_crank_follows_equations_of_the_plane(tmp_path: Path, method: str) -> None:
    done = completed(run(tmp_path, SLIDER_CRANK, method, tolerance=1e-9))
    steps = {"t_eval": done.t, "rtol": 1e-8, "atol": 1e-9, "method": "Radau"}
    exact = solve_ivp(lambda t, y: [y[1], *in_the_plane(*y)[:2]], (0, 0.3), [0, 20, 0], **steps).y
    places = np.array([in_the_plane(*y) for y in exact.T])
    assert np.abs(done["a.angle"] - exact[0]).max() < 1e-5
    assert np.abs(done["slider.x"] - places[:, 3]).max() < 1e-6
    assert np.abs(done["drag.load"] - places[:, 2]).max() < 1e-3 * places[:, 2].max()


@pytest.mark.parametrize("text", [PENDULUM, SPATIAL, FOUR_BAR.format(cut="true", more=", arm: 0.05")], ids=["tree", "space", "plane"])
def test_tangent_has_the_change_of_loads(text: str) -> None:
    model = read_model_text(text, "model.yaml")
    start = formulate_recursive(build_topology(model), next(iter(model.scenes.values())), ())
    system = WithStates(formulate_implicit(start, ()), {})
    for seed in range(3):
        assert verify_tangent(system, seed, moves=0.1) > 0


def test_both_methods_have_the_accelerations_of_a_spatial_loop(tmp_path: Path) -> None:
    text = SPATIAL.replace("output_step: 0.1", "output_step: 0.02, outputs: [cross.angle_1, first.load, shut.load]")
    text = re.sub(r"(coefficient|static): ([\d.]+)", lambda found: f"{found[1]}: {0.3 * float(found[2])}", text)
    runs = [completed(run(tmp_path, text, method, end=0.1, tolerance=1e-8)) for method in RULES]
    for name in ("cross.angle_1", "first.load", "shut.load"):
        assert runs[0][name] == pytest.approx(runs[1][name], rel=1e-6, abs=1e-7), name


def test_newtons_method_names_the_friction_by_which_the_rod_jams(tmp_path: Path) -> None:
    completed(run(tmp_path, ROD.format(coefficient=1.3, x=-1), "recursive-newton", tolerance=1e-6))
    with pytest.raises(FailedRunError, match=r"'rub'.*the load of the joint"):
        run(tmp_path, ROD.format(coefficient=1.4, x=-1), "recursive-newton", tolerance=1e-6)


def test_modes_of_a_block_that_sticks(tmp_path: Path) -> None:
    """The bristle is a spring of load times coefficient over the deflection, with its damper; the block may rest anywhere."""
    path = tmp_path / "block.yaml"
    path.write_text(BLOCK.format(coefficient=1.2, shake=0, end=1), encoding="utf-8")
    found = find_modes(path)
    stiffness, damping = 1.2 * 18 / 1e-4, 1.2 * 18 / 2 / 0.01
    s0 = 8 / (1.2 * 18)  # the share of the limit, under the pull of 8 N
    (mode,) = found.modes
    assert mode.eigenvalue == pytest.approx(max(np.roots([2, damping * (1 - s0**2), stiffness]), key=lambda root: root.imag), rel=1e-6)
    assert list(found.rigid_body_modes) == ["slide.displacement"]


@pytest.mark.parametrize("method", ["recursive", "recursive-newton"])
def test_a_thrust_bearing_brakes_by_its_own_radius(method: str, tmp_path: Path) -> None:
    """Its torque is coefficient times weight times thrust radius, whatever the bearing's radius is."""
    found = completed(run(tmp_path, FLYWHEEL, method)).columns
    torque = 0.2 * 4 * 9.81 * 0.03
    np.testing.assert_allclose(found["rub.load"], 4 * 9.81 * 0.03 / 0.05, rtol=1e-9)
    np.testing.assert_allclose(found["rub.force"][1:], -torque, rtol=1e-6)
    np.testing.assert_allclose(found["shaft.angle_rate"][-1], 10 - torque / 0.3 * 2, rtol=2e-3)
