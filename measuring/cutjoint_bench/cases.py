"""Scenes as cases to compare."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from cutjoint.model.elements.link_masses import with_link_masses
from cutjoint.model.expressions.quantities import unit_of
from cutjoint.model.expressions.units import PLACES
from cutjoint.model.records import Model, Output, Scene
from cutjoint.package.errors import RunError
from cutjoint.run.run_file import make_run_file
from cutjoint.run.scenes import find_case
from cutjoint.run.settings import PLAIN_STEPS
from cutjoint.topology.reading import read_model
from cutjoint_bench.records import Case
from cutjoint_bench.steps import exact

#: Rows of a comparison, at most; of one whose rows are given.
MOST_ROWS, MOST_GIVEN_ROWS = 2000, 1_000_000

QUANTITIES = ("x", "y", "z", "vx", "vy", "vz")


def make_case(
    path: Path, scene: str | None = None, *, end: float | None = None, row: float | None = None,
    parameters: Mapping[str, float] | None = None, link_masses: Mapping[str, float] | None = None, watched: bool = False,
) -> Case:  # fmt: skip
    """A scene of a model file, up to its end or another, with changed parameters and with rods in place of massless links.

    Rows are as far apart as the scene's output, or a multiple of that so that there are at most ``MOST_ROWS``.  If ``watched``, the
    scene's own outputs that are places or angles are compared too, and the case has the command line that simulates it.

    Raises:
        ModelError, RunError: the file is wrong, or has no such scene or parameter; no run is that long, or has such rows.
    """
    model, chosen = find_case(with_link_masses(read_model(path), link_masses or {}), scene)
    until = chosen.end if end is None else end
    apart = make_rows(chosen.output_step, until) if row is None else row
    if row is not None and not apart <= until <= apart * MOST_GIVEN_ROWS:
        raise RunError(f"rows {apart:g} s apart do not suit a run of {until:g} s: one at least, {MOST_GIVEN_ROWS} at most")
    scene_to_run = replace(chosen, end=until, output_step=apart)
    make_run_file(model, scene_to_run, parameters or {}, task="simulate", options=PLAIN_STEPS)
    case = Case(model=model, scene=scene_to_run, outputs=outputs_of_bodies(model), parameters=dict(parameters or {}))
    if not watched:
        return case
    places = {o: PLACES[unit] for o in chosen.outputs if (unit := unit_of(model, o)) in PLACES}
    known = {o.column for o in case.outputs}
    return replace(
        case, outputs=(*case.outputs, *(o for o in places if o.column not in known)), watched={o.column: x for o, x in places.items()},
        command="" if link_masses else _command(path, chosen, bool(model.scenes), end, parameters or {}),
    )  # fmt: skip


def _command(path: Path, scene: Scene, named: bool, end: float | None, parameters: Mapping[str, float]) -> str:
    """The start of a command line; a scene is ``named`` if the model has any."""
    wanted = [("--scene", scene.name)] if named else []
    wanted += [] if end is None else [("--end", repr(end))]
    wanted += [("--set", f"{name}={value!r}") for name, value in parameters.items()]
    return shlex.join(["cutjoint", "simulate", str(path), *(word for pair in wanted for word in pair)])


def make_rows(step: float, end: float, most: int = MOST_ROWS) -> float:
    """The distance in s of rows, a multiple of ``step`` so that there are at most so many up to the end."""
    multiple = 1
    while end / (multiple * step) > most:
        multiple *= 2
    return float(multiple * exact(step))


def outputs_of_bodies(model: Model) -> tuple[Output, ...]:
    """Places and velocities of the bodies that have a mass."""
    return tuple(Output(element=b.name, quantity=q, span=b.span) for b in model.bodies if b.mass != 0 for q in QUANTITIES)


def falling_steps(row: float, largest: float, smallest: float) -> list[float]:
    """Steps between two limits that share most rows: three a decade, whole fractions of ``row`` or multiples of it."""
    unit = exact(row)
    longer = [unit * k for k in (50, 20, 10, 5, 2)]
    shorter = [unit / k for k in (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000)]
    return [float(s) for s in (*longer, *shorter) if smallest * 0.999 <= s <= largest * 1.001]
