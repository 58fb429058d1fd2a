"""Shares of 60 hardpoint coordinates in the variance of a toe gradient: first order beside Monte Carlo, and the CPU time of both.

Central differences stand beside derivatives, by extrapolation from steps of half the size (Richardson).

    .venv/bin/python -m cutjoint_bench.studies.tolerances [--runs 400] [--points 3]

Each coordinate has a standard deviation of 0.3 mm.  Shares of the Monte Carlo runs are those of a least-squares plane through them; what
the plane leaves of the variance is printed too.  The time of 100 000 runs follows from that of those made.
"""

import argparse
import json
from pathlib import Path
from time import process_time

import numpy as np

from cutjoint.sweeps.designs import STEP
from cutjoint.sweeps.reading import read_study_text
from cutjoint.sweeps.tasks import Tasks

_MODEL = Path(__file__).resolve().parents[3] / "models" / "axle.yaml"
_POINTS = ("LF", "LR", "LB", "UF", "UR", "UB", "TI", "TO", "W", "PO")
_MANY = 100_000


def main() -> None:
    """Print shares, their largest difference and times."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=400)
    parser.add_argument("--points", type=int, default=3)
    asked = parser.parse_args()
    kinematics = {"kinematics": {"travel": "10 mm", "points": asked.points}}
    study = read_study_text(json.dumps({
        "cutjoint_study": 1, "model": str(_MODEL), "scenes": ["bump"], "tunable": [f"*.{p}.*" for p in _POINTS],
        "parameters": {f"{side}.{p}": {"normal": "0.3 mm"} for side in ("left", "right") for p in _POINTS},
        "design": {"tolerances": asked.runs, "seed": 1}, "objectives": {"gradient": {"slope": "left.toe", "of": kinematics}},
    }), "study")  # fmt: skip
    tasks = Tasks(study)

    def perform(values: np.ndarray) -> tuple[np.ndarray, float]:
        begin = process_time()
        found = np.array([tasks.find(0, row)[0] for row in values])
        return found, process_time() - begin

    drawn, spent = perform(study.values[: asked.runs])
    beside, spent_beside = perform(study.values[asked.runs :])
    steps = (study.values[asked.runs + 2 :: 2] - study.values[asked.runs + 1 :: 2]).diagonal()
    deviations = steps / (2 * STEP)
    means = study.values[asked.runs]
    halves, _ = perform(means + (study.values[asked.runs + 1 :] - means) / 2)
    coarse, fine = (of[1::2] - of[::2] for of in (beside[1:], halves))
    exact = (4 * 2 * fine - coarse) / 3  # of the change over a step
    by_differences, by_derivatives = (of**2 * deviations**2 / steps**2 for of in (coarse, exact))
    print(f"central differences off derivatives by {np.abs(coarse - exact).max() / np.abs(exact).max():.1e} of the largest; shares by "
          f"{np.abs(by_differences / by_differences.sum() - by_derivatives / by_derivatives.sum()).max():.1e}")  # fmt: skip
    parts = ((beside[2::2] - beside[1::2]) / steps * deviations) ** 2
    plane = np.column_stack([np.ones(asked.runs), study.values[: asked.runs] - study.values[asked.runs]])
    fitted = np.linalg.lstsq(plane, drawn, rcond=None)[0]
    left = drawn - plane @ fitted
    by_runs = (fitted[1:] * deviations) ** 2 / np.sum((fitted[1:] * deviations) ** 2)
    shares = parts / parts.sum()
    for i in np.argsort(-shares)[:6]:
        print(f"{study.variables[i].name}: first order {shares[i]:.4f}, Monte Carlo {by_runs[i]:.4f}")
    print(f"{len(shares)} variables, largest difference of shares {np.abs(shares - by_runs).max():.1e}")
    print(f"standard deviation: first order {np.sqrt(parts.sum()):.5g}, Monte Carlo {drawn.std(ddof=1):.5g} rad/m, {asked.runs} runs")
    print(f"left of the variance by the plane: {left.var() / drawn.var():.1e}")
    whole = spent / asked.runs * _MANY
    print(f"first order {spent_beside:.1f} s, a run {spent / asked.runs:.3f} s; {_MANY} runs take {whole / spent_beside:.0f} times as long")


if __name__ == "__main__":
    main()
