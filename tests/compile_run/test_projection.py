"""Projections by generated code: gaps are closed to rounding at any penalty, by a change that is an answer to multipliers alone."""

from __future__ import annotations

import subprocess
from functools import cache
from pathlib import Path

import pytest

from cutjoint.compile.pipeline import generate
from cutjoint.model.read import read_model
from cutjoint.package.locations import runtime_folder
from cutjoint.run.scenes import find_scene, with_closure
from cutjoint.toolchain.build import write_source
from tests.conftest import MODELS, with_heavy

PENALTIES = (1e4, 1e6, 1e9, 1e12)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("projection")


@cache
def program(folder: Path, model: str, scene: str, class_name: str) -> Path:
    """A program that projects disturbed states of a model, of which an evaluation with the closure "penalty" knows the masses exactly."""
    own = folder / model
    read = read_model(MODELS / f"{model}.yaml")
    write_source(generate(read, with_closure(find_scene(read, scene), "penalty"), ())[2], own)
    sources = [str(p) for p in own.glob("*.cpp") if p.name not in ("main.cpp", "report.cpp")]
    built = own / "project"
    subprocess.run(
        ["g++", "-std=c++20", "-O1", "-Wno-psabi", "-isystem", "/usr/include/eigen3", f"-I{own}", f"-I{runtime_folder() / 'include'}",
         f'-DMECHANISM_HEADER="{model}.hpp"', f"-DMECHANISM={class_name}", str(Path(__file__).with_name("projection.cpp")),
         *sources, str(own / "report.cpp"), "-o", str(built)],
        check=True,
    )  # fmt: skip
    return built


@pytest.mark.parametrize("penalty", PENALTIES)
@pytest.mark.parametrize(
    ("model", "scene", "class_name"),
    with_heavy(
        [("four_bar", "swing", "FourBar"), ("slider_crank", "turn", "SliderCrank"), ("iltis", "simul1", "Iltis")],
        ("slider_crank", "turn", "SliderCrank"), ("iltis", "simul1", "Iltis"),
    ),
)
def test_gaps_are_closed(folder: Path, model: str, scene: str, class_name: str, penalty: float) -> None:
    done = subprocess.run([program(folder, model, scene, class_name), str(penalty)], capture_output=True, text=True, check=True)
    iterations, gap, closed, steps, rate, still, stray = (float(x) for x in done.stdout.split())
    assert gap > 1e-4
    assert closed < 1e-13
    assert rate > 0.1
    assert still < 1e-12
    assert max(iterations, steps) < 12
    # the penalty costs digits of the masses: 1e12 against kilograms leaves four
    assert stray < 1e-10 + 1e-15 * penalty
