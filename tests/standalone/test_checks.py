"""Checks of a folder that is compiled, linked and given bytes: names, digests, flags, snapshots, sizes."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

import cutjoint
from cutjoint.emit.standalone import in_c
from tests.conftest import MODELS, needs_cpp

from .c_exports import CXX, C, link, run, standalone_of, write

pytestmark = needs_cpp

PROGRAM = """
#include <string.h>
#include "press.h"
static double memory[PRESS_SIZE / sizeof(double)];
int main(void) {
  press_sim* sim = press_create(memory, sizeof memory);
  if (strcmp(press_output_name(PRESS_OUTPUT_spring_force), "spring.force") != 0) return 1;
  if (PRESS_OUTPUT_slider_vx != press_find_output("slider.vx") || PRESS_PARAMETER_stiffness != 0) return 2;
  return strlen(PRESS_DIGEST) != 16 || press_start(sim) != PRESS_OK;
}
"""


@pytest.fixture(scope="module")
def press(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = write(standalone_of("press"), tmp_path_factory.mktemp("press"))
    (place / "host.c").write_text(PROGRAM)
    subprocess.run(["g++", *CXX, "-fstack-usage", "-c", "press.cpp"], cwd=place, check=True)
    return place


def test_names_are_known_when_a_host_is_compiled(press: Path) -> None:
    run(link(press, "host", ["host.c", "press.o"]))


def test_words_of_names_are_apart() -> None:
    assert in_c(["a.b", "c", "d_e"]) == ["a_b", "c", "d_e"]
    assert in_c(["a.b_c", "x", "a_b.c"]) == ["a_b_c_0", "x", "a_b_c_2"]
    assert in_c(["a.b", "a_b", "a.b_0"]) == ["a_b_0", "a_b_1", "a_b_0_2"]


def test_a_header_of_another_version_does_not_link(press: Path, tmp_path: Path) -> None:
    header = (press / "press.h").read_text()
    (digest,) = re.findall(r'#define PRESS_DIGEST "([0-9a-f]{16})"', header)
    (tmp_path / "press.h").write_text(header.replace(digest, "0123456789abcdef"))
    (tmp_path / "host.c").write_text(PROGRAM)
    for more, linked in (((), False), (("-DPRESS_UNCHECKED",), True)):
        command = ["gcc", *C, *more, "host.c", press / "press.o", "-lm", "-lmvec", "-o", "host"]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert (done.returncode == 0) == linked
        assert linked or "press_create_0123456789abcdef" in done.stderr


@pytest.mark.parametrize("compiler", ["g++", "clang++"])
@pytest.mark.parametrize(("flags", "words"), [
    (("-std=c++17",), "press.cpp is C++20: compile it with -std=c++20"),
    (("-std=c++20", "-ffast-math"), "compile it without -ffast-math"),
    (("-std=c++20", "-ffinite-math-only"), "tests for infinity and NaN"),
])  # fmt: skip
def test_flags_that_change_the_numbers_are_refused(press: Path, compiler: str, flags: tuple[str, ...], words: str) -> None:
    one = "-fmax-errors=1" if compiler == "g++" else "-ferror-limit=1"
    done = subprocess.run([compiler, *flags, one, "-fsyntax-only", "press.cpp"], cwd=press, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert words in done.stderr


def test_a_snapshot_in_which_a_bit_is_wrong_is_refused() -> None:
    sim = cutjoint.load(MODELS / "press.yaml", integrator="trapezoidal").reset()
    sim.run(5)
    good = sim.snapshot()
    other, random = sim.copy(), np.random.default_rng(1)
    for bit in random.choice(8 * len(good), 2000, replace=False).tolist():
        bad = bytearray(good)
        bad[bit // 8] ^= 1 << bit % 8
        with pytest.raises(ValueError, match="these bytes are no snapshot of 'press'"):
            other.restore(bytes(bad))
    with pytest.raises(ValueError, match="no snapshot"):
        other.restore(good[:-8])
    other.restore(good)
    sim.step()
    other.step()
    assert np.array_equal(sim.coordinates.array, other.coordinates.array)


def test_its_program_says_memory_and_stack(press: Path) -> None:
    said = run(link(press, "sizes", ["press_simulator.c", "press.o"]), "--sizes")
    memory, stack = map(int, re.fullmatch(r"(\d+) bytes of memory, (\d+) bytes of stack\n", said).groups())  # type: ignore[union-attr]
    (size,) = re.findall(r"#define PRESS_SIZE (\d+)", (press / "press.h").read_text())
    frames = {line.split("\t")[0]: int(line.split("\t")[1]) for line in (press / "press.su").read_text().splitlines()}
    step = max(bytes_ for name, bytes_ in frames.items() if "evaluate(" in name)
    assert memory == int(size)
    assert step < stack < sum(frames.values())  # each function once
