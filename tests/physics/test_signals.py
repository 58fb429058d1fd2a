"""Machines with controllers: laws of forces that read signals, states and other bodies, against equations by hand.

A speed-controlled DC motor is linear, so that the exponential of its matrix is exact.  Two carts that see each other, and a rod between
them that sees the speed of one, are integrated by SciPy.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from cutjoint.analysis.embedding.embed import embed_loops
from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene as compile_code
from cutjoint.export.fmu.archive import make_fmu
from cutjoint.methods import METHODS
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from cutjoint.stepping.load import load_scene
from cutjoint.tasks.states import find_scene_equilibrium, find_scene_modes
from tests.conftest import MODELS, needs_cpp
from tests.fmu.slaves import write
from tests.physics.simulation import compile_scene

MOTOR = """
cutjoint: 1
name: motor
gravity: [0, 0, 0]
parameters:
  wanted: {value: 12, unit: rad/s, binding: input}
  resistance: {value: 0.4, unit: ohm, binding: param}
bodies:
  rotor: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [0.02, 0.02, 0.02]}
joints:
  shaft: {kind: revolute, bodies: [ground, rotor], at: [0, 0, 0], axis: [0, 0, 1]}
forces:
  motor: {kind: joint_force, joint: shaft, law: 0.5*current - 0.01*rate}
states:
  integral: {start: 0 rad, rate: error}
  current: {start: 0 A, rate: (voltage - resistance*current - 0.5*shaft.angle_rate)/0.02}
signals:
  error: wanted - shaft.angle_rate
  voltage: 2*error + 9*integral
outputs: [shaft.angle_rate, motor.force, current.value, integral.value, voltage.value]
scenes:
  run: {end: 1, output_step: 0.05, numerics: {dt: 2.5e-4}}
"""

#: The rates of speed, current and integral by themselves, and by the wanted speed.
MATRIX = np.array([[-0.01 / 0.02, 0.5 / 0.02, 0], [(-2 - 0.5) / 0.02, -0.4 / 0.02, 9 / 0.02], [-1, 0, 0]])
DRIVE = np.array([0, 2 / 0.02, 1]) * 12


@cache
def motor() -> Model:
    return read_model_text(MOTOR, "motor.yaml")


def exact_motor(t: np.ndarray) -> dict[str, np.ndarray]:
    whole = np.zeros((4, 4))
    whole[:3, :3], whole[:3, 3] = MATRIX, DRIVE
    speed, current, integral = np.array([expm(whole * time)[:3, 3] for time in t]).T
    voltage = 2 * (12 - speed) + 9 * integral
    return {"shaft.angle_rate": speed, "current.value": current, "integral.value": integral, "voltage.value": voltage,
            "motor.force": 0.5 * current - 0.01 * speed}  # fmt: skip


CARTS = """
cutjoint: 1
name: carts
gravity: [0, 0, -9.81]
bodies:
  one: {mass: 2, centre_of_mass: [0, 0, 0], inertia: [0.1, 0.1, 0.1]}
  two: {mass: 1, centre_of_mass: [0, 1, 0], inertia: [0.1, 0.1, 0.1]}
joints:
  left: {kind: prismatic, bodies: [ground, one], at: [0, 0, 0], axis: [1, 0, 0]}
  right: {kind: prismatic, bodies: [ground, two], at: [0, 1, 0], axis: [1, 0, 0]}
forces:
  rod: {kind: point_spring, bodies: [one, two], from: [0, 0, 0], to: [0, 1, 0], law: 40*stretch + 3*right.displacement_rate}
  pull: {kind: joint_force, joint: left, law: -20*position + pushed}
  push: {kind: load, body: two, at: [0, 1, 0], force: ["-8*x - heard + 0.2*rod.force", 0, 0]}
states:
  heard: {start: 0.5 N, rate: (pull.force - heard)/0.1}
signals:
  stretch: rod.length - 1
  pushed: 6*two.x - 2*two.vx*one.x + 4*cos(3*t)
outputs: [one.x, two.x, heard.value, pushed.value, stretch.value, rod.force]
scenes:
  run: {end: 1, output_step: 0.05, positions: {left.displacement: 0.3}, rates: {right.displacement_rate: -1}, numerics: {dt: 2.5e-4}}
"""


@cache
def carts() -> Model:
    return read_model_text(CARTS, "carts.yaml")


@cache
def exact_carts(start: tuple[float, ...] = (0.3, 0, 0, -1, 0.5)) -> dict[str, np.ndarray]:
    """By SciPy, from equations by hand."""

    def parts(t: float, y: np.ndarray) -> tuple[float, ...]:
        x1, x2, _, v2, _ = y
        length = np.hypot(x2 - x1, 1)
        external_wrenches = 6 * x2 - 2 * v2 * x1 + 4 * np.cos(3 * t)
        return length - 1, external_wrenches, 40 * (length - 1) + 3 * v2, (x2 - x1) / length

    def derive(t: float, y: np.ndarray) -> list[float]:
        x1, x2, v1, v2, heard = y
        _, external_wrenches, rod, along = parts(t, y)
        pull = -20 * x1 + external_wrenches
        return [v1, v2, (pull + rod * along) / 2, -8 * x2 - heard + 0.2 * rod - rod * along, (pull - heard) / 0.1]

    t = np.linspace(0, 1, 21)
    y = solve_ivp(derive, (0, 1), start, t_eval=t, rtol=1e-12, atol=1e-12).y
    stretch, external_wrenches, rod, _ = parts(t, y)
    return {"one.x": y[0], "two.x": y[1], "heard.value": y[4], "pushed.value": external_wrenches, "stretch.value": stretch,
        "rod.force": rod}


def exact(model: Model) -> dict[str, np.ndarray]:
    return exact_motor(np.linspace(0, 1, 21)) if model.name == "motor" else exact_carts()


def error(run: Trajectory, expected: dict[str, np.ndarray]) -> float:
    """The largest error of all columns, as a share of the largest value of each."""
    assert run.failure is None, str(run.failure)
    return max(float(np.abs(run.columns[name] - values).max() / np.abs(values).max()) for name, values in expected.items())


#: Equal steps of second order are wrong by about rate^3 dt^2/12 a second, with rates up to 60 1/s, which decay.
SECOND = 2e-4
RUNS = {
    "recursive": {"trapezoidal": SECOND, "rk4": 1e-8, "dormand-prince": 1e-6, "dop853": 1e-6},
    "recursive-newton": {"trapezoidal": SECOND, "radau5-fixed": 1e-7, "radau5": 1e-6, "generalised-alpha": SECOND},
    "augmented": {"trapezoidal": SECOND},
    "classical": {"trapezoidal": SECOND},
}


@pytest.mark.parametrize(("method", "integrator"), [(method, integrator) for method, rules in RUNS.items() for integrator in rules])
@pytest.mark.parametrize("make", [motor, carts])
def test_methods_and_integrators(make: object, method: str, integrator: str) -> None:
    model = make()  # type: ignore[operator]
    options = {"tolerance": 1e-9} if integrator in ("dormand-prince", "dop853", "radau5") else {}
    run = simulate(compile_scene(model, model.scenes["run"], CompileOptions(method=method)), integrator=integrator, error=False, **options)
    assert error(run, exact(model)) < RUNS[method][integrator]


@pytest.mark.parametrize(("method", "integrator", "order"), [
    ("recursive", "trapezoidal", 2), ("recursive", "rk4", 4), ("recursive-newton", "radau5-fixed", 5),
    ("recursive-newton", "trapezoidal", 2), ("classical", "trapezoidal", 2),
])  # fmt: skip
def test_integrators_keep_their_order(method: str, integrator: str, order: int) -> None:
    """Half the step leaves a share 2^-order of the error."""
    model, errors = motor(), []
    for dt in (0.01, 0.005):
        scene = replace(model.scenes["run"], numerics=replace(model.scenes["run"].numerics, dt=dt, tolerance=1e-11))
        run = simulate(compile_scene(model, scene, CompileOptions(method=method)), integrator=integrator, error=False)
        errors.append(error(run, exact(model)))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.35)


@pytest.mark.parametrize(("method", "integrator", "order", "digits"), [
    ("recursive", "dormand-prince", 5, (5, 10)), ("recursive", "dop853", 8, (4, 10)), ("recursive-newton", "radau5", 5, (4, 9)),
])  # fmt: skip
@pytest.mark.parametrize("make", [motor, carts])
def test_adaptive_rules_keep_their_order(make: object, method: str, integrator: str, order: int, digits: tuple[int, int]) -> None:
    """Errors fall with that power of the number of steps, which follows the tolerance, or faster: few steps are irregular."""
    model = make()  # type: ignore[operator]
    artifact = compile_scene(model, model.scenes["run"], CompileOptions(method=method))
    runs = [simulate(artifact, integrator=integrator, error=False, tolerance=10.0**-each) for each in range(digits[0], digits[1] + 1)]
    steps, errors = np.log([run.steps for run in runs]), np.log([error(run, exact(model)) for run in runs])
    assert order - 0.4 < -np.polyfit(steps, errors, 1)[0] < 1.2 * order


@needs_cpp
@pytest.mark.parametrize("method", list(METHODS))
def test_generated_code_has_the_motion_of_the_interpreter(method: str) -> None:
    scene, options = carts().scenes["run"], CompileOptions(method=method)
    runs = [simulate(each(carts(), scene, options), integrator="trapezoidal", error=False) for each in (compile_scene, compile_code)]
    for name, column in runs[0].columns.items():
        assert np.abs(column - runs[1].columns[name]).max() < 1e-9, name


IMAGES = """
cutjoint: 1
name: images
gravity: [0, 0, -9.81]
bodies: {hull: {mass: 20, centre_of_mass: [0, 0, 0.5], inertia: [2, 3, 4]}}
joints: {free: {kind: free, bodies: [ground, hull], at: [0, 0, 0.5]}}
submodels:
  fin:
    connectors: [hull]
    parameters: [wish]
    points: {P: [0.3, 0.5, 0.4], Q: [0.3, 0.9, 0.4]}
    bodies: {fin: {mass: 2, centre_of_mass: Q, inertia: [0.1, 0.1, 0.1]}}
    joints: {hinge: {kind: revolute, bodies: [hull, fin], at: P, axis: [1, 0, 0]}}
    forces:
      motor: {kind: joint_force, joint: hinge, law: "-60*position - rate + drive + 2*hull.vz - 3*fin.roll + 40*hull.roll"}
    states: {lag: {start: 1, rate: "8*(1*fin.z - 0.4 + 2*fin.vy + 0.1*hinge.angle_rate - lag)"}}
    signals: {drive: "5*lag + wish + 4*hull.wx"}
    outputs: [hinge.angle, drive.value, fin.x, fin.y, fin.z]
instances:
  left: {use: fin, connect: {hull: hull}, with: {wish: 6*sin(5*lift)}}
  right: {use: fin, connect: {hull: hull}, with: {wish: 6*sin(5*lift)}, mirror: y}
signals: {lift: 1*hull.z}
outputs: [hull.y, hull.roll, hull.yaw]
scenes: {run: {end: 0.5, output_step: 0.05, numerics: {dt: 1.0e-3}}}
"""


@pytest.mark.parametrize("method", list(METHODS))
def test_an_image_moves_as_its_original(method: str) -> None:
    """A machine of two halves stays symmetric, although all laws see more than their own half."""
    model = read_model_text(IMAGES, "images.yaml")
    run = simulate(compile_scene(model, model.scenes["run"], CompileOptions(method=method)), integrator="trapezoidal", error=False)
    assert run.failure is None
    assert np.ptp(run.columns["left.hinge.angle"]) > 0.05
    for name in ("hinge.angle", "drive.value", "fin.x", "fin.z"):
        assert np.abs(run.columns[f"left.{name}"] - run.columns[f"right.{name}"]).max() < 1e-8, name
    assert np.abs(run.columns["left.fin.y"] + run.columns["right.fin.y"]).max() < 1e-8
    for name in ("hull.y", "hull.roll", "hull.yaw"):
        assert np.abs(run.columns[name]).max() < 1e-8, name


@pytest.mark.parametrize("method", list(METHODS))
def test_work_is_that_of_all_forces(method: str) -> None:
    """The kinetic energy grows by the work of laws, whatever these read; the defect is that of the steps."""
    run = simulate(compile_scene(carts(), carts().scenes["run"], CompileOptions(method=method)), integrator="trapezoidal")
    assert run.energy is not None
    assert run.energy.exchanged > 5
    assert run.energy.defect < 1e-5 * run.energy.exchanged


def test_a_scene_begins_with_states_of_its_own() -> None:
    """The motor with a current and an integral from before: the exponential from there."""
    text = MOTOR + "  later: {end: 1, output_step: 0.05, numerics: {dt: 2.5e-4}, states: {current: 3 A, integral: 0.5 rad}}\n"
    model = read_model_text(text, "motor.yaml")
    found = simulate(compile_scene(model, model.scenes["later"], CompileOptions(method="recursive")))
    whole = np.zeros((4, 4))
    whole[:3, :3], whole[:3, 3] = MATRIX, DRIVE
    current = [(expm(whole * time) @ (0, 3, 0.5, 1))[1] for time in found.t]
    plain = simulate(compile_scene(model, model.scenes["run"], CompileOptions(method="recursive")))
    bound = 2 * np.abs(plain["current.value"] - exact_motor(plain.t)["current.value"]).max()
    assert found["current.value"][0] == 3
    assert np.abs(found["current.value"] - current).max() < bound  # the error of the same steps from rest


def test_a_controller_at_rest() -> None:
    """No rate is left: the state has heard of the pull at the time 0."""
    scene = replace(carts().scenes["run"], positions={}, rates={})
    found = find_scene_equilibrium(carts(), scene).values
    x1, x2 = found["one.x"], found["two.x"]
    pull, length = -20 * x1 + 6 * x2 + 4, np.hypot(x2 - x1, 1)
    rod = 40 * (length - 1)
    assert pull + rod * (x2 - x1) / length == pytest.approx(0, abs=1e-6)
    assert -8 * x2 - pull + 0.2 * rod - rod * (x2 - x1) / length == pytest.approx(0, abs=1e-6)


FROM_REST = """
  from_rest:
    {end: 1, output_step: 0.05, pose: equilibrium, rates: {right.displacement_rate: -1}, states: {heard: 0.5 N}, numerics: {dt: 2.5e-4}}
"""


def test_a_state_that_is_given_beside_a_pose_at_rest() -> None:
    """It counts once the pose is found, in which it is at rest, as speeds do."""
    model = read_model_text(CARTS.rstrip() + FROM_REST, "carts.yaml")
    rest = find_scene_equilibrium(model, model.scenes["from_rest"]).values
    assert rest["heard.value"] == pytest.approx(-20 * rest["one.x"] + 6 * rest["two.x"] + 4, abs=1e-6)
    start = (rest["one.x"], rest["two.x"], 0, -1, 0.5)
    run = simulate(compile_scene(model, model.scenes["from_rest"], CompileOptions(method="recursive")), error=False)
    assert error(run, exact_carts(start)) < SECOND


@needs_cpp
def test_a_host_that_starts_at_rest() -> None:
    """A host gives a state as the scene does; the starts of states in a scene that is drawn do not count at rest."""
    model = read_model_text(CARTS.rstrip() + FROM_REST, "carts.yaml")
    rest = find_scene_equilibrium(model, replace(model.scenes["from_rest"], inputs={})).values
    sim = load_scene(model, model.scenes["from_rest"], method="recursive")
    assert float(sim.reset().outputs["heard.value"]) == 0.5
    assert float(sim.reset(speeds={"heard.value": 0.25}).outputs["heard.value"]) == 0.25
    drawn = load_scene(model, replace(model.scenes["run"], positions={}), method="recursive")
    assert float(drawn.reset().outputs["heard.value"]) == 0.5
    assert float(drawn.reset(equilibrium=True).outputs["heard.value"]) == pytest.approx(rest["heard.value"], abs=1e-6)
    assert float(drawn.reset(equilibrium=False).outputs["heard.value"]) == 0.5


def test_modes_are_those_of_the_controlled_motor() -> None:
    model = motor()
    scene = replace(model.scenes["run"], inputs={"wanted": 0})
    found = [mode.eigenvalue for mode in find_scene_modes(model, scene, at=0.0).modes]
    for value in (x for x in np.linalg.eigvals(MATRIX) if x.imag >= 0):
        assert min(abs(value - x) for x in found) < 1e-6 * abs(value), value


@needs_cpp
@pytest.mark.parametrize("method", ["recursive", "recursive-newton"])
def test_a_simulation_that_a_host_holds(method: str) -> None:
    sim = load_scene(motor(), motor().scenes["run"], method=method, linearise=True)
    sim.reset()
    sim.advance(0.5)
    expected = {name: column[10] for name, column in exact(motor()).items()}
    for name, value in expected.items():
        assert float(sim.outputs[name]) == pytest.approx(value, abs=SECOND * max(1, abs(value))), name
    space = sim.linearise()
    assert space.states[-2:] == ("integral.value", "current.value")
    order = [1, 3, 2]  # speed, current, integral
    np.testing.assert_allclose(space.A[np.ix_(order, order)], MATRIX, rtol=0, atol=1e-6)
    assert space.C[space.outputs.index("voltage.value")][order] == pytest.approx([-2, 0, 9])


@needs_cpp
def test_hosts_of_fmus(tmp_path: Path) -> None:
    fmpy = pytest.importorskip("fmpy")
    for kind in ("me", "cs"):
        file = write(make_fmu(motor(), motor().scenes["run"], version=2, kind=kind), tmp_path)
        options = {"fmi_type": "ModelExchange", "relative_tolerance": 1e-10, "record_events": False} if kind == "me" else {}
        table = fmpy.simulate_fmu(str(file), stop_time=1.0, output_interval=0.05, **options)
        for name, values in exact(motor()).items():
            assert np.abs(table[name] - values).max() < SECOND * max(1, np.abs(values).max()), (kind, name)


def controlled_crank() -> Model:
    """A spatial slider-crank, a loop, whose motor sees the rod's turn and the slider, and a spring that hears the motor."""
    text = (MODELS / "slider_crank.yaml").read_text(encoding="utf-8")
    controls = """
forces:
  motor: {kind: joint_force, joint: crank_pin, law: later - 0.05*rate + 0.5*rod.wy - 8*slider.vx*slide.displacement}
  brake: {kind: point_spring, bodies: [ground, rod], from: [0.3, 0.3, 0], to: C, law: 20*(length - 0.2) + 0.2*motor.force + cross.angle_1}
states: {later: {start: 0.3, rate: 5*(wish - later)}}
signals: {wish: 0.1*(7 - crank_pin.angle_rate) + rod.roll}
outputs: [later.value, wish.value, motor.force, brake.force, """
    return read_model_text(text.replace("outputs: [", controls), "crank.yaml")


@pytest.mark.parametrize("method", list(METHODS))
def test_loops_with_controllers_move_alike_by_all_methods(method: str) -> None:
    """Relative and natural coordinates find what laws read in ways of their own; steps of 0.25 ms are of second order."""
    scene = replace(controlled_crank().scenes["turn"], end=0.5)
    runs = [
        simulate(compile_scene(controlled_crank(), scene, CompileOptions(method=each)), integrator=rule, dt=2.5e-4, error=False)
        for each, rule in (("recursive", "rk4"), (method, "trapezoidal"))
    ]
    assert runs[1].failure is None
    for name, column in runs[0].columns.items():
        assert np.abs(column - runs[1].columns[name]).max() < 1e-3 * max(1, np.abs(column).max()), name


def test_functions_that_close_loops_move_what_laws_read() -> None:
    scene = replace(controlled_crank().scenes["turn"], end=0.5)
    model = controlled_crank()
    closed = embed_loops(model, scene).model
    assert closed.embedded_loops
    artifacts = [compile_scene(each, scene) for each in (model, closed)]
    exact, by_functions = (simulate(artifact, integrator="rk4", dt=2.5e-4, error=False) for artifact in artifacts)
    for name, column in exact.columns.items():
        assert np.abs(column - by_functions.columns[name]).max() < 1e-7 * max(1, np.abs(column).max()), name
