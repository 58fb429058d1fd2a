"""Outputs by expressions, by all methods and where hosts see them: what NumPy makes of plain outputs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import cutjoint
from cutjoint.compile.options import CompileOptions
from cutjoint.export.fmu.archive import make_fmu
from cutjoint.methods import METHODS
from cutjoint.model.read import read_model_text
from cutjoint.run.simulation import simulate
from tests.conftest import needs_cpp, with_heavy
from tests.physics.simulation import compile_scene

ARM = """
cutjoint: 1
name: arm
gravity: [0, 0, -9.81]
parameters:
  torque: {value: 3, unit: N*m, binding: param}
  wind: {value: 0, unit: N, binding: input}
bodies: {arm: {mass: 2, centre_of_mass: [0.75, 0, 0], inertia: [0.01, 0.4, 0.4]}}
joints: {hinge: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: [0, 1, 0]}}
forces: {push: {kind: load, body: arm, at: [1, 0, 0], force: [wind, 0, 0]}}
reactions: {foot: {joint: hinge, axes_of: ground}}
signals: {drop: -arm.z}
scenes:
  fall:
    end: 0.3
    output_step: 0.01
    inputs: {wind: 2*t}
    numerics: {dt: 1 ms}
    outputs:
      - hinge.angle
      - arm.z
      - arm.az
      - foot.Fx
      - foot.Fz
      - push.Fx
      - angle: {value: -hinge.angle, unit: deg}
      - below: {value: drop, unit: mm}
      - resultant: {value: "sqrt(foot.Fx**2 + foot.Fz**2)", unit: kN}
      - left: foot.Fz + 2*arm.az - 2*9.81 + push.Fx*t
      - sum: torque*hinge.angle*1 + wind*1
"""


def expected(of: dict[str, np.ndarray], t: np.ndarray) -> dict[str, np.ndarray]:
    return {
        "angle": np.degrees(-of["hinge.angle"]), "below": -1000 * of["arm.z"],
        "resultant": np.hypot(of["foot.Fx"], of["foot.Fz"]) / 1000,
        "left": of["foot.Fz"] + 2 * of["arm.az"] - 2 * 9.81 + of["push.Fx"] * t, "sum": 3 * of["hinge.angle"] + 2 * t,
    }  # fmt: skip


@pytest.mark.parametrize("method", with_heavy(METHODS, "classical", "recursive-newton"))
def test_expressions_are_those_of_plain_outputs(method: str) -> None:
    model = read_model_text(ARM, "arm.yaml")
    found = simulate(compile_scene(model, model.scenes["fall"], CompileOptions(method=method)))
    assert list(found.units.values())[-5:] == ["deg", "mm", "kN", "", ""]
    for name, values in expected(found.columns, found.t).items():
        assert found[name] == pytest.approx(values, rel=1e-12, abs=1e-13), name  # rounding of sums of numbers up to 30


@pytest.mark.parametrize(("unit", "size"), [("rad", 1.0), ("deg", 180 / np.pi)])
def test_a_tolerance_means_radians_whatever_the_unit(unit: str, size: float) -> None:
    """Steps do not depend on it, and errors are in the unit of the column."""
    scene = f"  tried: {{end: 0.3, output_step: 0.01, tolerance: 1e-7, outputs: [{{turn: {{value: hinge.angle, unit: {unit}}}}}]}}\n"
    model = read_model_text(ARM + scene, "arm.yaml")
    plain = read_model_text(ARM + scene.replace(f"{{turn: {{value: hinge.angle, unit: {unit}}}}}", "hinge.angle"), "arm.yaml")
    found, known = (simulate(compile_scene(m, m.scenes["tried"])) for m in (model, plain))
    assert found.steps == known.steps
    assert np.array_equal(found["turn"], size * known["hinge.angle"])
    assert found.error.max_error["turn"] == pytest.approx(size * known.error.max_error["hinge.angle"], rel=1e-3)


@needs_cpp
@pytest.mark.heavy
def test_hosts_have_them(tmp_path: Path) -> None:
    """Python's simulation, and the description of an FMU."""
    path = tmp_path / "arm.yaml"
    path.write_text(ARM)
    simulation = cutjoint.load(path).reset()
    simulation.advance(0.2)
    found = {name: np.array([value]) for name, value in simulation.outputs.items()}
    for name, value in expected(found, np.array([0.2])).items():
        assert found[name] == pytest.approx(value, rel=1e-12, abs=1e-13), name
    model = read_model_text(ARM, "arm.yaml")
    variables = {v.name: v for v in make_fmu(model, model.scenes["fall"], version=3).interface.variables}
    assert [variables[name].unit for name in ("angle", "below", "resultant", "sum")] == ["deg", "mm", "kN", ""]
