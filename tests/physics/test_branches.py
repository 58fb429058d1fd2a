"""Branches at singular poses: no run takes the wrong one silently."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from cutjoint.compile.options import CompileOptions
from cutjoint.model.read import read_model, read_model_text
from cutjoint.run.simulation import simulate
from cutjoint_bench.studies.branches import EQUAL_BARS, MECHANISMS, judge
from tests.conftest import MODELS
from tests.physics.simulation import compile_scene, completed

#: Half a degree or so of a crank that turns at 1 rad/s.
STEP = pi / 200
#: The crank is a flywheel, so that steps end on the dead centre.
ON_DEAD_CENTRE = (
    EQUAL_BARS.replace("inertia: [0.001, 0.1, 0.1]", "inertia: [1e8, 1e8, 1e8]", 1).replace("angle_rate: 2", "angle_rate: 1")
    .replace("START", "0").replace("end: 4, output_step: 0.02", f"end: {400 * STEP!r}, output_step: {10 * STEP!r}")
)  # fmt: skip


@pytest.mark.parametrize(
    ("method", "integrator"), [("recursive-newton", "trapezoidal"), ("recursive-newton", "generalised-alpha"), ("recursive", None)]
)
@pytest.mark.parametrize("parts", [1, 2])
def test_steps_that_end_on_a_dead_centre_keep_the_branch(method: str, integrator: str | None, parts: int) -> None:
    model = read_model_text(ON_DEAD_CENTRE, "equal_bars.yaml")
    (scene,) = model.scenes.values()
    run = completed(simulate(compile_scene(model, scene, CompileOptions(method=method)), integrator=integrator, dt=STEP / parts))
    assert np.abs(run["slider.x"] - 2 * np.cos(run.t)).max() < 2e-4
    assert run["slider.x"].min() < -1.99


def test_a_run_that_leaves_its_branch_says_so() -> None:
    """dormand-prince with 1e-3 jumps over the pose where all bars are in line; with 1e-4 it does not."""
    model = read_model(MODELS / "four_bar.yaml")
    artifact = compile_scene(model, model.scenes["swing"])
    jumped, stayed = (simulate(artifact, integrator="dormand-prince", tolerance=x) for x in (1e-3, 1e-4))
    assert np.abs(jumped["tip.x"] - np.interp(jumped.t, stayed.t, stayed["tip.x"])).max() > 1
    assert not jumped.error.converged
    assert stayed.error.converged


@pytest.mark.parametrize("dt", [0.02, 0.01])
@pytest.mark.parametrize("name", MECHANISMS)
def test_equal_steps_stay(name: str, dt: float) -> None:
    """The implicit rule in relative coordinates, which has no stabilisation to lead it back."""
    text, zero = MECHANISMS[name]
    model = read_model_text(text.replace("START", "0.2"), f"{name}.yaml")
    (scene,) = model.scenes.values()
    run = simulate(compile_scene(model, scene, CompileOptions(method="recursive-newton")), integrator="trapezoidal", dt=dt)
    assert judge(run, zero).kind == "stays"
