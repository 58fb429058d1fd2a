"""Run files with values out of range, of the wrong type or missing: a message and status 2, or a sane run."""

from __future__ import annotations

import copy
import json
import math
import random
import subprocess
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from cutjoint.run.run_file import make_run_file

from .press import compile_press

#: Steps that a run may have and still be tried to its end.
MANY = 1e6
SECONDS = 20.0

_ENDS = (0, -1, 1, 2**31 - 1, 2**31, -(2**31) - 1, 2**32, 2**32 + 1, 2**53, 2**63 - 1, 2**63, 2**64, 2**64 + 1, 10**30)
_REALS = (0.0, -0.0, 0.5, 1e-300, 5e-324, -1e-3, 1e16, 1e17, 1e300, 1.7976931348623157e308, -1e300, 1e-17)
_OTHERS: tuple[Any, ...] = (None, True, False, "", "1", "x" * 5000, "\x1b[31m", "\0", [], [1], {}, {"a": 1}, [[]], "simulate", "proximal")


@cache
def _template() -> tuple[Path, str]:
    """The simulator of the press, and its run file of a few steps."""
    with TemporaryDirectory() as folder:
        artifact = compile_press(Path(folder))
    file = make_run_file(artifact.topology.model, artifact.scene, {}, task="simulate", out="table.csv")
    return artifact.binary.path, json.dumps({**file.entries(), "end": 0.02, "steps_out": "steps.csv"})


def _places(node: Any) -> Iterator[tuple[Any, Any]]:
    items = list(node.items()) if isinstance(node, dict) else list(enumerate(node)) if isinstance(node, list) else []
    for key, value in items:
        yield node, key
        yield from _places(value)


def make(rng: random.Random) -> str:
    """A run file with one to three of its values changed; it may be no JSON any more."""
    file = json.loads(_template()[1])
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        container, key = rng.choice(list(_places(file)))
        kind = rng.random()
        if kind < 0.12:
            del container[key]
        elif kind < 0.17 and isinstance(container, dict):
            container[rng.choice(("", "a", "x" * 300, "\x1b[31m"))] = copy.deepcopy(container[key])
        elif key not in ("out", "steps_out"):
            container[key] = copy.deepcopy(rng.choice(rng.choice((_ENDS, _REALS, _OTHERS))))
    text = json.dumps(file)
    if rng.random() < 0.1:
        i = rng.randrange(len(text))
        text = text[:i] + rng.choice(("", "\xff", "nan", "1e999", "[" * 20_000, "}", '"')) + text[i + rng.randrange(3) :]
    return text


def check(text: str) -> tuple[str, ...]:
    """The simulator's message about a run file that it refuses; fails where it crashes, hangs, or calls done what is not."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "run.json").write_text(text, encoding="utf-8", errors="surrogateescape")
        try:
            done = subprocess.run(
                [_template()[0], "run.json"], cwd=folder, capture_output=True, text=True, errors="replace", timeout=SECONDS, check=False
            )
        except subprocess.TimeoutExpired:
            assert _is_long(text), "hangs"
            return ("runs for long",)
        assert done.returncode in (0, 1, 2), f"status {done.returncode}: {done.stderr[-300:]}"
        _require_message(done.stderr)
        if done.returncode == 2:
            assert done.stderr.strip(), "no message"
            return (done.stderr.strip(),)
        summary = json.loads(done.stdout.splitlines()[-1])
        if summary["status"] == "done":
            _require_table(folder, json.loads(text), summary)
        return () if summary["status"] == "done" else (summary["message"],)


def _require_message(complaint: str) -> None:
    """Require that the simulator's complaint is for people."""
    for word in ("terminate called", "std::", "cannot create", "\x1b", "\0"):
        assert word not in complaint, f"{word!r} in {complaint[:300]!r}"


def _require_table(folder: Path, file: dict[str, Any], summary: dict[str, Any]) -> None:
    """A run that is done has reached its end, and all that it wrote is finite."""
    if file.get("task") != "simulate" or "out" not in file:
        return
    assert summary["steps"] > 0 or file["end"] == 0, "done after no steps"
    lines = (folder / file["out"]).read_text(encoding="utf-8").splitlines()
    rows = [[float(cell) for cell in line.split(",")] for line in lines[1:]]
    assert all(math.isfinite(x) for row in rows for x in row), "not finite"
    assert abs(rows[-1][0] - file["end"]) <= 1e-9 * max(1.0, abs(file["end"])), f"done at {rows[-1][0]} of {file['end']}"


def _is_long(text: str) -> bool:
    """True if a run file asks for more steps or rows than can be waited for, or for motions as fast as these."""
    file = json.loads(text)
    numerics = file["numerics"]
    lengths = [x for x in (numerics.get("dt"), file.get("output_step")) if isinstance(x, int | float) and x > 0]
    rates = [abs(x) for x in file.get("rates", {}).values() if isinstance(x, int | float)]
    stiffness = file.get("parameters", {}).get("stiffness")
    rates += [math.sqrt(abs(stiffness))] if isinstance(stiffness, int | float) else []  # of a kilogram
    counts = [*rates, *(max(1, numerics.get("iterations", 1)) / x for x in lengths)]
    return any(file["end"] * count > MANY for count in counts)
