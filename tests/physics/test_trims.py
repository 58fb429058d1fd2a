"""Trimmed starts: what is found by closed forms and by SciPy, runs that stay there, and answers to wrong requests."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.typing import NDArray
from scipy.optimize import fsolve

from cutjoint import find_equilibrium, find_initial_state, find_modes, find_trim, read_model_text
from cutjoint.analysis.trim_equations import TrimEquations
from cutjoint.cli import main
from cutjoint.compile.c_export import make_standalone
from cutjoint.compile.pipeline import generate
from cutjoint.model.errors import ModelError
from cutjoint.package.errors import CutjointError, RunError
from cutjoint.run.results import Trajectory
from cutjoint.run.run_file import formulated_start, make_trim_problem, require_same_start, trimmed
from cutjoint.run.simulation import simulate
from cutjoint.stepping.load import load_scene
from cutjoint.tasks.batch import simulate_batch
from tests.conftest import DATA, with_heavy
from tests.mechanisms.starts import CRANE, LOADER, MOTORCYCLE
from tests.physics.simulation import compile_model, compile_scene

G = 9.81

MOTOR = """
cutjoint: 1
name: motor
gravity: [0, 0, -9.81]
parameters:
  voltage: {value: 0, unit: V, binding: input}
  length: {value: 0.5, unit: m, binding: param}
bodies:
  bob: {mass: 3, centre_of_mass: [length, 0, 0], inertia: [0.1, 0.1, 0.1, 0, 0, 0]}
joints:
  hinge: {kind: revolute, bodies: [ground, bob], at: [0, 0, 0], axis: [0, 1, 0]}
states:
  current: {start: 0 A, rate: "(voltage - 0.5*current - 5*hinge.angle_rate)/0.01"}
forces:
  motor: {kind: joint_force, joint: hinge, law: 5*current}
scenes:
  held: {end: 1, positions: {hinge.angle: 30 deg}, trim: {find: [voltage, current]}, outputs: [hinge.angle, current.value]}
"""

OIL = """
cutjoint: 1
name: lift
gravity: [0, 0, -9.81]
parameters:
  area: {value: 12, unit: cm^2, binding: param}
  load: {value: 500, unit: kg, binding: param}
bodies:
  load: {mass: load, centre_of_mass: [0, 0, 0.8]}
joints:
  rod: {kind: prismatic, bodies: [ground, load], at: [0, 0, 0.8], axis: z}
forces:
  piston: {kind: joint_force, joint: rod, law: area*(below - above) - 2e4*rate}
states:
  below: {start: 0 bar, rate: "-1.4e9*rod.displacement_rate/(0.1 + rod.displacement)", nominal: 50 bar}
  above: {start: 0 bar, rate: "1.4e9*rod.displacement_rate/(0.5 - rod.displacement)", nominal: 50 bar}
outputs: [rod.displacement, below.value]
scenes:
  held: {end: 1, positions: {rod.displacement: 0.1}, states: {above: 1 bar}, trim: {find: [below]}}
"""

SPRING = """
cutjoint: 1
name: preloaded
gravity: [0, 0, -9.81]
parameters:
  preload: {value: 0, unit: N, binding: param}
bodies:
  mass: {mass: 40, centre_of_mass: [0, 0, 0.5]}
joints:
  way: {kind: prismatic, bodies: [ground, mass], at: [0, 0, 0.5], axis: z}
forces:
  spring:
    {kind: point_spring, bodies: [ground, mass], from: [0, 0, 0], to: [0, 0, 0.5], law: {stiffness: 2000, damping: 5, preload: preload}}
scenes:
  held: {end: 1, positions: {way.displacement: 50 mm}, trim: {find: [preload]}, outputs: [way.displacement, spring.force]}
"""

SLED = """
cutjoint: 1
name: sled
gravity: [0, 0, -9.81]
parameters:
  throttle: {value: 0, binding: input}
  target: {value: 20, unit: m/s, binding: param}
bodies:
  sled: {mass: 300, centre_of_mass: [0, 0, 0]}
joints:
  way: {kind: prismatic, bodies: [ground, sled], at: [0, 0, 0], axis: x}
forces:
  engine: {kind: joint_force, joint: way, law: 900*throttle - 0.7*rate*abs(rate)}
states:
  far: {start: 0 m, rate: way.displacement_rate}
outputs: [way.displacement, way.displacement_rate]
scenes:
  steady:
    end: 1
    trim: {find: [throttle], hold: {way.displacement_rate: target}, unsteady: [far], bounds: {throttle: [0, 1]}}
"""

FIVE_BAR = """
cutjoint: 1
name: five_bar
gravity: [0, 0, -9.81]
parameters:
  preload: {value: 0, unit: N, binding: param}
  moment: {value: 0, unit: N*m, binding: input}
points: {A: [0, 0, 0], B: [-0.2, 0, 0.4], C: [0.3, 0, 0.7], D: [0.8, 0, 0.4], E: [0.6, 0, 0], F: [0.3, 0, 0]}
bodies:
  ab: {mass: 2, centre_of_mass: {midpoint: [A, B]}, inertia: [0.02, 0.02, 0.02, 0, 0, 0]}
  bc: {mass: 3, centre_of_mass: {midpoint: [B, C]}, inertia: [0.03, 0.03, 0.03, 0, 0, 0]}
  cd: {mass: 3, centre_of_mass: {midpoint: [C, D]}, inertia: [0.03, 0.03, 0.03, 0, 0, 0]}
  de: {mass: 2, centre_of_mass: {midpoint: [D, E]}, inertia: [0.02, 0.02, 0.02, 0, 0, 0]}
joints:
  a: {kind: revolute, bodies: [ground, ab], at: A, axis: y}
  b: {kind: revolute, bodies: [ab, bc], at: B, axis: y}
  c: {kind: revolute, bodies: [bc, cd], at: C, axis: y}
  d: {kind: revolute, bodies: [cd, de], at: D, axis: y}
  e: {kind: revolute, bodies: [de, ground], at: E, axis: y}
forces:
  spring: {kind: point_spring, bodies: [ground, bc], from: F, to: C, law: {stiffness: 300, preload: preload}}
  motor: {kind: joint_force, joint: a, law: moment - rate}
scenes:
  held: {end: 1, trim: {find: [preload, moment], hold: {a.angle: 5 deg, spring.length: 0.69 m}}, outputs: [a.angle, b.angle, spring.length]}
"""


def found_by(text: str, **parameters: float) -> dict[str, float]:
    state = find_equilibrium(read_model_text(text, "m.yaml"), parameters=parameters)
    assert state.trim is not None
    assert state.trim.residual < 1e-11
    return dict(state.trim.unknowns)


def run(text: str, **parameters: float) -> Trajectory:
    model = read_model_text(text, "m.yaml")
    artifact = compile_scene(model, next(iter(model.scenes.values())))
    found = simulate(artifact, error=False, parameters=parameters, tolerance=1e-9)
    assert found.failure is None
    return found


def refused(text: str, old: str, new: str) -> str:
    assert old in text
    with pytest.raises((RunError, ModelError)) as error:
        run(text.replace(old, new))
    return str(error.value)


def test_a_current_holds_a_pendulum() -> None:
    """Its torque is that of the weight, m g l cos(angle), and at rest the voltage drops at the resistance."""
    current = -3 * G * 0.5 * np.cos(np.pi / 6) / 5
    assert found_by(MOTOR) == pytest.approx({"voltage": 0.5 * current, "current": current}, rel=1e-12)
    assert found_by(MOTOR, length=1.0)["current"] == pytest.approx(2 * current, rel=1e-12)
    assert np.ptp(run(MOTOR, length=1.0)["hinge.angle"]) < 1e-6


def test_pressures_carry_a_load() -> None:
    below = 1e5 + 500 * G / 12e-4
    assert found_by(OIL) == pytest.approx({"below": below}, rel=1e-12)
    motion = run(OIL)
    assert np.abs(motion["below.value"] - below).max() < 1e-6 * below
    assert np.abs(motion["rod.displacement"] - 0.1).max() < 1e-7


def test_a_preload_lifts_a_mass() -> None:
    """The spring of 2 kN/m pushes with the weight where it is drawn out by 50 mm."""
    assert found_by(SPRING)["preload"] == pytest.approx(-40 * G - 2000 * 0.05, rel=1e-12)
    assert np.abs(run(SPRING)["way.displacement"] - 0.05).max() < 1e-7


def test_throttle_against_drag() -> None:
    """The position and the distance run on at 20 m/s; another speed is a parameter that changes."""
    assert found_by(SLED)["throttle"] == pytest.approx(0.7 * 20**2 / 900, rel=1e-12)
    motion = run(SLED)
    assert np.abs(motion["way.displacement"] - 20 * motion.t).max() < 2e-5
    assert run(SLED, target=30.0)["way.displacement"][-1] == pytest.approx(30, rel=1e-9)
    state = find_equilibrium(read_model_text(SLED, "m.yaml"))
    assert state.trim is not None
    assert state.trim.unsteady == {"far": (pytest.approx(20), "m/s")}


@cache
def five_bar_by_hand() -> NDArray[np.float64]:
    """Preload and moment by virtual work of weights, spring and motor in the plane x z, with angles about y of the links."""
    places = {"A": (0, 0), "B": (-0.2, 0.4), "C": (0.3, 0.7), "D": (0.8, 0.4), "E": (0.6, 0)}
    P = {name: np.array(xz, dtype=float) for name, xz in places.items()}

    def turned(r: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
        return np.array([r[0] * np.cos(angle) + r[1] * np.sin(angle), r[1] * np.cos(angle) - r[0] * np.sin(angle)])

    def points(s: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        b = turned(P["B"] - P["A"], s[0])
        c, d = b + turned(P["C"] - P["B"], s[1]), P["E"] + turned(P["D"] - P["E"], s[3])
        return b, c, d, d + turned(P["C"] - P["D"], s[2])

    def height_energy(s: NDArray[np.float64]) -> float:
        b, c, d, _ = points(s)
        return float(G * (2 * b[1] / 2 + 3 * (b[1] + c[1]) / 2 + 3 * (c[1] + d[1]) / 2 + 2 * d[1] / 2))

    def length(s: NDArray[np.float64]) -> float:
        return float(np.linalg.norm(points(s)[1] - [0.3, 0]))

    def derivatives(f: object, s: NDArray[np.float64]) -> NDArray[np.float64]:
        h = 1e-6
        return np.array([(f(s + h * e) - f(s - h * e)) / (2 * h) for e in np.eye(4)])  # type: ignore[operator]

    def left(z: NDArray[np.float64]) -> list[float]:
        s, force, moment, pulls = z[:4], z[4], z[5], z[6:]
        loop = points(s)[1] - points(s)[3]
        closing = [derivatives(lambda x, i=i: points(x)[1][i] - points(x)[3][i], s) for i in (0, 1)]
        work = derivatives(height_energy, s) + force * derivatives(length, s) - moment * np.eye(4)[0] + pulls @ np.array(closing)
        return [*work, *loop, s[0] - np.radians(5), length(s) - 0.69]

    z = fsolve(left, np.array([0.09, 0, 0, 0, -40, -3, 0, 0]), xtol=1e-10)
    assert np.abs(left(z)).max() < 1e-6
    return np.array([z[4] - 300 * (0.69 - 0.7), z[5]])


def test_a_five_bar_with_its_preload() -> None:
    """SciPy solves the equations by virtual work, with differences of 1e-6."""
    assert [*found_by(FIVE_BAR).values()] == pytest.approx(five_bar_by_hand().tolist(), rel=1e-6)
    motion = run(FIVE_BAR)
    for name in motion.columns:
        assert np.ptp(motion[name]) < 1e-6


def test_batches_trim_each_run() -> None:
    model = read_model_text(SLED, "m.yaml")
    batch = simulate_batch(model, [{"target": 10.0}, {"target": 25.0}])
    assert batch.end["way.displacement"] == pytest.approx([10, 25], rel=1e-9)
    assert batch.end["way.displacement_rate"] == pytest.approx([10, 25], rel=1e-9)


def test_a_start_that_is_frozen() -> None:
    """What exports get: numbers, with which the run is the same."""
    model = read_model_text(SLED, "m.yaml")
    frozen, scene, _ = trimmed(model, model.scenes["steady"], {})
    assert scene.trim is None
    assert float(scene.inputs["throttle"]) == pytest.approx(280 / 900)
    assert simulate(compile_scene(frozen, scene), error=False)["way.displacement"][-1] == pytest.approx(20, rel=1e-9)


def test_exports_say_that_the_start_is_trimmed_once(tmp_path: Path) -> None:
    """At compiling and in the header; a scene without a trim has no such words."""
    model = read_model_text(SLED.replace("scenes:", "scenes:\n  plain: {end: 1}"), "m.yaml")
    headers = {name: make_standalone(generate(model, model.scenes[name], ())).files["sled.h"] for name in ("plain", "steady")}
    assert [name for name, header in headers.items() if "trim was solved once, with the parameters" in header] == ["steady"]
    (tmp_path / "m.yaml").write_text(SPRING)
    said = CliRunner().invoke(main, ["compile", str(tmp_path / "m.yaml"), "--language", "c99", "--out", str(tmp_path / "code")]).output
    assert "the start is trimmed once, with the parameters of the file: preload = -492.4 N" in said


def test_modes_about_a_steady_motion() -> None:
    """Drag 0.7 v|v| slows a disturbance by 2 * 0.7 * 20 / 300 a second; position and distance have zeros."""
    found = find_modes(read_model_text(SLED, "m.yaml"))
    assert found.steady
    assert [mode.eigenvalue for mode in found.modes] == pytest.approx([-28 / 300], rel=1e-6)
    assert found.zeros == 2
    assert find_modes(read_model_text(MOTOR, "m.yaml")).at_rest


def test_another_body_is_free() -> None:
    """A plate hung from three springs, whose attitude is free and found: its weight stretches them alike, m g/(3 k)."""
    text = """
cutjoint: 1
name: plate
gravity: [0, 0, -9.81]
parameters: {tension: {value: 0, unit: N, binding: param}}
points: {A: [1, 0, 0], B: [-0.5, 0.8, 0], C: [-0.5, -0.8, 0], P: [1, 0, 1], Q: [-0.5, 0.8, 1], R: [-0.5, -0.8, 1]}
bodies:
  plate: {mass: 6, centre_of_mass: [0, 0, 0], inertia: [1, 1, 2, 0, 0, 0]}
joints:
  moves: {kind: free, bodies: [plate, ground], at: [0, 0, 0]}
forces:
  one: {kind: point_spring, bodies: [ground, plate], from: P, to: A, law: {stiffness: 1000, preload: tension}}
  two: {kind: point_spring, bodies: [ground, plate], from: Q, to: B, law: {stiffness: 1000, preload: tension}}
  three: {kind: point_spring, bodies: [ground, plate], from: R, to: C, law: {stiffness: 1000, preload: tension}}
outputs: [plate.z, plate.roll, plate.pitch]
scenes:
  hung:
    end: 1
    positions: {moves.attitude: {rotation_vector: [0.1, 0.2, 0]}}
    near: [moves.attitude]
    trim: {find: [tension], hold: {plate.z: 0.02 m}}
"""
    assert found_by(text)["tension"] == pytest.approx(6 * G / 3 + 1000 * 0.02, rel=1e-9)
    motion = run(text)
    assert max(np.ptp(motion[name]) for name in motion.columns) < 1e-6


@pytest.mark.parametrize(
    ("text", "old", "new", "said"),
    [
        (FIVE_BAR, ", spring.length: 0.69 m", "", "m.yaml:24:32: scene 'held': trim: too many unknowns: 'preload', "),
        (FIVE_BAR, "[preload, moment]", "[moment]", "trim: too few unknowns, or conditions that contradict each other: no start meets all "
         "conditions; the nearest has "),
        (FIVE_BAR, "[preload, moment]", "[moment, gain]", "'gain' is none that a start can have; write one of: a.angle, "),
        (MOTOR, "[voltage, current]", "[voltage, length]", "too many unknowns: 'length', 'voltage' and 'current' can change together"),
        (SLED, "[throttle]", "[throttle, way.displacement]", "m.yaml:20:29: scene 'steady': trim: no condition depends on "
         "'way.displacement'; remove it from 'find', or add a condition on what it changes"),
        (MOTOR, "positions: {hinge.angle: 30 deg}, trim: {", "trim: {hold: {bob.z: 0.8 m}, ", "m.yaml:17:18: scene 'held': trim: no start "
         "meets all conditions; the nearest has 'bob.z' = 0.5 in place of 0.8 m; write other values, or begin nearer"),
        (FIVE_BAR, "a.angle: 5 deg", "a.angle: 5 deg, 2*a.angle: 11 deg", "the nearest has 'a.angle' = 5.2"),
        (MOTOR, "[voltage, current]}", "[voltage], hold: {hinge.angle: 20 deg}}", "none of them changes "
         "'hinge.angle' = 30 in place of 20 deg"),
        (SLED, "[0, 1]", "[0, 0.1]", "with 'throttle' = 0.1 at the bound"),
        (SLED, "unsteady: [far], ", "", "'far' changing by "),
        (SPRING, ", binding: param", "", "the parameter 'preload' has binding const; give it 'binding: param'"),
        (SLED, "    end: 1\n", "    end: 1\n    inputs: {throttle: 0.1*t}\n", "the scene's law of the input 'throttle' is no number"),
        (SLED, "    end: 1\n", "    end: 1\n    pose: equilibrium\n", "a trim finds the pose of rest itself; remove 'pose: equilibrium'"),
        (SLED, "{throttle: [0, 1]}", "{target: [0, 1]}", "trim: bounds: 'target' is not to be found; list it under 'find' too"),
        (SLED, "{start: 0 m,", "{start: 0 m, bounds: [2 m, 1 m],", "its bounds do not ascend; write [least, "),
        (SLED, "{start: 0 m,", "{start: 0 m, bounds: [0, 1 s],", "state 'far': "),
        (SLED, "[0, 1]", "[1, 0]", "trim: bounds: those of 'throttle' do not ascend; write [least, largest]"),
    ],
)  # fmt: skip
def test_wrong_requests(text: str, old: str, new: str, said: str) -> None:
    assert said in refused(text, old, new)


def test_states_outside_of_their_bounds_are_not_found() -> None:
    """The voltage of a current of -2.55 A, which the bounds of the current exclude."""
    assert "no start meets all conditions" in refused(MOTOR, "start: 0 A,", "start: 0 A, bounds: [-2.5 A, 2.5 A],")


def test_values_of_what_is_found(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(SLED)
    with pytest.raises(RunError, match="'throttle' is to be found; leave out its value, or take it out of 'find'"):
        simulate(compile_model(tmp_path / "m.yaml"), parameters={"throttle": 0.5})


def test_redundant_values_are_named() -> None:
    text = FIVE_BAR.replace("a.angle: 5 deg", "a.angle: 5 deg, 2*a.angle: 10 deg")
    state = find_equilibrium(read_model_text(text, "m.yaml"))
    assert state.trim is not None
    assert state.trim.redundant == ("a.angle", "2*a.angle")


def test_bounds_of_a_coordinate_that_is_drawn_elsewhere() -> None:
    """Of the two angles at which a current of 1 A balances the weight the bounds choose one, whatever the guess is."""
    text = MOTOR.replace("positions: {hinge.angle: 30 deg}, trim: {find: [voltage, current]}", (
        "positions: {hinge.angle: -0.5}, states: {current: -2 A}, trim: {find: [hinge.angle, voltage], bounds: {hinge.angle: [ENDS]}}"
    ))  # fmt: skip
    angle = np.arccos(5 * 2 / (3 * G * 0.5))
    for ends, sign in (("-80 deg, -10 deg", -1), ("10 deg, 80 deg", 1)):
        assert found_by(text.replace("ENDS", ends))["hinge.angle"] == pytest.approx(sign * angle, rel=1e-9)


def test_sweeps_vary_what_the_start_does_not_follow_from() -> None:
    model = read_model_text(SLED.replace("outputs:", "  spare: {start: 0, rate: -gain*spare}\noutputs:").replace(
        "  target:", "  gain: {value: 1, unit: Hz, binding: param}\n  target:"), "m.yaml")  # fmt: skip
    require_same_start(model, model.scenes["steady"], [])
    with pytest.raises(RunError, match="its start is trimmed once, and follows from the parameter 'target'; use cutjoint batch"):
        require_same_start(model, model.scenes["steady"], ["target"])


SPINNING_BAR = FIVE_BAR.replace(
    "trim: {find: [preload, moment], hold: {a.angle: 5 deg, spring.length: 0.69 m}}",
    "rates: {a.angle_rate: 2}, trim: {find: [e.angle_rate]}",
)


@pytest.mark.parametrize(
    ("text", "scene"),
    [(FIVE_BAR, "held"), (SPINNING_BAR, "held"), (MOTOR, "held"), (CRANE, "slewing"), (LOADER, "hold"), (MOTORCYCLE, "leans")],
)
def test_derivatives_are_exact(text: str, scene: str) -> None:
    """Beside central differences of the conditions, of which each errs by its step squared and rounding over it."""
    model = read_model_text(text, "m.yaml")
    of = formulated_start(model, model.scenes[scene])
    equations = TrimEquations(of, make_trim_problem(model, model.scenes[scene], {}))
    free, sizes = np.flatnonzero(equations._free), equations._sizes
    y = equations.begin + np.where(equations._free, 1e-2 * np.random.default_rng(1).standard_normal(len(sizes)) * sizes, 0)
    evaluated = equations.evaluated(y)
    exact = evaluated.A * evaluated.rows[:, np.newaxis] / evaluated.columns
    steps = 1e-6 * sizes[free, np.newaxis] * np.eye(len(y))[free]
    differences = np.array([(equations.residuals(y + h) - equations.residuals(y - h)) / (2 * h.sum()) for h in steps]).T
    error = np.abs(differences - exact) * sizes[free] / np.maximum(evaluated.rows, 1e-3)[:, np.newaxis]
    assert error.max() < 1e-6


def test_gradients_of_what_is_found() -> None:
    """By closed forms: a current by the arm's length, drag by the speed."""
    motor = find_trim(read_model_text(MOTOR, "m.yaml"), by=["length"])
    assert motor.gradients["length"] == pytest.approx({name: value / 0.5 for name, value in motor.unknowns.items()}, rel=1e-8)
    sled = find_trim(read_model_text(SLED, "m.yaml"), parameters={"target": 15.0}, by=["target"])
    assert sled.gradients["target"] == pytest.approx({"throttle": 2 * 0.7 * 15 / 900}, rel=1e-8)


@pytest.mark.heavy
def test_gradients_of_a_motorcycle_that_leans() -> None:
    """Beside differences of trims."""
    bike = read_model_text(MOTORCYCLE, "m.yaml")
    less, more = (find_trim(bike, scene="leans", parameters={"speed": 15 + x}).unknowns for x in (-0.01, 0.01))
    differences = {name: (more[name] - less[name]) / 0.02 for name in less}
    assert find_trim(bike, scene="leans", by=["speed"]).gradients["speed"] == pytest.approx(differences, rel=1e-4, abs=1e-5)


@pytest.mark.parametrize(
    ("by", "said"), [("voltage", "no gradient by 'voltage'; name a tunable parameter that is given"), ("lenght", "did you mean 'length'?")]
)
def test_gradients_by_what_has_none(by: str, said: str) -> None:
    with pytest.raises(RunError) as error:
        find_trim(read_model_text(MOTOR, "m.yaml"), by=[by])
    assert said in str(error.value)


def test_the_command_prints_gradients(tmp_path: Path) -> None:
    """The drag is 0.7 v|v|; differences of trims agree."""
    (tmp_path / "m.yaml").write_text(SLED)
    command = ["gradient", str(tmp_path / "m.yaml"), "--objective", "start"]
    result = CliRunner().invoke(main, [*command, "--set", "target=15", "--check"])
    assert result.exit_code == 0
    title, _, value, row, deviation = result.output.splitlines()
    assert (title, float(value.split()[0])) == ("found by the trim", pytest.approx(0.7 * 15**2 / 900, rel=1e-5))
    assert (row.split()[0], float(row.split()[1])) == ("target", pytest.approx(2 * 0.7 * 15 / 900, rel=1e-5))
    assert float(deviation.split()[5]) < 1e-8
    words = "scene 'steady': trim: 'throtle' is not under 'find'; did you mean 'throttle'?"
    assert words in CliRunner().invoke(main, [*command, "--output", "throtle"]).output


@pytest.mark.heavy
def test_a_frozen_start_has_no_derivatives() -> None:
    sim = load_scene(model := read_model_text(SLED, "m.yaml"), model.scenes["steady"], linearise=True).reset()
    with pytest.raises(ValueError, match="the start is trimmed once"):
        sim.initial_state_sensitivities([], ["target"])


def test_scenes_without_a_trim() -> None:
    with pytest.raises(RunError, match="scene 'held' has no 'trim'; write one, or use find_equilibrium"):
        find_trim(read_model_text(MOTOR.replace(", trim: {find: [voltage, current]}", ""), "m.yaml"))


FOUR_BAR = """
cutjoint: 1
name: bars
gravity: [0, 0, -9.81]
parameters: {wish: {value: 2, unit: m, binding: param}}
points: {A: [0, 0, 0], B: [0, 0, 0.3], C: [0.8, 0, 0.6], D: [0.7, 0, 0]}
bodies:
  crank: {mass: 1, centre_of_mass: B, inertia: [0.01, 0.01, 0.01]}
  coupler: {mass: 1, centre_of_mass: C, inertia: [0.01, 0.01, 0.01]}
  rocker: {mass: 1, centre_of_mass: {midpoint: [C, D]}, inertia: [0.01, 0.01, 0.01]}
joints:
  a: {kind: revolute, bodies: [ground, crank], at: A, axis: y}
  b: {kind: revolute, bodies: [crank, coupler], at: B, axis: y}
  c: {kind: revolute, bodies: [coupler, rocker], at: C, axis: y, cut: true}
  d: {kind: revolute, bodies: [rocker, ground], at: D, axis: y}
scenes:
  s: {end: 1, SCENE}
"""


def four_bar_by_hand(crank: float) -> tuple[float, float]:
    """The rocker's angle of the joint d, and the height of C, by the intersection of two circles."""
    B, D = 0.3 * np.array([np.sin(crank), np.cos(crank)]), np.array([0.7, 0.0])
    coupler, rocker, along = np.hypot(0.8, 0.3), np.hypot(0.1, 0.6), D - B
    length = np.linalg.norm(along)
    part = (coupler**2 - rocker**2 + length**2) / (2 * length)
    C = B + part * along / length + np.sqrt(coupler**2 - part**2) * np.array([-along[1], along[0]]) / length
    return float(np.arctan2(0.1, 0.6) - np.arctan2(*(C - D))), float(C[1])


def nearest_rates(crank: float, rocker: float) -> tuple[float, float]:
    """The rates that follow from each other next to wanted ones, with the ratio by differences."""
    ratio = (four_bar_by_hand(1e-5)[0] - four_bar_by_hand(-1e-5)[0]) / 2e-5
    rate = (crank + ratio * rocker) / (1 + ratio**2)
    return rate, ratio * rate


@pytest.mark.parametrize(
    ("scene", "said"),
    [
        ("positions: {a.angle: 20 deg, b.angle: 40 deg}", "m.yaml:17:27: scene 's': the loop cannot close from the given coordinates"),
        ("rates: {a.angle_rate: 1, d.angle_rate: 2}", f"the nearest motion has a.angle_rate = {nearest_rates(1, 2)[0]:.6g} in place of 1 "
         f"rad/s and d.angle_rate = {nearest_rates(1, 2)[1]:.6g} in place of 2 rad/s"),
        ("positions: {a.angl: 1}", "m.yaml:17:27: scene 's': positions: the revolute joint 'a' has no 'angl'; did you mean 'angle'?"),
        ("positions: {c.angle: 1}", "m.yaml:17:27: scene 's': positions: the cut joint 'c' has no 'angle'; a cut joint has no positions"),
        ("assemble: {coupler.z: 2 m}", f"m.yaml:17:26: scene 's': assemble: no pose that closes the loops was found with these values; the "
         f"nearest has coupler.z = {np.hypot(0.1, 0.6):.6g} in place of 2 m"),
        ("positions: {a.angle: 0.2}, assemble: {coupler.z: 0.5 m}", f"the nearest has coupler.z = {four_bar_by_hand(0.2)[1]:.6g} in place "
         "of 0.5 m; values wanted: 1, 0 can be chosen there"),
        ("assemble: {crank.x: wish}", "in place of 2 m; write others, or fewer"),
        ("positions: {a.angle: 0.1}, assemble: {2*a.angle: 1}", "m.yaml:17:53: scene 's': assemble: no pose that closes the loops was "
         "found with these values; the nearest has 2*a.angle = 0.2 in place of 1"),
        ("trim: {hold: {a.angle: 20 deg, coupler.z: 0.7 m}}", "m.yaml:17:15: scene 's': trim: too few unknowns, or conditions that "
         "contradict each other: no start meets all conditions; the nearest has 'coupler.z' = "),
        ("trim: {hold: {a.angle: 20 deg, coupler.z: 0.7 m}}", "; with the others met, 'coupler.z' = "
         f"{four_bar_by_hand(np.pi / 9)[1]:.6g} m is possible"),
        ("trim: {hold: {a.angle: 1, d.angle: 1}}", f"; with the others met, 'd.angle' = {four_bar_by_hand(1.0)[0]:.6g} is possible"),
        ("positions: {a.angle: 1}, trim: {hold: {d.angle: 50 deg}}", f"; with the others met, 'd.angle' = "
         f"{np.degrees(four_bar_by_hand(1.0)[0]):.6g} deg is possible"),
        ("trim: {hold: {coupler.z: 2 m}}", " in place of 2 m, the loop of 'c.x' open"),
        ("trim: {find: [d.angle], bounds: {d.angle: [3, 3.1]}}", "with 'd.angle' = 3.1 at the bound; the nearest has "),
    ],
)  # fmt: skip
def test_wrong_starts_of_a_loop(scene: str, said: str) -> None:
    with pytest.raises(CutjointError) as error:
        find_initial_state(read_model_text(FOUR_BAR.replace("SCENE", scene), "m.yaml"))
    assert said in str(error.value)


ROLLING = """
cutjoint: 1
name: rolls
gravity: [0, 0, -9.81]
parameters: {speed: {value: 15, unit: m/s, binding: param}, pull: {value: 0, unit: N, binding: input}}
bodies:
  sledge: {mass: 1, centre_of_mass: [0, 0, 0.31]}
  carrier: {mass: 350, centre_of_mass: [0, 0, 0.31], inertia: [1, 1, 1]}
joints:
  drives: {kind: prismatic, bodies: [ground, sledge], at: [0, 0, 0.31], axis: x}
  heave: {kind: prismatic, bodies: [sledge, carrier], at: [0, 0, 0.31], axis: z}
forces: {tow: {kind: load, body: sledge, at: [0, 0, 0.31], force: [pull, 0, 0]}}
submodels: {wheel: {include: library/wheel_KIND}}
instances:
  w: {use: wheel, connect: {carrier: carrier}, with: {x: 0, y: 0, z: 0.31, MASS: 10, IXX: 1, IYY: 1.5}, properties: FILE}
"""
GUIDED = "scenes: {run: {end: 1, trim: {find: [w.rolling.bearing.angle_rate]}}}"
FREE = """
scenes:
  run:
    end: 1
    positions: {drives.displacement: 0}
    rates: {drives.displacement_rate: speed}
    trim: {find: [pull, w.rolling.bearing.angle_rate]}
"""
#: By kind of wheel: R0, Fz0, Cz, breff, dreff, freff, QSY1 to 4 and the reference speed of its file.
TYRES = {
    "mf52": ("mf52.tir", (0.3168, 4230, 198064.21298115156, 8.15, 0.262, 0.0731, 0.0107, -0.00213, 0.00083, 4.1e-5, 16.4)),
    "mf62": ("library/road_tyre.tir", (0.316, 4000, 210000, 8, 0.25, 0.07, 0.01, 0, 0, 0, 16.7)),
}


HEAVY = (("mf52", -20.0), ("mf62", 40.0), ("mf62", 0.0))


@pytest.mark.parametrize(("kind", "v"), with_heavy([("mf52", 15.0), ("mf62", -0.5), *HEAVY], *HEAVY))
def test_a_wheel_without_torque_rolls(kind: str, v: float) -> None:
    """By the formulas of effective radius and rolling resistance (Pacejka, Tyre and Vehicle Dynamics, 2012, 4.E); at 0 m/s it stands."""
    file, (R0, Fz0, Cz, breff, dreff, freff, q1, q2, q3, q4, v0) = TYRES[kind]
    free, guided = (
        read_model_text(text.replace("KIND", kind).replace("FILE", file), "m.yaml", folder=DATA / "tyres")
        for text in (ROLLING + FREE, ROLLING.replace("axis: x}", "axis: x, guide: speed*t}") + GUIDED)
    )
    found = find_trim(guided, parameters={"speed": v})
    Fz, way = 360 * G, np.sign(v)
    Re = R0 - Fz0 / Cz * (dreff * np.arctan(breff * Fz / Fz0) + freff * Fz / Fz0)
    assert found.unknowns["w.rolling.bearing.angle_rate"] == pytest.approx(v / Re, rel=2e-3, abs=1e-12)
    assert found.states["w.rolling.rolled.value"] == pytest.approx(way, abs=1e-6)
    if v:
        pulled = find_trim(free, parameters={"speed": v})
        q = q1 + q3 * abs(v) / v0 + q4 * (v / v0) ** 4
        assert pulled.unknowns["pull"] == pytest.approx(way * R0 * Fz * q / (R0 - Fz / Cz + way * R0 * Fz / Fz0 * q2), rel=1e-6)
        assert found.states == pytest.approx(dict(pulled.states), rel=1e-6, abs=1e-9)


RESTING = """
cutjoint: 1
name: rest
gravity: [0, 0, -9.81]
bodies:
  mass: {mass: 0.45, centre_of_mass: [0, 0, 1.3], inertia: [1, 1, 1]}
  bob: {mass: 80, centre_of_mass: [5, 0, 1.3], inertia: [1, 1, 1]}
joints:
  slide: {kind: prismatic, bodies: [ground, mass], at: [0, 0, 1], axis: z}
  arm: {kind: revolute, bodies: [ground, bob], at: [4, 0, 1.3], axis: y}
forces:
  foot: {kind: contact, bodies: [ground, mass], at: [0, 0, 0], normal: z, centre: [0, 0, 1.3], radius: 1, force: [0, 0, 1e5*deflection]}
  heel: {kind: contact, bodies: [ground, bob], at: [0, 0, 0], normal: z, centre: [5, 0, 1.3], radius: 1, force: [0, 0, 2e4*deflection]}
scenes: {run: {end: 1, trim: {find: [slide.displacement], hold: {mass.z: 2 m}}}}
"""


def test_a_target_that_the_other_conditions_determine_is_refused_soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """The mass rests on the ground, wherever it is wanted: one search with the target, one without; further ones took 259 evaluations."""
    count, evaluated = [], TrimEquations.evaluated
    monkeypatch.setattr(TrimEquations, "evaluated", lambda self, y: count.append(y) or evaluated(self, y))
    model = read_model_text(RESTING, "m.yaml")
    with pytest.raises(RunError, match=r"no start meets all conditions; the nearest has 'mass\.z' = 1 in place of 2 m"):
        find_equilibrium(model)
    assert len(count) < 60
