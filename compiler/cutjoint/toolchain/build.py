"""Generated source -> simulator binary, by CMake, cached by content."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from cutjoint.locations import runtime_folder
from cutjoint.methods import DEFAULT_PRECISION
from cutjoint.toolchain.cache import alone, cache_folder, fetch, find_or_make, is_sound, store
from cutjoint.toolchain.cmake import build_project, plain_runtime
from cutjoint.toolchain.compiler import Compiler, find_compiler, resolve

if TYPE_CHECKING:
    from cutjoint.emit.source import Source

#: How generated code is optimised, unless $CUTJOINT_FLAGS says otherwise; measured on the Iltis, see docs/performance.md.
FLAGS = tuple(os.environ.get("CUTJOINT_FLAGS", "-O3 -march=native").split())


@dataclass(frozen=True, kw_only=True)
class Binary:
    """A built simulator: ``path`` to run, ``fresh`` when it was built now rather than found, with what it was built."""

    path: Path
    fresh: bool
    compiler: str
    flags: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Kind:
    """What of a simulator is chosen besides its source and flags."""

    comparison: bool = False
    precision: str = DEFAULT_PRECISION

    @property
    def definitions(self) -> tuple[str, ...]:
        """Of CMake."""
        return f"-DCUTJOINT_COMPARISON={'ON' if self.comparison else 'OFF'}", f"-DCUTJOINT_PRECISION={self.precision}"


_PLAIN = Kind()


def write_source(source: Source, folder: Path) -> None:
    """Put the generated files into a folder."""
    for name, text in source.files.items():
        write_text(folder / name, text)


def write_text(file: Path, text: str) -> None:
    """A file with its folders."""
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text, encoding="utf-8")


def build(source: Source, *, flags: Sequence[str] = FLAGS, kind: Kind = _PLAIN) -> Binary:
    """Build the simulator of a source, or find it in the cache.

    The cache key covers the generated files, the runtime headers, compiler and flags, with "native" the processor too.
    A ``kind`` for comparison has the solvers of SuiteSparse, some of which are under the GPL: such a simulator is not for handing on.

    Raises:
        ToolchainError: a tool is missing, or the compiler refused the code.
    """
    compiler = find_compiler()
    key = _digest([source.digest, runtime_digest(part=source.driver), *compiler.key, *resolve(flags), *kind.definitions])
    cached = cache_folder() / key / "simulator"
    fresh = find_or_make(cached, lambda place: _build_in(place, source, compiler, flags, kind))
    return Binary(path=cached, fresh=fresh, compiler=compiler.name, flags=tuple(flags))


def build_generic(*, flags: Sequence[str] = FLAGS) -> Binary:
    """Build the generic simulator, which interprets any model, or find it in the cache.

    Raises:
        ToolchainError: a tool is missing, or the compiler refused the code.
    """
    compiler = find_compiler()
    key = _digest([runtime_digest(part="generic"), *compiler.key, *resolve(flags)])
    cached = cache_folder() / f"generic-{key}" / "simulator"
    fresh = find_or_make(cached, lambda place: _build_generic_in(place, compiler, flags))
    return Binary(path=cached, fresh=fresh, compiler=compiler.name, flags=tuple(flags))


def simulator_of(name: str) -> str:
    """The program that the folder of a model makes."""
    return f"{name}_simulator"


def build_folder(
    name: str, files: Mapping[str, str], digest: str, *, shared: bool, flags: Sequence[str] = FLAGS
) -> Path:  # fmt: skip
    """Build a folder that stands alone by its CMake project, or find what it makes in the cache: the simulator, or ``shared`` the
    library.

    Raises:
        ToolchainError: a tool is missing, or the compiler refused the code.
    """
    compiler = find_compiler()
    made = f"lib{name}.so" if shared else simulator_of(name)
    key = _digest([digest, *files.values(), *compiler.key, *resolve(flags)])
    cached = cache_folder() / f"alone-{key}" / made

    def make(folder: Path) -> Path:
        for file, text in files.items():
            write_text(folder / "source" / file, text)
        settings = (f"-D{name}_FLAGS={' '.join(flags)}", f"-DBUILD_SHARED_LIBS={'ON' if shared else 'OFF'}")
        build_project(folder / "source", folder / "out", compiler, flags, *settings)
        return folder / "out" / made

    find_or_make(cached, make)
    return cached


def _build_generic_in(folder: Path, compiler: Compiler, flags: Sequence[str]) -> Path:
    build_project(plain_runtime(folder), folder / "out", compiler, flags)
    return folder / "out" / "generic"


def _build_in(folder: Path, source: Source, compiler: Compiler, flags: Sequence[str], kind: Kind) -> Path:
    """Configure and build in a folder; the first simulator brings the driver's parts into the cache."""
    parts = _driver_parts(source, compiler, flags, kind)
    out = folder / "out"
    with ExitStack() as stack:
        for part in parts.values():
            if not is_sound(part):
                stack.enter_context(alone(part))
        known = {name: copy for name, part in parts.items() if fetch(part, copy := folder / part.name)}
        definitions = [f"-DCUTJOINT_{name.upper()}={copy}" for name, copy in known.items()]
        write_source(source, folder / "source")
        runtime = plain_runtime(folder)
        build_project(folder / "source", out, compiler, flags, f"-DCUTJOINT_RUNTIME={runtime}", *kind.definitions, *definitions)
        for part in (part for name, part in parts.items() if name not in known):
            store(out / part.name, part)
    return out / "simulator"


def _driver_parts(source: Source, compiler: Compiler, flags: Sequence[str], kind: Kind) -> dict[str, Path]:
    """The cache entries of the driver's parts.

    Starts and integrators are compiled with the flags of generated code.  In drivers for comparisons and for batches all other parts
    are, too.
    """
    start = [runtime_digest(), *compiler.key, *resolve(flags)]
    driver = [*start, source.driver, runtime_digest(part=source.driver), *kind.definitions]
    keys = {"initial_state": start, "driver": driver}
    return {name: cache_folder() / f"{name}-{_digest(key)}" / f"lib{name}.a" for name, key in keys.items()}


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


def _digest(parts: Sequence[str]) -> str:
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:32]
