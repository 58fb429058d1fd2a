"""The list of faults that a study plants stays true as the code changes."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from cutjoint_bench.studies.planted import Checkout, cpu_seconds, examine, table_of
from cutjoint_bench.studies.planted_faults import FAULTS, Fault
from tests.conftest import ROOT

PRODUCT = ("compiler/cutjoint/", "runtime/", "templates/")


def test_each_fault_stands_once_in_the_product_and_has_tests() -> None:
    wrong = []
    for fault in FAULTS:
        text = (ROOT / fault.file).read_text(encoding="utf-8")
        if text.count(fault.old) != 1:
            wrong.append(f"{fault.name}: its text stands {text.count(fault.old)} times in {fault.file}")
        wrong += [f"{fault.name}: there is no {test}" for test in fault.tests if not (ROOT / test).exists()]
    assert not wrong, "write the fault as the code is now:\n" + "\n".join(wrong)


def test_faults_are_of_the_product_and_differ() -> None:
    assert len({fault.name for fault in FAULTS}) == len(FAULTS) >= 40
    assert all(fault.file.startswith(PRODUCT) and fault.old != fault.new and 1 <= len(fault.tests) <= 4 for fault in FAULTS)
    for fault in FAULTS:
        if fault.file.endswith(".py"):
            text = (ROOT / fault.file).read_text(encoding="utf-8")
            compile(text.replace(fault.old, fault.new), fault.file, "exec", dont_inherit=True)


@pytest.fixture
def checkout(tmp_path: Path) -> Checkout:
    """A folder with a number, a test that sees it change, one that never passes, and one that never fails."""
    (tmp_path / "tree" / "compiler").mkdir(parents=True)
    (tmp_path / "tree" / "compiler" / "own.py").write_text("SIZE = 1\nOTHER = 1\n", encoding="utf-8")
    (tmp_path / "tree" / "pytest.ini").write_text("[pytest]\nmarkers =\n    cpp: x\n    heavy: x\n", encoding="utf-8")
    (tmp_path / "tree" / "test_own.py").write_text(
        "import own, pytest\ndef test_broken(): assert False\n@pytest.mark.cpp\n@pytest.mark.parametrize('x', ['a - [b]'])\n"
        "def test_size(x): assert own.SIZE == 1\ndef test_nothing(): pass\n", encoding="utf-8",
    )  # fmt: skip
    return Checkout(folder=tmp_path / "tree", cache=tmp_path / "cache")


def test_a_test_counts_that_passes_without_the_fault(checkout: Checkout) -> None:
    fault = Fault("size", "compiler/own.py", "SIZE = 1", "SIZE = 2", "", ("test_own.py",))
    row = examine(checkout, fault, every=False)
    assert row["seen_by"] == ["test_own.py::test_size[a - [b]]"]
    assert row["fail_without"] == ["test_own.py::test_broken"]
    assert row["in_time"]
    assert "SIZE = 1" in (checkout.folder / fault.file).read_text(encoding="utf-8")
    assert row["cpu_seconds"] > 0
    assert "test_size[a - [b]]" in table_of([row])


def test_a_fault_is_seen_whose_file_keeps_size_and_second(checkout: Checkout, monkeypatch: pytest.MonkeyPatch) -> None:
    """Python takes compiled modules for those of a source with the same size and the same second."""
    monkeypatch.delenv("PYTHONDONTWRITEBYTECODE", raising=False)
    fault, file = Fault("size", "compiler/own.py", "SIZE = 1", "SIZE = 2", "", ("test_own.py",)), checkout.folder / "compiler" / "own.py"

    def size() -> str:
        os.utime(file, (1e9, 1e9))
        command = [checkout.python, "-c", "import own; print(own.SIZE)"]
        return subprocess.run(command, env=checkout.environment, check=True, stdout=subprocess.PIPE, text=True).stdout.strip()

    found = [size()]
    with checkout.planted(fault):
        found.append(size())
    assert [*found, size()] == ["1", "2", "1"]


def test_what_no_test_sees_is_missed(checkout: Checkout) -> None:
    row = examine(checkout, Fault("other", "compiler/own.py", "OTHER = 1", "OTHER = 2", "", ("test_own.py",)), every=False)
    assert not row["seen_by"]
    assert "MISSED" in table_of([row])


def test_time_of_descendants_counts() -> None:
    code = "import subprocess, sys; subprocess.run([sys.executable, '-c', 'while True: pass'])"
    with subprocess.Popen([sys.executable, "-c", code], start_new_session=True) as process:
        until = time.monotonic() + 30
        while cpu_seconds(process.pid) < 0.5 and time.monotonic() < until:
            time.sleep(0.1)
        found = cpu_seconds(process.pid)
        os.killpg(process.pid, 9)
    assert found >= 0.5
