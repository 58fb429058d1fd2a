"""Fits beside clean runs, a simulator of SciPy, noise of known size, and numbers that data cannot tell apart."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.integrate import solve_ivp

import cutjoint
from cutjoint.cli import main
from cutjoint.fits.reading import read_fit
from cutjoint.model.read import read_model
from tests.conftest import MODELS
from tests.fits.studies import ARM, press_study, write
from tests.physics.simulation import compile_model, completed, simulate


def _run(model: Path, true: dict[str, float], *, dt: float, end: float, every: float) -> tuple[Any, dict[str, Any]]:
    """Times and outputs of a run by rk4 with these numbers, interpreted."""
    artifact = compile_model(model, tunable=[name for name in true if "." in name])
    artifact = replace(artifact, scene=replace(artifact.scene, output_step=every))
    run = completed(simulate(artifact, parameters=true, integrator="rk4", dt=dt, end=end, error=False))
    return run.t, {name.replace(".", "_"): column for name, column in run.columns.items()}


def _press(true: dict[str, float]) -> tuple[Any, dict[str, Any]]:
    """A run of the press with other numbers."""
    return _run(MODELS / "press.yaml", true, dt=1e-3, end=0.6, every=5e-3)


_TRUE = {
    "stiffness": 1700.0, "A.z": 0.11, "B.x": 0.31, "slider.mass": 3.5, "crank.inertia.1": 0.003, "rod.mass": 1.3,
    "spring.law.damping": 14.0, "spring.law.free_length": 0.5,
}  # fmt: skip


def test_clean_data_give_the_numbers_back(tmp_path: Path) -> None:
    t, columns = _press(_TRUE)
    data = write(tmp_path / "d.csv", t, **columns)
    found = cutjoint.fit(press_study(data, _TRUE, {name: {} for name in ("slider.x", "pin.angle", "spring.force")}))
    assert not found.faults
    assert found.iterations <= 10
    for name, value in _TRUE.items():
        assert found[name] == pytest.approx(value, rel=1e-9)


def test_numbers_that_data_cannot_tell_apart_are_named(tmp_path: Path) -> None:
    """A spring's ends and its free length along the rail: one sum alone acts."""
    t, columns = _press({"stiffness": 1700.0})
    data = write(tmp_path / "d.csv", t, **columns)
    found = cutjoint.fit(press_study(data, ["stiffness", "C.x", "spring.law.free_length"], {"slider.x": {}}))
    assert found.verdict == "not identified"
    assert found.status == 4
    (combination,) = found.before.open
    assert set(combination) == {"C.x", "spring.law.free_length"}
    assert combination["C.x"] * 0.8 == pytest.approx(combination["spring.law.free_length"] * 0.48, abs=1e-3)
    assert found["stiffness"] == pytest.approx(1700.0, rel=1e-8)
    assert found["C.x"] - found["spring.law.free_length"] == pytest.approx(0.8 - 0.48, abs=1e-9)


@cache
def _falls() -> Any:
    """From its drawn pose, for the experiments that differ in noise alone."""
    return _scipy_pendulum(np.arange(0.0, 1.5, 0.01), mass=2.0, inertia=0.08, friction=0.3, angle=0.0, rate=0.0)


def _scipy_pendulum(t: Any, *, mass: float, inertia: float, friction: float, angle: float, rate: float) -> Any:
    """About y, a centre at r = 0.3 m falls with m g r cos(angle)."""
    total = inertia + mass * 0.09

    def f(_: float, x: Any) -> Any:
        return [x[1], (mass * 9.81 * 0.3 * np.cos(x[0]) - friction * x[1]) / total]

    return solve_ivp(f, (0, t[-1]), [angle, rate], t_eval=np.clip(t, 0, t[-1]), rtol=1e-12, atol=1e-13).y[0]


def _arm_study(tmp_path: Path, data: str, **signal: Any) -> dict[str, Any]:
    (tmp_path / "arm.yaml").write_text(ARM)
    return {
        "cutjoint_fit": 1, "model": str(tmp_path / "arm.yaml"), "integrator": "dop853", "dt": "2 ms",
        "parameters": {
            "friction": {}, "arm.inertia.1": {}, "angle": {"start": "2 deg"}, "lag": {"start": "1 ms"},
            "zero": {"start": "0 deg"}, "scale": {"start": 1.0},
        },
        "experiments": {"drop": {
            "data": data, "start": {"pin.angle": "angle", "pin.angle_rate": -0.3},
            "signals": {"pin.angle": {"column": "encoder", "unit": "deg", "delay": "lag", "bias": "zero", "gain": "scale", **signal}},
        }},
    }  # fmt: skip


def test_numbers_that_no_model_has_are_in_the_units_of_their_starts(tmp_path: Path) -> None:
    study = _arm_study(tmp_path, write(tmp_path / "d.csv", np.arange(3.0), encoder=np.zeros(3)))
    study["parameters"]["rate"] = {"start": "3 rpm"}
    study["experiments"]["drop"]["start"]["pin.angle_rate"] = "rate"
    units = {p.name: p.unit for p in read_fit(study).parameters}
    assert [units[name] for name in ("angle", "zero", "rate", "lag", "scale")] == ["rad", "rad", "rad/s", "s", ""]


def test_a_start_of_no_coordinate_is_named_and_bounds_that_hold_are_said(tmp_path: Path) -> None:
    t, said = np.arange(0.0, 0.5, 0.01), list[str]()
    data = write(tmp_path / "d.csv", t, encoder=_scipy_pendulum(t, mass=2.0, inertia=0.08, friction=0.3, angle=0.1, rate=0.0))
    study = _arm_study(tmp_path, data)
    study["parameters"] = {"friction": {"to": 0.2}, "arm.inertia.1": {"start": 0.08, "from": 0.079, "to": 0.081}}
    drop = study["experiments"]["drop"] = {"data": data, "start": {"pin.angel": 0.1}, "signals": {"pin.angle": {"column": "encoder"}}}
    with pytest.raises(cutjoint.CutjointError, match=r"experiment 'drop': start: no 'pin.angel'; did you mean 'pin.angle'"):
        cutjoint.fit(study)
    drop["start"] = {"pin.angle": 0.1, "pin.angle_rate": 0.0}
    cutjoint.fit(study, note=said.append)
    assert "friction ends at its bound" in said


def test_data_of_another_simulator_with_unknown_start_delay_gain_and_bias(tmp_path: Path) -> None:
    """The file is in degrees, begins at 7 s, and lacks samples; samples are off the steps by the delay."""
    t = np.arange(0.05, 2.0, 0.01)
    lag, zero, scale = 0.0137, np.radians(0.4), 1.02
    angle = _scipy_pendulum(np.concatenate([[0.0], t - lag]), mass=2.0, inertia=0.08, friction=0.3, angle=0.05, rate=-0.3)[1:]
    lines = [f"{7 + x - 0.05:.17g},{np.degrees(scale * a + zero):.17g}" for x, a in zip(t, angle, strict=True)]
    lines[7] = lines[7].split(",")[0] + ","
    (tmp_path / "d.csv").write_text("\n".join(["t,encoder", *lines]) + "\n")
    study = _arm_study(tmp_path, str(tmp_path / "d.csv"))
    study["experiments"]["drop"]["from"] = 6.95
    found = cutjoint.fit(study)
    assert found.signals[0].missing == 1
    true = {"friction": 0.3, "arm.inertia.1": 0.08, "angle": 0.05, "lag": lag, "zero": zero, "scale": scale}
    for name, value in true.items():
        assert found[name] == pytest.approx(value, abs=1e-6), name


def _noisy(tmp_path: Path, seed: int) -> cutjoint.Fit:
    t = np.arange(0.0, 1.5, 0.01)
    rng, angle = np.random.default_rng(seed), _falls()
    data = write(tmp_path / f"{seed}.csv", t, encoder=np.degrees(angle + 0.01 * np.std(angle) * rng.normal(size=len(t))))
    study = _arm_study(tmp_path, data)
    study["parameters"] = {name: {} for name in ("friction", "arm.inertia.1")}
    study["experiments"]["drop"] = {"data": data, "signals": {"pin.angle": {"column": "encoder", "unit": "deg"}}}
    return cutjoint.fit(study)


@pytest.mark.parametrize("sets", [10, pytest.param(200, marks=pytest.mark.heavy)])
def test_intervals_cover_the_truth_in_95_of_100(tmp_path: Path, sets: int) -> None:
    covered = []
    for seed in range(sets):
        found = _noisy(tmp_path, seed)
        covered += [low <= true <= high for true, (low, high) in zip((0.3, 0.08), found.intervals, strict=True)]
        assert found.verdict in ("identified", "residual not white")
    assert abs(np.mean(covered) - 0.95) <= 2 * np.sqrt(0.95 * 0.05 / sets)


def test_the_command_writes_the_model_with_its_comments(tmp_path: Path) -> None:
    t = np.arange(0.0, 1.5, 0.01)
    angle = _scipy_pendulum(t, mass=2.0, inertia=0.08, friction=0.3, angle=0.0, rate=0.0)
    data = write(tmp_path / "d.csv", t, pin_angle=angle)
    study = _arm_study(tmp_path, data)
    study["parameters"] = {"friction": {"from": 0.0, "to": 1.0}, "arm.inertia.1": {"prior": {"mean": 0.08, "deviation": 0.01}}}
    run = {"data": data, "signals": {"pin.angle": {}}}
    study["experiments"] = {"a": {**run, "to": 1.0}, "b": {**run, "validation": True}}
    (tmp_path / "study.yaml").write_text(json.dumps(study))
    model, page, out = (tmp_path / name for name in ("new.yaml", "page.html", "fit.json"))
    done = CliRunner().invoke(main, ["fit", str(tmp_path / "study.yaml"), "--out", str(out), "--model", str(model), "--view", str(page)])
    assert done.exit_code == 0, done.output
    reported = json.loads(out.read_text())
    assert reported["verdict"] == "identified"
    assert reported["signals"][1]["validation"]
    assert reported["signals"][1]["rms"] < 1e-8
    written = model.read_text()
    assert "# of the bearing" in written
    assert "# as drawn" in written
    new = {p.name: p.value for p in read_model(model, tunable=["arm.inertia.1"]).parameters}
    assert new == pytest.approx({"friction": 0.3, "arm.inertia.1": 0.08}, rel=1e-7)
    assert page.read_text().count("<img") == 4


def test_coloured_residuals_are_a_verdict(tmp_path: Path) -> None:
    t = np.arange(0.0, 1.5, 0.01)
    angle = _scipy_pendulum(t, mass=2.0, inertia=0.08, friction=0.3, angle=0.0, rate=0.0) + 1e-3 * np.sin(40 * t)
    study = _arm_study(tmp_path, data := write(tmp_path / "d.csv", t, pin_angle=angle))
    study["parameters"] = {"friction": {}}
    study["experiments"] = {"a": {"data": data, "signals": {"pin.angle": {}}}}
    assert cutjoint.fit(study).status == 5


def test_a_whole_inertia_stays_physical(tmp_path: Path) -> None:
    """Whatever the ten numbers are, moments are those of a mass distribution, and at zero they are the model's."""
    from cutjoint.fits.inertias import tie_inertia
    from cutjoint.model.records import Span

    known = {"b.mass": 2.0, **{f"b.centre_of_mass.{a}": x for a, x in zip("xyz", (0.1, -0.2, 0.3), strict=True)},
             **{f"b.inertia.{i}": x for i, x in enumerate((0.03, 0.04, 0.02, 0.001, -0.002, 0.003))}}  # fmt: skip
    parameters, ties = tie_inertia("b", known, Span(file="", line=1, column=1))
    symbols = [p.symbol for p in parameters]
    for name, value in ties.items():
        assert float(value.subs(dict.fromkeys(symbols, 0))) == pytest.approx(known[name], rel=1e-12)
    rng = np.random.default_rng(0)
    for _ in range(5):
        at = dict(zip(symbols, rng.normal(size=10), strict=True))
        xx, yy, zz, xy, xz, yz = (float(ties[f"b.inertia.{i}"].subs(at)) for i in range(6))
        moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        assert moments[0] > 0
        assert moments[2] < moments[0] + moments[1]
        assert float(ties["b.mass"].subs(at)) > 0


def test_an_inertia_of_three_numbers_has_six_in_a_fit(tmp_path: Path) -> None:
    from cutjoint.fits.reading import _read_tunable
    from cutjoint.fits.writing import rewrite_model

    (tmp_path / "arm.yaml").write_text(ARM)
    model = _read_tunable(tmp_path / "arm.yaml", ["arm.*", "friction", "k"], ["arm"])
    assert "inertia: [0.04, 0.05, 0.05, 0, 0, 0]}  # as drawn" in rewrite_model(model, {})
    assert "arm.inertia.5" in {p.name for p in model.parameters}
    assert "inertia: [0.04, 0.05, 0.05, 0, 0, 0.01]}" in rewrite_model(model, {"arm.inertia.5": 0.01})


def test_a_narrow_prior_leaves_nothing_else_open() -> None:
    from cutjoint.fits.fit import identify

    jacobian = np.vstack([np.random.default_rng(0).normal(size=(500, 2)), [1e9, 0.0]])
    found = identify(jacobian, ["known", "fitted"], np.ones(2), 500)
    assert (found.open, found.nearly_open, found.collinear) == ((), (), ())


def test_a_linkage_is_calibrated_from_poses_alone(tmp_path: Path) -> None:
    """The slider of the press by trigonometry: crank length and the encoder's zero."""
    angle = np.linspace(-0.9, 0.9, 15)
    length, zero = 0.12, 0.03
    rod = np.hypot(0.3, length)
    x = length * np.sin(angle) + np.sqrt(rod**2 - (length * np.cos(angle)) ** 2)
    data = write(tmp_path / "d.csv", angle, encoder=angle - zero, x=x)
    study = press_study(data, ["A.z"], {"slider.x": {"column": "x"}})
    study["parameters"]["zero"] = {"start": "0 deg"}
    study["experiments"]["run"] |= {"poses": True, "start": {"pin.angle": "encoder + zero"}}
    found = cutjoint.fit(study)
    assert found["A.z"] == pytest.approx(length, rel=1e-9)
    assert found["zero"] == pytest.approx(zero, rel=1e-9)


def test_an_interrupted_fit_says_what_it_has(tmp_path: Path) -> None:
    t = np.arange(0.0, 1.0, 0.01)
    data = write(tmp_path / "d.csv", t, pin_angle=_scipy_pendulum(t, mass=2.0, inertia=0.08, friction=0.3, angle=0.0, rate=0.0))
    study = _arm_study(tmp_path, data)
    study["parameters"] = {name: {} for name in ("friction", "arm.inertia.1")}
    study["experiments"] = {"a": {"data": data, "signals": {"pin.angle": {}}}}

    def stop(text: str) -> None:
        if text.startswith("  run 4"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as stopped:
        cutjoint.fit(study, note=stop)
    (reported,) = stopped.value.__notes__
    assert float(reported.split("friction: {start: ")[1].split("}")[0]) == pytest.approx(0.3, rel=0.05)


def test_a_driven_arm_from_rest_with_ties_starts_and_bootstrap(tmp_path: Path) -> None:
    """The arm hangs, and a torque moves it that the file has in N mm; SciPy's motion follows the same lines between samples."""
    t = np.arange(0.0, 1.001, 0.01)
    push = 2 * np.sin(5 * t)
    total = 0.08 + 2.0 * 0.09

    def f(now: float, x: Any) -> Any:
        return [x[1], (2.0 * 9.81 * 0.3 * np.cos(x[0]) - 0.3 * x[1] + np.interp(now, t, push)) / total]

    angle = solve_ivp(f, (0, 1), [np.pi / 2, 0.0], t_eval=np.minimum(t, 1), rtol=1e-11, atol=1e-12, max_step=0.005).y[0]
    data = write(tmp_path / "d.csv", t, pin_angle=angle + 1e-4 * np.random.default_rng(0).normal(size=len(t)))
    np.savetxt(tmp_path / "torque.txt", np.column_stack([t, 1e3 * push]), fmt="%.17g")
    torque = {"data": str(tmp_path / "torque.txt"), "time": 1, "column": 2, "unit": "N*mm"}
    text = ARM.replace("parameters: {", "parameters: {push: {value: 0, unit: N*m, binding: input}, ").replace(
        "damping: friction}}", "damping: friction}}\n  motor: {kind: joint_force, joint: pin, law: push}"
    )
    (tmp_path / "arm.yaml").write_text(text)
    study = {
        "cutjoint_fit": 1, "model": str(tmp_path / "arm.yaml"), "integrator": "rk4", "dt": "2 ms", "loss": "soft_l1",
        "parameters": {"friction": {"from": 0.01, "to": 1.0}, "size": {"start": 0.05, "from": 0.04, "to": 0.15}},
        "ties": {"arm.inertia.1": "size", "arm.inertia.2": "size"}, "starts": {"count": 2}, "bootstrap": {"count": 8},
        "experiments": {"drive": {
            "data": data, "rest": True, "inputs": {"push": torque}, "signals": {"pin.angle": {}},
        }},
    }  # fmt: skip
    found = cutjoint.fit(study)
    assert len(found.starts) == 2
    assert found.numbers["arm.inertia.1"] == found.numbers["arm.inertia.2"] == found["size"]
    for name, value in {"friction": 0.3, "size": 0.08}.items():
        assert abs(found[name] - value) < 6 * found.deviations[found.names.index(name)]
        assert found[name] == pytest.approx(value, rel=5e-3)


def test_an_experiment_without_input_follows_its_scene_behind_one_that_is_driven(tmp_path: Path) -> None:
    """Both are of one scene; the torque of the first, which never is zero, would move the second."""
    text = ARM.replace("parameters: {", "parameters: {push: {value: 0, unit: N*m, binding: input}, ").replace(
        "damping: friction}}", "damping: friction}}\n  motor: {kind: joint_force, joint: pin, law: push}"
    )
    (tmp_path / "arm.yaml").write_text(text)
    t, total = np.arange(0.0, 0.501, 0.01), 0.05 + 2.0 * 0.09

    def angle(torque: float) -> Any:
        def f(_: float, x: Any) -> Any:
            return [x[1], (2.0 * 9.81 * 0.3 * np.cos(x[0]) - 0.3 * x[1] + torque) / total]

        return solve_ivp(f, (0, 0.5), [1.0, 0.0], t_eval=np.minimum(t, 0.5), rtol=1e-12, atol=1e-12).y[0]

    driven = write(tmp_path / "driven.csv", t, torque=np.full(len(t), 2.0), pin_angle=angle(2.0))
    free = write(tmp_path / "free.csv", t, pin_angle=angle(0.0))
    start = {"pin.angle": 1.0, "pin.angle_rate": 0.0}
    found = cutjoint.fit({
        "cutjoint_fit": 1, "model": str(tmp_path / "arm.yaml"), "integrator": "rk4", "dt": "1 ms", "parameters": {"friction": {}},
        "experiments": {
            "driven": {"data": driven, "start": start, "inputs": {"push": {"column": "torque"}}, "signals": {"pin.angle": {}}},
            "free": {"data": free, "start": start, "signals": {"pin.angle": {}}},
        },
    })  # fmt: skip
    assert found["friction"] == pytest.approx(0.3, rel=1e-6)


def test_an_experiment_from_the_drawn_pose_behind_one_at_rest(tmp_path: Path) -> None:
    (tmp_path / "arm.yaml").write_text(ARM)
    t = np.arange(0.0, 0.501, 0.01)
    falls = _scipy_pendulum(t, mass=2.0, inertia=0.05, friction=0.3, angle=0.0, rate=0.0)
    hangs = write(tmp_path / "hangs.csv", t, pin_angle=np.full(len(t), np.pi / 2))
    data = write(tmp_path / "falls.csv", t, pin_angle=falls)
    found = cutjoint.fit({
        "cutjoint_fit": 1, "model": str(tmp_path / "arm.yaml"), "integrator": "rk4", "dt": "1 ms", "parameters": {"friction": {}},
        "experiments": {
            "hangs": {"data": hangs, "rest": True, "signals": {"pin.angle": {"deviation": 1e-3}}},
            "falls": {"data": data, "signals": {"pin.angle": {"deviation": 1e-3}}},
        },
    })  # fmt: skip
    assert found["friction"] == pytest.approx(0.3, rel=1e-6)


_SWINGING = """cutjoint: 1
name: swinging
gravity: [0, 0, -9.81]
bodies:
  upper: {mass: 1, centre_of_mass: [0.25, 0, 0], inertia: [0.01, 0.01, 0.01]}
  lower: {mass: 0.8, centre_of_mass: [0.75, 0, 0], inertia: [0.01, 0.01, 0.01]}
joints:
  hip: {kind: revolute, bodies: [ground, upper], at: [0, 0, 0], axis: y}
  knee: {kind: revolute, bodies: [upper, lower], at: [0.5, 0, 0], axis: y}
forces:
  a: {kind: joint_force, joint: hip, law: {stiffness: 0.3, damping: 0.02, free_position: 0}}
  b: {kind: joint_force, joint: knee, law: {stiffness: 0.2, damping: 0.02, free_position: 0}}
outputs: [hip.angle, knee.angle]
scenes: {fall: {end: 10, positions: {hip.angle: -2, knee.angle: 1}}}
"""


def test_growing_windows_fit_a_chaotic_motion(tmp_path: Path) -> None:
    """A double pendulum that swings wildly for 10 s: from half the numbers, single shooting ends in a minimum far away."""
    (tmp_path / "m.yaml").write_text(_SWINGING, encoding="utf-8")
    true = {"lower.mass": 0.8, "a.law.stiffness": 0.3, "b.law.stiffness": 0.2, "a.law.damping": 0.02}
    t, columns = _run(tmp_path / "m.yaml", true, dt=2e-3, end=10.0, every=1e-2)
    rng = np.random.default_rng(0)
    data = write(tmp_path / "d.csv", t, **{name: column + 1e-3 * rng.standard_normal(len(t)) for name, column in columns.items()})
    parameters = {name: {"start": 0.6 * value} for name, value in true.items()}
    signals = {"hip.angle": {"deviation": 1e-3}, "knee.angle": {"deviation": 1e-3}}
    study = {"cutjoint_fit": 1, "model": str(tmp_path / "m.yaml"), "integrator": "rk4", "dt": 2e-3, "parameters": parameters,
             "experiments": {"run": {"data": data, "signals": signals}}}  # fmt: skip
    found = cutjoint.fit(study | {"windows": 6})
    assert found.verdict == "identified"
    for i, (name, value) in enumerate(true.items()):
        assert abs(found[name] - value) < 4 * found.deviations[i] < 1e-3 * value
