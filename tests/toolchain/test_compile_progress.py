"""Messages for those who wait for the compiler."""

from __future__ import annotations

from pathlib import Path

import pytest

from cutjoint.toolchain.cache import read_record, write_record
from cutjoint.toolchain.cmake import build_project
from cutjoint.toolchain.compiler import find_compiler
from cutjoint.toolchain.progress import Compiling, listening
from tests.conftest import needs_cpp

pytestmark = needs_cpp

PROJECT = "cmake_minimum_required(VERSION 3.18)\nproject(p CXX)\nadd_executable(p a.cpp b.cpp)\n"


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("CUTJOINT_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def compiled(folder: Path, b: str = "int main() { return 0; }\n") -> list[Compiling]:
    """Reports of the build of a project of two files."""
    source = folder / "source"
    source.mkdir(parents=True)
    for name, text in (("CMakeLists.txt", PROJECT), ("a.cpp", "int a;\n"), ("b.cpp", b)):
        (source / name).write_text(text)
    heard: list[Compiling] = []
    with listening(heard.append):
        build_project(source, folder / "out", find_compiler(), ["-O0"])
    return heard


def test_files_are_counted_and_forecast_by_what_they_took_before(tmp_path: Path) -> None:
    first, second = compiled(tmp_path / "first"), compiled(tmp_path / "second")
    for heard in (first, second):
        assert [(x.done, x.total) for x in heard] == [(0, 3), (1, 3), (2, 3), (3, 3)]
        assert heard[-1].seconds == 0.0
    assert first[0].seconds is None
    left = [x.seconds for x in second]
    assert None not in left
    assert left == sorted(left, key=lambda s: -(s or 0.0))
    assert (left[0] or 0.0) > 0.0


def test_a_longer_file_is_expected_to_take_longer(tmp_path: Path, cache: Path) -> None:
    body = "int main() { return 0; }\n"
    compiled(tmp_path / "first", body)
    ((key, known),) = read_record(cache / "seconds").items()
    fixed = {name: [100.0 if name.endswith("b.cpp.o") else 0.0, size] for name, (_, size) in known.items()}
    write_record(cache / "seconds", {key: fixed})
    assert compiled(tmp_path / "second", body + body.replace("main", "f"))[0].seconds == pytest.approx(
        100 * (2 * len(body) - 3) / len(body)
    )


def test_a_damaged_record_is_none(tmp_path: Path, cache: Path) -> None:
    compiled(tmp_path / "first")
    (cache / "seconds").write_bytes((cache / "seconds").read_bytes()[:-1])
    assert compiled(tmp_path / "second")[0].seconds is None
    assert compiled(tmp_path / "third")[0].seconds is not None
