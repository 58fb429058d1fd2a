"""Damaged files of a model: what failed once, and a few seeds; `make fuzz` has more."""

from __future__ import annotations

import random

import pytest

from .kinds import KINDS

KIND = KINDS["model_files"]


@pytest.mark.parametrize("path", KIND.corpus(), ids=lambda path: path.stem)
def test_corpus(path) -> None:
    """Inputs that failed once."""
    KIND.try_one(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("seeds", [range(20), pytest.param(range(20, 400), marks=pytest.mark.heavy)], ids=str)
def test_seeds(seeds: range) -> None:
    for seed in seeds:
        KIND.try_one(KIND.make(random.Random(seed)))
