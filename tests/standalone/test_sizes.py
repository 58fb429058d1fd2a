"""The bound of the bytes of a simulation, beside what a compiler says that its class takes."""

from __future__ import annotations

import re
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cutjoint.methods import METHODS, Formulation
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.toolchain.compiler import find_compiler
from tests.conftest import with_heavy
from tests.mechanisms.random_models import CLOSINGS, CUT_KINDS, loop_with, scene
from tests.mechanisms.rods import rods_text
from tests.standalone.c_exports import folder_of_model

#: Methods, integrators, and what a folder has besides.
KINDS = (
    ("recursive", "dormand-prince", {}), ("recursive-newton", "radau5", {}), ("recursive", "trapezoidal", {}),
    ("augmented", "trapezoidal", {}),
    ("recursive", "dop853", {"linearise": True}), ("recursive-newton", "radau5", {"adjoint": True}), ("classical", "trapezoidal", {}),
    ("recursive", "rk4", {"adjoint": True}), ("recursive-newton", "generalised-alpha", {"poses": True, "adjoint": True}),
)  # fmt: skip


def model_of(seed: int, method: str) -> Model:
    """A random loop, or plates on massless rods, of which four have more than 24 equations."""
    rng = np.random.default_rng(seed)
    if seed % 2 and METHODS[method].formulation is not Formulation.NATURAL:  # which has not the coordinates of all kinds
        return replace(loop_with(rng.choice(CUT_KINDS), rng.choice(CLOSINGS), seed), scenes={"run": scene()})
    return read_model_text(rods_text(int(rng.integers(2, 6)), plates=1 + seed // 2 % 3, seed=seed), "rods.yaml")


@pytest.mark.parametrize("seed", with_heavy(range(36), *range(1, 36)))
def test_a_simulation_takes_no_more_than_its_bound(seed: int, tmp_path: Path) -> None:
    method, integrator, choices = KINDS[seed % len(KINDS)]
    alone = folder_of_model(model_of(seed, method), None, integrator, method, **choices)
    for name, text in alone.files.items():
        changed = re.sub(r"static_assert\((sizeof.* \+ alignof.*) <= \w+\);", r"std::integral_constant<std::size_t, \1> actual = 0;", text)
        (tmp_path / name).write_text(changed)
    command = [*find_compiler().command, "-std=c++20", "-fsyntax-only", f"{alone.name}.cpp"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    (size,) = re.findall(r"integral_constant<[a-z ]+, (\d+)", done.stderr)[:1]
    assert 0 < int(size) <= alone.size
