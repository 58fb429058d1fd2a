"""Every reduced model of a reduction sequence is a contender."""

from __future__ import annotations

from pathlib import Path

import pytest

from cutjoint.reduce.sequence import reduction_sequence
from cutjoint_bench.cases import make_case
from cutjoint_bench.contenders import CONTENDERS, choose
from cutjoint_bench.reductions import NoReductionError
from cutjoint_bench.store import Store
from cutjoint_bench.study import Plan, perform
from tests.conftest import MODELS
from tests.mechanisms.planar import SWING


def test_lines_are_named_by_reduced_model(tmp_path: Path) -> None:
    """The reduced models that a scene has are its lines, and no others."""
    path = tmp_path / "swing.yaml"
    path.write_text(SWING)
    case = make_case(path)
    contenders = choose(["classical", *(f"classical/{name}" for name in ("links", "planar", "guards", "frozen"))])
    plan = Plan(cases=[case], contenders=contenders, reference="none", limits=False, steps=[0.01], repetitions=1)
    (found,) = perform(plan, Store(tmp_path / "measurements.jsonl"))["cases"]
    full, planar = found["lines"]
    assert [(line["contender"], line["label"], line["group"]) for line in (full, planar)] == [
        ("classical", "classical", "generated"), ("classical/planar", "classical, planar", "reductions"),
    ]  # fmt: skip
    assert planar["points"][0]["seconds"]
    assert planar["configuration"]["digest"] != full["configuration"]["digest"]


def test_models_that_a_scene_does_not_have() -> None:
    case = make_case(MODELS / "pendulum.yaml")
    assert len(reduction_sequence(case.model, case.scene)) == 1
    with pytest.raises(NoReductionError, match="the pass 'links' leaves this scene as it is"):
        CONTENDERS["recursive/links"].prepare(case)
