"""Tables in Parquet, Arrow and NumPy files: the numbers of the text, bit for bit, with names and units."""

import json
import sys
from pathlib import Path

import numpy as np
import pyarrow.feather
import pyarrow.parquet
import pytest

from cutjoint.run.results import read_table
from tests.conftest import needs_cpp
from tests.run.program import call, run
from tests.run.test_files import DRIVEN, WHOLE, files

pytestmark = needs_cpp

ENDINGS = (".parquet", ".arrow", ".npy")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a model, in which commands run."""
    (tmp_path / "driven.yaml").write_text(DRIVEN, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_table_has_the_numbers_of_the_text(ending: str, folder: Path) -> None:
    for name in ("run.csv", f"other{ending}", f"again{ending}"):
        assert call("simulate", "driven.yaml", *WHOLE, "--out", name).exit_code == 0
    (t, columns), (other_t, others) = read_table(Path("run.csv")), read_table(Path(f"other{ending}"))
    assert list(columns) == list(others)
    assert t.tobytes() == other_t.tobytes()
    assert all(columns[name].tobytes() == np.ascontiguousarray(others[name]).tobytes() for name in columns)
    assert Path(f"other{ending}").read_bytes() == Path(f"again{ending}").read_bytes()
    assert Path("other.units.json").read_text(encoding="utf-8") == Path("run.units.json").read_text(encoding="utf-8")
    assert Path("other.error.json").read_text(encoding="utf-8") == Path("run.error.json").read_text(encoding="utf-8")


@pytest.mark.parametrize("ending", [".parquet", ".arrow"])
def test_units_stand_in_the_file(ending: str, folder: Path) -> None:
    assert call("simulate", "driven.yaml", *WHOLE, "--no-error", "--out", f"run{ending}").exit_code == 0
    read = pyarrow.parquet.read_table if ending == ".parquet" else pyarrow.feather.read_table
    schema = read(f"run{ending}").schema
    units = json.loads(Path("run.units.json").read_text(encoding="utf-8"))
    assert {field.name: (field.metadata or {}).get(b"unit", b"").decode() for field in schema} == units
    assert json.loads(schema.metadata[b"PANDAS_ATTRS"])["units"] == units


@pytest.mark.parametrize("ending", ENDINGS)
def test_another_run_may_be_compared(ending: str, folder: Path) -> None:
    assert call("simulate", "driven.yaml", *WHOLE, "--no-error", "--out", f"run{ending}").exit_code == 0
    compare = ("--compare", f"run{ending}", "--plots", "plots")
    done = call("simulate", "driven.yaml", *WHOLE, "--no-error", "--out", "other.csv", *compare)
    assert done.exit_code == 0, done.output
    Path(f"bad{ending}").write_bytes(b"no table")
    done = call("simulate", "driven.yaml", "--out", "other.csv", "--compare", f"bad{ending}", "--plots", "plots")
    assert done.exit_code == 1
    assert done.output.startswith(f"--compare bad{ending}: this is no table of a run: ")


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_run_that_fails_leaves_its_rows(ending: str, folder: Path) -> None:
    for out in ("run.csv", f"other{ending}"):
        done = call("simulate", "driven.yaml", "--end", "1", "--dt", "1e-2", "--out", out)
        assert done.exit_code == 1
    assert f"other.partial{ending}" in done.output
    (t, _), (other_t, _) = read_table(Path("run.partial.csv")), read_table(Path(f"other.partial{ending}"))
    assert 0 < t.size == other_t.size
    assert t.tobytes() == other_t.tobytes()
    assert Path("other.partial.txt").read_text(encoding="utf-8") == Path("run.partial.txt").read_text(encoding="utf-8")
    assert not Path(f"other{ending}").exists()


def test_a_table_without_its_package_is_refused_before_the_run(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    done = call("simulate", "driven.yaml", *WHOLE, "--out", "run.parquet")
    message = "run.parquet: tables in .parquet need PyArrow, which is not installed; pip install 'cutjoint[data]'"
    assert (done.exit_code, done.output, files(folder)) == (1, f"{message}, or write a table in .csv or .npy\n", [])


def test_a_full_disk_leaves_no_table(folder: Path) -> None:
    (folder / "driven.yaml").write_text(DRIVEN.replace("output_step: 0.1", "output_step: 0.0001"), encoding="utf-8")
    status, messages = run("simulate", "driven.yaml", *WHOLE, "--no-error", "--dt", "1e-4", "--out", "run.npy", limit=20000)
    assert status == 1
    assert "File too large" in messages
    assert not Path("run.npy").exists()
