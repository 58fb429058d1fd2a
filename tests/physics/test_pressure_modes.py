"""Modes of a mass on an oil column: states of a million in SI units hide neither slow eigenvalues nor the mass that moves."""

from __future__ import annotations

import numpy as np
import pytest

import cutjoint
from cutjoint.topology.reading import read_model_text

_MASS, _AREA, _SPRING, _BULK, _LEAK, _FLOW = 1000.0, 2e-3, 1e3, 8e11, 1e-12, 5e-6


def _text(nominal: str, start: str) -> str:
    return f"""
cutjoint: 1
name: column
gravity: [0, 0, -9.81]
bodies: {{a: {{mass: {_MASS}, centre_of_mass: [0, 0, 0]}}}}
joints: {{s: {{kind: prismatic, bodies: [ground, a], at: [0, 0, 0], axis: z, spring: {{stiffness: {_SPRING}, damping: 0}}}}}}
states: {{p: {{start: 0 Pa, rate: "{_BULK}*({_FLOW} - {_LEAK}*p - {_AREA}*s.displacement_rate)"{nominal}}}}}
forces: {{piston: {{kind: joint_force, joint: s, law: {_AREA}*p}}}}
scenes: {{rest: {{end: 1{start}}}}}
"""


@pytest.mark.parametrize("nominal", ["", ", nominal: 50 bar"])
def test_a_slow_leak_is_no_eigenvalue_of_zero(nominal: str) -> None:
    found = cutjoint.find_modes(read_model_text(_text(nominal, ", trim: {}"), "column.yaml"))
    matrix = [[0, 1, 0], [-_SPRING / _MASS, 0, 1e6 * _AREA / _MASS], [0, -1e-6 * _BULK * _AREA, -_BULK * _LEAK]]  # p in MPa
    expected = sorted(np.linalg.eigvals(np.array(matrix, dtype=float)), key=abs)[:2]  # type: ignore[arg-type]
    assert found.zeros == 0
    assert not found.rigid_body_modes
    slow, swing = found.modes
    assert slow.eigenvalue == pytest.approx(expected[0].real, rel=1e-9)
    assert swing.eigenvalue.real == pytest.approx(expected[1].real, rel=1e-9)
    assert swing.eigenvalue.imag == pytest.approx(abs(expected[1].imag), rel=1e-12)
    assert max(slow.shape, key=lambda name: slow.shape[name].share) == "p.value"
    assert max(swing.shape, key=lambda name: swing.shape[name].share) == "s.displacement"


def test_a_pressure_has_its_static_equilibrium() -> None:
    """Flow through the leak: 5 MPa, from a start at 0, in steps of the nominal value; without it the search ends at a few pascals."""
    text = _text(", nominal: 50 bar", "").replace(f"stiffness: {_SPRING}", "stiffness: 1e5")
    found = cutjoint.find_equilibrium(read_model_text(text, "column.yaml")).values
    assert found["p.value"] == pytest.approx(_FLOW / _LEAK, rel=1e-9)
    assert found["a.z"] == pytest.approx((_AREA * _FLOW / _LEAK - 9.81 * _MASS) / 1e5, rel=1e-9)
