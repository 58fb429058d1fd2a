"""Time of the Iltis's frequency response on four posts, at 500 frequencies for 20 outputs, after its linearisation.

    .venv/bin/python -m cutjoint_bench.studies.response [--repetitions 20]

Each call evaluates a model of its own, which has no number from an earlier one.  The largest difference from a solution in 50 digits is
relative to each entry.
"""

import argparse
from pathlib import Path
from time import perf_counter, process_time

import mpmath
import numpy as np

import cutjoint
from cutjoint.stepping.state_space import StateSpace

_MODEL = Path(__file__).resolve().parents[3] / "models" / "iltis.yaml"
_POSTS = tuple(f"{axle}_{side}.tyre.terrain_height" for axle in ("front", "rear") for side in ("left", "right"))
_OUTPUTS = (
    *(f"chassis.{name}" for name in ("x", "y", "z", "roll", "pitch", "yaw", "vx", "vy", "vz", "ax", "ay", "az")),
    *(f"{axle}_{side}.{name}" for axle in ("front", "rear") for side in ("left", "right") for name in ("tyre.Fz", "shock.force")),
)


def exactly(near: StateSpace, s: complex) -> np.ndarray:
    """The transfer matrix in 50 digits."""
    mpmath.mp.dps = 50
    at = mpmath.mpc(s)
    A, B, C, D = (mpmath.matrix(of.tolist()) for of in (near.A, near.B, near.C, near.D))
    rates, accelerations = (mpmath.matrix(of.tolist()) for of in (near.B_rate, near.B_acceleration))
    more = mpmath.matrix(near.D_rate.tolist()) * at + mpmath.matrix(near.D_acceleration.tolist()) * at**2
    right, left = B + rates * at + accelerations * at**2, mpmath.eye(len(near.A)) * at - A
    states = mpmath.matrix(len(near.A), len(near.inputs))
    for j in range(len(near.inputs)):
        states[:, j] = mpmath.lu_solve(left, right[:, j])
    return np.array((C * states + D + more).tolist(), dtype=np.complex128)


def main() -> None:
    """Print times and the largest error."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repetitions", type=int, default=20)
    asked = parser.parse_args()
    found = cutjoint.find_linear_model(_MODEL, scene="iavsd_equilibrium", terrain=["*"], inputs=list(_POSTS), outputs=list(_OUTPUTS))
    assert isinstance(found, StateSpace)
    frequencies, times = np.geomspace(0.1, 50.0, 500), []
    for _ in range(asked.repetitions):
        near, wall, cpu = found.choose(), perf_counter(), process_time()
        response = near.frequency_response(frequencies)
        times.append((1e3 * (perf_counter() - wall), 1e3 * (process_time() - cpu)))
    (wall, cpu), shape = np.median(times, axis=0), response.values.shape
    print(f"{shape[0]} frequencies, {shape[2]} inputs, {shape[1]} outputs, {len(found.A)} states")
    print(f"{cpu:.1f} ms CPU, {wall:.1f} ms wall, medians of {asked.repetitions}")
    worst = 0.0
    for i in range(0, 500, 50):
        expected = exactly(found, 2j * np.pi * frequencies[i])
        worst = max(worst, float(np.abs(response.values[i] / expected - 1).max()))
    print(f"largest difference from 50 digits: {worst:.1e} of an entry")


if __name__ == "__main__":
    main()
