"""The command line: its commands by name."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

import click

from cutjoint.model.printing import escaped_lines
from cutjoint.run.stopping import Terminated

_COMMANDS = ("bench", "check", "compile", "equilibrium", "explain", "export", "modes", "realtime", "reduce", "schema", "simulate")


class _Commands(click.Group):
    """Commands that are imported when they are asked for: one does not wait for what others need."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """The arguments; names of files stand in tables, run files and messages, which are UTF-8."""
        for text in args:
            if not _is_utf_8(text):
                ctx.fail(f"the argument {text!a} is not UTF-8; rename the file, or write another name")
        return super().parse_args(ctx, args)

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(_COMMANDS)

    def invoke(self, ctx: click.Context) -> object:
        """Call a command; a signal that ends it is no error, and its message says what there is of the results."""
        try:
            with _plain_errors():
                return super().invoke(ctx)
        except (KeyboardInterrupt, Terminated) as stop:
            click.echo("\n".join([str(stop) or "interrupted", *getattr(stop, "__notes__", ())]), err=True)
            raise SystemExit(stop.code if isinstance(stop, Terminated) else 130) from None

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in _COMMANDS:
            return None
        command = import_module(f"cutjoint.commands.{cmd_name}").command
        assert isinstance(command, click.Command)
        return command

    def make_context(self, *args: Any, **kwargs: Any) -> click.Context:
        with _plain_errors():
            return super().make_context(*args, **kwargs)


@contextmanager
def _plain_errors() -> Iterator[None]:
    """What click says of wrong use repeats what was typed: without control characters."""
    try:
        yield
    except click.ClickException as error:
        error.message = escaped_lines(error.message)  # type: ignore[misc]
        raise


def _is_utf_8(text: str) -> bool:
    try:
        text.encode("utf-8")
    except UnicodeEncodeError:
        return False
    return True


@click.group(cls=_Commands)
@click.version_option(package_name="cutjoint")
def main() -> None:
    """A model compiler for multibody dynamics: from one YAML file to case-specific C++."""
