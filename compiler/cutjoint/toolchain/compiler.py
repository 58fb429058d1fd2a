"""The C++ compiler, and the processor that its flags target."""

import os
import platform
import shlex
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib.machinery import PathFinder
from itertools import pairwise
from pathlib import Path

from cutjoint.package.errors import MissingToolsError, ToolchainError
from cutjoint.package.locations import binaries_folder
from cutjoint.package.system import IS_WINDOWS

#: Debian's packages of the tools, and of all that generated code needs; wheels for a platform have the rest of it.
TOOLS = "g++ cmake ninja-build"
PACKAGES = f"{TOOLS} libeigen3-dev libsuitesparse-dev nlohmann-json3-dev"

#: The displayed name of the compiler of the package's own simulators.
SHIPPED = "no C++ compiler"
#: How to install the tools: by Debian's packages, or by those of PyPI, which need no administrator rights.
ADVICE = (
    "run it on Linux, or in the Windows Subsystem for Linux"
    if IS_WINDOWS
    else f"apt-get install {TOOLS}, or pip install 'cutjoint[compiler]'"
)

#: Environment variables besides $CXX that influence builds.
_VARIABLES = (
    "CXXFLAGS", "LDFLAGS", "CPATH", "CPLUS_INCLUDE_PATH", "LIBRARY_PATH", "COMPILER_PATH", "CMAKE_PREFIX_PATH", "CMAKE_TOOLCHAIN_FILE",
)  # fmt: skip

#: Timeout for a compiler's version, s.
_PATIENCE = 30.0
#: The properties of a processor that "native" depends on, as /proc/cpuinfo names them on x86, ARM, POWER, RISC-V and s390.
_CAPABILITIES = (
    "vendor_id", "cpu family", "model", "flags", "CPU implementer", "CPU architecture", "CPU variant", "CPU part", "Features", "cpu", "isa",
    "uarch", "features",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Compiler:
    """A C++ compiler: the ``command`` that calls it, a path and the words that $CXX has besides, and the first line of its version."""

    command: tuple[str, ...]
    version: str

    @property
    def name(self) -> str:
        """The displayed name: the version, and the arguments of $CXX."""
        return f"{self.version}, called by {shlex.join(self.command)}" if len(self.command) > 1 else self.version

    @property
    def zig(self) -> tuple[str, ...]:
        """The words that call Zig, which is a compiler of C, an archiver and more by its next word; none where it is no Zig."""
        return self.command[: _place_of_zig(self.command)]

    @property
    def words(self) -> tuple[str, ...]:
        """The arguments after those that call Zig's C++ compiler."""
        return self.command[len(self.zig) + 1 :]

    @property
    def key(self) -> tuple[str, ...]:
        """The properties of the compiler and its environment on which built files depend."""
        variables = (f"{name}={os.environ[name]}" for name in _VARIABLES if os.environ.get(name))
        return (self.version, *resolve(self.command[1:]), *variables)


def find_compiler() -> Compiler:
    """The C++ compiler: $CXX, with flags or a launcher such as ccache as in `make`, else g++, clang++, or that of the package ziglang.

    Raises:
        MissingToolsError: a tool is missing, or the system is Windows.
        ToolchainError: $CXX names no program, or the program does not say a version.
    """
    if IS_WINDOWS:
        raise MissingToolsError(f"this needs generated code, which is not compiled on Windows; {ADVICE}")
    command = _for_all_processors(_command_of_environment() or _usual_command())
    require_tools(*([] if command else ["a C++ compiler"]))
    return Compiler(command=command, version=ask_version(command))


def must_interpret() -> bool:
    """Return whether tools are missing and the package has simulators that need none.
    Raises ToolchainError: $CXX names a compiler for such a package, and that is none."""
    if not binaries_folder().is_dir():
        return False
    try:
        find_compiler()
    except MissingToolsError:
        return True
    return False


def require_tools(*missing: str) -> None:
    """Check that the build tools are installed, and that nothing else is ``missing``. Raises MissingToolsError: a tool is missing."""
    absent = [*(tool for tool in ("cmake", "ninja") if find_tool(tool) is None), *missing]
    if absent:
        fault = f"missing: {', '.join(absent)};"
        if binaries_folder().is_dir():
            raise MissingToolsError(f"this needs generated code; {fault} {ADVICE}")
        raise MissingToolsError(f"{fault} apt-get install {PACKAGES}")


def find_tool(name: str) -> str | None:
    """The absolute path of a tool; None if there is none."""
    found = shutil.which(name, path=tools_path())
    return found and os.path.abspath(found)


def tools_path() -> str:
    """The absolute folders of tools: those of $PATH and of Python's packages, but not the present one, which may be a stranger's."""
    requested = (os.environ.get("PATH", os.defpath) + os.pathsep + sysconfig.get_path("scripts")).split(os.pathsep)
    return os.pathsep.join(os.path.abspath(folder) for folder in requested if os.path.normpath(folder) != os.curdir)


def _command_of_environment() -> tuple[str, ...]:
    requested = os.environ.get("CXX", "").strip()
    try:
        words = [requested] if find_tool(requested) else shlex.split(requested)
    except ValueError as error:
        raise ToolchainError(f"CXX={requested}: {error}; set $CXX to a C++20 compiler, or unset it") from None
    if not words:
        return ()
    found = find_tool(words[0])
    if found is None:
        raise ToolchainError(f"CXX={requested}: there is no program '{words[0]}'; set $CXX to a C++20 compiler, or unset it")
    return (found, *words[1:])


def _usual_command() -> tuple[str, ...]:
    if found := find_tool("g++") or find_tool("clang++"):
        return (found,)
    return (found, "c++") if (found := find_zig()) else ()


def find_zig() -> str | None:
    """The program of the package ziglang, ignoring the current folder; None if it is not installed."""
    here = os.getcwd()
    package = PathFinder.find_spec("ziglang", [folder for folder in sys.path if os.path.abspath(folder) != here])
    return shutil.which("zig", path=os.path.dirname(package.origin)) if package and package.origin else None


def _place_of_zig(command: Sequence[str]) -> int:
    """The place of the word by which Zig compiles C++; 0 where it does not."""
    return next((i for i, (name, word) in enumerate(pairwise(command), 1) if word == "c++" and Path(name).stem in ("zig", "ziglang")), 0)


def _for_all_processors(command: tuple[str, ...]) -> tuple[str, ...]:
    """A command whose Zig compiles and links for all processors of a kind, unless its words name one."""
    behind = _place_of_zig(command) + 1
    named = any(word.lstrip("-").startswith(("target", "mcpu", "march")) for word in command[behind:])
    return command if behind == 1 or named else (*command[:behind], "-mcpu=baseline", *command[behind:])


@cache
def ask_version(command: tuple[str, ...]) -> str:
    """The first line of the compiler's version message. Raises ToolchainError: it says none."""
    fault = "it prints no version"
    try:
        done = subprocess.run(
            [*command, "--version"], stdin=subprocess.DEVNULL, capture_output=True, encoding="utf-8", errors="replace", check=False,
            timeout=_PATIENCE, cwd=os.sep,
        )  # fmt: skip
        lines = done.stdout.splitlines()
        if done.returncode == 0 and lines and lines[0].strip():
            return lines[0]
    except OSError as error:
        fault = error.strerror or str(error)
    except subprocess.TimeoutExpired:
        fault = "it does not answer"
    raise ToolchainError(f"{shlex.join(command)} --version: {fault}; set $CXX to a C++20 compiler, or unset it")


def resolve(flags: Sequence[str]) -> tuple[str, ...]:
    """Flags as keys of the cache have them: with the processor that "native" stands for, since machines may share a cache."""
    return (*flags, *(processor() if any("native" in flag for flag in flags) else ()))


@cache
def processor(file: Path = Path("/proc/cpuinfo")) -> tuple[str, ...]:
    """The capabilities of this machine's processor; its name where they are unknown, so that no other one runs its code."""
    known: dict[str, str] = {}
    with suppress(OSError), file.open(encoding="utf-8", errors="replace", buffering=4096) as stream:
        for name, _, value in (line.partition(":") for line in stream):
            known.setdefault(name.strip(), " ".join(sorted(value.split())))
            if not name.strip() and len(known) > 1:
                break  # all processors are alike
    found = tuple(f"{name}: {known[name]}" for name in _CAPABILITIES if name in known)
    return found or (f"machine: {platform.machine()} {platform.node()}",)
