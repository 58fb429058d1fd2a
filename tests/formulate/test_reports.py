"""Reported quantities against the dense oracle: motion of bodies and markers, coordinates, laws and their tangents, reactions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cutjoint.model.expressions.quantities import quantities
from cutjoint.model.records import COORDINATES, GROUND, SPEEDS, JointKind, Model, Output, Reaction
from cutjoint.topology.build import build_topology
from tests.mechanisms import random_models
from tests.mechanisms.random_models import CUT_KINDS, NOWHERE, TREE_KINDS, K, scene, workshop
from tests.oracles.dense import Instant, Numerics
from tests.oracles.evaluation import both
from tests.oracles.reports import reported

NUMERICS = Numerics(penalty=1e3, damping_ratio=0.7, frequency=5.0)
#: The tangents' oracle differentiates numerically.
TANGENTS = ("stiffness", "damping")


def all_outputs(model: Model) -> tuple[Output, ...]:
    """Every quantity of every element but fixed and cut joints."""
    tree = [j for j in model.joints if not j.cut]
    elements = (*model.bodies, *model.markers, *model.reactions, *model.forces, *tree)
    return tuple(Output(element=e.name, quantity=q, span=NOWHERE) for e in elements for q in quantities(e))


def with_reactions(model: Model) -> Model:
    """The model with all components of the reaction of every joint, along the axes of the base."""
    reactions = (Reaction(name=f"all_of_{j.name}", joint=j.name, body=j.base, direction=None, span=NOWHERE) for j in model.joints)
    return replace(model, reactions=(*model.reactions, *reactions))


def compare(model: Model, seed: int) -> None:
    model = with_reactions(model)
    outputs = all_outputs(model)
    blocks, dense = both(build_topology(model), scene(), outputs=outputs, parameters={"size": 1.3})
    rng = np.random.default_rng(seed)
    q, v = random_models.state(dense.layout, dense.nq, dense.nv, rng)
    at, multipliers, vdot = Instant(q=q, v=v, t=0.37), 10 * rng.standard_normal(dense.m), rng.standard_normal(dense.nv)
    found = blocks.report(at, vdot, multipliers, NUMERICS)
    expected = reported(dense, at, vdot, multipliers)
    assert {column.rpartition(".")[2] for column in found} >= {"x", "vy", "az", "wx", "roll", "pitch", "yaw", "force", *TANGENTS}
    for output in outputs:
        value = found[output.column]
        if (output.element, output.quantity) in expected:
            bound = 1e-5 if output.quantity in TANGENTS else 1e-10
            assert value == pytest.approx(expected[output.element, output.quantity], rel=bound, abs=bound), output.column
        else:
            (joint,) = (j for j in model.joints if j.name == output.element)
            if joint.guide is None:
                x = dense.layout[joint.name]
                named = dict(zip(COORDINATES[joint.kind], q[x.q_slice], strict=False))
                named |= dict(zip(SPEEDS[joint.kind], v[x.v_slice], strict=True))
                assert value == named[output.quantity], output.column


@pytest.mark.parametrize("kind", CUT_KINDS)
def test_reaction_of_a_cut_joint(kind: JointKind) -> None:
    compare(random_models.loop_with(kind, "roots", 5), 5)


@pytest.mark.parametrize("kind", TREE_KINDS)
def test_reaction_of_a_tree_joint(kind: JointKind) -> None:
    """As the mechanism's only tree, at the ground and on others, alternately the one and the other way round."""
    compare(random_models.tree_with(kind, TREE_KINDS.index(kind) % 2 == 0, 1), 1)


def test_reactions_of_guided_and_geared_joints() -> None:
    compare(random_models.loop_with(K.SPHERICAL, "guided", 2), 2)
    compare(random_models.with_gears(random_models.random_tree(0), 0), 0)


@pytest.mark.parametrize("seed", range(4))
def test_loops(seed: int) -> None:
    compare(random_models.random_loops(seed), seed)


@pytest.mark.parametrize("kind", random_models.GUIDABLE)
def test_guided_joint(kind: JointKind) -> None:
    """A guided joint's coordinate and rate are the guide's."""
    w = workshop(0, f"guide of {kind}")
    w.guided(GROUND, kind)
    model, name = w.model(), w.joints[0].name
    outputs = tuple(Output(element=name, quantity=q, span=NOWHERE) for q in (*COORDINATES[kind], *SPEEDS[kind]))
    blocks, _ = both(build_topology(model), scene({"drive": 0.3 * random_models.TIME}), outputs=outputs)
    none = np.zeros(0)
    for motion in (1.0, 0.0):
        at = Instant(q=none, v=none, t=0.4, motion=motion)
        reported = list(blocks.report(at, none, none, NUMERICS).values())
        for place, rate, guide in zip(reported, reported[len(reported) // 2 :], w.joints[0].guide, strict=False):
            now, after, before = (
                float(guide.subs({random_models.DRIVE.symbol: 0.3 * t, random_models.TIME: t})) for t in (0.4, 0.401, 0.399)
            )
            assert place == pytest.approx(now, rel=1e-14)
            assert rate == pytest.approx(motion * (after - before) / 0.002, rel=1e-6)


@pytest.mark.parametrize("sign", [1, -1])
def test_attitude_of_a_body_on_its_nose(sign: int) -> None:
    """At ninety degrees of pitch rounding must not push the sine over one."""
    w = workshop(0, "nose")
    w.grow(GROUND, K.FREE, is_reversed=False)
    outputs = tuple(Output(element="body_0", quantity=q, span=NOWHERE) for q in ("roll", "pitch", "yaw"))
    blocks, _ = both(build_topology(w.model()), scene(), outputs=outputs)
    half = np.sqrt(0.5)  # 2 half half > 1 in double precision
    q = np.array([0, 0, 0, half, 0, sign * half, 0])
    found = blocks.report(Instant(q=q, v=np.zeros(6)), np.zeros(6), np.zeros(0), NUMERICS)
    assert found["body_0.pitch"] == pytest.approx(sign * np.pi / 2, abs=1e-7)
