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
    ("recursive", "dormand-prince"), ("recursive-newton", "radau5"),
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


#: Elliptic wheels, turning opposite ways about foci, of eccentricity 0.5, without weight; and a cam under a valve that a spring pulls back.
BENT = """
cutjoint: 1
name: bent
gravity: [0, 0, -9.81]
parameters:
  e: {value: 0.5, binding: param}
  stroke: {value: 8, unit: mm, binding: param}
points: {O: [0, 0, 0], P: [0.2, 0, 0], Q: [0.4, 0, 0]}
bodies:
  one: {mass: 1, centre_of_mass: O, inertia: [0.01, 0.012, 0.01]}
  two: {mass: 1, centre_of_mass: P, inertia: [0.02, 0.03, 0.02]}
  shaft: {mass: 1, centre_of_mass: Q, inertia: [0.01, 0.01, 0.01]}
  valve: {mass: 0.4, centre_of_mass: Q, inertia: [0.01, 0.01, 0.01]}
joints:
  driver: {kind: revolute, bodies: [ground, one], at: O, axis: y}
  driven: {kind: revolute, bodies: [ground, two], at: P, axis: y}
  cam: {kind: revolute, bodies: [ground, shaft], at: Q, axis: y, guide: 60*t}
  stem: {kind: prismatic, bodies: [ground, valve], at: Q, axis: z, spring: {stiffness: 20 kN/m, free_position: -2 mm}}
gears:
  oval: {joints: [driven, driver], law: "-position - 2*atan2(e*sin(position), 1 - e*cos(position))"}
  profile: {joints: [stem, cam], law: stroke*(1 - cos(position))/2}
outputs: [driver.angle, driven.angle, driver.angle_rate, stem.displacement, profile.force]
scenes:
  turn: {end: 0.5, output_step: 0.01, rates: {driver.angle_rate: 20}}
"""


@pytest.mark.parametrize("method", ["recursive", "recursive-newton", "augmented", "classical"])
def test_wheels_and_cams_with_laws(method: str) -> None:
    """Elliptic wheels conserve (I_1 + f'^2 I_2) w^2, where tan(f/2) = -(1 + e)/(1 - e) tan(x/2), the theorem of the half angle.  A valve
    on a cam of constant speed feels m f'' w^2 beside weight and spring."""
    model = read_model_text(BENT, "bent.yaml")
    artifact = compile_scene(model, model.scenes["turn"], CompileOptions(method=method))
    equal = method in ("augmented", "classical")
    run = simulate(artifact, **({"dt": 2e-5} if equal else {"tolerance": 1e-11}))  # type: ignore[arg-type]
    assert run.failure is None, run.failure
    error = 1e-4 if equal else 1e-8
    x, e, ratio = run["driver.angle"], 0.5, 3.0
    assert np.ptp(x) > 2 * np.pi
    np.testing.assert_allclose(np.tan(run["driven.angle"] / 2), -ratio * np.tan(x / 2), rtol=1e-6)
    slope = -(1 - e**2) / (1 + e**2 - 2 * e * np.cos(x))
    energy = (0.012 + 0.03 * slope**2) * run["driver.angle_rate"] ** 2
    np.testing.assert_allclose(energy, energy[0], rtol=error)
    angle, w, stroke, mass = 60 * run.t, 60.0, 0.008, 0.4
    lift = stroke * (1 - np.cos(angle)) / 2
    np.testing.assert_allclose(run["stem.displacement"], lift, rtol=0, atol=error)
    external_wrenches = mass * (stroke / 2 * w**2 * np.cos(angle) + 9.81) + 2e4 * (lift + 0.002)
    np.testing.assert_allclose(run["profile.force"], external_wrenches, rtol=0, atol=3e-2 if equal else 1e-5)


def test_a_law_of_a_table_is_its_cubic() -> None:
    """A dwell, a rise over 20 mm, a dwell: at rest outside, monotonic within."""
    table = "{table: {position: [0, 60 deg, 120 deg, 210 deg], value: [0, 0, 20 mm, 20 mm]}}"
    text = BENT.replace("law: stroke*(1 - cos(position))/2", f"law: {table}").replace("60*t", "7*t")
    model = read_model_text(text, "bent.yaml")
    run = simulate(compile_scene(model, model.scenes["turn"]))
    angle, lift = 7 * run.t, run["stem.displacement"]
    np.testing.assert_allclose(lift[angle < np.radians(60)], 0, atol=1e-12)
    np.testing.assert_allclose(lift[(angle > np.radians(120)) & (angle < np.radians(200))], 0.02, atol=1e-9)
    assert np.all(np.diff(lift) > -1e-12)
    middle = np.interp(np.radians(90), angle, lift)
    assert middle == pytest.approx(0.01, abs=1e-3)
