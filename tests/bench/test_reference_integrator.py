"""The integrator `reference` in a simulator: what it finds and where it stops."""

from __future__ import annotations

import pytest

from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.model.read import read_model_text
from cutjoint.package.errors import RunError
from cutjoint.run.simulation import simulate
from tests.conftest import MODELS
from tests.mechanisms import gears
from tests.physics import simulation
from tests.physics.test_gears import verify
from tests.reduce import test_guards as guards

ADDED = ("reference",)


@pytest.mark.heavy
@pytest.mark.parametrize("method", ["recursive", "classical"])
def test_it_checks_guards_at_its_rows(method: str) -> None:
    model, scene = guards.without(*guards.OUT), guards.hammer().scenes["turn"]
    artifact = compile_scene(model, scene, CompileOptions(method=method, additions=ADDED))
    failure = simulate(artifact, integrator="reference", dt=0.01, tolerance=1e-8, check=False).failure
    limit = guards.run(method, "turn").failure
    assert failure is not None
    assert limit is not None
    assert failure.guards == ("wall",)
    assert 0 <= failure.time - limit.time + 1e-3 < 0.012


@pytest.mark.heavy
def test_gears_in_natural_coordinates() -> None:
    """The pinion makes several turns, which its angle counts; the rates of what a gear drives follow from those given."""
    model = read_model_text(gears.TEXT, "gears.yaml")
    artifact = compile_scene(model, model.scenes["run"], CompileOptions(method="classical", additions=ADDED))
    run = simulation.completed(simulate(artifact, integrator="reference"))
    verify(dict(run.columns), run.t, 2e-8)


def test_a_simulator_without_it_says_how_to_get_it() -> None:
    artifact = simulation.compile_model(MODELS / "four_bar.yaml", scene="swing")
    with pytest.raises(RunError, match=r'^this simulator is without reference: compile the model with additions=\["reference"\]$'):
        simulate(artifact, integrator="reference")
