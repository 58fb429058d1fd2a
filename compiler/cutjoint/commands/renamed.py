"""Words of earlier versions: they still work, and the new word is printed once."""

import shlex
from collections.abc import Mapping
from itertools import pairwise

from cutjoint.commands import options
from cutjoint.methods import AUTO, FORMER_INTEGRATORS

#: Options that have become commands; the option's file becomes the first argument there.
_COMMANDS = {("simulate", "--batch"): "batch", ("simulate", "--with"): "couple"}

#: Options by command and earlier name; those of method auto are --accuracy.
_OPTIONS = {command: {"--tolerance": "--solver-tolerance"} for command in ("simulate", "batch", "couple")}

#: Options of all commands.
_OF_ALL = {
    "--open": "--tunable", "--push": "--external-wrench", "--ground": "--terrain", "--turn": "--steer-travel", "--beside": "--compare",
    "--over": "--ghost", "--from-rest": "--from-equilibrium",
}  # fmt: skip

#: Values of options.
_VALUES: Mapping[str, Mapping[str, str]] = {
    "--integrator": FORMER_INTEGRATORS,
    "--loops": {"compiled": "embedded"},
    "--objective": {"largest": "maximum", "smallest": "minimum", "rest": "equilibrium"},
}


def rename_arguments(words: list[str]) -> list[str]:
    """The arguments of a call in the words of this version; a message reports those that differ."""
    words = _with_values(_with_options(words))
    for (command, option), new in _COMMANDS.items():
        files = []
        while words[:1] == [command] and (file := _value_of(option, words)) is not None:
            files.append(file)
        if files:
            words = [new, *words[1:2], *files, *words[2:]] if words[1:2] and not words[1].startswith("-") else [new, *words[1:], *files]
            options.err.print(f"{command} {option} is now cutjoint {shlex.join(words)}")
    return words


def _with_options(words: list[str]) -> list[str]:
    command, has_auto = words[0] if words else "", f"--method={AUTO}" in words or ("--method", AUTO) in pairwise(words)
    for old, new in {**_OPTIONS.get(command, {}), **_OF_ALL}.items():
        new = "--accuracy" if has_auto and old == "--tolerance" else new
        for i, word in enumerate(words):
            if word == old or word.startswith(f"{old}="):
                words = [*words[:i], new + word.removeprefix(old), *words[i + 1 :]]
                options.err.print(f"{command} {old} is now {new}")
    return words


def _with_values(words: list[str]) -> list[str]:
    for option, names in _VALUES.items():
        for i, word in enumerate(words):
            name = word.removeprefix(f"{option}=")
            if (new := names.get(name)) is not None and (word != name or words[i - 1] == option):
                words = [*words[:i], word.removesuffix(name) + new, *words[i + 1 :]]
                options.err.print(f"{words[0]} {option} {name} is now {new}")
    return words


def _value_of(option: str, words: list[str]) -> str | None:
    """Remove an option with its value from ``words``; return the value, None if the option is missing."""
    for i, word in enumerate(words):
        if word.startswith(f"{option}="):
            return words.pop(i).partition("=")[2]
        if word == option and i + 1 < len(words):
            return [words.pop(i), words.pop(i)][1]
    return None
