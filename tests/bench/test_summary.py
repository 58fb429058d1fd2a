"""The part of the report that git holds: a summary, a page that links its charts, and the charts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from click import ClickException
from click.testing import CliRunner

from cutjoint_bench.findings import leading
from cutjoint_bench.report.page import NO_MAPS
from cutjoint_bench.report.tables import milliseconds
from cutjoint_bench.studies import report, tables


def point(dt: float, seconds: float, error: float, failure: str = "") -> dict[str, Any]:
    errors = {"position": error, "velocity": error, "energy": None, "residual": None}
    return {"dt": dt, "seconds": [] if failure else [seconds], "errors": errors, "failure": failure}


def line(name: str, group: str, *points: dict[str, Any]) -> dict[str, Any]:
    of = {"contender": name, "label": name, "group": group, "configuration": {"digest": "0123456789"}}
    return {**of, "dt": points[0]["dt"], "points": points}


STUDIES: dict[str, Any] = {
    "swings": {
        "machine": {"processor": "one", "system": "another"}, "drifts": [], "atlases": [], "situations": [],
        "cases": [{
            "name": "clock/swing", "title": "and peers", "model": "clock", "scene": "swing", "end": 1.0, "reference": None,
            "lines": [
                line("recursive", "generated", point(0.01, 0.5, 1e-4), point(0.005, 1.0, 2e-5), point(0.001, 9.0, 1e-6)),
                line("mujoco/rk4", "peer", point(0.01, 3.0, 1e-3), point(0.005, 6.0, 5e-5), point(0.001, 0.1, 1e-9, "it stopped")),
            ],
        }],
    }
}  # fmt: skip


def test_tables_come_from_the_summary_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tables, "SUMMARY", tmp_path / "summary.json")
    report.write_docs(tmp_path, STUDIES)
    said = CliRunner().invoke(tables.main, catch_exceptions=False).output
    assert said.count("## ") == 4
    assert "| clock/swing (swings) | recursive: 500 | recursive: 500 | recursive: " in said
    assert "| study | processor | system | measured with other code than this version's |\n| --- | --- | --- | --- |\n" in said
    assert "## swings: clock/swing, at equal errors" in said
    assert "| recursive | step 10 ms | 500 ± 0 | 1.0e-04 |" in said


def test_the_page_begins_with_the_question_and_ends_with_provenance(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(report, "PICTURES", ("swings",))
    report.write_docs(tmp_path, STUDIES)
    page = (tmp_path / "bench.html").read_text(encoding="utf-8")
    parts = ('id="explore"', "<h2>clock/swing: and peers</h2>", "At equal accuracy", "At the scene's own step", "Provenance")
    assert [page.index(part) for part in parts] == sorted(page.index(part) for part in parts)
    assert NO_MAPS.note in page
    assert page.count("<svg") == 1, "the chart of all points alone"
    assert (tmp_path / "clock_swing.svg").read_text(encoding="utf-8").startswith("<svg")


def test_a_page_that_is_too_large_for_git_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(report, "LARGEST", 1000)
    with pytest.raises(ClickException, match=r"the page for .* has \d+ bytes"):
        report.write_docs(tmp_path, STUDIES)
    assert not (tmp_path / "bench.html").exists()


def test_times_have_three_digits() -> None:
    assert [milliseconds(s) for s in (1.2345e-5, 0.99949, 0.9996, 1.4837, 12.0)] == ["0.0123", "999", "1000", "1480", "12000"]


def test_what_leads_its_group_is_drawn() -> None:
    lines = [
        line("recursive", "generated", point(0.01, 9.0, 1e-4)), line("augmented", "generated", point(0.01, 10.0, 1e-4)),
        line("recursive/rk4", "integrators", point(0.01, 2.0, 1e-6)), line("recursive/events", "integrators", point(0.01, 3.0, 1e-6)),
        line("recursive/radau5", "integrators", point(0.01, 1.0, 1e-3)), line("mujoco/rk4", "peer", point(0.01, 3.0, 1e-6)),
        line("mujoco/euler", "peer", point(0.01, 4.0, 1e-4)), line("exudyn/index2", "peer", point(0.01, 99.0, 1e-3)),
        line("classical", "solvers", point(0.01, 1.0, 1.0)),
    ]  # fmt: skip
    drawn = [found["contender"] for found in leading(lines)]
    assert drawn == ["recursive", "augmented", "recursive/rk4", "recursive/radau5", "mujoco/rk4", "exudyn/index2"]
