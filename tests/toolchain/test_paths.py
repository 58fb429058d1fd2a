"""Names of folders mean nothing to what builds: whatever characters they have, and where nothing can be written."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from cutjoint.emit.source import Source
from cutjoint.package import locations
from cutjoint.package.errors import ToolchainError
from cutjoint.toolchain import build, cache, cmake
from cutjoint.toolchain.cache import find_or_make, is_sound
from tests.toolchain.test_damage import make
from tests.toolchain.test_locks import Site, output, pytestmark, site

__all__ = ["pytestmark", "site"]

#: Characters that CMake, Ninja, a shell or C++ would read as more than part of a name; no name of a file has a slash.
ODD = """a;b "c" 'd' \\e $(touch elsewhere) `touch elsewhere` ${CXX} $$ @x@ #g %h *i [j] (k) {l} &m |n <o> ?p !q ~r=s,t:u é"""

#: A project whose runtime has a header and a list of CMake.
WITH_RUNTIME = """
cmake_minimum_required(VERSION 3.18)
project(small CXX)
include(${CUTJOINT_RUNTIME}/small.cmake)
add_library(initial_state STATIC main.cpp)
add_library(driver STATIC main.cpp)
add_library(integrators STATIC main.cpp)
add_executable(simulator main.cpp)
target_include_directories(simulator PRIVATE ${CUTJOINT_RUNTIME}/include)
target_include_directories(initial_state PRIVATE ${CUTJOINT_RUNTIME}/include)
target_include_directories(driver PRIVATE ${CUTJOINT_RUNTIME}/include)
target_include_directories(integrators PRIVATE ${CUTJOINT_RUNTIME}/include)
"""


@pytest.mark.parametrize("name", [ODD, f"{ODD}\nsecond line", " leading and trailing ", "-O0", os.fsdecode(b"no \xff text")])
def test_any_name_of_the_cache_and_of_folders(name: str, site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    site.open_gate()
    for variable, folder in (("CUTJOINT_CACHE", "caches"), ("TMPDIR", "temporary")):
        (site.folder / folder / name).mkdir(parents=True)
        monkeypatch.setenv(variable, str(site.folder / folder / name))
    assert output(site.build("one")) == "one\n"
    assert output(site.build("other")) == "other\n"
    assert site.log == ["simulator one", "parts", "simulator other"]
    assert {p.name for p in site.folder.iterdir()} == {"caches", "temporary", "log", "gate"}
    assert [p.name for p in (site.folder / "caches").iterdir()] == [name]
    assert not Path("elsewhere").exists()


@pytest.mark.parametrize("name", [ODD, "two\nlines"])
def test_any_name_of_the_installation(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    runtime = tmp_path / name / "runtime"
    (runtime / "include").mkdir(parents=True)
    (runtime / "include" / "small.hpp").write_text("inline int zero() { return 0; }\n", encoding="utf-8")
    (runtime / "small.cmake").write_text("set(CMAKE_CXX_STANDARD 20)\n", encoding="utf-8")
    for module in (locations, cache, cmake):
        monkeypatch.setattr(module, "runtime_folder", lambda: runtime)
    monkeypatch.setenv("CUTJOINT_CACHE", str(tmp_path / "cache"))
    cache.runtime_digest.cache_clear()
    files = {"CMakeLists.txt": WITH_RUNTIME, "main.cpp": "#include <small.hpp>\nint main() { return zero(); }\n"}
    binary = build.build(Source(stem="small", files=files, digest="small", driver="recursive"), flags=())
    cache.runtime_digest.cache_clear()
    assert subprocess.run([binary.path], check=False).returncode == 0
    assert {p.name for p in tmp_path.iterdir()} == {name, "cache"}


#: A check that this user can mount a folder read-only for a process.
can_mount = pytest.mark.skipif(
    shutil.which("unshare") is None or subprocess.run(["unshare", "-rm", "true"], capture_output=True, check=False).returncode != 0,
    reason="needs user namespaces",
)


def run_mounted(folder: Path, script: str, options: str = "ro") -> subprocess.CompletedProcess[str]:
    """Python run where a folder is mounted with these options, which hold for every user."""
    mount = 'mount --bind "$0" "$0" && mount -o "remount,bind,$1" "$0" && exec "$2" -c "$3"'
    command = ["unshare", "-rm", "sh", "-c", mount, folder, options, sys.executable, script]
    return subprocess.run(command, capture_output=True, text=True, check=False)


FIND = """
from pathlib import Path
from cutjoint.package.errors import ToolchainError
from tests.toolchain.test_locks import Site
site = Site(Path({folder!r}))
print(site.build("one").fresh)
try:
    site.build("other")
except ToolchainError as error:
    print(error)
"""


@can_mount
def test_a_cache_that_cannot_be_written_does_for_what_it_has(site: Site) -> None:
    site.open_gate()
    site.build("one")
    before = sorted((site.folder / "cache").rglob("*"))
    done = run_mounted(site.folder / "cache", FIND.format(folder=str(site.folder)))
    assert done.stdout.splitlines() == [
        "False",
        f"the cache {site.folder / 'cache'} cannot be written: Read-only file system; set $CUTJOINT_CACHE to a folder that can",
    ], done.stderr
    assert sorted((site.folder / "cache").rglob("*")) == before


@pytest.mark.parametrize("place", ["a file", "below a file", "a" * 300])
def test_a_cache_that_cannot_be(place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    folder = {"a file": tmp_path / "file", "below a file": tmp_path / "file" / "below"}.get(place, tmp_path / place)
    monkeypatch.setenv("CUTJOINT_CACHE", str(folder))
    assert not is_sound(folder / "key" / "simulator")
    assert cache.read_record(folder / "runs" / "key.json") is None
    with pytest.raises(ToolchainError, match=r"the cache .* cannot be written: .*; set \$CUTJOINT_CACHE to a folder that can"):
        find_or_make(folder / "key" / "simulator", make)
    with pytest.raises(ToolchainError, match="cannot be written"):
        cache.write_record(folder / "runs" / "key.json", {})


def test_a_cache_may_be_named_from_where_one_is(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    site.open_gate()
    monkeypatch.chdir(site.folder)
    monkeypatch.setenv("CUTJOINT_CACHE", "near")
    found = site.build("one")
    monkeypatch.chdir("/")
    assert output(found) == "one\n"
