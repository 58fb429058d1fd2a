"""The kinds of inputs that need a simulator: what failed once, and a few seeds of each; `make fuzz` has more."""

from __future__ import annotations

import os
import random
import shutil
from pathlib import Path

import pytest

from tests.conftest import needs_cpp
from tests.view.browser import CHROMIUM

from .kinds import KINDS
from .tally import Kind

pytestmark = needs_cpp

#: Seeds that the tests try: some, and those of `make full`.
SEEDS = {
    "mechanisms": (1, 8), "calls": (1, 6), "disks": (1, 2), "signals": (1, 2), "caches": (1, 1), "parts": (4, 40),
    "lanes": (1, 15), "meshes": (6, 60), "impacts": (1, 6), "controllers": (1, 4), "hosts": (20, 200), "poses": (1, 12),
    "friction": (1, 12), "massless": (1, 10), "tyres": (100, 1000), "road_files": (100, 1000),
    "dense": (2, 100),
}


def _require_means(kind: Kind) -> None:
    if kind.name == "disks" and (os.geteuid() or shutil.which("mount") is None):
        pytest.skip("a small disk is mounted, which this user may not")
    if kind.name == "meshes" and CHROMIUM is None:
        pytest.skip("needs chromium")


def _marks(name: str) -> tuple[pytest.MarkDecorator, ...]:
    """A private cache is compiled for minutes."""
    return (pytest.mark.heavy,) if name == "caches" else ()


@pytest.mark.parametrize(
    ("kind", "path"),
    [pytest.param(KINDS[name], path, marks=_marks(name), id=path.stem) for name in SEEDS for path in KINDS[name].corpus()],
)
def test_corpus(kind: Kind, path: Path) -> None:
    """Inputs that failed once."""
    _require_means(kind)
    kind.make(random.Random(0))  # what it needs is compiled then
    kind.try_one(path.read_bytes().decode("utf-8", "surrogateescape"))


def _try_seeds(kind: Kind, seeds: range) -> None:
    _require_means(kind)
    for seed in seeds:
        kind.try_one(kind.make(random.Random(seed)))


@pytest.mark.parametrize("name", [pytest.param(name, marks=_marks(name)) for name in SEEDS])
def test_some_seeds(name: str) -> None:
    _try_seeds(KINDS[name], range(SEEDS[name][0]))


@pytest.mark.heavy
@pytest.mark.parametrize("name", SEEDS)
def test_more_seeds(name: str) -> None:
    _try_seeds(KINDS[name], range(*SEEDS[name]))
