"""Folders that stand alone, and programs on them."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from cutjoint.model.read import read_model_text
from cutjoint.pipeline import generate
from cutjoint.run.scenes import find_scene
from cutjoint.standalone import Standalone, make_standalone

#: What the README of a folder says of its compilation, but for how far it is optimised.
CXX = ("-std=c++20", "-O1", "-Wall", "-Wextra", "-Werror", "-fno-math-errno", "-fno-exceptions", "-fno-rtti", "-fno-threadsafe-statics",
       "-Wno-psabi")  # fmt: skip
C = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O1")
LIBRARIES = ("-lm", "-lmvec")


@cache
def folder_of(text: str, name: str, scene: str | None = None) -> Standalone:
    """The folder of a model that is given as text."""
    model = read_model_text(text, name)
    chosen = find_scene(model, scene)
    equations, program, source = generate(model, chosen, chosen.outputs)
    return make_standalone(equations.mechanism, program, source)


def write(folder: Standalone, place: Path) -> Path:
    """Write the files of a folder."""
    place.mkdir(parents=True, exist_ok=True)
    for name, text in folder.files.items():
        (place / name).write_text(text, encoding="utf-8")
    return place


def compile_object(place: Path, name: str, *, compiler: str = "g++", flags: Sequence[str] = ()) -> Path:
    """The object file of a model."""
    subprocess.run([compiler, *CXX, *flags, "-c", f"{name}.cpp", "-o", f"{name}.o"], cwd=place, check=True)
    return place / f"{name}.o"


def link(place: Path, program: str, sources: Sequence[Path | str], *, compiler: str = "gcc", flags: Sequence[str] = ()) -> Path:
    """A program in C with objects of models."""
    subprocess.run([compiler, *C, *flags, "-o", program, *map(str, sources), *LIBRARIES], cwd=place, check=True)
    return place / program


def run(program: Path, *arguments: str) -> str:
    """What a program prints."""
    return subprocess.run([program, *arguments], cwd=program.parent, check=True, capture_output=True, text=True).stdout
