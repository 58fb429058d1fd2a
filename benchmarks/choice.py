"""What `method: auto` picks beside the best of an exhaustive search: `make choice`.

The search tries every rung of every method with steps that fall by 9 %, where the choice tries the last rung of each kind of motion with
steps that fall by a factor of 1.4.  Both measure against the same truth and are timed in one run, in turns.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from rich.console import Console
from rich.table import Table

from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model
from cutjoint.model.records import Model, Scene
from cutjoint.pipeline import METHODS, compile_scene, find_scene
from cutjoint.reduce.choose import Candidate, choose, find_truth, try_rung
from cutjoint.reduce.ladder import Rung, climb
from cutjoint.reduce.measure import time_run
from cutjoint.run.run_file import RunError

MODELS = Path(__file__).resolve().parent.parent / "models"

#: Model, scene (the only one of its model where there is none), tolerance in m and rad.
SCENES = (
    ("pendulum", None, 1e-3), ("four_bar", None, 1e-3), ("slider_crank", None, 1e-3), ("flyball", None, 1e-4),
    ("iltis", "iavsd_inphase_5", 1e-3), ("iltis", "simul2", 1e-2),
)  # fmt: skip

FINE = 2**0.125


def main() -> None:
    """Print a row for each scene."""
    table = Table(title="method auto beside an exhaustive search", title_justify="left", box=None)
    for heading in ("scene", "tolerance", "picked", "ms", "best of all", "ms", "ratio"):
        table.add_column(heading, justify="left")
    for name, scene, tolerance in SCENES:
        model = read_model(MODELS / f"{name}.yaml")
        wanted = replace(find_scene(model, scene), method="auto", tolerance=tolerance)
        table.add_row(*_compared(model, wanted))
    Console(highlight=False, width=160).print(table)


def _compared(model: Model, scene: Scene) -> tuple[str, ...]:
    picked = choose(model, scene).picked
    best = min((c for c in _search(model, scene) if not c.failure), key=lambda c: c.seconds)
    times = [min(_seconds(model, scene, c) for _ in range(3)) for c in (picked, best)]
    words = [f"{c.method}, {c.rung}, {1e3 * c.dt:.3g} ms" for c in (picked, best)]
    name = f"{model.name} {scene.name}"
    return name, f"{scene.tolerance:g}", words[0], f"{1e3 * times[0]:.3g}", words[1], f"{1e3 * times[1]:.3g}", f"{times[0] / times[1]:.2f}"


def _search(model: Model, scene: Scene) -> Iterator[Candidate]:
    truth = find_truth(model, scene, {})
    for method in METHODS:
        try:
            rungs = climb(model, scene, method, approximate=True)
        except (ModelError, RunError):
            continue
        for rung in rungs:
            yield try_rung(rung, scene, {}, truth, ratio=FINE)


def _seconds(model: Model, scene: Scene, candidate: Candidate) -> float:
    rung: Rung = next(r for r in climb(model, scene, candidate.method, approximate=True) if r.name == candidate.rung)
    return time_run(compile_scene(rung.model, rung.scene, method=candidate.method), candidate.dt).seconds


if __name__ == "__main__":
    main()
