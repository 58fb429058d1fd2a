"""scripts/same-code: a change of the generated code is found, whatever it does to the operations."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
CASE = "pendulum/swing/recursive/double"
COMMIT = ("git", "-c", "user.name=nobody", "-c", "user.email=nobody", "commit", "-q", "-m", "base")


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """A repository of its own of what generates code."""
    place = tmp_path / "cutjoint"
    for name in ("compiler", "templates", "models", "tests/fewer_cases", "tests/mechanisms", "scripts"):
        shutil.copytree(ROOT / name, place / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("__init__.py", "conftest.py"):
        shutil.copy(ROOT / "tests" / name, place / "tests")
    for command in (("git", "init", "-q"), ("git", "add", "."), COMMIT):
        subprocess.run(command, cwd=place, check=True)
    return place


def same_code(repository: Path, *options: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "scripts/same-code", "HEAD", "--only", CASE, "--jobs", "1", *options]
    environment = {**os.environ, "CUTJOINT_CACHE": str(repository.parent)}
    return subprocess.run(command, cwd=repository, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.skipif(shutil.which("git") is None, reason="needs git")
def test_a_change_is_found_and_shown(repository: Path) -> None:
    header = repository / "templates" / "main.cpp.jinja"
    header.write_text("// changed\n" + header.read_text(encoding="utf-8"), encoding="utf-8")
    done = same_code(repository)
    assert done.returncode == 1, done.stderr
    assert f"{CASE}: main.cpp; operations " in done.stdout
    assert "\n+// changed\n" in done.stdout
    done = same_code(repository, "--counts")
    assert (done.returncode, done.stdout) == (0, "1 cases; 0 differ from HEAD\n"), done.stderr


@pytest.mark.skipif(shutil.which("git") is None, reason="needs git")
def test_more_operations_are_no_other_wording(repository: Path) -> None:
    scalars = repository / "compiler" / "cutjoint" / "program" / "scalars.py"
    folds_ones = scalars.read_text(encoding="utf-8").replace("if u == 1.0:", "if False:").replace("if v == 1.0:", "if False:")
    scalars.write_text(folds_ones, encoding="utf-8")
    done = same_code(repository, "--counts")
    assert done.returncode == 1, done.stderr
    assert re.search(rf"{CASE}: .*evaluate.cpp.*; OPERATIONS (\d+) \(\d+\) -> (?!\1)\d+", done.stdout)
