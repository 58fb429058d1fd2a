"""A table of bad values, by the type that an option takes."""

from __future__ import annotations

import os
from collections.abc import Iterator

import click

MODEL, LINK, HARD_LINK, TABLE, FOLDER, STUDY = "press.yaml", "link.yaml", "hard_link.yaml", "cases.csv", "folder", "study.yaml"
FIT, DATA = "fit.yaml", "measured.csv"
ROBOT = "robot.urdf"

_LONG = "n" * 300
_ESCAPE = "\x1b[31mred"
_NOT_UTF8 = os.fsdecode(b"\xff\xfe")

_WORDS = ("nan", "", "1_0", "\uff11\uff10", "0x10", "one", "9" * 5000, _ESCAPE, "-1")
FLOATS = (*_WORDS, "inf", "-inf", "0", "1e999", "1e300", "1e-300", "1e16")
INTEGERS = (*_WORDS, "inf", "-inf", "0", "1.5", "1e-300", "1e16", str(2**31), str(2**32 + 1), str(2**63), "1e300")
TEXTS = ("", "=", "=1", "not_there", "not_there=1", f"{_ESCAPE}=1", _NOT_UTF8, "x" * 100_000, ",", "\0")
#: Of NAME=VALUE, with a name that the model has.
CHANGES = tuple(f"stiffness={value}" for value in ("", "nan", "inf", "1e999", "1_0", "\uff11\uff10", "0x10", "one", _ESCAPE, "=1"))
FILES_IN = ("", "missing", FOLDER, "/dev/null", "/dev/full", "/bin/ls", _ESCAPE, _NOT_UTF8, _LONG, f"{MODEL}/below")
FILES_OUT = ("", FOLDER, "/dev/full", "/proc/nothing.csv", _LONG, f"{MODEL}/below", "loop")
#: The model, by other names too.
MODELS = (MODEL, f"./{FOLDER}/../{MODEL}", LINK, HARD_LINK)
FOLDERS_OUT = ("", MODEL, LINK, "/dev/full", "/dev/null", "/proc/nothing", _LONG, f"{MODEL}/below", "loop")
#: Odd, but no fault of the option's: a command does what is asked for, or refuses it.
ODD_FILES_OUT = ("/dev/null", _ESCAPE, _NOT_UTF8, "new/folder/file.csv", "no_suffix", "-")
ODD_FOLDERS_OUT = (_ESCAPE, _NOT_UTF8, "new/folder")

#: Values of the table that an option of this name can use: a run with them ends in what was asked for, or is refused.
USABLE = {
    "at": {"0", "1e-300"},
    "accuracy": {"1e300", "1e16", "1e-300"},
    "tolerance": {"1e300", "1e16", "1e-300"},
    "end": {"1e-300"},
    "replay": {"0"},
    "replays": {"0"},
}


def bad_values(option: click.Parameter, *, reads_model: bool) -> Iterator[tuple[str, bool]]:
    """Values to try with an option of a command that reads a model or does not, each with whether it must be refused; none for switches
    and choices, which click refuses itself."""
    usable = USABLE.get(option.name or "", set()) | ({option.default} if isinstance(option.default, str) else set())
    bad, odd = _of_type(option)
    yield from ((value, value not in usable) for value in bad)
    yield from ((value, False) for value in odd)
    if odd is ODD_FILES_OUT:
        yield from ((value, reads_model) for value in MODELS)


def _of_type(option: click.Parameter) -> tuple[tuple[str, ...], tuple[str, ...]]:
    kind = option.type
    if isinstance(kind, click.Path):
        return _of_path(kind)
    if isinstance(kind, click.types.FloatParamType):
        return (INTEGERS if kind.name == "integer" else FLOATS), ()
    if isinstance(kind, click.types.StringParamType):
        return (*TEXTS, *(CHANGES if (option.name or "") == "changes" else ())), ()
    return (), ()


def _of_path(kind: click.Path) -> tuple[tuple[str, ...], tuple[str, ...]]:
    if kind.exists:
        return FILES_IN, ()
    return (FOLDERS_OUT, ODD_FOLDERS_OUT) if kind.dir_okay else (FILES_OUT, ODD_FILES_OUT)
