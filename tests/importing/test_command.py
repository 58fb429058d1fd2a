"""`cutjoint import`, and commands that take a file of another program as it is."""

from __future__ import annotations

import sys
from pathlib import Path
from shutil import copy

import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.topology.reading import read_model

LEG = Path(__file__).with_name("leg.urdf")


def call(*words: str) -> str:
    result = CliRunner().invoke(main, list(words))
    assert result.exit_code == 0, result.output
    return result.output


def test_a_file_becomes_a_model_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    copy(LEG, tmp_path)
    said = call("import", "leg.urdf")
    assert "left out: collision (1), limit (1)" in said
    written = tmp_path / "leg.urdf.yaml"
    assert written.read_text().startswith("# From leg.urdf.\n")
    assert read_model("leg.urdf").text == written.read_text()
    assert "lines of leg.urdf.yaml are those of the model file that 'cutjoint import leg.urdf' writes" in call("check", "leg.urdf")


def test_a_base_that_moves(tmp_path: Path) -> None:
    path = tmp_path / "one.urdf"
    link = '<link name="a"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>'
    path.write_text(f'<robot name="r">{link}</robot>')
    call("import", str(path), "--base", "free", "--out", str(tmp_path / "free.yaml"))
    (joint,) = read_model(tmp_path / "free.yaml").joints
    assert (joint.name, joint.kind) == ("a_free", "free")


def test_no_file_of_the_user_is_written_over(tmp_path: Path) -> None:
    copy(LEG, tmp_path)
    (tmp_path / "leg.yaml").write_text("kept: 1\n")
    for out in ("leg.urdf", "leg.yaml"):
        result = CliRunner().invoke(main, ["import", str(tmp_path / "leg.urdf"), "--out", str(tmp_path / out)])
        assert result.exit_code != 0
        assert "would overwrite" in result.output or "is" in result.output
    assert (tmp_path / "leg.yaml").read_text() == "kept: 1\n"
    assert (tmp_path / "leg.urdf").read_text() == LEG.read_text()
    result = CliRunner().invoke(main, ["import", str(tmp_path / "leg.yaml")])
    assert "has an unknown format" in result.output


def test_bench_takes_such_a_file() -> None:
    pytest.importorskip("cutjoint_bench")
    result = CliRunner().invoke(main, ["bench", str(LEG), "--scenes", "nothing"])
    assert "no scene 'nothing'; there is motion" in str(result.exception or "") + result.output


@pytest.mark.parametrize(("code", "message"), [
    ("raise ImportError('libGL.so.1 is not there')", "the package mujoco is installed but cannot be imported: libGL.so.1 is not there"),
    ("import an_absent_package", "the package mujoco is installed but cannot be imported: No module named 'an_absent_package'"),
    ("raise ModuleNotFoundError(name='mujoco')", "reading MJCF needs the package mujoco: pip install"),
])  # fmt: skip
def test_a_mujoco_that_cannot_be_imported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: str, message: str) -> None:
    (tmp_path / "mujoco.py").write_text(code)
    (tmp_path / "robot.xml").write_text("<mujoco/>")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "mujoco", raising=False)
    result = CliRunner().invoke(main, ["import", str(tmp_path / "robot.xml")])
    assert (result.exit_code, message in result.output) == (1, True), result.output
