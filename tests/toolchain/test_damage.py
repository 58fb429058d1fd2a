"""Files of the cache that came to harm are made again, by one of the processes that meet them."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from cutjoint.toolchain import cache
from cutjoint.toolchain.cache import cache_folder, find_or_make, read_record, write_record
from tests.toolchain.damage import DAMAGE, damaged_records
from tests.toolchain.test_locks import Site, output, pytestmark, site

__all__ = ["pytestmark", "site"]

RECORD = {"name": "press", "counts": [["bodies", 3]], "run": {"end": 2.0, "parameters": {"stiffness": 2000.0}}, "following": []}


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A file of a cache."""
    monkeypatch.setenv("CUTJOINT_CACHE", str(tmp_path / "cache"))
    return cache_folder() / "key" / "simulator"


def make(folder: Path) -> Path:
    program = folder / "made"
    program.write_text("#!/bin/sh\necho sound\n", encoding="utf-8")
    program.chmod(0o755)
    return program


@pytest.mark.parametrize("damage", DAMAGE)
def test_what_came_to_harm_is_made_again(damage: str, file: Path) -> None:
    assert [find_or_make(file, make) for _ in range(2)] == [True, False]
    DAMAGE[damage](file)
    assert [find_or_make(file, make) for _ in range(2)] == [True, False]
    assert os.access(file, os.X_OK)
    assert file.read_text(encoding="utf-8").endswith("echo sound\n")
    assert sorted(p.name for p in cache_folder().rglob("*")) == ["key", "simulator", "simulator.sha256"]


@pytest.mark.parametrize("damage", ["empty", "cut off", "a bit flipped", "not executable", "a folder"])
def test_two_processes_that_meet_a_damaged_simulator(damage: str, site: Site) -> None:
    site.open_gate()
    DAMAGE[damage](site.build("one").path)
    both = [site.ask("one"), site.ask("one")]
    assert sorted(p.communicate(timeout=120)[0] for p in both) == ["False\n", "True\n"]
    assert site.log == ["simulator one", "parts", "simulator one"]
    assert output(site.build("one")) == "one\n"


@pytest.mark.parametrize("damage", ["empty", "cut off", "a bit flipped", "a folder"])
def test_a_damaged_part_of_the_driver_is_built_again(damage: str, site: Site) -> None:
    site.open_gate()
    site.build("one")
    (part,) = (site.folder / "cache").glob("integrators-*/libintegrators.a")
    DAMAGE[damage](part)
    assert output(site.build("other")) == "other\n"
    assert output(site.build("third")) == "third\n"
    assert site.log == ["simulator one", "parts", "simulator other", "parts", "simulator third"]


def test_a_record_is_what_was_written_or_none(file: Path) -> None:
    place = cache_folder() / "runs" / "key.json"
    write_record(place, RECORD)
    assert read_record(place) == RECORD
    content = place.read_bytes()
    damaged = list(damaged_records(content))
    assert len(damaged) > 100
    for harmed in damaged:
        place.write_bytes(harmed)
        assert read_record(place) is None
    write_record(place, RECORD)
    assert place.read_bytes() == content


@pytest.mark.parametrize("damage", [name for name in DAMAGE if "digest" not in name and name != "not executable"])
def test_a_record_that_came_to_harm_is_written_again(damage: str, file: Path) -> None:
    place = cache_folder() / "runs" / "key.json"
    write_record(place, RECORD)
    DAMAGE[damage](place)
    assert read_record(place) is None
    write_record(place, RECORD)
    assert read_record(place) == RECORD


def test_a_copy_of_a_damaged_file_is_not_taken(file: Path, tmp_path: Path) -> None:
    """Also where it comes to harm between the check and the copy."""
    find_or_make(file, make)
    assert cache.fetch(file, tmp_path / "copy")
    DAMAGE["a bit flipped"](file)
    assert not cache.fetch(file, tmp_path / "copy")
