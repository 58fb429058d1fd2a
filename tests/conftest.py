"""Folders of models and data; generated code is compiled fast rather than made fast, and without warnings."""

from __future__ import annotations

import gc
import os
import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from tests.view.browser import Page

ROOT = Path(__file__).resolve().parent.parent
MODELS = ROOT / "models"
DATA = ROOT / "tests" / "data"

gc.set_threshold(100_000)  # as commands have it: an eighth less time
os.environ.setdefault("CUTJOINT_FLAGS", "-O1")
os.environ.setdefault("CUTJOINT_STRICT", "1")
os.environ.setdefault("CUTJOINT_IMPLEMENTATION", "generated")  # whatever a machine's speed and cache are

#: Skipped without the tools that compile generated code.
needs_cpp = pytest.mark.skipif(shutil.which("cmake") is None or shutil.which("ninja") is None, reason="needs cmake and ninja")


@pytest.fixture(scope="module")
def browser() -> Iterator[Page]:
    """Chromium without a window; what opens it is not in all copies of the tests' mechanisms (tests/test_same_code.py)."""
    from tests.view.browser import CHROMIUM, opened

    if CHROMIUM is None:
        pytest.skip("needs chromium")
    with opened() as page:
        yield page


def with_heavy(cases: Iterable[Any], *heavy: Any) -> list[Any]:
    """Cases of a parametrised test, some of them for `make heavy` only."""
    return [_heavy(case) if case in heavy else case for case in cases]


def _heavy(case: Any) -> Any:
    return pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=pytest.mark.heavy)
