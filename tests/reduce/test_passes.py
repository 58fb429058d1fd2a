"""Exact passes: what they do, why they stop, and that the motion stays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.model.outcome import Note, Outcome, Pass
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import JointKind, Model, RodForce, Scene
from cutjoint.reduce.links import shorten_links
from cutjoint.reduce.planar import drop_idle_equations
from cutjoint.reduce.reach import drop_unreached
from cutjoint.reduce.sequence import Step, lighten_links, reduction_sequence
from cutjoint.reduce.weld import weld_bodies
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from cutjoint.topology.build import build_topology
from tests.conftest import MODELS, needs_cpp
from tests.mechanisms.overconstrained import IN_LINE, UPRIGHT, parallel_cranks_text

#: A crank drives a rocker about another direction by a massless rod; a massless hinged link keeps the rocker's other end on a circle.
SPATIAL = """\
cutjoint: 1
name: spatial
gravity: [0, 0, -9.81]
points: {A: [0.2, 0, 0], B: [0.9, 0.35, 0.2], C: [1.02, 0, 0.4], D: [1.05, 0.25, 0.3], S: [1, 0, 0.4]}
bodies:
  crank: {mass: 1, centre_of_mass: [0.1, 0, 0], inertia: [0.01, 0.02, 0.02]}
  carrier: {mass: 3, centre_of_mass: [1, 0.3, 0.1], inertia: [0.1, 0.12, 0.11]}
  arm: {mass: 2, centre_of_mass: [1, 0.1, 0], inertia: [0.02, 0.01, 0.02]}
  rod: {massless: true}
  link: {massless: true}
joints:
  crank_pin: {kind: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: [0, 1, 0]}
  arm_pin: {kind: revolute, bodies: [ground, arm], at: [1, 0, 0], axis: [1, 0, 0]}
  ball: {kind: spherical, bodies: [arm, carrier], at: [1, 0.3, 0]}
  rod_start: {kind: spherical, bodies: [crank, rod], at: A, cut: true}
  rod_end: {kind: universal, bodies: [carrier, rod], at: B, axis: [1, 0, 0], axis_2: [0, 0, 1]}
  link_pin: {kind: revolute, bodies: [ground, link], at: C, axis: [1, 0, 0], cut: true}
  link_ball: {kind: spherical, bodies: [carrier, link], at: D}
forces:
  spring: {kind: axial_force, bodies: [ground, link], origin: S, point: D, axis: [0, 0, -1], law: "300*(0.1 - travel)"}
reactions:
  pull: {joint: rod_start, axes_of: rod, direction: {from: A, to: B}}
  hold: {joint: link_pin, axes_of: link, direction: {from: D, to: C}}
outputs: [carrier.x, carrier.y, carrier.z, crank.z, pull.force, hold.force, spring.force]
scenes:
  fall: {end: 0.2, output_step: 0.02, numerics: {dt: 0.001, penalty: 1.0e+4, solver_tolerance: 1.0e-9}}
"""

#: A pendulum of two bodies in one, with a third that a guide holds, beside another that touches neither.
WELDED = """\
cutjoint: 1
name: welded
gravity: [0, 0, -9.81]
parameters: {push: {value: 0, unit: m, binding: input}}
bodies:
  rod: {mass: 1, centre_of_mass: [0.5, 0, 0], inertia: [0.01, 0.1, 0.1]}
  bob: {mass: 2, centre_of_mass: [1, 0.1, 0.05], inertia: {principal: [0.01, 0.02, 0.03], x: [1, 1, 0], z: [0, 0, 1]}}
  slide: {mass: 0.5, centre_of_mass: [0.7, 0, 0], inertia: [0.001, 0.002, 0.003]}
  other: {mass: 1, centre_of_mass: [0, 2, -1], inertia: [0.1, 0.1, 0.1]}
joints:
  pin: {kind: revolute, bodies: [ground, rod], at: [0, 0, 0], axis: [0, 1, 0]}
  weld: {kind: fixed, bodies: [rod, bob], at: [1, 0, 0]}
  rail: {kind: prismatic, bodies: [rod, slide], at: [0.7, 0, 0], axis: [1, 0, 0], guide: push}
  other_pin: {kind: revolute, bodies: [ground, other], at: [0, 2, 0], axis: [0, 1, 0]}
outputs: [rod.x, rod.pitch, bob.x, bob.vz, bob.roll, slide.az]
scenes:
  fall: {end: 1, output_step: 0.02, numerics: {dt: 0.002, solver_tolerance: 1.0e-12}}
  pushed: {end: 1, inputs: {push: "0.1*sin(t)"}}
"""


WITHOUT_DIRECTION = "stays: 'all' is the reaction of its joint 'link_pin' without a direction"


def read(text: str, scene: str = "fall") -> tuple[Model, Scene]:
    model = read_model_text(text, "model.yaml")
    return model, model.scenes[scene]


def run(model: Model, scene: Scene, method: str = "recursive", dt: float | None = None) -> Trajectory:
    trajectory = simulate(compile_interpreted(model, scene, method=method), dt=dt)
    assert trajectory.failure is None
    return trajectory


def words(outcome: Outcome) -> dict[str, str]:
    return {note.element: note.text for note in (*outcome.done, *outcome.left)}


def apart(a: Trajectory, b: Trajectory) -> dict[str, float]:
    assert list(a.columns) == list(b.columns)
    return {name: float(np.abs(a[name] - b[name]).max() / (1 + np.abs(a[name]).max())) for name in a.columns}


def test_links_become_distances() -> None:
    outcome = shorten_links(*read(SPATIAL))
    assert words(outcome) == {"rod": "becomes a distance", "link": "becomes two distances that keep a point on a circle"}
    assert {j.name: j.kind for j in outcome.model.joints if j.cut} == dict.fromkeys(("rod", "link_1", "link_2"), JointKind.DISTANCE)
    assert {b.name for b in outcome.model.bodies} == {"crank", "carrier", "arm"}
    assert {f.name: f.follower for f in outcome.model.forces} == {"spring": "carrier"}  # type: ignore[union-attr]
    assert all(isinstance(r, RodForce) for r in outcome.model.reactions)


@needs_cpp
def test_distances_move_as_links_do() -> None:
    """Index-3 methods hold all equations in every step; reactions are reported as exactly as a step's multipliers settle."""
    model, scene = read(SPATIAL)
    outcome = shorten_links(model, scene)
    found = apart(run(model, scene, "augmented"), run(outcome.model, outcome.scene, "augmented"))
    assert all(error < 1e-12 for name, error in found.items() if not name.endswith("force")), found
    assert all(error < 1e-5 for error in found.values()), found


@needs_cpp
def test_distances_move_as_links_do_in_the_recursion() -> None:
    """Its stabilisation draws other equations to zero: the difference is one of the step, and falls with its square."""
    model, scene = read(SPATIAL)
    outcome = shorten_links(model, scene)
    coarse, fine = (apart(run(model, scene, dt=dt), run(outcome.model, outcome.scene, dt=dt))["carrier.z"] for dt in (2e-3, 1e-3))
    assert fine < 1e-5
    assert coarse / fine == pytest.approx(4, rel=0.4)


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("[carrier.x,", "[link.x, carrier.x,", "stays: the output 'link.x' needs it"),
        ("point: D, axis", "point: [1.03, 0.2, 0.3], axis", "stays: 'spring' is at a point between its joints"),
        ("{joint: link_pin, axes_of: link,", "{joint: link_pin, axes_of: carrier,", "stays: the direction of 'hold' is fixed in 'carrier'"),
        ("{joint: link_pin, axes_of: link,", "{joint: link_ball, axes_of: link,", "stays: 'hold' is the reaction of its joint 'link_ball'"),
        ("reactions:", "reactions:\n  all: {joint: link_pin, axes_of: link}", WITHOUT_DIRECTION),
        ("hold.force", "hold.moment", "stays: the output 'hold.moment' needs a moment in its joint 'link_pin'"),
        (
            "link_ball: {kind: spherical", "link_ball: {kind: universal, axis: [1, 0, 0], axis_2: [0, 1, 0]",
            "stays: it has a revolute and a universal joint",
        ),
        ("{end: 0.2,", "{end: 0.2, positions: {rod_end.angle_1: 0},", "stays: the scene gives 'rod_end.angle_1'"),
    ],
)  # fmt: skip
def test_links_stay_where_something_needs_them(old: str, new: str, why: str) -> None:
    assert old in SPATIAL
    assert why in words(shorten_links(*read(SPATIAL.replace(old, new)))).values()


def test_massive_links_stay() -> None:
    heavy = SPATIAL.replace("rod: {massless: true}", "rod: {mass: 1, centre_of_mass: [0.5, 0.2, 0.1], inertia: [0.1, 0.1, 0.1]}")
    assert "rod" not in words(shorten_links(*read(heavy)))


def test_light_links_lose_their_mass() -> None:
    light = SPATIAL.replace("rod: {massless: true}", "rod: {mass: 0.1, centre_of_mass: [0.55, 0.175, 0.1], inertia: [0.001, 0.004, 0.004]}")
    outcome = lighten_links(*read(light))
    assert words(outcome) == {"rod": "loses its mass, 1.6 % of the whole, and becomes a distance"}
    assert all(body.mass != 0.1 for body in outcome.model.bodies)


@needs_cpp
def test_what_never_moves_becomes_one_body() -> None:
    model, scene = read(WELDED)
    outcome = weld_bodies(model, scene)
    assert [b.name for b in outcome.model.bodies] == ["rod", "other"]
    assert words(outcome)["weld"] == "does not move: 'bob' becomes a part of 'rod'"
    found = apart(run(model, scene), run(outcome.model, outcome.scene))
    assert all(error < 1e-12 for error in found.values()), found


@pytest.mark.parametrize("kind", ["fixed, bodies: [rod, bob]", "revolute, axis: [0, 1, 0], bodies: [bob, rod]"])
def test_joints_beside_a_weld_go_with_it(kind: str) -> None:
    """The rest has a tree again, and the motion stays."""
    model, scene = read(WELDED.replace("  weld:", f"  beside: {{kind: {kind}, at: [1, 0, 0], cut: true}}\n  weld:"))
    outcome = weld_bodies(model, scene)
    assert "beside" not in {j.name for j in outcome.model.joints}
    assert build_topology(outcome.model).cuts == ()


def test_a_joint_beside_a_weld_that_somebody_asks_for_stays() -> None:
    beside = "  beside: {kind: prismatic, bodies: [rod, bob], at: [1, 0, 0], axis: [1, 0, 0], cut: true"
    asked = WELDED.replace("  weld:", f"{beside}}}\n  weld:").replace("outputs: [", "outputs: [beside.displacement, ")
    reason = "the output 'beside.displacement' needs it"
    assert words(weld_bodies(*read(asked)))["weld"] == f"stays: 'beside' joins the same bodies, and {reason}"


def test_what_is_asked_for_is_not_welded_to_the_ground() -> None:
    hinge = "revolute, bodies: [ground, rod], at: [0, 0, 0], axis: [0, 1, 0]"
    assert hinge in WELDED
    fixed = WELDED.replace(hinge, "fixed, bodies: [ground, rod], at: [0, 0, 0]")
    assert words(weld_bodies(*read(fixed)))["pin"] == "stays: the output 'rod.x' needs 'rod', which would be the ground"


def test_a_guide_that_moves_is_not_welded() -> None:
    assert set(words(weld_bodies(*read(WELDED, "pushed")))) == {"weld"}


def test_what_no_output_can_feel_is_dropped() -> None:
    model, scene = read(WELDED)
    outcome = drop_unreached(model, scene)
    assert words(outcome) == {"other": "is dropped: no output depends on it"}
    assert {j.name for j in outcome.model.joints} == {"pin", "weld", "rail"}


def test_nothing_is_dropped_that_a_force_leads_to() -> None:
    spring = "forces: {cord: {kind: point_spring, bodies: [rod, other], from: [0, 0, 0], to: [0, 2, 0], law: length}}\noutputs:"
    assert drop_unreached(*read(WELDED.replace("outputs:", spring))).done == ()


def test_nothing_is_dropped_that_a_reaction_carries() -> None:
    """A guided base holds all that hangs on it, though no output is about that."""
    base = "joints:\n  base: {kind: prismatic, bodies: [ground, foot], at: [0, 0, 0], axis: [1, 0, 0], guide: push}"
    text = WELDED.replace("joints:", f"  foot: {{mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}}\n{base}")
    text = text.replace("bodies: [ground, other], at: [0, 2, 0]", "bodies: [foot, other], at: [0, 2, 0]")
    asked = text.replace("outputs: [", "reactions:\n  hold: {joint: base, axes_of: ground}\noutputs: [hold.Mx, ")
    assert list(words(drop_unreached(*read(text)))) == ["other"]
    assert drop_unreached(*read(asked)).done == ()


@pytest.mark.parametrize("reduce", [drop_unreached, weld_bodies, shorten_links, drop_idle_equations, lighten_links])
def test_passes_leave_what_they_have_done(reduce: Pass) -> None:
    model = read_model(MODELS / "iltis.yaml")
    once = reduce(model, model.scenes["simul1"])
    assert reduce(once.model, once.scene).done == ()


@needs_cpp
def test_plane_loops_need_two_equations() -> None:
    model = read_model(MODELS / "four_bar.yaml")
    outcome = drop_idle_equations(model, model.scenes["swing"])
    assert {j.kind for j in outcome.model.joints if j.cut} == {JointKind.POINT_ON_LINE}
    found = apart(run(model, model.scenes["swing"]), run(outcome.model, outcome.scene))
    assert all(error < 1e-9 for error in found.values()), found


def test_spatial_loops_keep_their_equations() -> None:
    model = read_model(MODELS / "iltis.yaml")
    assert drop_idle_equations(model, model.scenes["simul1"]).done == ()


def iltis(scene: str) -> tuple[Model, Scene]:
    model = read_model(MODELS / "iltis.yaml")
    return model, model.scenes[scene]


def test_sequence_of_the_iltis() -> None:
    """Coordinates and equations of design.md."""
    variants = reduction_sequence(*iltis("simul3"))
    assert [(r.name, r.unknowns, r.equations, r.motion) for r in variants] == [("full", 42, 36, "exact"), ("links", 22, 12, "exact")]
    assert [r.operations for r in variants] == [10743, 7205]


def test_sequence_of_the_iltis_with_its_rack_at_rest() -> None:
    model, scene = iltis("simul1")
    variants = reduction_sequence(model, scene)
    assert [(r.name, r.unknowns, r.equations) for r in variants] == [("full", 42, 36), ("welded", 42, 36), ("links", 22, 12)]
    assert [r.operations for r in variants][:2] == [10743, 10717]


def test_outputs_keep_their_columns() -> None:
    model, scene = iltis("simul1")
    for variant in reduction_sequence(model, scene):
        assert [o.column for o in variant.scene.outputs] == [o.column for o in scene.outputs]


def test_the_sequence_leaves_what_costs_more() -> None:
    model = read_model(MODELS / "four_bar.yaml")
    (variant,) = reduction_sequence(model, model.scenes["swing"])
    assert {note.text for note in variant.left} == {"stays: the pass 'idle equations' would take 517 operations in place of 445"}


def columns_of(reduced: Callable[[Model, Scene], Outcome], scene: str) -> list[str]:
    model, asked = iltis(scene)
    outcome = reduced(model, replace(asked, outputs=asked.outputs[:3]))
    return [o.column for o in outcome.scene.outputs]


def test_fewer_outputs_stay_few() -> None:
    assert columns_of(weld_bodies, "simul1") == ["chassis.x", "chassis.y", "chassis.z"]


def test_what_a_method_refuses_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    """Upright cranks, and a pass that lays them in line with their coupler, where distances of pins depend on each other."""
    upright, in_line = (
        read_model_text(f"{parallel_cranks_text(2, crank)}scenes: {{run: {{end: 1}}}}\n", "cranks.yaml") for crank in (UPRIGHT, IN_LINE)
    )
    done = (Note(element="crank_1", text="lies down", span=upright.span),)
    laid = Outcome(model=in_line, scene=in_line.scenes["run"], done=done, left=())
    monkeypatch.setattr("cutjoint.reduce.sequence.STEPS", (Step(name="laid", reduce=lambda model, scene: laid),))
    (variant,) = reduction_sequence(upright, upright.scenes["run"], "classical")
    assert (variant.model, variant.left[-1].text) == (upright, "stays: the method classical cannot solve the model after the pass 'laid'")
