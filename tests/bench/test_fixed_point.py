"""Limits up to which the fixed point's map contracts, against closed forms, and runs up to there."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.run.artifact import Artifact
from cutjoint.run.simulation import simulate
from cutjoint_bench.cases import make_case
from cutjoint_bench.exact.chain import Chain, write_chain
from cutjoint_bench.fixed_point import predict_limit
from cutjoint_bench.records import Case
from tests.conftest import MODELS

#: A mass m on a spring k with a damper c.
OSCILLATOR = """\
cutjoint: 1
name: oscillator
gravity: [0, 0, 0]
bodies: {{mass: {{mass: 2, centre_of_mass: [0, 0, 0]}}}}
joints: {{rail: {{kind: prismatic, bodies: [ground, mass], at: [0, 0, 0], axis: [1, 0, 0], spring: {{stiffness: {k}, damping: {c}}}}}}}
scenes: {{swing: {{end: 0.1, output_step: 0.01, positions: {{rail.displacement: 1}}, numerics: {{dt: 0.001}}}}}}
"""


def compiled(case: Case) -> Artifact:
    return compile_scene(case.model, case.scene, CompileOptions(outputs=case.outputs))


@pytest.mark.parametrize(("k", "c"), [(800.0, 0.0), (0.0, 40.0), (800.0, 40.0)])
def test_an_oscillator(k: float, c: float, tmp_path: Path) -> None:
    """dt^2/4 k/m + dt/2 c/m = 1."""
    (tmp_path / "model.yaml").write_text(OSCILLATOR.format(k=k, c=c), encoding="utf-8")
    case = make_case(tmp_path / "model.yaml")
    found = predict_limit(case, compiled(case))
    assert found is not None
    (exact,) = (root for root in np.roots([k / 8, c / 4, -1]) if root > 0)
    assert found.contracts == pytest.approx(exact, rel=2e-3)


def test_runs_pass_as_far_as_it_is_predicted() -> None:
    """The flyball governor, whose states hardly change, up to where the map contracts: mixed iterations end in time there too."""
    case = make_case(MODELS / "flyball.yaml", end=1.1)
    artifact = compiled(case)
    found = predict_limit(case, artifact)
    assert found is not None
    row = replace(artifact, scene=replace(case.scene, output_step=case.scene.end))
    assert simulate(row, dt=0.99 * found.contracts).failure is None


def test_nothing_is_predicted_where_the_penalty_follows_the_step(tmp_path: Path) -> None:
    (tmp_path / "model.yaml").write_text(write_chain(Chain(windows=2)), encoding="utf-8")
    case = make_case(tmp_path / "model.yaml", end=0.1)
    assert predict_limit(case, compiled(case)) is None
