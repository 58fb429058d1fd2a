"""A cache that somebody else can write is refused by name; the message says what cures it."""

from __future__ import annotations

import os
import shlex
import shutil
import stat
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import pytest

from cutjoint.package.errors import ToolchainError
from cutjoint.toolchain import cache, drivers
from cutjoint.toolchain.cache import cache_folder, find_or_make, installed_folder, is_sound, read_record, write_record
from tests.toolchain.test_damage import make

#: Somebody else.
OTHER = 65534

needs_root = pytest.mark.skipif(os.geteuid() != 0, reason="gives files to another user")


def _give(*paths: Path) -> None:
    for path in paths:
        os.lchown(path, OTHER, OTHER)


def _swap_by_link(path: Path, owner: int) -> None:
    """A link in place of a file, which leads to the file."""
    moved = path.with_name(f"{path.name}.moved")
    path.rename(moved)
    path.symlink_to(moved)
    os.lchown(path, owner, owner)


#: By name: what happens to the file of a cache, and the part of its path that the message names (0: the file, 1: its folder, ...).
OPEN: Mapping[str, tuple[Callable[[Path], object], int]] = {
    "file": (lambda file: file.chmod(0o777), 0),
    "folder": (lambda file: file.parent.chmod(0o777), 1),
    "store": (lambda file: file.parent.parent.chmod(0o777), 2),
    "sticky store": (lambda file: file.parent.parent.chmod(0o1777), 2),
    "parent": (lambda file: file.parent.parent.parent.chmod(0o777), 3),
    "grandparent": (lambda file: file.parent.parent.parent.parent.chmod(0o777), 4),
}
FOREIGN: Mapping[str, tuple[Callable[[Path], object], int]] = {
    "file of another": (lambda file: _give(file), 0),
    "folder of another": (lambda file: _give(file.parent), 1),
    "store of another": (lambda file: _give(file.parent.parent), 2),
    "parent of another": (lambda file: _give(file.parent.parent.parent), 3),
    "link of another": (lambda file: _swap_by_link(file, OTHER), 0),
    "link to a folder of another": (lambda file: _swap_by_link(file.parent, OTHER), 1),
    "parent is a link of another": (lambda file: _swap_by_link(file.parent.parent.parent, OTHER), 3),
    "file of a foreign group": (lambda file: (os.chown(file, -1, OTHER), file.chmod(0o775)), 0),
    "store of a foreign group": (lambda file: (os.chown(file.parent.parent, -1, OTHER), file.parent.parent.chmod(0o2775)), 2),
}
CASES = [
    *(pytest.param(*case, id=name) for name, case in OPEN.items()),
    *(pytest.param(*case, id=name, marks=needs_root) for name, case in FOREIGN.items()),
]


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A file of a cache in a folder in a folder."""
    monkeypatch.setenv("CUTJOINT_CACHE", str(tmp_path / "above" / "cache"))
    monkeypatch.delenv("CUTJOINT_CACHE_GROUP", raising=False)
    found = cache_folder() / "key" / "simulator"
    assert find_or_make(found, make)
    write_record(cache_folder() / "key" / "record.json", {"x": 1})
    yield found
    tmp_path.chmod(0o700)


@pytest.mark.parametrize(("harm", "level"), CASES)
def test_what_others_can_write_is_refused_by_name(harm: Callable[[Path], object], level: int, file: Path) -> None:
    named = (file, *file.parents)[level]
    harm(file)
    uses = [lambda: is_sound(file), lambda: find_or_make(file, make), lambda: cache.fetch(file, file.parents[3] / "copy")]
    for use in uses:
        with pytest.raises(ToolchainError, match=rf"the cache {cache_folder()} is not safe: {named} (can be written by|belongs to) .*; "):
            use()
    assert not (file.parents[3] / "copy").exists()


@pytest.mark.parametrize(("harm", "level"), CASES)
def test_so_is_a_record(harm: Callable[[Path], object], level: int, file: Path) -> None:
    record = file.with_name("record.json")
    harm(record)
    uses = [lambda: read_record(record), *([lambda: write_record(record, {})] if level else [])]
    for use in uses:
        with pytest.raises(ToolchainError, match="is not safe"):
            use()
    if not level:  # in place of what another left there
        write_record(record, {"x": 2})
        assert read_record(record) == {"x": 2}


@pytest.mark.parametrize("name", OPEN)
def test_the_chmod_of_the_message_cures_it(name: str, file: Path) -> None:
    OPEN[name][0](file)
    with pytest.raises(ToolchainError) as error:
        is_sound(file)
    command = shlex.split(str(error.value).split("; ", 1)[1].split(" if nobody")[0])
    assert command[0] == "chmod"
    subprocess.run(command, check=True)
    assert is_sound(file)


@needs_root
def test_the_digest_of_another_user_is_none(file: Path) -> None:
    _give(file.with_name("simulator.sha256"))
    with pytest.raises(ToolchainError, match=r"simulator.sha256 belongs to user"):
        is_sound(file)


def test_sticky_parents_are_safe(file: Path) -> None:
    file.parents[2].chmod(0o1777)
    assert is_sound(file)


def test_links_of_ones_own_are_followed(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (file.parents[3] / "link").symlink_to("above/../above")
    monkeypatch.setenv("CUTJOINT_CACHE", str(file.parents[3] / "link" / "cache"))
    assert is_sound(cache_folder() / "key" / "simulator")
    file.parents[2].chmod(0o777)  # where the link leads
    with pytest.raises(ToolchainError, match=f"{file.parents[2]} can be written by everybody"):
        is_sound(cache_folder() / "key" / "simulator")


def test_what_is_stored_can_be_written_by_nobody_else_under_any_umask(file: Path) -> None:
    before = os.umask(0)
    try:
        place = cache_folder() / "other" / "deep" / "simulator"
        assert find_or_make(place, make)
        write_record(cache_folder() / "runs" / "record.json", {})
        shutil.rmtree(cache_folder())
        assert find_or_make(place, make)
    finally:
        os.umask(before)
    for path in (cache_folder(), *cache_folder().rglob("*")):
        assert not path.stat().st_mode & (stat.S_IWGRP | stat.S_IWOTH), path
    assert is_sound(place)


@needs_root
def test_a_group_that_is_named_shares_the_cache(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.rmtree(cache_folder())
    monkeypatch.setenv("CUTJOINT_CACHE_GROUP", str(OTHER))
    find_or_make(file, make)
    for path in (cache_folder(), file.parent):
        assert (path.stat().st_gid, path.stat().st_mode & 0o7777) == (OTHER, 0o2775)
    assert (file.stat().st_gid, file.stat().st_mode & 0o777) == (OTHER, 0o755)
    for path in (file, file.with_name("simulator.sha256"), file.parent):
        os.chown(path, OTHER, OTHER)  # by another member
    assert is_sound(file)
    os.chown(file, OTHER, 65533)
    with pytest.raises(ToolchainError, match="belongs to user"):
        is_sound(file)
    file.chmod(0o777)
    os.chown(file, 0, OTHER)
    with pytest.raises(ToolchainError, match="can be written by everybody"):
        is_sound(file)


def test_a_group_that_is_none(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CUTJOINT_CACHE_GROUP", "no such group")
    with pytest.raises(ToolchainError, match="CUTJOINT_CACHE_GROUP=no such group: no such group; set it to the group"):
        is_sound(file)


@pytest.mark.parametrize("harm", ["store", pytest.param("file of another", marks=needs_root)])
def test_what_stands_beside_the_installation_is_looked_at_too(harm: str, file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "prefix", str(file.parents[3] / "installed"))
    place = drivers.Part(name="driver", digest="0").place(installed_folder())
    find_or_make(place, make)
    assert is_sound(place)
    {**OPEN, **FOREIGN}[harm][0](place)
    with pytest.raises(ToolchainError, match=rf"the library {installed_folder()} is not safe: .*; .*remove {installed_folder()}$"):
        is_sound(place)
