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

import cutjoint
from cutjoint.cli import main
from cutjoint.fits.design import _HALVINGS, _TRIES, design_experiment
from cutjoint.fits.reading import read_fit
from cutjoint.fits.records import Study
from cutjoint.fits.residuals import Prediction
from cutjoint.package.errors import RunError

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
    """The eigenvalues are those of variational equations that SciPy solves; limits hold in its motion too.
    COBYQA asks for the limits of a place ten times: no place is simulated again."""
    notes: list[str] = []
    study = _study(tmp_path)
    found = design_experiment(study, notes.append)
    runs = max(int(note.split(":")[0].split()[1]) for note in notes if note.startswith("  run "))
    assert runs <= study["design"].get("runs", 300) + _TRIES * _HALVINGS + 2
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
    """Mass, spring, damping and the force's gain grow together.  The table goes back as the input of the experiment, whose file counts
    milliseconds from another time, and the force in kN."""
    study = _study(tmp_path)
    t, push, x = np.loadtxt(tmp_path / "slow.csv", delimiter=",", skiprows=1).T
    columns = np.column_stack([1e3 * (t + 7), push / 1e3, x])
    np.savetxt(tmp_path / "slow.csv", columns, delimiter=",", header="clock,push,x", comments="")
    study["experiments"]["slow"] |= {"time": "clock", "time_unit": "ms", "inputs": {"push": {"unit": "kN"}}}
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


def test_the_file_of_inputs_counts_time_as_the_experiment_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The run begins at the first sample, 7 s, in a file of milliseconds; the inputs come back as they were designed, from its start."""
    study = _study(tmp_path)
    t, push, x = np.loadtxt(tmp_path / "slow.csv", delimiter=",", skiprows=1).T
    np.savetxt(tmp_path / "slow.csv", np.column_stack([1e3 * (t + 7), push, x]), delimiter=",", header="clock,push,x", comments="")
    study["experiments"]["slow"] |= {"time": "clock", "time_unit": "ms", "inputs": {"push": {"unit": "kN"}}}
    study["design"] |= {"inputs": {"push": ["-2 kN", "2 kN"]}, "runs": 1}
    _replace_runs(monkeypatch, lambda count: np.random.default_rng(count).normal(size=(121, 3)))
    found = design_experiment(study, print)
    assert list(found.table) == ["clock", "push"]
    np.savetxt(tmp_path / "inputs.csv", np.column_stack(list(found.table.values())), delimiter=",", header="clock,push", comments="")
    study["experiments"]["slow"]["inputs"]["push"]["data"] = str(tmp_path / "inputs.csv")
    (read,) = read_fit(study).experiments
    table: Any = read.inputs["push"]
    assert table["t"] == pytest.approx(0.01 * np.arange(601), abs=1e-12)
    assert np.abs(table["value"]).max() > 500  # N
    assert table["value"] == pytest.approx(1e3 * found.table["push"], rel=1e-12)


def _replace_runs(monkeypatch: pytest.MonkeyPatch, derivatives: Any) -> None:
    """Runs that end at once, with these derivatives (samples, parameters) of the n-th one, and outputs of zero."""

    class Runs:
        count = 0

        def __init__(self, study: Study, note: Any, sims: Any = None) -> None:
            self.study = study

        def predict(self, theta: Any) -> list[Prediction]:
            Runs.count += 1
            (e,), found = self.study.experiments, derivatives(Runs.count)
            return [Prediction(experiment=e, signal=s, values=np.zeros(len(s.times)), derivatives=found) for s in e.signals]

    for module in ("fit", "design"):
        monkeypatch.setattr(f"cutjoint.fits.{module}.Runs", Runs)


def test_what_no_inputs_determine_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing turns, so that no moment of inertia has an effect."""
    _replace_runs(monkeypatch, lambda count: np.zeros((121, 2)))
    study = _study(tmp_path, parameters={"slider.inertia.1": {}, "slider.inertia.2": {}})
    words = r"design: no inputs determine: slider\.inertia\.1 \+100 %; slider\.inertia\.2 \+100 %; add a signal"
    with pytest.raises(RunError, match=words):
        design_experiment(study, print)


def test_failed_runs_are_no_fault_of_the_limits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(count: int) -> Any:
        if count > 1:  # the first is with the present inputs
            raise RunError(f"step {count} cannot be solved")
        return np.ones((121, 3))

    study = _study(tmp_path)
    for derivatives, words in (
        (fail, r"the runs with all inputs that were tried failed, the last: step 65 cannot be solved"),
        (lambda count: np.ones((121, 3)), "no inputs keep the limits; widen them, or begin further inside them"),
    ):
        _replace_runs(monkeypatch, derivatives)
        study["design"]["limits"] = {"rail.displacement": ["1 mm", "2 mm"]}  # zero is outside
        with pytest.raises(RunError, match=f"design: {words}"):
            design_experiment(study, print)


def test_a_study_without_a_design_is_not_compiled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    study = _study(tmp_path)
    del study["design"]
    with pytest.raises(RunError, match="it has no section design"):
        design_experiment(study, print)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"frequency": "0.25 rad/s"}, ["'0.25 rad/s' counts angles; write Hz"]),
        ({"limits": {"pin.angle_rate": ["-0.5 Hz", "0.5 rad/s"]}}, ["Hz leaves open whether"]),
        ({"inputs": {"push": ["1 N", "2 N"]}}, ["its present value 0 is not between its bounds 1 and 2 N; change one of them"]),
        ({"inputs": {"push": ["2 N", "1 N"]}}, ["its bounds 2 and 1 N enclose nothing"]),
        ({"inputs": {"push": ["1 foo", "2 N"]}}, ["unknown unit 'foo'"]),
        ({"inputs": {"pusch": [0, 1]}, "frequency": "1 kg"}, ["'pusch' is no input of the model", "needs"]),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_design_is_said_once(tmp_path: Path, change: dict[str, Any], words: list[str]) -> None:
    study = _study(tmp_path)
    text = _OSCILLATOR.replace("}}\njoints: {", "}, wheel: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}}\njoints: {\n"
        "  pin: {kind: revolute, bodies: [slider, wheel], at: [0, 0, 0], axis: x}, ")  # fmt: skip
    (tmp_path / "oscillator.yaml").write_text(text)
    study["design"] |= change
    with pytest.raises(cutjoint.ModelError) as said:
        read_fit(study)
    lines = str(said.value).splitlines()
    assert len(lines) == len(words)
    for line, part in zip(sorted(lines), sorted(words), strict=True):
        assert part in line


def test_a_design_needs_a_column_of_times(tmp_path: Path) -> None:
    """Rows that are counted have no times that could be written."""
    study = _study(tmp_path)
    study["experiments"]["slow"] |= {"time": "", "time_unit": "ms"}
    with pytest.raises(cutjoint.ModelError, match="experiment 'slow' has no column of times; write its time"):
        read_fit(study)


def test_a_present_value_at_its_bound_may_be_rounded(tmp_path: Path) -> None:
    study = _study(tmp_path)
    file = tmp_path / "slow.csv"
    file.write_text(file.read_text().replace("\n0.000000000000000000e+00,0.000000000000000000e+00,", "\n0,-1e-17,", 1))
    study["design"]["inputs"]["push"] = ["0 N", "2 N"]
    design = read_fit(study).design
    assert design is not None
    assert design.inputs["push"][1] == -1e-17


@pytest.mark.parametrize(("parameters", "present"), [({}, 3.5), ({"lift": {"start": 5}}, 5.5)])
def test_an_input_that_the_scene_drives_begins_at_its_law(tmp_path: Path, parameters: dict[str, Any], present: float) -> None:
    study = _study(tmp_path, parameters={"stiffness": {}, **parameters})
    scene = "scenes: {driven: {end: 6, output_step: 10 ms, inputs: {push: lift + cos(2*t)/2}}}\n"
    (tmp_path / "oscillator.yaml").write_text(_OSCILLATOR.replace("gain: 1", "gain: 1\n  lift: 3") + scene)
    study["experiments"]["slow"]["inputs"] = {}
    study["design"]["inputs"]["push"] = [0, 6]
    design = read_fit(study).design
    assert design is not None
    assert design.inputs["push"][1] == pytest.approx(present, rel=1e-15)


_ARM = """
cutjoint: 1
name: arm
gravity: [0, 0, -9.81]
parameters: {viscous: {value: 0.1, unit: N*m*s}, dry: {value: 0.2, unit: N*m}}
bodies: {arm: {mass: 2, centre_of_mass: [0.3, 0, 0], inertia: [0.04, 0.05, 0.05]}}
joints: {pin: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: [0, 1, 0]}}
forces: {friction: {kind: joint_force, joint: pin, law: -viscous*rate - dry*tanh(rate/0.1)}}
"""


def test_a_path_has_the_unit_of_its_motion(tmp_path: Path) -> None:
    """Columns in degrees: the path goes back in degrees."""
    (tmp_path / "arm.yaml").write_text(_ARM)
    t = np.arange(0, 4, 0.02)
    angle, rate = np.rad2deg(0.3 * np.sin(0.5 * t)), np.rad2deg(0.15 * np.cos(0.5 * t))
    np.savetxt(tmp_path / "arm.csv", np.column_stack([t, angle, rate]), delimiter=",")
    moved, signals = {"column": 2, "rate": 3, "unit": "deg"}, {"pin.drive": {"column": 2}}
    design = read_fit({
        "cutjoint_fit": 1, "model": str(tmp_path / "arm.yaml"), "parameters": {"viscous": {}},
        "experiments": {"a": {"data": str(tmp_path / "arm.csv"), "time": 1, "motion": {"pin": moved}, "signals": signals}},
        "design": {"experiment": "a", "inputs": {"pin": ["-80 deg", "80 deg"]}},
    }).design  # fmt: skip
    assert design is not None
    _, _, low, high, factor = design.inputs["pin"]
    assert (low / factor, high / factor) == pytest.approx((-80, 80), rel=1e-12)


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
