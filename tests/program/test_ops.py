"""Rows of scalar operations: each reaches what computes, prints and differentiates it, or the error names both."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from cutjoint.model.expressions.operations import FUNCTIONS as OF_MODELS
from cutjoint.ops import CONDITIONS, OPERATIONS, SMOOTH, STANDARD, Operation, fact
from cutjoint.program.blocks import FUNCTIONS, BindingTime, Builder
from cutjoint.toolchain.wasm import MATHEMATICS
from cutjoint.view.sliders import print_function
from tests.conftest import ROOT

#: Arguments at which all have values, and conditions and choices too.
PLACES = (0.3, 0.4, 0.7)


@pytest.mark.parametrize("row", OPERATIONS.values(), ids=OPERATIONS)
def test_a_row_reaches_all_that_follow_from_it(row: Operation) -> None:
    runtime = ROOT / "runtime"
    listed = (runtime / "include/cutjoint/core/numbers/functions.hpp").read_text(encoding="utf-8")
    interpreted = (runtime / "interpreter/operations.cpp").read_text(encoding="utf-8")
    assert f"X({row.name}, " in listed or f'("{row.name}")' in interpreted
    if row.fold is not None:
        places = PLACES[: row.arity]
        assert row.fold(*places) == pytest.approx(float(row.numpy(*places)), rel=1e-15)
        assert FUNCTIONS[row.name] == row.arity
        b = Builder()
        x = b.symbol("x", row.arity, BindingTime.ITERATION)
        args = [b.element(x, i, 0) for i in range(row.arity)]
        if row.name == "where":
            args[0] = b.call("lt", args[1], args[0])
        value = b.call(row.name, *args)
        text = print_function("f", [b.call("where", value, *args[:1] * 2) if row.name in CONDITIONS else value], {}, {"x": 0})
        assert (row.infix or {"not": "!", "where": "?"}.get(row.name, f"Math.{row.name}(")) in text or row.name in CONDITIONS
    if row.parity:
        assert row.numpy(-0.3) == pytest.approx(row.parity * row.numpy(0.3), rel=1e-15)


def test_models_have_the_smooth_ones() -> None:
    assert {name: OPERATIONS[name].arity for name in SMOOTH}.items() <= OF_MODELS.items()
    assert all(hasattr(math, name) for name in SMOOTH)
    assert np.arctan2 is OPERATIONS["atan2"].numpy


@pytest.mark.parametrize(("operation", "name"), [("where", "partials"), ("gamma", "numpy"), ("not", "standard")])
def test_a_missing_entry_names_the_operation_and_the_entry(operation: str, name: str) -> None:
    with pytest.raises(LookupError, match=f"the operation '{operation}' has no '{name}' in cutjoint.ops"):
        fact(operation, name)


def test_each_function_is_in_the_mathematical_library() -> None:
    """Which C99 folders and pages bring for the same bits everywhere; square roots and absolute values are exact in any."""
    folder = ROOT / "runtime" / "libm"
    renamed = re.findall(r"^CUTJOINT_OF_\w+\((\w+)\)$", (folder / "names.h").read_text(encoding="utf-8"), re.MULTILINE)
    assert {*STANDARD} - {"sqrt", "abs"} <= {*MATHEMATICS}
    assert {*renamed} == {*MATHEMATICS} == {name for name in MATHEMATICS if (folder / f"{name}.c").is_file()}
