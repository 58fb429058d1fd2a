"""Functions in C++ that equal expressions: trajectories, derivatives and snapshots are theirs to rounding."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.model.functions import supply
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.package.errors import CutjointError
from cutjoint.run.failures import FailedRunError
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from cutjoint.stepping.load import load
from cutjoint.tasks.batch import simulate_batch
from tests.conftest import with_heavy

FLAGS = ("-O1",)

#: Four equal pendulums on a cart, whose laws go side by side; a state and a signal have functions too.
MODEL = """\
cutjoint: 1
name: cart
gravity: [0, 0, -9.81]
functions:
  cubic: {arguments: [x, rate], partials: true}
  sink: {arguments: [x], partials: true}
parameters:
  k: {value: 1, binding: param}
submodels:
  pendulum:
    connectors: [base]
    parameters: [x]
    bodies:
      rod: {mass: 1, centre_of_mass: [x, 0, -0.5], inertia: [0.1, 0.1, 0.1]}
      bob: {mass: 0.5, centre_of_mass: [x, 0, -1.5], inertia: [0.1, 0.1, 0.1]}
    joints:
      pivot: {kind: revolute, bodies: [base, rod], at: [x, 0, 0], axis: [0, 1, 0]}
      knee: {kind: revolute, bodies: [rod, bob], at: [x, 0, -1], axis: [0, 1, 0]}
    forces:
      spring: {kind: joint_force, joint: knee, law: "-k*cubic(position, rate)"}
bodies:
  cart: {mass: 5, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}
joints:
  slide: {kind: prismatic, bodies: [ground, cart], at: [0, 0, 0], axis: [1, 0, 0]}
forces:
  drive: {kind: joint_force, joint: slide, law: "20*pressure"}
states:
  pressure: {start: 1, rate: "sink(pressure)"}
instances:
  a: {use: pendulum, connect: {base: cart}, with: {x: -1}}
  b: {use: pendulum, connect: {base: cart}, with: {x: 0}}
  c: {use: pendulum, connect: {base: cart}, with: {x: 1}}
  d: {use: pendulum, connect: {base: cart}, with: {x: 2}}
scenes:
  run:
    end: 0.5
    output_step: 0.1
    positions: {a.knee.angle: 0.3, b.knee.angle: 0.1}
    outputs: [slide.displacement, a.knee.angle, b.knee.angle, a.spring.force, pressure.value, {twice: "2*sink(pressure)"}]
    numerics: {dt: 5 ms}
"""
CODE = """\
#include <cmath>

void cutjoint_cubic(const double* a, double* result, double* partials) {
  *result = 100 * a[0] + 2000 * a[0] * a[0] * a[0] + 3 * a[1];
  if (partials) {
    partials[0] = 100 + 6000 * a[0] * a[0];
    partials[1] = 3;
  }
}

void cutjoint_sink(const double* a, double* result, double* partials) {
  *result = -3 * std::sin(a[0]);
  if (partials) partials[0] = -3 * std::cos(a[0]);
}
"""


def supplied(tmp_path: Path, code: str = CODE) -> Model:
    path = tmp_path / "functions.cpp"
    path.write_text(code, encoding="utf-8")
    return supply(read_model_text(MODEL, "m.yaml"), path)


def written() -> Model:
    """Expressions in place of the functions."""
    lines = [line for line in MODEL.splitlines() if not line.startswith(("functions:", "  cubic:", "  sink:"))]
    text = "\n".join(lines).replace("cubic(position, rate)", "(100*position + 2000*position**3 + 3*rate)")
    return read_model_text(text.replace("sink(pressure)", "(-3*sin(pressure))"), "m.yaml")


def run(model: Model, method: str) -> Trajectory:
    return simulate(compile_scene(model, model.scenes["run"], CompileOptions(method=method, flags=FLAGS)))


@pytest.mark.parametrize("method", with_heavy(["recursive", "recursive-newton", "augmented"], "recursive-newton", "augmented"))
def test_code_moves_as_the_expression_does(method: str, tmp_path: Path) -> None:
    """Steps are the same in number; sums are rounded in another order (1e-16), and 100 steps and their iterations keep that."""
    one, other = run(supplied(tmp_path), method), run(written(), method)
    assert one.failure is None
    assert one.steps == other.steps
    for name in other:
        np.testing.assert_allclose(one[name], other[name], rtol=1e-10, atol=1e-11 * max(1.0, np.abs(other[name]).max()), err_msg=name)
    assert np.ptp(one["a.knee.angle"]) > 0.1


@pytest.mark.heavy
def test_runs_side_by_side_call_it_once_each(tmp_path: Path) -> None:
    cases = [{"k": k} for k in np.linspace(0.5, 2.0, 11)]
    one, other = (simulate_batch(model, cases) for model in (supplied(tmp_path), written()))
    for name in other.end:
        np.testing.assert_allclose(one.end[name], other.end[name], rtol=1e-10, atol=1e-10)
    assert len(set(one.end["a.knee.angle"])) == 11


@pytest.mark.heavy
def test_derivatives_and_snapshots_of_a_host(tmp_path: Path) -> None:
    """Derivatives to rounding, and steps after a snapshot to the last bit."""
    pair = [load(model, linearise=True, flags=FLAGS) for model in (supplied(tmp_path), written())]
    spaces = []
    for simulation in pair:
        simulation.reset()
        simulation.advance(0.2)
        spaces.append(simulation.linearise())
    for name in ("A", "B", "C", "D"):
        one, other = (np.asarray(getattr(space, name)) for space in spaces)
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9 * max(1.0, np.abs(other).max(initial=0.0)))
    simulation = pair[0]
    kept = simulation.snapshot()
    first = simulation.play(10).copy()
    simulation.restore(kept)
    np.testing.assert_array_equal(simulation.play(10), first)


@pytest.mark.heavy
def test_a_wrong_partial_derivative_shows(tmp_path: Path) -> None:
    """The derivatives of a host follow from those of the code, so that the comparison above can fail."""
    wrong = supplied(tmp_path, CODE.replace("6000 * a[0] * a[0]", "6100 * a[0] * a[0]"))
    spaces = []
    for model in (wrong, written()):
        simulation = load(model, linearise=True, flags=FLAGS)
        simulation.reset()
        spaces.append(simulation.linearise())
    assert np.abs(np.asarray(spaces[0].A) - np.asarray(spaces[1].A)).max() > 1e-3


def test_what_is_no_number_ends_the_run(tmp_path: Path) -> None:
    model = supplied(tmp_path, CODE.replace("-3 * std::sin(a[0])", "-20 * std::sqrt(a[0] - 0.5)"))
    with pytest.raises(FailedRunError, match=r"m\.yaml:28:3: .* worst at 'pressure\.value' with nan"):
        run(model, "recursive")


def test_code_that_does_not_compile_is_told(tmp_path: Path) -> None:
    with pytest.raises(CutjointError, match=r"functions:\d+"):
        run(supplied(tmp_path, CODE.replace("3 * a[1];", "3 * b[1];")), "recursive")


def test_a_sweep_has_the_code_of_the_command_line(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    (tmp_path / "f.cpp").write_text(CODE, encoding="utf-8")
    (tmp_path / "called.yaml").write_text(MODEL, encoding="utf-8")
    (tmp_path / "written.yaml").write_text(written().text, encoding="utf-8")
    study = "cutjoint_study: 1\nmodel: {}.yaml\nparameters: {{k: {{from: 1, to: 2}}}}\ndesign: {{sobol: 8}}\n"
    study += "objectives: {{far: {{end: a.knee.angle}}}}\nflags: -O1\n"
    found = []
    for name, more in (("called", ["--functions", str(tmp_path / "f.cpp")]), ("written", [])):
        (tmp_path / f"{name}_study.yaml").write_text(study.format(name), encoding="utf-8")
        words = ["sweep", tmp_path / f"{name}_study.yaml", "--out", tmp_path / f"{name}.parquet", *more]
        result = CliRunner().invoke(main, [str(word) for word in words])
        assert result.exit_code == 0, result.output
        found.append(parquet.read_table(tmp_path / f"{name}.parquet")["far"].to_numpy())
    assert found[0] == pytest.approx(found[1], rel=1e-12)
    assert np.ptp(found[0]) > 0
