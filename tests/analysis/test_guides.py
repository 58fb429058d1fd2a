"""Guides that contradict each other are refused by name; those that do not are none of our business."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from cutjoint.analysis.mobility import GuideError
from cutjoint.cli import main
from cutjoint.compile.pipeline import generate
from cutjoint.methods import METHODS
from cutjoint.model.read import read_model, read_model_text
from tests.conftest import MODELS, needs_cpp

#: A four-bar that is a parallelogram; guides hold its crank and its rocker.
LOCKED = """\
cutjoint: 1
name: locked
gravity: [0, -9.81, 0]
parameters: {turn: {value: 0, unit: rad, binding: input}, other: {value: 0, unit: rad, binding: input}}
bodies:
  crank: {mass: 1, centre_of_mass: [0, 0.5, 0], inertia: [0.1, 0.1, 0.1]}
  coupler: {mass: 1, centre_of_mass: [0.5, 1, 0], inertia: [0.1, 0.1, 0.1]}
  rocker: {mass: 1, centre_of_mass: [1, 0.5, 0], inertia: [0.1, 0.1, 0.1]}
joints:
  crank_pin: {kind: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: [0, 0, 1], guide: turn}
  rocker_pin: {kind: revolute, bodies: [ground, rocker], at: [1, 0, 0], axis: [0, 0, 1], guide: other}
  coupler_pin: {kind: revolute, bodies: [crank, coupler], at: [0, 1, 0], axis: [0, 0, 1]}
  closure: {kind: revolute, bodies: [coupler, rocker], at: [1, 1, 0], axis: [0, 0, 1], cut: true}
outputs: [crank.x, coupler.x]
scenes:
  against: {end: 1, inputs: {turn: "0.3*t**2"}}
  late: {end: 10, inputs: {turn: "where(t > 5, 0.1*(t - 5)**2, 0)", other: "0"}}
  together: {end: 1, inputs: {turn: "0.3*t", other: "0.3*t"}}
  still: {end: 1, inputs: {turn: "0", other: "0"}}
  apart: {end: 1, inputs: {turn: "0.3"}}
"""


def derive(scene: str, text: str = LOCKED, method: str = "recursive") -> None:
    model = read_model_text(text, "locked.yaml")
    chosen = model.scenes[scene]
    generate(model, chosen, chosen.outputs, method=method)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("scene", ["against", "late"])
def test_contradictory_locks_are_refused(scene: str, method: str) -> None:
    line = next(i for i, text in enumerate(LOCKED.splitlines(), 1) if "crank_pin:" in text)
    with pytest.raises(GuideError) as error:
        derive(scene, method=method)
    assert str(error.value) == (
        f"locked.yaml:{line}:3: scene '{scene}': the guides of 'crank_pin', 'rocker_pin' are incompatible with the loop "
        "that 'closure' closes: no motion of its other joints satisfies them; leave out a guide, or free another joint of the loop"
    )


@pytest.mark.parametrize("scene", ["together", "still"])
def test_guides_that_agree_are_not(scene: str) -> None:
    """Two guides where one would do, but a parallelogram's crank and rocker turn alike."""
    derive(scene)


@pytest.mark.parametrize("law", ["sqrt(t)", "sqrt(-t)", "log(t)", "1/t", "asin(1 + t)", "0.1*t/t**2", "where(t < 1, sqrt(t), t)"])
def test_guides_begin_with_a_finite_position_and_rate(law: str) -> None:
    """NumPy's decomposition of a loop's Jacobian failed on these, and said no more."""
    text = LOCKED.replace('"0.3*t**2"}', f'"{law}"}}').replace(", guide: other", "")
    with pytest.raises(GuideError, match=r"locked.yaml:10:3: joint 'crank_pin': the guide has no finite position and rate at 0 s"):
        derive("against", text)


@pytest.mark.parametrize("law", ["t**1.5", "abs(t)", "where(t > 0.1, log(t + 0.9), 0)", "1/(t - 0.3)", "max(0, t - 0.2)**2"])
def test_other_guides_may_begin(law: str) -> None:
    derive("against", LOCKED.replace('"0.3*t**2"}', f'"{law}"}}').replace(", guide: other", ""))


def test_a_guided_crank_may_start_in_a_singular_pose() -> None:
    """With all bars in line the loop's Jacobian has lost a direction, though the crank can turn."""
    flat = LOCKED.replace(", guide: other", "").replace("[0, 0.5, 0]", "[0.5, 0, 0]").replace("[0.5, 1, 0]", "[1.5, 0, 0]")
    flat = flat.replace("[1, 0.5, 0]", "[1.5, 0, 0]").replace("at: [0, 1, 0]", "at: [1, 0, 0]").replace("at: [1, 1, 0]", "at: [2, 0, 0]")
    derive("against", flat)


def test_the_slalom_is_not_refused() -> None:
    model = read_model(MODELS / "iltis.yaml")
    generate(model, model.scenes["simul3"], ())


@needs_cpp
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["simulate", "--scene", "against", "--out", "out.csv"], "are incompatible with the loop that 'closure' closes"),
        (["reduce", "--scene", "against"], "are incompatible with the loop that 'closure' closes"),
        (["simulate", "--scene", "apart", "--out", "out.csv"], "locked.yaml:10:3: scene 'apart': the loop cannot close from the given"),
        (["reduce", "--scene", "apart"], "locked.yaml:13:3: scene 'apart': the full model has no run to measure by: the loop cannot close"),
        (
            ["simulate", "--scene", "apart", "--method", "auto", "--accuracy", "1e-3", "--out", "out.csv"],
            "scene 'apart': no converged reference run: recursive, dop853: the loop cannot close from the given coordinates",
        ),
    ],
)  # fmt: skip
def test_commands_end_with_the_reason(arguments: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("locked.yaml").write_text(LOCKED)
    done = CliRunner().invoke(main, [arguments[0], "locked.yaml", *arguments[1:]])
    assert done.exit_code == 1
    assert message in done.output.replace("\n", " "), done.output
