"""Machines that share a cache: what "native" means is part of its keys."""

from __future__ import annotations

from pathlib import Path

import pytest

from cutjoint.toolchain import compiler
from cutjoint_bench.generic import build as generic_build
from cutjoint_bench.peers import compile_cpp
from tests.toolchain.test_locks import Site, pytestmark, site

__all__ = ["pytestmark", "site"]

NATIVE = ("-O1", "-march=native")

X86 = "processor\t: {i}\nvendor_id\t: {vendor}\nmodel\t\t: 17\ncpu MHz\t\t: {speed}\nflags\t\t: {flags}\n\n"
ARM = "processor\t: {i}\nBogoMIPS\t: {speed}\nFeatures\t: {flags}\nCPU implementer\t: {vendor}\nCPU part\t: 0xd40\n\n"


def touched(path: Path) -> Path:
    path.touch()
    return path


def capabilities(folder: Path, text: str) -> tuple[str, ...]:
    (folder / "cpuinfo").write_text(text, encoding="utf-8")
    compiler.processor.cache_clear()
    try:
        return compiler.processor(folder / "cpuinfo")
    finally:
        compiler.processor.cache_clear()


@pytest.mark.parametrize("block", [X86, ARM])
def test_a_processor_is_what_it_can_do(block: str, tmp_path: Path) -> None:
    """Neither how fast it is now, nor how many there are, nor the order in which the kernel writes."""
    first = capabilities(tmp_path, "".join(block.format(i=i, vendor="one", speed=1000 + i, flags="fma avx2") for i in range(4)))
    assert first == capabilities(tmp_path, block.format(i=0, vendor="one", speed=3000, flags="avx2 fma"))
    assert first != capabilities(tmp_path, block.format(i=0, vendor="one", speed=1000, flags="avx2 fma avx512f"))
    assert first != capabilities(tmp_path, block.format(i=0, vendor="other", speed=1000, flags="avx2 fma"))


@pytest.mark.parametrize("text", ["", "nothing\n"])
def test_a_machine_that_does_not_tell_has_its_name(text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiler.platform, "node", lambda: "here")
    assert capabilities(tmp_path, text)[0].endswith(" here")
    assert compiler.processor(tmp_path / "none") == capabilities(tmp_path, text)


def test_each_processor_has_its_simulator_and_parts(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    site.open_gate()
    built = {}
    for name in ("avx2", "avx512f", "avx2"):
        monkeypatch.setattr(compiler, "processor", lambda name=name: (name,))
        assert site.build("one", NATIVE).fresh is (name not in built)
        built[name] = site.build("one", NATIVE).path
    assert built["avx2"] != built["avx512f"]
    assert site.log == 2 * ["simulator one", "parts"]


def test_flags_that_name_no_processor_are_the_same_everywhere(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    site.open_gate()
    assert site.build("one", ("-O1", "-mavx2")).fresh
    monkeypatch.setattr(compiler, "processor", lambda: ("another",))
    assert not site.build("one", ("-O1", "-mavx2")).fresh


def test_each_processor_has_its_generic_solver_and_its_peers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CUTJOINT_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(generic_build, "_build_in", lambda folder, compiler, flags: touched(folder / "generic"))
    monkeypatch.setattr(compile_cpp, "FLAGS", NATIVE)
    (tmp_path / "peer").mkdir()
    (tmp_path / "peer" / "main.cpp").write_text("int main() {}\n", encoding="utf-8")
    found = set()
    for name in ("avx2", "avx512f", "avx2"):
        monkeypatch.setattr(compiler, "processor", lambda name=name: (name,))
        found |= {generic_build.build_generic(flags=NATIVE).path, compile_cpp.compile_program(tmp_path / "peer", [])}
    assert len(found) == 4
