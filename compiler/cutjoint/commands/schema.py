"""`cutjoint schema`."""

from pathlib import Path

import click

from cutjoint.commands import table
from cutjoint.model.document.model_file import json_schema
from cutjoint.run.result_files import write_whole
from cutjoint.sweeps.document import Document


@table.command("schema")
def command(of_studies: bool, out: Path | None) -> None:
    """Print the JSON Schema of model files, for editors."""
    schema = json_schema(Document) if of_studies else json_schema()
    if out is None:
        click.echo(schema, nl=False)
    else:
        write_whole(out, schema)
