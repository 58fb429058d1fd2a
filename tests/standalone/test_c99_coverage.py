"""Branches of exported C99 that a scene's run and random calls take, counted by gcov."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Mapping
from pathlib import Path

import pytest

from tests.conftest import needs_cpp

from .test_c99 import exported

pytestmark = [needs_cpp, pytest.mark.heavy]

#: A run of the scene, calls without a simulation and before its start, then calls of any order, some with numbers that no step survives.
CALLS = """
#include <math.h>
#include <stdlib.h>
#include "{p}.h"
static {p}_sim memory, snapshot;
static unsigned long seed = 1;
static int pick(int n) {{ seed = (1103515245UL * seed + 12345UL) & 0x7fffffffUL; return (int)((seed >> 8) % (unsigned long)n); }}
static double number(void) {{
  static const double special[] = {{0.0, NAN, INFINITY, -INFINITY, 1e308, -1e300, 1e150, 1e-300}};
  return pick(20) == 0 ? special[pick(8)] : (pick(2001) - 1000) / 1000.0 * (pick(2) ? 1.0 : 1e-3);
}}
static void set_state({p}_sim* sim, double size) {{
  static double q[{P}_COORDINATES], v[{P}_SPEEDS];
  int i;
  for (i = 0; {p}_coordinates(sim) && i < {P}_COORDINATES; ++i) {{ q[i] = {p}_coordinates(sim)[i] + size * number(); }}
  for (i = 0; {p}_speeds(sim) && i < {P}_SPEEDS; ++i) {{ v[i] = {p}_speeds(sim)[i] + size * number(); }}
  {p}_set_state(sim, pick(50) ? 0.1 * pick(100) : NAN, pick(50) ? q : NULL, pick(50) ? v : NULL);
}}
static void call({p}_sim* sim) {{
  const int index = pick({P}_PARAMETERS + {P}_INPUTS + 2) - 1;
  switch (pick(14)) {{
    case 0: {p}_set_parameter(sim, index, ({p}_parameters(sim) && index >= 0 && index < {P}_PARAMETERS && pick(3))
                                            ? {p}_parameters(sim)[index] * (1.0 + 0.1 * number()) : number()); break;
    case 1: {more} break;
    case 2: set_state(sim, pick(2) ? 0.0 : 1e-3); break;
    case 3: {p}_outputs(sim); {p}_accelerations(sim); {p}_multipliers(sim); {p}_parameters(sim); {p}_time(sim); break;
    case 4: if (pick(9) == 0) {{ {p}_start(sim); }} break;
    case 5: if (sim) {{ snapshot = *sim; }} break;
    case 6: if (sim && pick(2)) {{ *sim = snapshot; }} break;
    default: {p}_step(sim); break;
  }}
}}
int main(void) {{
  {p}_sim* sim = NULL;
  int k;
  for (k = 0; k < 500; ++k) {{ call(sim); }}
  for (k = -9; k < 60; ++k) {{ {p}_status_text(k); }}
  {p}_create(NULL, sizeof memory); {p}_create(&memory, 1); {p}_step(&memory);
  sim = {p}_create(&memory, sizeof memory);
  for (k = 0; k < 500; ++k) {{ call(sim); }}
  sim = {p}_create(&memory, sizeof memory);
  {p}_start(sim);
  for (k = 0; k < {steps}; ++k) {{ {p}_step(sim); {p}_outputs(sim); }}
  snapshot = *sim;
  for (k = 0; k < {rounds}; ++k) {{
    call(sim);
    if (k % 1000 == 0) {{ sim = {p}_create(&memory, sizeof memory); {p}_start(sim); snapshot = *sim; }}
  }}
  return 0;
}}
"""
INPUTS = (
    "{p}_set_input(sim, index, number(), pick(2) ? 0.0 : number(), pick(2) ? 0.0 : number()); "
    "if (pick(4) == 0) {{ {p}_release_input(sim, index); }}"
)
ITERATED = (
    "{p}_set_limit(sim, pick(4) - 1, pick(3) ? 1e-9 : number()); {p}_set_iterations(sim, pick(20) ? 1 + pick(9) : pick(300) - 90); "
    "{{ {p}_step_statistics s; {p}_last_step(sim, pick(9) ? &s : NULL); }}"
)


def coverage(files: Mapping[str, str], p: str, steps: int, place: Path, rounds: int = 100_000) -> dict[str, tuple[float, int]]:
    """Percentages of lines executed and of branches taken, each of how many, in the C file of a model p."""
    more = [text.format(p=p) for text, there in ((INPUTS, "_set_input"), (ITERATED, "_set_iterations")) if p + there in files[f"{p}.h"]]
    main = CALLS.format(p=p, P=p.upper(), more=" ".join(more), steps=steps, rounds=rounds)
    for file, text in {f"{p}.c": files[f"{p}.c"], f"{p}.h": files[f"{p}.h"], "main.c": main}.items():
        (place / file).write_text(text, encoding="utf-8")
    subprocess.run(["gcc", "-std=c99", "-O0", "--coverage", "-c", f"{p}.c"], cwd=place, check=True)
    subprocess.run(["gcc", "-std=c99", "-Wall", "-O0", "--coverage", "main.c", f"{p}.o", "-lm", "-o", "main"], cwd=place, check=True)
    subprocess.run([place / "main"], cwd=place, check=True)
    said = subprocess.run(["gcov", "-b", f"{p}.c"], cwd=place, check=True, capture_output=True, text=True).stdout
    part = said.partition(f"File '{p}.c'")[2].partition("\nFile ")[0]
    found = re.findall(r"(Lines executed|Taken at least once):([\d.]+)% of (\d+)", part)
    return {what: (float(share), int(number)) for what, share, number in found[:2]}


@pytest.mark.parametrize(
    "name", [
        "press", "press rk4", "press embedded rk4", "pushed", "pushed rk4", "pushed newton", "delta", "rolled", "rolled newton",
        "iltis embedded",
    ],
)
def test_random_calls_take_most_branches(name: str, tmp_path: Path) -> None:
    files, standalone = exported(name)
    found = coverage(files, standalone.name, round(standalone.defaults.end / standalone.defaults.dt), tmp_path)
    assert found["Lines executed"][0] == 100
    assert found["Taken at least once"][0] > 95
