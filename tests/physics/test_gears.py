"""Gears by every method against equations by hand: racks, trains, a differential, a guided drive."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import sympy

from cutjoint.compile.options import CompileOptions
from cutjoint.model.read import read_model_text
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from tests.conftest import needs_cpp
from tests.mechanisms import gears
from tests.physics.simulation import compile_scene

pytestmark = needs_cpp


@cache
def compiled(method: str) -> Artifact:
    model = read_model_text(gears.TEXT, "gears.yaml")
    return compile_scene(model, model.scenes["run"], CompileOptions(method=method))


def finished(method: str, **how: object) -> Trajectory:
    run = simulate(compiled(method), **how)
    assert run.failure is None, run.failure
    return run


def verify(columns: dict[str, np.ndarray], t: np.ndarray, tolerance: float) -> None:
    expected = gears.motion(t)
    assert columns.keys() == expected.keys()
    for name, values in expected.items():
        assert columns[name] == pytest.approx(values, abs=tolerance * max(1.0, np.abs(values).max())), name


@pytest.mark.parametrize(("method", "integrator"), [
    ("recursive", "dormand-prince"), ("recursive-newton", "sdirk4"), ("recursive-newton", "radau5"),
])  # fmt: skip
def test_tight_integrators(method: str, integrator: str) -> None:
    """The pinion makes several turns, which its angle counts; the rates of what a gear drives follow from those given."""
    run = finished(method, integrator=integrator)
    assert np.ptp(run["pinion.angle"]) > 4 * np.pi
    verify(dict(run.columns), run.t, 2e-8)


def test_given_coordinates_that_contradict_a_gear_name_it() -> None:
    artifact = compiled("recursive")
    positions = {"pinion.angle": 1.0, "rack.displacement": 0.3}
    scene = replace(artifact.scene, positions={n: sympy.Float(x) for n, x in positions.items()})
    run = simulate(replace(artifact, scene=scene), end=0.01, check=False)
    assert run.failure is not None
    assert run.failure.element == "mesh.ratio"
    assert run.failure.residual == pytest.approx(0.2)
    assert artifact.places["mesh"] == "gears.yaml:35:3"


def test_a_given_coordinate_turns_what_a_gear_couples_it_to() -> None:
    """Several turns, which no closing of the gear takes back."""
    artifact = compiled("recursive")
    run = simulate(replace(artifact, scene=replace(artifact.scene, positions={"pinion.angle": sympy.Float(20)}, rates={})), end=0.01)
    assert run.failure is None
    assert run["rack.displacement"][0] == pytest.approx(2.0, abs=1e-9)
    assert run["pinion.angle"][0] == pytest.approx(20.0, abs=1e-8)


@pytest.mark.parametrize("method", ["recursive", "recursive-newton", "augmented", "classical"])
def test_trapezoidal_rule(method: str) -> None:
    """Of second order: two runs extrapolate to nearly all digits.  A penalty of 1e9 beside inertias of 0.01 kg m2 would cost them."""
    how = {"integrator": "trapezoidal", **({"penalty": 1e6} if method == "recursive" else {})}
    coarse, fine = (finished(method, dt=dt, **how) for dt in (1e-3, 5e-4))
    verify({name: (4 * fine[name] - coarse[name]) / 3 for name in fine.columns if name != "mesh.force"} | {
        "mesh.force": gears.motion(fine.t)["mesh.force"],
    }, fine.t, 3e-6)  # fmt: skip
