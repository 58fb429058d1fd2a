"""Calls of every command with one option at a time: what its click parameters say, so that a new one is tried as well."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib.util import find_spec

import click

from cutjoint.cli import main

from .values import FIT, MODEL, ROBOT, STUDY, TABLE

#: A choice that suits the press, where the first does not.
_CHOICES = {"peer": "exudyn"}
#: Commands that take minutes where nothing is wrong.
LONG = ("bench",)
#: Commands that refuse any call with the press, which has no wheels, and no scene that prescribes a motion, and what takes a package
#: that may not be there.
UNSUITED = ("inverse", "kinematics", "response", *(() if find_spec("ziglang") else ("drive",)))
#: Options that keep a call short, where a command has them.
_SHORT = {"--end": "0.01", "--method": "recursive"}
#: The command for which such an option goes with another value of its choice alone.
_ELSEWHERE = ("export", "--method")
#: Options beside an option that is refused without them.
_BESIDE = {"ghost_page": ["--view=out_view.html"], "compare": ["--plots=out_plots"]}
#: Files other than models that options and arguments read.
READ = {"cases": TABLE, "study": STUDY, "fit_study": FIT, "file": ROBOT, "folder": "."}
#: Options and arguments that read a file of which users have none here.
_UNREADY = ("ghost_page", "fmus", "compare", "functions", "replay")


def commands() -> dict[str, click.Command]:
    """All commands by name."""
    context = click.Context(main)
    return {name: command for name in main.list_commands(context) if (command := main.get_command(context, name)) is not None}


def good_calls() -> Iterator[list[str]]:
    """A call of every command with good values, and of each option that names a file to read, but for commands that take minutes."""
    for name, command in commands().items():
        if name not in (*LONG, *UNSUITED) and not any(o.name in _UNREADY and o.required for o in command.params):
            yield call_with(name, [])
            optional = [o for o in command.params if is_path(o, written=False) and not o.required and o.name not in _UNREADY]
            yield from (call_with(name, [(option, _good(option))]) for option in optional)


def options() -> Iterator[tuple[str, click.Parameter]]:
    """Every option and argument of every command that takes a value."""
    for name, command in commands().items():
        yield from ((name, option) for option in command.params if not getattr(option, "is_flag", False))


def is_path(option: click.Parameter, *, written: bool) -> bool:
    """True if an option names a file or a folder that is written, or with ``written=False`` one that is read."""
    return isinstance(option.type, click.Path) and option.type.exists != written


def reads_model(name: str) -> bool:
    """True if a command has a model, or several."""
    return any(option.name in ("model", "models", "study", "fit_study") for option in commands()[name].params)


def call_with(name: str, given: Sequence[tuple[click.Parameter, str]]) -> list[str]:
    """The words of a call of a command with values for some options and good ones for what it needs besides."""
    command = commands()[name]
    words, named = [name], {option.name for option, _ in given}
    for option in command.params:
        switch = option.opts[0]
        if option.name in named:
            continue
        if option.required:
            words += _spelled(option, _good(option))
        elif switch in _SHORT and (name, switch) != _ELSEWHERE:
            words += [switch, _SHORT[switch]]
    for option, value in given:
        words += [*_spelled(option, value), *(word for word in _BESIDE.get(option.name or "", []) if "view" not in named)]
    return words


def _spelled(option: click.Parameter, value: str) -> list[str]:
    return [value] if isinstance(option, click.Argument) else [f"{option.opts[0]}={value}"]


def _good(option: click.Parameter) -> str:
    if isinstance(option.type, click.Choice):
        return _CHOICES.get(option.name or "", str(option.type.choices[0]))
    if not isinstance(option.type, click.Path):
        raise NotImplementedError(f"a good value for {option.opts[0]}")
    if option.type.exists:
        return READ.get(option.name or "", MODEL)
    return f"out_{option.name}"
