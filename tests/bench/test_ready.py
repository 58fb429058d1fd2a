"""What is made before the clock runs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from cutjoint.bench.cases import make_case
from cutjoint.bench.contenders import choose
from cutjoint.bench.ready import make_ready
from cutjoint.bench.store import Store
from cutjoint.bench.study import Plan, perform
from tests.conftest import MODELS


def records(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line)["of"] for line in path.read_text(encoding="utf-8").splitlines()]


def test_only_times_are_left_to_measure(tmp_path: Path) -> None:
    """Limits and drift are made on all cores, under the keys by which the bench looks for them."""
    path = tmp_path / "measurements.jsonl"
    plan = Plan(cases=[make_case(MODELS / "pendulum.yaml", end=1.0)], contenders=choose(["recursive"]), steps=[0.01], drift=True)
    make_ready([plan], path)
    ready = records(path)
    assert sorted(of.get("limit", "drift") for of in ready) == ["drift", "largest step", "predicted"]
    data = perform(plan, Store(path))
    assert len(data["cases"][0]["lines"][0]["points"][0]["seconds"]) == plan.repetitions
    (left,) = records(path)[len(ready) :]
    assert left["dt"] == 0.01
    assert "limit" not in left


def test_what_fails_is_left_to_the_bench(tmp_path: Path) -> None:
    plan = Plan(cases=[make_case(MODELS / "pendulum.yaml", end=1.0)], contenders=choose(["recursive-newton/reduced"]), reference="none")
    make_ready([plan], tmp_path / "measurements.jsonl")
    (line,) = perform(plan, Store(tmp_path / "measurements.jsonl"))["cases"][0]["lines"]
    assert "no pass makes the model smaller" in line["refused"]
