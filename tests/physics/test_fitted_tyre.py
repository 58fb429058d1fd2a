"""The tyre of models/iltis.tir: a Magic Formula fitted to the Calspan tyre of models/iltis.yaml by scripts/fit-tyre."""

from __future__ import annotations

import re
import runpy

import pytest

from cutjoint.model.property_file import read_properties
from tests.conftest import MODELS, ROOT

SCRIPT = runpy.run_path(str(ROOT / "scripts" / "fit-tyre"))


def coefficients() -> dict[str, float]:
    """The numbers of the file."""
    return dict(read_properties((MODELS / "iltis.tir").read_text(encoding="utf-8"), "iltis.tir", "instance 'w'").values)


def test_what_is_left_is_what_the_docs_say() -> None:
    text = (ROOT / "docs" / "models.md").read_text(encoding="utf-8")
    said = re.search(r"within ([\d.]+) % \(along\), ([\d.]+) % \(sideways\) and ([\d.]+) %", text)
    assert said is not None
    found = SCRIPT["residuals"](coefficients())
    assert [f"{100 * found[name]:.2g}" for name in ("Fx", "Fy", "Mz")] == list(said.groups())


def test_the_target_is_the_calspan_tyre() -> None:
    """By hand at 4 kN: cornering stiffness, friction and the trail at small slip."""
    motion = {name: values[:2] * 0 for name, values in SCRIPT["motions"]().items()}
    motion |= {"load": motion["load"] + 4000, "alpha": motion["alpha"] + (1e-6, 1.5)}
    found = SCRIPT["target"](motion)
    stiffness = 2625 + 14.47 * 4000 * (12930 - 4000) / 12930
    assert found["Fy"][0] == pytest.approx(-stiffness * 1e-6, rel=1e-4)
    assert found["Fy"][1] == pytest.approx(-(-4.64e-5 * 4000 + 1.216 + 2.18e-11 * 4000**2) * 1.0274 * 4000, rel=1e-9)
    assert found["Mz"][0] == pytest.approx(1.71e-5 * 4000 * stiffness * 1e-6, rel=1e-4)


def test_the_file_is_what_the_script_finds() -> None:
    """But for the last digits, which follow from libraries of linear algebra."""
    found, written = SCRIPT["fit"](), coefficients()
    for name, value in found.items():
        assert written[name] == pytest.approx(value, rel=0.01, abs=1e-3), name
