"""The work of `cutjoint export --to fmu`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from cutjoint.commands import options
from cutjoint.export.fmu.archive import Fmu, make_fmu
from cutjoint.export.fmu.description import KINDS
from cutjoint.model.records import Model
from cutjoint.package.errors import RunError
from cutjoint.run.outputs import require_apart
from cutjoint.run.result_files import write_whole
from cutjoint.run.scenes import find_case
from cutjoint.view.graph import picture_graph

#: The optional contents of an FMU, by their options: sources, a binary.
CONTENTS = {"sources": (True, False), "binary": (False, True), "both": (True, True)}


def export_fmu(
    model: Model, scene: str | None, path: Path, *, version: int, kind: str, content: str, method: str, integrator: str | None,
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
        packed = fmu.pack(sources=sources, binary=binary, picture=picture_graph(fmu.topology), platforms=platforms, target=target)
    write_whole(out, packed)
    variables = fmu.interface.variables
    inputs, outputs = ([v.name for v in variables if v.causality == kind] for kind in ("input", "output"))
    options.out.print(f"FMI {version} {_describe(fmu)}; {len(inputs)} inputs, {len(outputs)} outputs in {out}", markup=False)


def _describe(fmu: Fmu) -> str:
    """The purpose of an FMU in words."""
    simulates, exchanges = KINDS[fmu.subject.kind]
    steps = [f"co-simulation by {fmu.standalone.settings}"] * simulates
    return "; ".join([*steps, *[f"model exchange, {len(fmu.interface.states)} states"] * exchanges])


def require_fmu(peer: str, **given: object) -> None:
    """Check that options that only FMUs have are given with them alone.

    Raises:
        UsageError: one is given for another simulator.
    """
    wrong = [name for name, value in given.items() if value is not None]
    if wrong:
        raise click.UsageError(f"--{wrong[0]} is for --to fmu, not for --to {peer}")
