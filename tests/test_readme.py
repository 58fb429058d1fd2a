"""The README: its model is the one in models/, its commands and its Python run, what it says of messages is so."""

from __future__ import annotations

import re
import shlex

import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model_text

from .conftest import MODELS, ROOT, needs_cpp

README = (ROOT / "README.md").read_text(encoding="utf-8")
#: Commands that compile more than one simulator; they are tried elsewhere.
LONG = ("reduce", "auto")
COMMANDS = [line for line in re.findall(r"^    \.venv/bin/cutjoint (.*)$", README, re.MULTILINE) if not any(word in line for word in LONG)]


def listing(language: str) -> str:
    (text,) = re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)
    return text


def test_the_model_is_the_one_of_the_models_folder() -> None:
    assert listing("yaml") == (MODELS / "press.yaml").read_text(encoding="utf-8")


def test_the_message_is_what_the_compiler_says() -> None:
    wrong = listing("yaml").replace("crank: {mass: 2", "crank: {mas: 2")
    with pytest.raises(ModelError) as error:
        read_model_text(wrong, "press.yaml")
    (message,) = re.findall(r"`(press\.yaml:.*?\?)`", README.replace("\n", " "))
    assert message in str(error.value)


@needs_cpp
@pytest.mark.parametrize("line", COMMANDS)
def test_the_commands_run(line: str, tmp_path, monkeypatch) -> None:
    (tmp_path / "models").symlink_to(MODELS)
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(main, shlex.split(line))
    assert done.exit_code == 0, done.output


@needs_cpp
def test_the_python_runs(capsys, monkeypatch) -> None:
    monkeypatch.chdir(ROOT)
    exec(compile(listing("python"), "README.md", "exec"), {})
    stretched = [float(line.split()[1]) for line in capsys.readouterr().out.splitlines()]
    assert len(stretched) == 3
    assert stretched == sorted(stretched, reverse=True), "a stiffer spring lets the slider go less far"


def test_it_is_short() -> None:
    assert len(README.splitlines()) <= 120
