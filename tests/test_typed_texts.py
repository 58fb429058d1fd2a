"""Typed texts: one grammar of numbers everywhere, and no control characters in messages about them."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.model.read import read_model
from cutjoint.model.text import is_number, is_whole, read_number
from cutjoint.package.errors import RunError
from cutjoint.run.cases import read_cases
from tests.conftest import needs_cpp

MODELS = Path(__file__).resolve().parents[1] / "models"
PENDULUM = MODELS / "pendulum.yaml"

NO_NUMBERS = ("1_0", "\uff11\uff10", "\u0661", "inf", "nan", "-Infinity", "0x10", "1e", "1e_3", "1.0.0", "1 0", "1,5", "1d3", "ten", "")


def test_the_grammar_of_numbers() -> None:
    for text, value in (("1", 1.0), ("+1.", 1.0), (".5e-3", 0.0005), ("-2E+2", -200.0), ("007", 7.0)):
        assert is_number(text)
        assert read_number(f" {text} ") == value
    assert not any(map(is_number, NO_NUMBERS))
    assert not any(map(is_whole, (*NO_NUMBERS, "1.0")))


@pytest.mark.parametrize("text", [x for x in NO_NUMBERS if x])
@pytest.mark.parametrize("option", ["--dt", "--end", "--iterations", "--set"])
def test_options_refuse_what_is_no_plain_number(option: str, text: str) -> None:
    value = f"stiffness={text}" if option == "--set" else text
    result = CliRunner().invoke(main, ["simulate", str(PENDULUM), "--out", "none.csv", option, value])
    assert result.exit_code == (1 if option == "--set" else 2), result.output
    wanted = {"--set": "write NAME=NUMBER", "--iterations": "is not a whole number"}.get(option, "is not a plain decimal number")
    assert wanted in " ".join(result.output.split())


@pytest.mark.parametrize("text", ["1_0", "\uff11\uff10", "inf", "0x10"])
def test_tables_of_parameters_refuse_what_is_no_plain_number(text: str, tmp_path: Path) -> None:
    table = tmp_path / "runs.csv"
    model = read_model(MODELS / "iltis.yaml")
    name = next(p.name for p in model.parameters if p.binding == "param")
    table.write_text(f"{name}\n{text}\n", encoding="utf-8")
    with pytest.raises(RunError, match="is not a finite number; write a plain number in SI units"):
        read_cases(table, model)


ESCAPES = "\x1b[31m\x07\x9b2J\u202e"


@needs_cpp
@pytest.mark.parametrize(
    "arguments",
    [
        ("check", str(PENDULUM), "--scene", ESCAPES),
        ("simulate", str(PENDULUM), "--out", "none.csv", "--set", f"{ESCAPES}=1"),
        ("simulate", str(PENDULUM), "--out", "none.csv", "--set", ESCAPES),
        ("simulate", str(PENDULUM), "--out", "none.csv", "--dt", ESCAPES),
        ("simulate", str(PENDULUM), "--out", "none.csv", "--method", ESCAPES),
        ("check", ESCAPES),
        ("check", str(PENDULUM), ESCAPES),
        ("check", str(PENDULUM), f"--{ESCAPES}"),
        (f"check{ESCAPES}",),
        (f"--{ESCAPES}",),
    ],
)
def test_messages_repeat_no_control_characters(arguments: tuple[str, ...]) -> None:
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code in (1, 2)
    assert "x1b" in result.output
    assert not {"\x1b", "\x07", "\x9b", "\u202e"} & set(result.output)


def test_a_file_with_control_characters_in_its_name(tmp_path: Path) -> None:
    file = tmp_path / f"{ESCAPES}[red].yaml"
    file.write_text("cutjoint: 2\n", encoding="utf-8")
    result = CliRunner().invoke(main, ["check", str(file)])
    assert result.exit_code == 1
    assert r"\x1b[31m\x07\x9b2J\u202e[red].yaml:1:" in result.output
    assert "\x1b" not in result.output
