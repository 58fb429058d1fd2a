"""`cutjoint compile`."""

from __future__ import annotations

from pathlib import Path

import click

from cutjoint.commands import options
from cutjoint.compile.pipeline import compile_model, generate
from cutjoint.emit.standalone import INTEGRATORS_OF_CORE
from cutjoint.formulate.inputs import open_parameters
from cutjoint.run.artifact import Artifact
from cutjoint.topology.reading import read_model


@click.command("compile")
@options.model
@options.scene
@options.method
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), required=True, help="Folder for the C++ and the simulator.")
@click.option("--integrator", type=click.Choice(INTEGRATORS_OF_CORE), help="Rule of the steps; otherwise the scene's, else trapezoidal.")
@click.option("--linearise", is_flag=True, help="Add derivatives at a state to the C interface: A, B, C, D and directional ones.")
@options.opened
@options.reports_errors
def command(
    model: Path, scene: str | None, method: str, out: Path, integrator: str | None, linearise: bool, opened: tuple[str, ...]
) -> None:
    """Generate and compile the C++ of MODEL for one scene."""
    with options.progress_bar(f"compiling {model.name}"):
        artifact = compile_model(model, scene=scene, method=method, out=out, integrator=integrator, linearise=linearise, opened=opened)
        price = _price(artifact, model) if opened else ""
    operations = artifact.program.operations(artifact.iteration)
    options.out.print(f"{operations} operations an evaluation{price}; source and simulator in {out}", markup=False)


def _price(artifact: Artifact, path: Path) -> str:
    """The cost of opened numbers, in words."""
    plain = read_model(path)
    _, program, _ = generate(plain, plain.scenes[artifact.scene.name], artifact.scene.outputs, method=artifact.method)
    count = len(open_parameters(artifact.topology.model)) - len(open_parameters(plain))
    return f" ({count} numbers are opened; {program.operations(artifact.iteration)} without)"
