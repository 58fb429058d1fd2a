"""Exports in C++ -> programs, compiled once and cached by content."""

from __future__ import annotations

import hashlib
import subprocess
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from cutjoint.package.errors import ToolchainError
from cutjoint.toolchain.build import FLAGS
from cutjoint.toolchain.cache import cache_folder, find_or_make
from cutjoint.toolchain.compiler import find_compiler, resolve


def compile_program(folder: Path, options: Sequence[str]) -> Path:
    """Compile the one .cpp file of a folder; ``options`` are those of the peer's headers and libraries.

    Raises:
        ToolchainError: there is not one such file, or the compiler refused it.
    """
    compiler, source = find_compiler(), _only(folder, "*.cpp")
    command = [*compiler.command, *FLAGS, "-std=c++20", source.name]
    files = sorted(p for p in folder.iterdir() if p.suffix in (".cpp", ".hpp"))
    content = [part for p in files for part in (p.name, p.read_text(encoding="utf-8"))]
    about = [*compiler.key, *resolve(command), *options, *content]
    digest = hashlib.sha256("\0".join(about).encode()).hexdigest()[:32]
    cached = cache_folder() / f"peer-{digest}" / source.stem

    def make(place: Path) -> Path:
        _call([*command, *options, "-o", str(place / source.stem)], folder)
        return place / source.stem

    find_or_make(cached, make)
    return cached


def module_folder(module: str, package: str) -> Path:
    """The folder of an installed module.

    Raises:
        ToolchainError: it is not installed.
    """
    found = find_spec(module)
    if found is None or not found.submodule_search_locations:
        raise ToolchainError(f"{module} is not installed: pip install {package}")
    return Path(next(iter(found.submodule_search_locations)))


def _only(folder: Path, pattern: str) -> Path:
    found = sorted(folder.glob(pattern))
    if len(found) != 1:
        raise ToolchainError(f"{folder} has {len(found)} files {pattern} in place of one; export into a folder of its own")
    return found[0]


def _call(command: Sequence[str], folder: Path) -> None:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        errors = [line for line in done.stderr.splitlines() if "error" in line]
        raise ToolchainError(f"{command[0]} failed: {'; '.join(errors[:5]) or done.stderr[-800:]}")
