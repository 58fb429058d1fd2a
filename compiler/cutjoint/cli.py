"""The command line: its commands by name."""

import ast
import errno
import gc
import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from keyword import iskeyword
from pathlib import Path
from typing import Any

import click

from cutjoint.commands.renamed import rename_arguments
from cutjoint.model.text import escaped_lines
from cutjoint.package.extensions import COMMANDS, MissingPackageError
from cutjoint.package.locations import OUTPUTS
from cutjoint.run.stopping import Terminated, ended_by_signals

_COMMANDS = ("batch", "check", "compile", "couple", "drive", "equilibrium", "explain", "export", "fit", "gradient", "import", "inverse",
             "kinematics", "modes", "realtime", "reduce", "response", "schema", "simulate", "sweep", "view", "warm")  # fmt: skip

#: After how many new objects Python looks for cycles among them.  A command makes many that stay: with Python's 700, an eighth of its time
#: and more goes there.
_COLLECTION = 100_000


class _Commands(click.Group):
    """Commands that are imported on demand, so that none waits for the imports of others."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """The arguments; tables, run files and messages contain file names as UTF-8."""
        for text in args:
            if fault := _fault_of_argument(text):
                ctx.fail(fault)
        return super().parse_args(ctx, args)

    def list_commands(self, ctx: click.Context) -> list[str]:
        return sorted({*_COMMANDS, *COMMANDS.installed()})

    def resolve_command(self, ctx: click.Context, args: list[str]) -> tuple[str | None, click.Command | None, list[str]]:
        """The command, its name and its arguments; names of earlier versions work too."""
        return super().resolve_command(ctx, rename_arguments(args))

    def invoke(self, ctx: click.Context) -> object:
        """Call a command; a signal that ends it is no error, and its message names the partial results."""
        gc.set_threshold(_COLLECTION)
        try:
            with ended_by_signals(), _plain_errors(), warnings.catch_warnings():
                warnings.showwarning = lambda message, *_, **__: click.echo(str(message), err=True)
                return super().invoke(ctx)
        except (KeyboardInterrupt, Terminated) as stop:
            click.echo("\n".join([str(stop) or "interrupted", *getattr(stop, "__notes__", ())]), err=True)
            raise SystemExit(stop.code if isinstance(stop, Terminated) else 130) from None
        finally:
            OUTPUTS.clear()

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name in _COMMANDS:
            command = import_module(_module_of(cmd_name)).command
        elif cmd_name in COMMANDS.names():
            try:
                command = COMMANDS.load(cmd_name)
            except MissingPackageError as missing:
                raise click.UsageError(str(missing), ctx) from None
        else:
            return None
        assert isinstance(command, click.Command)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """One line for each command, read from its source: importing all takes seconds."""
        commands = [click.Command(name, help=_text_of(name)) for name in self.list_commands(ctx)]
        room = formatter.width - 6 - max(len(each.name or "") for each in commands)
        with formatter.section("Commands"):
            formatter.write_dl([(each.name or "", each.get_short_help_str(room)) for each in commands])

    def make_context(self, *args: Any, **kwargs: Any) -> click.Context:
        with _plain_errors():
            return super().make_context(*args, **kwargs)


def _module_of(command: str) -> str:
    return f"cutjoint.commands.{command}{'_' * iskeyword(command)}"


def _text_of(command: str) -> str:
    """The docstring of a command's function, read without importing its module; "" if there is none."""
    module = _module_of(command) if command in _COMMANDS else COMMANDS.installed()[command].module
    place = find_spec(module)
    if place is None or place.origin is None:
        return ""
    functions = (node for node in ast.parse(Path(place.origin).read_bytes()).body if isinstance(node, ast.FunctionDef))
    return next((ast.get_docstring(node) or "" for node in functions if node.name == "command"), "")


@contextmanager
def _plain_errors() -> Iterator[None]:
    """Make click's errors safe to print: they repeat what was typed."""
    try:
        yield
    except click.ClickException as error:
        error.message = escaped_lines(error.message)  # type: ignore[misc]
        raise


def _fault_of_argument(text: str) -> str:
    """What is wrong with an argument of any command; "" if nothing."""
    option, _, value = text.partition("=") if text.startswith("--") else ("", "", text)
    if any("\ud800" <= letter <= "\udfff" for letter in text):
        return f"the argument {text!a} is not UTF-8; rename the file, or write another name"
    if not value and (not option or text.endswith("=")):
        return f"the argument {text!a} is empty; write a value, or omit the option"
    return f"{value}: a circular link;  remove it, or write another name" if _is_link_loop(value) else ""


def _is_link_loop(path: str) -> bool:
    try:
        os.stat(path)
    except (OSError, ValueError) as error:
        return isinstance(error, OSError) and error.errno == errno.ELOOP
    return False


@click.group(cls=_Commands)
@click.version_option(package_name="cutjoint")
def main() -> None:
    """A model compiler for multibody dynamics: from one YAML file to case-specific C++."""


if __name__ == "__main__":
    main()
