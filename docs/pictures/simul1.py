"""Draws docs/pictures/simul1.png: the Iltis up a ramp and down five steps.  Run it as `.venv/bin/python docs/pictures/simul1.py`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from cutjoint.compile.pipeline import compile_model
from cutjoint.run.results import Trajectory
from cutjoint.run.roads import profile_pieces
from cutjoint.run.simulation import simulate

FOLDER = Path(__file__).resolve().parent
MODEL = FOLDER.parent.parent / "models" / "iltis.yaml"
STEP = 0.001
WHEELS = {"front": ("front_left", 0.970, "#c1440e"), "rear": ("rear_left", -1.047, "#1f5f8b")}  # place before the centre of mass, m
ROAD, CHASSIS = "#b9b2a5", "#222222"


def main() -> None:
    """Run the scene and write the picture."""
    artifact = compile_model(MODEL, scene="simul1")
    artifact = replace(artifact, scene=replace(artifact.scene, output_step=STEP))
    run = simulate(artifact, dt=STEP)
    figure = Figure(figsize=(8, 6.2), layout="constrained")
    FigureCanvasAgg(figure)
    height, acceleration, loads = figure.subplots(3, 1, sharex=True, height_ratios=(3, 2, 2))
    draw_height(height, run, artifact.scene.road.left, artifact.scene.road.start)
    draw_acceleration(acceleration, run)
    draw_loads(loads, run)
    loads.set_xlim(5, 36)
    loads.set_xlabel("x, m")
    for panel in (height, acceleration, loads):
        panel.grid(visible=True, linewidth=0.3)
        panel.spines[["top", "right"]].set_visible(False)
    figure.suptitle("Iltis, scene simul1: 5 m/s up a ramp and down five steps", fontsize="medium")
    figure.savefig(FOLDER / "simul1.png", dpi=100, metadata={"Software": None})


def draw_height(panel: Axes, run: Trajectory, segments: tuple, start: float) -> None:
    """Centre of mass over the road."""
    pieces = profile_pieces(segments, start)
    x = np.arange(0.0, 50.0, 0.005)
    road = [next((p for p in reversed(pieces) if p.begin <= at), pieces[0]).height(at) for at in x]
    panel.fill_between(x, road, -0.3, color=ROAD, linewidth=0, label="road")
    panel.plot(run["chassis.x"], run["chassis.z"], color=CHASSIS, linewidth=1.2, label="chassis, centre of mass")
    panel.set_ylim(-0.3, 2.2)
    panel.set_ylabel("height, m")
    panel.legend(loc="upper left", frameon=False, fontsize="small")


def draw_acceleration(panel: Axes, run: Trajectory) -> None:
    """Vertical acceleration of the centre of mass."""
    panel.plot(run["chassis.x"], run["chassis.az"] / 9.81, color=CHASSIS, linewidth=0.9)
    panel.axhline(-1, color=CHASSIS, linewidth=0.6, linestyle=":")
    panel.text(5.2, -0.9, "free fall", fontsize="x-small", verticalalignment="bottom")
    panel.set_ylabel("vertical\nacceleration, g")


def draw_loads(panel: Axes, run: Trajectory) -> None:
    """Loads of the left wheels, each over its own place."""
    for name, (corner, ahead, colour) in WHEELS.items():
        panel.plot(
            run["chassis.x"] + ahead, run[f"{corner}.tyre.Fz"] / 1e3, color=colour, linewidth=0.9, label=f"{name}, over the wheel's x"
        )
    panel.set_ylim(0, None)
    panel.set_ylabel("load of a left\nwheel, kN")
    panel.legend(loc="upper left", frameon=False, fontsize="small")


if __name__ == "__main__":
    main()
