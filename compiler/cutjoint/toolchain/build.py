"""Generated source -> simulator binary, by CMake, cached by content."""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import platformdirs
from filelock import FileLock

from cutjoint.locations import runtime_folder

if TYPE_CHECKING:
    from cutjoint.emit.source import Source

#: Where the environment asks for it, as the tests do, warnings are errors (from CMake 3.24 on); a user's compiler may have others.
_STRICT = ("-DCMAKE_COMPILE_WARNING_AS_ERROR=ON",) if os.environ.get("CUTJOINT_STRICT", "0") != "0" else ()

#: How generated code is optimised, unless $CUTJOINT_FLAGS says otherwise; measured on the Iltis, see docs/performance.md.
FLAGS = tuple(os.environ.get("CUTJOINT_FLAGS", "-O3 -march=native").split())

PACKAGES = "g++ cmake ninja-build libeigen3-dev libsuitesparse-dev nlohmann-json3-dev"


class ToolchainError(RuntimeError):
    """The C++ side is missing something or refused the code."""


@dataclass(frozen=True, kw_only=True)
class Binary:
    """A built simulator: ``path`` to run, ``fresh`` when it was built now rather than found, with what it was built."""

    path: Path
    fresh: bool
    compiler: str
    flags: tuple[str, ...]


#: Number types that a simulator can be built for: 24, 53, 64 (80-bit registers, x86) and 113 bits.
PRECISIONS = ("single", "double", "extended", "quad")


@dataclass(frozen=True, kw_only=True)
class Kind:
    """What of a simulator is chosen besides its source and flags."""

    comparison: bool = False
    precision: str = "double"

    @property
    def definitions(self) -> tuple[str, ...]:
        """Of CMake."""
        return f"-DCUTJOINT_COMPARISON={'ON' if self.comparison else 'OFF'}", f"-DCUTJOINT_PRECISION={self.precision}"


_PLAIN = Kind()


def write_source(source: Source, folder: Path) -> None:
    """Put the generated files into a folder."""
    for name, text in source.files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")


def build(source: Source, *, flags: Sequence[str] = FLAGS, folder: Path | None = None, kind: Kind = _PLAIN) -> Binary:
    """Build the simulator of a source, or find it in the cache.

    The cache key covers the generated files, the runtime headers, compiler and flags, with "native" the processor too.  ``folder`` keeps
    source and binary there as well.
    A ``kind`` for comparison has the solvers of SuiteSparse, some of which are under the GPL: such a simulator is not for handing on.

    Raises:
        ToolchainError: a tool is missing, or the compiler refused the code.
    """
    compiler = find_compiler()
    key = _digest([source.digest, runtime_digest(part=source.driver), compiler_version(compiler), *resolve(flags), *kind.definitions])
    kept = cache_folder() / key / "simulator"
    with alone(kept):
        fresh = not kept.exists()
        if fresh:
            _build_into(kept.parent, source, flags, kind)
    if folder is not None:
        write_source(source, folder)
        shutil.copy2(kept, folder / "simulator")
    return Binary(path=kept, fresh=fresh, compiler=compiler_version(compiler), flags=tuple(flags))


def build_generic(*, flags: Sequence[str] = FLAGS) -> Binary:
    """Build the generic simulator, which interprets any model, or find it in the cache.

    Raises:
        ToolchainError: a tool is missing, or the compiler refused the code.
    """
    compiler = find_compiler()
    key = _digest([runtime_digest(part="generic"), compiler_version(compiler), *resolve(flags)])
    kept = cache_folder() / f"generic-{key}" / "simulator"
    with alone(kept):
        fresh = not kept.exists()
        if fresh:
            with workplace() as folder:
                _cmake(runtime_folder(), folder, flags)
                keep(folder / "generic", kept)
    return Binary(path=kept, fresh=fresh, compiler=compiler_version(compiler), flags=tuple(flags))


def _build_into(target: Path, source: Source, flags: Sequence[str], kind: Kind) -> None:
    """Configure and build in a temporary folder, then move the simulator into place at once; the first one brings the driver's parts."""
    parts = _driver_parts(source, flags, kind)
    with ExitStack() as stack:
        folder = stack.enter_context(workplace())
        for part in parts.values():
            stack.enter_context(alone(part))
        missing = [name for name, part in parts.items() if not part.exists()]
        known = [f"-DCUTJOINT_{name.upper()}={part}" for name, part in parts.items() if name not in missing]
        write_source(source, folder / "source")
        _cmake(folder / "source", folder / "out", flags, f"-DCUTJOINT_RUNTIME={runtime_folder()}", *kind.definitions, *known)
        keep(folder / "out" / "simulator", target / "simulator")
        for name in missing:
            keep(folder / "out" / f"lib{name}.a", parts[name])


def _driver_parts(source: Source, flags: Sequence[str], kind: Kind) -> dict[str, Path]:
    """Where the driver's parts stand in the cache; all have integrators with the flags of generated code, those for comparisons and batches
    nothing else."""
    told = resolve(flags)
    launch = [runtime_digest(), compiler_version(find_compiler()), *(told if kind.comparison or source.driver == "batch" else ())]
    driver = [*launch, source.driver, runtime_digest(part=source.driver), *kind.definitions, *told]
    return {name: cache_folder() / f"{name}-{_digest(key)}" / f"lib{name}.a" for name, key in (("launch", launch), ("driver", driver))}


@contextmanager
def alone(file: Path) -> Iterator[None]:
    """While a file of the cache is not there, one process at a time; the others find it then."""
    if file.exists():
        yield
        return
    cache_folder().mkdir(parents=True, exist_ok=True)
    with FileLock(cache_folder() / f"{'-'.join(file.relative_to(cache_folder()).with_suffix('').parts)}.lock"):
        yield


@contextmanager
def workplace() -> Iterator[Path]:
    """A temporary folder on the cache's file system."""
    cache_folder().mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=cache_folder()) as name:
        yield Path(name)


def keep(file: Path, target: Path) -> None:
    """Move a file into the cache at once, so that no other process sees half of it."""
    target.parent.mkdir(parents=True, exist_ok=True)
    file.replace(target)


def _cmake(source: Path, out: Path, flags: Sequence[str], *definitions: str) -> None:
    command = [
        "cmake", "-S", str(source), "-B", str(out), "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release",
        f"-DCMAKE_CXX_COMPILER={find_compiler()}", "-DCMAKE_CXX_FLAGS_RELEASE=-O2 -DNDEBUG", f"-DCUTJOINT_FLAGS={' '.join(flags)}",
        *_STRICT, *definitions,
    ]  # fmt: skip
    _call(command)
    _call(["cmake", "--build", str(out)])


def _call(command: Sequence[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        lines = [x for x in (done.stdout + done.stderr).splitlines() if "error" in x.lower() or "not find" in x]
        hint = f"install the C++ side: apt-get install {PACKAGES}" if "CMakeLists" in done.stderr else "please report this"
        raise ToolchainError(f"{command[0]} failed: {'; '.join(lines[:5]) or done.stderr[-800:]} ({hint})")


def find_compiler() -> str:
    """The C++ compiler: $CXX, else g++, else clang++.

    Raises:
        ToolchainError: a tool is missing.
    """
    missing = [tool for tool in ("cmake", "ninja") if shutil.which(tool) is None]
    for name in (os.environ.get("CXX", ""), "g++", "clang++"):
        found = shutil.which(name) if name else None
        if found and not missing:
            return found
    missing += [] if shutil.which("g++") or shutil.which("clang++") else ["a C++ compiler"]
    raise ToolchainError(f"missing: {', '.join(missing) or os.environ.get('CXX', '')}; apt-get install {PACKAGES}")


@cache
def compiler_version(compiler: str) -> str:
    """The compiler's first line about itself."""
    return subprocess.run([compiler, "--version"], capture_output=True, text=True, check=True).stdout.splitlines()[0]


def resolve(flags: Sequence[str]) -> tuple[str, ...]:
    """Flags as keys of the cache have them: with the processor that "native" stands for, since machines may share a cache."""
    return (*flags, *(processor() if any("native" in flag for flag in flags) else ()))


#: What of a processor "native" follows from, as /proc/cpuinfo names it on x86, ARM, POWER, RISC-V and s390.
_CAPABILITIES = (
    "vendor_id", "cpu family", "model", "flags", "CPU implementer", "CPU architecture", "CPU variant", "CPU part", "Features", "cpu", "isa",
    "uarch", "features",
)  # fmt: skip


@cache
def processor(file: Path = Path("/proc/cpuinfo")) -> tuple[str, ...]:
    """What this machine's processor can do; where nothing tells, the machine's name, so that no other one runs its code."""
    known: dict[str, str] = {}
    with suppress(OSError), file.open(encoding="utf-8", errors="replace", buffering=4096) as stream:
        for name, _, value in (line.partition(":") for line in stream):
            known.setdefault(name.strip(), " ".join(sorted(value.split())))
            if not name.strip() and len(known) > 1:
                break  # the other processors are like the first
    found = tuple(f"{name}: {known[name]}" for name in _CAPABILITIES if name in known)
    return found or (f"machine: {platform.machine()} {platform.node()}",)


#: Parts of the runtime that only one kind of simulator has: the generic twin, and batches.
_PARTS = ("generic", "batch")


@cache
def runtime_digest(*, part: str = "") -> str:
    """A digest of the runtime's headers and sources; of those that only one kind of simulator has, with its ``part``."""
    folder = runtime_folder()
    files = sorted(p for p in folder.rglob("*") if p.suffix in (".hpp", ".cpp", ".txt", ".cmake"))
    left_out = {*_PARTS} - {part}
    files = [p for p in files if left_out.isdisjoint(p.relative_to(folder).with_suffix("").parts)]
    return _digest([text for p in files for text in (str(p.relative_to(folder)), p.read_text(encoding="utf-8"))])


def cache_folder() -> Path:
    """Where binaries are kept: $CUTJOINT_CACHE, else the user's cache folder."""
    return Path(os.environ.get("CUTJOINT_CACHE") or platformdirs.user_cache_path("cutjoint"))


def _digest(parts: Sequence[str]) -> str:
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:32]
