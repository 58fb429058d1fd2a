"""`cutjoint import`."""

from pathlib import Path

import click

from cutjoint.commands import options, table
from cutjoint.importing.document import import_file
from cutjoint.importing.formats import READERS, is_foreign, name_of
from cutjoint.run.outputs import require_apart
from cutjoint.run.result_files import write_whole
from cutjoint.topology.reading import read_model_text


@table.command("import")
def command(file: Path, base: str, name: str, folder: Path | None, out: Path | None) -> None:
    """Write a URDF, SDF or MJCF FILE as a model file."""
    if not is_foreign(file):
        raise click.UsageError(f"{file.name} has an unknown format; known endings are {', '.join(READERS)}")
    if name and READERS[file.suffix.lower()] != "SDF":
        raise click.UsageError(f"--model chooses a model of an SDF file; {file.name} is not one")
    if folder and not file.resolve().is_relative_to(folder.resolve()):
        raise click.UsageError(f"--folder {folder}: {file.name} is not below it")
    out = Path(name_of(file).name) if out is None else out
    beside = file.with_suffix(".yaml")
    require_apart({"the file": file, "the file with its loops": beside if beside.is_file() else None}, documents=[("--out", out)])
    with options.progress_bar(f"reading {file.name}"):
        imported = import_file(file, free=base == "free", folder=folder, model=name)
        read_model_text(imported.text, str(out), folder=folder or file.parent)  # checks that the written file can be read
    write_whole(out, imported.text)
    console = options.message_console(out)
    console.print_each(f"{note[0].upper()}{note[1:]}." for note in imported.notes)
    if imported.left_out:
        console.print("left out: " + ", ".join(f"{tag} ({count})" for tag, count in sorted(imported.left_out.items())))
    console.print(f"model: {out}")
