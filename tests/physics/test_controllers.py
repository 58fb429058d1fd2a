"""Controllers against difference equations: sampled loops whose motion between samples is exact by hand.

A state x' = -a x + b u with u = -k x held over T has the discrete pole e^(-aT) - k b (1 - e^(-aT))/a.  A rotor that a held torque u turns
gains u T/J of speed in a sample, and is then elsewhere by T times the mean of its speeds.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.compile.options import CompileOptions
from cutjoint.methods import METHODS
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.package.errors import RunError
from cutjoint.run.results import Trajectory
from cutjoint.run.run_file import make_run_file
from cutjoint.run.settings import Options
from cutjoint.run.simulation import simulate
from cutjoint.stepping.load import load_scene
from cutjoint.tasks.batch import compile_scene_batch, simulate_batch
from cutjoint.tasks.states import find_scene_equilibrium, find_scene_modes
from tests.conftest import needs_cpp
from tests.physics.simulation import compile_scene

POLE = """
cutjoint: 1
name: pole
gravity: [0, 0, 0]
parameters:
  k: {value: 3, binding: param}
bodies:
  rotor: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [0.02, 0.02, 0.02]}
joints:
  shaft: {kind: revolute, bodies: [ground, rotor], at: [0, 0, 0], axis: [0, 0, 1]}
states:
  level: {start: 1, rate: -2*level + 1.5*loop.u}
controllers:
  loop: {every: 100 ms, signals: {u: -k*level}}
outputs: [loop.u, level.value]
scenes:
  run: {end: 1, output_step: 0.1}
"""

A, B, K, T = 2, 1.5, 3, 0.1


def pole(decay: float) -> float:
    """That of the loop by the decay of the state in an interval."""
    return decay - K * B * (1 - decay) / A


def by_trapezoids(dt: float) -> float:
    return float(((1 - A * dt / 2) / (1 + A * dt / 2)) ** round(T / dt))


@cache
def pole_model() -> Model:
    return read_model_text(POLE, "pole.yaml")


def run(model: Model, method: str = "recursive", **settings: object) -> Trajectory:
    artifact = compile_scene(model, model.scenes["run"], CompileOptions(method=method))
    return simulate(artifact, **settings)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("method", "integrator", "dt", "tolerance", "decay", "within"),
    [
        ("recursive", "dop853", None, 1e-13, math.exp(-A * T), 1e-12),
        ("recursive", "dormand-prince", None, 1e-14, math.exp(-A * T), 1e-11),  # its own error, of many small steps
        ("recursive", "rk4", 1e-3, None, math.exp(-A * T), 1e-12),
        ("recursive", "trapezoidal", 1e-2, 1e-13, by_trapezoids(1e-2), 1e-12),
        ("recursive-newton", "radau5-fixed", 1e-3, None, math.exp(-A * T), 1e-12),
        ("recursive-newton", "radau5", None, 1e-13, math.exp(-A * T), 1e-11),
        ("recursive-newton", "trapezoidal", 1e-2, None, by_trapezoids(1e-2), 1e-12),
        ("augmented", "trapezoidal", 1e-2, None, by_trapezoids(1e-2), 1e-12),
        ("classical", "trapezoidal", 1e-2, None, by_trapezoids(1e-2), 1e-12),
    ],
)  # fmt: skip
def test_a_sampled_loop_has_its_discrete_pole(
    method: str, integrator: str, dt: float | None, tolerance: float | None, decay: float, within: float
) -> None:
    trajectory = run(pole_model(), method, integrator=integrator, dt=dt, tolerance=tolerance)
    level = trajectory.columns["level.value"]
    assert np.abs(level[1:] / level[:-1] - pole(decay)).max() < within
    assert (trajectory.columns["loop.u"] == -K * level).all()


SERVO = """
cutjoint: 1
name: servo
gravity: [0, 0, 0]
parameters:
  wanted: {value: 1, unit: rad, binding: input}
bodies:
  rotor: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [0.02, 0.02, 0.02]}
joints:
  shaft: {kind: revolute, bodies: [ground, rotor], at: [0, 0, 0], axis: [0, 0, 1]}
forces:
  motor: {kind: joint_force, joint: shaft, law: outer.torque}
controllers:
  outer:
    every: 20 ms
    delay: 40 ms
    signals:
      torque: {value: "max(-0.4, min(0.4, 6*error - rest + 4*sum))", start: 0.1}
      error: wanted - shaft.angle
      rest: 0.5*inner.speed
    memory:
      sum: {start: 0 rad, next: "sum + where(abs(6*error) < 5, 0.02*error, 0)"}
  inner:
    every: 5 ms
    offset: 5 ms
    signals: {speed: "0.6*inner.speed + 0.4*shaft.angle_rate + 1e-3*outer.torque"}
outputs: [shaft.angle, shaft.angle_rate, outer.torque, outer.error, outer.sum, inner.speed]
scenes:
  run: {end: 0.5, output_step: 0.0025, inputs: {wanted: 1 + t}, numerics: {dt: 2.5 ms}}
"""


@cache
def servo() -> Model:
    return read_model_text(SERVO, "servo.yaml")


def servo_by_hand(wanted: Callable[[float], float]) -> np.ndarray:
    """The columns at the rows, by the rule in the file's order: at one instant the outer controller first."""
    dt, inertia = 2.5e-3, 0.02
    angle = rate = speed = total = error = 0.0
    torque, waiting, errors, rows = 0.1, [0.1, 0.1], [0.0, 0.0], []
    for i in range(201):
        t = i * dt
        if i % 8 == 0:
            error = wanted(t) - angle
            computed = max(-0.4, min(0.4, 6 * error - 0.5 * speed + 4 * total))
            total = total + (0.02 * error if abs(6 * error) < 5 else 0)
            torque, waiting = waiting[1], [computed, waiting[0]]
            errors = [error, *errors]
        if i >= 2 and (i - 2) % 2 == 0:
            speed = 0.6 * speed + 0.4 * rate + 1e-3 * torque
        rows.append([angle, rate, torque, errors[2], total, speed])
        angle, rate = angle + dt * rate + dt**2 / 2 * torque / inertia, rate + dt * torque / inertia
    return np.array(rows)


@pytest.mark.parametrize("method", ["recursive", "recursive-newton"])
def test_memory_delays_and_the_order_at_one_instant(method: str) -> None:
    """The trapezoidal rule integrates a held torque exactly; 1e-11 is the tolerance of its iteration, often."""
    trajectory = run(servo(), method, tolerance=1e-12)
    columns = np.array([trajectory.columns[o.column] for o in servo().scenes["run"].outputs]).T
    assert np.abs(columns - servo_by_hand(lambda t: 1 + t)).max() < 1e-11


def test_adaptive_steps_end_at_samples() -> None:
    model = servo()
    artifact = compile_scene(model, model.scenes["run"])
    trajectory = simulate(artifact, integrator="dormand-prince", tolerance=1e-10)
    columns = np.array([trajectory.columns[o.column] for o in model.scenes["run"].outputs]).T
    assert np.abs(columns - servo_by_hand(lambda t: 1 + t)).max() < 1e-10


RELAY = """
cutjoint: 1
name: relay
gravity: [0, 0, 0]
bodies:
  rotor: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [0.02, 0.02, 0.02]}
joints:
  shaft: {kind: revolute, bodies: [ground, rotor], at: [0, 0, 0], axis: [0, 0, 1], spring: {stiffness: 0.5}}
forces:
  motor: {kind: joint_force, joint: shaft, law: relay.torque}
controllers:
  relay: {every: 1 ms, signals: {torque: "where(shaft.angle > 0.1, -0.02, where(shaft.angle < -0.1, 0.02, relay.torque))"}}
  notes:
    every: 2 ms
    offset: 1 ms
    signals: {torque: relay.torque}
    memory: {count: {start: 0, next: count + 1}, peak: {start: 0 rad, next: "max(peak, shaft.angle)"}}
outputs: [shaft.angle, shaft.angle_rate, relay.torque, notes.torque, notes.count, notes.peak]
scenes:
  run: {end: 5, output_step: 2.5 ms, rates: {shaft.angle_rate: 1}}
"""


def relay_by_hand() -> np.ndarray:
    """The columns at the rows: harmonic oscillations about the angle of the held torque; the relay is before the notes."""
    stiffness, inertia = 0.5, 0.02
    omega, torque, noted, count, peak, rows = math.sqrt(stiffness / inertia), 0.0, 0.0, 0, 0.0, []
    angle, rate = 0.0, 1.0
    for half in range(10001):
        if half % 2 == 0:
            torque = -0.02 if angle > 0.1 else 0.02 if angle < -0.1 else torque
            if half % 4 == 2:
                noted, count, peak = torque, count + 1, max(peak, angle)
        if half % 5 == 0:
            rows.append([angle, rate, torque, noted, count, peak])
        rest, c, s = torque / stiffness, math.cos(omega * 5e-4), math.sin(omega * 5e-4)
        angle, rate = rest + (angle - rest) * c + rate / omega * s, rate * c - (angle - rest) * omega * s
    return np.array(rows)


@pytest.mark.parametrize("integrator", ["dormand-prince", "dop853"])
def test_samples_that_change_no_force_end_no_step(integrator: str) -> None:
    """A relay switches at a few of 5001 samples, and nothing that moves reads notes: rows within steps have the values of their time."""
    model = read_model_text(RELAY, "relay.yaml")
    trajectory = run(model, integrator=integrator, tolerance=1e-10)
    columns, known = np.array([trajectory.columns[o.column] for o in model.scenes["run"].outputs]).T, relay_by_hand()
    assert 5 < np.count_nonzero(np.diff(known[:, 2])) < 20
    assert (columns[:, 2:5] == known[:, 2:5]).all()
    assert np.abs(columns - known).max() < 1e-8
    assert trajectory.steps < 1000


def test_events_between_samples_that_end_no_step() -> None:
    """A stop of the shaft at 0.15 rad is met by steps that pass samples; where notes read an acceleration, steps end at each of theirs."""
    text = RELAY.replace(
        "controllers:", '  stop: {kind: joint_force, joint: shaft, law: "where(position > 0.15, 40*(0.15 - position), 0)"}\ncontrollers:'
    )
    passing, ending = (
        run(read_model_text(each, "relay.yaml"), integrator="dormand-prince", tolerance=1e-10)
        for each in (text, text.replace("torque: relay.torque}", "torque: relay.torque + 1e-30*rotor.ax}"))
    )
    assert passing.statistics.events == ending.statistics.events > 10
    assert 2 * passing.steps < 2500 <= ending.steps
    for name in ("shaft.angle", "relay.torque", "notes.count", "notes.peak"):
        assert np.abs(passing.columns[name] - ending.columns[name]).max() < 1e-8, name


REACTIONS = """
cutjoint: 1
name: pushed
gravity: [0, 0, -9.81]
bodies:
  block: {mass: 2, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}
joints:
  slide: {kind: prismatic, bodies: [ground, block], at: [0, 0, 0], axis: [1, 0, 0]}
forces:
  drive: {kind: joint_force, joint: slide, law: feel.push - 3*rate}
reactions:
  rail: {joint: slide, axes_of: ground}
controllers:
  feel: {every: 10 ms, signals: {push: "4 + 0.5*block.ax + 0.1*rail.Fz"}}
outputs: [block.ax, block.vx, feel.push]
scenes:
  run: {end: 0.2, output_step: 0.01, numerics: {dt: 1 ms}}
"""


@pytest.mark.parametrize("method", [m.name for m in METHODS.values()])
def test_accelerations_and_reactions_are_those_of_the_values_before(method: str) -> None:
    """The rail carries 2 x 9.81 N, the acceleration is (push - 3 v)/2 with the push that was held until then, at the start none."""
    trajectory = run(read_model_text(REACTIONS, "m.yaml"), method, integrator="trapezoidal", tolerance=1e-12)
    speed, push = trajectory.columns["block.vx"], trajectory.columns["feel.push"]
    before = np.array([0, *push[:-1]])
    assert np.abs(push - (4 + 0.5 * (before - 3 * speed) / 2 + 0.1 * 2 * 9.81)).max() < 1e-9
    assert np.abs(trajectory.columns["block.ax"] - (push - 3 * speed) / 2).max() < 1e-9


LOOP = """
cutjoint: 1
name: driven
gravity: [0, 0, -9.81]
bodies:
  crank: {shapes: [{rod: {from: [0, 0, 0], to: [0.1, 0, 0.2]}, mass: 1}]}
  coupler: {shapes: [{rod: {from: [0.1, 0, 0.2], to: [0.5, 0, 0.4]}, mass: 2}]}
  rocker: {shapes: [{rod: {from: [0.4, 0, 0], to: [0.5, 0, 0.4]}, mass: 1.5}]}
joints:
  pin: {kind: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: [0, 1, 0]}
  knee: {kind: revolute, bodies: [crank, coupler], at: [0.1, 0, 0.2], axis: [0, 1, 0]}
  elbow: {kind: revolute, bodies: [coupler, rocker], at: [0.5, 0, 0.4], axis: [0, 1, 0]}
  foot: {kind: revolute, bodies: [ground, rocker], at: [0.4, 0, 0], axis: [0, 1, 0], cut: true}
forces:
  motor: {kind: joint_force, joint: pin, law: drive.torque}
reactions:
  load: {joint: foot, axes_of: ground}
controllers:
  drive: {every: 10 ms, signals: {torque: "30*(1 + t - pin.angle) - 4*pin.angle_rate + 0.02*load.Fz"}}
outputs: [pin.angle, drive.torque, load.Fz]
scenes:
  run: {end: 0.3, output_step: 0.01}
"""


@cache
def driven_loop() -> tuple[Model, Trajectory]:
    """A loop whose reaction is sampled, and its motion to a tolerance of steps of 1e-11."""
    model = read_model_text(LOOP, "m.yaml")
    return model, run(model, integrator="dormand-prince", tolerance=1e-11)


def distance(found: Trajectory) -> float:
    """The largest difference from the known motion, as a share of the largest value of each column."""
    known = driven_loop()[1].columns
    return max(float(np.abs(found.columns[name] - values).max() / np.abs(values).max()) for name, values in known.items())


@pytest.mark.parametrize("method", [m.name for m in METHODS.values()])
def test_equal_steps_keep_their_order_2_across_samples(method: str) -> None:
    """A fourth of the step has a sixteenth of the error; with accelerations that were not those of the held values, a fourth."""
    model, _ = driven_loop()
    coarse, fine = (distance(run(model, method, integrator="trapezoidal", dt=dt, tolerance=1e-8)) for dt in (1e-3, 2.5e-4))
    assert fine < 1e-4
    assert 12 < coarse / fine < 20


def test_a_controller_by_which_nothing_moves_changes_no_bit() -> None:
    """One that notes where the crank has been, as often as steps are made: accelerations are not found anew for it."""
    noted = 'notes: {every: 1 ms, memory: {peak: {start: 0 rad, next: "max(peak, pin.angle + 1e-3*crank.ax)"}}}'
    text = LOOP.replace("controllers:\n", f"controllers:\n  {noted}\n").replace("outputs: [", "outputs: [notes.peak, ")
    plain, noting = (run(read_model_text(each, "m.yaml"), integrator="trapezoidal", dt=1e-3) for each in (LOOP, text))
    assert noting.columns["notes.peak"][-1] > 0.1
    for name, values in plain.columns.items():
        assert (noting.columns[name] == values).all(), name


def test_diagonally_implicit_steps_have_the_same_motion() -> None:
    assert distance(run(driven_loop()[0], "recursive-newton", integrator="radau5", tolerance=1e-10)) < 1e-6


def test_what_is_held_counts_as_constant() -> None:
    """A stiffness that grows: at 0.25 s that of the sample at 0.2 s holds, at rest that of the start; J = 0.02."""
    text = POLE.replace("states:\n  level: {start: 1, rate: -2*level + 1.5*loop.u}\n", "")
    text = text.replace("controllers:", "forces:\n  spring: {kind: joint_force, joint: shaft, law: -loop.u*position}\ncontrollers:")
    text = text.replace("u: -k*level", "u: {value: 2 + t, start: k}").replace(", level.value", ", shaft.angle")
    model = read_model_text(text, "m.yaml")
    scene = model.scenes["run"]
    for at, stiffness in ((0.25, 2.2), (None, 3.0)):
        (mode,) = find_scene_modes(model, scene, at=at).modes
        assert abs(mode.eigenvalue.imag - math.sqrt(stiffness / 0.02)) < 1e-6
    assert find_scene_equilibrium(model, scene)["loop.u"] == 3.0


def test_equal_steps_that_do_not_divide_an_interval() -> None:
    with pytest.raises(RunError) as caught:
        run(servo(), dt=3e-3)
    assert str(caught.value) == (
        "servo.yaml:29:3: scene 'run': steps of 0.003 s do not divide every, 0.02 s, of the controller 'outer' (line 14); "
        "the nearest steps that do are dt: 0.0025"
    )
    with pytest.raises(RunError, match=r"do not divide every, 0.005 s, of the controller 'inner' \(line 23\); .* dt: 0.005$"):
        run(servo(), dt=2e-2)


def test_a_row_of_many_samples_and_one_of_too_many() -> None:
    """1e5 samples in a row of results: -k of the level that was held over 10 us is that of the loop without sampling to 1e-5."""
    model = read_model_text(POLE.replace("100 ms", "1e-5").replace("output_step: 0.1", "output_step: 1"), "pole.yaml")
    trajectory = run(model, integrator="dormand-prince")
    assert abs(trajectory.columns["level.value"][-1] / math.exp(-A - B * K) - 1) < 1e-3
    with pytest.raises(RunError) as caught:
        run(read_model_text(POLE.replace("100 ms", "1e-9"), "pole.yaml"))
    assert str(caught.value) == (
        "pole.yaml:14:3: controller 'loop': a run of 1 s has more than 1e+08 samples, one each 1e-09 s; write a longer every, or an "
        "earlier end"
    )


def test_an_integrator_of_another_package_that_takes_no_samples() -> None:
    pytest.importorskip("cutjoint_bench")
    words = r"servo.yaml:14:3: the integrator reference does not support sampling, which the controller 'outer' needs; use trapezoidal, "
    with pytest.raises(RunError, match=words):
        make_run_file(servo(), servo().scenes["run"], {}, task="simulate", options=Options(integrator="reference"))


def test_a_value_that_is_not_finite_ends_the_run() -> None:
    text = POLE.replace("u: -k*level", "u: sqrt(0.25 - t)")
    trajectory = run(read_model_text(text, "m.yaml"), check=False, dt=0.05)
    assert trajectory.failure is not None
    assert trajectory.failure.message == "the controller 'loop' (m.yaml:14) computes a value that is not finite"
    assert abs(trajectory.failure.time - 0.3) < 1e-9


@needs_cpp
@pytest.mark.parametrize("method", ["recursive", pytest.param("recursive-newton", marks=pytest.mark.heavy)])
def test_a_simulation_that_a_host_holds_goes_on_bit_by_bit(method: str) -> None:
    """Between samples, at one, and with values that wait; another simulation goes on from there too."""
    model = servo()
    simulation = load_scene(model, model.scenes["run"], method=method)
    simulation.reset()
    snapshots, rows = {}, []
    for i in range(201):
        rows.append(simulation.outputs.array.copy())
        if i in (0, 3, 8, 21):
            snapshots[i] = simulation.snapshot()
        simulation.step()
    assert np.abs(np.array(rows) - servo_by_hand(lambda t: 1 + t)).max() < 1e-11
    other = simulation.copy()
    for i, snapshot in snapshots.items():
        other.restore(snapshot)
        assert other.snapshot() == snapshot
        for row in rows[i:]:
            assert (other.outputs.array == row).all()
            other.step()


@needs_cpp
def test_a_host_that_takes_steps_of_other_lengths_meets_all_samples() -> None:
    """Of inputs that it sets between samples too: 1 until 0.102 s, then 2."""
    model = servo()
    simulation = load_scene(model, model.scenes["run"])
    simulation.reset()
    simulation.set_input("wanted", 1.0)
    simulation.reset()
    simulation.advance(0.102)
    simulation.set_input("wanted", 2.0)
    simulation.advance(0.5)
    known = servo_by_hand(lambda t: 1.0 if t < 0.102 else 2.0)[-1]
    assert np.abs(simulation.outputs.array - known).max() < 1e-11


@needs_cpp
def test_a_state_that_is_set_between_samples_has_the_next_one_next() -> None:
    """The same state again changes nothing: no sample of an earlier time is taken once more."""
    model = servo()
    simulation = load_scene(model, model.scenes["run"])
    simulation.reset()
    simulation.advance(0.05)
    other = simulation.copy()
    other.set_state(simulation.time, simulation.coordinates.array, simulation.speeds.array)
    for each in (simulation, other):
        each.advance(0.2)
    assert np.abs(simulation.outputs.array - other.outputs.array).max() < 1e-11


@needs_cpp
@pytest.mark.heavy
def test_batches_and_studies_have_the_runs_of_the_command_line(tmp_path: Path) -> None:
    model = pole_model()
    artifact = compile_scene_batch(model, model.scenes["run"])
    found = simulate_batch(artifact, [{"k": 2.0}, {"k": 3.0}])
    single = [simulate(artifact.single, parameters={"k": k}) for k in (2.0, 3.0)]  # type: ignore[arg-type]
    for i, trajectory in enumerate(single):
        assert found.end["level.value"][i] == trajectory.columns["level.value"][-1]


@needs_cpp
@pytest.mark.heavy
def test_batches_by_adaptive_steps_meet_samples() -> None:
    """Two controllers with delays and memory, by steps as long as errors allow: each run of a batch is the single one, bit by bit."""
    text = SERVO.replace(", numerics: {dt: 2.5 ms}", "").replace("wanted: 1 + t", "wanted: 1 + k*t")
    text = text.replace("bodies:", "  k: {value: 1, binding: param}\nbodies:", 1)
    model = read_model_text(text, "servo.yaml")
    artifact = compile_scene_batch(model, model.scenes["run"])
    found = simulate_batch(artifact, [{"k": k} for k in (0.5, 1.0, 2.0)])
    for i, k in enumerate((0.5, 1.0, 2.0)):
        single = simulate(artifact.single, parameters={"k": k})  # type: ignore[arg-type]
        for name in ("shaft.angle", "outer.torque", "outer.sum", "inner.speed"):
            assert found.end[name][i] == single[name][-1]
    assert np.ptp(found.end["shaft.angle"]) > 0.01
    known = servo_by_hand(lambda t: 1 + t)[-1][[0, 2]]
    assert [found.end[name][1] for name in ("shaft.angle", "outer.torque")] == pytest.approx(known, abs=1e-6)


def test_arms_with_controllers_of_their_own_go_side_by_side() -> None:
    """Four arms, each with a state and a controller, are one class: an evaluation counts one of them."""
    text = """
cutjoint: 1
name: arms
gravity: [0, 0, -9.81]
submodels:
  arm:
    parameters: [y]
    points: {P: [0, y, 0]}
    bodies: {link: {mass: 1, centre_of_mass: {sum: [P, [0.5, 0, 0]]}, inertia: [0.01, 0.1, 0.1]}}
    joints: {hinge: {kind: revolute, bodies: [ground, link], at: P, axis: y}}
    forces: {motor: {kind: joint_force, joint: hinge, law: pid.u + 0.1*filtered}}
    states: {filtered: {start: 0 rad, rate: (hinge.angle - filtered)/0.05}}
    controllers: {pid: {every: 5 ms, signals: {u: -3*hinge.angle - hinge.angle_rate}}}
instances:
"""
    text += "".join(f"  {name}: {{use: arm, with: {{y: {y}}}}}\n" for y, name in enumerate("abcd")) + "scenes: {run: {end: 1}}\n"
    model = read_model_text(text, "arms.yaml")
    artifact = compile_interpreted(model, model.scenes["run"])
    assert [found.roots for found in artifact.topology.classes] == [("a.link", "b.link", "c.link", "d.link")]
    assert artifact.program.operations("evaluate") == 4 * artifact.program.instructions("evaluate")
    arms = simulate(artifact, error=False)
    assert arms.failure is None
