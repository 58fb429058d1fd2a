"""`cutjoint schema`."""

from __future__ import annotations

from pathlib import Path

import click

from cutjoint.commands import options
from cutjoint.model.document import json_schema
from cutjoint.run.result_files import write_whole


@click.command("schema")
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), help="JSON file; standard output otherwise.")
@options.reports_errors
def command(out: Path | None) -> None:
    """Print the JSON Schema of model files, for editors."""
    if out is None:
        click.echo(json_schema(), nl=False)
    else:
        write_whole(out, json_schema())
