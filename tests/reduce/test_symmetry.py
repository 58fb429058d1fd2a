"""Half of a symmetric model moves as the whole one, and what is not symmetric is left with its reason."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_interpreted
from cutjoint.methods import METHODS
from cutjoint.model.outcome import Outcome
from cutjoint.model.quantities import quantities
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import COORDINATES, SPEEDS, JointKind, Model, Output, Patch, RoughSurface, Scene
from cutjoint.reduce.half.symmetry import halve
from cutjoint.run.artifact import Artifact
from cutjoint.run.simulation import simulate
from cutjoint.topology.build import build_topology
from tests.conftest import MODELS, needs_cpp, with_heavy
from tests.mechanisms.symmetric import CARRIAGE, wings_text
from tests.oracles.dense import Instant, Numerics
from tests.oracles.evaluation import both as both_ways
from tests.physics.simulation import compile_scene, completed

pytestmark = needs_cpp

ILTIS = MODELS / "iltis.yaml"
#: Outputs of the carriage that its half does not tell.
UNTOLD = frozenset({"pod_ball.wy", "keel_spring.force", "keel_spring.stiffness", "keel_spring.damping"})


def carriage(old: str = "", new: str = "") -> tuple[Model, Scene]:
    """The carriage, or a variant, asked for everything."""
    assert not old or old in CARRIAGE
    model = read_model_text(CARRIAGE.replace(old, new) if old else CARRIAGE, "carriage.yaml")
    return model, replace(model.scenes["run"], outputs=tuple(everything(model)))


def everything(model: Model) -> Iterator[Output]:
    for element in (*model.bodies, *model.joints, *model.forces, *model.reactions, *model.markers):
        for quantity in quantities(element):
            if f"{element.name}.{quantity}" not in UNTOLD:
                yield Output(element=element.name, quantity=quantity, span=element.span)


def refusal(old: str, new: str) -> str:
    """Reasons why a variant of the carriage is not cut."""
    model, scene = carriage(old, new)
    outcome = halve(model, scene)
    assert (outcome.model, outcome.scene, outcome.done) == (model, scene, ())
    return "; ".join(f"{note.element} {note.words}" for note in outcome.left)


@cache
def iltis() -> Model:
    return read_model(ILTIS)


@cache
def both(method: str) -> tuple[Artifact, Artifact]:
    """The car and its half in simul1."""
    model = iltis()
    outcome = halve(model, model.scenes["simul1"])
    both, options = ((model, model.scenes["simul1"]), (outcome.model, outcome.scene)), CompileOptions(method=method)
    return tuple(compile_scene(m, s, options) for m, s in both)  # type: ignore[return-value]


# The same motion


@pytest.mark.parametrize("method", with_heavy(METHODS, "augmented", "classical", "recursive-newton"))
def test_every_column_of_a_half_is_that_of_the_whole(method: str) -> None:
    """All joints, forces and sensors in the plane and in pairs, and all their quantities, from an asymmetric start in the plane."""
    model, scene = carriage()
    outcome = halve(model, scene)
    assert outcome.left == ()
    whole, half = (
        completed(simulate(compile_interpreted(m, s, method=method))) for m, s in ((model, scene), (outcome.model, outcome.scene))
    )  # fmt: skip
    assert list(whole.columns) == list(half.columns)
    assert whole.units == half.units
    assert np.abs(whole["mast_hinge.angle"]).max() > 0.01
    assert np.abs(whole["left.hand.wx"]).max() > 0.1
    for column in whole.columns:
        scale = max(1.0, float(np.abs(whole[column]).max()))
        assert half[column] == pytest.approx(whole[column], abs=accuracy(method, column) * scale), column


@pytest.mark.parametrize("axis", "xyz")
def test_any_of_the_three_planes(axis: str) -> None:
    """Wings written by hand: where the mirror turns a hinge about, its angle counts the other way.  All that is reported at one instant."""
    model = read_model_text(wings_text(axis), "wings.yaml")
    scene = replace(model.scenes["fall"], outputs=tuple(everything(model)))
    outcome = halve(model, scene)
    assert [b.name for b in outcome.model.bodies] == ["hull", "port"]
    whole, half = at_start(model, scene), at_start(outcome.model, outcome.scene)
    assert list(whole) == list(half)
    assert whole["starboard_hinge.angle_rate"] == -whole["port_hinge.angle_rate"] == -0.7
    for column, value in whole.items():
        assert half[column] == pytest.approx(value, abs=1e-12), column


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


def accuracy(method: str, column: str) -> float:
    """The rest that a fixed point leaves where two different sums have settled; penalties tell reactions less well."""
    if method in ("augmented", "recursive-newton") and column in ("brace_push.force", "left.stay_pull.force", "right.stay_pull.force"):
        return 1e-3
    return {"classical": 1e-8, "augmented": 1e-8, "recursive": 1e-6, "recursive-newton": 1e-8}[method]


@pytest.mark.parametrize(("method", "rounding"), with_heavy([("classical", 1e-10), ("recursive", 1e-5)], ("classical", 1e-10)))
def test_half_a_car_climbs_the_ramp_as_the_whole_one(method: str, rounding: float) -> None:
    """Four seconds of simul1 from its equilibrium, as shares of the columns' sizes; what the whole has from its two sides is their mean.

    The whole car's equilibrium leaves it a yaw of 4e-9 rad, a direction in which nothing holds it: that is in the differences of its
    sides and in the columns that are zero in the half.  A recursive run ends its iterations at 1e-6 of the accelerations.
    """
    whole, half = (completed(simulate(artifact, end=4.0)) for artifact in both(method))
    assert list(whole.columns) == list(half.columns)
    assert whole.t == pytest.approx(half.t, abs=0)
    for column in whole.columns:
        if column.endswith((".y", ".vy", ".ay", ".roll", ".yaw")):
            assert np.abs(half[column]).max() < 1e-11, column
            assert np.abs(whole[column]).max() < 1e-6, column
            continue
        other, sign = image(column)
        mean = (whole[column] + sign * whole[other]) / 2
        assert half[column] == pytest.approx(sign * half[other], abs=0), column
        assert half[column] == pytest.approx(mean, abs=rounding * float(np.abs(mean).max())), column
        assert half[column] == pytest.approx(whole[column], abs=1e-5 * float(np.abs(mean).max())), column


def image(column: str) -> tuple[str, int]:
    """The column of the other side and its sign."""
    corner, _, rest = column.partition(".")
    sides = {"left": "right", "right": "left"}
    end, _, side = corner.partition("_")
    return (f"{end}_{sides[side]}.{rest}", -1 if rest in ("tyre.Fy", "tyre.slip") else 1) if side in sides else (column, 1)


@pytest.mark.parametrize(("method", "share"), [("recursive", 0.45), ("classical", 0.45)])
def test_an_evaluation_of_half_a_car_takes_less_than_half(method: str, share: float) -> None:
    whole, half = both(method)
    assert half.program.operations(half.iteration) < share * whole.program.operations(whole.iteration)


# What is done


def test_joints_in_the_plane_keep_what_they_can_do_in_it() -> None:
    model, scene = carriage()
    outcome = halve(model, scene)
    joints = {j.name: j for j in outcome.model.joints}
    assert {name: joints[name].kind for name in ("frame_free", "mast_hinge", "pod_ball", "keel_hinge", "rudder_slide")} == {
        "frame_free": JointKind.PLANAR, "mast_hinge": JointKind.REVOLUTE, "pod_ball": JointKind.REVOLUTE,
        "keel_hinge": JointKind.FIXED, "rudder_slide": JointKind.FIXED,
    }  # fmt: skip
    assert outcome.scene.rates == {"frame_free.displacement_2_rate": pytest.approx(-0.5)}
    assert [n.element for n in outcome.done] == ["carriage", "frame_free", "pod_ball", "keel_hinge", "rudder_slide"]
    assert outcome.done[0].words == (
        "is symmetric about the plane y = 0: 2 bodies, 3 joints, 5 forces are left out as images of others"
    )  # fmt: skip


def test_names_do_not_tell_what_is_an_image() -> None:
    """The sides of a hand-written model, in the opposite order and by other names."""
    model, scene = carriage()
    backwards = replace(model, bodies=model.bodies[::-1], joints=model.joints[::-1], forces=model.forces[::-1])
    assert {b.name for b in halve(backwards, scene).model.bodies} == {b.name for b in halve(model, scene).model.bodies}


def test_columns_of_the_other_side_keep_their_names() -> None:
    outcome = halve(*carriage())
    columns = {o.column: o for o in outcome.scene.outputs}
    hand, free = columns["right.hand.vy"], columns["frame_free.x"]
    assert (hand.element, hand.quantity, hand.factor) == ("left.hand", "vy", -1)
    assert (free.element, free.quantity, free.factor) == ("frame_free", "displacement_2", -1)
    assert (columns["tether.force"].factor, columns["tether.length"].factor) == (2, 1)
    assert columns["left.hand.vy"].stands_for == columns["right.finger.vy"].stands_for == ""


def test_a_model_without_pairs_is_left_without_a_word() -> None:
    model = read_model(MODELS / "pendulum.yaml")
    scene = next(iter(model.scenes.values()))
    assert halve(model, scene) == Outcome(model=model, scene=scene)


# What is not symmetric

REFUSALS = [
    ("idle: {kind: load, body: frame, at: [0, 0, 0], force: [0, 100, 0], active: false}",
     "idle: {kind: point_spring, bodies: [ground, frame], from: [0, 1, 3], to: [0, 0, 0.4], law: length, active: false}",
     "idle is not symmetric about the plane y"),
    ("{steer: 0*t}", "{steer: t}", "rudder_slide has a guide of its displacement that moves it out of the plane y = 0, and is not zero"),
    ("frame_free.vy: 0", "frame_free.vy: 0.1", "frame_free starts with a vy that leaves the plane y = 0"),
    ("left.shoulder.angle: 0,", "", "right.shoulder does not start with the angle that the plane y = 0 shows of 'left.shoulder'"),
    ("{idle: false}", "{idle: true}", "idle is not symmetric about the plane y = 0"),
    ("gravity: [0.5, 0,", "gravity: [0.5, 1,", "carriage has gravity that pulls out of the plane y = 0"),
    ('"-5*position"', '"1 - 5*position"', "keel_spring is not symmetric about the plane y = 0"),
    ("at: [0.3, 0, 2.5]", "at: [0.3, 0.1, 2.5]", "brace has no image: no distance joint like it"),
    ("centre_of_mass: [0.1, 0, 0.8]", "centre_of_mass: [0.1, 0.01, 0.8]", "mast is not symmetric about the plane y = 0"),
    ("  idle:", '  tie: {kind: point_spring, bodies: [left.hand, right.hand], from: [0, 0.5, 0], to: [0, -0.5, 0], law: "1"}\n  idle:',
     "tie joins the two sides of the plane y = 0 directly, which cannot be cut in half"),
    ("  idle:", '  gust: {kind: load, body: left.arm, at: [0, 0, 0], force: [0, 0, 1]}\n  idle:', "gust has no image: nothing like it"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "expected"), REFUSALS)
def test_what_is_not_symmetric_is_left_with_its_reason(old: str, new: str, expected: str) -> None:
    assert refusal(old, new).startswith(expected)


@pytest.mark.parametrize("column", sorted(UNTOLD))
def test_what_the_half_does_not_tell_is_left(column: str) -> None:
    model, scene = carriage()
    element, _, quantity = column.rpartition(".")
    outcome = halve(model, replace(scene, outputs=(Output(element=element, quantity=quantity, span=model.span),)))
    assert [n.element for n in outcome.left] == [element]


def test_the_slalom_is_left_because_of_the_rack() -> None:
    model = iltis()
    outcome = halve(model, model.scenes["simul3"])
    assert outcome.model is model
    (note,) = outcome.left
    assert (note.element, note.span.line) == ("rack_slide", next(j.span.line for j in model.joints if j.name == "rack_slide"))
    assert note.words == "has a guide of its displacement that moves it out of the plane y = 0, and is not zero in this scene"


def test_a_road_with_two_tracks_is_left() -> None:
    model = iltis()
    scene = model.scenes["simul1"]
    (note,) = halve(model, replace(scene, road=replace(scene.road, right=()))).left
    assert (note.element, note.words) == ("simul1", "has a road whose left and right tracks differ")


@pytest.mark.parametrize("part", ["a surface", "patches of friction"])
def test_a_road_with_a_surface_is_left(part: str) -> None:
    model = iltis()
    scene = model.scenes["simul1"]
    rough = RoughSurface(grade="A", seed=1, width=3.0, span=scene.span)
    patch = Patch(x=(0.0, 1.0), y=(0.0, 1.0), friction=0.5, edge=0.1, span=scene.span)
    road = replace(scene.road, surface=rough) if part == "a surface" else replace(scene.road, patches=(patch,))
    (note,) = halve(model, replace(scene, road=road)).left
    assert (note.element, note.words) == ("simul1", f"has {part} on its road, which need not be symmetric")


def test_a_car_with_a_heavier_side_is_left() -> None:
    model = iltis()
    bodies = tuple(replace(b, mass=b.mass + 1) if b.name == "rear_right.carrier" else b for b in model.bodies)
    (note,) = halve(replace(model, bodies=bodies), model.scenes["simul1"]).left
    assert note.element == "rear_left.carrier"
    assert note.words == "is not what the plane y = 0 shows of 'rear_right.carrier': its mass differs"
