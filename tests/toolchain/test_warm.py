"""Code that does not depend on the model is compiled once, beside the installation, for all caches."""

from __future__ import annotations

import shutil
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.package import locations
from cutjoint.toolchain import cache, cmake
from cutjoint.toolchain.build import warm
from tests.toolchain.damage import DAMAGE
from tests.toolchain.test_locks import Site, output, pytestmark, site

__all__ = ["pytestmark", "site"]

#: The libraries of a driver, the simulator that interprets programs, and a note of each build.
DRIVER = """
cmake_minimum_required(VERSION 3.18)
project(small CXX)
file(APPEND "{log}" "driver ${{CUTJOINT_DRIVER_KIND}} ${{CUTJOINT_FLAGS}}\\n")
foreach(part initial_state driver integrators)
  string(TOUPPER ${{part}} name)
  if(NOT DEFINED CUTJOINT_${{name}})
    add_library(${{part}} STATIC part.cpp)
  endif()
endforeach()
file(WRITE "${{CMAKE_BINARY_DIR}}/simulator" "interpreter")
"""


@pytest.fixture
def installation(site: Site, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder where cutjoint is installed, with a driver that is compiled fast."""
    runtime = site.folder / "runtime"
    (runtime / "driver" / "alone").mkdir(parents=True)
    (runtime / "driver" / "alone" / "CMakeLists.txt").write_text(DRIVER.format(log=site.folder / "log"), encoding="utf-8")
    (runtime / "driver" / "alone" / "part.cpp").write_text("int part() { return 1; }\n", encoding="utf-8")
    for module in (locations, cache, cmake):
        monkeypatch.setattr(module, "runtime_folder", lambda: runtime)
    monkeypatch.setattr(sys, "prefix", str(site.folder / "installed"))
    cache.runtime_digest.cache_clear()
    site.open_gate()
    return site.folder / "installed"


@pytest.fixture(autouse=True)
def forget_digests() -> object:
    """The digest of the real runtime afterwards."""
    yield None
    cache.runtime_digest.cache_clear()


def test_a_warm_driver_serves_every_cache(installation: Path, site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    assert [warm("recursive", flags=()) for _ in range(2)] == [True, False]
    for name in ("one cache", "another"):
        monkeypatch.setenv("CUTJOINT_CACHE", str(site.folder / name))
        assert output(site.build("one")) == "one\n"
        assert not list((site.folder / name).glob("driver-*"))
    assert site.log == ["driver recursive ", "simulator one", "simulator one"]


def test_drivers_of_several_flags_and_kinds_stand_side_by_side(installation: Path, site: Site) -> None:
    for kind, flags in (("recursive", ()), ("recursive", ("-O1",)), ("lagrangian", ()), ("recursive", ())):
        warm(kind, flags=flags)
    assert site.log == ["driver recursive ", "driver recursive -O1", "driver lagrangian "]


def test_drivers_of_another_version_are_removed(installation: Path, site: Site) -> None:
    warm("recursive", flags=())
    (old,) = (installation / "share" / "cutjoint").glob("drivers-*")
    (site.folder / "runtime" / "driver" / "more.cpp").touch()
    cache.runtime_digest.cache_clear()
    assert warm("recursive", flags=())
    (new,) = (installation / "share" / "cutjoint").glob("drivers-*")
    assert new != old


@pytest.mark.parametrize("damage", ["empty", "a bit flipped", "a folder", "digest gone"])
def test_a_damaged_driver_is_built_again(damage: str, installation: Path, site: Site) -> None:
    warm("recursive", flags=())
    (part,) = installation.glob("share/cutjoint/*/integrators-*/libintegrators.a")
    DAMAGE[damage](part)
    assert output(site.build("one")) == "one\n"  # with one of the cache
    assert not warm("recursive", flags=())  # which does for other caches from now on
    shutil.rmtree(site.folder / "cache")
    assert output(site.build("one")) == "one\n"
    assert site.log.count("parts") == 1


def test_a_driver_that_is_damaged_everywhere_is_built_again(installation: Path, site: Site) -> None:
    warm("recursive", flags=())
    (part,) = installation.glob("share/cutjoint/*/integrators-*/libintegrators.a")
    DAMAGE["a bit flipped"](part)
    assert [warm("recursive", flags=()) for _ in range(2)] == [True, False]
    assert output(site.build("one")) == "one\n"
    assert site.log == ["driver recursive ", "driver recursive ", "simulator one"]


def test_an_installation_that_cannot_be_written(installation: Path, site: Site) -> None:
    installation.touch()  # a file, where even root cannot make a folder
    assert [warm("recursive", flags=()) for _ in range(2)] == [True, False]
    assert len(list((site.folder / "cache").glob("driver-*"))) == 1
    assert output(site.build("one")) == "one\n"
    assert site.log == ["driver recursive ", "simulator one"]


def test_one_of_two_builds_the_driver(installation: Path, site: Site) -> None:
    with ThreadPoolExecutor(max_workers=2) as pool:
        assert sorted(pool.map(lambda _: warm("recursive", flags=()), range(2))) == [False, True]
    assert site.log == ["driver recursive "]


def test_the_command_says_what_it_did(installation: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    results = [CliRunner().invoke(main, ["warm", "--driver", "recursive"]) for _ in range(2)]
    assert [r.exit_code for r in results] == [0, 0]
    assert "driver recursive: compiled (" in results[0].output
    assert "driver recursive: up to date (" in results[1].output
