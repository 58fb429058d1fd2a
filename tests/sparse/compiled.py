"""Emitted factorisations, compiled and called."""

from __future__ import annotations

import ctypes
import os
import subprocess
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cutjoint.emit.factorisation import emit_factorisation
from cutjoint.emit.source import Page
from cutjoint.package.locations import runtime_folder
from cutjoint.sparse.plan import Plan
from cutjoint.toolchain.compiler import find_compiler

Array = NDArray[np.float64]

PAGE = Page(stem="vehicle", class_name="Vehicle", formulation="classical", text="")

_WARNINGS = ("-Wall", "-Wextra", "-Werror", "-Wno-psabi")

#: Reals before and after an array that nothing may touch.
_GUARD = 8

_SHIM = """
#include "factorisation.hpp"
extern "C" {
int length() { return cutjoint::generated::factors; }
int factor(const double* tangent, double* factors) { return cutjoint::generated::factor<double>(tangent, factors); }
void solve(const double* factors, double* x) { cutjoint::generated::solve<double>(factors, x); }
}
"""


def names(plan: Plan) -> list[str]:
    """A name for each row."""
    return [f"node_{k // 3}.{'xyz'[k % 3]}" for k in range(plan.pattern.size)]


def emit(plan: Plan, *, tables: bool) -> dict[str, str]:
    """The files of a plan, as straight-line code or as tables."""
    return PAGE.files(emit_factorisation(plan, names(plan), PAGE, straight_line=0 if tables else 10**9))


class Factorisation:
    """An emitted factorisation.  Arrays lie between guards, and away from any alignment but that of a real."""

    def __init__(self, files: Mapping[str, str], folder: Path, *, compiler: str | None = None) -> None:
        for name, text in {**files, "shim.cpp": _SHIM}.items():
            (folder / name).write_text(text, encoding="utf-8")
        sources = sorted(str(p) for p in folder.glob("*.cpp"))
        flags = os.environ["CUTJOINT_FLAGS"].split()
        target = folder / "factorisation.so"
        called = [compiler] if compiler else find_compiler().command
        command = [*called, "-std=c++20", *_WARNINGS, *flags, "-shared", "-fPIC", f"-I{runtime_folder() / 'include'}"]
        done = subprocess.run([*command, f"-I{folder}", *sources, "-o", str(target)], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        self._library = ctypes.CDLL(str(target))
        self._factors = _guarded(np.full(self._library.length(), np.nan))

    def factor(self, values: Array) -> int:
        """Call `factor`; returns its result."""
        tangent = _guarded(values)
        row = int(self._library.factor(_pointer(tangent), _pointer(self._factors)))
        assert _is_whole(tangent)
        assert _is_whole(self._factors)
        return row

    def solve(self, right: Array) -> Array:
        """Call `solve`; returns its solution for a right-hand side."""
        x = _guarded(right)
        self._library.solve(_pointer(self._factors), _pointer(x))
        assert _is_whole(x)
        assert _is_whole(self._factors)
        return x[_GUARD:-_GUARD].copy()


def _guarded(array: Array) -> Array:
    guard = np.arange(1.0, _GUARD + 1)
    everything = np.concatenate([[0.0], guard, array, guard])
    return everything[1:]


def _is_whole(array: Array) -> bool:
    guard = np.arange(1.0, _GUARD + 1)
    return bool((array[:_GUARD] == guard).all() and (array[-_GUARD:] == guard).all())


def _pointer(array: Array) -> ctypes.c_void_p:
    return ctypes.c_void_p(array[_GUARD:].ctypes.data)
