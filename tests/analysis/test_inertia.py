"""Motions that no mass resists."""

from __future__ import annotations

import numpy as np
import pytest

from cutjoint.analysis.closing import explore
from cutjoint.analysis.inertia import NoInertiaError, describe_momentary, find_idle_motions, find_momentary_motions, require_inertia
from cutjoint.compile.pipeline import generate
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.model.read import read_model_text
from cutjoint.run.scenes import find_scene
from tests.analysis.formulated import dense_closures, formulated
from tests.conftest import MODELS
from tests.mechanisms.four_bar import four_bar_text
from tests.mechanisms.random_models import random_loops, random_tree
from tests.oracles.dense import DenseMechanism, Instant

HEAD = "cutjoint: 1\nname: idle\ngravity: [0, 0, -9.81]\nbodies:\n"
HEAVY = "{mass: 1, centre_of_mass: [2, 0, 0.5], inertia: [1, 1, 1]}"


def idle_directions(equations: RecursiveEquations) -> int:
    """By the oracle: the fewest independent speeds over the poses that neither a mass nor a cut joint feels."""
    dense = DenseMechanism(equations.topology, equations.scene)
    counts = []
    for pose in explore(equations):
        M, _ = dense.inertia(dense.motion(Instant(q=pose.q, v=np.zeros(dense.nv), motion=0.0)))
        J = dense_closures(equations, pose.q).jacobian
        system = M + np.abs(M).max(initial=1.0) * J.T @ J
        scale = 1 / np.sqrt(np.maximum(np.diag(system), 1e-12 * np.diag(system).max(initial=1.0)))
        counts.append(dense.nv - np.linalg.matrix_rank(system * np.outer(scale, scale), rtol=1e-12))
    return min(counts)


def spherical_tie_rods() -> str:
    """The Iltis with tie rods that turn freely about themselves."""
    universal = "kind: universal, bodies: [carrier, tie_rod], at: T2, axis: [1, 0, 0], axis_2: [0, 0, 1]"
    text = (MODELS / "iltis.yaml").read_text()
    assert universal in text
    return text.replace(universal, "kind: spherical, bodies: [carrier, tie_rod], at: T2")


def test_a_massless_link_between_two_balls_is_named() -> None:
    equations = formulated(spherical_tie_rods())
    found = find_idle_motions(equations)
    assert [m.joints[0].child for m in found] == [f"{c}.tie_rod" for c in ("front_left", "front_right", "rear_left", "rear_right")]
    assert idle_directions(equations) == 4
    with pytest.raises(NoInertiaError) as error:
        require_inertia(equations)
    first, *others = str(error.value).split("\n")
    assert len(others) == 3
    assert first.startswith("model.yaml:")
    assert "joint 'front_left.tie_rod_joint': nothing resists the motion of body 'front_left.tie_rod'" in first
    assert "(front_left.tie_rod_joint.wy, front_left.tie_rod_joint.wz)" in first
    assert "a massless link between two spherical joints: make one of them universal" in first


def test_a_point_that_floats_is_named_once() -> None:
    joints = "joints: {moves: {kind: free, bodies: [ground, load], at: [0, 0, 0]}}\n"
    text = f"{HEAD}  load: {{mass: 1, centre_of_mass: [0, 0, 0]}}\n{joints}"
    with pytest.raises(NoInertiaError) as error:
        require_inertia(formulated(text))
    (line,) = str(error.value).split("\n")
    assert "nothing resists the motion of body 'load' (moves.wx, moves.wy, moves.wz), so that" in line


def test_no_code_is_generated() -> None:
    model = read_model_text(spherical_tie_rods(), "model.yaml")
    with pytest.raises(NoInertiaError):
        generate(model, find_scene(model, "simul1"), ())


def test_a_massless_leaf_is_named() -> None:
    text = f"{HEAD}  arm: {HEAVY}\n  pointer: {{massless: true}}\njoints:\n"
    text += "  hinge: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: [0, 0, 1]}\n"
    text += "  pivot: {kind: revolute, bodies: [arm, pointer], at: [1, 0, 0], axis: [0, 1, 0]}\n"
    (motion,) = find_idle_motions(formulated(text))
    assert ([t.child for t in motion.joints], motion.speeds) == (["pointer"], ("pivot.angle_rate",))


def test_a_chain_of_massless_bodies_with_one_joint_too_many_is_named_once() -> None:
    """Two parallel hinges and a slider between two bodies: what one turns the other turns back."""
    text = f"{HEAD}  between: {{massless: true}}\n  arm: {HEAVY}\njoints:\n"
    text += "  one: {kind: revolute, bodies: [ground, between], at: [0, 0, 0], axis: [0, 0, 1]}\n"
    text += "  two: {kind: revolute, bodies: [between, arm], at: [0, 0, 1], axis: [0, 0, 1]}\n"
    (motion,) = find_idle_motions(formulated(text))
    assert motion.speeds == ("one.angle_rate", "two.angle_rate")
    with pytest.raises(NoInertiaError, match="nothing resists the motion of bodies 'between', 'arm'"):
        require_inertia(formulated(text))


def test_a_slender_bar_between_balls_spins_freely() -> None:
    """A bar without inertia about itself is as idle as a massless one; on a hinge across it, it is not."""
    bar = "{mass: 1, centre_of_mass: [0.5, 0, 0], inertia: [0, 0.1, 0.1]}"
    ball = "  start: {kind: spherical, bodies: [ground, bar], at: [0, 0, 0]}\n"
    hinge = "  start: {kind: revolute, bodies: [ground, bar], at: [0, 0, 0], axis: [0, 1, 0]}\n"
    (motion,) = find_idle_motions(formulated(f"{HEAD}  bar: {bar}\njoints:\n{ball}"))
    assert motion.speeds == ("start.wx",)
    assert find_idle_motions(formulated(f"{HEAD}  bar: {bar}\njoints:\n{hinge}")) == ()


def dead_centre(y: float = 0.0) -> str:
    """A slider with massless crank and rod, whose pin is ``y`` (m) off their line."""
    text = f"{HEAD}  crank: {{massless: true}}\n  rod: {{massless: true}}\n  slider: {HEAVY}\njoints:\n"
    text += "  main_bearing: {kind: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: [0, 0, 1]}\n"
    text += f"  big_end: {{kind: revolute, bodies: [crank, rod], at: [1, {y}, 0], axis: [0, 0, 1]}}\n"
    text += "  way: {kind: prismatic, bodies: [ground, slider], at: [3, 0, 0], axis: [1, 0, 0]}\n"
    return text + "  small_end: {kind: revolute, bodies: [rod, slider], at: [3, 0, 0], axis: [0, 0, 1], cut: true}\n"


def double_pendulum(bob: str, y: float = 0.0) -> str:
    """A massless link that carries another body, whose hinge is ``y`` (m) off their line."""
    text = f"{HEAD}  link: {{massless: true}}\n  bob: {bob}\njoints:\n"
    text += "  upper: {kind: revolute, bodies: [ground, link], at: [0, 0, 0], axis: [0, 1, 0]}\n"
    return text + f"  lower: {{kind: revolute, bodies: [link, bob], at: [1, 0, {y}], axis: [0, 1, 0]}}\n"


def test_a_dead_centre_is_not_refused() -> None:
    """Massless crank and rod move the slider in every pose but this one."""
    equations = formulated(dead_centre())
    assert idle_directions(equations) == 0
    assert find_idle_motions(equations) == ()


POINT = "{mass: 1, centre_of_mass: [2, 0, 0]}"


@pytest.mark.parametrize(
    ("text", "joints"), [(dead_centre(), ["main_bearing", "big_end"]), (double_pendulum(POINT), ["upper", "lower"])], ids=["loop", "tree"]
)
def test_a_massless_link_in_line_is_found(text: str, joints: list[str]) -> None:
    """The oracle's inertia has no rank for the motion there."""
    equations = formulated(text)
    poses = explore(equations)
    (motion,) = find_momentary_motions(equations, poses)
    assert [t.joint.name for t in motion.joints] == joints
    dense = DenseMechanism(equations.topology, equations.scene)
    M, _ = dense.inertia(dense.motion(Instant(q=poses[0].q, v=np.zeros(dense.nv), motion=0.0)))
    J = dense_closures(equations, poses[0].q).jacobian
    assert np.linalg.matrix_rank(M + J.T @ J, rtol=1e-9) == dense.nv - 1
    line, *others = describe_momentary(equations.topology.model, motion).split("\n")
    assert line.startswith(f"model.yaml:5:3: body '{equations.topology.model.bodies[0].name}': in the design position no mass resists")
    assert len(others) == text.count("massless") - 1


@pytest.mark.parametrize(
    "text", [dead_centre(0.5), double_pendulum(POINT, 0.5), double_pendulum(POINT.replace("}", ", inertia: [1, 1, 1]}"))],
    ids=["loop", "tree", "inertia"],
)  # fmt: skip
def test_a_massless_link_out_of_line_or_with_inertia_behind_it_is_right(text: str) -> None:
    equations = formulated(text)
    assert find_momentary_motions(equations, explore(equations)) == ()


@pytest.mark.parametrize("model", ["iltis", "four_bar"])
def test_models_of_the_repository_pass(model: str) -> None:
    require_inertia(formulated((MODELS / f"{model}.yaml").read_text()))


def test_bars_on_hinges_need_no_second_look() -> None:
    require_inertia(formulated(four_bar_text(30)))


@pytest.mark.parametrize("seed", [1, 3, 7])
@pytest.mark.parametrize("make", [random_loops, random_tree])
def test_random_models_with_massless_links_are_what_the_oracle_says(make: object, seed: int) -> None:
    equations = formulated(make(seed))  # type: ignore[operator]
    assert (find_idle_motions(equations) == ()) == (idle_directions(equations) == 0)
