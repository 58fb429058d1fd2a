"""Forces and torques that a host sets on bodies: beside Jacobians of their points, closed forms, and loads that the model file names."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.integrate import solve_ivp

import cutjoint
from cutjoint.cli import main
from cutjoint.model.expressions.tunable import WRENCH_UNITS, with_external_wrenches
from cutjoint.model.read import read_model_text
from cutjoint.stepping.load import load_scene
from tests.conftest import ROOT, needs_cpp

CART_POLE = ROOT / "examples" / "cart_pole.yaml"

BOX = """
cutjoint: 1
name: box
gravity: [0, 0, -9.81]
{parameters}
bodies:
  box: {{mass: 2, centre_of_mass: [0.1, 0, 0], inertia: [0.1, 0.2, 0.3]}}
joints:
  free: {{kind: free, bodies: [ground, box], at: [0, 0, 0]}}
markers:
  corner: {{body: box, at: [0.4, 0.2, -0.1]}}
{forces}
outputs: [box.x, box.y, box.z, corner.x, corner.y, corner.z]
scenes:
  fall: {{end: 1, output_step: 10 ms, numerics: {{dt: 1 ms}}}}
"""

pytestmark = needs_cpp


def test_an_external_wrench_is_what_the_jacobian_of_its_point_says() -> None:
    sim = cutjoint.load(CART_POLE, external_wrenches=["cart", "pole"], linearise=True, poses=True)
    sim.reset(coordinates={"pin.angle": 0.4}, speeds={"pin.angle_rate": 0.7})
    mass, force = sim.equations_of_motion()
    jacobian = sim.point_jacobian("pole")
    wrench = np.array([2.0, 0.5, -1.5, 0.2, 0.3, 0.1])
    for end, value in zip(WRENCH_UNITS, wrench, strict=True):
        sim.inputs[f"pole.wrench.{end}"] = value
    assert sim.equations_of_motion()[1] - force == pytest.approx(jacobian.T @ wrench, rel=1e-12, abs=1e-12)
    columns = [sim.inputs.place(f"pole.wrench.{end}") for end in WRENCH_UNITS]
    assert sim.linearise().B[2:, columns] == pytest.approx(np.linalg.solve(mass, jacobian.T), rel=1e-11, abs=1e-12)
    sim.inputs["pole.wrench.fx"] = 0.0
    wrench[0] = 0.0
    assert sim.equations_of_motion()[1] - force == pytest.approx(jacobian.T @ wrench, rel=1e-12, abs=1e-12)


def test_a_body_under_an_external_wrench_moves_as_its_centre_and_its_turn() -> None:
    sim = load_scene(*_box(external_wrenches=("box", "corner")), integrator="dormand-prince").reset(tolerance=1e-11)
    sim.inputs["box.wrench.fx"], sim.inputs["box.wrench.ty"], sim.inputs["corner.wrench.fz"] = 3.0, 0.05, 0.2
    sim.advance(0.7)

    def rates(_: float, y: np.ndarray) -> np.ndarray:
        R, v, w = y[3:12].reshape(3, 3), y[12:15], y[15:]  # w in global axes
        external_wrenches = np.array([0.0, 0.0, 0.2])
        inertia = R @ np.diag([0.1, 0.2, 0.3]) @ R.T
        torque = np.array([0.0, 0.05, 0.0]) + np.cross(R @ [0.3, 0.2, -0.1], external_wrenches)
        turn = np.linalg.solve(inertia, torque - np.cross(w, inertia @ w))
        moved = (np.array([3.0, 0.0, 0.0]) + external_wrenches) / 2 + [0, 0, -9.81]
        return np.concatenate([v, np.cross(w, R.T).T.ravel(), moved, turn])

    y0 = np.concatenate([[0.1, 0, 0], np.eye(3).ravel(), np.zeros(6)])
    y = solve_ivp(rates, (0, 0.7), y0, rtol=1e-12, atol=1e-13).y[:, -1]
    corner = y[:3] + y[3:12].reshape(3, 3) @ [0.3, 0.2, -0.1]
    assert [*sim.outputs.array] == pytest.approx([*y[:3], *corner], abs=1e-9)


def test_an_external_wrench_is_the_load_that_a_model_file_names() -> None:
    own = list(WRENCH_UNITS)
    named = [f"corner.wrench.{end}" for end in own]
    text = BOX.format(
        parameters=f"parameters: {{{', '.join(f'{name}: {{value: 0, binding: input}}' for name in own)}}}",
        forces="forces:\n  a: {kind: load, body: box, at: [0.4, 0.2, -0.1], force: [fx, fy, fz]}\n"
        "  b: {kind: load, body: box, torque: [tx, ty, tz]}",
    )
    model = read_model_text(text, "box.yaml")
    sims = [load_scene(*_box(external_wrenches=["corner"])).reset(), load_scene(model, model.scenes["fall"]).reset()]
    for step in range(50):
        for i in range(6):
            value = np.sin(0.1 * step + i)
            sims[0].inputs[named[i]] = sims[1].inputs[own[i]] = value
        for sim in sims:
            sim.step()
    assert sims[0].outputs.array.tolist() == sims[1].outputs.array.tolist()


def test_the_folder_and_the_fmu_have_the_inputs(tmp_path: Path) -> None:
    run = CliRunner().invoke(main, ["compile", str(CART_POLE), "--external-wrench", "pole", "--out", str(tmp_path / "c")])
    assert run.exit_code == 0, run.output
    header = (tmp_path / "c" / "cart_pole.h").read_text()
    assert "CART_POLE_INPUT_pole_wrench_fx" in header
    assert "CART_POLE_INPUT_pole_wrench_tz" in header
    to = ["--to", "fmu", "--sources", "--out", str(tmp_path / "c.fmu")]
    run = CliRunner().invoke(main, ["export", str(CART_POLE), "--external-wrench", "pole", *to])
    assert run.exit_code == 0, run.output
    assert "7 inputs" in run.output


@pytest.mark.parametrize(
    ("names", "words"),
    [(["pol"], "did you mean 'pole'"), (["pole", "pole"], "is given twice"), (["ground"], "no body or marker of this name")],
)
def test_what_cannot_be_loaded_is_reported(names: list[str], words: str) -> None:
    with pytest.raises(cutjoint.ModelError, match=words):
        cutjoint.load(CART_POLE, external_wrenches=names)


def _box(external_wrenches: tuple[str, ...] | list[str]) -> tuple[cutjoint.Model, cutjoint.Scene]:
    model = with_external_wrenches(read_model_text(BOX.format(parameters="", forces=""), "box.yaml"), external_wrenches)
    return model, model.scenes["fall"]
