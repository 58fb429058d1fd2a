"""Derivatives of a trim's conditions, and gradients of what it finds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from cutjoint import find_trim, read_model_text
from cutjoint.analysis.trim_equations import TrimEquations
from cutjoint.cli import main
from cutjoint.package.errors import RunError
from cutjoint.run.run_file import formulated_start, make_trim_problem
from cutjoint.stepping.load import load_scene
from tests.mechanisms.starts import CRANE, LOADER, MOTORCYCLE
from tests.mechanisms.trims import FIVE_BAR, MOTOR, SLED

SPINNING_BAR = FIVE_BAR.replace(
    "trim: {find: [preload, moment], hold: {a.angle: 5 deg, spring.length: 0.69 m}}",
    "rates: {a.angle_rate: 2}, trim: {find: [e.angle_rate]}",
)


@pytest.mark.parametrize(
    ("text", "scene"),
    [(FIVE_BAR, "held"), (SPINNING_BAR, "held"), (MOTOR, "held"), (CRANE, "slewing"), (LOADER, "hold"), (MOTORCYCLE, "leans")],
)
def test_derivatives_are_exact(text: str, scene: str) -> None:
    """Beside central differences of the conditions, of which each errs by its step squared and rounding over it."""
    model = read_model_text(text, "m.yaml")
    of = formulated_start(model, model.scenes[scene])
    equations = TrimEquations(of, make_trim_problem(model, model.scenes[scene], {}))
    free, sizes = np.flatnonzero(equations._free), equations._sizes
    y = equations.begin + np.where(equations._free, 1e-2 * np.random.default_rng(1).standard_normal(len(sizes)) * sizes, 0)
    evaluated = equations.evaluated(y)
    exact = evaluated.A * evaluated.rows[:, np.newaxis] / evaluated.columns
    steps = 1e-6 * sizes[free, np.newaxis] * np.eye(len(y))[free]
    differences = np.array([(equations.residuals(y + h) - equations.residuals(y - h)) / (2 * h.sum()) for h in steps]).T
    error = np.abs(differences - exact) * sizes[free] / np.maximum(evaluated.rows, 1e-3)[:, np.newaxis]
    assert error.max() < 1e-6


def test_gradients_of_what_is_found() -> None:
    """By closed forms: a current by the arm's length, drag by the speed."""
    motor = find_trim(read_model_text(MOTOR, "m.yaml"), by=["length"])
    assert motor.gradients["length"] == pytest.approx({name: value / 0.5 for name, value in motor.unknowns.items()}, rel=1e-8)
    sled = find_trim(read_model_text(SLED, "m.yaml"), parameters={"target": 15.0}, by=["target"])
    assert sled.gradients["target"] == pytest.approx({"throttle": 2 * 0.7 * 15 / 900}, rel=1e-8)


@pytest.mark.heavy
def test_gradients_of_a_motorcycle_that_leans() -> None:
    """Beside differences of trims."""
    bike = read_model_text(MOTORCYCLE, "m.yaml")
    less, more = (find_trim(bike, scene="leans", parameters={"speed": 15 + x}).unknowns for x in (-0.01, 0.01))
    differences = {name: (more[name] - less[name]) / 0.02 for name in less}
    assert find_trim(bike, scene="leans", by=["speed"]).gradients["speed"] == pytest.approx(differences, rel=1e-4, abs=1e-5)


@pytest.mark.parametrize(
    ("by", "said"), [("voltage", "no gradient by 'voltage'; name a tunable parameter that is given"), ("lenght", "did you mean 'length'?")]
)
def test_gradients_by_what_has_none(by: str, said: str) -> None:
    with pytest.raises(RunError) as error:
        find_trim(read_model_text(MOTOR, "m.yaml"), by=[by])
    assert said in str(error.value)


def test_the_command_prints_gradients(tmp_path: Path) -> None:
    """The drag is 0.7 v|v|; differences of trims agree."""
    (tmp_path / "m.yaml").write_text(SLED)
    command = ["gradient", str(tmp_path / "m.yaml"), "--objective", "start"]
    result = CliRunner().invoke(main, [*command, "--set", "target=15", "--check"])
    assert result.exit_code == 0
    title, _, value, row, deviation = result.output.splitlines()
    assert (title, float(value.split()[0])) == ("found by the trim", pytest.approx(0.7 * 15**2 / 900, rel=1e-5))
    assert (row.split()[0], float(row.split()[1])) == ("target", pytest.approx(2 * 0.7 * 15 / 900, rel=1e-5))
    assert float(deviation.split()[5]) < 1e-8
    words = "scene 'steady': trim: 'throtle' is not under 'find'; did you mean 'throttle'?"
    assert words in CliRunner().invoke(main, [*command, "--output", "throtle"]).output


@pytest.mark.heavy
def test_a_frozen_start_has_no_derivatives() -> None:
    sim = load_scene(model := read_model_text(SLED, "m.yaml"), model.scenes["steady"], linearise=True).reset()
    with pytest.raises(ValueError, match="the start is trimmed once"):
        sim.initial_state_sensitivities([], ["target"])
