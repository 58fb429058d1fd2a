"""No allocation in a step."""

from __future__ import annotations

import subprocess
from pathlib import Path

from cutjoint.locations import runtime_folder
from cutjoint.pipeline import compile_model
from tests.conftest import MODELS


def test_steps_do_not_allocate(tmp_path: Path) -> None:
    compile_model(MODELS / "four_bar.yaml", out=tmp_path)
    sources = [str(p) for p in tmp_path.glob("*.cpp") if p.name != "main.cpp"]
    program = tmp_path / "count"
    subprocess.run(
        ["g++", "-std=c++20", "-O1", "-Wno-psabi", "-isystem", "/usr/include/eigen3", f"-I{tmp_path}", f"-I{runtime_folder() / 'include'}",
         str(Path(__file__).with_name("no_allocation.cpp")), *sources, "-o", str(program)],
        check=True,
    )  # fmt: skip
    at_start, in_steps = subprocess.run([program], capture_output=True, text=True, check=True).stdout.split()
    assert int(at_start) > 0  # the counter works
    assert int(in_steps) == 0
