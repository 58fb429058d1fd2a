"""Generated source -> a simulator or a library, by CMake, cached by content."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from cutjoint.package.locations import without_mark
from cutjoint.toolchain.cache import cache_folder, digest_of, find_or_make, is_sound, runtime_digest, store
from cutjoint.toolchain.cmake import build_project, plain_runtime
from cutjoint.toolchain.compiler import SHIPPED, Compiler, find_compiler, must_interpret, resolve
from cutjoint.toolchain.drivers import Kind, driver_parts, interpreter_part, make_drivers, parts_for, shipped_interpreter, store_parts
from cutjoint.toolchain.objects import fetch_objects, find_objects
from cutjoint.toolchain.platforms import Platform

if TYPE_CHECKING:
    from cutjoint.emit.source import Source

#: Default flags for generated code, unless $CUTJOINT_FLAGS is set; measured on the Iltis, see docs/evidence/performance.md.
FLAGS = tuple(os.environ.get("CUTJOINT_FLAGS", "-O3 -march=native").split())
_PLAIN = Kind()


@dataclass(frozen=True, kw_only=True)
class Binary:
    """A built simulator or library: its ``path``, ``fresh`` when it was built now rather than found, with what it was built."""

    path: Path
    fresh: bool
    compiler: str
    flags: tuple[str, ...]


def write_source(source: Source, folder: Path) -> None:
    """Write the generated files into a folder."""
    for name, text in source.files.items():
        write_text(folder / name, text)


def write_text(file: Path, text: str) -> None:
    """Write a file and make its folders."""
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text, encoding="utf-8")


def build(source: Source, *, flags: Sequence[str] = FLAGS, kind: Kind = _PLAIN) -> Binary:
    """Build the simulator or the library of a source, or find it in the cache.

    The cache key covers the generated files, the runtime and extensions, compiler and flags, with "native" the processor too. Raises
    ToolchainError: a tool is missing, or the compiler refused the code.
    """
    compiler = find_compiler()
    cached = place_of(source, compiler, flags, kind)
    fresh = find_or_make(cached, lambda place: _build_in(place, source, compiler, flags, kind))
    return Binary(path=cached, fresh=fresh, compiler=compiler.name, flags=tuple(flags))


def place_of(source: Source, compiler: Compiler, flags: Sequence[str], kind: Kind) -> Path:
    """The place in the cache of the simulator or the library of a source."""
    key = digest_of([source.digest, runtime_digest(part=source.driver), *compiler.key, *resolve(flags), *kind.key])
    return cache_folder() / key / source.product


def warm(driver: str, *, flags: Sequence[str] = FLAGS) -> bool:
    """Build a driver, one of DRIVERS, in double for all models, unless it is there; returns whether it was built now.
    Raises ToolchainError: a tool is missing, the compiler refused the code, or neither installation nor cache can be written."""
    return make_drivers(driver, find_compiler(), flags, _PLAIN)


def build_interpreter(driver: str, *, flags: Sequence[str] = FLAGS) -> Binary:
    """Build the interpreter for the programs of a driver's methods, or find it in the installation or the cache.
    Without a compiler it is that of the package. Raises ToolchainError: a tool is missing and the package has no simulator, or the compiler
    refused the code."""
    if must_interpret():
        return Binary(path=shipped_interpreter(driver), fresh=False, compiler=SHIPPED, flags=())
    compiler = find_compiler()
    installed, cached = interpreter_part(driver, compiler, flags).places
    fresh = not is_sound(cached) and not is_sound(installed) and make_drivers(driver, compiler, flags, _PLAIN, cache_folder())
    if not is_sound(cached):
        store(installed, cached)
    return Binary(path=cached, fresh=fresh, compiler=compiler.name, flags=tuple(flags))


def simulator_of(name: str) -> str:
    """The program that a C export builds."""
    return f"{name}_simulator"


def build_files(
    name: str, files: Mapping[str, str], made: str, digest: str, flags: Sequence[str], *settings: str, platform: Platform | None = None
) -> Path:  # fmt: skip
    """Build the CMake project of ``files`` around a C export for a ``platform`` (default: this machine); returns the file ``made``, cached.
    Raises ToolchainError: a tool is missing, or the compiler refused the code."""
    compiler, there = (platform.find_compiler(), platform.settings) if platform else (find_compiler(), ())
    key = digest_of([digest, *map(without_mark, files.values()), *compiler.key, *resolve(flags), *settings, *there])
    cached = cache_folder() / f"alone-{key}" / made

    def make(folder: Path) -> Path:
        for file, text in files.items():
            write_text(folder / "source" / file, text)
        definitions = (f"-D{name}_FLAGS={' '.join(flags)}", *settings, *there)
        is_library, here = bool(Path(made).suffix), platform is None
        build_project(folder / "source", folder / "out", compiler, flags, *definitions, runs=here, shared=is_library)
        return folder / "out" / made

    find_or_make(cached, make)
    return cached


def _build_in(folder: Path, source: Source, compiler: Compiler, flags: Sequence[str], kind: Kind) -> Path:
    """Configure and build in a folder; the driver's parts that it had to build, and its object files, go into the cache."""
    out, objects = folder / "out", find_objects(source, compiler, flags, kind)
    with parts_for(driver_parts(source.driver, compiler, flags, kind), folder, cache_folder()) as (definitions, missing):
        write_source(source, folder / "source")
        known = fetch_objects(objects, folder / "objects")
        places = (f"-DCUTJOINT_RUNTIME={plain_runtime(folder)}", f"-DCUTJOINT_OBJECTS={folder / 'objects'}", *kind.definitions(folder))
        build_project(folder / "source", out, compiler, flags, *places, *definitions, shared=bool(Path(source.product).suffix))
        store_parts(missing, out, cache_folder())
    for o in objects:
        if o not in known and o.built(out).is_file():
            store(o.built(out), o.cached)
    return out / source.product
