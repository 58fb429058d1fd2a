"""The mathematical library of modules: its values are right, the same bits by two compilers, and no other library is linked."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from shutil import which

import mpmath
import numpy as np
import pytest
from numpy.typing import NDArray

from cutjoint.package.locations import runtime_folder
from cutjoint.toolchain.wasm import MATHEMATICS, build_matching_library, build_module

Array = NDArray[np.float64]

_OF_TWO = ("atan2", "pow")
_PROGRAM = """extern "C" void m_{0}(const double* x, const double* y, double* z, int n) {{
  for (int i = 0; i < n; ++i) z[i] = std::{0}({1});
}}
"""
FILES = {
    "m.cpp": "#include <cmath>\n" + "".join(_PROGRAM.format(f, "x[i], y[i]" if f in _OF_TWO else "x[i]") for f in MATHEMATICS),
    "m.h": "".join(f"void m_{f}(const double* x, const double* y, double* z, int n);\n" for f in MATHEMATICS),
}

_HOST = """
import { readFileSync, writeFileSync } from 'node:fs';
const { instance: { exports } } = await WebAssembly.instantiate(readFileSync('m.wasm'), {});
exports._initialize();
const given = readFileSync('given'), n = given.length / 16, at = exports.memory.grow(Math.ceil(24 * n / 65536)) * 65536;
new Uint8Array(exports.memory.buffer).set(given, at);
for (const name of process.argv.slice(2)) {
  exports[`m_${name}`](at, at + 8 * n, at + 16 * n, n);
  writeFileSync(name, new Uint8Array(exports.memory.buffer, at + 16 * n, 8 * n));
}
"""


def arguments() -> Array:
    """Pairs of numbers (2, n) of all sizes, signs and kinds."""
    rng = np.random.default_rng(48)
    usual = [rng.normal(size=20_000), rng.uniform(-1, 1, 20_000), rng.normal(size=20_000) * 10.0 ** rng.integers(-300, 300, 20_000)]
    x = np.concatenate([*usual, [0.0, -0.0, np.inf, -np.inf, np.nan, 1.0, -1.0, 5e-324, 1e22, 709.7, -745.2, np.pi / 2]])
    return np.array([x, rng.permutation(x)])


def natively(given: Array) -> Mapping[str, Array]:
    """The values of each function by the library for this machine."""
    library, found = ctypes.CDLL(str(build_matching_library("m", FILES, "libm"))), {}
    for name in MATHEMATICS:
        found[name] = np.empty(given.shape[1])
        getattr(library, f"m_{name}")(*(x.ctypes.data_as(ctypes.c_void_p) for x in (*given, found[name])), given.shape[1])
    return found


def test_its_values_are_near_to_exact_ones() -> None:
    """Each within the two units in the last place that its authors promise at most (sinh and tanh; others one)."""
    rng = np.random.default_rng(3)
    given = np.ascontiguousarray([rng.uniform(0.01, 0.99, 300), rng.uniform(-3, 3, 300)])
    with mpmath.workprec(120):
        for name, values in natively(given).items():
            exact = {"log": mpmath.ln, "pow": mpmath.power}.get(name) or getattr(mpmath, name)
            for x, y, value in zip(*given, values, strict=True):
                right = exact(mpmath.mpf(x), mpmath.mpf(y)) if name in _OF_TWO else exact(mpmath.mpf(x))
                assert abs(value - right) <= 2 * np.spacing(abs(value)), (name, x, y)


@pytest.mark.skipif(which("node") is None or find_spec("ziglang") is None, reason="needs Node.js, and ziglang of PyPI")
def test_modules_have_the_same_bits(tmp_path: Path) -> None:
    given = arguments()
    (tmp_path / "given").write_bytes(given.tobytes())
    (tmp_path / "m.wasm").write_bytes(build_module("m", FILES, "libm"))
    (tmp_path / "host.mjs").write_text(_HOST, encoding="utf-8")
    subprocess.run(["node", "host.mjs", *MATHEMATICS], cwd=tmp_path, check=True)
    for name, here in natively(given).items():
        there = np.fromfile(tmp_path / name)
        same = (here.view(np.uint64) == there.view(np.uint64)) | (np.isnan(here) & np.isnan(there))
        assert same.all(), (name, given[:, ~same][:, :3])
        assert np.unique(here).size > 100


@pytest.mark.skipif(which("nm") is None, reason="needs nm of binutils")
def test_no_other_mathematics_is_called() -> None:
    """Square roots and whole numbers are exact wherever they come from."""
    library = build_matching_library("m", FILES, "libm")
    said = subprocess.run(["nm", "-D", "--undefined-only", library], check=True, capture_output=True, text=True)
    called = {line.split()[-1].partition("@")[0] for line in said.stdout.splitlines()}
    assert {name for name in called if not name.startswith(("_", "mem", "str"))} <= {"sqrt", "floor", "fabs"}


def test_names_are_those_of_all_functions() -> None:
    text = (runtime_folder() / "libm/names.h").read_text(encoding="utf-8")
    for name in MATHEMATICS:
        assert f"CUTJOINT_OF_{'TWO' if name in _OF_TWO else 'ONE'}({name})\n" in text
        assert (runtime_folder() / f"libm/{name}.c").is_file()
