"""Coefficients of Runge-Kutta methods in C++ beside those that SciPy has; interpolants by the conditions of their order."""

from __future__ import annotations

import re
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import RK45
from scipy.integrate._ivp import dop853_coefficients as dop853

from cutjoint.package.locations import runtime_folder

Rows = list[list[Fraction]]

_NUMBER = re.compile(r"\{(?:(-?[\d.e-]+)(?:, (-?[\d.e-]+))?)?\}")


def table(name: str) -> dict[str, Rows]:
    """The rows of a table by its members' names; of `nodes` there is one."""
    text = (runtime_folder() / "include/cutjoint/core/runge_kutta/tables.hpp").read_text(encoding="utf-8")
    body = text.split(f"struct {name} {{")[1].split("\n};")[0]
    members = re.findall(r"static constexpr (?:Row|std::array<Row, \w+>) (\w+)(\{.*?\});", body, re.DOTALL)
    decimal = "Decimals" in body
    return {member: [_row(row, decimal) for row in re.findall(r"\{\{((?:[^{}]|\{[^{}]*\})*)\}\}", rows)] for member, rows in members}


def _row(text: str, decimal: bool) -> list[Fraction]:
    """The numbers of a row: sums of a double and a rest, or fractions."""
    pairs = [(a or "0", b) for a, b in _NUMBER.findall(text)]
    if decimal:
        return [Fraction(float(a)) + Fraction(float(b or "0")) for a, b in pairs]
    return [Fraction(int(a), int(b or "1")) for a, b in pairs]


def as_array(rows: Rows, columns: int) -> NDArray[np.float64]:
    return np.array([[float(x) for x in row] + [0.0] * (columns - len(row)) for row in rows])


def test_numbers_of_dop853_are_those_of_scipy() -> None:
    """So that it meets all conditions of order that SciPy's table meets."""
    found = table("Dop853Table")
    weights = [[], *found["weights"]]  # the first stage has none
    assert np.array_equal(as_array(found["nodes"], 16)[0], dop853.C)
    assert np.array_equal(as_array(weights, 16), dop853.A)
    assert as_array(found["errors"], 13) == pytest.approx(np.array([dop853.E5, dop853.E3]), rel=0, abs=1e-16)
    assert np.array_equal(as_array(found["dense"], 16), dop853.D)


def test_numbers_have_thirty_digits() -> None:
    """The digits of SciPy's text, which number types with more than a double's take."""
    text, found = Path(dop853.__file__).read_text(encoding="utf-8"), table("Dop853Table")
    weights = [[], *found["weights"]]
    entries = re.findall(r"^([AD])\[(\d+), (\d+)\] = (\S+)$", text, re.MULTILINE)
    assert len(entries) > 120
    for array, row, column, digits in entries:
        number = {"A": weights, "D": found["dense"]}[array][int(row)][int(column)]
        exact = Fraction(Decimal(digits))
        assert abs(number - exact) <= abs(exact) * Fraction(1, 10**30)


def test_dormand_prince_is_scipys() -> None:
    found = table("DormandPrinceTable")
    weights = as_array([[], *found["weights"]], 7)
    assert weights[:6, :5] == pytest.approx(RK45.A, abs=1e-16)
    assert weights[6, :6] == pytest.approx(RK45.B, abs=1e-16)
    assert as_array(found["errors"], 7)[0] == pytest.approx(-RK45.E, abs=1e-16)


@pytest.mark.parametrize(("name", "order"), [("DormandPrinceTable", 4), ("Dop853Table", 7)])
def test_quadrature_between_the_ends(name: str, order: int) -> None:
    """Of y' = t^k the interpolant is exact for all k below its order, at any place: the conditions of the bushes among the trees."""
    found = table(name)
    nodes = [float(x) for x in found["nodes"][0]]
    columns, end = len(nodes), as_array([found["weights"][{"DormandPrinceTable": 5, "Dop853Table": 11}[name]]], len(nodes))[0]
    last = len(found["weights"]) if name == "DormandPrinceTable" else 12
    first_, last_ = np.eye(columns)[0], np.eye(columns)[last]
    parts = [end, first_ - end, 2 * end - first_ - last_, *as_array(found["dense"], columns)]
    for s in (0.13, 0.5, 0.82):
        weights = np.zeros(columns)
        for k, part in reversed(list(enumerate(parts))):
            weights = (weights + part) * (s if k % 2 == 0 else 1 - s)
        for power in range(order):
            assert weights @ np.power(nodes, power) == pytest.approx(s ** (power + 1) / (power + 1), abs=1e-13)
