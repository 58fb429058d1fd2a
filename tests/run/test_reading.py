"""Models that the cache keeps: they equal what is read, and give way to any change."""

from __future__ import annotations

import os
import subprocess
import sys
from hashlib import sha256
from pathlib import Path

import pytest

from cutjoint.compile.pipeline import generate
from cutjoint.model.errors import ModelError
from cutjoint.model.records import Model
from cutjoint.run import reading
from cutjoint.toolchain import origins
from cutjoint.toolchain.cache import cache_folder
from cutjoint.topology import reading as from_files
from tests.conftest import MODELS

_MODEL = """cutjoint: 1
name: slide
gravity: [0, 0, -9.81]
submodels: {block: {include: block.yaml}}
instances: {one: {use: block, with: {m: 2}}}
scenes: {fall: {end: 1}}
outputs: [one.rail.displacement]
"""
_BLOCK = """cutjoint: 1
parameters: [m]
bodies: {block: {mass: m, centre_of_mass: [0, 0, 0]}}
joints: {rail: {kind: prismatic, bodies: [ground, block], at: [0, 0, 0], axis: z}}
"""


@pytest.fixture
def model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A model, which takes long to read, that names another file."""
    monkeypatch.setenv("CUTJOINT_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(reading, "_LONG", -1.0)
    (tmp_path / "block.yaml").write_text(_BLOCK)
    (tmp_path / "slide.yaml").write_text(_MODEL)
    return tmp_path / "slide.yaml"


@pytest.fixture
def reads(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The files that are read, not taken from the cache."""
    read, made = from_files.read_model, list[str]()

    def watch(path: str, **how: object) -> Model:
        made.append(str(path))
        return read(path, **how)  # type: ignore[arg-type]

    monkeypatch.setattr(from_files, "read_model", watch)
    return made


def mass(found: Model) -> float:
    return float(found.bodies[0].mass)


def test_a_model_is_read_once_until_something_changes(model: Path, reads: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    first = reading.read_model(model)
    assert (reading.read_model(model), len(reads)) == (first, 1)
    assert [p.name for p in reading.read_model(model, tunable=["*.mass"]).parameters] == ["one.block.mass"]
    assert len(reads) == 2
    model.write_text(_MODEL.replace("m: 2", "m: 3"))
    assert (mass(reading.read_model(model)), len(reads)) == (3.0, 3)
    model.with_name("block.yaml").write_text(_BLOCK.replace("mass: m", "mass: 2*m"))
    assert (mass(reading.read_model(model)), len(reads)) == (6.0, 4)
    monkeypatch.setattr(reading, "versions", lambda: (*origins.versions(), "another"))
    assert (mass(reading.read_model(model)), len(reads)) == (6.0, 5)
    model.with_name("block.yaml").unlink()
    with pytest.raises(ModelError, match=r"block\.yaml"):
        reading.read_model(model)


def test_a_model_that_cannot_be_kept_is_read(model: Path, reads: list[str]) -> None:
    first = reading.read_model(model)
    (place,) = (cache_folder() / "models").iterdir()
    place.write_bytes(place.read_bytes()[:-7])  # damage
    assert (reading.read_model(model), len(reads)) == (first, 2)
    assert (reading.read_model(model), len(reads)) == (first, 2)


def test_a_law_that_sympy_would_evaluate_is_not_kept(model: Path, reads: list[str]) -> None:
    model.write_text(_MODEL.replace("outputs", "forces: {law: {kind: joint_force, joint: one.rail, law: 'atan2(rate, 1)'}}\noutputs"))
    first = reading.read_model(model)
    assert (reading.read_model(model), len(reads)) == (first, 2)


def test_files_in_latin_1_keep_their_digests(tmp_path: Path) -> None:
    (tmp_path / "tyre.tir").write_bytes(b"$ 20 \xb0C\n")
    assert origins.digests_of([str(tmp_path / "tyre.tir")]) == {str(tmp_path / "tyre.tir"): sha256("$ 20 °C\n".encode()).hexdigest()}


def test_another_process_generates_the_same_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CUTJOINT_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(reading, "_LONG", -1.0)
    read = reading.read_model(MODELS / "six_bar.yaml")
    script = (
        "import sys; from cutjoint.run import reading; from cutjoint.topology import reading as r; r.read_model = None\n"
        "from cutjoint.compile.pipeline import generate\n"
        "m = reading.read_model(sys.argv[1]); s = next(iter(m.scenes.values())); print(generate(m, s, s.outputs).source.digest)"
    )
    command = [sys.executable, "-c", script, str(MODELS / "six_bar.yaml")]
    done = subprocess.run(command, capture_output=True, text=True, env=dict(os.environ), check=True)
    scene = next(iter(read.scenes.values()))
    assert done.stdout.strip() == generate(read, scene, scene.outputs).source.digest
