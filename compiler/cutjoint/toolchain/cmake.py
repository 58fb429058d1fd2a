"""Runs CMake and Ninja in a folder whose path has no special characters.

One small file shows whether flags make programs or libraries, before CMake fails with them in words of its own.
"""

import os
import re
import shlex
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

from cutjoint.package.errors import ToolchainError
from cutjoint.package.locations import binaries_folder, runtime_folder
from cutjoint.toolchain.cache import cache_folder, digest_of, read_record, write_record
from cutjoint.toolchain.children import call, tool
from cutjoint.toolchain.compiler import PACKAGES, Compiler, find_tool, resolve, tools_path
from cutjoint.toolchain.progress import STATUS, Watch, has_listener, made_file
from cutjoint.toolchain.temporary import is_plain

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
#: Warnings are errors if the environment asks for it, as the tests do (from CMake 3.24 on); a user's compiler may have others.
_STRICT = ("-DCMAKE_COMPILE_WARNING_AS_ERROR=ON",) if os.environ.get("CUTJOINT_STRICT", "0") != "0" else ()
#: CMake's message about a program that it does not recognise as a compiler.
_UNKNOWN = "compiler identification is unknown"


def are_known(flags: Sequence[str]) -> bool:
    """Return whether flags need no check."""
    return all(map(_KNOWN.fullmatch, flags))


def require_flags(
    compiler: Compiler, flags: Sequence[str], folder: Path, environment: Mapping[str, str], *, runs: bool, shared: bool
) -> None:  # fmt: skip
    """Check that a compiler makes programs with flags, which run if code for this machine is asked for, or a ``shared`` library.

    What passed is in the cache. Raises ToolchainError: it does not, though it does without them.
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


def _find_fault(compiler: Compiler, flags: Sequence[str], folder: Path, environment: Mapping[str, str], runs: bool, shared: bool) -> str:
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


def plain_runtime(folder: Path) -> Path:
    """The runtime's folder; a copy in ``folder`` if its own path is not plain."""
    return plain_tree(runtime_folder(), folder / "runtime")


def plain_tree(tree: Path, copy: Path) -> Path:
    """A folder; a ``copy`` of it if its own path is not plain."""
    return tree if is_plain(tree) else Path(shutil.copytree(tree, copy))


def build_project(
    source: Path, out: Path, compiler: Compiler, flags: Sequence[str], *definitions: str, runs: bool = True, shared: bool = False
) -> None:  # fmt: skip
    """Configure and build a CMake project in folders with plain paths.
    The result ``runs`` on this machine or is for others; it is a program or a ``shared`` library. Raises ToolchainError: CMake or the
    compiler refused it, or no program comes of the flags."""
    scratch = out / "tmp"  # compilers that are killed leave files where $TMPDIR says
    scratch.mkdir(parents=True)
    environment = {**os.environ, "CXX": _one_word(compiler, scratch), "TMPDIR": str(scratch), "PATH": tools_path()}
    if compiler.zig:
        zig = zig_tools(scratch, *compiler.zig, target=compiler.words)
        environment["CC"], definitions = str(zig["cc"]), (*(f"-DCMAKE_{n.upper()}={zig[n]}" for n in ("ar", "ranlib")), *definitions)
    require_flags(compiler, flags, scratch, environment, runs=runs, shared=shared)
    command = [
        str(find_tool("cmake")), "-S", str(source), "-B", str(out), "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release",
        "-DCMAKE_CXX_FLAGS_RELEASE=-O2 -DNDEBUG", f"-DCUTJOINT_FLAGS={' '.join(flags)}", *_STRICT, *_shipped_headers(out), *definitions,
    ]  # fmt: skip
    if _UNKNOWN in _call(command, environment, compiler, flags):
        raise ToolchainError(f"cmake does not know this compiler ({_advice(_UNKNOWN, compiler, flags)})")
    _compile(source, out, environment, compiler, flags)


def _shipped_headers(out: Path) -> tuple[str, ...]:
    """The definition by which CMake finds the headers that a wheel for a platform has."""
    headers = binaries_folder() / "headers"
    return (f"-DCMAKE_PREFIX_PATH={plain_tree(headers, out / 'headers')}",) if headers.is_dir() else ()


def _one_word(compiler: Compiler, folder: Path) -> str:
    """A compiler as a path for CMake: its own, or a script, since CMake passes the words of $CXX to the shell unquoted."""
    if len(compiler.command) == 1 and is_plain(Path(compiler.command[0])):
        return compiler.command[0]
    return str(_script(folder / "c++", compiler.command))


def zig_tools(folder: Path, *zig: str, target: Sequence[str] = ()) -> dict[str, Path]:
    """Zig's tools by the words that call it, compilers with those of a target, as programs in a folder under the names that others have."""
    words = {"cc": ("cc", *target), "c++": ("c++", *target), "ar": ("ar",), "ranlib": ("ranlib",)}
    return {name: _script(folder / name, (*zig, *each)) for name, each in words.items()}


def _script(file: Path, command: Sequence[str]) -> Path:
    file.write_bytes(b"#!/bin/sh\nexec " + os.fsencode(shlex.join(command)) + b' "$@"\n')
    file.chmod(0o700)
    return file


def _compile(source: Path, out: Path, environment: Mapping[str, str], compiler: Compiler, flags: Sequence[str]) -> None:
    """Build the configured project, and report progress to a listener."""
    command, environment = [str(find_tool("cmake")), "--build", str(out)], {**environment, "NINJA_STATUS": STATUS}
    if not has_listener():
        _call(command, environment, compiler, flags)
        return
    planned = [made_file(line) for line in _call([*command, "--", "-n"], environment, compiler, flags).splitlines()]
    watch = Watch(source, [*compiler.key, *flags], [name for name in planned if name])
    watch.notify()
    _call(command, environment, compiler, flags, watch)
    watch.keep(out / ".ninja_log")


def _call(
    command: Sequence[str], environment: Mapping[str, str], compiler: Compiler, flags: Sequence[str], watch: Watch | None = None
) -> str:  # fmt: skip
    """The output of a command, which must succeed; ``watch`` is called with the files that it makes."""
    lines = []
    with tool(command, environment, Path(environment["TMPDIR"])) as process:
        assert process.stdout is not None
        for line in process.stdout:
            lines.append(line)
            if watch is not None and (name := made_file(line)):
                watch.finish(name)
        status = process.wait()
    text = "".join(lines)
    if status != 0:
        found = [x.strip() for x in text.splitlines() if "error" in x.lower() or "not find" in x]
        raise ToolchainError(f"{Path(command[0]).name} failed: {'; '.join(found[:5]) or text[-800:]} ({_advice(text, compiler, flags)})")
    return text


def _advice(text: str, compiler: Compiler, flags: Sequence[str]) -> str:
    if "No space left on device" in text:
        return "make room on the disk, or set $CUTJOINT_CACHE to a folder on another one"
    if "CMakeTestCXXCompiler" in text or _UNKNOWN in text:
        return f"{shlex.join(compiler.command)} does not compile C++: set $CXX to a C++20 compiler, or unset it"
    if "CMakeLists" in text:
        return f"install the C++ side: apt-get install {PACKAGES}"
    return "please report this" if are_known(flags) else f"please report this, if it is so without the flags {shlex.join(flags)} too"
