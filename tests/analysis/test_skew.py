"""Axes that are slightly off, and mechanisms whose axes are meant to be as they are."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from cutjoint.analysis.mobility import find_mobility
from cutjoint.analysis.skew import describe_skew
from cutjoint.cli import main
from tests.analysis.formulated import formulated
from tests.conftest import MODELS
from tests.mechanisms.overconstrained import parallel_cranks_text
from tests.mechanisms.random_models import random_loops

PRESS = (MODELS / "press.yaml").read_text(encoding="utf-8")
PIN, RAIL = "at: A, axis: [0, 1, 0]", "at: B, axis: [1, 0, 0]"


def said(text: str) -> tuple[int, str]:
    """The degrees of freedom, and what is said of axes."""
    equations = formulated(text)
    found = find_mobility(equations)
    return found.degrees_of_freedom, describe_skew(equations, found)


def words(what: str, axis: str) -> str:
    return f"axes are slightly off: {what} to 'pin'; exact axes give mobility 1 instead of 0: write axis: {axis}"


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (PIN, "at: A, axis: [0, 1, 0.001]", words("'elbow' (model.yaml:12:3) is 0.057 deg from parallel", "[0, 1, 0] at 'elbow'")),
        (PIN, "at: A, axis: [1.0e-7, -1, 0]", words("'elbow' (model.yaml:12:3) is 5.7e-06 deg from parallel", "[0, -1, 0] at 'elbow'")),
        (PIN, "at: A, axis: {from: A, to: P}", words("'elbow' (model.yaml:12:3) is 0.57 deg from parallel", "[0, 1, 0] at 'elbow'")),
        (RAIL, "at: B, axis: [1, 0.001, 0]", words("'rail' (model.yaml:14:3) is 0.057 deg from square", "[1, 0, 0] at 'rail'")),
    ],
)  # fmt: skip
def test_an_axis_that_is_slightly_off_makes_the_press_rigid(old: str, new: str, expected: str) -> None:
    text = PRESS.replace(old, new, 1).replace("C: [0.8, 0, 0]}", "C: [0.8, 0, 0], P: [0, 0.1, 0.101]}")
    assert said(text) == (0, expected)


def test_an_oblique_axis_is_that_of_another_joint() -> None:
    """All axes are turned about x, so that none is easy to write."""
    turned = PRESS.replace("[0, 1, 0]", "[0, 3, 4]").replace(PIN.replace("[0, 1, 0]", "[0, 3, 4]"), "at: A, axis: [0, 3, 4.001]")
    freedom, what = said(turned)
    assert freedom == 0
    assert what.endswith("write an axis at 'elbow' that is just that of 'pin'")


@pytest.mark.parametrize("angle", [0.0, 1e-12, 0.05])
def test_axes_that_are_exact_or_far_off_are_as_they_were_meant(angle: float) -> None:
    assert said(PRESS.replace(PIN, f"at: A, axis: [0, 1, {angle}]"))[1] == ""


def test_only_what_costs_freedom_is_named() -> None:
    """A tree has no loop that could jam, and a rod between two balls takes any axis of crank and slider."""
    tree = "\n".join(line for line in PRESS.splitlines() if "rail:" not in line).replace(PIN, "at: A, axis: [0, 1, 0.001]")
    assert said(tree)[1] == ""
    held = PRESS.replace("at: A, axis: [0, 1, 0]", "at: A").replace("at: B, axis: [0, 1, 0]", "at: B")
    for name in ("elbow", "wrist"):
        held = held.replace(f"{name}: {{kind: revolute", f"{name}: {{kind: spherical")
    assert said(held) == said(held.replace(RAIL, "at: B, axis: [1, 0.001, 0]")) == (2, "")


@pytest.mark.parametrize("name", ["delta", "stewart", "six_bar", "axle", "slider_crank", "flyball"])
def test_models_with_axes_in_space_have_none(name: str) -> None:
    assert said((MODELS / f"{name}.yaml").read_text(encoding="utf-8"))[1] == ""


@pytest.mark.parametrize("seed", [1, 3, 7, 9])
def test_random_loops_have_none(seed: int) -> None:
    equations = formulated(random_loops(seed))
    assert describe_skew(equations, find_mobility(equations)) == ""


def test_of_many_axes_three_are_named() -> None:
    text = parallel_cranks_text(4)
    for i in range(4):
        text = text.replace(f"at: [{i}, 0.0, 0], axis: [0, 0, 1]", f"at: [{i}, 0.0, 0], axis: [0, 0.00{i + 1}, 1]")
        text = text.replace(f"at: [{i}, 0, 0], axis: [0, 0, 1]", f"at: [{i}, 0, 0], axis: [0, 0.00{i + 1}, 1]")
    what = said(text)[1]
    assert what.count("from parallel to") == 3
    assert ", and 1 more; exact axes give mobility 1 instead of 0" in what


def test_check_says_so(tmp_path: Path) -> None:
    (tmp_path / "press.yaml").write_text(PRESS.replace(PIN, "at: A, axis: [0, 1, 0.001]"), encoding="utf-8")
    done = CliRunner(env={"COLUMNS": "400"}).invoke(main, ["check", str(tmp_path / "press.yaml")])
    assert "warning              axes are slightly off: 'elbow'" in done.output
