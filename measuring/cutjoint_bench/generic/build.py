"""The generic solver as a program, by CMake, cached by content."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path

from cutjoint.toolchain.build import FLAGS, Binary
from cutjoint.toolchain.cache import cache_folder, digest_of, find_or_make, runtime_digest, tree_digest
from cutjoint.toolchain.cmake import build_project, plain_runtime, plain_tree
from cutjoint.toolchain.compiler import Compiler, find_compiler, resolve
from cutjoint_bench.generic import ADDITIONS, RUNTIME


@cache
def measuring_digest() -> str:
    """A digest of the runtime, the generic solver and all additions to drivers."""
    return digest_of([runtime_digest(), *map(tree_digest, (RUNTIME, ADDITIONS))])


def build_generic(*, flags: Sequence[str] = FLAGS) -> Binary:
    """Build the generic simulator, which interprets any model, or find it in the cache.

    Raises:
        ToolchainError: a tool is missing, or the compiler refused the code.
    """
    compiler = find_compiler()
    key = digest_of([measuring_digest(), *compiler.key, *resolve(flags)])
    cached = cache_folder() / f"generic-{key}" / "simulator"
    fresh = find_or_make(cached, lambda place: _build_in(place, compiler, flags))
    return Binary(path=cached, fresh=fresh, compiler=compiler.name, flags=tuple(flags))


def _build_in(folder: Path, compiler: Compiler, flags: Sequence[str]) -> Path:
    project, additions = plain_tree(RUNTIME, folder / "generic"), plain_tree(ADDITIONS, folder / "additions")
    places = (f"-DCUTJOINT_RUNTIME={plain_runtime(folder)}", f"-DCUTJOINT_ADDITIONS={additions}")
    build_project(project, folder / "out", compiler, flags, *places)
    return folder / "out" / "generic"
