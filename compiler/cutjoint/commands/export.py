"""`cutjoint export`."""

from __future__ import annotations

from pathlib import Path

import click

from cutjoint.commands import options, table
from cutjoint.commands.export_fmu import export_fmu, require_fmu
from cutjoint.methods import DEFAULT_METHOD
from cutjoint.model.link_masses import with_link_masses
from cutjoint.model.opening import with_pushes
from cutjoint.model.records import Model, Output
from cutjoint.package.extensions import EXPORTERS
from cutjoint.run.outputs import require_apart
from cutjoint.run.result_files import write_files
from cutjoint.run.scenes import find_case
from cutjoint.topology.reading import read_model


@table.command("export")
def command(
    model: Path, scene: str | None, peer: str, opened: tuple[str, ...], changes: tuple[str, ...], links: tuple[str, ...],
    asked: tuple[str, ...], fmi: str | None, kind: str | None, content: str | None, platforms: tuple[str, ...], target: str | None,
    method: str | None, integrator: str | None, poses: bool, pushed: tuple[str, ...], out: Path, functions: Path | None,
) -> None:  # fmt: skip
    """Write MODEL as a program for another simulator, which runs one scene there, or as an FMU."""
    if peer == table.FMU:
        if changes or asked:
            option = "--set" if changes else "--output"
            raise click.UsageError(f"{option} is not for --to fmu, which has all parameters, for the host to set, and the scene's outputs")
        checked = with_link_masses(read_model(model, opened=opened, functions=functions), options.read_masses(links))
        export_fmu(
            with_pushes(checked, pushed), scene, model, version=int(fmi or "2"), kind=kind or "cs", content=content or "both",
            method=method or DEFAULT_METHOD, integrator=integrator, out=out, platforms=platforms,
            target=target, poses=poses,
        )  # fmt: skip
        return
    require_fmu(
        peer, fmi=fmi, kind=kind, method=method, integrator=integrator, platform=platforms or None, target=target,
        poses=poses or None, push=pushed or None, functions=functions,
        **({} if content is None else {content: True}),
    )  # fmt: skip
    exporter = EXPORTERS.load(peer)
    if out.exists() and not out.is_dir():
        raise click.BadParameter(f"Directory '{out}' is a file.", param_hint="'--out'")
    checked = with_link_masses(read_model(model, opened=opened), options.read_masses(links))
    checked, chosen = find_case(checked, scene)
    outputs = [_output(checked, name) for name in asked] or exporter.known_outputs(checked, [o for o in chosen.outputs if not o.name])
    with options.progress_bar(f"exporting {model.name}"):
        exported = exporter.export(checked, chosen, options.read_parameters(changes), outputs)
    require_apart({"the model": model}, documents=[(f"--out {out}: file", out / name) for name in exported.files])
    write_files(out, exported.files)
    for sentence in exported.differences:
        options.out.print(sentence, markup=False)
    if left_out := [o.column for o in chosen.outputs if not asked and o not in outputs]:
        options.out.print(f"outputs left out: {', '.join(left_out)}", markup=False)
    options.out.print(f"{', '.join(exported.files)} in {out}; the first of them says how to run it", markup=False)


def _output(model: Model, name: str) -> Output:
    element, _, quantity = name.rpartition(".")
    return Output(element=element, quantity=quantity, span=model.span)
