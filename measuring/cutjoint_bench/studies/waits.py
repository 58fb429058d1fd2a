"""Waits of a user, from an edit to a result, and their parts.  `make waits`.

Each command is a process of its own.  "Cold" begins with an empty cache, after what `cutjoint warm` builds once; the others with the cache
that the unchanged model has left.  Wall time says what a user waits for; processor time hardly depends on what else the machine does.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter

import click
from rich.console import Console
from rich.table import Table

from cutjoint.toolchain.build import FLAGS, warm
from cutjoint.toolchain.cmake import build_project, plain_runtime
from cutjoint.toolchain.compiler import find_compiler
from cutjoint.toolchain.drivers import DRIVERS, Kind
from cutjoint_bench.studies.checkout import MODELS
from cutjoint_bench.studies.provenance import provenance

#: Edits of the Iltis by name: what stands in its file, and what stands there afterwards.
EDITS: Mapping[str, tuple[str, str]] = {
    "output": ("outputs: [chassis.x,", "outputs: [chassis.wx, front_left.carrier.vz, chassis.x,"),
    "hardpoint": ("S: [x_hinge, 0.1585, 0.600]", "S: [x_hinge, 0.1585, 0.601]"),
    "input law": ("    road:\n", '    inputs: {rack_displacement: "0.001*sin(2*pi*t)"}\n    road:\n'),
    "road": ("{ramp: 10, rise: 1.25}", "{ramp: 10, rise: 1.2}"),
}

CUTJOINT = (sys.executable, "-c", "from cutjoint.cli import main; main()")

#: Phases of the symbolic half, in a process of their own: JSON of processor times, s; the source goes to a folder.
SYMBOLIC = """
import gc, json, sys
gc.set_threshold(100_000)
from pathlib import Path
from time import process_time
times, last = {"start of Python": process_time()}, process_time()
def note(name):
    global last
    times[name], last = process_time() - last, process_time()
import sympy
note("import SymPy")
from cutjoint.commands import simulate
from cutjoint.compile import derivation
from cutjoint.formulate.lanes import schedule_recursive
from cutjoint.model.read import read_model
from cutjoint.compile.systems import schedule_system
from cutjoint.toolchain.build import write_source
note("other imports")
model = read_model(Path(sys.argv[1]))
scene, method = model.scenes[sys.argv[2]], sys.argv[3]
note("read the model")
has_system = derivation.METHODS[method].has_system
equations = derivation.derive(model, scene, () if has_system else scene.outputs)
note("topology, equations of the mechanism")
if has_system:
    scheduled = schedule_system(equations.starting, method, tuple(scene.outputs), lanes=True)
    note("equations of the system, lanes, lowering, common terms, order")
else:
    scheduled = equations, schedule_recursive(equations, lanes=True)
    note("lanes, lowering, common terms")
source = derivation.emit_scheduled(*scheduled)
note("printing")
write_source(source, Path(sys.argv[4]))
print(json.dumps(times))
"""


@dataclass(frozen=True, kw_only=True)
class Wait:
    """A command that is waited for: ``words`` of `cutjoint` with {model}, {cases} and {out}, or a ``script``.
    The script is Python with {model}; an ``edit`` of EDITS comes after a first run of the unchanged model."""

    name: str
    model: str
    words: str = ""
    script: str = ""
    edit: str = ""

    def command(self, places: Mapping[str, Path]) -> list[str]:
        """The command with its files."""
        script = [sys.executable, "-c", self.script.format_map(places)]
        return script if self.script else [*CUTJOINT, *(word.format_map(places) for word in self.words.split())]


#: A simulation that Python holds, and the library of a study with many runs.
_LOAD = "import cutjoint; cutjoint.load('{model}', scene='simul1')"
_SWEEP = """
from cutjoint.sweeps.code import build_kernels
from cutjoint.sweeps.reading import read_study_text
build_kernels(read_study_text('''
cutjoint_study: 1
model: {model}
scenes: [simul1]
parameters: {{chassis_mass: [1200, 1300]}}
objectives: {{high: {{maximum: chassis.z}}}}
''', '{model}'), lanes=True)
"""

_SIMUL1 = "simulate {model} --scene simul1 --out {out}"
WAITS = (
    Wait(name="Iltis simul1, cold", model="iltis", words=_SIMUL1),
    *(Wait(name=f"Iltis simul1, changed {edit}", model="iltis", words=_SIMUL1, edit=edit) for edit in EDITS),
    Wait(name="four-bar, cold", model="four_bar", words="simulate {model} --out {out}"),
    Wait(name="Iltis simul1 by recursive-newton, cold", model="iltis", words=f"{_SIMUL1} --method recursive-newton"),
    Wait(name="batch of 200 runs of the press, cold", model="press", words="batch {model} {cases} --out {out}"),
    Wait(name="modes of the Iltis, changed hardpoint", model="iltis", words="modes {model} --scene simul1", edit="hardpoint"),
    Wait(name="equilibrium of the Iltis, changed hardpoint", model="iltis", words="equilibrium {model} --scene simul1", edit="hardpoint"),
    Wait(name="Iltis simul1 by method auto, cold", model="iltis", words=f"{_SIMUL1} --method auto --accuracy 1e-3"),
    Wait(name="load of the four-bar, cold", model="four_bar", script="import cutjoint; cutjoint.load('{model}')"),
    *(
        Wait(name=f"{what} of the Iltis{how}, {f'changed {edit}' if edit else 'cold'}", model="iltis", script=script, edit=edit)
        for what, how, script, edits in (("load", "", _LOAD, ("", "output", "road")), ("sweep", " in lanes", _SWEEP, ("", "road")))
        for edit in edits
    ),
)


def time_wait(wait: Wait) -> tuple[float, float]:
    """Wall time and processor time of a command, s."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        model, cases = folder / f"{wait.model}.yaml", folder / "cases.csv"
        text = (MODELS / f"{wait.model}.yaml").read_text(encoding="utf-8")
        model.write_text(text, encoding="utf-8")
        cases.write_text("stiffness\n" + "".join(f"{2000 + i}\n" for i in range(200)), encoding="utf-8")
        places = {"model": model, "cases": cases, "out": folder / "run.csv"}
        command = wait.command(places)
        environment = {**os.environ, "CUTJOINT_CACHE": str(folder / "cache")}
        if wait.edit:
            time_process(command, environment)
            model.write_text(edited(text, wait.edit), encoding="utf-8")
        return time_process(command, environment)


def edited(text: str, edit: str) -> str:
    """A model's text after an edit of EDITS; at its first scene with a road, simul1, where the edit is one of a scene."""
    before, after = EDITS[edit]
    assert before in text
    return re.sub(f"(simul1: .*?){re.escape(before)}", lambda found: found[1] + after, text, count=1, flags=re.DOTALL) if (
        text.index(before) > text.index("scenes:")
    ) else text.replace(before, after, 1)  # fmt: skip


def time_process(command: Sequence[str], environment: Mapping[str, str] | None = None) -> tuple[float, float]:
    """Wall time and processor time, s, of a process and of those that it has called."""
    begin, before = perf_counter(), getrusage(RUSAGE_CHILDREN)
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, env=environment, check=False)
    elapsed, after = perf_counter() - begin, getrusage(RUSAGE_CHILDREN)
    if done.returncode != 0:
        raise click.ClickException(f"{shlex.join(command)}: {done.stderr[-800:]}")
    return elapsed, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def phases(model: str, scene: str, method: str) -> Iterator[tuple[str, float]]:
    """Names and processor times, s, of what compiling a model comes to."""
    with TemporaryDirectory() as name:
        source, out = Path(name) / "source", Path(name) / "out"
        yield from symbolic_phases(MODELS / f"{model}.yaml", scene, method, source).items()
        runtime = plain_runtime(Path(name))
        project = ("-DCMAKE_EXPORT_COMPILE_COMMANDS=ON", f"-DCUTJOINT_RUNTIME={runtime}", *Kind().definitions(Path(name)))
        before = getrusage(RUSAGE_CHILDREN)
        build_project(source, out, find_compiler(), FLAGS, *project)
        everything = getrusage(RUSAGE_CHILDREN).ru_utime - before.ru_utime
        compilations = sorted(_compilations(out), key=lambda found: found[0])
        yield from _times_of_files(compilations)
        again = ["cmake", "-S", str(source), "-B", str(Path(name) / "again"), "-G", "Ninja", project[1]]
        yield "CMake's configuration, with a driver to build", time_process(again)[1]
        yield "all processes of the build together", everything


def symbolic_phases(model: Path, scene: str, method: str, out: Path) -> dict[str, float]:
    """Names and processor times, s, of the symbolic half, which puts its source into a folder."""
    done = subprocess.run([sys.executable, "-c", SYMBOLIC, model, scene, method, out], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise click.ClickException(done.stderr[-800:])
    times: dict[str, float] = json.loads(done.stdout)
    return times


def _compilations(out: Path) -> Iterator[tuple[str, list[str]]]:
    """The source of each object file of a build, and its command."""
    for entry in json.loads((out / "compile_commands.json").read_text(encoding="utf-8")):
        yield Path(entry["file"]).name, ["env", "-C", entry["directory"], *shlex.split(entry["command"])]


def _times_of_files(compilations: Iterable[tuple[str, list[str]]]) -> Iterator[tuple[str, float]]:
    """Processor times of compilations, one by one: of the compiler's front end, and of all."""
    for name, command in compilations:
        yield f"{name}: front end and headers", time_process([*command, "-fsyntax-only"])[1]
        yield f"{name}: all", time_process(command)[1]


def print_waits(console: Console, repetitions: int, only: str) -> None:
    """A line for each wait as soon as it is measured."""
    console.print(f"waits, medians of {repetitions} (least .. largest), s: wall; processor")
    for wait in (w for w in WAITS if only in w.name):
        times = zip(*(time_wait(wait) for _ in range(repetitions)), strict=True)
        console.print(f"{wait.name:50}", "; ".join(f"{median(x):5.1f} ({min(x):.1f} .. {max(x):.1f})" for x in times))


@click.command()
@click.option("--repetitions", default=3, show_default=True)
@click.option("--only", default="", help="Waits whose names have this text.")
@click.option("--where/--no-where", default=True, help="Where the time goes, too.")
def main(repetitions: int, only: str, where: bool) -> None:
    """Print what is waited for, and where the time goes."""
    console = Console(highlight=False, width=140)
    console.print(f"{provenance()}; {len(os.sched_getaffinity(0))} cores", markup=False)
    for driver in DRIVERS:
        warm(driver)
    print_waits(console, repetitions, only)
    for method in ("recursive", "recursive-newton") if where else ():
        table = Table("", "processor, s", title=f"iltis, simul1, {method}", box=None)
        for name, seconds in phases("iltis", "simul1", method):
            table.add_row(name, f"{seconds:.2f}")
        console.print(table)


if __name__ == "__main__":
    main()
