"""Hosts in C, which run FMUs by FMI 3 on other platforms and processors."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cutjoint.export.fmu.archive import Fmu

#: Half a second of the press, whose crank turns.
STEPS, SIZE = 500, 1e-3


def host(place: Path, tools: str = "", *libraries: str) -> Path:
    """The program, by a compiler with a prefix."""
    program = place / "host.exe"
    flags = ["-std=c99", "-D_GNU_SOURCE", "-Wall", "-Wextra", "-Werror", "-pedantic"]
    subprocess.run([f"{tools}gcc", *flags, Path(__file__).with_name("host.c"), "-o", program, *libraries], check=True)
    return program


def hosted(
    fmu: Fmu, binary: Path, call: Sequence[str], *, steps: int = STEPS, begin: Path | None = None, end: Path | None = None,
    environment: dict[str, str] | None = None,
) -> subprocess.CompletedProcess[str]:  # fmt: skip
    """A host that has taken steps, from a state in a file, and left one in another."""
    references = [str(i) for i, v in enumerate(fmu.interface.variables) if v.causality == "output"]
    words = [fmu.subject.token, str(steps), str(SIZE), str(begin or "-"), str(end or "-")]
    return subprocess.run([*call, str(binary), *words, *references], capture_output=True, text=True, env=environment, check=False)


def rows_of(done: subprocess.CompletedProcess[str]) -> np.ndarray:
    """The outputs after each step."""
    assert done.returncode == 0, done.stderr
    return np.array([[float(word) for word in line.split()] for line in done.stdout.splitlines()])


def require_equal(found: np.ndarray, known: np.ndarray) -> None:
    """Other processors join products and sums, and other libraries round sines, in half a second of a crank that turns."""
    assert found.shape == known.shape == (STEPS, 4)
    assert np.ptp(known, axis=0).min() > 0.05
    assert (np.abs(found - known).max(axis=0) <= 1e-11 * np.abs(known).max(axis=0)).all()
