"""`cutjoint import`."""

from __future__ import annotations

from pathlib import Path

import click

from cutjoint.commands import options, table
from cutjoint.importing.document import READERS, import_file, is_foreign, name_of
from cutjoint.run.outputs import require_apart
from cutjoint.run.result_files import write_whole


@table.command("import")
def command(file: Path, base: str, out: Path | None) -> None:
    """Write a URDF, SDF or MJCF FILE as a model file."""
    if not is_foreign(file):
        raise click.UsageError(f"{file.name} is of no format that is read; files end in {', '.join(READERS)}")
    out = Path(name_of(file).name) if out is None else out
    beside = file.with_suffix(".yaml")
    require_apart({"the file": file, "the file with its loops": beside if beside.is_file() else None}, documents=[("--out", out)])
    with options.progress_bar(f"reading {file.name}"):
        imported = import_file(file, free=base == "free")
    write_whole(out, imported.text)
    console = options.console_beside(out)
    for note in imported.notes:
        console.print(f"{note[0].upper()}{note[1:]}.", markup=False)
    if imported.left_out:
        console.print("left out: " + ", ".join(f"{tag} ({count})" for tag, count in sorted(imported.left_out.items())), markup=False)
    console.print(f"model: {out}", markup=False)
