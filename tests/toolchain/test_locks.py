"""Builds at once: one process compiles what several ask for, and one that was killed holds up nobody."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from time import monotonic, sleep

import pytest

from cutjoint.emit.source import Source
from cutjoint.toolchain.build import Binary, build
from tests.conftest import needs_cpp

pytestmark = needs_cpp

#: A simulator and the driver's parts, whose project notes what it is asked to build and then waits until it may.
PROJECT = """
cmake_minimum_required(VERSION 3.18)
project(small CXX)
file(APPEND "{log}" "simulator {stem}\\n")
if(NOT DEFINED CUTJOINT_INITIAL_STATE)
  add_library(initial_state STATIC part.cpp)
endif()
if(NOT DEFINED CUTJOINT_DRIVER)
  add_library(driver STATIC part.cpp)
endif()
if(DEFINED CUTJOINT_INTEGRATORS)
  add_library(integrators STATIC IMPORTED)
  set_target_properties(integrators PROPERTIES IMPORTED_LOCATION ${{CUTJOINT_INTEGRATORS}})
else()
  file(APPEND "{log}" "parts\\n")
  add_library(integrators STATIC part.cpp)
endif()
execute_process(COMMAND sh -c "while [ ! -e '{gate}' ]; do sleep 0.02; done")
add_executable(simulator main.cpp)
target_link_libraries(simulator integrators)
"""

#: Builds a source in a process of its own, and says so before.
SCRIPT = """
import sys
from pathlib import Path
from tests.toolchain.test_locks import Site
sys.prefix = str(Path(sys.argv[1]) / "installed")  # without drivers
print("asks", flush=True)
print(Site(Path(sys.argv[1])).build(sys.argv[2]).fresh)
"""


@dataclass(frozen=True)
class Site:
    """A folder with a cache, the log of the builds, and their gate."""

    folder: Path

    @property
    def log(self) -> list[str]:
        """Names of the builds that were begun."""
        path = self.folder / "log"
        return path.read_text(encoding="utf-8").splitlines() if path.exists() else []

    def open_gate(self) -> None:
        (self.folder / "gate").touch()

    def build(self, stem: str, flags: tuple[str, ...] = ()) -> Binary:
        project = PROJECT.format(log=self.folder / "log", gate=self.folder / "gate", stem=stem)
        main = f'#include <cstdio>\nint part();\nint main() {{ std::puts("{stem}"); return part() - 1; }}\n'
        files = {"CMakeLists.txt": project, "main.cpp": main, "part.cpp": "int part() { return 1; }\n"}
        return build(Source(stem=stem, files=files, digest=stem, driver="recursive"), flags=flags)

    def ask(self, stem: str) -> subprocess.Popen[str]:
        """A process that is about to build."""
        process = subprocess.Popen([sys.executable, "-c", SCRIPT, self.folder, stem], stdout=subprocess.PIPE, text=True)
        assert process.stdout is not None
        assert process.stdout.readline() == "asks\n"
        return process

    def wait_for(self, *lines: str) -> None:
        """Until these lines are in the log."""
        limit = monotonic() + 120
        while not set(lines) <= set(self.log):
            assert monotonic() < limit, self.log
            sleep(0.02)


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Site]:
    monkeypatch.setenv("CUTJOINT_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(sys, "prefix", str(tmp_path / "installed"))  # without drivers
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(p for p in sys.path if p))
    monkeypatch.chdir(Path(__file__).parents[2])
    found = Site(tmp_path)
    yield found
    found.open_gate()


def output(binary: Binary) -> str:
    return subprocess.run([binary.path], capture_output=True, text=True, check=True).stdout


def test_what_was_compiled_is_found_and_other_flags_compile_again(site: Site) -> None:
    site.open_gate()
    assert [site.build("one").fresh for _ in range(2)] == [True, False]
    assert [site.build("one", ("-O0",)).fresh for _ in range(2)] == [True, False]
    assert site.log == 2 * ["simulator one", "parts"]


def test_one_of_two_processes_compiles(site: Site) -> None:
    first = site.ask("one")
    site.wait_for("simulator one")
    second = site.ask("one")
    site.open_gate()
    assert sorted(p.communicate(timeout=120)[0] for p in (first, second)) == ["False\n", "True\n"]
    assert site.log == ["simulator one", "parts"]
    found = site.build("one")
    assert not found.fresh
    assert output(found) == "one\n"


def test_one_of_two_threads_compiles(site: Site) -> None:
    with ThreadPoolExecutor(max_workers=2) as pool:
        first = pool.submit(site.build, "one")
        site.wait_for("simulator one")
        second = pool.submit(site.build, "one")
        sleep(0.2)  # the second meets the first one's lock
        site.open_gate()
        binaries = [first.result(timeout=120), second.result(timeout=120)]
    assert [b.fresh for b in binaries] == [True, False]
    assert site.log == ["simulator one", "parts"]
    assert [output(b) for b in binaries] == ["one\n", "one\n"]


def test_the_parts_of_the_driver_are_compiled_once_for_two_simulators(site: Site) -> None:
    first = site.ask("one")
    site.wait_for("simulator one", "parts")
    second = site.ask("other")
    site.open_gate()
    assert [p.communicate(timeout=120)[0] for p in (first, second)] == ["True\n", "True\n"]
    assert site.log == ["simulator one", "parts", "simulator other"]
    assert [output(site.build(stem)) for stem in ("one", "other")] == ["one\n", "other\n"]


def test_a_process_that_was_killed_holds_up_nobody(site: Site) -> None:
    killed = site.ask("one")
    site.wait_for("simulator one", "parts")
    killed.send_signal(signal.SIGKILL)
    killed.communicate()
    # it had the locks of the simulator, of all parts and of the folder where it built
    assert len(list((site.folder / "cache").glob("*.lock"))) == 5
    site.open_gate()
    assert site.ask("one").communicate(timeout=120)[0] == "True\n"
    found = site.build("one")
    assert not found.fresh
    assert output(found) == "one\n"
