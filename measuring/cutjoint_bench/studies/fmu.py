"""What the functions of FMI 2 add to a step of the core: instructions counted by valgrind, as `instructions` has them."""

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
_HOST = Path(__file__).with_name("fmu_steps.c")
#: As the folder's own project compiles it.
_AS_FOLDER = ("-fno-math-errno", "-fno-tree-slp-vectorize", "-fno-exceptions", "-fno-rtti", "-Wno-psabi")


def build(fmu: Fmu, place: Path) -> tuple[Path, Path]:
    """The program that steps by the core, and the one that steps by the FMU."""
    name = fmu.standalone.name
    for file, text in fmu.sources.items():
        (place / file).write_text(text, encoding="utf-8")
    sources = [file for file in fmu.sources if file.endswith(".cpp")]
    subprocess.run(["g++", "-std=c++20", *FLAGS, *_AS_FOLDER, "-c", *sources], cwd=place, check=True)
    defined = [f"-DMODEL={name}", f'-DTOKEN="{fmu.subject.token}"', f"-DBYTES={fmu.standalone.size}"]
    for program, more in (("core", ()), ("fmu", ("-DBY_FMU",))):
        subprocess.run(["gcc", "-O2", *defined, *more, "-c", _HOST, "-o", f"{program}.o"], cwd=place, check=True)
        objects = [f"{Path(file).stem}.o" for file in sources]
        subprocess.run(["g++", f"{program}.o", *objects, "-lmvec", "-lm", "-o", program], cwd=place, check=True)
    return place / "core", place / "fmu"


def per_step(program: Path, step: float, counts: tuple[int, int]) -> float:
    """Instructions of a step of communication."""
    first, last = (count_instructions([str(program), str(number), repr(step)], program.parent) for number in counts)
    return (last - first) / (counts[1] - counts[0])


def main() -> None:
    """Print the table."""
    if which("valgrind") is None:
        raise click.ClickException("install valgrind (Debian's package of that name) first")
    table = Table("scene", "steps in one of communication", "core", "by fmi2DoStep", "more, %")
    for name, scene, dt, parts, counts in CASES:
        model = read_model(MODELS / f"{name}.yaml")
        with TemporaryDirectory() as folder:
            programs = build(make_fmu(model, find_scene(model, scene), version=2, integrator="trapezoidal"), Path(folder))
            core, fmu = (per_step(program, parts * dt, counts) for program in programs)
        table.add_row(f"{name} {scene}", str(parts), f"{core:.0f}", f"{fmu:.0f}", f"{100 * (fmu / core - 1):.2f}")
    console = Console(highlight=False, width=140)
    console.print(provenance(FLAGS), markup=False)
    console.print(table)


if __name__ == "__main__":
    main()
