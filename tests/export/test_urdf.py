"""Models as URDF files: read again they have the same code, and Pinocchio sees the same mechanism in both files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.compile.pipeline import generate
from cutjoint.export.robots import write_urdf
from cutjoint.importing.document import import_file
from cutjoint.model.errors import ModelError
from cutjoint.model.records import Model
from cutjoint.topology.reading import read_model, read_model_text
from cutjoint_bench.robots import PinocchioRobot

LEG = Path(__file__).parents[1] / "importing" / "leg.urdf"

#: A relation over two ways of joints, a slide, a ball that closes a loop, friction, colours and a mesh that is turned.
ARMS = """<robot name="arms"><link name="base"/>
  <link name="a"><inertial><origin xyz="0.1 0 0" rpy="0.1 0.2 0.3"/><mass value="2"/><inertia ixx="0.01" iyy="0.02" izz="0.025"/></inertial>
    <visual><geometry><mesh filename="a.stl" scale="0.1 0.1 0.1"/></geometry><origin xyz="0 1 0" rpy="0.3 -0.4 0.5"/>
      <material name="red"><color rgba="1 0 0 1"/></material></visual></link>
  <link name="b"><inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01"/></inertial></link>
  <link name="c"><inertial><mass value="1"/><inertia ixx="0.001" iyy="0.002" izz="0.05"/></inertial></link>
  <link name="s"><inertial><mass value="3"/><inertia ixx="0.1" iyy="0.1" izz="0.1"/></inertial></link>
  <joint name="j" type="continuous"><parent link="base"/><child link="a"/><origin xyz="0 0 1" rpy="0.2 0 0"/><axis xyz="0.6 0 0.8"/>
    <dynamics damping="0.3" friction="0.2"/></joint>
  <joint name="k" type="continuous"><parent link="a"/><child link="b"/><origin xyz="0.4 0 0" rpy="0 0.1 0.7"/><axis xyz="1 2 3"/></joint>
  <joint name="l" type="continuous"><parent link="base"/><child link="c"/><origin xyz="0 0.5 1"/><axis xyz="1 0 0"/></joint>
  <joint name="p" type="prismatic"><parent link="base"/><child link="s"/><origin xyz="1 0 0" rpy="0 0 0.5"/><axis xyz="0 1 1"/>
    <limit effort="1" velocity="1" lower="-1" upper="1"/></joint>
  <coupling name="both"><predecessor link="b"/><successor link="c"/><ratio value="2.5"/></coupling>
  <transmission name="t"><joint name="p"/></transmission>
</robot>
"""


def back(model: Model, tmp_path: Path) -> Path:
    path = tmp_path / "back.urdf"
    path.write_text(write_urdf(model)[0])
    return path


@pytest.mark.parametrize("text", [LEG.read_text(), ARMS], ids=["leg", "arms"])
def test_a_file_that_goes_out_and_comes_back_has_the_same_code(tmp_path: Path, text: str) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    (tmp_path / "a.stl").touch()
    first = read_model(path)
    returned = import_file(back(first, tmp_path)).text
    lines = [[line for line in text.splitlines() if not line.startswith("#")] for text in (first.text, returned)]
    assert lines[0] == lines[1]
    sources = [
        generate(model, model.scenes["motion"], model.scenes["motion"].outputs).source.files
        for model in (read_model_text("\n".join(part), "robot.yaml") for part in lines)
    ]
    assert sources[0] == sources[1]


def test_pinocchio_reads_the_same_mechanism_from_both_files(tmp_path: Path) -> None:
    """Accelerations at a random state that satisfies the constraints; the leg's loops close where all coordinates are zero."""
    robots = [PinocchioRobot(path) for path in (LEG, back(read_model(LEG), tmp_path))]
    places = dict.fromkeys((joint for joint in robots[0].model.names[1:]), 0.0)
    speeds = robots[0].free_speeds(places) @ np.random.default_rng(1).uniform(-1, 1, 2)
    state = {name: (0.0, float(rate)) for name, rate in zip(robots[0].model.names[1:], speeds, strict=True)}
    solutions = [robot.solve(*robot.state(state)) for robot in robots]
    assert solutions[0].freedom == solutions[1].freedom == 2
    for link, acceleration in solutions[0].accelerations.items():
        assert solutions[1].places[link] == pytest.approx(solutions[0].places[link], abs=1e-12)
        assert solutions[1].accelerations[link] == pytest.approx(acceleration, abs=1e-9)


MODEL = """cutjoint: 1
name: m
gravity: [0, 0, 0]
bodies:
  a: {{mass: 1, centre_of_mass: [0, 1, 0]}}
  b: {{mass: 1, centre_of_mass: [1, 1, 0]}}
joints:
  j: {}
  k: {}
{}scenes:
  s: {{end: 1}}
"""
HINGE = "{kind: revolute, bodies: [ground, a], at: [0, 0, 0], axis: z}"
BEHIND = "{kind: revolute, bodies: [b, a], at: [1, 0, 0], axis: z}"


def test_a_joint_that_is_written_the_other_way_round_turns_the_same_way(tmp_path: Path) -> None:
    model = read_model_text(MODEL.format(HINGE, BEHIND, ""), "m.yaml")
    joint = next(joint for joint in read_model(back(model, tmp_path)).joints if joint.name == "k")
    assert (joint.base, joint.follower, [float(x) for x in joint.axes[0]]) == ("a", "b", [0, 0, -1])


@pytest.mark.parametrize(
    ("joint", "more", "message"),
    [
        ("{kind: planar, bodies: [a, b], at: [1, 0, 0], axis: z}", "", "joint 'k': URDF has no joint of kind planar there"),
        (BEHIND.replace("}", ", armature: 1}"), "", "joint 'k': URDF has no armature"),
        (BEHIND.replace("}", ", guide: 0*t}"), "", "joint 'k': URDF has no guides"),
        (BEHIND, "gears:\n  g: {joints: [j, k], law: position**2}\n", "gear 'g': URDF has no such relation"),
    ],
)
def test_what_urdf_cannot_say(joint: str, more: str, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        write_urdf(read_model_text(MODEL.format(HINGE, joint, more), "m.yaml"))


def test_a_body_that_is_called_as_the_ground_is_refused() -> None:
    text = MODEL.format(HINGE, BEHIND, "").replace("b:", "world:").replace("[b, a]", "[world, a]")
    with pytest.raises(ModelError, match="body 'world': URDF calls the ground so; rename it"):
        write_urdf(read_model_text(text, "m.yaml"))


def test_what_is_left_out_is_named(tmp_path: Path) -> None:
    spring = "forces:\n  f: {kind: joint_force, joint: j, law: -3*position}\n"
    path = tmp_path / "m.yaml"
    path.write_text(MODEL.format(HINGE, BEHIND, spring))
    result = CliRunner().invoke(main, ["export", str(path), "--to", "urdf", "--out", str(tmp_path / "m.urdf")])
    said = " ".join(result.output.split())
    assert "left out, since URDF has only dampers, dry friction and drives of joints: f" in said
    assert "left out: gravity" in said
    for words in (["--output", "a.x"], ["--scene", "s"]):
        assert CliRunner().invoke(main, ["export", str(path), "--to", "urdf", "--out", str(tmp_path / "m.urdf"), *words]).exit_code == 2
    assert "ends in .urdf" in CliRunner().invoke(main, ["export", str(path), "--to", "urdf", "--out", str(tmp_path / "m.xml")]).output
