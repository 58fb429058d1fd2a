"""Tables of responses: what rounding leaves is shown as 0, and phases of files are in their unit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from cutjoint.report.response import response_tables, write_response
from cutjoint.run.results import read_table
from cutjoint.stepping.state_space import StateSpace


def test_rounding_is_shown_as_zero() -> None:
    """Two outputs in m, of which one follows the input by rounding alone, and a pole and a zero that are 0 but for rounding."""
    none = np.zeros((2, 1))
    model = StateSpace(
        A=np.array([[-40.0, 0.0], [0.0, 3e-17]]), B=np.array([[1.0], [1.0]]), B_rate=none, B_acceleration=none,
        C=np.array([[1.0, 0.0], [1e-19, 0.0]]), D=none, D_rate=none, D_acceleration=none, x=np.zeros(2), y=np.zeros(2),
        states=("a", "b"), inputs=("u",), outputs=("far", "near"), units={"far": "m", "near": "m", "u": "N"},
    )  # fmt: skip
    console = Console(width=200, record=True)
    for table in response_tables(model, np.array([0.1, 1.0, 10.0]), "rest"):
        console.print(table)
    text = console.export_text()
    assert "e-" not in text
    assert "responses: outputs in their units, inputs in SI units" in text
    rows = [line.split() for line in text.splitlines()]
    assert ["near", "u", "0", *"------"] in rows
    assert ["0", "-", "-"] in rows
    assert next(row for row in rows if row[:1] == ["far"])[2] == f"{1 / abs(40 + 0.2j * np.pi):.4g}"


def test_an_undamped_pole_has_no_sign_of_rounding() -> None:
    """A damping ratio of 0 is not printed as -0.0000, also where rounding makes the real part positive."""
    none, one = np.zeros((1, 1)), np.ones((2, 1))
    model = StateSpace(
        A=np.array([[1e-16, 4.0], [-4.0, 1e-16]]), B=one, B_rate=0 * one, B_acceleration=0 * one, C=one.T, D=none, D_rate=none,
        D_acceleration=none, x=np.zeros(2), y=np.zeros(1), states=("a", "b"), inputs=("u",), outputs=("y",), units={"y": "m", "u": "N"},
    )  # fmt: skip
    console = Console(width=200, record=True)
    for table in response_tables(model, np.array([0.1, 1.0]), "rest"):
        console.print(table)
    assert ["±4i", "0.6366", "0.0000"] in [line.split()[-3:] for line in console.export_text().splitlines()]


def test_narrow_terminals_fold_names_and_keep_each_number() -> None:
    """At 80 columns a long name and a row of six numbers are printed whole."""
    none, name = np.zeros((1, 1)), "a_very_long_name_of_a_joint.displacement"
    model = StateSpace(
        A=np.array([[-1.0, 0.0], [0.0, -2.0]]), B=np.array([[1.0], [1.0]]), B_rate=np.zeros((2, 1)), B_acceleration=np.zeros((2, 1)),
        C=np.array([[1e5, 3e5]]), D=none, D_rate=none, D_acceleration=none, x=np.zeros(2), y=np.zeros(1), states=("a", "b"),
        inputs=("an_input_with_a_name",), outputs=(name,), units={name: "m", "an_input_with_a_name": "N"},
    )  # fmt: skip
    console = Console(width=80, record=True)
    *_, table = response_tables(model, np.array([0.1, 1.0, 10.0]), "rest")
    console.print(table)
    text = console.export_text()
    assert "…" not in text
    first = "".join(line[1:].split(" ", 1)[0] for line in text.splitlines()[3:])
    assert first.endswith(name)


def test_a_file_has_phases_in_radians(tmp_path: Path) -> None:
    """Of 1/(s + 2): at 2 rad/s it lags by an eighth of a turn."""
    one = np.ones((1, 1))
    model = StateSpace(
        A=-2 * one, B=one, B_rate=0 * one, B_acceleration=0 * one, C=one, D=0 * one, D_rate=0 * one, D_acceleration=0 * one, x=np.zeros(1),
        y=np.zeros(1), states=("a",), inputs=("u",), outputs=("y",), units={"y": "m", "u": "N"},
    )  # fmt: skip
    _, columns = read_table(write_response(model.frequency_response([1 / np.pi]), tmp_path / "response.csv"))
    assert columns["y/u.gain"] == pytest.approx([1 / np.sqrt(8)])
    assert columns["y/u.phase"] == pytest.approx([-np.pi / 4])
    assert "rad" in (tmp_path / "response.units.json").read_text()
