"""Friction by the load of a joint wherever a model runs: Python, batches, studies, FMUs, mirrored submodels, loops as functions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import cutjoint
from cutjoint.analysis.embedding.embed import embed_loops
from cutjoint.cli import main
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.compile.pipeline import CompileOptions, compile_scene
from cutjoint.export.fmu.archive import make_fmu
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.run.simulation import simulate
from cutjoint.tasks.batch import compile_scene_batch, simulate_batch
from tests.conftest import needs_cpp
from tests.fmu.slaves import write
from tests.physics.test_friction import FOUR_BAR, PENDULUM

pytestmark = needs_cpp

#: A pendulum whose coefficient is open.
OPEN = PENDULUM.replace("bodies:", "parameters: {grip: {value: 0.2, binding: param}}\nbodies:", 1).replace(
    "coefficient: 0.2, static: 0.3", "coefficient: grip, static: 1.5*grip"
)
GRIPS = (0.1, 0.2, 0.4)

#: Two pendulums side by side, one the image of the other, with balls off the plane of their swing, which their pins hold by moments.
PAIR = """
cutjoint: 1
name: pair
gravity: [1, 0, -9.81]
bodies: {}
submodels:
  arm:
    connectors: []
    bodies: {bob: {mass: 2, centre_of_mass: [0.1, 0.4, -0.5], inertia: [0.02, 0.02, 0.03, 0.001, 0.002, 0.003]}}
    joints: {pin: {kind: revolute, bodies: [ground, bob], at: [0, 0.3, 0], axis: [0.1, 1, 0.2]}}
    forces: {rub: {kind: joint_friction, joint: pin, coefficient: 0.05, radius: 0.02, arm: 0.05, thrust_radius: 0.03}}
    outputs: [bob.x, bob.y, rub.load, pin.angle, rub.force]
instances:
  left: {use: arm}
  right: {use: arm, mirror: y}
scenes: {swing: {end: 1, output_step: 0.05}}
"""


def pendulum() -> Model:
    return read_model_text(OPEN, "pendulum.yaml")


@pytest.mark.parametrize("method", ["recursive", "recursive-newton"])
def test_restored_moments_of_python_go_on_the_same(method: str, tmp_path: Path) -> None:
    file = tmp_path / "pendulum.yaml"
    file.write_text(OPEN, encoding="utf-8")
    sim = cutjoint.load(file, method=method, integrator="trapezoidal")
    run = cutjoint.simulate(cutjoint.compile_model(file, method=method), integrator="trapezoidal", error=False, dt=1e-3, end=0.2)
    sim.reset(dt=1e-3)
    for t, angle, load in zip(run.t, run["pin.angle"], run["rub.load"], strict=True):
        sim.advance(t)
        assert (sim.outputs["pin.angle"], sim.outputs["rub.load"]) == (angle, load)
    moment = sim.snapshot()
    first = sim.run(50)
    sim.restore(moment)
    assert np.array_equal(sim.run(50), first)


@pytest.mark.parametrize("method", ["recursive", "recursive-newton"])
def test_generated_code_of_a_loop_has_the_loads_of_the_interpreter(method: str) -> None:
    model = read_model_text(FOUR_BAR.format(cut="true", more=""), "four_bar.yaml")
    scene = model.scenes["swing"]
    made, reported = compile_scene(model, scene, CompileOptions(method=method)), compile_interpreted(model, scene, method=method)
    runs = [simulate(artifact, dt=1e-3, integrator="trapezoidal", error=False, check=True) for artifact in (made, reported)]
    for name in ("A.angle", "at_A.load", "at_C.load"):
        assert runs[0][name] == pytest.approx(runs[1][name], rel=1e-8), name


def test_batches_and_studies(tmp_path: Path) -> None:
    scene = pendulum().scenes["swing"]
    artifact, cases = compile_scene(pendulum(), scene), [{"grip": grip} for grip in GRIPS]
    singles = [simulate(artifact, parameters=case, integrator="trapezoidal", dt=1e-3, error=False, check=True) for case in cases]
    batch = simulate_batch(compile_scene_batch(pendulum(), scene), cases, dt=1e-3, threads=1)
    file = tmp_path / "pendulum.yaml"
    file.write_text(OPEN, encoding="utf-8")
    study = {
        "cutjoint_study": 1, "model": str(file), "parameters": {"grip": list(GRIPS)}, "design": "grid", "integrator": "trapezoidal",
        "dt": 1e-3, "objectives": {"last": {"end": "pin.angle"}, "most": {"maximum": "rub.load"}},
    }  # fmt: skip
    done = cutjoint.sweep(study, tmp_path / "out.parquet")
    for i, single in enumerate(singles):
        for name, column in single.columns.items():
            assert batch.end[name][i] == pytest.approx(column[-1], abs=1e-9), name
        assert done["last"][i] == pytest.approx(single["pin.angle"][-1], abs=1e-9)
        assert done["most"][i] == pytest.approx(single["rub.load"].max(), rel=1e-9)


def test_an_fmu_has_the_bristle_as_a_state(tmp_path: Path) -> None:
    fmpy = pytest.importorskip("fmpy")
    model = pendulum()
    known = simulate(compile_interpreted(model, model.scenes["swing"]), integrator="dormand-prince", tolerance=1e-10, error=False, end=0.5)
    file = write(make_fmu(model, model.scenes["swing"], version=3, kind="me"), tmp_path)
    assert len(fmpy.read_model_description(str(file)).derivatives) == 3  # of the angle, its rate and the bristle
    table = fmpy.simulate_fmu(str(file), stop_time=0.5, output_interval=known.t[1], relative_tolerance=1e-9, record_events=False)
    assert np.abs(table["pin.angle"] - known["pin.angle"]).max() < 1e-6
    assert np.abs(table["rub.load"] - known["rub.load"]).max() < 1e-2


def test_images_of_submodels_have_the_image_of_the_motion() -> None:
    model = read_model_text(PAIR, "pair.yaml")
    run = simulate(compile_interpreted(model, model.scenes["swing"]), integrator="dormand-prince", tolerance=1e-8, error=False)
    assert np.ptp(run["left.bob.x"]) > 0.05
    for name, sign in (("bob.x", 1), ("bob.y", -1), ("rub.load", 1), ("pin.angle", 1), ("rub.force", 1)):
        assert np.abs(run[f"left.{name}"] - sign * run[f"right.{name}"]).max() < 1e-6 * max(1.0, np.abs(run[f"left.{name}"]).max()), name


def test_loops_with_friction_stay_exact_and_say_so() -> None:
    model = read_model_text(FOUR_BAR.format(cut="true", more=""), "four_bar.yaml")
    outcome = embed_loops(model, model.scenes["swing"])
    assert outcome.model.embedded_loops == ()
    assert [note.text for note in outcome.left] != []
    assert all("its joint friction needs their loads" in note.text for note in outcome.left)


@pytest.mark.parametrize("target", ["pinocchio", "mujoco", "exudyn"])
def test_exports_refuse_it_by_its_name(target: str, tmp_path: Path) -> None:
    file = tmp_path / "pendulum.yaml"
    file.write_text(PENDULUM, encoding="utf-8")
    done = CliRunner().invoke(main, ["export", str(file), "--to", target, "--out", str(tmp_path / "out")])
    assert done.exit_code == 1
    assert "'rub': only cutjoint has friction that sticks; leave it out" in done.output.replace("\n", " ")
    assert "rub_bristle" not in done.output
