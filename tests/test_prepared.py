"""Cached runs: they derive nothing, equal the runs that were prepared, and give way to any change."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import EntryPoints
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result

import cutjoint
from cutjoint.cli import main
from cutjoint.commands import options, preparing
from cutjoint.compile import prepared
from cutjoint.compile.prepared import PreparedRun, Request, find_cached_run
from cutjoint.model.records import Model, Scene
from cutjoint.package import extensions
from cutjoint.package.errors import RunError
from cutjoint.run.settings import Options
from cutjoint.toolchain import compiler, origins
from cutjoint.toolchain.cache import cache_folder, read_record, write_record
from tests.conftest import MODELS, needs_cpp
from tests.toolchain.damage import DAMAGE, damaged_records
from tests.toolchain.test_paths import can_mount, run_mounted

pytestmark = needs_cpp

#: A block on a spring: one parameter changes the law alone, the other one where the block starts.
SLIDE = """
cutjoint: 1
name: slide
gravity: [0, 0, 0]
parameters:
  push: {value: 2, binding: param}
  begin: {value: 0.25, binding: param}
bodies: {block: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}}
joints: {rail: {kind: prismatic, bodies: [ground, block], at: [0, 0, 0], axis: [1, 0, 0]}}
forces: {spring: {kind: joint_force, joint: rail, law: push - 4*position}}
outputs: [block.x]
scenes:
  still: {end: 0.1, output_step: 0.05, numerics: {dt: 0.01}}
  moved: {end: 0.1, output_step: 0.05, numerics: {dt: 0.01}, positions: {rail.displacement: begin}}
"""

#: Modules that a compiled run does without: other commands' packages, and measuring.
LATER = (
    "cutjoint.reduce", "cutjoint.export", "cutjoint.view", "cutjoint.report.explain", "cutjoint.report.tasks",
    "cutjoint_bench",
)  # fmt: skip

#: One value of each option that is not the default.
OTHER_OPTIONS: dict[str, Any] = {
    "solver": "klu", "integrator": "rk4", "events": "located", "dt": 0.005, "end": 1.0, "tolerance": 1e-3, "iterations": 3, "penalty": 1e5,
}  # fmt: skip

_WITH_SOLVER = "augmented, classical or recursive-newton"

#: Modules that a cached run does without.
HEAVY = ("sympy", "pint", "yaml", "pydantic", "jinja2", "matplotlib", "cutjoint.compile.pipeline", "cutjoint.model.read")


@pytest.fixture(autouse=True)
def _around(monkeypatch: pytest.MonkeyPatch) -> None:
    """Digests are those of this test's files, and no line is broken."""
    forget_digests()
    monkeypatch.setattr(options.out, "width", 200)


def forget_digests() -> None:
    for cached in (origins.code_digest, origins.versions):
        cached.cache_clear()


@pytest.fixture
def model(tmp_path: Path) -> Path:
    path = tmp_path / "slide.yaml"
    path.write_text(SLIDE, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model whose scene `still` is kept."""
    path = tmp_path_factory.mktemp("shared") / "slide.yaml"
    path.write_text(SLIDE, encoding="utf-8")
    assert simulate(path).exit_code == 0
    return path


def simulate(model: Path, *arguments: object, scene: str = "still", out: str = "run.csv") -> Result:
    given = ("simulate", model, "--scene", scene, "--verbose", "--out", model.parent / out, *arguments)
    return CliRunner().invoke(main, [str(a) for a in given])


def anew(monkeypatch: pytest.MonkeyPatch) -> list[Request]:
    """Requests that are prepared anew from now on."""
    done: list[Request] = []
    prepare = preparing.prepare_and_run

    def watched(request: Request, *rest: object) -> object:
        done.append(request)
        return prepare(request, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(preparing, "prepare_and_run", watched)
    return done


def lasting(output: str) -> list[list[str]]:
    """The words of an output's lines that do not tell how long something took."""
    lines = [line.split() for line in output.splitlines() if line.strip()]
    return [words for words in lines if words[0] not in ("generate", "compile", "run")]


def table(model: Path, out: str = "run.csv") -> bytes:
    return (model.parent / out).read_bytes()


def test_a_run_that_is_compiled_imports_nothing_of_other_commands(shared: Path) -> None:
    script = (
        "import sys; from cutjoint.cli import main; import cutjoint.commands.simulate as simulate; "
        "simulate.find_cached_run = lambda *_: None; main(sys.argv[1:], standalone_mode=False); "
        f"later = {LATER}; print('derived:', 'cutjoint.compile.pipeline' in sys.modules, 'of others:', "
        "[name for name in sys.modules if any(f'{name}.'.startswith(f'{package}.') for package in later)])"
    )
    command = [sys.executable, "-c", script, "simulate", shared, "--scene", "still", "--out", shared.parent / "again.csv"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "derived: True of others: []" in done.stdout


def test_a_kept_run_imports_nothing_of_what_derives(model: Path) -> None:
    assert simulate(model).exit_code == 0
    first = table(model)
    script = (
        "import sys; from cutjoint.cli import main; main(sys.argv[1:], standalone_mode=False); "
        f"print('imported:', [name for name in {HEAVY} if name in sys.modules])"
    )
    command = [sys.executable, "-c", script, "simulate", model, "--scene", "still", "--verbose", "--out", model.parent / "run.csv"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "imported: []" in done.stdout
    assert re.search("generate +found in the cache", done.stdout)
    assert table(model) == first


@pytest.mark.parametrize("arguments", [
    (), pytest.param(("--method", "augmented", "--implementation", "generic"), marks=pytest.mark.heavy), ("--dt", "0.005", "--end", "0.05")
])  # fmt: skip
def test_a_kept_run_is_what_it_was(arguments: tuple[str, ...], model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done = anew(monkeypatch)
    first = simulate(model, *arguments, "--steps", model.parent / "steps.csv")
    kept = table(model), table(model, "run.units.json"), table(model, "steps.csv")
    for name in ("run.csv", "run.units.json", "steps.csv"):
        (model.parent / name).unlink()
    second = simulate(model, *arguments, "--steps", model.parent / "steps.csv", "--plots", model.parent / "plots")
    assert first.exit_code == second.exit_code == 0, first.output + second.output
    assert len(done) == 1
    assert lasting(first.output) == lasting(second.output)[:-1]
    assert (table(model), table(model, "run.units.json"), table(model, "steps.csv")) == kept
    assert [p.name for p in (model.parent / "plots").iterdir()] == ["position.png"]


def test_parameters_change_a_kept_run_that_nothing_else_follows_from(model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    simulate(model, "--set", "push=3")
    external_wrenches = table(model)
    simulate(model, out="plain.csv")
    assert external_wrenches != table(model, "plain.csv")
    done = anew(monkeypatch)
    assert re.search("generate +found in the cache", simulate(model, "--set", "push=3", out="again.csv").output)
    assert table(model, "again.csv") == external_wrenches
    assert done == []


def test_a_start_that_follows_from_a_parameter_is_found_anew(model: Path) -> None:
    for begin, arguments in ((0.25, ()), (0.5, ("--set", "begin=0.5")), (0.25, ())):
        assert simulate(model, *arguments, scene="moved").exit_code == 0
        assert np.loadtxt(model.parent / "run.csv", delimiter=",", skiprows=1)[0, 1] == begin


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--set", "pull=3"), "model 'slide' has no parameter 'pull'; it has begin, push"),
        (("--set", "push"), "--set push: write NAME=NUMBER, with a unit or without"),
        (("--solver", "klu"), "--solver klu: the recursive method has no linear solver; use --method " + _WITH_SOLVER),
    ],
)
def test_wrong_requests_are_reported_as_before(arguments: tuple[str, ...], message: str, model: Path) -> None:
    before = simulate(model, *arguments)
    assert simulate(model).exit_code == 0
    after = simulate(model, *arguments)
    assert before.output.strip() == after.output.strip() == message
    assert before.exit_code == after.exit_code == 1


def test_a_model_that_became_wrong_is_reported(model: Path) -> None:
    assert simulate(model).exit_code == 0
    model.write_text(SLIDE.replace("[ground, block]", "[ground, clock]"), encoding="utf-8")
    result = simulate(model)
    assert result.exit_code == 1
    assert f"{model}:9:" in result.output


def test_a_kept_run_that_fails_says_where(model: Path) -> None:
    model.write_text(SLIDE.replace("push - 4*position", "push - 1e6*sign(position)"), encoding="utf-8")
    first, second = (simulate(model, scene="moved") for _ in range(2))
    assert first.exit_code == second.exit_code == 1
    assert f"{model}:9:10: scene 'moved': the fixed point" in first.output
    assert lasting(first.output) == lasting(second.output)


def test_a_scene_for_method_auto_is_measured_each_time(model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    measured: list[str] = []

    def stop(model: Model, scene: Scene, **how: object) -> None:
        measured.append(scene.name)
        raise RunError("stopped")

    monkeypatch.setattr("cutjoint.commands.picking.choose", stop)
    assert [simulate(model, "--method", "auto").exit_code for _ in range(2)] == [1, 1]
    assert measured == ["still", "still"]
    assert find_cached_run(Request(model=model, scene="still", method="auto"), {}) is None


def _copied(name: str, file: str) -> Callable[[Path, pytest.MonkeyPatch], None]:
    """The compiler's own folders as a copy, in which one file has a line more."""

    def change(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        folders = {p.name: p for p in prepared.code_folders()}
        copies = {n: Path(shutil.copytree(p, folder / n, ignore=shutil.ignore_patterns("__pycache__"))) for n, p in folders.items()}
        monkeypatch.setattr(prepared, "code_folders", lambda: tuple(copies.values()))
        with (copies[name] / file).open("a", encoding="utf-8") as stream:
            stream.write("\n")

    return change


def _other_compiler(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "c++").write_text("#!/bin/sh\necho another\n", encoding="utf-8")
    (folder / "c++").chmod(0o755)
    monkeypatch.setenv("CXX", str(folder / "c++"))


CHANGES: dict[str, Callable[[Path, pytest.MonkeyPatch], None]] = {
    "compiler's sources": _copied("cutjoint", "kernels/joints.py"),
    "templates": _copied("templates", "function.cpp.jinja"),
    "runtime": _copied("runtime", "include/cutjoint/any_mechanism.hpp"),
    "version of a library": lambda _, monkeypatch: monkeypatch.setattr(origins, "version", lambda name: "0"),
    "C++ compiler": _other_compiler,
    "flags": lambda _, monkeypatch: monkeypatch.setattr(prepared, "FLAGS", ("-O0",)),
    "cache": lambda folder, monkeypatch: monkeypatch.setenv("CUTJOINT_CACHE", str(folder / "cache")),
}


@pytest.mark.parametrize("what", CHANGES)
def test_what_has_changed_is_prepared_anew(what: str, shared: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert find_cached_run(Request(model=shared, scene="still"), {}) is not None
    forget_digests()
    CHANGES[what](tmp_path, monkeypatch)
    assert find_cached_run(Request(model=shared, scene="still"), {}) is None


def test_another_processor_is_another_run_where_flags_mean_it(model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    request = Request(model=model, scene="still")
    places = set()
    for flags in (("-O1",), ("-O1", "-march=native")):
        monkeypatch.setattr(prepared, "FLAGS", flags)
        for capabilities in ("avx2", "avx512f"):
            monkeypatch.setattr(compiler, "processor", lambda found=capabilities: (found,))
            places.add(prepared._cache_path(request, b""))
    assert len(places) == 3


def test_the_same_sources_elsewhere_are_the_same_code(shared: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Their folder does not matter, nor what Python keeps beside them."""
    copies = tuple(Path(shutil.copytree(p, tmp_path / p.name)) for p in prepared.code_folders())
    (copies[0] / "more.pyc").write_bytes(b"")
    monkeypatch.setattr(prepared, "code_folders", lambda: copies)
    assert find_cached_run(Request(model=shared, scene="still"), {}) is not None


@pytest.mark.parametrize(("old", "new"), [("mass: 1", "mass: 2"), ("name: slide", "name: slide  # that slides"), ("\n", "\r\n")])
def test_another_text_of_the_model_is_prepared_anew(old: str, new: str, model: Path) -> None:
    """A comment too: messages and generated code have lines of the file."""
    assert simulate(model).exit_code == 0
    model.write_bytes(SLIDE.encode())
    assert find_cached_run(Request(model=model, scene="still"), {}) is not None
    model.write_bytes(SLIDE.replace(old, new).encode())
    assert find_cached_run(Request(model=model, scene="still"), {}) is None


def test_another_file_of_the_model_is_prepared_anew(model: Path) -> None:
    """A table that changes, and one that goes."""
    table = model.with_name("spring.csv")
    model.write_text(SLIDE.replace("push - 4*position", "{sum: [push, {table: {file: spring.csv}}]}"), encoding="utf-8")
    request = Request(model=model, scene="still")
    table.write_text("position [mm], value\n0, 0\n1000, -4\n", encoding="utf-8")
    assert simulate(model).exit_code == 0
    first = model.with_name("run.csv").read_bytes()
    assert find_cached_run(request, {}) is not None
    table.write_text("position [mm], value\n0, 0\n1000, -8\n", encoding="utf-8")
    assert find_cached_run(request, {}) is None
    assert simulate(model).exit_code == 0
    assert model.with_name("run.csv").read_bytes() != first
    assert find_cached_run(request, {}) is not None
    table.unlink()
    assert find_cached_run(request, {}) is None


@pytest.mark.parametrize(
    "asked",
    [
        {"scene": "moved"}, {"method": "augmented"}, {"closure": "proximal"}, {"implementation": "generic"}, {"precision": "single"},
        *({"options": Options(**{name: value})} for name, value in OTHER_OPTIONS.items()),
    ],
    ids=str,
)  # fmt: skip
def test_another_request_is_prepared_anew(asked: dict[str, object], shared: Path) -> None:
    assert find_cached_run(Request(model=shared, scene="still"), {}) is not None
    assert find_cached_run(replace(Request(model=shared, scene="still"), **asked), {}) is None  # type: ignore[arg-type]


def test_another_name_of_the_file_is_prepared_anew(model: Path) -> None:
    """Messages have the name."""
    assert simulate(model).exit_code == 0
    model.rename(model.with_name("other.yaml"))
    assert find_cached_run(Request(model=model.with_name("other.yaml"), scene="still"), {}) is None


def _cached(model: Path) -> tuple[Path, PreparedRun]:
    assert simulate(model).exit_code == 0
    request = Request(model=model, scene="still")
    file = prepared._cache_path(request, model.read_bytes())
    found = find_cached_run(request, {})
    assert found is not None
    return file, found


def test_what_came_to_harm_is_prepared_anew(model: Path) -> None:
    file, _ = _cached(model)
    sound, rows = file.read_bytes(), table(model)
    harmed = list(damaged_records(sound))
    for content in harmed:
        file.write_bytes(content)
        assert find_cached_run(Request(model=model, scene="still"), {}) is None
    for content in harmed[:: len(harmed) // 5]:
        file.write_bytes(content)
        assert simulate(model).exit_code == 0
        assert (file.read_bytes(), table(model)) == (sound, rows)


@pytest.mark.parametrize("damage", ["gone", "cut off", "a bit flipped", "not executable", "a folder", "digest gone"])
def test_a_simulator_that_came_to_harm_is_not_run(damage: str, model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _, found = _cached(model)
    monkeypatch.setenv("CUTJOINT_CACHE", str(tmp_path / "cache"))
    shutil.copytree(found.run.simulator.parent, cache_folder() / found.run.simulator.parent.name)
    _, copied = _cached(model)
    assert copied.run.simulator.is_relative_to(cache_folder())
    DAMAGE[damage](copied.run.simulator)
    assert find_cached_run(Request(model=model, scene="still"), {}) is None


@can_mount
def test_a_run_needs_no_cache_to_write_to(model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _, found = _cached(model)
    monkeypatch.setenv("CUTJOINT_CACHE", str(tmp_path / "cache"))
    shutil.copytree(found.run.simulator.parent, cache_folder() / found.run.simulator.parent.name)
    command = ["simulate", str(model), "--scene", "still", "--out", str(model.parent / "run.csv")]
    script = f"from cutjoint.cli import main; main({command!r})"
    rows = table(model)
    for _ in range(2):  # with the simulator alone in the cache, and with the run
        (model.parent / "run.csv").unlink()
        done = run_mounted(cache_folder(), script)
        assert done.returncode == 0, done.stderr
        assert table(model) == rows
        _cached(model)


def test_a_kept_file_names_no_program_outside_of_the_cache(model: Path) -> None:
    file, found = _cached(model)
    data = read_record(file)
    folder = model.parent / "elsewhere"
    folder.mkdir()
    shutil.copy2(found.run.simulator, folder)
    for place in (str(folder), os.path.relpath(folder, cache_folder()), f"../{cache_folder().name}/{found.run.simulator.parent.name}"):
        assert (cache_folder() / place / "simulator").exists()
        write_record(file, {**data, "run": {**data["run"], "simulator": place}})
        assert find_cached_run(Request(model=model, scene="still"), {}) is None


def test_a_pipe_is_left_to_who_reads_the_model(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    pipe = os.open(tmp_path / "pipe", os.O_RDWR)
    os.write(pipe, b"x")
    assert find_cached_run(Request(model=tmp_path / "pipe"), {}) is None
    assert os.read(pipe, 1) == b"x"
    os.close(pipe)


def test_the_package_has_what_it_names() -> None:
    assert sorted(name for names in cutjoint._HOMES.values() for name in names.split()) == sorted(cutjoint.__all__)
    assert all(getattr(cutjoint, name).__name__ == name for name in cutjoint.__all__)
    with pytest.raises(AttributeError, match="module 'cutjoint' has no attribute 'compile_modle'"):
        _ = cutjoint.compile_modle


def test_help_names_all_commands(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extensions, "_entry_points", lambda: EntryPoints(()))
    output = CliRunner().invoke(main, ["--help"]).output
    helpers = {"__init", "options", "picking", "preparing", "renamed", "replay", "table"}
    modules = {p.stem.rstrip("_") for p in Path(preparing.__file__).parent.glob("*.py")} - helpers
    assert {line.split()[0] for line in output.partition("Commands:")[2].splitlines() if line.strip()} == modules
    assert "No such command 'simualte'" in CliRunner().invoke(main, ["simualte", str(MODELS / "four_bar.yaml")]).output
