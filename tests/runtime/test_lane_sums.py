"""Sums of lanes of each width, in a program of a second to compile."""

from __future__ import annotations

import subprocess
from pathlib import Path

from cutjoint.package.locations import runtime_folder

PROGRAM = """
#include <cstdio>

#include "cutjoint/core/numbers/lanes.hpp"

template <class Real, int N>
void add() {
  cutjoint::Lanes<Real, N> a;
  for (int k = 0; k < N; ++k) a.v[k] = Real(1 << k);
  std::printf("%d %g\\n", N, double(sum(a)));
}

int main() { add<double, 2>(), add<double, 4>(), add<double, 8>(), add<float, 4>(), add<float, 8>(); }
"""


def test_sums_have_all_lanes(tmp_path: Path) -> None:
    """Lane k has the k-th power of two, so that a sum shows which it has."""
    (tmp_path / "sums.cpp").write_text(PROGRAM)
    command = ["g++", "-std=c++20", "-O0", "-Wno-psabi", f"-I{runtime_folder() / 'include'}", "sums.cpp", "-o", "sums"]
    subprocess.run(command, cwd=tmp_path, check=True)
    lines = subprocess.run([tmp_path / "sums"], capture_output=True, text=True, check=True).stdout.splitlines()
    assert [line.split() for line in lines] == [[str(n), str(2**n - 1)] for n in (2, 4, 8, 4, 8)]
