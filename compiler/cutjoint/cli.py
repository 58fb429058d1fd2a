"""The command line: its commands by name."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

import click

from cutjoint.model.printing import escaped_lines

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

    def make_context(self, *args: Any, **kwargs: Any) -> click.Context:
        with _plain_errors():
            return super().make_context(*args, **kwargs)

    def invoke(self, ctx: click.Context) -> Any:
        with _plain_errors():
            return super().invoke(ctx)


@contextmanager
def _plain_errors() -> Iterator[None]:
    """What click says of wrong use repeats what was typed: without control characters."""
    try:
        yield
    except click.ClickException as error:
        error.message = escaped_lines(error.message)  # type: ignore[misc]
        raise


@click.group(cls=_Commands)
@click.version_option(package_name="cutjoint")
def main() -> None:
    """A model compiler for multibody dynamics: from one YAML file to case-specific C++."""
