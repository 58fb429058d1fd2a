"""`cutjoint schema`."""

from __future__ import annotations

from pathlib import Path

import click

from cutjoint.model.document import json_schema


@click.command("schema")
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), help="JSON file; standard output otherwise.")
def command(out: Path | None) -> None:
    """Print the JSON Schema of model files, for editors."""
    if out is None:
        click.echo(json_schema(), nl=False)
    else:
        out.write_text(json_schema(), encoding="utf-8")
