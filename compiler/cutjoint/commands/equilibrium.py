"""`cutjoint equilibrium`."""

from __future__ import annotations

from pathlib import Path

import click

from cutjoint.commands import options
from cutjoint.report import tables
from cutjoint.states import find_equilibrium
from cutjoint.topology.reading import read_model


@click.command("equilibrium")
@options.model
@options.some_scene
@options.changes
@options.reports_errors
def command(model: Path, scene: str | None, changes: tuple[str, ...]) -> None:
    """Find the static equilibrium of MODEL and print every element's force."""
    parameters = options.read_parameters(changes)
    checked = read_model(model)
    chosen = options.take_scene(checked, scene)
    with options.progress_bar(f"compiling {model.name}"):
        found = find_equilibrium(model, scene=chosen.name if checked.scenes else None, parameters=parameters)
    options.out.print(tables.equilibrium_table(found))
