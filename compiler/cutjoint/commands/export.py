"""`cutjoint export`."""

from __future__ import annotations

from pathlib import Path

import click

from cutjoint.commands import options
from cutjoint.export.columns import known_outputs
from cutjoint.export.peers import PEERS, write_export
from cutjoint.model.link_masses import with_link_masses
from cutjoint.model.read import read_model
from cutjoint.model.records import Model, Output
from cutjoint.run.outputs import require_apart
from cutjoint.run.scenes import find_scene


@click.command("export")
@options.model
@options.scene
@click.option("--to", "peer", type=click.Choice(list(PEERS)), required=True, help="The other simulator.")
@options.changes
@options.links
@click.option("--output", "asked", metavar="ELEMENT.QUANTITY", multiple=True,
              help="A column of the table; by default those of the scene that are motions of bodies and markers.")
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), required=True, help="Folder for the program.")
@options.reports_errors
def command(
    model: Path, scene: str | None, peer: str, changes: tuple[str, ...], links: tuple[str, ...], asked: tuple[str, ...], out: Path
) -> None:  # fmt: skip
    """Write MODEL as a program for another simulator, which runs one scene there."""
    checked = with_link_masses(read_model(model), options.read_parameters(links, "--link-mass"))
    chosen = find_scene(checked, scene)
    outputs = [_output(checked, name) for name in asked] or known_outputs(checked, chosen.outputs)
    with options.progress_bar(f"exporting {model.name}"):
        exported = PEERS[peer].export(checked, chosen, options.read_parameters(changes), outputs)
    require_apart({"the model": model}, documents=[(f"--out {out}: file", out / name) for name in exported.files])
    write_export(exported, out)
    for sentence in exported.differences:
        options.out.print(sentence, markup=False)
    if left_out := [o.column for o in chosen.outputs if not asked and o not in outputs]:
        options.out.print(f"outputs left out: {', '.join(left_out)}", markup=False)
    options.out.print(f"{', '.join(exported.files)} in {out}; the first of them says how to run it", markup=False)


def _output(model: Model, name: str) -> Output:
    element, _, quantity = name.rpartition(".")
    return Output(element=element, quantity=quantity, span=model.span)
