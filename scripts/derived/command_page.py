"""The command reference, from the arguments, options and help texts of the commands."""

from __future__ import annotations

from collections.abc import Iterator

import click

from cutjoint.cli import main

HEAD = """# Command line

`cutjoint COMMAND --help` prints the same. Paths are relative to the current folder. Exit status: 0 success, 1 an error, whose
message names the place and a remedy, 2 wrong use of the command.
"""


def page() -> str:
    """The page; `cutjoint bench` is of the package that measures."""
    context = click.Context(main, info_name="cutjoint")
    names = [name for name in main.list_commands(context) if name != "bench"]
    return "\n".join([HEAD, *(line for name in names for line in _about(context, name))])


def _about(context: click.Context, name: str) -> Iterator[str]:
    command = main.get_command(context, name)
    assert command is not None
    arguments = [p for p in command.params if isinstance(p, click.Argument)]
    yield f"## cutjoint {name}\n"
    yield f"    cutjoint {name} {' '.join(a.human_readable_name for a in arguments)} [options]\n"
    yield " ".join((command.help or "").split()) + "\n"
    options = [p.get_help_record(context) for p in command.params if isinstance(p, click.Option)]
    yield "| option | |"
    yield "|---|---|"
    for option, text in (record for record in options if record):
        yield f"| `{option.replace('|', ' / ')}` | {' '.join(text.split()).replace('|', ' / ').replace('*', chr(92) + '*')} |"
    yield ""
