"""Simulators that evaluate functions at given states, or time the parts of an iteration, in place of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from hashlib import sha256

from cutjoint.emit.source import Source
from cutjoint_bench.generic import RUNTIME

HEADER = "examine.hpp"
#: What the program needs besides: Eigen, of whose solvers it chooses.
_EIGEN = "\nfind_package(Eigen3 3.3 REQUIRED NO_MODULE)\ntarget_link_libraries(simulator PRIVATE Eigen3::Eigen)\n"


def examining(source: Source) -> Source:
    """The source of a simulator, with a main program for the tasks "evaluate" and "factor"; see `runtime/include/cutjoint/examine.hpp`."""
    main = source.files["main.cpp"].replace("return run_main(", "return examine::run_main(")
    return with_files(source, {"main.cpp": f'#include "{HEADER}"\n{main}'})


def with_files(source: Source, files: Mapping[str, str]) -> Source:
    """The source with other ``files`` that may include the header."""
    header = (RUNTIME / "include" / "cutjoint" / HEADER).read_text(encoding="utf-8")
    more = {**source.files, **files, HEADER: header, "CMakeLists.txt": source.files["CMakeLists.txt"] + _EIGEN}
    return replace(source, files=more, digest=sha256("\0".join(more.values()).encode()).hexdigest())
