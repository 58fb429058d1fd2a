"""Systems of mass points, written by hand in C++ (tests/runtime/lagrangian), run by the driver of the Lagrangian methods."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeAlias

import jinja2
import numpy as np

from cutjoint.emit.source import Source
from cutjoint.package.locations import templates_folder
from cutjoint.run.results import read_table
from cutjoint.toolchain.build import build
from cutjoint.toolchain.drivers import Kind
from cutjoint_bench.driver import ADDED_SOLVERS, ALL_SOLVERS
from cutjoint_bench.examine import with_files
from tests.physics.simulation import is_generated

SOURCES = Path(__file__).with_name("lagrangian")
FILES = ("main.cpp", "nothing.hpp", "point_system.cpp", "point_system.hpp")

GRAVITY = 9.81

AUGMENTED, CLASSICAL = "augmented", "classical"
METHODS = (AUGMENTED, CLASSICAL)

#: Solvers by the method whose matrix they can factor; those of cutjoint-bench, whose driver is another one, in `make full`.
ADDED = ADDED_SOLVERS if is_generated() else ()
SOLVERS = {AUGMENTED: ("emitted", *ADDED), CLASSICAL: ("emitted", *(s for s in ADDED if not ALL_SOLVERS[s].symmetric))}

NUMERICS: Mapping[str, Any] = {
    "dt": 1e-3, "penalty": 1e9, "tolerance": 1e-8, "iterations": 50, "multiplier_updates": 4, "fixed_cost": False, "events": None,
    "absolute_tolerance": None, "spectral_radius": None,
}  # fmt: skip
STABILISATION = {"closure": "penalty", "penalty": 1e9, "damping_ratio": 1.0, "frequency": 10.0}

#: A point by its index, or a place.
End: TypeAlias = int | Mapping[str, Any]


@cache
def points_source() -> Source:
    """The simulator of all systems, as the compiler would hand it on."""
    files = {name: (SOURCES / name).read_text(encoding="utf-8") for name in FILES}
    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(templates_folder()), undefined=jinja2.StrictUndefined, trim_blocks=True)
    view = {"banner_hash": "# points", "stem": "points", "start_sources": ["point_system.cpp"], "sources": [], "large_sources": [],
            "driver": "lagrangian"}  # fmt: skip
    files["CMakeLists.txt"] = environment.get_template("CMakeLists.txt.jinja").render(view)
    return with_files(Source(stem="points", files=files, digest="", driver="lagrangian"), {})


def simulator(additions: tuple[str, ...] = ADDED) -> Path:
    """The simulator with solvers of other packages; by default the one that has all `SOLVERS`."""
    return build(points_source(), kind=Kind(additions=additions)).path


@dataclass(frozen=True)
class PointRun:
    """Results of a run: columns by name, one row a step of measurements, and the summary."""

    t: np.ndarray
    columns: Mapping[str, np.ndarray]
    steps: Mapping[str, np.ndarray]
    summary: Mapping[str, Any]

    def __getitem__(self, column: str) -> np.ndarray:
        return self.columns[column]

    def vectors(self, kind: str = "") -> np.ndarray:
        """Places (or rates "v", accelerations "a") of all points, (rows, 3 points)."""
        return np.stack([x for name, x in self.columns.items() if name.partition(".")[2] in [kind + axis for axis in "xyz"]], axis=1)


def start(folder: Path, run_file: Mapping[str, Any], binary: Path | None = None) -> subprocess.CompletedProcess[str]:
    """The simulator's process on a run file."""
    path = folder / "run.json"
    path.write_text(json.dumps(run_file), encoding="utf-8")
    return subprocess.run([binary or simulator(), path], capture_output=True, text=True, check=False)


def run_file(system: Mapping[str, Any], task: str, *, numerics: Mapping[str, Any] | None = None, **more: Any) -> dict[str, Any]:
    """A run file with the settings of most tests."""
    settings = {**NUMERICS, **(numerics or {})}
    return {
        "model": system, "task": task, "parameters": {}, "roads": {}, "numerics": settings, "stabilisation": STABILISATION,
        "integrator": "trapezoidal", "solver": "emitted", "pose": "design", "positions": {}, "rates": {}, "end": 1.0,
        "output_step": settings["dt"], **more,
    }  # fmt: skip


def summary_of(folder: Path, file: Mapping[str, Any]) -> dict[str, Any]:
    """The summary of a task."""
    done = start(folder, file)
    assert done.returncode in (0, 1), done.stderr
    summary: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return summary


def simulate(
    folder: Path, system: Mapping[str, Any], method: str, *, end: float = 1.0, solver: str = "", output_step: float = 0.0, **numerics: Any
) -> PointRun:
    """Simulate a system, whether or not it comes to its end."""
    more: dict[str, Any] = {"end": end, "out": str(folder / "table.csv"), "steps_out": str(folder / "steps.csv")}
    more |= {"solver": solver} if solver else {}
    more |= {"output_step": output_step} if output_step else {}
    for name in ("table.csv", "steps.csv"):
        (folder / name).write_text("t\n")
    summary = summary_of(folder, run_file({**system, "method": method}, "simulate", numerics=numerics, **more))
    t, columns = read_table(folder / "table.csv")
    steps_t, steps = read_table(folder / "steps.csv")
    return PointRun(t, columns, {"t": steps_t, **steps}, summary)


def completed(folder: Path, system: Mapping[str, Any], method: str, **more: Any) -> PointRun:
    """Simulate a system to its end."""
    run = simulate(folder, system, method, **more)
    assert run.summary["status"] == "done", run.summary
    return run


def point(mass: float, at: Sequence[float], rate: Sequence[float] = (0, 0, 0)) -> dict[str, Any]:
    """A mass point at its start."""
    return {"mass": mass, "at": list(at), "rate": list(rate)}


def pivot(*at: float, swing: Sequence[float] = (0, 0, 0), rate: float = 0.0) -> dict[str, Any]:
    """A place that is given, at + swing sin(rate t)."""
    return {"at": list(at), "swing": list(swing), "rate": rate}


def distance(a: End, b: End, length: float) -> dict[str, Any]:
    """An equation that keeps two ends apart."""
    return {"a": a, "b": b, "length": length}


def plane(a: End, normal: Sequence[float], through: End) -> dict[str, Any]:
    """An equation that keeps an end on a plane."""
    return {"a": a, "b": through, "normal": list(normal)}


ORIGIN = pivot(0, 0, 0)

#: A plane pendulum of length 1, from a horizontal start.
PENDULUM = {"points": [point(2.0, (1, 0, 0))], "equations": [distance(0, ORIGIN, 1.0), plane(0, (0, 1, 0), ORIGIN)]}

#: A plane pendulum on a pivot that swings sideways.
DRIVEN = pivot(0, 0, 0, swing=(0.2, 0, 0), rate=5.0)
DRIVEN_PENDULUM = {
    "points": [point(2.0, (1, 0, 0), (1.0, 0, 0))],
    "equations": [distance(0, DRIVEN, 1.0), plane(0, (0, 1, 0), ORIGIN)],
}

#: Two points that swing in space, the second on the first.
DOUBLE_PENDULUM = {
    "points": [point(1.5, (1, 0, 0), (0, 0.5, 0.3)), point(0.5, (1, 1, 0), (0.4, 0.5, -0.6))],
    "equations": [distance(0, ORIGIN, 1.0), distance(1, 0, 1.0)],
}

#: A point on a line that rises by 3 in 4, on a spring and damper without a length.
SLIDER = {
    "points": [point(2.0, (0.8, 0, 0.6))],
    "equations": [plane(0, (0, 1, 0), ORIGIN), plane(0, (-0.6, 0, 0.8), ORIGIN)],
    "springs": [{"a": 0, "b": ORIGIN, "stiffness": 50.0, "damping": 1.2}],
}


def four_bar(loops: int, rate: float) -> dict[str, Any]:
    """Cranks of length 1 side by side, upright, joined by couplers of length 1: a loop's equations depend on each other when cranks lie."""
    planes = [plane(i, (0, 1, 0), ORIGIN) for i in range(loops + 1)]
    cranks = [distance(i, pivot(i, 0, 0), 1.0) for i in range(loops + 1)]
    couplers = [distance(i, i + 1, 1.0) for i in range(loops)]
    return {"points": [point(1.0 + i, (i, 0, 1), (-rate, 0, 0)) for i in range(loops + 1)], "equations": [*planes, *cranks, *couplers]}


def redundant(system: Mapping[str, Any]) -> dict[str, Any]:
    """The system with its first equation twice."""
    return {**system, "equations": [*system["equations"], system["equations"][0]]}
