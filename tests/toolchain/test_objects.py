"""Only what changed is compiled again."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path
from shutil import which

import pytest

from cutjoint.compile.c_export import make_standalone
from cutjoint.compile.pipeline import generate
from cutjoint.emit.source import Source
from cutjoint.model.read import read_model
from cutjoint.toolchain.build import FLAGS, build
from cutjoint.toolchain.cache import cache_folder, is_sound
from cutjoint.toolchain.compiler import find_compiler
from cutjoint.toolchain.drivers import Kind, driver_parts
from cutjoint.toolchain.objects import Object, find_objects
from tests.conftest import MODELS, ROOT, needs_cpp
from tests.toolchain.damage import DAMAGE

#: Edits of the Iltis' file by name, with those of its generated files that may be compiled again for `recursive`.
EDITS: Mapping[str, tuple[str, str, set[str]]] = {
    "an output": ("outputs: [chassis.x,", "outputs: [chassis.wx, front_left.carrier.vz, chassis.x,", {"report.cpp", "description.cpp"}),
    "a law of an input": (
        "    road:\n      contact: disc\n", '    inputs: {rack_displacement: "0.001*sin(2*pi*t)"}\n    road:\n      contact: disc\n',
        {"scene_inputs.cpp", "unity/start.cpp"},
    ),
    "a road": ("{ramp: 10, rise: 1.25}", "{ramp: 10, rise: 1.2}", set()),
    "a start": ("rates: {chassis_free.vx: 5}", "rates: {chassis_free.vx: 6}", set()),
    "a step": ("dt: 0.0075", "dt: 0.005", set()),
    "a default": ("speed: {value: 5,", "speed: {value: 6,", {"description.cpp"}),
    "a line that moves all others": ("name: iltis\n", "name: iltis\n\n", {"description.cpp"}),
    "nothing": ("name: iltis\n", "name: iltis\n", set()),
}  # fmt: skip


#: Files of its library with lanes that a change compiles, beside the interface, which has sizes and scene.
OF_LIBRARY: Mapping[str, set[str]] = {
    "an output": {"report.cpp", "side_by_side/report.cpp", "unity/side_by_side_report.cpp"},
    "a law of an input": {"scene_inputs.cpp", "unity/mechanism.cpp", "side_by_side/scene_inputs.cpp", "unity/side_by_side.cpp"},
}  # fmt: skip


def source_of(text: str, folder: Path, scene: str, *, library: bool = False) -> Source:
    file = folder / "model.yaml"
    file.write_text(text, encoding="utf-8")
    model = read_model(file)
    made = generate(model, model.scenes[scene], model.scenes[scene].outputs)
    return make_standalone(made, equal_steps=True, side_by_side=True).library if library else made.source


def objects(source: Source) -> set[Object]:
    return set(find_objects(source, find_compiler(), FLAGS, Kind()))


@pytest.fixture(scope="module")
def iltis(tmp_path_factory: pytest.TempPathFactory) -> set[Object]:
    """The object files of the unchanged vehicle."""
    return objects(source_of(_text("iltis"), tmp_path_factory.mktemp("iltis"), "simul1"))


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> set[Object]:
    """Objects of its library."""
    return objects(source_of(_text("iltis"), tmp_path_factory.mktemp("library"), "simul1", library=True))


def _text(model: str) -> str:
    return (MODELS / f"{model}.yaml").read_text(encoding="utf-8")


def _edited(edit: str) -> str:
    """The vehicle's file after an edit."""
    before, after, _ = EDITS[edit]
    model, _, scene = _text("iltis").partition("  simul1: ")
    model, scene = (model, scene.replace(before, after, 1)) if before in scene else (model.replace(before, after), scene)
    text = f"{model}  simul1: {scene}"
    assert text != _text("iltis") or edit == "nothing"
    return text


@needs_cpp
@pytest.mark.parametrize("edit", EDITS)
def test_what_is_not_of_the_dynamics_does_not_compile_them_again(edit: str, iltis: set[Object], tmp_path: Path) -> None:
    changed = objects(source_of(_edited(edit), tmp_path, "simul1")) - iltis
    assert {o.source for o in changed} == EDITS[edit][2]


@needs_cpp
@pytest.mark.parametrize("edit", EDITS)
def test_libraries_compile_no_dynamics_again(edit: str, library: set[Object], tmp_path: Path) -> None:
    changed = objects(source_of(_edited(edit), tmp_path, "simul1", library=True)) - library
    assert {o.source for o in changed} - {"interface.cpp"} == OF_LIBRARY.get(edit, set())


@needs_cpp
def test_what_is_of_the_dynamics_compiles_them_again(iltis: set[Object], tmp_path: Path) -> None:
    text = _text("iltis").replace("S: [x_hinge, 0.1585, 0.600]", "S: [x_hinge, 0.1585, 0.601]")
    changed = objects(source_of(text, tmp_path, "simul1")) - iltis
    assert {o.source for o in changed} == {"constraint_residual.cpp", "energy.cpp", "evaluate.cpp", "project.cpp", "report.cpp"}


@needs_cpp
def test_a_simulator_is_made_of_the_object_files_that_there_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = source_of(_text("press"), tmp_path, "turn")
    other = source_of(_text("press").replace("turn: {end: 2", "turn: {end: 1").replace("slider.x, slider.vx", "slider.x"), tmp_path, "turn")
    build(first)
    parts = driver_parts(first.driver, find_compiler(), FLAGS, Kind())
    libraries = [next(place for place in part.places if is_sound(place)).parent for part in parts]
    monkeypatch.setenv("CUTJOINT_CACHE", str(tmp_path / "cache"))
    for library in libraries:
        shutil.copytree(library, cache_folder() / library.name)
    build(first)
    stored = set(cache_folder().glob("object-*"))
    assert len(stored) == 3  # functions, description and main program
    build(other)
    assert set(cache_folder().glob("object-*")) - stored == {
        o.cached.parent for o in objects(other) - objects(first) if o.cached.is_file()
    }  # fmt: skip
    # what came to harm is compiled again
    for file in cache_folder().glob("object-*/code.o"):
        DAMAGE["a bit flipped"](file)
    shutil.rmtree(build(first).path.parent)
    assert build(first).fresh
    assert all(is_sound(folder / "code.o") for folder in stored)


@needs_cpp
def test_a_library_shows_names_of_its_model_alone(tmp_path: Path) -> None:
    made = build(source_of(_text("press"), tmp_path, "turn", library=True)).path
    lines = subprocess.run(["nm", "-D", "--defined-only", made], check=True, capture_output=True, text=True).stdout.splitlines()
    names = {line.split()[-1] for line in lines}
    assert "press_step" in names
    assert all(name.startswith("press_") for name in names)


@pytest.mark.skipif(which("clang++") is None, reason="needs clang++")
@pytest.mark.parametrize("source", ["newton", "integrators"])
def test_clang_takes_the_integrators(source: str) -> None:
    """Clang before version 16 instantiates members whose constraints are not met."""
    folder = ROOT / "runtime"
    flags = ("-std=c++20", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", f"-I{folder / 'include'}", "-isystem", "/usr/include/eigen3")
    subprocess.run(["clang++", *flags, str(folder / "driver" / f"{source}.cpp")], check=True)
