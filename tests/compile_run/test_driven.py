"""A host program drives generated code: by values that it holds or interpolates, by a function of time, or not at all."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from cutjoint.compile.pipeline import generate
from cutjoint.model.read import read_model_text
from cutjoint.package.locations import runtime_folder
from cutjoint.toolchain.build import write_source
from tests.mechanisms.driven import DRIVEN, LIFT, Array, guided, orders


def test_hosts_drive_generated_code(tmp_path: Path) -> None:
    model = read_model_text(DRIVEN, "driven.yaml")
    scene = model.scenes["lawful"]
    _, _, source = generate(model, scene, scene.outputs)
    write_source(source, tmp_path)
    program = tmp_path / "drive"
    subprocess.run(
        ["g++", "-std=c++20", "-O1", "-Wall", "-Wextra", "-Werror", "-isystem", "/usr/include/eigen3", f"-I{tmp_path}",
         f"-I{runtime_folder() / 'include'}", str(Path(__file__).with_name("driven.cpp")),
         *(str(p) for p in sorted(tmp_path.glob("*.cpp")) if p.name not in ("main.cpp", "description.cpp")), "-o", str(program)],
        check=True,
    )  # fmt: skip
    printed = subprocess.run([program], capture_output=True, text=True, check=True).stdout
    rows = np.array([[float(x) for x in line.split()] for line in printed.splitlines()])
    cubic = CubicHermiteSpline([0.5, 0.75], [0.1, 0.4], [0.5, -1.0])
    trajectories = [
        orders(LIFT, np.float64(0.5)), (0.7, 0.0, 0.0), (-0.3, 0.0, 0.0), (0.1 + 0.1 * 1.2, 1.2, 0.0),
        (cubic(0.6), cubic(0.6, 1), cubic(0.6, 2)), (1.2, 2.0, 0.0), orders(LIFT, np.float64(0.5)),
    ]  # fmt: skip
    for row, trajectory in zip(rows, trajectories, strict=True):
        lift: tuple[Array, Array, Array] = tuple(np.array(x) for x in trajectory)  # type: ignore[assignment]
        assert row[1:] == pytest.approx([float(x) for x in guided(lift, row[0]).values()], abs=1e-13)
