"""Code for several processors in one binary: which is chosen, its numbers, its states, and that none is taken for another's."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Sequence
from pathlib import Path
from shutil import which

import numpy as np
import pytest
from click.testing import CliRunner

import cutjoint
from cutjoint.cli import main
from cutjoint.export.fmu.archive import choose_target
from cutjoint.toolchain.compiler import processor
from cutjoint.toolchain.platforms import name_here
from tests.conftest import MODELS, needs_cpp

from .hosts import SIZE, STEPS, host, hosted, require_equal, rows_of
from .slaves import fmu_of

pytestmark = [needs_cpp, pytest.mark.skipif(name_here() != "linux-x86_64", reason="needs Linux on x86-64")]

#: From -O2 on compilers join products and sums.
FLAGS, AVX2 = ("-O2",), ("-mavx2", "-mfma")
#: A processor of 2008, without AVX.
OLD = ["qemu-x86_64", "-cpu", "Nehalem"]

needs_qemu = pytest.mark.skipif(which(OLD[0]) is None, reason="needs qemu-user")
needs_avx2 = pytest.mark.skipif(
    not {"avx2", "fma"} <= {word for line in processor() for word in line.split()}, reason="needs a processor with AVX2 and FMA"
)


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> str:
    return str(host(tmp_path_factory.mktemp("host"), "", "-ldl"))


def table(target: str, *call: str, flags: Sequence[str] = FLAGS) -> np.ndarray:
    """Outputs of the press by a host, one row a step."""
    fmu = fmu_of("press", 3, integrator="trapezoidal")
    return rows_of(hosted(fmu, fmu.build(flags, target=target), call))


@needs_avx2
@pytest.mark.heavy
def test_a_processor_with_avx2_runs_the_folder_compiled_for_it_bit_by_bit(program: str) -> None:
    found, sim = table("both", program), cutjoint.load(MODELS / "press.yaml", integrator="trapezoidal", flags=(*FLAGS, *AVX2)).reset()
    for i, row in enumerate(found):
        sim.advance(i * SIZE + SIZE)
        assert list(row) == list(sim.outputs.array)
    assert np.array_equal(found, table("avx2", program))


@needs_qemu
def test_a_processor_without_avx2_runs_the_code_for_all_bit_by_bit(program: str) -> None:
    assert np.array_equal(table("both", *OLD, program), table("baseline", *OLD, program))


@needs_qemu
@needs_avx2
def test_codes_differ_by_rounding(program: str) -> None:
    new, old = table("both", program), table("both", *OLD, program)
    require_equal(old, new)
    assert not np.array_equal(table("baseline", program), new)


@needs_qemu
@needs_avx2
def test_states_go_on_in_the_other_code(program: str, tmp_path: Path) -> None:
    fmu, state, half = fmu_of("press", 3, integrator="trapezoidal"), tmp_path / "state", STEPS // 2
    binary, known = fmu.build(FLAGS, target="both"), table("both", program)
    for first, second in (([program], [*OLD, program]), ([*OLD, program], [program])):
        before = rows_of(hosted(fmu, binary, first, steps=half, end=state))
        after = rows_of(hosted(fmu, binary, second, steps=half, begin=state))
        require_equal(np.concatenate([before, after]), known)


@needs_qemu
@pytest.mark.heavy
def test_a_processor_without_avx2_is_reported_what_it_lacks(program: str) -> None:
    fmu = fmu_of("press", 3, integrator="trapezoidal")
    done = hosted(fmu, fmu.build(FLAGS, target="avx2"), [*OLD, program])
    assert done.returncode == 4
    assert "the binary is for processors with AVX2 and FMA, and this one lacks them" in done.stderr


#: A function in a disassembly, and the instructions of AVX in it: all that begin with v but two of the first protected mode.
_FUNCTION, _AVX = re.compile(r"^[0-9a-f]+ <(.+)>:$"), re.compile(r"^\s+[0-9a-f]+:\t(v(?!er[rw])\w+)")


@needs_avx2
@pytest.mark.heavy
@pytest.mark.parametrize(("compiler", "kind"), [("g++", "cs"), ("clang++", "both")])
def test_no_function_of_avx2_is_taken_for_other_processors(compiler: str, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without optimisation templates of the C++ library are functions, which both compilations have and the linker takes from one."""
    monkeypatch.setenv("CXX", compiler)
    made = fmu_of("press", 3, integrator="rk4", kind=kind).build(("-O0",), target="both")
    text = subprocess.run(["objdump", "-d", "--no-show-raw-insn", made], capture_output=True, text=True, check=True).stdout
    functions, name = dict[str, int](), ""
    for line in text.splitlines():
        if found := _FUNCTION.match(line):
            name = found[1]
            functions[name] = 0
        elif name and _AVX.match(line):
            functions[name] += 1
    shared = [name for name in functions if name.startswith(("_ZNSt", "_ZNKSt", "_ZSt"))]
    assert len(shared) > 20
    assert sum(count > 0 for name, count in functions.items() if "press_avx2_" in name) > 100
    assert [name for name, count in functions.items() if count and "press_avx2_" not in name] == []


def test_flags_that_name_a_processor_choose_its_code_alone() -> None:
    assert choose_target(("-O3",)) == "both"
    assert choose_target(("-O3", "-march=native")) == "baseline"
    assert choose_target(("-O3",), "avx2") == "avx2"
    with pytest.raises(cutjoint.RunError, match="target: the flags name a processor, -mavx; leave out --target, or remove them from"):
        choose_target(("-O3", "-mavx"), "both")


def test_targets_are_for_binaries_of_fmus(tmp_path: Path) -> None:
    for words, text in (
        (("fmu", "--sources"), "--target is for binaries; leave out --sources"),
        (("mujoco",), "--target is for --to fmu, not for --to mujoco"),
    ):
        arguments = ["export", str(MODELS / "press.yaml"), "--to", *words, "--target", "both", "--out", str(tmp_path / "press.fmu")]
        done = CliRunner().invoke(main, arguments)
        assert (done.exit_code, text in " ".join(done.output.split())) == (2, True)
