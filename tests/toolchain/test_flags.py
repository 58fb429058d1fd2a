"""Flags that make no program are named as the cause, before anything else is built; others are checked once."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from cutjoint.package.errors import ToolchainError
from cutjoint.toolchain import cmake as module
from cutjoint.toolchain.build import build_files
from cutjoint.toolchain.cache import cache_folder
from tests.toolchain.test_locks import Site, output, pytestmark, site

__all__ = ["pytestmark", "site"]

#: Flags by kind, which are refused, and why.
REFUSED = {
    "no flag": ("hello", "the compiler refuses them: .*hello"),
    "no file": ("-include nothing.hpp", "the compiler refuses them: .*nothing.hpp"),
    "no option": ("-fnonsense", "the compiler refuses them: .*-fnonsense"),
    "no level": ("-Oh", "the compiler refuses them: .*-O"),
    "no processor": ("-march=nothing", "the compiler refuses them: .*(nothing|-march)"),
    "no language": ("-x nothing", "the compiler refuses them: .*nothing"),
    "no quote": ("-DX='", "No closing quotation"),
    "a list": ("-O2;-g", "the compiler refuses them: .*-O"),
    "a call": ("$(touch called)", "the compiler refuses them: .*(touch|called)"),
    "no plugin": ("-fplugin=nothing", "the compiler refuses them: .*plugin"),
    "older language": ("-std=c++11", "the compiler refuses them: .*floating_point"),
    "no exceptions": ("-fno-exceptions", "the compiler refuses them: .*exception"),
    "help": ("--help", "the compiler makes no object file with them"),
    "version": ("--version", "the compiler makes no object file with them"),
    "commands": ("-###", "the compiler makes no object file with them"),
    "syntax": ("-fsyntax-only", "the compiler makes no object file with them"),
    "preprocessed": ("-E", "what the compiler makes with them makes no program"),
    "assembler": ("-S", "what the compiler makes with them makes no program"),
    "dependencies": ("-M", "what the compiler makes with them makes no program"),
    "not linked": ("-fsanitize=address", "what the compiler makes with them makes no program: .*undefined"),
    "another main": ("-Dmain=other", "what the compiler makes with them makes no program: .*undefined"),
    "not run": ("-Dmain=main(){__builtin_trap();}int/**/other", "a program made with them ends with status 1[0-9][0-9]"),
}
#: Flags with which programs are made, but no libraries that are loaded.
PROGRAMS_ONLY = ("-fpie", "-fPIE -g")
TAKEN = ("-c", "-v -Wall", "-O2 -g", "-Os", "-ffast-math", "-DX='a b'", "-Winvalid-pch -pipe", "-o elsewhere")


@pytest.mark.parametrize("name", REFUSED)
def test_what_makes_no_program_is_named(name: str, site: Site) -> None:
    text, reason = REFUSED[name]
    given = tuple(text.split(" "))
    site.open_gate()
    with pytest.raises(ToolchainError) as error:
        site.build("one", given)
    said = str(error.value)
    assert re.match(f"flags {re.escape(shlex.join(given))}: ({reason}).*; write others, or unset \\$CUTJOINT_FLAGS$", said), said
    assert site.log == []
    assert not list(Path.cwd().glob("called"))


@pytest.mark.parametrize("text", PROGRAMS_ONLY)
def test_what_makes_no_library_is_named_where_one_is_made(text: str, site: Site) -> None:
    """A program is made with them all the same; the model's file is never compiled."""
    given = tuple(text.split(" "))
    site.open_gate()
    with pytest.raises(ToolchainError, match=r"^flags .*: what the compiler makes with them makes no library: .*(relocation|recompile)"):
        build_files("one", {"CMakeLists.txt": "message(FATAL_ERROR reached)\n"}, "one.so", "one", given)
    assert output(site.build("one", given)) == "one\n"


@pytest.mark.parametrize("text", TAKEN)
def test_others_are_taken(text: str, site: Site) -> None:
    site.open_gate()
    assert output(site.build("one", tuple(text.split(" ")))) == "one\n"


def test_flags_are_checked_once_and_usual_ones_never(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []
    find = module._find_fault
    monkeypatch.setattr(module, "_find_fault", lambda *args: (calls.append(args[1]), find(*args))[1])
    site.open_gate()
    for stem in ("one", "other"):
        site.build(stem, ("-O3", "-march=native"))
        site.build(stem, ("-O3", "-DX"))
    assert calls == [("-O3", "-DX")]
    assert len(list((cache_folder() / "flags").iterdir())) == 1


def test_a_compiler_that_makes_nothing_at_all_is_no_fault_of_flags(site: Site, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    broken = tmp_path / "c++"
    broken.write_text('#!/bin/sh\n[ "$1" = --version ] && echo "c++ 1" && exit\necho "error: broken" >&2\nexit 1\n', encoding="utf-8")
    broken.chmod(0o755)
    monkeypatch.setenv("CXX", str(broken))
    with pytest.raises(ToolchainError, match=r"does not compile C\+\+: set \$CXX"):
        site.build("one", ("-DX",))
