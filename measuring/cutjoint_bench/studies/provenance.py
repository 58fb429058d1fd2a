"""The heading of every table: machine, compiler and version of its measurement."""

from __future__ import annotations

from collections.abc import Sequence

from cutjoint.package.locations import __version__
from cutjoint.toolchain.build import FLAGS
from cutjoint.toolchain.cache import runtime_digest
from cutjoint.toolchain.compiler import find_compiler
from cutjoint_bench.machine import machine


def provenance(flags: Sequence[str] = FLAGS) -> str:
    """Machine, compiler, flags and runtime in a line."""
    made = (find_compiler().name, " ".join(flags), f"cutjoint {__version__}", f"runtime {runtime_digest()[:16]}")
    return ", ".join((*machine().values(), *(part for part in made if part)))
