"""The command line: its commands by name."""

from __future__ import annotations

from importlib import import_module

import click

_COMMANDS = ("bench", "check", "compile", "equilibrium", "explain", "export", "modes", "realtime", "reduce", "schema", "simulate")


class _Commands(click.Group):
    """Commands that are imported when they are asked for: one does not wait for what others need."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in _COMMANDS:
            return None
        command = import_module(f"cutjoint.commands.{cmd_name}").command
        assert isinstance(command, click.Command)
        return command


@click.group(cls=_Commands)
@click.version_option(package_name="cutjoint")
def main() -> None:
    """A model compiler for multibody dynamics: from one YAML file to case-specific C++."""
