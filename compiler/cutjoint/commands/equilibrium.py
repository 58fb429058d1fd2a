"""`cutjoint equilibrium`."""

from __future__ import annotations

from pathlib import Path

import click

from cutjoint.commands import options
from cutjoint.model.read import read_model
from cutjoint.report import tables
from cutjoint.states import find_equilibrium


@click.command("equilibrium")
@options.model
@options.scene
@options.changes
@options.reports_errors
def command(model: Path, scene: str | None, changes: tuple[str, ...]) -> None:
    """Find the static equilibrium of MODEL and print every element's force."""
    parameters = options.read_parameters(changes)
    if scene is None:
        scene = next(iter(read_model(model).scenes), None)
    with options.progress_bar(f"compiling {model.name}"):
        found = find_equilibrium(model, scene=scene, parameters=parameters)
    options.out.print(tables.equilibrium_table(found))
