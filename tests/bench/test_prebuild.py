"""Work that a bench does before the clock runs."""

from __future__ import annotations

import json
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cutjoint.package.errors import RunError
from cutjoint_bench import reference
from cutjoint_bench.cases import make_case
from cutjoint_bench.contenders import choose
from cutjoint_bench.prebuild import prebuild
from cutjoint_bench.progress import part_of
from cutjoint_bench.reference import Reference
from cutjoint_bench.store import Store
from cutjoint_bench.study import Plan, perform
from tests.conftest import MODELS
from tests.toolchain.damage import damaged_records


def records(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line)["of"] for line in path.read_text(encoding="utf-8").splitlines()]


@pytest.mark.heavy
def test_only_times_are_left_to_measure(tmp_path: Path) -> None:
    """Limits and drift are made on all cores, under the keys by which the bench looks for them."""
    path = tmp_path / "measurements.jsonl"
    plan = Plan(cases=[make_case(MODELS / "pendulum.yaml", end=1.0)], contenders=choose(["recursive"]), steps=[0.01], drift=True)
    prebuild([plan], path)
    ready = records(path)
    assert sorted(of.get("limit", "drift") for of in ready) == ["drift", "largest step", "predicted"]
    data = perform(plan, Store(path))
    assert len(data["cases"][0]["lines"][0]["points"][0]["seconds"]) == plan.repetitions
    (left,) = records(path)[len(ready) :]
    assert left["dt"] == 0.01
    assert "limit" not in left


@pytest.mark.parametrize(
    ("contender", "words"),
    [
        ("recursive-newton/reduced", "no pass makes the model smaller"),
        ("recursive-newton/functions", "no loops can be closed by functions"),
    ],
)
def test_what_fails_is_left_to_the_bench(contender: str, words: str, tmp_path: Path) -> None:
    plan = Plan(cases=[make_case(MODELS / "pendulum.yaml", end=1.0)], contenders=choose([contender]), reference="none")
    prebuild([plan], tmp_path / "measurements.jsonl")
    (line,) = perform(plan, Store(tmp_path / "measurements.jsonl"))["cases"][0]["lines"]
    assert words in line["refused"]


def test_a_reference_is_made_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two that want it at the same time one makes it, the other finds it."""
    case = make_case(MODELS / "pendulum.yaml", end=0.5)
    made: list[float] = []

    def integrate(*_: object) -> Reference:
        made.append(time.perf_counter())
        time.sleep(0.2)
        return Reference(t=np.zeros(1), columns={}, position_apart=0.0, velocity_apart=0.0, provenance={})

    monkeypatch.setenv("CUTJOINT_CACHE", str(tmp_path))
    monkeypatch.setattr(reference, "_compiled", lambda *_: None)
    monkeypatch.setattr(reference, "_integrate", integrate)
    with ThreadPoolExecutor(2) as pool:
        one, other = pool.map(reference.find_reference, [case, case])
    assert len(made) == 1
    assert one.t.tolist() == other.t.tolist() == [0.0]


def test_a_reference_that_came_to_harm_is_made_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    case = make_case(MODELS / "pendulum.yaml", end=0.5)
    about = {"position_apart": 1e-9, "velocity_apart": np.nan, "provenance": {"routes": ["one"]}}
    made = Reference(t=np.zeros(2), columns={"bob.x": np.ones(2)}, **about)
    monkeypatch.setenv("CUTJOINT_CACHE", str(tmp_path))
    monkeypatch.setattr(reference, "_compiled", lambda *_: None)
    monkeypatch.setattr(reference, "_integrate", lambda *_: made)
    reference.find_reference(case)
    (file,) = (tmp_path / "references").iterdir()
    sound = file.read_bytes()
    for harmed in damaged_records(sound):
        file.write_bytes(harmed)
        assert reference.find_reference(case).columns["bob.x"].tolist() == [1.0, 1.0]
        assert file.read_bytes() == sound


def test_a_parameter_that_is_not_there_is_reported_before_anything_is_made(tmp_path: Path) -> None:
    plan = Plan(cases=[make_case(MODELS / "pendulum.yaml", end=1.0)], contenders=[], atlas=True, vary="stifness")
    begun: list[str] = []
    with pytest.raises(RunError, match="stifness"):
        prebuild([plan], tmp_path / "measurements.jsonl", begun.append)
    assert not begun


def test_a_line_that_was_broken_off_is_passed_over_and_nothing_is_lost(tmp_path: Path) -> None:
    """Two that find the file so, and both end the line."""
    path = tmp_path / "measurements.jsonl"
    Store(path).get({"what": 1}, lambda: {"value": 1})
    with path.open("a", encoding="utf-8") as stream:
        stream.write('{"key": "half')
    one, other = Store(path), Store(path)
    one.get({"what": 2}, lambda: {"value": 2})
    other.get({"what": 3}, lambda: {"value": 3})
    again = Store(path)
    assert [again.get({"what": n}, lambda: {"value": 0})["value"] for n in (1, 2, 3)] == [1, 2, 3]


def test_shares_of_parts_are_those_of_the_whole() -> None:
    reported: list[tuple[str, float | None]] = []

    def say(text: str, /, *, share: float | None = None) -> None:
        reported.append((text, share))

    part = part_of(part_of(say, 1, 2), 3, 4)
    part("half of the last quarter of the second half", share=0.5)
    part("no share")
    assert reported == [("half of the last quarter of the second half", 0.9375), ("no share", None)]
