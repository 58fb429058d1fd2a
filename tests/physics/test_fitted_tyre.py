"""The tyre of models/iltis.tir: a Magic Formula fitted to the Calspan tyre of models/iltis.yaml by scripts/fit-tyre."""

from __future__ import annotations

import re
import runpy

import numpy as np
import pytest

from cutjoint.model.files.property_file import read_properties
from cutjoint.model.read import read_model_text
from cutjoint.run.simulation import simulate
from cutjoint_bench.studies.instructions import rolling_text
from tests.conftest import MODELS, ROOT
from tests.physics.simulation import compile_scene, completed

SCRIPT = runpy.run_path(str(ROOT / "scripts" / "fit-tyre"))


def coefficients() -> dict[str, float]:
    """The numbers of the file."""
    return dict(read_properties((MODELS / "iltis.tir").read_text(encoding="utf-8"), "iltis.tir", "instance 'w'").values)


def test_what_is_left_is_what_the_docs_say() -> None:
    text = (ROOT / "docs" / "evidence" / "verification.md").read_text(encoding="utf-8")
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


STOPS = """  stops:
    end: 6
    output_step: 0.001
    pose: equilibrium
    positions: {chassis_free.x: 0, chassis_free.y: 0}
    rates: {chassis_free.vx: 20%s}
    states: {%s}
    inputs: {pedal: {table: {t: [0, 0.5, 0.6, 9], value: [0, 0, 1, 1]}, interpolation: linear}}
    numerics: {penalty: 1.0e+9, dt: 0.001, integrator: trapezoidal}
"""


def test_the_iltis_brakes_to_rest_in_half_waves() -> None:
    """From 20 m/s by default: no brake's torque changes its sign more than five times while more than a thousandth of it is left."""
    corners = [f"{end}_{side}" for end in ("front", "rear") for side in ("left", "right")]
    text = rolling_text((MODELS / "iltis.yaml").read_text(encoding="utf-8"), on_wheels=True)
    text = text.replace("parameters:\n", "parameters:\n  pedal: {value: 0, binding: input}\n", 1)
    text = text.replace('drive: "where(x_hinge < 0, 60, 0)"', 'brake: "where(x_hinge < 0, 450, 900)*pedal"')
    text = text.replace("outputs: [shock.force", "outputs: [wheel.rolling.held.value, shock.force")
    rates = "".join(f", {corner}.wheel.rolling.bearing.angle_rate: 20/0.361" for corner in corners)
    text += STOPS % (rates, ", ".join(f"{corner}.wheel.rolling.rolled: 1" for corner in corners))
    model = read_model_text(text, "iltis.yaml", folder=MODELS)
    found = completed(simulate(compile_scene(model, model.scenes["stops"]), error=False))
    stops = int(np.argmax(found["chassis.vx"] < 0))
    assert 4.5 < found["t"][stops] < 4.7
    for corner in corners:
        held = found[f"{corner}.wheel.rolling.held.value"]
        changes = stops + np.flatnonzero(np.diff(np.sign(held[stops:])))
        assert 1 <= sum(np.abs(held[after + 1 :]).max() > 1e-3 for after in changes) <= 5
