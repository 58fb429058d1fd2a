"""C++ of loops that once did not compile: in every number type, in batches, with conditions and awkward names."""

from __future__ import annotations

import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from cutjoint.compile.pipeline import generate
from cutjoint.emit.classes import LANES
from cutjoint.emit.source import Source
from cutjoint.model.read import read_model_text
from cutjoint.package.locations import runtime_folder
from cutjoint.run.scenes import find_scene, with_closure
from cutjoint.toolchain.build import write_source
from cutjoint.toolchain.compiler import find_compiler
from cutjoint_bench.driver import QUAD
from tests.mechanisms.chains import pendulums_in_a_row
from tests.mechanisms.sources import source_of_batch

LINKS = 12
REALS = {
    "double": ["-DCUTJOINT_REAL=double"], "extended": ["-DCUTJOINT_REAL=long double"],
    "quad": ["-DCUTJOINT_REAL=cutjoint::Quad", "-include", str(QUAD.folder / QUAD.record.header), "-isystem", "/usr/include/eigen3"],
    "batch": [f"-DCUTJOINT_REAL={LANES}", "-include", "cutjoint/core/mechanism/instances.hpp"],
}  # fmt: skip


def with_laws(law: str, *, bodies: str = "", joints: str = "") -> str:
    """Pendulums in a row with a force in each joint; ``law`` may have the link's number as {i}, and one more as {j}."""
    laws = [law.replace("{i}", str(i)).replace("{j}", str(i + 1)) for i in range(LINKS)]
    forces = "".join(f"  force_{i}: {{kind: joint_force, joint: pin_{i}, law: {law}}}\n" for i, law in enumerate(laws))
    text = pendulums_in_a_row(LINKS).replace("joints:\n", f"{bodies}joints:\n{joints}")
    return text.replace("scenes:\n", f"forces:\n{forces}scenes:\n")


CONDITIONS = with_laws('{of: position, piecewise: [{below: 0.0{j}, expression: "-3*position-rate"}, {expression: "-5*position**2"}]}')
NUMBERS = with_laws("{of: position, piecewise: [{below: 0.1, polynomial: [0.{j}]}, {expression: \"-5*position\"}]}")
POWERS = with_laws('"-{j}*(1+position**2)**(1.3+0.1*{i})"')
NAMES = with_laws(
    '"-{j}*position**3-(2*{i}+1)*sin(position)"', bodies="  given: {mass: 1, centre_of_mass: [3, 0, 0], inertia: [1, 1, 1]}\n",
    joints="  free: {kind: spherical, bodies: [ground, given], at: [3, 0, 1]}\n",
)  # fmt: skip


CASES = {
    "balls": (pendulums_in_a_row(LINKS, joint="spherical"), "recursive-newton", "double"),
    "conditions": (CONDITIONS, "recursive-newton", "double"), "conditions, natural": (CONDITIONS, "augmented", "double"),
    "conditions, batch": (CONDITIONS, "recursive", "batch"), "numbers, extended": (NUMBERS, "recursive", "extended"),
    "numbers, quad": (NUMBERS, "recursive", "quad"), "numbers, batch": (NUMBERS, "recursive", "batch"),
    "powers, batch": (POWERS, "recursive", "batch"), "names": (NAMES, "recursive", "double"),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_loops_compile(case: str, tmp_path: Path) -> None:
    text, method, real = CASES[case]
    source = written(text, method, real)
    assert any("for (int " in code for code in source.files.values())
    write_source(source, tmp_path)
    for name, code in source.files.items():
        if name.endswith(".cpp") and "for (int " in code and not name.startswith(("factor", "solve")):
            command = [
                *find_compiler().command, "-std=c++20", "-fsyntax-only", "-Wall", "-Wextra", "-Werror", "-Wno-psabi",
                f"-I{runtime_folder()}/include", f"-I{tmp_path}", *REALS[real], str(tmp_path / name),
            ]  # fmt: skip
            done = subprocess.run(command, capture_output=True, text=True)
            assert done.returncode == 0, done.stderr


def written(text: str, method: str, real: str) -> Source:
    model = read_model_text(text, "row.yaml")
    scene = find_scene(model, "swing")
    if real == "batch":
        source = source_of_batch(model, with_closure(scene, "penalty"), ())[1]
        return replace(source, files={name: code for name, code in source.files.items() if name.startswith("side_by_side/")})
    return generate(model, scene, (), method=method, lanes=real == "double")[2]
