"""Files that follow from others are what `make regenerate` would write."""

from __future__ import annotations

import runpy
from collections.abc import Callable
from functools import cache

import pytest

from tests.conftest import ROOT

NAMES = (
    "docs/model.schema.json", "docs/study.schema.json", "docs/fit.schema.json",
    "docs/reference/command-line.md", "docs/reference/python.md", "docs/reference/c.md",
    "docs/reference/library.md", "docs/pictures/signs.svg",
    "docs/reference/model-file.md", "docs/background/mechanics.md", "docs/reference/integrators.md",
    "runtime/include/cutjoint/integrator_table.hpp", "runtime/include/cutjoint/core/numbers/functions.hpp",
)  # fmt: skip


@cache
def derived() -> dict[str, Callable[[], str]]:
    return runpy.run_path(str(ROOT / "scripts" / "regenerate"))["derived"]()  # type: ignore[no-any-return]


@pytest.mark.parametrize("name", NAMES)
def test_a_derived_file_is_current(name: str) -> None:
    assert derived()[name]() == (ROOT / name).read_text(encoding="utf-8"), "run make regenerate"


def test_the_generated_example_is_current() -> None:
    folder = ROOT / "generated"
    kept = {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in folder.rglob("four_bar/**/*") if path.is_file()}
    assert {name: make() for name, make in derived().items() if name.startswith("generated/")} == kept, "run make regenerate"


def test_every_derived_file_is_looked_at() -> None:
    assert {name for name in derived() if not name.startswith("generated/")} == set(NAMES)
