"""The command line: its commands by name."""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import EntryPoint, entry_points

import click

_COMMANDS = ("check", "compile", "equilibrium", "explain", "export", "modes", "realtime", "reduce", "schema", "simulate")

#: The entry points by which other packages add commands, and the packages of this project that do.
GROUP = "cutjoint.commands"
_PACKAGES = {"bench": "cutjoint-bench"}


class _Commands(click.Group):
    """Commands that are imported when they are asked for: one does not wait for what others need."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return sorted({*_COMMANDS, *_added()})

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name in _COMMANDS:
            command = import_module(f"cutjoint.commands.{cmd_name}").command
        elif (point := _added().get(cmd_name)) is not None:
            command = point.load()
        elif cmd_name in _PACKAGES:
            package = _PACKAGES[cmd_name]
            raise click.UsageError(f"{cmd_name} is a command of the package {package}, which is not installed; pip install {package}", ctx)
        else:
            return None
        assert isinstance(command, click.Command)
        return command


def _added() -> dict[str, EntryPoint]:
    """The commands of other packages."""
    return {point.name: point for point in entry_points(group=GROUP)}


@click.group(cls=_Commands)
@click.version_option(package_name="cutjoint")
def main() -> None:
    """A model compiler for multibody dynamics: from one YAML file to case-specific C++."""
