"""`cutjoint compile`."""

from __future__ import annotations

from pathlib import Path

import click

from cutjoint.commands import options
from cutjoint.emit.standalone import INTEGRATORS_OF_CORE
from cutjoint.pipeline import compile_model


@click.command("compile")
@options.model
@options.scene
@options.method
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), required=True, help="Folder for the C++ and the simulator.")
@click.option("--integrator", type=click.Choice(INTEGRATORS_OF_CORE), help="Rule of the steps instead of the scene's.")
@options.reports_errors
def command(model: Path, scene: str | None, method: str, out: Path, integrator: str | None) -> None:
    """Generate and compile the C++ of MODEL for one scene."""
    with options.progress_bar(f"compiling {model.name}"):
        artifact = compile_model(model, scene=scene, method=method, out=out, integrator=integrator)
    operations = artifact.program.operations(artifact.iteration)
    options.out.print(f"{operations} operations an evaluation; source and simulator in {out}", markup=False)
