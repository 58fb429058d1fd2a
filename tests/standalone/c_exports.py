"""Folders that stand alone, and programs on them."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from cutjoint.compile.c_export import Standalone, make_standalone
from cutjoint.compile.pipeline import generate
from cutjoint.methods import DEFAULT_METHOD, METHODS, STEPS
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.run.scenes import find_scene
from cutjoint_bench.driver import QUAD
from tests.conftest import MODELS
from tests.physics.simulation import is_generated

#: The flags of a folder's README, but for the level of optimisation.
CXX = ("-std=c++20", "-O1", "-Wall", "-Wextra", "-Werror", "-fno-math-errno", "-fno-tree-slp-vectorize", "-fno-exceptions", "-fno-rtti",
       "-fno-threadsafe-statics")  # fmt: skip
C = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O1")
LIBRARIES = ("-lm", "-lmvec")


HERE = Path(__file__).parent

#: The methods that folders have.
ALONE = tuple(METHODS)

#: Definitions for a C program with a method that has no number of iterations to set.
DEFINITIONS = {
    name: () if STEPS[name]["trapezoidal"].is_iterated else ("-Dpress_set_iterations(sim,number)=PRESS_NOT_FINITE",) for name in ALONE
}

#: Random calls under sanitizers; 1e6 of them take half a minute.
RANDOM_CALLS = 50_000

#: Functions that the code of a model may call: mathematics, and what compilers make of loops.
_CALLS = {"memcmp", "memcpy", "memmove", "memset", "strcmp", "sin", "cos", "sincos", "tan", "atan", "atan2", "sqrt", "exp", "log", "pow"}


@cache
def folder_of(
    text: str, name: str, scene: str | None = None, integrator: str | None = None, method: str = DEFAULT_METHOD, **choices: bool
) -> Standalone:
    """The folder of a model that is given as text; choices as of `folder_of_model`."""
    return folder_of_model(read_model_text(text, name), scene, integrator, method, **choices)


def folder_of_model(
    model: Model, scene: str | None = None, integrator: str | None = None, method: str = DEFAULT_METHOD, *, linearise: bool = False,
    adjoint: bool = False, poses: bool = False,
) -> Standalone:  # fmt: skip
    """The folder of a model."""
    chosen = find_scene(model, scene)
    generated = generate(model, chosen, chosen.outputs, method=method, poses=poses)
    return make_standalone(generated, integrator=integrator, equal_steps=True, linearise=linearise, adjoint=adjoint)


def standalone_of(name: str, scene: str | None = None, integrator: str | None = None, method: str = DEFAULT_METHOD) -> Standalone:
    """The folder of a model of the repository."""
    return folder_of((MODELS / f"{name}.yaml").read_text(encoding="utf-8"), f"{name}.yaml", scene, integrator, method)


def write(folder: Standalone, place: Path) -> Path:
    """Write the files of a folder."""
    place.mkdir(parents=True, exist_ok=True)
    for name, text in folder.files.items():
        (place / name).write_text(text, encoding="utf-8")
    return place


def compile_object(place: Path, name: str, *, compiler: str = "g++", flags: Sequence[str] = ()) -> Path:
    """The object file of a model, without optimisation but in `make full`: in half the time."""
    level = () if is_generated() else ("-O0",)
    subprocess.run([compiler, *CXX, *level, *flags, "-c", f"{name}.cpp", "-o", f"{name}.o"], cwd=place, check=True)
    return place / f"{name}.o"


def link(place: Path, program: str, sources: Sequence[Path | str], *, compiler: str = "gcc", flags: Sequence[str] = ()) -> Path:
    """A program in C with objects of models."""
    subprocess.run([compiler, *C, *flags, "-o", program, *map(str, sources), *LIBRARIES], cwd=place, check=True)
    return place / program


def run(program: Path, *arguments: str) -> str:
    """The output of a program."""
    return subprocess.run([program, *arguments], cwd=program.parent, check=True, capture_output=True, text=True).stdout


def in_quads(place: Path, name: str, program: str, functions: str = "") -> Path:
    """A program on a folder's code for numbers of 113 bits, with the model's functions for these."""
    (place / "functions.hpp").write_text(functions, encoding="utf-8")
    sources = [HERE / f"{program}.cpp", *(["supplied.cpp"] if functions else [])]
    subprocess.run(
        ["g++", "-std=c++20", "-O0", "-Wno-psabi", "-I.", f"-I{QUAD.folder / 'include'}", "-isystem", "/usr/include/eigen3",
         f'-DSOURCE="{name}.cpp"', '-DFUNCTIONS="functions.hpp"', f"-DMODEL={name}", f"-DTITLE={name.upper()}",
         *sources, "-o", program, *LIBRARIES],
        cwd=place, check=True,
    )  # fmt: skip
    return place / program


def foreign_symbols(made: Path, name: str) -> list[str]:
    """Foreign symbols of an object file: calls besides mathematics, or of what only the file itself may define, and definitions without the
    model's name."""
    called = [words[-1] for words in _symbols(made, "-u")]
    own = [words[-1] for words in _symbols(made, "-g", "--defined-only")]
    assert own
    read = subprocess.run(["readelf", "-sW", made], capture_output=True, text=True, check=True).stdout.splitlines()
    hidden = [words[-1] for words in map(str.split, read) if {"HIDDEN", "UND"} <= set(words)]
    foreign = hidden + [x for x in called if x not in _CALLS and not x.startswith("_ZGV") and x != "_GLOBAL_OFFSET_TABLE_"]
    return foreign + [x for x in own if not x.startswith(f"{name}_") and f"{name}_code" not in x]


def _symbols(made: Path, *which: str) -> list[list[str]]:
    """The output of nm for an object file."""
    return [line.split() for line in subprocess.run(["nm", *which, made], capture_output=True, text=True, check=True).stdout.splitlines()]
