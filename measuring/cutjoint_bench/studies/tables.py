"""The tables of the report's summary as Markdown, from which README and docs/evidence/benchmarks.md take theirs: `make tables`."""

from __future__ import annotations

import json
from collections.abc import Sequence

import click

from cutjoint_bench.studies.checkout import SUMMARY


def as_markdown(rows: Sequence[Sequence[str]]) -> str:
    """A row a line; the first is the head."""
    head, *others = rows
    return "\n".join(f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *others))


@click.command()
def main() -> None:
    """Print them."""
    for table in json.loads(SUMMARY.read_text(encoding="utf-8"))["tables"]:
        click.echo(f"## {table['title']}\n\n{as_markdown([table['head'], *table['rows']])}\n")


if __name__ == "__main__":
    main()
