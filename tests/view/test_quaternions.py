"""Quaternions of rotations that turn on and on."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from cutjoint.view.motions import quaternions_of


def test_neighbours_are_on_the_same_side_over_several_turns() -> None:
    """Matrices of SciPy, of two and a half turns about a skew axis, in steps of a tenth of a radian."""
    turns = Rotation.from_rotvec(np.linspace(0, 5 * np.pi, 158)[:, np.newaxis] * np.array([0.36, 0.48, 0.8]))
    found = quaternions_of(turns.as_matrix())
    assert np.abs(Rotation.from_quat(found).as_matrix() - turns.as_matrix()).max() < 1e-14
    assert np.linalg.norm(np.diff(found, axis=0), axis=1).max() < 0.051  # half of each turn; from side to side it would be 2
