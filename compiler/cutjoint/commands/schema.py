"""`cutjoint schema`."""

from __future__ import annotations

from pathlib import Path

import click

from cutjoint.commands import options
from cutjoint.model.document import json_schema
from cutjoint.run.result_files import write_whole
from cutjoint.sweeps.document import study_schema


@click.command("schema")
@click.option("--study", "of_studies", is_flag=True, help="Of study files of cutjoint sweep, instead of model files.")
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), help="JSON file; standard output otherwise.")
@options.reports_errors
def command(of_studies: bool, out: Path | None) -> None:
    """Print the JSON Schema of model files, for editors."""
    schema = study_schema() if of_studies else json_schema()
    if out is None:
        click.echo(schema, nl=False)
    else:
        write_whole(out, schema)
