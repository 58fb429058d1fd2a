"""Joints that scenes lock, drive and release: kinematic and dynamic scenes of one model."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.run.results import Trajectory
from cutjoint.run.scenes import find_case, in_scene
from cutjoint.run.simulation import simulate
from cutjoint.sweeps.reading import read_study
from cutjoint.tasks.states import find_initial_state
from tests.conftest import needs_cpp

#: A rod of 2 kg and 1 m from a hinge, a block of 3 kg that slides on it, at 0.25 m in the design position; both horizontal.
TEXT = """\
cutjoint: 1
name: boom
gravity: [0, 0, -10]
parameters: {speed: {value: 2, unit: rad/s, binding: input}}
bodies:
  rod: {shapes: [{rod: {from: [0, 0, 0], to: [1, 0, 0]}, mass: 2}]}
  block: {mass: 3, centre_of_mass: [0.25, 0, 0]}
joints:
  hinge: {kind: revolute, bodies: [ground, rod], at: [0, 0, 0], axis: [0, -1, 0]}
  slide: {kind: prismatic, bodies: [rod, block], at: [0.25, 0, 0], axis: [1, 0, 0], guide: 0.1*t}
reactions:
  drive: {joint: hinge, axes_of: ground, direction: [0, -1, 0]}
  rail: {joint: slide, axes_of: rod, direction: [1, 0, 0]}
outputs: [hinge.angle, slide.displacement, drive.moment, rail.force, block.x]
scenes:
  as_written: {end: 0.5, output_step: 0.05}
  turned: {end: 0.5, output_step: 0.05, lock: [slide], positions: {slide.displacement: 0.5}, drive: {hinge: "speed*t"}}
  both: {end: 0.5, output_step: 0.05, drive: {hinge.angle: "0.3*t**2", slide: "0.2*sin(3*t)"}}
  loose: {end: 0.2, output_step: 0.05, release: [slide], positions: {slide.displacement: 0.1}, rates: {hinge.angle_rate: 1}}
  held: {end: 0.2, output_step: 0.05, lock: [hinge, slide]}
"""


def run(scene: str, **how: object) -> Trajectory:
    model, chosen = find_case(read_model_text(TEXT, "boom.yaml"), scene)
    return simulate(compile_interpreted(model, chosen), **how)  # type: ignore[arg-type]


@needs_cpp
def test_a_scene_drives_and_locks_what_another_leaves_free() -> None:
    """The moment of the drive at constant speed is that of the weights, the slide bears weight and centrifugal force."""
    found = run("turned")
    t = found.t
    np.testing.assert_allclose(found["hinge.angle"], 2 * t, atol=1e-12)
    np.testing.assert_allclose(found["slide.displacement"], 0.5, atol=1e-12)
    np.testing.assert_allclose(found["drive.moment"], 10 * (2 * 0.5 + 3 * 0.75) * np.cos(2 * t), atol=1e-8)
    np.testing.assert_allclose(found["rail.force"], 3 * (10 * np.sin(2 * t) - 4 * 0.75), atol=1e-8)


@needs_cpp
def test_a_kinematic_run_has_the_forces_of_its_drives() -> None:
    """By Lagrange's equations: J(s) = 2/3 + 3 r^2 and the block along the rod."""
    model, chosen = find_case(read_model_text(TEXT, "boom.yaml"), "both")
    found = simulate(compile_interpreted(model, chosen))
    t = found.t
    angle, rate, second = 0.3 * t**2, 0.6 * t, 0.6
    r, slide_rate, slide_second = 0.25 + 0.2 * np.sin(3 * t), 0.6 * np.cos(3 * t), -1.8 * np.sin(3 * t)
    moment = (2 / 3 + 3 * r**2) * second + 6 * r * slide_rate * rate + 10 * (2 * 0.5 + 3 * r) * np.cos(angle)
    np.testing.assert_allclose(found["drive.moment"], moment, atol=1e-7)
    np.testing.assert_allclose(found["rail.force"], 3 * (slide_second - r * rate**2 + 10 * np.sin(angle)), atol=1e-7)


@needs_cpp
def test_a_released_joint_is_free_and_may_have_a_start() -> None:
    """Beside the same model whose joint has no guide."""
    plain = read_model_text(TEXT.replace(", guide: 0.1*t", "").replace("release: [slide], ", ""), "boom.yaml")
    known = simulate(compile_interpreted(plain, plain.scenes["loose"]))
    found = run("loose")
    assert found["slide.displacement"][0] == pytest.approx(0.1, abs=1e-12)
    for name in found:
        np.testing.assert_allclose(found[name], known[name], atol=1e-9)


@needs_cpp
def test_other_scenes_stay_as_they_are() -> None:
    model = read_model_text(TEXT, "boom.yaml")
    plain = read_model_text(TEXT.partition("  turned:")[0], "boom.yaml")
    again = in_scene(in_scene(model, model.scenes["both"]), model.scenes["as_written"])
    assert again == model
    assert in_scene(model, model.scenes["as_written"]) is model
    known, found = (simulate(compile_interpreted(m, m.scenes["as_written"])) for m in (plain, again))
    assert list(known["hinge.angle"]) == list(found["hinge.angle"])
    assert find_initial_state(model, scene="turned")["slide.displacement"] == pytest.approx(0.5, abs=1e-12)


@needs_cpp
def test_a_run_says_that_it_is_kinematic(tmp_path: Path) -> None:
    file = tmp_path / "boom.yaml"
    file.write_text(TEXT)
    words = ("simulate", file, "--implementation", "interpreted", "--out", tmp_path / "run.csv", "--scene")
    driven, free = (CliRunner().invoke(main, [str(x) for x in (*words, scene)]) for scene in ("turned", "as_written"))
    assert "motion: kinematic: guides prescribe all degrees of freedom; runs report guide forces and all reactions" in driven.output
    assert "kinematic" not in free.output
    held = CliRunner().invoke(main, ["check", str(file), "--scene", "held"])
    assert "0 cut" in held.output
    assert "kinematic" in held.output


def test_a_study_has_the_joints_of_its_scenes(tmp_path: Path) -> None:
    (tmp_path / "boom.yaml").write_text(TEXT)
    study = "cutjoint_study: 1\nmodel: boom.yaml\nscenes: [SCENES]\nparameters: {speed: [1, 2]}\nobjectives: {peak: {maximum: block.x}}\n"
    (tmp_path / "one.yaml").write_text(study.replace("SCENES", "turned"))
    model: Model = read_study(tmp_path / "one.yaml").model
    assert [joint.guide is not None for joint in model.joints] == [True, True]
    (tmp_path / "two.yaml").write_text(study.replace("SCENES", "turned, both"))
    with pytest.raises(ModelError, match="the scenes lock, drive or release different joints; write a study for each"):
        read_study(tmp_path / "two.yaml")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("lock: [slide], pos", "lock: [slid], pos", "boom.yaml:17:48: scene 'turned': lock: unknown joint 'slid'; did you mean 'slide'?"),
        ("drive: {hinge: ", "drive: {hinge.anglee: ", "drive: 'hinge.anglee' names no coordinate; did you mean 'angle'?"),
        ("drive: {hinge: \"speed*t\"", "drive: {hinge: \"rod.z\"", "drive.hinge: the quantity 'rod.z' cannot be used here"),
        ("release: [slide], positions: {slide.displacement: 0.1}", "release: [hinge]",
         "release: the joint 'hinge' has no guide; remove it here"),
        ("lock: [slide], positions: {slide.displacement: 0.5}, drive: {hinge: ", "lock: [hinge], drive: {hinge: ",
         "lock: the joint 'hinge' is driven or released too; say one of them"),
        ("lock: [hinge, slide]", "lock: [hinge], rates: {hinge.angle_rate: 1}", "rates: the joint 'hinge' is locked; remove its rate"),
        ("slide: \"0.2*sin(3*t)\"}", "slide: t}, positions: {slide.displacement: 1}", "positions: the joint 'slide' is guided"),
    ],
)  # fmt: skip
def test_what_is_wrong(old: str, new: str, message: str) -> None:
    assert old in TEXT
    with pytest.raises(ModelError) as error:
        read_model_text(TEXT.replace(old, new), "boom.yaml")
    assert message in str(error.value)


def test_a_joint_has_to_have_a_coordinate() -> None:
    text = TEXT.replace("slide: {kind: prismatic", "slide: {kind: spherical").replace(", axis: [1, 0, 0], guide: 0.1*t", "")
    with pytest.raises(ModelError, match="lock: a spherical joint has no coordinate to guide; take another joint of the loop"):
        read_model_text(text, "boom.yaml")
