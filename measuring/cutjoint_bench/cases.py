"""Scenes as cases to compare."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from cutjoint.model.elements.link_masses import with_link_masses
from cutjoint.model.records import Model, Output
from cutjoint.package.errors import RunError
from cutjoint.reduce.trials import exact
from cutjoint.run.run_file import make_run_file
from cutjoint.run.scenes import find_scene
from cutjoint.run.settings import PLAIN_STEPS
from cutjoint.topology.reading import read_model
from cutjoint_bench.records import Case

#: Rows of a comparison, at most; of one whose rows are given.
MOST_ROWS, MOST_GIVEN_ROWS = 2000, 1_000_000

QUANTITIES = ("x", "y", "z", "vx", "vy", "vz")


def make_case(
    path: Path, scene: str | None = None, *, end: float | None = None, row: float | None = None,
    parameters: Mapping[str, float] | None = None, link_masses: Mapping[str, float] | None = None,
) -> Case:  # fmt: skip
    """A scene of a model file, up to its end or another, with changed parameters and with rods in place of massless links.

    Rows are as far apart as the scene's output, or a multiple of that so that there are at most ``MOST_ROWS``.

    Raises:
        ModelError, RunError: the file is wrong, or has no such scene or parameter; no run is that long, or has such rows.
    """
    model = with_link_masses(read_model(path), link_masses or {})
    chosen = find_scene(model, scene)
    until = chosen.end if end is None else end
    apart = make_rows(chosen.output_step, until) if row is None else row
    if row is not None and not apart <= until <= apart * MOST_GIVEN_ROWS:
        raise RunError(f"rows {apart:g} s apart do not suit a run of {until:g} s: one at least, {MOST_GIVEN_ROWS} at most")
    scene_to_run = replace(chosen, end=until, output_step=apart)
    make_run_file(model, scene_to_run, parameters or {}, task="simulate", options=PLAIN_STEPS)
    return Case(model=model, scene=scene_to_run, outputs=_outputs(model), parameters=dict(parameters or {}))


def make_rows(step: float, end: float, most: int = MOST_ROWS) -> float:
    """The distance in s of rows, a multiple of ``step`` so that there are at most so many up to the end."""
    multiple = 1
    while end / (multiple * step) > most:
        multiple *= 2
    return float(multiple * exact(step))


def _outputs(model: Model) -> tuple[Output, ...]:
    """Places and velocities of the bodies that have a mass."""
    return tuple(Output(element=b.name, quantity=q, span=b.span) for b in model.bodies if b.mass != 0 for q in QUANTITIES)


def falling_steps(row: float, largest: float, smallest: float) -> list[float]:
    """Steps between two limits that share most rows: three a decade, whole fractions of ``row`` or multiples of it."""
    unit = exact(row)
    longer = [unit * k for k in (50, 20, 10, 5, 2)]
    shorter = [unit / k for k in (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000)]
    return [float(s) for s in (*longer, *shorter) if smallest * 0.999 <= s <= largest * 1.001]
