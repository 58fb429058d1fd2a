"""Folders on other processors: ARM with 64 and 32 bits and RISC-V, run by qemu, and WebAssembly, run by Node.js."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from shutil import which

import pytest

from .c_exports import CXX, LIBRARIES, C, standalone_of, write

#: A host of WebAssembly with the calls of WASI that the C library makes: it opens files beside it, and prints.
WASI = """
import { readFile } from "node:fs/promises";
import { WASI } from "node:wasi";
const wasi = new WASI({ version: "preview1", args: process.argv.slice(2), preopens: { ".": "." } });
const { instance } = await WebAssembly.instantiate(await readFile(process.argv[2]), wasi.getImportObject());
process.exit(wasi.start(instance));
"""


@dataclass(frozen=True)
class Processor:
    """Compilers of C and of C++ for a processor, the call that runs a program, the packages that both need, and libraries."""

    c: tuple[str, ...]
    cxx: tuple[str, ...]
    call: tuple[str, ...]
    package: str
    libraries: tuple[str, ...] = ("-lm", "-static")
    missing: bool = False
    same_sines: bool = True


def by_qemu(tools: str, name: str, *, same_sines: bool = True) -> Processor:
    """A processor that Debian has compilers for."""
    return Processor(
        (f"{tools}-gcc",), (f"{tools}-g++",), (f"qemu-{name}",), f"qemu-user and g++-{tools}", same_sines=same_sines,
        missing=which(f"qemu-{name}") is None or which(f"{tools}-g++") is None,
    )  # fmt: skip


_ZIG = (sys.executable, "-m", "ziglang")

HERE = Processor(("gcc",), ("g++",), (), "", LIBRARIES)

PROCESSORS = {
    "aarch64": by_qemu("aarch64-linux-gnu", "aarch64"),
    "armhf": by_qemu("arm-linux-gnueabihf", "arm", same_sines=False),
    "riscv64": by_qemu("riscv64-linux-gnu", "riscv64"),
    "wasm32": Processor(
        (*_ZIG, "cc", "-target", "wasm32-wasi"), (*_ZIG, "c++", "-target", "wasm32-wasi"), ("node", "--no-warnings", "host.mjs"),
        "Node.js, and ziglang from PyPI", ("-lm",), same_sines=False,
        missing=find_spec("ziglang") is None or which("node") is None,
    ),
}  # fmt: skip


def table_of(processor: Processor, name: str, place: Path) -> list[list[float]]:
    """The rows of a folder's simulator, after its header."""
    quiet = () if processor is HERE else ("-Wno-psabi",) if processor.package.startswith("qemu") else ("-Wno-unknown-warning-option",)
    subprocess.run([*processor.cxx, *CXX, *quiet, "-ffp-contract=off", "-c", f"{name}.cpp", "-o", f"{name}.o"], cwd=place, check=True)
    subprocess.run([*processor.c, *C, f"{name}_simulator.c", f"{name}.o", *processor.libraries, "-o", "simulator"], cwd=place, check=True)
    (place / "host.mjs").write_text(WASI, encoding="utf-8")
    call = [*processor.call, "./simulator", f"{name}.run"]
    done = subprocess.run(call, cwd=place, check=True, capture_output=True, text=True)
    return [[float(x) for x in line.split(",")] for line in done.stdout.splitlines()[1:]]


@pytest.mark.parametrize("processor", PROCESSORS)
@pytest.mark.parametrize(
    ("name", "method", "rows"), [("four_bar", "recursive", 501), ("four_bar", "augmented", 501), ("press", "recursive-newton", 201)]
)
def test_a_run_has_the_numbers_of_this_machine(name: str, method: str, rows: int, processor: str, tmp_path: Path) -> None:
    """To the last bit where products and sums are not contracted and the sines are the same; with other sines as near as iterations end."""
    there = PROCESSORS[processor]
    if there.missing:
        pytest.skip(f"needs {there.package}")
    place = write(standalone_of(name, method=method), tmp_path)
    here, found = table_of(HERE, name, place), table_of(there, name, place)
    assert len(here) == rows
    if there.same_sines:
        assert found == here
    else:
        differences = [abs(x - y) for a, b in zip(here, found, strict=True) for x, y in zip(a, b, strict=True)]
        assert max(differences) < (1e-6 if method == "recursive-newton" else 1e-9)  # Newton's iteration ends at the step's tolerance
