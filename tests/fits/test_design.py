"""Designed inputs beside closed forms of an oscillator, and limits beside SciPy's motion."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from cutjoint.cli import main
from cutjoint.fits.design import design_experiment

_MASS, _STIFFNESS, _DAMPING, _NOISE = 2.0, 80.0, 0.6, 1e-3

_OSCILLATOR = f"""
cutjoint: 1
name: oscillator
gravity: [0, 0, -9.81]
parameters:
  push: {{value: 0, unit: N, binding: input}}
  stiffness: {{value: {_STIFFNESS}, unit: N/m}}
  damping: {{value: {_DAMPING}, unit: N*s/m}}
  gain: 1
bodies: {{slider: {{mass: {_MASS}, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}}}}
joints: {{rail: {{kind: prismatic, bodies: [ground, slider], at: [0, 0, 0], axis: x}}}}
forces: {{spring: {{kind: joint_force, joint: rail, law: -stiffness*position - damping*rate + gain*push}}}}
"""


def _study(folder: Path, **more: Any) -> dict[str, Any]:
    """An oscillator that is pushed so slowly that its spring alone resists."""
    (folder / "oscillator.yaml").write_text(_OSCILLATOR)
    t = np.arange(0, 6.001, 0.05)
    push = np.sin(0.5 * t)
    np.savetxt(folder / "slow.csv", np.column_stack([t, push, push / _STIFFNESS]), delimiter=",", header="t,push,x", comments="")
    slow = {
        "data": str(folder / "slow.csv"), "start": {"rail.displacement": 0, "rail.displacement_rate": 0}, "inputs": {"push": {}},
        "signals": {"rail.displacement": {"column": "x", "deviation": "1 mm"}},
    }  # fmt: skip
    design = {
        "experiment": "slow", "inputs": {"push": ["-2 N", "2 N"]}, "frequency": "0.25 Hz", "harmonics": 4, "runs": 40,
        "limits": {"rail.displacement": ["-60 mm", "60 mm"], "rail.displacement_rate": [-0.3, 0.3]},
    }  # fmt: skip
    parameters: dict[str, Any] = {"slider.mass": {}, "stiffness": {}, "damping": {}}
    return {"cutjoint_fit": 1, "model": str(folder / "oscillator.yaml"), "integrator": "rk4", "dt": "10 ms", "parameters": parameters,
            "experiments": {"slow": slow}, "design": design, **more}  # fmt: skip


def _motion(t: Any, push: Any) -> Any:
    """Displacement, rate, and the displacement's derivatives by mass, stiffness and damping as shares of these: variational equations."""

    def f(now: float, y: Any) -> Any:
        x, v, *z = y
        a = (np.interp(now, t, push) - _STIFFNESS * x - _DAMPING * v) / _MASS
        shares = (-_MASS * a, -_STIFFNESS * x, -_DAMPING * v)
        return [v, a, *(w for s, (u, r) in zip(shares, np.reshape(z, (3, 2)), strict=True)
                        for w in (r, (s - _STIFFNESS * u - _DAMPING * r) / _MASS))]  # fmt: skip

    return solve_ivp(f, (0, t[-1]), np.zeros(8), t_eval=t, rtol=1e-9, atol=1e-12, max_step=0.05).y


def _eigenvalue(t: Any, push: Any) -> float:
    y = _motion(t, push)
    jacobian = np.column_stack([y[2], y[4], y[6]])[np.isclose(t / 0.05, np.rint(t / 0.05))] / _NOISE
    return float(np.linalg.eigvalsh(jacobian.T @ jacobian)[0])


def test_designed_inputs_tell_mass_spring_and_damping_apart_within_limits(tmp_path: Path) -> None:
    """The eigenvalues are those of variational equations that SciPy solves; limits hold in its motion too."""
    found = design_experiment(_study(tmp_path), print)
    t, push = found.table["t"], found.table["push"]
    slow = np.arange(0, 6.001, 0.05)
    assert found.before == pytest.approx(_eigenvalue(t, np.interp(t, slow, np.sin(0.5 * slow))), rel=1e-4)
    assert found.after == pytest.approx(_eigenvalue(t, push), rel=1e-4)
    assert found.after > 10 * found.before
    assert np.abs(push).max() <= 2.0
    assert push[0] == pytest.approx(0, abs=1e-12)
    x, v, *_ = _motion(t, push)
    assert np.abs(x).max() <= 0.06
    assert np.abs(v).max() <= 0.3
    assert not found.open


def test_the_command_writes_inputs_that_a_study_takes_and_names_what_none_determines(tmp_path: Path) -> None:
    """Mass, spring, damping and the force's gain grow together.  The table goes back as the input of the experiment."""
    study = _study(tmp_path)
    study["parameters"]["gain"] = {}
    study["design"] |= {"runs": 10, "limits": {}}
    (tmp_path / "study.json").write_text(json.dumps(study))
    done = CliRunner().invoke(main, ["fit", str(tmp_path / "study.json"), "--design", str(tmp_path / "inputs.csv")])
    assert done.exit_code == 0, done.output
    assert "no such inputs determine: slider.mass +100 %, stiffness +100 %, damping +100 %, gain +100 %" in done.output
    after = float(done.output.split("before, ")[-1].split()[0])
    study["experiments"]["slow"]["inputs"]["push"]["data"] = str(tmp_path / "inputs.csv")
    again = design_experiment(study, print)
    assert again.before == pytest.approx(after, rel=1e-3)  # as many digits as are printed
    assert again.after >= again.before * 0.999


_ARM = """
cutjoint: 1
name: arm
gravity: [0, 0, -9.81]
parameters: {viscous: {value: 0.1, unit: N*m*s}, dry: {value: 0.2, unit: N*m}}
bodies: {arm: {mass: 2, centre_of_mass: [0.3, 0, 0], inertia: [0.04, 0.05, 0.05]}}
joints: {pin: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: [0, 1, 0]}}
forces: {friction: {kind: joint_force, joint: pin, law: -viscous*rate - dry*tanh(rate/0.1)}}
"""


@pytest.mark.heavy
def test_a_path_is_designed_for_a_measured_motion(tmp_path: Path) -> None:
    """The torque and its derivatives by hand, of the path's spline."""
    (tmp_path / "arm.yaml").write_text(_ARM)
    t = np.arange(0, 4, 0.02)
    slow = 0.3 * np.sin(0.5 * t)
    np.savetxt(tmp_path / "arm.csv", np.column_stack([t, slow, slow]), delimiter=",", header="t,angle,torque", comments="")
    found = design_experiment({
        "cutjoint_fit": 1, "model": str(tmp_path / "arm.yaml"),
        "parameters": {"arm.mass": {}, "arm.inertia.1": {}, "viscous": {}, "dry": {}},
        "experiments": {"a": {
            "data": str(tmp_path / "arm.csv"), "motion": {"pin": {"column": "angle"}}, "bandwidth": "5 Hz",
            "signals": {"pin.drive": {"column": "torque", "deviation": 0.05}},
        }},
        "design": {"experiment": "a", "inputs": {"pin": ["-1 rad", "1 rad"]}, "runs": 40,
                   "limits": {"pin.drive": [-12, 12], "pin.angle_rate": [-3, 3]}},
    }, print)  # fmt: skip
    path = CubicSpline(found.table["t"], found.table["pin"])
    q, v, a = (path(t, order) for order in range(3))
    columns = np.column_stack([2 * (0.09 * a - 0.3 * 9.81 * np.cos(q)), 0.05 * a, 0.1 * v, 0.2 * np.tanh(v / 0.1)])
    least = np.linalg.eigvalsh(columns.T @ columns / 0.05**2)[0]
    assert found.after == pytest.approx(least, rel=0.02)  # accelerations of two splines with knots every 20 ms
    assert found.after > 1000 * found.before
    assert np.abs(columns.sum(axis=1)).max() <= 12 * 1.01
    assert np.abs(v).max() <= 3 * 1.01
    assert np.abs(q).max() <= 1
    assert not found.open
