"""Promises of docs/reference/files.md about the table of a batch."""

from __future__ import annotations

import json
import resource
import signal
from pathlib import Path

import numpy as np
import pytest

from cutjoint.run.cases import CaseTable
from cutjoint.run.outputs import OutputError
from tests.conftest import needs_cpp
from tests.run.program import PATIENCE, files, has_content, launch, run, small_disk, wait_for
from tests.run.test_batch import TEXT

pytestmark = needs_cpp


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


CASES = [{"load": float(k)} for k in range(6)]


def results(*loads: int) -> list[dict[str, object]]:
    return [{"status": "done", "evaluations": 7, "end": [k], "minimum": [None], "maximum": [k + 0.5]} for k in loads]


def rows_of(path: Path) -> list[str]:
    return [line.partition(",")[0] for line in path.read_text(encoding="utf-8").splitlines()[1:]]


def test_rows_of_a_batch_are_written_when_they_are_done(folder: Path) -> None:
    with CaseTable(Path("out.csv"), CASES, {"a.x": "m"}) as table:
        partial = Path("out.partial.csv")
        table.take(2, results(2, 3))
        assert rows_of(partial) == []  # those before are not done
        table.take(0, results(0, 1))
        assert rows_of(partial) == ["0.0", "1.0", "2.0", "3.0"]
        table.take(4, results(4, 5))
        table.finish()
    assert Path("out.csv").read_text(encoding="utf-8").splitlines()[:2] == [
        "load,run.failure,run.evaluations,a.x.end,a.x.min,a.x.max", "0.0,,7,0.0,,0.5",
    ]  # fmt: skip
    assert rows_of(Path("out.csv")) == [repr(case["load"]) for case in CASES]
    assert json.loads(Path("out.units.json").read_text(encoding="utf-8")) == {"a.x.end": "m", "a.x.min": "m", "a.x.max": "m"}
    assert files(folder) == ["out.csv", "out.units.json"]


def test_a_batch_that_is_broken_off_has_all_rows_that_were_done(folder: Path) -> None:
    """Rows that waited for one before them are there too."""

    def break_off() -> None:
        with CaseTable(Path("out.csv"), CASES, {"a.x": "m"}) as table:
            table.take(0, results(0, 1))
            table.take(4, results(4, 5))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as stop:
        break_off()
    assert stop.value.__notes__ == ["the results of 4 of 6 runs are in out.partial.csv"]
    assert rows_of(Path("out.partial.csv")) == ["0.0", "1.0", "4.0", "5.0"]
    assert files(folder) == ["out.partial.csv", "out.partial.txt", "out.partial.units.json"]


@pytest.fixture
def batch(folder: Path) -> tuple[object, ...]:
    (folder / "quarter.yaml").write_text(TEXT, encoding="utf-8")
    rows = "".join(f"{load}\n" for load in np.linspace(200, 400, 50_000))
    (folder / "cases.csv").write_text(f"load\n{rows}", encoding="utf-8")
    return "batch", "quarter.yaml", "cases.csv", "--threads", 2, "--out", "out.csv"


def test_an_interrupted_batch_keeps_what_was_done(batch: tuple[object, ...], folder: Path) -> None:
    Path("out.csv").write_text("before", encoding="utf-8")
    with launch(*batch) as process:
        wait_for(lambda: has_content(Path("out.partial.csv")) and len(rows_of(Path("out.partial.csv"))) > 100)
        process.send_signal(signal.SIGINT)
        _, messages = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    header, *rows = Path("out.partial.csv").read_text(encoding="utf-8").splitlines()
    assert messages.endswith(f"interrupted\nthe results of {len(rows)} of 50000 runs are in out.partial.csv\n")
    assert {row.count(",") for row in rows} == {header.count(",")}
    assert Path("out.partial.txt").read_text(encoding="utf-8") == "interrupted\n"
    assert Path("out.csv").read_text(encoding="utf-8") == "before"


def test_a_batch_on_a_full_disk_keeps_what_was_done(batch: tuple[object, ...], folder: Path) -> None:
    with small_disk(folder / "disk") as disk:
        status, messages = run(*batch[:-1], disk / "out.csv")
        assert status == 1
        header, *rows = (disk / "out.partial.csv").read_text(encoding="utf-8").splitlines()
        assert f"cannot write {disk / 'out.csv'}: No space left on device\n" in messages
        assert f"the results of {len(rows)} of 50000 runs are in {disk / 'out.partial.csv'}" in messages
        assert len(rows) > 100
        assert {row.count(",") for row in rows} == {header.count(",")}


def test_rows_that_do_not_fit_are_not_counted(folder: Path) -> None:
    def fill() -> None:
        with CaseTable(Path("out.csv"), CASES, {"a.x": "m"}) as table:
            size = Path("out.partial.csv").stat().st_size
            resource.setrlimit(resource.RLIMIT_FSIZE, (size + 40, hard))  # a row has 16 bytes
            table.take(0, results(*range(6)))

    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        with pytest.raises(OutputError, match=r"^cannot write out\.csv: File too large") as error:
            fill()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert rows_of(Path("out.partial.csv")) == ["0.0", "1.0"]
    assert error.value.__notes__ == ["the results of 2 of 6 runs are in out.partial.csv"]
