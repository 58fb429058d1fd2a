"""The machine that times are of."""

from __future__ import annotations

import platform
from collections.abc import Iterator, Mapping
from pathlib import Path


def machine() -> Mapping[str, str]:
    """This machine: processor, its cores, system."""
    return {"processor": _processor(), "system": platform.system(), "python": platform.python_version()}


#: The names of a processor's widest vectors, by the flag that stands for them.
_VECTORS = {"avx512f": "AVX-512", "avx2": "AVX2"}


def _processor() -> str:
    cores = 0
    vectors = ""
    name = platform.processor() or platform.machine()
    for line in _lines(Path("/proc/cpuinfo")):
        key, _, value = (part.strip() for part in line.partition(":"))
        cores += key == "processor"
        name = value if key == "model name" else name
        if key == "flags":
            vectors = next((f" with {words}" for flag, words in _VECTORS.items() if flag in value.split()), "")
    return f"{name}{vectors}, {cores} cores" if cores else name


def _lines(path: Path) -> Iterator[str]:
    if path.exists():
        yield from path.read_text(encoding="utf-8").splitlines()
