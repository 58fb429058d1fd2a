"""Exports in folders -> the commands that run them there."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from cutjoint.toolchain.temporary import temporary_folder
from cutjoint_bench.export.exudyn import MODULES
from cutjoint_bench.export.pinocchio import DEFINITIONS, ENGINE
from cutjoint_bench.peers.compile_cpp import compile_program, module_folder


def build_mujoco(folder: Path) -> list[str]:
    """Compile an export in a folder; the command that runs it there.

    Raises:
        ToolchainError: MuJoCo is not installed, or the compiler refused the program.
    """
    home = module_folder("mujoco", "mujoco-core")
    libraries = [str(path) for path in sorted(home.glob("libmujoco.so.*"))]
    return [str(compile_program(folder, [f"-I{home / 'include'}", *libraries, f"-Wl,-rpath,{home}"]))]


def build_exudyn(folder: Path) -> list[str]:
    """The command that runs an export in a folder.

    Raises:
        ToolchainError: Exudyn is not installed.
    """
    module_folder("exudyn", "exudyn")
    modules = {f"{module}.py" for module in MODULES}
    script = next(path for path in sorted(folder.glob("*.py")) if path.name not in modules)
    return [sys.executable, script.name]


def build_pinocchio(folder: Path) -> list[str]:
    """The command that runs an export in a folder, compiled; what is the same for all models is compiled once.

    Raises:
        ToolchainError: Pinocchio is not installed, or its headers or the program did not compile.
    """
    installed = module_folder("pinocchio", "pin")
    prefix = next(p for p in installed.parents if p.name == "cmeel.prefix")
    headers = (f"{prefix}/include", f"{prefix}/include/eigen3", "/usr/include/eigen3", "/usr/local/include/eigen3")
    options = ["-w", *DEFINITIONS, *(f"-isystem{folder}" for folder in headers)]
    compiled = [str(_compile_part(folder, part, includes, options)) for part, includes in ENGINE.items()]
    return [str(compile_program(folder, [*options, *compiled]))]


def _compile_part(folder: Path, part: str, includes: Sequence[str], options: Sequence[str]) -> Path:
    """The object of a part; -O2, since -O3 takes a compiler still longer."""
    with temporary_folder() as place:
        for file in (part, *includes):
            (place / file).with_suffix(".cpp" if file.endswith(".cc") else ".hpp").write_bytes((folder / file).read_bytes())
        return compile_program(place, ["-O2", "-c", *options])
