"""Mechanisms that points slightly off hold only just, and those that are meant to be rigid."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from cutjoint.analysis.mobility import find_mobility
from cutjoint.analysis.shaky import ShakyError, mend_misfit
from cutjoint.analysis.skew import describe_geometry
from cutjoint.cli import main
from cutjoint.compile.derivation import derive, schedule_method
from cutjoint.compile.options import CompileOptions
from cutjoint.methods import METHODS
from cutjoint.model.read import read_model_text
from cutjoint.run.scenes import find_scene
from tests.analysis.formulated import formulated
from tests.conftest import MODELS, needs_cpp
from tests.mechanisms.overconstrained import BENNETT, parallel_cranks_text, skew_chain_text
from tests.physics.simulation import compile_scene, completed, simulate

PRESS = (MODELS / "press.yaml").read_text(encoding="utf-8")
DOOR = """\
cutjoint: 1
name: door
gravity: [0, 0, -9.81]
bodies: {door: {mass: 10, centre_of_mass: [0.5, 0, 0.5], inertia: [1, 1, 1]}}
joints:
  low: {kind: revolute, bodies: [ground, door], at: [0, 0, 0], axis: [0, 0, 1]}
  high: {kind: revolute, bodies: [ground, door], at: [OFF, 0, 1], axis: [0, 0, 1]}
scenes: {swing: {end: 1}}
"""


def said(text: str) -> str:
    equations = formulated(text)
    return describe_geometry(equations, find_mobility(equations))


def test_hinges_that_are_nearly_on_one_line_are_named() -> None:
    """A door turned at 1 rad/s about one hinge moves the other by their distance across the axis."""
    assert said(DOOR.replace("OFF", "0.001")).startswith(
        "barely rigid: at a speed of 1 of 'low.angle_rate' the rate of violation is 0.001 m/s or rad/s, most at 'high.y'; hinges"
    )


def test_a_small_door_is_held_by_as_much_of_its_size() -> None:
    small = DOOR.replace("OFF, 0, 1]", "OFF, 0, 0.01]")
    assert said(small.replace("OFF", "0.001")) == ""
    assert "1e-05 m/s" in said(small.replace("OFF", "0.00001"))


@pytest.mark.parametrize("off", ["0", "0.1"])
def test_hinges_on_one_line_or_far_off_are_as_they_were_meant(off: str) -> None:
    assert said(DOOR.replace("OFF", off)) == ""


def test_a_crank_that_is_nearly_as_long_as_two_others() -> None:
    """Three equal cranks carry a coupler; one of another length holds it, by its difference."""
    cranks = parallel_cranks_text(3, (0.6, 0.8))
    assert said(cranks) == ""
    assert said(cranks.replace("at: [2, 0, 0]", "at: [2, 0.003, 0]")).startswith("barely rigid")


def test_a_mechanism_that_a_guide_drives_is_meant_to_have_no_freedom() -> None:
    """A crank and slider whose crank is guided, near its dead centre: the slider's speed hardly follows."""
    dead_centre, rail = PRESS.replace("A: [0, 0, 0.1]", "A: [0.1, 0, 0.0001]"), "at: B, axis: [1, 0, 0]"
    assert rail in dead_centre
    assert said(dead_centre.replace(rail, f"{rail}, guide: t")) == ""


def _off(off: float, scene: str = "{end: 0.3, output_step: 0.1}") -> str:
    """Three parallel cranks, a pin of the last one off."""
    text = parallel_cranks_text(3, (0.6, 0.8)).replace("at: [2, 0, 0]", f"at: [2, {off}, 0]")
    return f"{text}outputs: [coupler.x, coupler.y]\nscenes: {{fall: {scene}}}\n"


@pytest.mark.parametrize(("off", "scale"), [(1e-9, 1.0), (1e-8, 1e-3), (1e-6, 1.0), (1e-4, 1.0)])
def test_a_misfit_within_the_accuracy_is_taken_out(off: float, scale: float) -> None:
    """A shift of the middle crank by half does as much as one of the last crank to first order."""
    equations = formulated(_scaled(_off(off), scale))
    model, (words, exact) = equations.topology.model, mend_misfit(equations, 1e-4)
    joint, size = re.fullmatch(
        r"model.yaml:\d+:3: '(\w+)' is off by (\S+) m, which would lock the loops; within the accuracy of 0.0001 .*", words
    ).groups()  # type: ignore[union-attr]
    assert 0.49 * off * scale < float(size) < 1.01 * off * scale
    assert exact is not None
    moved = {a.name: np.abs(np.array(a.at, float) - np.array(b.at, float)).max() for a, b in zip(exact.joints, model.joints, strict=True)}
    assert max(moved, key=lambda name: moved[name]) == joint
    assert mend_misfit(formulated(exact), 1e-4) == ("", None)
    assert find_mobility(formulated(exact)).degrees_of_freedom == 1


@pytest.mark.parametrize("method", METHODS)
def test_a_larger_misfit_is_refused_by_all_methods(method: str) -> None:
    """Where the scene asks for more, and where a pin of cranks of ten kilometres is a centimetre off."""
    for text in (_off(1e-6, "{end: 1, accuracy: 1e-7}"), _scaled(_off(1e-6), 1e4)):
        model = read_model_text(text, "cranks.yaml")
        with pytest.raises(ShakyError, match=r"cranks.yaml:\d+:3: '\w+' is off by \S+ m, more than the accuracy of \S+, and locks loops"):
            schedule_method(model, find_scene(model, None), (), method=method)


def test_a_misfit_that_leaves_no_motion_is_reported_by_check_and_runs(tmp_path: Path) -> None:
    """Three cranks with a pin 1 mm off have no motion, and neither have those with a pin 0.1 m off, whatever was meant."""
    file = tmp_path / "cranks.yaml"
    file.write_text(_off(1e-3), encoding="utf-8")
    model = read_model_text(_off(1e-3), "cranks.yaml")
    with pytest.warns(UserWarning, match=r"cranks.yaml:\d+:3: '\w+' is off by 0.001 m, which locks the loops: the mechanism cannot move"):
        equations = derive(model, find_scene(model, None), ())
    assert equations.topology.model is model
    assert "0.001 m, which locks the loops" in " ".join(CliRunner().invoke(main, ["check", str(file)]).output.split())
    for firm in (_off(0.1), DOOR.replace("OFF", "0.1"), PRESS):
        assert mend_misfit(formulated(firm), 1e-4) == ("", None)


def test_a_run_of_a_door_that_a_hinge_locks_says_so(tmp_path: Path) -> None:
    """One speed, which an equation locks by a thousandth of the door's height; `check` says it once."""
    file = tmp_path / "door.yaml"
    file.write_text(DOOR.replace("OFF", "0.001"), encoding="utf-8")
    model = read_model_text(file.read_text(encoding="utf-8"), "door.yaml")
    with pytest.warns(UserWarning, match=r"door.yaml:\d+:\d+: the mechanism cannot move; barely rigid: at a speed of 1 of 'low.angle_rate"):
        equations = derive(model, find_scene(model, None), ())
    assert equations.topology.model is model
    assert " ".join(CliRunner().invoke(main, ["check", str(file)]).output.split()).count("barely rigid") == 1


@pytest.mark.parametrize("off", [1e-9, 1e-6, 1e-4])
def test_exact_cranks_have_the_change_point(off: float) -> None:
    """In line all their pins are: cranks of lengths that differ by x leave it by the root of x."""
    model = mend_misfit(formulated(_off(off)), 1e-4)[1]
    assert model is not None
    at = {joint.name: np.array(joint.at, float) for joint in model.joints}
    cranks = np.array([at[f"closure_{i}"] - at[f"pin_{i}"] for i in range(3)])
    assert np.ptp(np.linalg.norm(cranks, axis=1)) < 1e-15 + off**2


@needs_cpp
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("off", "scale"), [(1e-10, 1.0), (1e-8, 1.0), (1e-5, 1.0), (1e-4, 1.0), (1e-6, 1e-3)])
def test_cranks_with_a_misfit_move_as_exact_ones(method: str, off: float, scale: float) -> None:
    """The pendulum of the parallelogram by SciPy: every crank turns by an angle x, and the coupler moves along a circle."""
    model = read_model_text(_scaled(_off(off), scale), "cranks.yaml")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        artifact = compile_scene(model, find_scene(model, None), CompileOptions(method=method))
    assert [str(w.message).count(" m, which would lock the loops") for w in caught] == ([1] if off > 1e-10 else [])
    run = completed(simulate(artifact, dt=1e-3, error=False, check=False))
    inertia, weight = 3 * (0.1 + scale**2 / 4) + scale**2, 9.81 * 2.5 * scale
    begin = [np.arctan2(0.8, 0.6), 0.0]
    swing = solve_ivp(lambda _, y: [y[1], -weight * np.cos(y[0]) / inertia], (0, 0.3), begin, "DOP853", run.t, rtol=1e-11, atol=1e-11)
    places = scale * np.array([1 + np.cos(swing.y[0]), np.sin(swing.y[0])])
    assert np.abs([run["coupler.x"], run["coupler.y"]] - places).max() < 2 * off * scale + 2e-6 * scale


@needs_cpp
@pytest.mark.parametrize("method", METHODS)
def test_cranks_with_a_misfit_pass_their_change_point_as_exact_ones(method: str) -> None:
    """All pins are in line after 0.47 s; cranks of lengths that differ by 4e-10 m left it on another way, by 1.4e-4 m."""
    runs, off = [], 1e-9
    for text in (_off(0.0, "{end: 0.8, output_step: 0.1}"), _off(off, "{end: 0.8, output_step: 0.1}")):
        model = read_model_text(text, "cranks.yaml")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            artifact = compile_scene(model, find_scene(model, None), CompileOptions(method=method))
        run = completed(simulate(artifact, dt=1e-3, error=False, check=False))
        runs.append([run["coupler.x"], run["coupler.y"]])
    assert np.abs(np.subtract(*runs)).max() < 2 * off


@pytest.mark.parametrize("seed", range(2))
def test_a_turned_bennett_linkage_with_rounded_corners_moves(seed: int) -> None:
    """Six digits of its corners hold it: its loop has more equations than it needs in no plane."""
    turn = Rotation.random(rng=seed).as_matrix()
    corners = tuple(tuple(np.round(turn @ np.array(corner), 6).tolist()) for corner in BENNETT)
    words, exact = mend_misfit(formulated(skew_chain_text(corners, "{end: 1, output_step: 0.1}")), 1e-4)
    assert "would lock the loops" in words
    assert find_mobility(formulated(exact)).degrees_of_freedom == 1  # type: ignore[arg-type]


@needs_cpp
def test_the_command_line_warns_each_time(tmp_path: Path) -> None:
    file = tmp_path / "cranks.yaml"
    file.write_text(_off(1e-7), encoding="utf-8")
    run = ["simulate", str(file), "--implementation", "interpreted", "--no-error", "--out", str(tmp_path / "run.csv")]
    for asked in (["check", str(file)], run, run):
        done = CliRunner().invoke(main, asked)
        assert " ".join(done.output.split()).count("m, which would lock the loops; within the accuracy of 0.0001") == 1, done.output
    done = CliRunner().invoke(main, [*run, "--accuracy", "1e-8"])
    assert done.exit_code == 1
    assert "more than the accuracy of 1e-08, and locks loops" in " ".join(done.output.split())


@pytest.mark.parametrize("off", [0.0, 1e-12])
def test_what_moves_has_no_misfit(off: float) -> None:
    assert mend_misfit(formulated(_off(off)), 1e-4) == ("", None)


def _scaled(text: str, scale: float) -> str:
    """The model with all points so much farther apart."""
    points = re.compile(r"(at|centre_of_mass): \[([^]]*)\]")
    return points.sub(lambda m: f"{m[1]}: [{', '.join(repr(scale * float(x)) for x in m[2].split(','))}]", text)
