"""Folders that stand alone: their needs, their libraries, and their C interface, which keeps the contract of its header."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from cutjoint.compile.c_export import make_standalone, plan_export
from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_model, generate
from cutjoint.model.read import read_model, read_model_text
from cutjoint.reduce.guards import guard_forces
from cutjoint.run.artifact import Artifact
from cutjoint.run.scenes import find_scene
from cutjoint.run.simulation import simulate
from tests.conftest import MODELS, needs_cpp, with_heavy
from tests.fmu.slaves import text_of
from tests.mechanisms.driven import DRIVEN
from tests.reduce.test_guards import TEXT as HAMMER

from .c_exports import (
    ALONE,
    CXX,
    DEFINITIONS,
    HERE,
    LIBRARIES,
    RANDOM_CALLS,
    C,
    compile_object,
    folder_of,
    foreign_symbols,
    link,
    run,
    standalone_of,
    write,
)

pytestmark = needs_cpp

#: Models, their scenes and methods; those of the vehicle take long to compile.
VEHICLE = [("iltis", "simul1", method) for method in ALONE]
FOLDERS = with_heavy([*(("press", None, method) for method in ALONE), *VEHICLE], *VEHICLE)


@pytest.fixture(scope="module")
def press(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the press with its object file."""
    place = write(standalone_of("press"), tmp_path_factory.mktemp("press"))
    compile_object(place, "press")
    return place


def test_files_include_the_standard_library_alone(press: Path) -> None:
    texts = [path.read_text(encoding="utf-8") for path in press.glob("*.[ch]*")]
    included = {name for text in texts for name in re.findall(r"#include ([<\"][^>\"]+)", text)}
    assert '"press.h' in included
    assert not [name for name in included if "/" in name or "Eigen" in name or (name[0] == '"' and name != '"press.h')]


def test_a_shared_library_shows_the_interface_alone(press: Path) -> None:
    """GCC shares tables of inline functions and templates between libraries, though they are another model's: those that it may see."""
    made = press / "libpress.so"
    subprocess.run(["g++", *CXX, "-O0", "-fPIC", "-shared", "press.cpp", "-o", made, *LIBRARIES], cwd=press, check=True)
    listed = subprocess.run(["nm", "-DC", "--defined-only", made], check=True, capture_output=True, text=True).stdout
    shown = [line.split(maxsplit=2)[2] for line in listed.splitlines()]
    header = (press / "press.h").read_text(encoding="utf-8")
    declared = set(re.findall(r"^[a-z].*?\b(press_\w+)\(", header, re.MULTILINE))
    assert {name for name in shown if name.startswith("press_")} >= declared - {"press_create"}
    assert not [name for name in shown if name.startswith(("press_code", "cutjoint"))]


@pytest.mark.parametrize(("name", "scene", "method"), FOLDERS)
@pytest.mark.parametrize("compiler", ["g++", "clang++"])
def test_the_code_calls_mathematics_and_nothing_else(
    compiler: str, name: str, scene: str | None, method: str, tmp_path: Path
) -> None:
    made = compile_object(write(standalone_of(name, scene, method=method), tmp_path), name, compiler=compiler, flags=("-O1",))
    assert not foreign_symbols(made, name)


def test_vectors_that_a_processor_lacks_bring_no_warnings(tmp_path: Path) -> None:
    """Four wheels side by side are vectors of 256 bits, arguments for which clang has no registers by default."""
    compile_object(write(standalone_of("iltis", "simul1"), tmp_path), "iltis", compiler="clang++", flags=("-O0",))


def test_a_folder_goes_without_vector_mathematics(tmp_path: Path) -> None:
    place, tables = write(folder_of(text_of("axle"), "axle.yaml", "chirp"), tmp_path), []
    for flags, libraries in (((), ("-lmvec",)), (("-DCUTJOINT_WITHOUT_LIBMVEC",), ())):
        made = compile_object(place, "axle", flags=flags)
        called = subprocess.run(["nm", "-u", made], check=True, capture_output=True, text=True).stdout
        assert ("_ZGV" in called) == bool(libraries)
        subprocess.run(["gcc", *C, "axle_simulator.c", "axle.o", "-lm", *libraries, "-o", "simulator"], cwd=place, check=True)
        tables.append(np.genfromtxt(run(place / "simulator", "axle.run").splitlines(), delimiter=",", skip_header=1))
    assert tables[0] == pytest.approx(tables[1], rel=1e-7, abs=1e-7)  # a few units in the last place at each step


@pytest.mark.parametrize("method", ALONE)
def test_calls_right_and_wrong(method: str, tmp_path: Path) -> None:
    place = write(standalone_of("press", method=method), tmp_path)
    compile_object(place, "press")
    program = link(place, "calls", ["-I.", HERE / "calls.c", "press.o"], flags=DEFINITIONS[method])
    assert run(program) == ""


@pytest.mark.parametrize("method", ALONE)
def test_random_calls_under_sanitizers(method: str, tmp_path: Path) -> None:
    place = write(standalone_of("press", method=method), tmp_path)
    sanitize = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    compile_object(place, "press", flags=sanitize)
    program = link(place, "random", ["-I.", HERE / "random_calls.c", "press.o"], flags=(*sanitize, *DEFINITIONS[method]))
    good, _, calls, _ = run(program, str(RANDOM_CALLS)).split()
    assert int(calls) == RANDOM_CALLS
    assert RANDOM_CALLS / 4 < int(good) < RANDOM_CALLS


def test_two_models_in_one_program(press: Path, tmp_path: Path) -> None:
    write(standalone_of("four_bar"), tmp_path)
    compile_object(tmp_path, "four_bar")
    (tmp_path / "both.c").write_text(
        '#include "press.h"\n#include "four_bar.h"\n'
        "static double one[PRESS_SIZE / sizeof(double)], other[FOUR_BAR_SIZE / sizeof(double)];\n"
        "int main(void) {\n  press_sim* a = press_create(one, sizeof one);\n  four_bar_sim* b = four_bar_create(other, sizeof other);\n"
        "  return press_start(a) || four_bar_start(b) || press_run(a, 10, 0) || four_bar_run(b, 10, 0);\n}\n"
    )
    run(link(tmp_path, "both", ["-I.", f"-I{press}", "both.c", "four_bar.o", press / "press.o"]))


@pytest.mark.parametrize(
    ("name", "scene", "method"),
    [*FOLDERS, ("four_bar", None, "augmented"), ("andrews", None, "recursive-newton"), ("flyball", None, "recursive-newton")],
)
def test_its_table_is_that_of_the_command_line_bit_by_bit(name: str, scene: str | None, method: str, tmp_path: Path) -> None:
    check_table(compile_model(MODELS / f"{name}.yaml", scene=scene, method=method, out=tmp_path), tmp_path)


def test_other_number_types_leave_the_source_of_a_simulator(tmp_path: Path) -> None:
    """Nothing of that is compiled here: tests of number types do."""
    model = read_model(MODELS / "four_bar.yaml")
    generated = generate(model, find_scene(model, None), (), precision="quad")
    delivery = plan_export(generated, CompileOptions(precision="quad", out=tmp_path))
    assert delivery is not None
    assert delivery.standalone is None
    assert {"CMakeLists.txt", "report.cpp", "four_bar.hpp", "main.cpp"} <= {*delivery.files}
    assert delivery.program == "simulator"


@pytest.mark.heavy
@pytest.mark.parametrize("method", ALONE)
def test_so_it_is_where_products_and_sums_are_joined(method: str, tmp_path: Path) -> None:
    """A compiler joins them without regard to what it knows of sizes."""
    flags = ("-O3", "-march=native")
    check_table(compile_model(MODELS / "andrews.yaml", method=method, out=tmp_path, flags=flags), tmp_path)


def check_table(artifact: Artifact, folder: Path) -> None:
    """Check that a simulator's table is that of the command line, number by number."""
    name, scene = artifact.source.stem, artifact.scene
    fits = scene.numerics.of_method(artifact.method).step <= scene.output_step  # else rows of the command line lie where its steps end
    (folder / "same.run").write_text((folder / f"{name}.run").read_text() + ("" if fits else f"step {scene.output_step!r}\n"))
    table = run(folder / f"{name}_simulator", "same.run").splitlines()
    rows = np.array([[float(x) for x in line.split(",")] for line in table[1:]])
    known = simulate(artifact, integrator="trapezoidal", events="crossed", error=False, dt=None if fits else scene.output_step)
    assert table[0].split(",") == ["t", *known.columns]
    assert np.array_equal(rows[:, 0], known.t)
    for i, column in enumerate(known.columns, start=1):
        assert np.array_equal(rows[:, i], known[column]), column


@pytest.mark.parametrize("method", ALONE)
def test_a_force_that_was_left_out_and_would_act_ends_the_motion(method: str, tmp_path: Path) -> None:
    model = read_model_text(HAMMER, "hammer.yaml")
    reduced = guard_forces(model, model.scenes["swing"], ("floor",))
    generated = generate(reduced.model, reduced.scene, reduced.scene.outputs, method=method)
    write(make_standalone(generated, equal_steps=True), tmp_path)
    compile_object(tmp_path, "hammer")
    (tmp_path / "high.run").write_text("end 0.7\nparameter depth 0.1\n")
    program = link(tmp_path, "hammer_simulator", ["hammer_simulator.c", "hammer.o"])
    assert run(program).count("\n") > 50
    done = subprocess.run([program, "high.run"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1
    said = r"a guard is violated: the force would act, or the equation stands open"
    words = rf"at 0\.\d+ s: {said}: 'floor' \(hammer.yaml:\d+\); use the full model\n"
    assert re.fullmatch(words, done.stderr)


@pytest.mark.parametrize("name", ["test", "install", "math", "string", "press_sim", "main", "linux", "errno", "new"])
def test_any_name_will_do(name: str, tmp_path: Path) -> None:
    text = (MODELS / "press.yaml").read_text(encoding="utf-8").replace("name: press", f"name: {name}")
    place = write(folder_of(text, "press.yaml"), tmp_path)
    build = ["-G", "Ninja", "-DCMAKE_BUILD_TYPE=Debug", f"-D{name}_FLAGS=-O0"]
    for command in (["cmake", "-S", ".", "-B", "out", *build], ["cmake", "--build", "out"]):
        done = subprocess.run(command, cwd=place, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
    assert run(place / "out" / f"{name}_simulator").count("\n") == 202


def test_a_run_file_changes_the_run(press: Path) -> None:
    program = link(press, "press_simulator", ["press_simulator.c", "press.o"])
    (press / "other.run").write_text("end 0.02 # s\nparameter stiffness 4000\nspeed pin.angle_rate 5\n")
    known = simulate(compile_model(MODELS / "press.yaml"), error=False, end=0.02, parameters={"stiffness": 4000})
    rows = [[float(x) for x in line.split(",")] for line in run(program, "other.run").splitlines()[1:]]
    assert rows[0][3] == pytest.approx(known["slider.vx"][0] / 2, rel=1e-9)
    (press / "wrong.run").write_text("end 1\nparameter stifness 3\n")
    done = subprocess.run([program, "wrong.run"], cwd=press, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (1, "wrong.run:2: an index is out of range: parameter stifness 3\n")
    for line in ("iterations nan", "iterations 2.5", "iterations 1e12", "end nan", "end inf", "end -1", "output_step inf", "step nan"):
        (press / "wrong.run").write_text(f"{line}\n")
        done = subprocess.run([program, "wrong.run"], cwd=press, capture_output=True, text=True, timeout=20)
        assert (done.returncode, done.stdout) == (1, "")
        assert re.fullmatch(rf"wrong\.run:1: [a-z].*: {re.escape(line)}\n", done.stderr)


def test_a_project_takes_it_in_both_ways(tmp_path: Path) -> None:
    write(standalone_of("press"), tmp_path / "press")
    write(standalone_of("four_bar"), tmp_path / "four_bar")
    (tmp_path / "main.c").write_text(
        '#include "press.h"\n#include "four_bar.h"\nint main(void) { return !press_status_text(0) || !four_bar_status_text(0); }\n'
    )
    build = ["-G", "Ninja", "-DCMAKE_BUILD_TYPE=Debug", "-Dpress_FLAGS=-O0", "-Dfour_bar_FLAGS=-O0"]
    project = "cmake_minimum_required(VERSION 3.20)\nproject(host LANGUAGES C CXX)\n"
    added = f"{project}add_subdirectory(press)\nadd_subdirectory(four_bar)\n"
    linked = "add_executable(host main.c)\ntarget_link_libraries(host press::press four_bar::four_bar)\n"
    (tmp_path / "CMakeLists.txt").write_text(added + linked + "install(TARGETS host)\n")
    install = ["cmake", "--install", "out", "--prefix", "place"]
    for command in (["cmake", "-S", ".", "-B", "out", *build], ["cmake", "--build", "out"], install, ["out/host"]):
        subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    found = f"{project}find_package(press REQUIRED)\nfind_package(four_bar REQUIRED)\n"
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "CMakeLists.txt").write_text(found + linked.replace("main.c", "../main.c"))
    configure = ["cmake", "-S", "other", "-B", "second", *build, f"-DCMAKE_PREFIX_PATH={tmp_path}/place"]
    for command in (configure, ["cmake", "--build", "second"], ["second/host"]):
        subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)


def test_the_example_steers_what_moves_no_guide(tmp_path: Path) -> None:
    """From the middle on it holds an input: what the model then does is not the scene's any more."""
    place = write(folder_of(DRIVEN, "driven.yaml", "lawful"), tmp_path)
    compile_object(place, "driven")
    text = (place / "example.c").read_text()
    assert "/* 'push' is constant from now on */" in text
    steering = run(link(place, "example", ["-I.", "example.c", "driven.o"])).splitlines()
    (place / "plain.c").write_text("\n".join(line for line in text.splitlines() if "set_input" not in line))
    plain = run(link(place, "plain", ["-I.", "plain.c", "driven.o"])).splitlines()
    assert len(steering) == 11
    assert steering[:5] == plain[:5]
    assert steering[5] != plain[5]
