"""The page that is kept: studies that are not measured anew stay on it, and what is not of this version is named."""

from __future__ import annotations

import json
from copy import deepcopy
from pathlib import Path

import pytest
from click.testing import CliRunner

from cutjoint_bench.cases import make_case
from cutjoint_bench.contenders import choose
from cutjoint_bench.outdated import find_outdated
from cutjoint_bench.store import Store
from cutjoint_bench.studies import report
from cutjoint_bench.study import Plan, perform
from tests.conftest import MODELS


def swing(*contenders: str, end: float = 0.2) -> Plan:
    case = make_case(MODELS / "pendulum.yaml", end=end)
    return Plan(cases=[case], contenders=choose(contenders), steps=[0.01, 0.005], repetitions=1, reference="extended", limits=False)


@pytest.mark.heavy
def test_what_is_of_other_code_or_missing_is_named(tmp_path: Path) -> None:
    plan = swing("recursive", "augmented/generic")
    data = perform(plan, Store(tmp_path / "store.jsonl"))
    assert find_outdated(plan, data) == []
    changed = deepcopy(data)
    changed["cases"][0]["lines"][1]["configuration"]["runtime"] = "another"
    assert find_outdated(plan, changed) == ["pendulum/swing, augmented, generic solver"]
    changed["cases"][0]["lines"][0]["configuration"]["digest"] = "another"
    assert find_outdated(plan, changed) == ["pendulum/swing, recursive", "pendulum/swing, augmented, generic solver"]
    more = swing("recursive", "augmented/generic", "classical", "recursive/half")  # of which a pendulum has no half
    assert find_outdated(more, data) == ["pendulum/swing, classical (not measured)"]


@pytest.mark.heavy
def test_studies_that_are_not_measured_stay_on_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(report, "MEASUREMENTS", tmp_path / "store.jsonl")
    monkeypatch.setattr(report, "STUDIES", {"short": lambda: swing("recursive"), "shorter": lambda: swing("recursive", end=0.1)})
    (choice,) = (p for p in report.main.params if p.name == "only")
    monkeypatch.setattr(choice, "type", type(choice.type)(["short", "shorter"]))
    docs = tmp_path / "docs"
    where = ["--out", str(tmp_path), "--docs", str(docs)]
    first = CliRunner().invoke(report.main, ["--only", "shorter", *where], catch_exceptions=False)
    assert f"{docs} is left as it is, since these studies are not in {tmp_path / 'bench.json'}: short" in first.output
    assert not docs.exists()
    CliRunner().invoke(report.main, ["--only", "short", *where], catch_exceptions=False)
    studies = json.loads((tmp_path / "bench.json").read_text())["studies"]
    assert [(name, data["cases"][0]["end"], data.get("outdated")) for name, data in studies.items()] == [
        ("short", 0.2, None),
        ("shorter", 0.1, []),
    ]
    page = (tmp_path / "bench.html").read_text()
    assert "<td>short</td>" in page
    assert "0.1 s of motion" in page
    studies["shorter"]["cases"][0]["lines"][0]["configuration"]["digest"] = "another"
    (tmp_path / "bench.json").write_text(json.dumps({"studies": studies}))
    CliRunner().invoke(report.main, ["--only", "short", *where], catch_exceptions=False)
    assert json.loads((tmp_path / "bench.json").read_text())["studies"]["shorter"]["outdated"] == ["pendulum/swing, recursive"]
    assert ">pendulum/swing, recursive</td>" in (tmp_path / "bench.html").read_text()
