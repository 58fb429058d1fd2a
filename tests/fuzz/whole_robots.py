"""Random URDF trees without a fault: accelerations in random states are those of Pinocchio, which reads the same file."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np

from cutjoint.topology.build import build_topology
from cutjoint.topology.reading import read_model
from tests.oracles.dense import Instant, Numerics
from tests.oracles.evaluation import BlockMechanism

_FREE = Numerics(penalty=1.0, damping_ratio=1.0, frequency=1.0)


def write(rng: random.Random) -> str:
    """Two to five links; joints, centres of mass and axes of inertia stand askew, and joints are turned against their parents."""
    links, joints = ['<link name="world"/>'], []
    for k in range(rng.randint(2, 5)):
        squares = [rng.uniform(0.05, 1) for _ in "xyz"]  # moments of inertia of a body: sums of two of three squares
        moments = dict(zip(("ixx", "iyy", "izz"), (sum(squares) - square for square in squares), strict=True))
        inertia = " ".join(f'{name}="{value:.4f}"' for name, value in {**moments, "ixy": 0, "ixz": 0, "iyz": 0}.items())
        links.append(
            f'<link name="b{k}"><inertial>{_origin(rng)}<mass value="{rng.uniform(0.2, 3):.3f}"/><inertia {inertia}/></inertial></link>'
        )
        parent = rng.choice(["world", *(f"b{i}" for i in range(k))])
        kind = rng.choice(("continuous", "continuous", "prismatic"))
        limit = '<limit lower="-9" upper="9" effort="1" velocity="1"/>' if kind == "prismatic" else ""
        joints.append(
            f'<joint name="j{k}" type="{kind}"><parent link="{parent}"/><child link="b{k}"/>{_origin(rng)}'
            f'<axis xyz="{_triple(rng)}"/>{limit}</joint>'
        )  # fmt: skip
    return f'<robot name="whole">{"".join(links + joints)}</robot>'


def _triple(rng: random.Random) -> str:
    return " ".join(f"{rng.uniform(-1, 1):.3f}" for _ in "xyz")


def _origin(rng: random.Random) -> str:
    return f'<origin xyz="{_triple(rng)}" rpy="{_triple(rng)}"/>'


def require_accelerations(path: Path, seed: int) -> None:
    """Fails where accelerations of joints are not those of Pinocchio, to rounding times the condition of the mass matrix."""
    import pinocchio  # the fuzzer goes without it

    model = read_model(path)
    blocks = BlockMechanism(build_topology(model), next(iter(model.scenes.values())))
    other = pinocchio.buildModelFromUrdf(str(path))
    other.gravity.linear = np.array([float(x) for x in model.gravity])
    data, rng = other.createData(), np.random.default_rng(seed)
    places = {chart.joint: (chart.q, chart.v) for chart in blocks.equations.charts}
    names = list(other.names)[1:]
    for _ in range(3):
        q, v = rng.uniform(-2, 2, len(names)), rng.uniform(-2, 2, len(names))
        ours = Instant(q=np.zeros(len(q)), v=np.zeros(len(v)))
        theirs, rates = pinocchio.neutral(other), np.zeros(other.nv)
        for name, angle, rate in zip(names, q, v, strict=True):
            joint = other.joints[other.getJointId(name)]
            theirs[joint.idx_q : joint.idx_q + joint.nq] = (np.cos(angle), np.sin(angle)) if joint.nq == 2 else (angle,)
            rates[joint.idx_v], ours.q[places[name][0]], ours.v[places[name][1]] = rate, angle, rate
        expected = pinocchio.aba(other, data, theirs, rates, np.zeros(other.nv))
        found = blocks.solve(ours, np.zeros(0), _FREE).vdot
        expected = np.array([expected[other.joints[other.getJointId(name)].idx_v] for name in names])
        found = np.array([found[places[name][1]] for name in names])
        condition = np.linalg.cond(pinocchio.crba(other, data, theirs) + np.triu(data.M, 1).T)
        assert np.abs(found - expected).max() <= 1e-11 * condition * max(1.0, np.abs(expected).max()), (names, found, expected)
