"""Functions in C++ that equal expressions: trajectories, derivatives and snapshots are theirs to rounding."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path

import numpy as np
import pytest
import sympy
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.emit.source import code_file
from cutjoint.model.expressions.functions import supply
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

#: Templates over the number type that do as much.
TEMPLATES = """\
#include <cmath>

template <class Real>
void cutjoint_cubic(const Real* a, Real* result) {
  *result = 100 * a[0] + 2000 * a[0] * a[0] * a[0] + 3 * a[1];
}

template <typename Number>
void cutjoint_sink(const Number* a, Number* result) {
  using std::sin;
  *result = -3 * sin(a[0]);
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


def test_templates_move_as_the_expression_does(tmp_path: Path) -> None:
    """By their derivatives the iteration of Newton's method takes as many steps."""
    one, other = run(supplied(tmp_path, TEMPLATES), "recursive-newton"), run(written(), "recursive-newton")
    assert one.failure is None
    assert one.evaluations == other.evaluations
    np.testing.assert_allclose(one["a.knee.angle"], other["a.knee.angle"], rtol=1e-10, atol=1e-11)


#: Ten arguments, more than directions go side by side; all functions of numbers with derivatives; a memory is no argument.
FIRST = "sin(a)*cos(b) + tan(c)/(2 + d) - asin(e)*acos(f) + atan(g)*sinh(h) - cosh(i)*tanh(j)"
SECOND = "exp(a)*log(2 + b) + sqrt(1 + c*c) + atan2(d, e) + pow(1 + f, g) + abs(h) - (i > j ? i : 2*j)"
LETTERS = "abcdefghij"
WIDE = f"""
cutjoint: 1
name: wide
gravity: [0, 0, 0]
functions:
  wide: {{arguments: [{", ".join(LETTERS)}], results: [first, second], partials: true, memory: 8}}
bodies: {{block: {{mass: 1, centre_of_mass: [0, 0, 0]}}}}
joints: {{slide: {{kind: prismatic, bodies: [ground, block], at: [0, 0, 0], axis: [1, 0, 0]}}}}
scenes: {{run: {{end: 1}}}}
"""
WIDE_CODE = f"""
#include <cmath>
template <class Real>
void cutjoint_wide(const Real* x, const void* memory, Real* results) {{
  using namespace std;
  const Real {", ".join(f"{name} = x[{k}]" for k, name in enumerate(LETTERS))};
  results[0] = {FIRST} + *static_cast<const double*>(memory);
  results[1] = {SECOND};
}}
extern "C" void cutjoint_wide_update(const double*, const void*, void*) {{}}
"""


def test_partial_derivatives_of_a_template_are_those_of_sympy(tmp_path: Path) -> None:
    path = tmp_path / "wide.cpp"
    path.write_text(WIDE_CODE, encoding="utf-8")
    files = code_file(supply(read_model_text(WIDE, "wide.yaml"), path))
    (tmp_path / "supplied.cpp").write_text(files["supplied.cpp"], encoding="utf-8")
    flags = ["-std=c++20", "-Wall", "-Wextra", "-Werror", "-Wno-psabi", "-O1", "-shared", "-fPIC"]
    subprocess.run(["g++", *flags, "supplied.cpp", "-o", "wide.so"], cwd=tmp_path, check=True)
    call = ctypes.CDLL(str(tmp_path / "wide.so")).cutjoint_wide
    x, memory = np.array([0.3, -0.4, 0.5, 0.7, -0.2, 0.6, 1.2, -0.8, 0.9, 0.1]), np.array([4.0])
    results, partials = np.zeros(2), np.zeros((2, 10))
    call(*(array.ctypes.data_as(ctypes.c_void_p) for array in (x, memory, results, partials)))
    symbols = sympy.symbols(" ".join(LETTERS), real=True)
    known = [sympy.sympify(text, {**dict(zip(LETTERS, symbols, strict=True)), "abs": sympy.Abs, "pow": sympy.Pow})
             for text in (f"{FIRST} + 4", SECOND.replace("(i > j ? i : 2*j)", "i"))]  # fmt: skip
    at = dict(zip(symbols, x, strict=True))
    assert results == pytest.approx([float(value.subs(at)) for value in known], rel=1e-14)
    for row, value in zip(partials, known, strict=True):
        assert row == pytest.approx([float(value.diff(symbol).subs(at)) for symbol in symbols], rel=1e-13, abs=1e-13)
    call(*(array.ctypes.data_as(ctypes.c_void_p) for array in (x, memory, results)), None)


@pytest.mark.heavy
def test_runs_side_by_side_call_it_once_each(tmp_path: Path) -> None:
    cases = [{"k": k} for k in np.linspace(0.5, 2.0, 11)]
    one, other = (simulate_batch(model, cases) for model in (supplied(tmp_path), written()))
    for name in other.end:
        np.testing.assert_allclose(one.end[name], other.end[name], rtol=1e-10, atol=1e-10)
    assert len(set(one.end["a.knee.angle"])) == 11


@pytest.mark.heavy
@pytest.mark.parametrize("code", [CODE, TEMPLATES], ids=["plain", "templates"])
def test_derivatives_and_snapshots_of_a_host(code: str, tmp_path: Path) -> None:
    """Derivatives to rounding, and steps after a snapshot to the last bit."""
    pair = [load(model, linearise=True, flags=FLAGS) for model in (supplied(tmp_path, code), written())]
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
    first = simulation.run(10).copy()
    simulation.restore(kept)
    np.testing.assert_array_equal(simulation.run(10), first)


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


def test_code_that_does_not_compile_is_reported(tmp_path: Path) -> None:
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
