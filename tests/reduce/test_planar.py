"""Mechanisms put into their plane move as before; those that may leave it stay, with the reason."""

from __future__ import annotations

import numpy as np
import pytest

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.compile.pipeline import generate
from cutjoint.model.outcome import Outcome
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import COORDINATES, SPEEDS, JointKind, Model, Scene
from cutjoint.reduce.planar import flatten
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from cutjoint.topology.build import build_topology
from tests.conftest import MODELS, needs_cpp
from tests.mechanisms.planar import SWING, random_tree
from tests.oracles.dense import Instant, Numerics
from tests.oracles.evaluation import both as both_ways


def swing(old: str = "", new: str = "") -> tuple[Model, Scene]:
    assert not old or old in SWING
    model = read_model_text(SWING.replace(old, new) if old else SWING, "swing.yaml")
    return model, model.scenes["fall"]


def run(model: Model, scene: Scene, method: str) -> Trajectory:
    trajectory = simulate(compile_interpreted(model, scene, method=method))
    assert trajectory.failure is None
    return trajectory


def words(outcome: Outcome) -> dict[str, str]:
    return {note.element: note.text for note in (*outcome.done, *outcome.left)}


def test_joints_keep_the_motions_in_the_plane() -> None:
    model, scene = swing()
    outcome = flatten(model, scene)
    assert words(outcome) == {
        "rod_start": "moves in the plane z = 0 alone: a revolute joint in place of a spherical one",
        "plate_free": "moves in the plane z = 0 alone: a planar joint in place of a free one",
        "bob_slide": "moves in the plane z = 0 alone: a prismatic joint in place of a cylindrical one",
    }
    assert {f.name for f in model.forces} - {f.name for f in outcome.model.forces} == {"screwing"}
    assert flatten(outcome.model, outcome.scene).done == ()


def test_a_scene_that_gives_an_attitude_stays() -> None:
    model, scene = swing("plate_free.x: 0.01", "plate_free.attitude: {rotation_vector: [0, 0, 0.1]}")
    outcome = flatten(model, scene)
    assert (outcome.model, outcome.scene) == (model, scene)
    assert words(outcome) == {"plate_free": "starts with an attitude, which the pass does not compare: it may leave the plane"}


@needs_cpp
@pytest.mark.parametrize(("method", "rounding"), [("classical", 1e-11), ("augmented", 1e-8)])
def test_a_mechanism_in_its_plane_moves_as_before(method: str, rounding: float) -> None:
    """All equations are held at every step: rounding times what a damper makes of it; the augmented method iterates to its tolerance."""
    model, scene = swing()
    outcome = flatten(model, scene)
    full, flat = run(model, scene, method), run(outcome.model, outcome.scene, method)
    assert list(full.columns) == list(flat.columns)
    assert np.abs(full["rod.yaw"]).max() > 0.1
    for column in full.columns:
        assert flat[column] == pytest.approx(full[column], abs=rounding * (1 + float(np.abs(full[column]).max()))), column


def at_start(model: Model, scene: Scene) -> dict[str, float]:
    """Outputs of a model without cut joints at the coordinates and speeds that a scene gives; others are zero."""
    blocks, dense = both_ways(build_topology(model), scene, outputs=scene.outputs)
    q, v = np.zeros(dense.nq), np.zeros(dense.nv)
    for joint in (j for j in model.joints if j.name in dense.layout):
        place = dense.layout[joint.name]
        given = [float(scene.positions.get(f"{joint.name}.{name}", 0)) for name in COORDINATES[joint.kind]]
        q[place.q_slice] = given + ([1.0, 0.0, 0.0, 0.0] if place.ball else [])
        v[place.v_slice] = [float(scene.rates.get(f"{joint.name}.{name}", 0)) for name in SPEEDS[joint.kind]]
    at = Instant(q=q, v=v, t=0.0)
    figures = Numerics(penalty=1.0, damping_ratio=1.0, frequency=1.0)
    return blocks.report(at, blocks.solve(at, np.zeros(0), figures).vdot, np.zeros(0), figures)


@pytest.mark.parametrize("seed", range(12))
def test_any_tree_in_a_plane(seed: int) -> None:
    """All that is reported at an instant of random trees, by the dense reference's coordinates; what leaves the plane is zero in both."""
    model = read_model_text(random_tree(np.random.default_rng(seed)), "tree.yaml")
    outcome = flatten(model, model.scenes["go"])
    assert outcome.done
    assert {j.kind for j in outcome.model.joints} <= {JointKind.REVOLUTE, JointKind.PRISMATIC, JointKind.PLANAR}
    full, flat = at_start(model, model.scenes["go"]), at_start(outcome.model, outcome.scene)
    assert list(full) == list(flat)
    for column, value in full.items():
        assert flat[column] == pytest.approx(value, abs=1e-9 * (1 + abs(value))), column


def test_operations_of_the_recursion() -> None:
    model, scene = swing()
    outcome = flatten(model, scene)
    full, flat = (generate(m, s, s.outputs)[1].operations("evaluate") for m, s in ((model, scene), (outcome.model, outcome.scene)))
    assert (full, flat) == (1590, 511)


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("gravity: [0, -9.81, 0]", "gravity: [0, -9.81, 1]", "has gravity that pulls out of the plane z = 0"),
        ("{mass: 2, centre_of_mass: [1.5, 0.2, 0]", "{mass: 2, centre_of_mass: [1.5, 0.2, 0.01]", "its centre of mass is not"),
        ("from: [1.5, 1.2, 0], to: E", "from: [1.5, 1.2, 0.1], to: E", "is not symmetric about the plane z = 0, nor has it an image there"),
        ("at: D, axis: [0, 0, -1]", "at: D, axis: [0, 0.1, -1]", "is not symmetric about the plane z = 0"),
        ("plate_free.vx: 0.2", "plate_free.vz: 0.2", "starts with a vz that leaves the plane z = 0"),
        ("at: G, axis: [0, 1, 0]}", "at: G, axis: [0, 1, 1]}", "is not symmetric about the plane z = 0"),
    ],
)  # fmt: skip
def test_what_may_leave_the_plane_stays(old: str, new: str, why: str) -> None:
    outcome = flatten(*swing(old, new))
    assert outcome.done == ()
    assert any(why in found for found in words(outcome).values()), words(outcome)


def test_a_loop_of_hinges_needs_no_symmetry() -> None:
    """Hinges hold the rocker, though its mass is in another plane and a force pushes it out of its own."""
    assert "rocker" not in words(flatten(*swing("centre_of_mass: [1.1, 0.3, -0.2]", "centre_of_mass: [1.1, 0.3, -0.4]")))


@pytest.mark.parametrize("name", ["slider_crank", "flyball", "iltis"])
def test_spatial_mechanisms_stay(name: str) -> None:
    model = read_model(MODELS / f"{name}.yaml")
    assert flatten(model, next(iter(model.scenes.values()))).done == ()


def test_hinges_are_in_their_plane_already() -> None:
    model = read_model(MODELS / "four_bar.yaml")
    assert flatten(model, model.scenes["swing"]).done == ()
