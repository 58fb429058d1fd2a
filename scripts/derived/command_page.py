"""The command reference, from the arguments, options and help texts of the commands."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from typing import TypeAlias

import click

from cutjoint.cli import main

HEAD = """# Command line

`cutjoint COMMAND --help` prints the same. Paths are relative to the current folder. Exit status: 0 success; 1 an error, whose
message names the place and a remedy, or a requested accuracy that was not reached; 2 wrong use of the command.
`cutjoint-bench` is the package in the folder `measuring/` of the repository.

## Common options

"""

#: An option and its help.
Row: TypeAlias = tuple[str, str]
#: So many commands make an option a common one.
_MANY = 2


def page() -> str:
    """The page; `cutjoint bench` is of the package that measures."""
    context = click.Context(main, info_name="cutjoint")
    commands = {name: main.get_command(context, name) for name in main.list_commands(context) if name != "bench"}
    options = {name: list(_options(context, command)) for name, command in commands.items() if command is not None}
    uses = Counter(row for rows in options.values() for row in rows)
    common = {row: None for row, _ in {row[0].split()[0]: (row, n) for row, n in reversed(uses.most_common()) if n >= _MANY}.values()}
    sections = [line for name, command in commands.items() if command for line in _about(name, command, options[name], common)]
    return HEAD + "\n".join([*_table(sorted(common)), *sections])


def _options(context: click.Context, command: click.Command) -> Iterator[Row]:
    for record in (p.get_help_record(context) for p in command.params if isinstance(p, click.Option)):
        if record:
            yield record[0].replace("|", " / "), " ".join(record[1].split()).replace("|", " / ").replace("*", "\\*")


def _about(name: str, command: click.Command, rows: list[Row], common: dict[Row, None]) -> Iterator[str]:
    arguments = [p for p in command.params if isinstance(p, click.Argument)]
    yield f"## cutjoint {name}\n"
    yield f"    cutjoint {name} {' '.join(a.human_readable_name for a in arguments)} [options]\n"
    yield " ".join((command.help or "").split()) + "\n"
    if shared := [f"`{option.split()[0]}`" for option, text in rows if (option, text) in common]:
        yield f"Common options: {', '.join(shared)}.\n"
    yield from _table(row for row in rows if row not in common)


def _table(rows: Iterable[Row]) -> Iterator[str]:
    if lines := [f"| `{option}` | {text} |" for option, text in rows]:
        yield from ("| option | |", "|---|---|", *lines, "")
