"""Flags of a compiler: one small file shows whether they make programs or libraries, before CMake fails with them in words of its own."""

import re
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path

from cutjoint.package.errors import ToolchainError
from cutjoint.toolchain.cache import cache_folder, digest_of, read_record, write_record
from cutjoint.toolchain.children import call
from cutjoint.toolchain.compiler import Compiler, resolve

#: Flags that every compiler accepts, including the default ones.
_KNOWN = re.compile(r"-O[0-3]|-march=native")

#: A program that uses the language features of generated code and prints a result.
_PROGRAM = """
#include <cmath>
#include <concepts>
#include <cstdio>
#include <stdexcept>
#include <vector>

template <std::floating_point T>
T root(const std::vector<T>& x) {
  if (x.empty()) throw std::runtime_error("empty");
  return std::sqrt(x.front());
}

int main(int words, char**) {
  try {
    std::printf("%g\\n", root(std::vector<double>(words, 4.0 * words)));
  } catch (const std::exception& error) {
    std::puts(error.what());
  }
}
"""
_PRINTED = "2\n"

#: The status of a program that the system refuses to run, for example on a disk mounted with noexec.
_NOT_STARTED = 126


def are_known(flags: Sequence[str]) -> bool:
    """Return whether flags need no check."""
    return all(map(_KNOWN.fullmatch, flags))


def require_flags(
    compiler: Compiler, flags: Sequence[str], folder: Path, environment: Mapping[str, str], *, runs: bool, shared: bool
) -> None:  # fmt: skip
    """Check that a compiler makes programs with flags, which run if code for this machine is asked for, or a ``shared`` library.

    What passed is in the cache.

    Raises:
        ToolchainError: it does not, though it does without them.
    """
    key = digest_of([*compiler.command, *compiler.key, *resolve(flags), _PROGRAM, str(runs), str(shared)])
    place = cache_folder() / "flags" / f"{key}.json"
    if are_known(flags) or read_record(place) is not None:
        return
    (folder / "program.cpp").write_text(_PROGRAM, encoding="utf-8")
    how = (folder, environment, runs, shared)
    if (fault := _find_fault(compiler, flags, *how)) and not _find_fault(compiler, (), *how):
        raise ToolchainError(f"flags {shlex.join(flags)}: {fault}; write others, or unset $CUTJOINT_FLAGS")
    if not fault:
        write_record(place, True)


def _find_fault(
    compiler: Compiler, flags: Sequence[str], folder: Path, environment: Mapping[str, str], runs: bool, shared: bool
) -> str:  # fmt: skip
    """The fault of flags in words; "" if they have none."""
    try:
        words = shlex.split(" ".join(flags))  # as CMake splits them
    except ValueError as error:
        return str(error)
    made, program = folder / "program.o", folder / "program"
    independent, linked = (("-fPIC",), ("-shared",)) if shared else ((), ())
    status, said = call([*compiler.command, "-std=c++20", *independent, *words, "-c", "program.cpp", "-o", str(made)], environment, folder)
    if status:
        return f"the compiler refuses them{_first_error(said)}"
    if not made.is_file():
        return "the compiler makes no object file with them"
    status, said = call([*compiler.command, *linked, str(made), "-o", str(program)], environment, folder)
    made.unlink()
    if status:
        return f"what the compiler makes with them makes no {'library' if shared else 'program'}{_first_error(said)}"
    status, said = call([str(program)], environment, folder) if runs and not shared else (0, _PRINTED)
    return "" if status == _NOT_STARTED or (status, said) == (0, _PRINTED) else f"a program made with them ends with status {status}"


def _first_error(said: str) -> str:
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    telling = ("error", "undefined", "recompile with")
    found = next((line for line in lines if any(word in line.lower() for word in telling)), lines[0] if lines else "")
    return f": {found}" if found else ""
