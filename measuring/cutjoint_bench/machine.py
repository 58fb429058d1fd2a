"""The machine that times are of."""

import platform
from collections.abc import Mapping
from pathlib import Path

#: The names of a processor's widest vector registers, by CPU flag.
_VECTORS = {"avx512f": "AVX-512", "avx2": "AVX2"}


def machine() -> Mapping[str, str]:
    """This machine: processor, its cores, system."""
    return {"processor": _processor(), "system": platform.system(), "python": platform.python_version()}


def _processor() -> str:
    cores, vectors, name, known = 0, "", platform.processor() or platform.machine(), Path("/proc/cpuinfo")
    for line in known.read_text(encoding="utf-8").splitlines() if known.exists() else ():
        key, _, value = (part.strip() for part in line.partition(":"))
        cores += key == "processor"
        name = value if key == "model name" else name
        if key == "flags":
            vectors = next((f" with {words}" for flag, words in _VECTORS.items() if flag in value.split()), "")
    return f"{name}{vectors}, {cores} cores" if cores else name
