"""Tangents of systems whose laws see signals, states, samples, a function and friction by loads, against differences in 113 bits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cutjoint.methods import METHODS
from tests.conftest import needs_cpp, with_heavy
from tests.mechanisms.seeing import SOFT_IN_QUADS, seeing

from .c_exports import folder_of_model, in_quads, run, write

pytestmark = needs_cpp

#: States of the model, besides those of friction.
STATES = 2


@pytest.mark.parametrize("method", with_heavy([m for m in METHODS if METHODS[m].has_system], "augmented", "classical"))
def test_tangents_are_differences(method: str, tmp_path: Path) -> None:
    model = seeing(method, closed=True)
    place = write(folder_of_model(model, method=method), tmp_path)
    output = run(in_quads(place, "seeing", "tangents", SOFT_IN_QUADS if model.functions else ""), "50").split()
    rows, n, m = map(int, output[:3])
    numbers = np.array(output[3:], dtype=float)
    parts = np.split(numbers, np.cumsum([rows**2, n**2]))
    tangent, balance, J = (part.reshape(-1, size) for part, size in zip(parts, (rows, n, n), strict=True))
    free = np.eye(rows)
    if method == "recursive-newton":  # multipliers turn with what carries the loop: see `tests/formulate/test_implicit.py`
        free = np.linalg.svd(J)[2][m:]
    elif method == "augmented":  # has half of what one does to the other, and of states their own rates
        own = np.diag(np.diag(balance)[-STATES:])
        balance = (balance + balance.T) / 2 + J.T @ J
        balance[-STATES:], balance[:, -STATES:] = 0, 0
        balance[-STATES:, -STATES:] = own
    else:
        balance = np.block([[balance, J.T], [J, np.zeros((m, m))]])
    assert len(free) == rows - (m if method == "recursive-newton" else 0)
    assert np.abs(balance).max() > 5
    assert np.abs(free @ (tangent - balance)).max() < 1e-14 * np.abs(balance).max()
