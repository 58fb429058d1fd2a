"""Draws docs/pictures/hardpoints.svg: the axle before and after examples/hardpoints.py.  Run it as
`.venv/bin/python -m docs.pictures.hardpoints`."""

from __future__ import annotations

import runpy
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib import pyplot

FILE = Path(__file__).with_name("hardpoints.svg")
EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "hardpoints.py"


def draw(first: tuple[np.ndarray, np.ndarray], last: tuple[np.ndarray, np.ndarray]) -> None:
    """Draw times and outputs, (rows) and (rows, outputs), of a run before and one after."""
    matplotlib.rcParams["svg.hashsalt"] = "cutjoint"
    figure, (above, below) = pyplot.subplots(2, 1, sharex=True, figsize=(7, 4.5), layout="constrained")
    for label, (times, values) in (("as drawn", first), ("found", last)):
        above.plot(times, np.degrees(values[:, 0]), label=label)
        below.plot(times, values[:, 2], label=label)
    above.set_ylabel("steer of the left wheel, deg")
    below.set_ylabel("chassis, m/s\N{SUPERSCRIPT TWO}")
    below.set_xlabel("t, s")
    above.legend(frameon=False)
    figure.savefig(FILE, metadata={"Date": None, "Creator": None})


if __name__ == "__main__":
    known = runpy.run_path(str(EXAMPLE))
    draw(*((known[name][2].times, known[name][2].values) for name in ("first", "last")))
