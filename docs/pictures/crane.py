"""Draws docs/pictures/crane.svg: the motion that examples/crane.py finds.  Run it as `.venv/bin/python -m docs.pictures.crane`."""

from __future__ import annotations

import runpy
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib import pyplot

FILE = Path(__file__).with_name("crane.svg")
EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "crane.py"


def draw(times: np.ndarray, forces: np.ndarray, at: np.ndarray, values: np.ndarray) -> None:
    """Draw forces (N) at times (s), and rows of the cart's place (m), its speed and the rope's angle (rad) at others."""
    matplotlib.rcParams["svg.hashsalt"] = "cutjoint"
    figure, (above, below) = pyplot.subplots(2, 1, sharex=True, figsize=(7, 4.5), layout="constrained")
    above.plot(times, forces, marker=".", markersize=3)
    above.set_ylabel("force on the cart, N")
    below.plot(at, values[:, 0], label="cart, m")
    below.plot(at, values[:, 0] - np.sin(values[:, 2]), label="load, m")
    below.set_xlabel("t, s")
    below.legend(frameon=False)
    figure.savefig(FILE, metadata={"Date": None, "Creator": None})


if __name__ == "__main__":
    known = runpy.run_path(str(EXAMPLE))
    sim, steps = known["sim"], known["STEPS"]
    sim.reset(dt=known["LONG"] / steps)
    trajectory = {"t": known["times"], "value": known["found"].x, "interpolation": "linear"}
    found = sim.forward_sensitivities(steps, known["ENDS"], [], inputs={"push": trajectory})
    draw(known["times"], known["found"].x, found.times, found.values)
