"""Reactions: closed forms, the same mechanism cut at different joints, natural coordinates, and that no equation of motion feels them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cutjoint.compile.pipeline import generate
from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model_text
from cutjoint.model.records import COORDINATES, JointForce, JointKind, Model, Output
from cutjoint.topology.build import build_topology
from tests.formulate.test_natural import SCENE, determined, make_pair, natural_report, recursive_report, states, without_rod_forces
from tests.formulate.test_reports import with_reactions
from tests.mechanisms import random_models
from tests.mechanisms.random_models import NOWHERE, K
from tests.oracles.dense import Array, DenseMechanism, Instant, Numerics
from tests.oracles.evaluation import both

NUMERICS = Numerics(penalty=1e3, damping_ratio=0.7, frequency=5.0)
COMPONENTS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")

PENDULUM = """
cutjoint: 1
name: pendulum
gravity: [0, 0, -10]
bodies:
  rod: {mass: 3, centre_of_mass: [0.5, 0, 0], inertia: [0.01, 0.25, 0.25]}
joints:
  pin: {kind: revolute, bodies: [JOINED], at: [0, 0, 0], axis: [0, -1, 0]DRIVE}
reactions:
  along: {joint: pin, axes_of: rod, direction: [1, 0, 0]}
  across: {joint: pin, axes_of: rod, direction: [0, 0, 1]}
  about: {joint: pin, axes_of: ground, direction: [0, -1, 0]}
outputs: [along.force, across.force, about.moment]
scenes: {fall: {end: 1}}
"""

DRIVES = {"free": "", "sprung": ", spring: {stiffness: 7, damping: 2}", "guided": ', guide: "0.4 + 3*t + t**2"'}


@pytest.mark.parametrize(("joined", "sign"), [("ground, rod", 1), ("rod, ground", -1)])
@pytest.mark.parametrize("drive", DRIVES.values(), ids=DRIVES.keys())
def test_pin_of_a_pendulum(joined: str, sign: int, drive: str) -> None:
    """Along the rod m (g sin a - l w^2), across it m (g cos a + l w'), about the pin nothing, the spring's moment or the guide's."""
    model = read_model_text(PENDULUM.replace("JOINED", joined).replace("DRIVE", drive), "pendulum.yaml")
    scene = model.scenes["fall"]
    blocks, dense = both(build_topology(model), scene, outputs=scene.outputs)
    at = Instant(q=np.full(dense.nq, 0.4 * sign), v=np.full(dense.nv, 3.0 * sign))
    vdot = blocks.solve(at, np.zeros(0), NUMERICS).vdot
    found = blocks.report(at, vdot, np.zeros(0), NUMERICS)
    a, w, m, g, arm, J = 0.4, 3.0, 3.0, 10.0, 0.5, 0.25 + 3 * 0.5**2
    if "guide" in drive:
        a, w = sign * a, sign * w
        bent = 2.0 * sign
        torque = J * bent + m * g * arm * np.cos(a)
    else:
        torque = -(7 * a + 2 * w) if drive else 0.0
        bent = (torque - m * g * arm * np.cos(a)) / J
    expected = (m * (g * np.sin(a) - arm * w**2), m * (g * np.cos(a) + arm * bent), torque)
    assert list(found.values()) == pytest.approx([sign * x for x in expected], abs=1e-12)


SPATIAL = """
cutjoint: 1
name: spatial
gravity: [0.3, -0.2, -9.81]
bodies:
  crank: {mass: 1.2, centre_of_mass: [0.05, 0.02, 0.1], inertia: [0.01, 0.02, 0.015]}
  coupler: {mass: 0.8, centre_of_mass: [0.5, 0.25, 0.25], inertia: [0.05, 0.04, 0.06, 0.01, 0, 0.005]}
  rocker: {mass: 1.5, centre_of_mass: [1, 0.3, 0.2], inertia: [0.03, 0.02, 0.04]}
joints:
  drive: {kind: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: [0, 1, 0.2]}
  ball: {kind: spherical, bodies: [coupler, crank], at: [0.1, 0.05, 0.2]}
  cross: {kind: universal, bodies: [coupler, rocker], at: [0.9, 0.4, 0.3], axis: [0, 1, 0], axis_2: [1, 0, 0]}
  swing: {kind: revolute, bodies: [rocker, ground], at: [1.1, 0.3, 0], axis: [0.2, 1, 0]}
forces:
  rope: {kind: point_spring, bodies: [crank, rocker], from: [0, 0.1, 0.1], to: [1, 0.2, 0.1], law: "50*length + rate"}
  mount: {kind: bushing, bodies: [ground, coupler], at: [0.5, 0, 0], stiffness: [10, 20, 30, 4, 5, 6]}
  push: {kind: load, body: rocker, at: [1, 0.3, 0.3], force: [4, -3, 2]}
scenes: {run: {end: 1}}
"""


def motion_of(dense: DenseMechanism) -> tuple[Instant, Array, Array]:
    """The design pose with a crank that turns at 2 rad/s: speeds, accelerations, and multipliers of least norm."""
    still = Instant(q=design(dense), v=np.zeros(dense.nv))
    axis = np.array([0, 1, 0.2]) / np.hypot(1, 0.2)
    rows = np.vstack([dense.closures(still).jacobian, axis @ dense.motion(still).spin("crank")[0]])
    v = np.linalg.lstsq(rows, np.append(np.zeros(dense.m), 2.0), rcond=None)[0]
    at = Instant(q=still.q, v=v)
    motion, closures = dense.motion(at), dense.closures(at)
    M, bias = dense.inertia(motion)
    J, force = closures.jacobian, dense.applied(at, motion) - bias
    system = np.block([[M, J.T], [J, np.zeros((dense.m, dense.m))]])
    solution = np.linalg.lstsq(system, np.concatenate([force, -closures.drift]), rcond=1e-12)[0]
    return at, solution[: dense.nv], solution[dense.nv :]


def design(dense: DenseMechanism) -> Array:
    """Zero coordinates and unit quaternions."""
    q = np.zeros(dense.nq)
    for x in dense.layout.values():
        if x.ball:
            q[x.q + x.scalars] = 1.0
    return q


def test_cut_or_in_the_tree_a_joint_has_the_same_reaction() -> None:
    """Force and moment of all four joints, whichever of them is cut."""
    found = []
    for cut in ("drive", "ball", "cross", "swing"):
        model = with_reactions(read_model_text(SPATIAL, "spatial.yaml"))
        model = replace(model, joints=tuple(replace(j, cut=j.name == cut) for j in model.joints))
        outputs = tuple(Output(element=r.name, quantity=q, span=NOWHERE) for r in model.reactions for q in COMPONENTS)
        blocks, dense = both(build_topology(model), model.scenes["run"], outputs=outputs)
        at, vdot, multipliers = motion_of(dense)
        found.append(list(blocks.report(at, vdot, multipliers, NUMERICS).values()))
    assert np.abs(found[0]).max() > 10
    for other in found[1:]:
        assert other == pytest.approx(found[0], abs=1e-9)


@pytest.mark.parametrize("method", ["recursive", "recursive-newton"])
def test_equations_of_motion_do_not_feel_reactions(method: str) -> None:
    """The functions but `report` are the same, byte for byte."""
    model = read_model_text(SPATIAL, "spatial.yaml")
    asked = with_reactions(model)
    outputs = (Output(element="rocker", quantity="x", span=NOWHERE),)
    more = tuple(Output(element=r.name, quantity=q, span=NOWHERE) for r in asked.reactions for q in COMPONENTS)
    without, with_ = (generate(m, m.scenes["run"], o, method=method)[2].files for m, o in ((model, outputs), (asked, (*outputs, *more))))
    same = [name for name in without if name.endswith(".cpp") and not name.endswith(("report.cpp", "description.cpp"))]
    assert {"evaluate.cpp", "system_dynamic_residual.cpp"}.intersection(same)
    assert [name for name in same if without[name] != with_[name]] == []


#: Kinds whose force natural coordinates give in some mechanism.
FOUND = tuple(kind for kind in random_models.PLAIN_KINDS if kind not in (K.FIXED, K.FREE))


def external_wrenches(model: Model, kind: JointKind) -> Model:
    """The model with a force on the displacement of each joint of a kind that has one."""
    coordinates = {j.name: [c for c in COORDINATES[kind] if c.startswith("displacement")] for j in model.joints if j.kind is kind}
    law = 5 - 4 * random_models.variable("position") - random_models.variable("rate")
    forces = (
        JointForce(name=f"push_in_{joint}", joint=joint, coordinate=names[0], unit="m", law=law, active=True, span=NOWHERE)
        for joint, names in coordinates.items() if names
    )  # fmt: skip
    return replace(model, forces=(*model.forces, *forces))


@pytest.mark.parametrize("kind", FOUND)
@pytest.mark.parametrize("is_reversed", [False, True], ids=["normal", "reversed"])
def test_tree_joints_in_natural_coordinates(kind: JointKind, is_reversed: bool) -> None:
    """A force of a joint in the tree that natural coordinates have is that of the recursion."""
    model = external_wrenches(with_reactions(without_rod_forces(random_models.tree_with(kind, is_reversed, 1))), kind)
    joint = next(j for j in model.joints if j.kind is kind)
    outputs = tuple(Output(element=f"all_of_{joint.name}", quantity=q, span=NOWHERE) for q in COMPONENTS[:3])
    pair = make_pair(model, SCENE, outputs)
    at = states(pair, 1)[0]
    expected, found, known = recursive_report(pair, at), natural_report(pair, at), determined(pair, at)
    assert known
    for name in known:
        assert found[name] == pytest.approx(expected[name], abs=1e-6 * max(1.0, abs(expected[name]))), name


def refusal(model: Model, element: str, quantity: str) -> str:
    with pytest.raises(ModelError) as caught:
        generate(model, model.scenes["run"], (Output(element=element, quantity=quantity, span=NOWHERE),), method="augmented")
    return str(caught.value)


def test_what_natural_coordinates_refuse() -> None:
    text = SPATIAL.replace("scenes:", "reactions:\n  pull: {joint: weld, axes_of: ground, direction: [1, 0, 0]}\nscenes:")
    text = text.replace("forces:", "  weld: {kind: fixed, bodies: [crank, disc], at: [0, 0, 0]}\nforces:", 1)
    text = text.replace("joints:", "  disc: {mass: 1, centre_of_mass: [0, 0.1, 0], inertia: [0.1, 0.1, 0.1]}\njoints:", 1)
    model = read_model_text(text, "spatial.yaml")
    way_out = "; use --method recursive or recursive-newton, or leave this output out"
    assert f"reaction 'pull': natural coordinates do not give moments of joints{way_out}" in refusal(model, "pull", "moment")
    fixed = "reaction 'pull': natural coordinates do not give the force of joint 'weld': it is fixed, so that both bodies are one there"
    assert f"{fixed}{way_out}" in refusal(model, "pull", "force")
