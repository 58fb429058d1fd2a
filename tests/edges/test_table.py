"""The table of options, and the words of earlier versions."""

from __future__ import annotations

import os
from inspect import signature, unwrap
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.commands.renamed import rename_arguments
from cutjoint.commands.table import OPTIONS, Setting
from cutjoint.model.ranges import fault_of_setting

from .commands import commands


def test_every_row_belongs_to_a_command() -> None:
    used = set()
    for name, command in commands().items():
        assert command.callback is not None
        if command.callback.__module__.startswith("cutjoint.commands."):
            used |= {row if (row := f"{name}.{p}") in OPTIONS else p for p in signature(unwrap(command.callback)).parameters}
    assert used == set(OPTIONS)


def numbers() -> list[tuple[str, click.Option]]:
    return [(name, p) for name, command in commands().items() for p in command.params if isinstance(p, click.Option)]


def written() -> list[tuple[str, click.Option]]:
    """The options that name a file to write; the program or file of `export` is checked by its format."""
    return [
        (name, p) for name, p in numbers()
        if isinstance(p.type, click.Path) and p.type.file_okay and not p.type.exists and (name, p.name) != ("export", "out")
    ]  # fmt: skip


@pytest.mark.parametrize(("name", "option"), written(), ids=lambda x: x if isinstance(x, str) else x.name)
def test_a_file_has_the_ending_of_what_is_written(name: str, option: click.Option, tmp_path: Path) -> None:
    for file in (tmp_path / "x.xlsx", tmp_path / "x.MAT"):
        with pytest.raises(click.BadParameter, match=r"x\.(xlsx|MAT): no such kind of file; write a name that ends in \."):
            option.type.convert(str(file), option, None)
    with pytest.raises(click.BadParameter, match="- would be a file of that name; standard output is /dev/stdout"):
        option.type.convert("-", option, None)
    os.symlink("/dev/null", tmp_path / "null.xlsx")
    assert option.type.convert(str(tmp_path / "null.xlsx"), option, None) == tmp_path / "null.xlsx"


@pytest.mark.parametrize("name", ["run.txt", "run.CSV", "run.v2", "run"])
def test_a_table_may_have_any_ending_of_no_other_format(name: str) -> None:
    (option,) = (p for p in commands()["simulate"].params if p.name == "out")
    assert option.type.convert(name, option, None) == Path(name)


@pytest.mark.parametrize(("name", "option"), numbers(), ids=lambda x: x if isinstance(x, str) else x.name)
def test_numbers_have_a_range_that_the_help_tells(name: str, option: click.Option) -> None:
    """The bounds in the help are those that are refused beyond, and at an open end."""
    assert not isinstance(option.type, click.types.IntParamType | click.types.FloatParamType) or isinstance(option.type, Setting)
    if not isinstance(option.type, Setting):
        return
    (low, is_open), high = (option.type.min, option.type.min_open), option.type.max
    text = (option.get_help_record(click.Context(commands()[name])) or ("", ""))[1]
    assert low is not None
    assert f"{low}<{'' if is_open else '='}x" in text or f"x>{'' if is_open else '='}{low}" in text
    for beyond in (low - 1, *([low] if is_open else []), *([high + 1] if high is not None else [])):
        with pytest.raises(click.BadParameter):
            option.type.convert(str(int(beyond)), option, None)
    assert high is None or option.type.convert(str(high), option, None) == high


def test_a_range_is_that_of_files_and_python() -> None:
    assert fault_of_setting("threads", 4097)
    with pytest.raises(click.BadParameter):
        Setting("threads").convert("4097", None, None)


OLD = [
    ("simulate press.yaml --batch cases.csv --out x.csv", "batch press.yaml cases.csv --out x.csv"),
    ("simulate --batch=cases.csv press.yaml --out x.csv", "batch press.yaml cases.csv --out x.csv"),
    ("simulate --out x.csv press.yaml --set a=1 --batch cases.csv", "batch --out x.csv press.yaml --set a=1 cases.csv"),
    ("simulate pole.yaml --with pole.fmu --connect a=b --out x.csv", "couple pole.yaml pole.fmu --connect a=b --out x.csv"),
]


@pytest.mark.parametrize(("old", "new"), OLD)
def test_words_of_an_earlier_version_are_those_of_this_one(old: str, new: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert rename_arguments(old.split()) == new.split()
    assert " ".join(capsys.readouterr().err.split()).endswith(f"is now cutjoint {new}")


@pytest.mark.parametrize("words", ["simulate press.yaml --out x.csv", "compile press.yaml --batch x", "simulate --batch", "check", ""])
def test_other_words_stay(words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert rename_arguments(words.split()) == words.split()
    assert capsys.readouterr().err == ""


def test_an_old_call_is_the_new_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for file in ("press.yaml", "cases.csv", "pole.fmu"):
        Path(file).touch()
    os.symlink("pole.fmu", "pole.csv")
    old = ("--batch", "cases.csv", "batch", "the table of parameters"), ("--with", "pole.fmu", "couple", "the FMU")
    for option, file, command, what in old:
        out = f"{Path(file).stem}.csv"
        done = CliRunner().invoke(main, ["simulate", "press.yaml", option, file, "--out", out])
        assert done.exit_code == 1
        assert done.output == (
            f"simulate {option} is now cutjoint {command} press.yaml {file} --out {out}\n"
            f"--out {out}: that is {what}; write the results elsewhere\n"
        )
