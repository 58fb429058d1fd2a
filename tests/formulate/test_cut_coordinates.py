"""Coordinates of cut joints: rates belong to positions, forces have the power force times rate, tangents, and natural coordinates, which
know no cut joint."""

from __future__ import annotations

import numpy as np
import pytest

from cutjoint.analysis.closing import explore, make_inputs, retract
from cutjoint.elements.joint import rate_name
from cutjoint.elements.joints import JOINTS
from cutjoint.formulate.inputs import make_translator
from cutjoint.formulate.recursive.coordinates import angle_of_pose
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.formulate.recursive.kinematics import derive_kinematics
from cutjoint.model.read import read_model_text
from cutjoint.model.records import JointKind, Model, Output
from cutjoint.program.interpret import interpret_blocks
from cutjoint.topology.build import build_topology
from cutjoint.topology.spanning_tree import TopologyError
from tests.formulate.test_implicit import TIME_NOW, make_system, state, verify_tangent
from tests.formulate.test_natural import EXACT, SCENE, make_pair, natural_report, recursive_report, states, without_rod_forces
from tests.mechanisms import random_models
from tests.mechanisms.cut_coordinates import measured, outputs_of_cuts, with_forces_on_cuts
from tests.mechanisms.random_models import CUT_KINDS, NOWHERE
from tests.oracles.dense import Array, Instant
from tests.oracles.evaluation import BlockMechanism

KINDS = [kind for kind in CUT_KINDS if JOINTS[kind].measurable]
CLOSINGS = ("roots", "branch")

#: A crank with a rod and a slider; each joint has a spring and a damper, so that one of them carries its own where it is cut.
SPRUNG = """
cutjoint: 1
name: sprung
gravity: [0, 0, -9.81]
bodies:
  crank: {mass: 1, centre_of_mass: [0, 0, 0.05], inertia: [0.001, 0.001, 0.0005]}
  rod: {mass: 1, centre_of_mass: [0.15, 0, 0.05], inertia: [0.001, 0.008, 0.008]}
  slider: {mass: 1, centre_of_mass: [0.3, 0, 0]}
joints:
  pin: {kind: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: [0, 1, 0], spring: {stiffness: 2, damping: 0.1}}
  elbow: {kind: revolute, bodies: [rod, crank], at: [0, 0, 0.1], axis: [0, -1, 0], spring: {stiffness: 1, damping: 0.2}}
  wrist: {kind: revolute, bodies: [rod, slider], at: [0.3, 0, 0], axis: [0, -1, 0], spring: {stiffness: 3, damping: 0.1}}
  rail: {kind: prismatic, bodies: [ground, slider], at: [0.3, 0, 0], axis: [1, 0, 0], spring: {stiffness: 40, damping: 1}}
reactions: {guide: {joint: rail, axes_of: ground}}
outputs: [pin.angle, elbow.angle, wrist.angle_rate, rail.displacement, guide.Fx, guide.Fz]
scenes: {turn: {end: 1}}
"""


def cut_at(joint: str) -> str:
    return SPRUNG.replace(f"  {joint}: {{", f"  {joint}: {{cut: true, ")


def report(blocks: BlockMechanism, at: dict[str, Array]) -> dict[str, float]:
    return blocks.report(Instant(q=at["q"], v=at["v"], t=TIME_NOW), at["vdot"], at["lambda"], EXACT)


def rate_gradient(blocks: BlockMechanism, at: dict[str, Array], column: str) -> Array:
    """A rate by the joints' speeds, which it is linear in."""
    still = report(blocks, {**at, "v": np.zeros_like(at["v"])})[column]
    return np.array([report(blocks, {**at, "v": e})[column] - still for e in np.eye(len(at["v"]))])


@pytest.mark.parametrize("closing", CLOSINGS)
@pytest.mark.parametrize("kind", KINDS)
def test_forces_have_the_power_of_their_coordinates(kind: JointKind, closing: str) -> None:
    """The balance changes by -force d(rate)/dv, in any pose, closed or not."""
    bare = random_models.loop_with(kind, closing, 3)
    model, scene = with_forces_on_cuts(bare), random_models.scene()
    topology = build_topology(model)
    forces = [f"on_{cut.name}_{coordinate}" for cut, coordinate, _ in measured(topology)]
    outputs = tuple(Output(element=name, quantity="force", span=NOWHERE) for name in forces) + outputs_of_cuts(topology)
    blocks = BlockMechanism(topology, scene, outputs=outputs)
    with_force, without = (make_system(m, scene) for m in (model, bare))
    at = state(without, 5)
    del at["delta"]
    external_wrenches = with_force.call("dynamic_residual", **at)["force_residual"] - without.call("dynamic_residual",
        **at)["force_residual"]
    columns, expected = report(blocks, at), np.zeros(without.n)
    for (cut, coordinate, _), name in zip(measured(topology), forces, strict=True):
        expected -= columns[f"{name}.force"] * rate_gradient(blocks, at, f"{cut.name}.{rate_name(coordinate)}")
    assert external_wrenches == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())
    assert np.abs(expected).max() > 1e-3


@pytest.mark.parametrize("closing", CLOSINGS)
@pytest.mark.parametrize("kind", KINDS)
def test_rates_are_those_of_the_positions(kind: JointKind, closing: str) -> None:
    """The loop is closed here; between gaping bodies a displacement's rate is that of the force's power."""
    model = random_models.loop_with(kind, closing, 3)
    topology = build_topology(model)
    pair = make_pair(without_rod_forces(model), SCENE, outputs_of_cuts(topology))
    h, whole = 1e-4, [f"{cut.name}.{name}" for cut, name, is_whole in measured(topology) if is_whole]
    for at in states(pair, 3) if whole else []:
        zero, still = np.zeros(len(pair.recursive.equations.equation_names)), np.zeros_like(at.v)
        moved = [
            pair.recursive.report(Instant(q=retract(pair.recursive.equations, at.q, s * h * at.v), v=at.v, t=0.0), still, zero, EXACT)
            for s in (-2, -1, 1, 2)
        ]
        now = pair.recursive.report(at, still, zero, EXACT)
        for name in whole:
            far_before, before, after, far_after = (columns[name] for columns in moved)
            slope = (8 * (after - before) - (far_after - far_before)) / (12 * h)
            element, coordinate = name.split(".")
            assert now[f"{element}.{rate_name(coordinate)}"] == pytest.approx(slope, abs=1e-7 * max(1.0, abs(slope))), name


@pytest.mark.parametrize("closing", ["branch", "floating"])
@pytest.mark.parametrize("kind", KINDS)
def test_tangents_have_them(kind: JointKind, closing: str) -> None:
    verify_tangent(make_system(with_forces_on_cuts(random_models.loop_with(kind, closing, 5)), random_models.scene()), 2)


@pytest.mark.parametrize("joint", ["elbow", "wrist", "rail", "pin"])
def test_each_joint_of_a_sprung_loop_can_be_cut(joint: str) -> None:
    """Forces, outputs and reactions against natural coordinates; the tangent."""
    model = read_model_text(cut_at(joint), "sprung.yaml")
    (cut,) = build_topology(model).cuts
    assert cut.name == joint
    scene = model.scenes["turn"]
    pair = make_pair(model, SCENE, (*scene.outputs[:4], *(o for o in all_rates(model))))
    compared = 0
    for at in states(pair, 4):
        expected, found = recursive_report(pair, at), natural_report(pair, at)
        for name, value in found.items():
            assert value == pytest.approx(expected[name], rel=1e-6, abs=1e-6 * max(map(abs, expected.values()))), name
            compared += 1
    assert compared >= 24
    assert verify_tangent(make_system(model, scene), 3) == 1


def all_rates(model: Model) -> tuple[Output, ...]:
    return tuple(Output(element=body.name, quantity=q, span=NOWHERE) for body in model.bodies for q in ("vx", "ax"))


def test_what_a_force_does_to_a_cut_joint_is_in_its_reaction() -> None:
    """Along a slide the reaction is the force on its coordinate, tree joint or cut joint."""
    for joint in ("rail", "elbow"):
        model = read_model_text(cut_at(joint), "sprung.yaml")
        scene = model.scenes["turn"]
        blocks = BlockMechanism(build_topology(model), scene, outputs=(*scene.outputs, FORCE_OF_RAIL))
        system = make_system(model, scene)
        at = state(system, 1)
        at["vdot"] = blocks.solve(Instant(q=at["q"], v=at["v"]), at["lambda"], EXACT).vdot
        correction = blocks.solve(Instant(q=at["q"], v=at["v"]), at["lambda"], EXACT).correction
        columns = report(blocks, {**at, "lambda": at["lambda"] + correction})
        assert columns["guide.Fx"] == pytest.approx(columns["rail_spring.force"], rel=1e-9)


FORCE_OF_RAIL = Output(element="rail_spring", quantity="force", span=NOWHERE)

#: A Bennett linkage: four bars with hinges whose axes are skew, which moves all the same.
BENNETT = """
cutjoint: 1
name: skew
gravity: [0, 0, -9.81]
bodies:
  a: {mass: 1, centre_of_mass: [0.5, 0, 0], inertia: [1, 1, 1]}
  b: {mass: 1, centre_of_mass: [1, 0.5, 0], inertia: [1, 1, 1]}
  c: {mass: 1, centre_of_mass: [0.5, 1, 0], inertia: [1, 1, 1]}
joints:
  one: {kind: revolute, bodies: [ground, a], at: [0, 0, 0], axis: [0, 0.3, 1]}
  two: {kind: revolute, bodies: [a, b], at: [1, 0, 0], axis: [0.3, 0, 1]}
  three: {kind: revolute, bodies: [b, c], at: [1, 1, 0], axis: [0, -0.3, 1]}
  four: {kind: revolute, bodies: [c, ground], at: [0, 1, 0], axis: [-0.3, 0, 1]}
OUTPUTS
scenes: {move: {end: 1}}
"""
FOUR = ("one", "two", "three", "four")


def test_an_angle_that_no_pose_counts_is_refused_with_the_reason() -> None:
    outputs = f"outputs: [{', '.join(f'{name}.angle' for name in FOUR)}]"
    with pytest.raises(TopologyError, match="an angle whose full turns no pose shows in a loop with more than two directions") as error:
        build_topology(read_model_text(BENNETT.replace("OUTPUTS", outputs), "skew.yaml"))
    assert "scene 'move' has its coordinate among the outputs" in str(error.value)


#: A Sarrus linkage: two pairs of plates on parallel hinges, across each other, which lift a table straight up.
SARRUS = """
cutjoint: 1
name: sarrus
gravity: [0, 0, -9.81]
bodies:
  table: {mass: 1, centre_of_mass: [0, 0, 1], inertia: [1, 1, 1]}
  lower_x: {mass: 1, centre_of_mass: [1, 0, 0.3], inertia: [1, 1, 1]}
  upper_x: {mass: 1, centre_of_mass: [1, 0, 0.7], inertia: [1, 1, 1]}
  lower_y: {mass: 1, centre_of_mass: [0, 1, 0.3], inertia: [1, 1, 1]}
  upper_y: {mass: 1, centre_of_mass: [0, 1, 0.7], inertia: [1, 1, 1]}
joints:
  foot_x: {kind: revolute, bodies: [ground, lower_x], at: [0.8, 0, 0], axis: [0, 1, 0]}
  knee_x: {kind: revolute, bodies: [upper_x, lower_x], at: [1.2, 0, 0.5], axis: [0, 1, 0]}
  head_x: {kind: revolute, bodies: [upper_x, table], at: [0.8, 0, 1], axis: [0, -1, 0]}
  foot_y: {kind: revolute, bodies: [ground, lower_y], at: [0, 0.8, 0], axis: [1, 0, 0]}
  knee_y: {kind: revolute, bodies: [lower_y, upper_y], at: [0, 1.2, 0.5], axis: [1, 0, 0]}
  head_y: {kind: revolute, bodies: [upper_y, table], at: [0, 0.8, 1], axis: [1, 0, 0]}
outputs: [foot_x.angle, knee_x.angle, head_x.angle, foot_y.angle, knee_y.angle, head_y.angle]
scenes: {lift: {end: 1}}
"""
SIX = ("foot_x", "knee_x", "head_x", "foot_y", "knee_y", "head_y")


@pytest.mark.parametrize("joint", SIX)
def test_angles_of_a_loop_with_two_directions_are_measured(joint: str) -> None:
    """Against the pose of the bodies that the joint connects, whichever is cut."""
    model = read_model_text(SARRUS.replace(f"  {joint}: {{", f"  {joint}: {{cut: true, "), "sarrus.yaml")
    topology, scene = build_topology(model), model.scenes["lift"]
    assert [cut.name for cut in topology.cuts] == [joint]
    equations = formulate_recursive(topology, scene, scene.outputs)
    angle = equations.function("report").results[f"column:{joint}.angle"]
    moved = [pose for pose in explore(equations)[1:] if pose.closed]
    assert len(moved) == 4
    k = derive_kinematics(equations.builder, make_translator(equations.builder, model), topology, {c.joint: c for c in equations.charts})
    expected = angle_of_pose(k, topology.cuts[0])
    for pose in moved:
        values = interpret_blocks([angle, expected], make_inputs(equations, pose.q, np.zeros(equations.speeds)), {})
        assert values[angle][0, 0] == pytest.approx(values[expected][0, 0], abs=1e-8)
        assert abs(values[expected][0, 0]) > 1e-3


def test_its_rate_is_not() -> None:
    outputs = f"outputs: [{', '.join(f'{name}.angle_rate' for name in FOUR)}]"
    assert len(build_topology(read_model_text(BENNETT.replace("OUTPUTS", outputs), "skew.yaml")).cuts) == 1


def test_a_joint_that_the_file_cuts_says_why_it_must_not_be() -> None:
    text = BENNETT.replace("OUTPUTS", "outputs: [two.angle]").replace("two: {", "two: {cut: true, ")
    with pytest.raises(TopologyError, match=r"joint 'two': it must not be cut, since scene 'move' has .*; cut another joint of its loop"):
        build_topology(read_model_text(text, "skew.yaml"))


@pytest.mark.parametrize("name", ["elbow.angle", "wrist.angle", "rail.displacement", "pin.angle_rate"])
def test_an_output_does_not_change_the_cuts(name: str) -> None:
    bare = SPRUNG.replace(", spring: {", ", #").replace("reactions:", "#")
    bare = "\n".join(line.partition(", #")[0] + ("}" if ", #" in line else "") for line in bare.splitlines())
    bare = bare.replace("outputs: [pin.angle, elbow.angle, wrist.angle_rate, rail.displacement, guide.Fx, guide.Fz]", "outputs: [OUTPUT]")
    cuts = [build_topology(read_model_text(bare.replace("OUTPUT", o), "bare.yaml")).cuts[0].name for o in ("slider.x", name)]
    assert cuts[0] == cuts[1]


def test_a_force_stays_in_the_tree_where_another_joint_can_be_cut() -> None:
    for free in ("elbow", "wrist", "rail"):
        text = "\n".join(line.partition(", spring")[0] + "}" if f"  {free}:" in line else line for line in SPRUNG.splitlines())
        assert [cut.name for cut in build_topology(read_model_text(text, "one.yaml")).cuts] == [free]
