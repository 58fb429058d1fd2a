"""A simulator has no settings of its own: it refuses a run file without one of them, or with a word that it does not know."""

from __future__ import annotations

import json
import subprocess
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.run.run_file import make_run_file
from tests.conftest import needs_cpp
from tests.run.test_settings import pendulum

pytestmark = needs_cpp

#: Stands for a key that is taken out.
MISSING = object()


@cache
def binary(method: str) -> Path:
    return compile_scene(pendulum(), pendulum().scenes["rest"], CompileOptions(method=method)).binary.path


def refused(method: str, changes: dict[str, Any], folder: Path) -> str:
    """The simulator's message about a run file with some values changed, by their keys joined by dots."""
    made = make_run_file(pendulum(), pendulum().scenes["rest"], {}, task="simulate", method=method, out=str(folder / "run.csv"))
    file = deepcopy(made.entries())
    for name, value in changes.items():
        *parents, key = name.split(".")
        place = file
        for parent in parents:
            place = place[parent]
        place[key] = value
        if value is MISSING:
            del place[key]
    path = folder / "run.json"
    path.write_text(json.dumps(file), encoding="utf-8")
    done = subprocess.run([binary(method), path], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 2, done.stdout
    assert not (folder / "run.csv").exists()
    return done.stderr


SETTINGS = (
    "task", "pose", "end", "output_step", "integrator", "solver", "numerics", "stabilisation", *(f"numerics.{name}" for name in (
        "dt", "penalty", "tolerance", "iterations", "multiplier_updates", "fixed_cost", "events", "absolute_tolerance", "spectral_radius")),
    *(f"stabilisation.{name}" for name in ("closure", "penalty", "damping_ratio", "frequency")),
)  # fmt: skip


@pytest.mark.parametrize("key", SETTINGS)
def test_no_setting_has_a_default(key: str, tmp_path: Path) -> None:
    complaint = refused("recursive", {key: MISSING}, tmp_path)
    assert f"key '{key.rpartition('.')[2]}' not found" in complaint


@pytest.mark.parametrize(("method", "key", "value", "message"), [
    ("recursive", "integrator", "euler", "this program has no integrator euler"),
    ("recursive-newton", "integrator", "rk4", "this program has no integrator rk4"),
    ("recursive", "pose", "rest", 'pose is "rest"'), ("recursive", "stabilisation.closure", "weld", 'closure is "weld"'),
    ("recursive", "task", "\x1b[31m\x9b", 'task is "\\u001b[31m\\x9b"'),
])  # fmt: skip
def test_words_are_known(method: str, key: str, value: str, message: str, tmp_path: Path) -> None:
    assert refused(method, {key: value}, tmp_path) == f"error: run file: {message}\n"
