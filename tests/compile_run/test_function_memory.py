"""Functions with several results and with a memory: motions by hand, results side by side, states that hosts save."""

from __future__ import annotations

import copy
import pickle
import subprocess
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_model, compile_scene, generate
from cutjoint.export.fmu.archive import Fmu, make_fmu
from cutjoint.model.errors import ModelError
from cutjoint.model.expressions.functions import leave_to_host, supply
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.package.errors import RunError
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from cutjoint.stepping.load import load
from cutjoint.tasks.batch import simulate_batch
from cutjoint.toolchain.compiler import find_compiler
from tests.conftest import with_heavy
from tests.fmu.slaves import OK, Slave

FLAGS = ("-O1",)

#: Two blocks with springs that soften by what each has gone through; what a spring keeps has bits of all kinds.
MODEL = """\
cutjoint: 1
name: worn
gravity: [0, 0, -9.81]
parameters:
  k: {value: 100, unit: N/m, binding: param}
functions:
  wear: {arguments: {stiffness: N/m, x: m, v: m/s}, results: {force: N, loss: W}, partials: true, memory: 27}
submodels:
  worn:
    connectors: [base]
    parameters: [y]
    bodies:
      block: {mass: 2, centre_of_mass: [0, y, 0], inertia: [1, 1, 1]}
    joints:
      slide: {kind: prismatic, bodies: [base, block], at: [0, y, 0], axis: [1, 0, 0]}
    forces:
      spring: {kind: joint_force, joint: slide, law: "-wear.force(k, position, rate, keeper.kept)"}
    states:
      heat: {start: 0 J, rate: "wear.loss(k, slide.displacement, slide.displacement_rate, keeper.kept)"}
    controllers:
      keeper:
        every: 10 ms
        memory: {kept: {function: wear, arguments: [k, slide.displacement, slide.displacement_rate]}}
bodies:
  cart: {mass: 5, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}
joints:
  rail: {kind: prismatic, bodies: [ground, cart], at: [0, 0, 0], axis: [1, 0, 0], guide: 0.02*sin(20*t)}
instances:
  a: {use: worn, connect: {base: cart}, with: {y: -1}}
  b: {use: worn, connect: {base: cart}, with: {y: 1}}
scenes:
  run:
    end: 0.5
    output_step: 0.02
    positions: {a.slide.displacement: 0.1, b.slide.displacement: -0.3}
    outputs: [a.slide.displacement, b.slide.displacement, a.heat.value, b.heat.value, {soft: "wear.force(1, 1, 0, a.keeper.kept)"}]
    numerics: {dt: 5 ms, solver_tolerance: 1e-14}
"""
CODE = """\
#include <cmath>
#include <cstring>

namespace {
struct Kept { double most; unsigned bits; float half; short count; char text[9]; };
constexpr unsigned size = 27;
}

void cutjoint_wear(const double* a, const void* memory, double* results, double* partials) {
  Kept kept;
  std::memcpy(&kept, memory, size);
  const double soft = 1 + 5 * kept.most;
  results[0] = a[0] * a[1] / soft + 3 * a[2];
  results[1] = 3 * a[2] * a[2];
  if (partials) {
    const double slopes[] = {a[1] / soft, a[0] / soft, 3, 0, 0, 6 * a[2]};
    std::memcpy(partials, slopes, sizeof slopes);
  }
}

void cutjoint_wear_update(const double* a, const void* memory, void* next) {
  Kept kept;
  std::memcpy(&kept, memory, size);
  kept.most = std::fmax(kept.most, std::abs(a[1]));
  if (kept.bits != 0xfff00001u * kept.count || kept.half != 0.5f * kept.count) kept.most = NAN;  // what it kept has changed
  kept.count += 1;
  kept.bits = 0xfff00001u * kept.count;
  kept.half = 0.5f * kept.count;
  std::memcpy(next, &kept, size);
}
"""


def worn() -> Model:
    return replace(read_model_text(MODEL, "m.yaml"), code=CODE)


def written() -> Model:
    """A memory of numbers and expressions in place of the function."""
    text = "\n".join(line for line in MODEL.splitlines() if not line.startswith(("functions:", "  wear:")))
    text = text.replace("wear.force(k, position, rate, keeper.kept)", "(k*position/(1 + 5*keeper.kept) + 3*rate)")
    text = text.replace("wear.loss(k, slide.displacement, slide.displacement_rate, keeper.kept)", "3*slide.displacement_rate**2")
    text = text.replace("wear.force(1, 1, 0, a.keeper.kept)", "1/(1 + 5*a.keeper.kept)")
    kept = "{kept: {start: 0, next: 'max(kept, abs(slide.displacement))'}}"
    return read_model_text(
        text.replace("{kept: {function: wear, arguments: [k, slide.displacement, slide.displacement_rate]}}", kept), "m.yaml"
    )  # fmt: skip


def run(model: Model, method: str) -> Trajectory:
    return simulate(compile_scene(model, model.scenes["run"], CompileOptions(method=method, flags=FLAGS)))


@pytest.mark.parametrize("method", with_heavy(["recursive", "recursive-newton", "augmented"], "recursive-newton", "augmented"))
def test_a_memory_moves_as_numbers_that_a_controller_keeps(method: str) -> None:
    """Steps and samples are the same; sums are rounded in another order, and 100 steps keep that."""
    one, other = run(worn(), method), run(written(), method)
    assert one.failure is None
    assert one.steps == other.steps
    for name in other:
        np.testing.assert_allclose(one[name], other[name], rtol=1e-12, atol=1e-12, err_msg=name)
    assert one["soft"][0] == pytest.approx(1 / 1.5)  # 0.1 m at the first sample
    assert one["soft"][-1] < 0.63  # and 0.124 m later
    assert (one["a.heat.value"][1:] > 0).all()


def test_a_call_has_all_results_at_once() -> None:
    """Of both blocks together: value and power by one call each, and so their derivatives."""
    model = worn()
    scene = model.scenes["run"]
    code = generate(model, scene, scene.outputs, method="recursive-newton").source.files
    assert code["system_dynamic_residual.cpp"].count("supplied_results<") == 1
    assert code["system_linearise.cpp"].count("supplied_results<") <= 1
    assert code["system_linearise.cpp"].count("supplied_partials<") == 1
    assert code["system_sample.cpp"].count("updated_memory<") == 2  # one for each block


@pytest.mark.heavy
def test_a_simulation_that_a_host_holds_goes_on_bit_by_bit() -> None:
    """Between two samples, by a snapshot, a copy and a pickle."""
    simulation = load(worn(), flags=FLAGS)
    simulation.reset()
    simulation.advance(0.123)
    kept, copied, text = simulation.snapshot(), copy.deepcopy(simulation), pickle.dumps(simulation)
    simulation.advance(0.4)
    known = simulation.outputs.array.copy()
    assert known[-1] < 0.63
    for other in (copied, pickle.loads(text)):
        other.advance(0.4)
        np.testing.assert_array_equal(other.outputs.array, known)
    simulation.restore(kept)
    simulation.advance(0.4)
    np.testing.assert_array_equal(simulation.outputs.array, known)


@pytest.mark.heavy
def test_derivatives_of_a_host() -> None:
    """The derivatives are those of the expressions in place of the function: what is held counts as constant."""
    spaces = []
    for model in (worn(), written()):
        simulation = load(model, linearise=True, flags=FLAGS)
        simulation.reset()
        simulation.advance(0.2)
        spaces.append(simulation.linearise())
    for name in ("A", "B", "C", "D"):
        one, other = (np.asarray(getattr(space, name)) for space in spaces)
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9 * max(1.0, np.abs(other).max(initial=0.0)))


@pytest.mark.heavy
def test_batches_have_the_runs_of_the_command_line() -> None:
    cases = [{"k": k} for k in (60.0, 100.0, 170.0)]
    batch = simulate_batch(worn(), cases)
    single = [simulate(compile_scene(worn(), worn().scenes["run"], CompileOptions()), parameters=case) for case in cases]
    for name in batch.end:
        np.testing.assert_allclose(batch.end[name], [each[name][-1] for each in single], rtol=1e-12, atol=1e-14)
    assert np.ptp(batch.end["a.slide.displacement"]) > 1e-3


@cache
def exported() -> Fmu:
    model = worn()
    return make_fmu(model, model.scenes["run"], version=3, kind="cs", integrator="trapezoidal")


def test_an_fmu_keeps_a_step_by_one_file_beside_that_of_functions() -> None:
    sources = exported().sources
    assert "supplied.cpp" in sources
    assert [name for name, text in sources.items() if "worn_sim::keep(" in text] == ["worn.cpp"]


@pytest.mark.heavy
def test_a_saved_state_of_an_fmu_has_the_memory_bit_by_bit() -> None:
    slave, other = Slave(exported()), Slave(exported())
    assert slave.initialise() == OK, slave.log
    rows, state = [], None
    for i in range(30):
        rows.append(slave.get())
        if i == 7:
            state = slave.save()
        assert slave.step(i * 7.5e-3, 7.5e-3) == OK, slave.log
    status, restored = other.deserialise(slave.serialise(state))
    assert status == OK
    for instance, own in ((slave, state), (other, restored)):
        assert instance.restore(own) == OK
        for i in range(7, 30):
            assert instance.get() == rows[i]
            assert instance.step(i * 7.5e-3, 7.5e-3) == OK


def test_explanations_have_a_memory_as_one_argument(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(MODEL, encoding="utf-8")
    result = CliRunner().invoke(main, ["explain", str(tmp_path / "m.yaml"), "--out", str(tmp_path / "m.md")])
    assert result.exit_code == 0, result.output
    lines = (tmp_path / "m.md").read_text(encoding="utf-8").splitlines()
    (update,) = [line for line in lines if "leftarrow" in line and "a keeper kept" in line]
    assert update.count("a keeper kept") == 2
    assert r"\text{ wear update }" in update


@pytest.mark.parametrize("command", ["modes", "equilibrium", "view"])
def test_commands_that_interpret_refuse_functions_by_name(command: str, tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(MODEL, encoding="utf-8")
    more = ["--out", str(tmp_path / "m.html")] if command == "view" else []
    result = CliRunner().invoke(main, [command, str(tmp_path / "m.yaml"), *more])
    assert result.exit_code == 1
    assert "m.yaml:7:3: function 'wear': only generated code calls functions of the user" in result.output.replace("\n", " ")


def test_code_without_the_update_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "f.cpp"
    path.write_text(CODE.replace("cutjoint_wear_update", "update"), encoding="utf-8")
    with pytest.raises(ModelError, match=r"m\.yaml:7:3: function 'wear': .*f\.cpp has no cutjoint_wear_update; write extern \"C\" void"):
        supply(read_model_text(MODEL, "m.yaml"), path)


def soften(a: np.ndarray, memory: np.ndarray, results: np.ndarray, partials: np.ndarray | None) -> None:
    """The function of Python; its memory begins with the largest displacement."""
    soft = 1 + 5 * memory[:8].view(float)[0]
    results[:] = a[0] * a[1] / soft + 3 * a[2], 3 * a[2] ** 2
    if partials is not None:
        partials[:] = [[a[1] / soft, a[0] / soft, 3], [0, 0, 6 * a[2]]]


def keep_most(a: np.ndarray, memory: np.ndarray, following: np.ndarray, _: None) -> None:
    following[:8].view(float)[0] = max(memory[:8].view(float)[0], abs(a[1]))


def declared() -> Model:
    return read_model_text(MODEL, "m.yaml")


@pytest.mark.heavy
@pytest.mark.parametrize("method", ["recursive", "recursive-newton"])
def test_python_has_the_code(method: str) -> None:
    """Steps are those of the code in C++, to rounding; a copy and a snapshot go on bit by bit."""
    known = load(worn(), method=method, flags=FLAGS).reset()
    found = load(declared(), method=method, flags=FLAGS, functions={"wear": soften, "wear_update": keep_most}).reset()
    for each in (known, found):
        each.advance(0.2)
    copied, kept = found.copy(), found.snapshot()
    for each in (known, found, copied):
        each.advance(0.4)
    np.testing.assert_allclose(found.outputs.array, known.outputs.array, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(copied.outputs.array, found.outputs.array)
    found.restore(kept)
    found.advance(0.4)
    np.testing.assert_array_equal(copied.outputs.array, found.outputs.array)


@pytest.mark.heavy
def test_what_python_raises_comes_out_of_the_step() -> None:
    def fail(*arguments: object) -> None:
        raise ZeroDivisionError("at last")

    with pytest.raises(ZeroDivisionError, match="at last"):
        load(declared(), flags=FLAGS, functions={"wear": fail, "wear_update": keep_most}).reset()


def test_functions_of_python_are_those_that_the_model_declares() -> None:
    with pytest.raises(RunError, match="functions: the model has wear, wear_update, not wear; give a callable for each name"):
        load(declared(), functions={"wear": soften})
    plain = "cutjoint: 1\nname: none\ngravity: [0, 0, 0]\nbodies: {a: {mass: 1, centre_of_mass: [0, 0, 0]}}\n"
    text = plain + "joints: {s: {kind: prismatic, bodies: [ground, a], at: [0, 0, 0], axis: x}}\nscenes: {run: {end: 1}}\n"
    with pytest.raises(ModelError, match="it declares no functions, and a host is to have their code"):
        load(read_model_text(text, "m.yaml"), functions={"wear": soften})


def test_one_place_has_the_code(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(MODEL, encoding="utf-8")
    (tmp_path / "f.cpp").write_text(CODE, encoding="utf-8")
    words = ["compile", tmp_path / "m.yaml", "--out", tmp_path / "out", "--host-functions", "--functions", tmp_path / "f.cpp"]
    result = CliRunner().invoke(main, [str(word) for word in words])
    assert result.exit_code == 2
    assert "--functions and --host-functions exclude each other: the code is compiled in or left to the host" in result.output


#: Three simulations of one folder, each with functions and data of its own, and one whose functions are missing.
HOST = """\
#include <stdio.h>
#include <string.h>
#include "worn.h"

static void wear(void* host, const double* a, const void* memory, void* results, double* partials) {
  double most, *found = results;
  memcpy(&most, memory, sizeof most);
  found[0] = *(double*)host * a[0] * a[1] / (1 + 5 * most) + 3 * a[2];
  found[1] = 3 * a[2] * a[2];
  (void)partials;
}

static void keep(void* host, const double* a, const void* memory, void* next, double* partials) {
  double most, now = a[1] < 0 ? -a[1] : a[1];
  memcpy(&most, memory, sizeof most);
  if (now > most) memcpy(next, &now, sizeof now);
  (void)host, (void)partials;
}

int main(void) {
  static double memory[3][WORN_SIZE / sizeof(double)];
  worn_sim* sims[3];
  double share[3] = {1.0, 2.0, 1.0};
  for (int i = 0; i < 3; ++i) {
    sims[i] = worn_create(memory[i], sizeof memory[i]);
    worn_set_function(sims[i], worn_find_function("wear_update"), keep, 0);
  }
  if (worn_start(sims[0]) != WORN_NO_FUNCTION || worn_set_function(sims[0], 2, keep, 0) != WORN_NO_SUCH_INDEX) return 1;
  if (worn_set_function(sims[0], 0, 0, 0) != WORN_NO_FUNCTION || worn_set_function(0, 0, wear, 0) != WORN_NO_SIMULATION) return 2;
  for (int i = 0; i < 3; ++i) {
    worn_set_function(sims[i], WORN_FUNCTION_wear, wear, &share[i]);
    if (worn_start(sims[i])) return 3;
  }
  for (int k = 1; k <= 80; ++k)
    for (int i = 0; i < 3; ++i)
      if (worn_advance(sims[i], k * 5e-3)) return 4;
  for (int i = 0; i < 3; ++i) printf("%.17g %.17g\\n", worn_outputs(sims[i])[0], worn_outputs(sims[i])[2]);
  puts(worn_status_text(WORN_NO_FUNCTION));
  return 0;
}
"""


@pytest.mark.heavy
def test_a_host_in_c_gives_each_simulation_its_functions(tmp_path: Path) -> None:
    """One of twice the stiffness: of the code in C++ with another parameter."""
    compile_model(leave_to_host(declared()), scene="run", out=tmp_path / "worn", flags=FLAGS)
    (tmp_path / "host.c").write_text(HOST, encoding="utf-8")
    folder, compiler = tmp_path / "worn", find_compiler().command
    for source, options in ((folder / "worn.cpp", ["-std=c++20"]), (folder / "supplied.cpp", []), (tmp_path / "host.c", ["-x", "c"])):
        words = [*compiler, "-O1", *options, "-Wall", "-Wextra", "-Werror", f"-I{folder}", "-c", source, "-o", f"{source}.o"]
        subprocess.run([str(word) for word in words], check=True)
    objects = [f"{source}.o" for source in (folder / "worn.cpp", folder / "supplied.cpp", tmp_path / "host.c")]
    subprocess.run([*compiler, *objects, "-lm", "-o", str(tmp_path / "host")], check=True)
    *rows, text = subprocess.run([tmp_path / "host"], check=True, capture_output=True, text=True).stdout.splitlines()
    one, two, three = ([float(x) for x in row.split()] for row in rows)
    assert text == "a function of the host is missing"
    assert one == three != two
    for found, k in ((one, 100.0), (two, 200.0)):
        known = load(worn(), flags=FLAGS)
        known.parameters["k"] = k
        known.reset().advance(0.4)
        assert found == pytest.approx([known.outputs.array[0], known.outputs.array[2]], rel=1e-11)
