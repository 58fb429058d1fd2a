"""Structures that loops hold to second order only: refused by name, where runs would crawl, or drop what holds them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import cutjoint
from cutjoint.analysis.shaky import ShakyError, find_shakiness
from cutjoint.cli import main
from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene as compile_code
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.methods import METHODS
from cutjoint.model.read import read_model_text
from cutjoint.package.errors import RunError
from cutjoint.run.artifact import Artifact
from cutjoint.run.scenes import find_scene
from cutjoint.topology.build import build_topology
from tests.conftest import MODELS, needs_cpp
from tests.mechanisms.shaky import screws, six_axes, six_text
from tests.physics.simulation import compile_scene, compile_text, completed, simulate

REFUSING = [name for name, method in METHODS.items() if not method.supports_shaky]

#: Two bars from support to support with a hinge between them, in line or, with a HEIGHT, not; all axes parallel.
BARS = """
cutjoint: 1
name: bars
gravity: [0, 0, -9.81]
bodies:
  left: {mass: 1, centre_of_mass: [0.5, 0, 0], inertia: [0.1, 0.1, 0.1]}
  right: {mass: 1, centre_of_mass: [1.5, 0, 0], inertia: [0.1, 0.1, 0.1]}
joints:
  a: {kind: revolute, bodies: [ground, left], at: [0, 0, 0], axis: [0, 1, 0]}
  b: {kind: revolute, bodies: [left, right], at: [1, 0, HEIGHT], axis: [0, 1, 0]}
  c: {kind: revolute, bodies: [right, ground], at: [2, 0, 0], axis: [0, 1, 0]}
outputs: [left.x]
scenes:
  run: {end: 0.1, output_step: 0.01}
"""

#: Crank and rod of one length on a slider, in the pose in which all axes are in line: two motions cross there.
IN_LINE = """
cutjoint: 1
name: crossing
gravity: [0, 0, -9.81]
bodies:
  crank: {mass: 1, centre_of_mass: [0.5, 0, 0], inertia: [0.1, 0.1, 0.1]}
  rod: {mass: 1, centre_of_mass: [1.5, 0, 0], inertia: [0.1, 0.1, 0.1]}
  slider: {mass: 1, centre_of_mass: [2, 0, 0], inertia: [0.1, 0.1, 0.1]}
joints:
  a: {kind: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: [0, 1, 0]}
  b: {kind: revolute, bodies: [crank, rod], at: [1, 0, 0], axis: [0, 1, 0]}
  c: {kind: revolute, bodies: [rod, slider], at: [2, 0, 0], axis: [0, 1, 0]}
  d: {kind: prismatic, bodies: [ground, slider], at: [2, 0, 0], axis: [1, 0, 0]}
outputs: [slider.x]
scenes:
  run: {end: 0.1, output_step: 0.01}
"""


#: A bar on three cranks that a guide drives slowly; where the third has another LENGTH its loop closes in the pose of the file alone.
CRANKS = """
cutjoint: 1
name: cranks
gravity: [0, 0, -9.81]
bodies:
  one: {mass: 1, centre_of_mass: [0, 0, 0.5], inertia: [0.1, 0.1, 0.1]}
  two: {mass: 1, centre_of_mass: [1, 0, 0.5], inertia: [0.1, 0.1, 0.1]}
  three: {mass: 1, centre_of_mass: [2, 0, 0.75], inertia: [0.1, 0.1, 0.1]}
  bar: {mass: 1, centre_of_mass: [1, 0, 1], inertia: [0.1, 0.1, 0.1]}
joints:
  a: {kind: revolute, bodies: [ground, one], at: [0, 0, 0], axis: [0, 1, 0], guide: "0.02*t"}
  b: {kind: revolute, bodies: [one, bar], at: [0, 0, 1], axis: [0, 1, 0]}
  c: {kind: revolute, bodies: [ground, two], at: [1, 0, 0], axis: [0, 1, 0]}
  d: {kind: revolute, bodies: [two, bar], at: [1, 0, 1], axis: [0, 1, 0]}
  e: {kind: revolute, bodies: [ground, three], at: [2, 0, 1 - LENGTH], axis: [0, 1, 0]}
  f: {kind: revolute, bodies: [three, bar], at: [2, 0, 1], axis: [0, 1, 0]}
outputs: [bar.x, bar.z]
scenes:
  run: {end: 0.4, output_step: 0.05}
"""


def found(text: str) -> object:
    model = read_model_text(text, "model.yaml")
    return find_shakiness(formulate_recursive(build_topology(model), find_scene(model, None), ()))


@pytest.mark.parametrize("seed", range(1, 6))
def test_six_hinges_with_screws_of_rank_five(seed: int) -> None:
    """The six screws depend on each other in the pose of the file alone; off it by a thousandth they hold it to first order."""
    assert np.linalg.svd(screws(six_axes(seed)), compute_uv=False)[-1] < 1e-12
    assert found(six_text(seed)) is not None
    assert found(six_text(seed, off=1e-3)) is None


def test_bars_in_line_are_shaky_and_others_are_not() -> None:
    assert found(BARS.replace("HEIGHT", "0")) is not None
    assert found(BARS.replace("HEIGHT", "0.1")) is None
    assert found(BARS.replace("HEIGHT", "0").replace("axis: [0, 1, 0]}\n  b", "axis: [0, 1, 0], guide: t}\n  b")) is None


def test_motions_that_cross_are_motions() -> None:
    assert found(IN_LINE) is None


@pytest.mark.parametrize("model", ["four_bar", "andrews", "excavator", "press"])
def test_models_move(model: str) -> None:
    assert found((MODELS / f"{model}.yaml").read_text(encoding="utf-8")) is None


@pytest.mark.parametrize("method", REFUSING)
def test_methods_refuse_it_with_the_reason(method: str, tmp_path: Path) -> None:
    file = tmp_path / "six.yaml"
    file.write_text(six_text(), encoding="utf-8")
    done = CliRunner().invoke(main, ["simulate", str(file), "--method", method, "--out", str(tmp_path / "run.csv")])
    assert done.exit_code == 1
    said = done.output.replace("\n", " ")
    assert "six.yaml:14:3: 'j3': the loops lock this structure to second order only: in its only pose 'j4.angle_rate' has" in said
    assert "move an axis or a point, or use --method augmented" in said
    assert not (tmp_path / "run.csv").exists()


def test_check_says_it(tmp_path: Path) -> None:
    file = tmp_path / "six.yaml"
    file.write_text(six_text(), encoding="utf-8")
    done = CliRunner().invoke(main, ["check", str(file)])
    assert done.exit_code == 0
    assert "'j3': the loops lock this structure to second order only" in done.output.replace("\n", " ")


@needs_cpp
def test_augmented_holds_it(tmp_path: Path) -> None:
    """By its penalty: the middle body stays within a millimetre, where it swung away once classical had dropped an equation."""
    model = read_model_text(six_text(), "six.yaml")
    run = completed(simulate(compile_scene(model, find_scene(model, None), CompileOptions(method="augmented")), error=False))
    assert max(np.ptp(run[name]) for name in ("b2.x", "b2.y", "b2.z")) < 1e-3


def test_classical_drops_nothing_on_the_one_pose(tmp_path: Path) -> None:
    """A scene with positions is not refused beforehand; beside the pose the equations are independent."""
    text = six_text(scene=", positions: {j0.angle: 0}")
    model = read_model_text(text, "six.yaml")
    with pytest.raises(RunError, match=r"'b4': what holds it follows from what holds other elements .* which classical cannot solve"):
        compile_scene(model, find_scene(model, None), CompileOptions(method="classical"))
    with pytest.raises(ShakyError):
        compile_text(tmp_path, six_text())


@needs_cpp
@pytest.mark.parametrize("compiled", [compile_scene, compile_code])
def test_equations_that_classical_leaves_out_in_one_pose_are_watched(compiled: Callable[..., Artifact]) -> None:
    """A third crank of half the length turns twice as far, and sinks by x^2 at an angle x of the others, which sink by x^2/2.

    So it stands off the bar by 1e-5 m at x = 4.47e-3, which the guide has at 0.2236 s.
    """
    runs = []
    for length in ("0.5", "1"):
        model = read_model_text(CRANKS.replace("1 - LENGTH", str(1 - float(length))), "cranks.yaml")
        artifact = compiled(model, find_scene(model, None), CompileOptions(method="classical"))
        assert [equation.name for equation in artifact.equations.left_out] != []
        runs.append(simulate(artifact, dt=1e-3, error=False, check=False))
    torn, whole = runs
    assert torn.failure is not None
    assert torn.failure.message == (
        "equation 'three.f' (cranks.yaml:8) stands open: it was left out, since others implied it in the only pose that was known"
    )
    assert torn.failure.time == pytest.approx(0.224, abs=1.5e-3)
    assert completed(whole)["bar.x"][-1] == pytest.approx(1 + np.sin(0.02 * 0.4), abs=1e-6)


@needs_cpp
def test_folders_watch_them_too(tmp_path: Path) -> None:
    path = tmp_path / "cranks.yaml"
    path.write_text(CRANKS.replace("1 - LENGTH", "0.5"), encoding="utf-8")
    sim = cutjoint.load(path, method="classical").reset(dt=1e-3)
    with pytest.raises(cutjoint.SimulationError, match=r"at 0.224 s: .*or the equation stands open: 'three.f' \(cranks.yaml:8\)"):
        sim.advance(0.4)
