"""Costs of the functions of FMI 2 and 3 beside a step of the core: instructions counted by valgrind, as `instructions` has them."""

from __future__ import annotations

import subprocess
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory

import click
from rich.console import Console
from rich.table import Table

from cutjoint.export.fmu.archive import Fmu, make_fmu
from cutjoint.run.scenes import find_scene
from cutjoint.topology.reading import read_model
from cutjoint_bench.studies.checkout import MODELS
from cutjoint_bench.studies.instructions import FLAGS, count_instructions
from cutjoint_bench.studies.provenance import provenance

#: Model, scene, integrator's step (s), steps of it in one of communication, and how many of these the two runs have.
CASES = (("iltis", "simul1", 7.5e-3, 1, (160, 320)), ("iltis", "simul1", 7.5e-3, 4, (40, 80)), ("press", "turn", 1e-3, 1, (500, 1000)))
VERSIONS = (2, 3)
_HOST = Path(__file__).with_name("fmu_steps.c")
#: As the folder's own project compiles it.
_AS_FOLDER = (
    "-fPIC", "-fno-math-errno", "-fno-tree-slp-vectorize", "-fno-exceptions", "-fno-rtti", "-fno-threadsafe-statics", "-Wno-psabi"
)  # fmt: skip


def build_core(fmu: Fmu, place: Path) -> Path:
    """The program that steps by the folder's interface, with the code for processors with AVX2 and FMA."""
    name = fmu.standalone.name
    code = {file: text for file, text in fmu.standalone.files.items() if file.endswith((".cpp", ".h"))}
    for file, text in code.items():
        (place / file).write_text(text, encoding="utf-8")
    (source,) = (file for file in code if file.endswith(".cpp"))
    subprocess.run(["g++", "-std=c++20", *FLAGS, *_AS_FOLDER, "-c", source, "-o", "model.o"], cwd=place, check=True)
    defined = [f"-DMODEL={name}", f"-DBYTES={fmu.standalone.size}"]
    subprocess.run(["gcc", "-O2", *defined, "-c", _HOST, "-o", "core.o"], cwd=place, check=True)
    subprocess.run(["g++", "core.o", "model.o", "-lmvec", "-lm", "-o", "core"], cwd=place, check=True)
    return place / "core"


def build_host(fmu: Fmu, place: Path) -> Path:
    """The program that steps by an FMU's binary."""
    made = place / f"fmi{fmu.version}"
    defined = [f"-DFMI={fmu.version}", f'-DTOKEN="{fmu.subject.token}"']
    subprocess.run(["gcc", "-O2", *defined, _HOST, "-o", made, "-ldl"], check=True)
    return made


def per_step(program: Path, step: float, counts: tuple[int, int], *binary: str) -> float:
    """Instructions of a step of communication."""
    first, last = (count_instructions([str(program), str(number), repr(step), *binary], program.parent) for number in counts)
    return (last - first) / (counts[1] - counts[0])


def main() -> None:
    """Print the table."""
    if which("valgrind") is None:
        raise click.ClickException("install valgrind (Debian's package of that name) first")
    table = Table("scene", "steps in one of communication", "core", *(f"by fmi{v}DoStep, more, %" for v in VERSIONS))
    for name, scene, dt, parts, counts in CASES:
        model = read_model(MODELS / f"{name}.yaml")
        fmus = [make_fmu(model, find_scene(model, scene), version=v, integrator="trapezoidal") for v in VERSIONS]
        with TemporaryDirectory() as folder:
            place = Path(folder)
            core = per_step(build_core(fmus[0], place), parts * dt, counts)
            found = [per_step(build_host(f, place), parts * dt, counts, str(f.build(("-O3",), target="both"))) for f in fmus]
        table.add_row(f"{name} {scene}", str(parts), f"{core:.0f}", *(f"{x:.0f}, {100 * (x / core - 1):.2f}" for x in found))
    console = Console(highlight=False, width=140)
    console.print(provenance(FLAGS), markup=False)
    console.print(table)


if __name__ == "__main__":
    main()
