"""Derivatives of starts and of modes: beside closed forms, and beside differences of what is found anew."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from tests.conftest import needs_cpp
from tests.standalone.test_run_derivatives import fourth_order
from tests.standalone.test_step_derivatives import loaded

pytestmark = needs_cpp

#: A crank of length a, which stands upright in the design position, a rod from its end to (b, 0), and a slider there.
CRANK = """
cutjoint: 1
name: crank
gravity: [0, 0, -9.81]
parameters: {a: {value: 0.2, unit: m, binding: param}, b: {value: 0.5, unit: m, binding: param}}
bodies:
  arm: {mass: 1, centre_of_mass: [0, 0, 0.1], inertia: [0.01, 0.01, 0.01]}
  rod: {mass: 1, centre_of_mass: [0.25, 0, 0.1], inertia: [0.01, 0.01, 0.01]}
  slider: {mass: 2, centre_of_mass: [b, 0, 0]}
joints:
  pin: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: y}
  knee: {kind: revolute, bodies: [arm, rod], at: [0, 0, a], axis: y}
  wrist: {kind: revolute, bodies: [rod, slider], at: [b, 0, 0], axis: y}
  rail: {kind: prismatic, bodies: [ground, slider], at: [b, 0, 0], axis: x}
outputs: [slider.x, slider.vx]
scenes:
  given: {end: 1, positions: {pin.angle: 0.4}, rates: {pin.angle_rate: 3}}
"""


def slider(angle: float, rate: float, a: complex, b: complex) -> tuple[complex, complex]:
    """Its place and speed: x = a sin + root, root^2 = l^2 - a^2 cos^2, l^2 = a^2 + b^2."""
    sin, cos = np.sin(angle), np.cos(angle)
    root = np.sqrt(a * a * sin * sin + b * b)
    return a * sin + root, rate * (a * cos + a * a * sin * cos / root)


def test_a_loop_closes_by_the_numbers_of_its_points(tmp_path: Path) -> None:
    sim = loaded(CRANK, "crank", integrator="rk4").reset()
    wanted = np.transpose([[x.imag / 1e-30 for x in slider(0.4, 3.0, 0.2 + 1e-30j * (1 - i), 0.5 + 1e-30j * i)] for i in range(2)])
    start = sim.initial_state_sensitivities(["slider.x", "slider.vx"], ["a", "b"])
    assert start.values == pytest.approx(slider(0.4, 3.0, 0.2, 0.5), rel=1e-12)
    assert start.derivatives == pytest.approx(wanted, rel=1e-8)
    sim.choose_independent(["pin.angle_rate"])  # which the scene gives, so that it stays
    assert sim.forward_sensitivities(0, ["slider.x", "slider.vx"], ["a", "b"]).end[1] == pytest.approx(wanted, rel=1e-11)
    assert sim.initial_state_sensitivities([], ["a", "b"]).states == pytest.approx(np.zeros((2, 2)), abs=1e-9)
    sim.step()
    with pytest.raises(ValueError, match="the present state is not the scene's start"):
        sim.initial_state_sensitivities(["slider.x"], ["a"])
    (tmp_path / "crank.yaml").write_text(CRANK, encoding="utf-8")
    done = CliRunner().invoke(main, ["gradient", str(tmp_path / "crank.yaml"), "--objective", "start", "--check", "--integrator", "rk4"])
    assert done.exit_code == 0, done.output
    assert float(re.findall(r"differences: ([\d.e-]+) of the largest", done.output)[0]) < 1e-8


def test_a_start_that_is_found_changes_with_what_it_is_found_by() -> None:
    """The slider is to be at 0.6 m: the angle changes so that it stays there."""
    text = CRANK.replace("positions: {pin.angle: 0.4}, rates: {pin.angle_rate: 3}", "positions: {rail.displacement: 0.1}")
    sim = loaded(text, "crank", integrator="rk4").reset()
    sim.choose_independent(["pin.angle_rate"])
    start = sim.initial_state_sensitivities(["slider.x"], ["a"])
    assert start.derivatives == pytest.approx(np.zeros((1, 1)), abs=1e-9)
    angle, h = sim.coordinates["pin.angle"], 1e-30j
    by_angle = slider(angle, 1.0, 0.2, 0.5)[1]
    by_a = slider(angle, 0.0, 0.2 + h, 0.5)[0].imag / 1e-30
    assert start.states[0, 0] == pytest.approx(-by_a / by_angle, rel=1e-8)


#: A pendulum of a length with a damper, and a mass on a hardening spring.
SWING = """
cutjoint: 1
name: swing
gravity: [0, 0, -g]
parameters:
  g: {value: 9.81, binding: param}
  length: {value: 0.7, unit: m, binding: param}
  c: {value: 0.3, binding: param}
  k: {value: 400, binding: param}
  hard: {value: 3000, binding: param}
  load: {value: 2.5, unit: kg, binding: param}
bodies: {bob: {mass: 1.5, centre_of_mass: [0, 0, -length]}, mass: {mass: load, centre_of_mass: [1, 0, 0]}}
joints:
  pin: {kind: revolute, bodies: [ground, bob], at: [0, 0, 0], axis: y}
  slide: {kind: prismatic, bodies: [ground, mass], at: [1, 0, 0], axis: z}
forces:
  damper: {kind: joint_force, joint: pin, law: -c*rate}
  spring: {kind: joint_force, joint: slide, law: -k*position - hard*position**3}
outputs: [mass.z]
scenes: {rest: {end: 1, pose: equilibrium}}
"""


def eigenvalues(g: complex, length: complex, c: complex, k: complex, hard: complex, load: complex) -> list[complex]:
    """Eigenvalues of the pendulum, s^2 + c/(m l^2) s + g/l = 0, and of the mass where it hangs."""
    sag = -load * g / k
    for _ in range(60):
        sag = sag - (k * sag + hard * sag**3 + load * g) / (k + 3 * hard * sag**2)
    d = c / (2 * 1.5 * length**2)
    return [-d + 1j * np.sqrt(g / length - d * d), 1j * np.sqrt((k + 3 * hard * sag**2) / load)]


def test_a_pendulum_and_a_spring_that_sags(tmp_path: Path) -> None:
    sim = loaded(SWING, "swing", integrator="rk4").reset()
    by, numbers = ["g", "length", "c", "k", "hard", "load"], np.array([9.81, 0.7, 0.3, 400, 3000, 2.5])
    found = sim.eigenvalue_sensitivities(by)
    assert found.values == pytest.approx(np.array(eigenvalues(*numbers)), rel=1e-9, abs=1e-9)
    for i, x in enumerate(numbers):

        def course(change: float, i: int = i) -> np.ndarray:
            given = numbers.copy()
            given[i] += change
            return np.array(eigenvalues(*given))

        wanted = fourth_order(course, 1e-3 * x)
        assert np.abs(found.derivatives[:, i] - wanted).max() < 1e-8 * np.abs(wanted).max(), by[i]
    length, rate = 0.7, found.values[0].imag
    d, by_d = 0.3 / (3 * length**2), -2 * 0.3 / (3 * length**3)
    assert found.frequencies[1][0, 1] == pytest.approx((-9.81 / length**2 - 2 * d * by_d) / (2 * rate) / (2 * np.pi), rel=1e-8)
    (tmp_path / "swing.yaml").write_text(SWING, encoding="utf-8")
    done = CliRunner().invoke(main, ["gradient", str(tmp_path / "swing.yaml"), "--objective", "modes", "--check", "--integrator", "rk4"])
    assert done.exit_code == 0, done.output
    assert "mode 1" in done.output
    assert float(re.findall(r"differences: ([\d.e-]+) of the largest", done.output)[0]) < 1e-6  # poses at rest that are found anew


def test_a_loop_and_a_motion() -> None:
    """About the motion of a crank: the matrices of the same states with another number."""
    sim = loaded(CRANK, "crank", integrator="rk4").reset()
    sim.choose_independent(["pin.angle_rate"])
    here, x = sim.snapshot(), sim.states.array.copy()
    found = sim.eigenvalue_sensitivities(["a"])

    def course(change: float) -> np.ndarray:
        sim.restore(here)
        sim.parameters["a"] = 0.2 + change
        sim.set_states(x)
        values = np.linalg.eigvals(sim.linearise().A)
        sim.restore(here)
        return values[values.imag >= 0][np.argsort(np.abs(values[values.imag >= 0]))]

    wanted = fourth_order(course, 3e-4)
    assert np.abs(found.derivatives[:, 0] - wanted).max() < 1e-7 * np.abs(wanted).max()


#: Masses on springs, two of which are equal; the last is damped as much as it just does not turn.
EQUAL = """
cutjoint: 1
name: equal
gravity: [0, 0, 0]
parameters: {k: {value: 100, binding: param}}
bodies: {a: {mass: 1, centre_of_mass: [0, 0, 0]}, b: {mass: 1, centre_of_mass: [1, 0, 0]}, c: {mass: 4, centre_of_mass: [2, 0, 0]}}
joints:
  left: {kind: prismatic, bodies: [ground, a], at: [0, 0, 0], axis: z}
  right: {kind: prismatic, bodies: [ground, b], at: [1, 0, 0], axis: z}
  other: {kind: prismatic, bodies: [ground, c], at: [2, 0, 0], axis: z}
forces:
  one: {kind: joint_force, joint: left, law: -k*position}
  two: {kind: joint_force, joint: right, law: -100*position}
  three: {kind: joint_force, joint: other, law: -k*position DAMPING}
outputs: [a.z]
scenes: {rest: {end: 1}}
"""


def test_an_eigenvalue_that_repeats_has_none() -> None:
    sim = loaded(EQUAL.replace("DAMPING", ""), "equal", integrator="rk4").reset()
    with pytest.raises(ValueError, match=re.escape("the eigenvalue 0+10j 1/s repeats: it has no derivative; name other modes")):
        sim.eigenvalue_sensitivities(["k"])
    assert sim.eigenvalue_sensitivities(["k"], [0]).derivatives == pytest.approx(np.array([[1j / (2 * np.sqrt(400))]]), rel=1e-9)
    with pytest.raises(KeyError, match="no mode 7: there are 3"):
        sim.eigenvalue_sensitivities(["k"], [7])
    with pytest.raises(ValueError, match=r"the eigenvalue -5\S* 1/s repeats"):
        loaded(EQUAL.replace("DAMPING", "- 40*rate"), "equal", integrator="rk4").reset().eigenvalue_sensitivities(["k"], [0])


def test_a_kink_at_the_pose_has_none() -> None:
    """A damper of the mass that sags has other rates for bump and rebound."""
    law = "-k*position - hard*position**3"
    sim = loaded(SWING.replace(law, f'"where(rate < 0, -30, -90)*rate {law}"'), "swing", integrator="rk4").reset()
    with pytest.raises(ValueError, match="by 'load' there is no derivative: what changes with it jumps or is not smooth at this state"):
        sim.eigenvalue_sensitivities(["load"])
    with pytest.raises(TypeError, match="by: 'k' is one name; give a list"):
        sim.eigenvalue_sensitivities("k")
    with pytest.raises(KeyError, match="no 'lenght'; did you mean 'length'"):
        sim.initial_state_sensitivities(["mass.z"], ["lenght"])
