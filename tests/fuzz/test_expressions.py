"""Random texts of expressions: never a traceback, a hang or a wrong value.  $CUTJOINT_FUZZ multiplies the number of examples."""

from __future__ import annotations

import os
import random
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from .chain import run_chain
from .expressions import any_text, mutate, nest, write

CORPUS = Path(__file__).parent / "corpus"
SHARE = float(os.environ.get("CUTJOINT_FUZZ", "1"))


def generators(make: object) -> st.SearchStrategy[str]:
    """Results of a function of a random number generator."""
    return st.randoms(use_true_random=False).map(make)  # type: ignore[arg-type]


@given(generators(any_text))
@settings(max_examples=int(150 * SHARE), deadline=None, derandomize=SHARE == 1)
def test_any_text(text: str) -> None:
    run_chain(text)


@given(generators(lambda rng: write(rng, 4)))
@settings(max_examples=int(150 * SHARE), deadline=None, derandomize=SHARE == 1)
def test_valid_texts_have_pythons_value(text: str) -> None:
    run_chain(text)


@given(generators(nest))
@settings(max_examples=int(60 * SHARE), deadline=None, derandomize=SHARE == 1)
def test_nested_texts_end_soon(text: str) -> None:
    run_chain(text)


@given(generators(lambda rng: mutate(rng, write(rng, 3))))
@settings(max_examples=int(100 * SHARE), deadline=None, derandomize=SHARE == 1)
def test_mutated_texts(text: str) -> None:
    run_chain(text)


@given(st.text(max_size=60))
@settings(max_examples=int(100 * SHARE), deadline=None, derandomize=SHARE == 1)
def test_garbage(text: str) -> None:
    run_chain(text)


@pytest.mark.parametrize("path", sorted(CORPUS.glob("*.txt")), ids=lambda path: path.stem)
def test_corpus(path: Path) -> None:
    """Inputs that failed once."""
    run_chain(path.read_text(encoding="utf-8").removesuffix("\n"))


def test_the_grammar_is_accepted() -> None:
    """Most of what the grammar writes is read, so that the values are tested."""
    rng = random.Random(1)
    accepted = sum(not run_chain(write(rng, 3)) for _ in range(60))
    assert accepted > 30
