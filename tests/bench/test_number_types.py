"""Simulators in other number types than double, and what makes one."""

from __future__ import annotations

from pathlib import Path

import pytest

from cutjoint.compile.pipeline import compile_model
from cutjoint.run.simulation import simulate
from tests.mechanisms.bouncing import bouncing_text
from tests.physics.simulation import completed


@pytest.mark.heavy
@pytest.mark.parametrize("precision", ["single", "extended", "quad"])
def test_motions_in_two_number_types_agree_to_the_digits_of_the_shorter(precision: str, tmp_path: Path) -> None:
    path = tmp_path / "bounce.yaml"
    path.write_text(bouncing_text(10.0, 0.5), encoding="utf-8")
    tolerance = {"single": 1e-4, "extended": 1e-10, "quad": 1e-10}[precision]
    plain, other = (
        completed(simulate(compile_model(path, precision=p), integrator="dormand-prince", tolerance=tolerance))
        for p in ("double", precision)
    )  # fmt: skip
    assert other["mass.z"] == pytest.approx(plain["mass.z"], abs=20 * tolerance)
    assert other.statistics.events == plain.statistics.events
