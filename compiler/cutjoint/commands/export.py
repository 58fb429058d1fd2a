"""`cutjoint export`."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import click

from cutjoint.commands import options, table
from cutjoint.compile.c_export import describe_frozen
from cutjoint.export.fmu.archive import Fmu, make_fmu
from cutjoint.export.fmu.description import KINDS
from cutjoint.export.mjcf import write_mjcf
from cutjoint.export.robots import write_urdf
from cutjoint.model.elements.link_masses import with_link_masses
from cutjoint.model.expressions.tunable import with_inputs
from cutjoint.model.records import Model, Output
from cutjoint.package.errors import RunError, plural
from cutjoint.package.extensions import EXPORTERS
from cutjoint.run.outputs import require_apart
from cutjoint.run.reading import read_model
from cutjoint.run.result_files import write_files, write_whole
from cutjoint.run.run_file import parameter_values
from cutjoint.run.scenes import find_case

#: Formats of robots: the endings of their files' names, and their writers.
ROBOTS = {table.URDF: (".urdf", write_urdf), table.MJCF: (".xml", write_mjcf)}
#: The optional contents of an FMU, by their options: sources, a binary.
CONTENTS = {"sources": (True, False), "binary": (False, True), "both": (True, True)}


@table.command("export")
def command(
    model: Path, scene: str | None, peer: str, tunable: tuple[str, ...], changes: tuple[str, ...], links: tuple[str, ...],
    requested: tuple[str, ...], fmi: str | None, kind: str | None, content: str | None, platforms: tuple[str, ...], target: str | None,
    method: str | None, integrator: str | None, poses: bool, external_wrenches: tuple[str, ...], terrain: tuple[str, ...], out: Path,
    functions: Path | None,
) -> None:  # fmt: skip
    """Write MODEL as an FMU, as a URDF or MJCF file with loops, or as a program that runs one scene in another simulator."""
    if peer == table.FMU:
        if changes or requested:
            option = "--set" if changes else "--output"
            raise click.UsageError(f"{option} does not apply to --to fmu: it has all parameters, set by its host, and the scene's outputs")
        checked = with_link_masses(read_model(model, tunable=tunable, functions=functions), options.read_masses(links))
        export_fmu(
            with_inputs(checked, external_wrenches=external_wrenches, terrain=terrain), scene, model, version=int(fmi or "2"),
            kind=kind or "cs", content=content or "both", method=method, integrator=integrator, out=out,
            platforms=platforms, target=target, poses=poses,
        )  # fmt: skip
        return
    for_fmu = {
        "fmi": fmi, "kind": kind, "method": method, "integrator": integrator, "platform": platforms, "target": target, "poses": poses,
        "external-wrench": external_wrenches, "terrain": terrain, "functions": functions, content: content,
    }  # fmt: skip
    if wrong := [name for name, value in for_fmu.items() if value]:
        raise click.UsageError(f"--{wrong[0]} is for --to fmu, not for --to {peer}")
    if peer in ROBOTS:
        if requested or scene:
            raise click.UsageError(f"--{'output' if requested else 'scene'} is not for --to {peer}, which exports the mechanism only")
        checked = with_link_masses(read_model(model, tunable=tunable), options.read_masses(links))
        export_robot(checked, options.read_parameters(changes), model, peer, out)
        return
    exporter = EXPORTERS.load(peer)
    if out.exists() and not out.is_dir():
        raise click.BadParameter(f"Directory '{out}' is a file.", param_hint="'--out'")
    checked = with_link_masses(read_model(model, tunable=tunable), options.read_masses(links))
    checked, chosen = find_case(checked, scene)
    outputs = [
        Output(element=element, quantity=quantity, span=checked.span)
        for element, _, quantity in (name.rpartition(".") for name in requested)
    ] or exporter.known_outputs(checked, [o for o in chosen.outputs if not o.name])
    with options.progress_bar(f"exporting {model.name}"):
        exported = exporter.export(checked, chosen, options.read_parameters(changes), outputs)
    require_apart({"the model": model}, documents=[(f"--out {out}: file", out / name) for name in exported.files])
    write_files(out, exported.files)
    options.out.print_each(exported.differences)
    if left_out := [o.column for o in chosen.outputs if not requested and o not in outputs]:
        options.out.print(f"outputs left out: {', '.join(left_out)}")
    options.out.print(f"{', '.join(exported.files)} in {out}; the first of them says how to run it")


def export_robot(model: Model, parameters: Mapping[str, float], path: Path, kind: str, out: Path) -> None:
    """Write a model as a file of robots; errors as of its writer.

    Raises:
        RunError: the file's name does not end as those of the format do, or there is no such parameter.
        OutputError: the file is the model, or cannot be written.
    """
    ending, write = ROBOTS[kind]
    if out.suffix != ending or out.is_dir():
        raise RunError(f"--out {out}: {'a URDF' if kind == table.URDF else 'an MJCF'} is one file whose name ends in {ending}")
    require_apart({"the model": path}, documents=[("--out", out)])
    text, left_out = write(model, parameter_values(model, parameters))
    write_whole(out, text)
    options.out.print_each(left_out)
    options.out.print(f"{plural(len(model.bodies), 'body', 'bodies')}, {plural(len(model.joints), 'joint')} in {out}")


def export_fmu(
    model: Model, scene: str | None, path: Path, *, version: int, kind: str, content: str, method: str | None, integrator: str | None,
    out: Path, platforms: Sequence[str] = (), target: str | None = None, poses: bool = False,
) -> None:  # fmt: skip
    """Write a model as an FMU; errors as of `make_fmu` and `Fmu.pack`.

    Raises:
        UsageError: platforms or a target are named for an FMU without binaries.
        RunError: the file's name does not end as those of FMUs do.
        OutputError: the file is the model, or cannot be written.
    """
    if out.suffix != ".fmu" or out.is_dir():
        raise RunError(f"--out {out}: an FMU is one file whose name ends in .fmu")
    require_apart({"the model": path}, documents=[("--out", out)])
    sources, binary = CONTENTS[content]
    if (platforms or target) and not binary:
        raise click.UsageError(f"--{'platform' if platforms else 'target'} is for binaries; leave out --sources")
    with options.progress_bar(f"exporting {path.name}"):
        fmu = make_fmu(*find_case(model, scene), version=version, kind=kind, method=method, integrator=integrator, poses=poses)
        packed = fmu.pack(sources=sources, binary=binary, platforms=platforms, target=target)
    write_whole(out, packed)
    variables = fmu.interface.variables
    inputs, outputs = ([v.name for v in variables if v.causality == kind] for kind in ("input", "output"))
    ports = f"{plural(len(inputs), 'input')}, {plural(len(outputs), 'output')}"
    options.out.print(f"FMI {version} {_describe(fmu)}; {ports} in {out}")


def _describe(fmu: Fmu) -> str:
    simulates, exchanges = KINDS[fmu.subject.kind]
    steps = [f"co-simulation by {fmu.standalone.settings}"] * simulates
    frozen = [words] if (words := describe_frozen(fmu.topology.model)) else []
    return "; ".join([*steps, *frozen, *[f"model exchange, {plural(len(fmu.interface.states), 'state')}"] * exchanges])
