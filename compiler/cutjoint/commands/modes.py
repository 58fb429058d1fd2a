"""`cutjoint modes`."""

from __future__ import annotations

from pathlib import Path

import click

from cutjoint.commands import options
from cutjoint.report.modes import mode_tables, modes_json
from cutjoint.run.outputs import require_apart
from cutjoint.run.result_files import write_whole
from cutjoint.run.scenes import find_scene
from cutjoint.tasks.states import find_scene_modes
from cutjoint.topology.reading import read_model
from cutjoint.view.states import show_modes
from cutjoint.view.views import require_view, write_shown


@click.command("modes")
@options.model
@click.option("--scene", metavar="NAME",
              help="Scene of the model file; the first otherwise. With --at it may be left out if there is only one.")
@click.option("--at", type=options.Setting("at"), metavar="T",
              help="Linearise about the scene's motion at T seconds; otherwise about the static equilibrium.")
@options.changes
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), help="JSON file for all numbers.")
@options.view("that moves in each mode")
@options.reports_errors
def command(model: Path, scene: str | None, at: float | None, changes: tuple[str, ...], out: Path | None, view: Path | None) -> None:
    """Linearise MODEL and print eigenvalues, frequencies, damping and mode shapes."""
    require_apart({"the model": model}, documents=[("--out", out), ("--view", view)])
    if view is not None:
        require_view(view, "--view")
    checked = read_model(model)
    chosen = options.take_scene(checked, scene) if at is None else find_scene(checked, scene)
    parameters = options.read_parameters(changes)
    with options.progress_bar(f"linearising {model.name}") as progress:
        found = find_scene_modes(checked, chosen, at=at, parameters=parameters, progress=progress)
    for table in mode_tables(found):
        options.console_beside(out).print(table)
    if out is not None:
        write_whole(out, modes_json(found, checked.name, chosen.name))
    if view is not None:
        with options.progress_bar(f"drawing {model.name}"):
            write_shown(view, show_modes(checked, chosen, parameters, found))
        options.console_beside(out, view).print(f"view: {view}", markup=False)
