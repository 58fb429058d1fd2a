"""Instructions of a step and of an evaluation, counted by valgrind: the same in every run, whatever else the machine does.

Few rows, so that printing them is next to nothing; vectors of AVX2, since valgrind knows no AVX-512.  The counts of a longer run less
those of a shorter one, over the steps between: what a run begins with is not in them.
"""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory

import click
from rich.console import Console
from rich.table import Table

from cutjoint.compile.c_export import make_standalone
from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.emit.source import Generated
from cutjoint.methods import METHODS, Formulation
from cutjoint.model.read import read_model_text
from cutjoint.run.artifact import Artifact, make_simulator_run
from cutjoint.run.scenes import find_scene
from cutjoint.run.settings import Options
from cutjoint.run.simulator_run import SimulatorRun
from cutjoint_bench.studies.checkout import MODELS
from cutjoint_bench.studies.provenance import provenance

FLAGS = ("-O3", "-mavx2", "-mfma")

#: The generated function, not the one of the simulator that calls it.
EVALUATE = "cutjoint::generated::*::evaluate*"
#: Name, scene, methods, and the ends of the two runs, s.
CASES = (
    ("iltis", "simul1", tuple(METHODS), (2.4, 4.8)),
    *(
        (name, scene, ("recursive",), ends)
        for scene, ends in (("rolls", (0.1, 0.3)), ("rolls_in_long_steps", (0.3, 0.9)))
        for name in ("iltis", "iltis on wheels that turn")
    ),
    ("slider_crank", "turn", tuple(METHODS), (0.5, 1.0)),
    ("slider_crank with a motor", "turn", tuple(METHODS), (0.5, 1.0)),
    ("slider_crank with a motor, 20 signals and 8 states", "turn", tuple(METHODS), (0.5, 1.0)),
)

#: The carrier of the Iltis without its wheel, and the wheel in place of the element `tyre`.
CARRIER = "      carrier: {mass: 37.35, centre_of_mass: C, inertia: [0.2402, 0.1, 0.2402]}\n"
WHEEL = """    submodels: {wheel: {include: library/wheel_mf62}}
    instances:
      wheel:
        use: wheel
        connect: {carrier: carrier}
        with: {x: x_hinge, y: 0.615, z: 0.356, UNLOADED_RADIUS: tyre_radius, drive: "where(x_hinge < 0, 60, 0)"}
        properties: iltis.tir
"""
#: From its design position at 20 m/s with a steer that begins softly, at two lengths of steps.
ROLLS = """  rolls: &rolls
    end: 3
    rates: {{chassis_free.vx: 20{rates}}}
    states: {{{states}}}
    inputs: {{rack_displacement: "0.001*(1 - cos(2*pi*t))"}}
    numerics: {{penalty: 1.0e+9, dt: 0.001}}
  rolls_in_long_steps:
    <<: *rolls
    numerics: {{penalty: 1.0e+9, dt: 0.0075}}
"""


def rolling_text(text: str, *, on_wheels: bool) -> str:
    """The Iltis with the scenes that roll, on request on four wheels by the Magic Formula 6.2, of which the rear ones are driven."""
    corners = ("front_left", "front_right", "rear_left", "rear_right") if on_wheels else ()
    if on_wheels:
        text = re.sub(r"      tyre:\n        kind: tyre\n(        .*\n)+", WHEEL, text)
        text = re.sub(r"      carrier:\n(        .*\n)+", CARRIER, text, count=1)
        text = text.replace("tyre.Fz, tyre.Fy, tyre.slip, ", "")
    rates = "".join(f", {corner}.wheel.rolling.bearing.angle_rate: 20/0.361" for corner in corners)
    return text + ROLLS.format(rates=rates, states=", ".join(f"{corner}.wheel.rolling.rolled: 1" for corner in corners))


def text_of(name: str) -> str:
    """The text of a model of the repository, some with additions.
    With a motor that sees its pin, or signals and states of a product and a sum each."""
    text = (MODELS / f"{name.split(' ')[0]}.yaml").read_text(encoding="utf-8")
    if name.startswith("iltis"):
        return rolling_text(text, on_wheels="wheels" in name)
    if "motor" not in name:
        return text
    more = "forces: {motor: {kind: joint_force, joint: crank_pin, law: -0.05*rate}}\n"
    if "signals" in name:
        states = "".join(f"  s{i}: {{start: 0.1, rate: -2*s{i} + g{2 * i + 1}}}\n" for i in range(8))
        signals = "".join(f"  g{k}: 0.5*g{k - 1} + s{k % 8}\n" for k in range(1, 20))
        more = more.replace("-0.05*rate", "-0.05*rate + 0.001*g19")
        more += f"states:\n{states}signals:\n  g0: 0.5*crank_pin.angle_rate + s0\n{signals}"
    return text.replace("outputs: [", f"{more}outputs: [")


def count(run: SimulatorRun, within: str = "") -> tuple[int, int]:
    """Instructions of a run, or of one function in it, and its steps."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "run.json").write_text(json.dumps({**run.run_file.entries(), "out": str(folder / "table.csv")}), encoding="utf-8")
        only = [f"--toggle-collect={within}"] if within else []
        done = call_under_valgrind([str(run.simulator), str(folder / "run.json")], folder, *only)
    return collected(done), json.loads(done.stdout.splitlines()[-1])["steps"]


def count_instructions(command: Sequence[str], folder: Path) -> int:
    """Instructions of a program."""
    return collected(call_under_valgrind(command, folder))


def call_under_valgrind(command: Sequence[str], folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    """A program under callgrind, whose own file goes into the folder."""
    valgrind = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={folder / 'out'}", *options]
    return subprocess.run([*valgrind, *command], capture_output=True, text=True, check=True)


def collected(done: subprocess.CompletedProcess[str]) -> int:
    """The instructions that callgrind has counted."""
    found = re.search(r"Collected : (\d+)", done.stderr)
    assert found is not None, done.stderr
    return int(found[1])


def per_step_alone(artifact: Artifact, ends: tuple[float, float]) -> float:
    """Instructions of a step of the C export, in whole steps of the scene's length."""
    standalone = make_standalone(Generated(artifact.equations, artifact.program, artifact.source), equal_steps=True)
    program, dt = standalone.build_simulator(FLAGS), artifact.scene.numerics.of_method(artifact.method).step
    totals, steps = [], [round(end / dt) for end in ends]
    with TemporaryDirectory() as name:
        place = Path(name) / "run"
        for number in steps:
            place.write_text(f"step {dt!r}\nend {number * dt!r}\noutput_step {number * dt!r}\n", encoding="utf-8")
            totals.append(count_instructions([str(program), str(place)], Path(name)))
    return (totals[1] - totals[0]) / (steps[1] - steps[0])


def per_step(artifact: Artifact, ends: tuple[float, float], within: str = "") -> float:
    """Instructions of a step, or of what one function does of it."""
    (first, before), (last, after) = (count(make_simulator_run(artifact, Options(end=end)), within) for end in ends)
    return (last - first) / (after - before)


def main() -> None:
    """Print the table."""
    if which("valgrind") is None:
        raise click.ClickException("install valgrind (Debian's package of that name) first")
    table = Table("scene", "method", "step, ms", "instructions a step", "of these in evaluate")
    for name, scene, methods, ends in CASES:
        model = read_model_text(text_of(name), f"{name.split(' ')[0]}.yaml", folder=MODELS)
        for method in methods:
            artifact = compile_scene(model, find_scene(model, scene), CompileOptions(method=method, flags=FLAGS))
            artifact = replace(artifact, scene=replace(artifact.scene, output_step=ends[1] - ends[0]))
            inside = f"{per_step(artifact, ends, EVALUATE):.0f}" if METHODS[method].formulation is Formulation.RECURSIVE else ""
            dt = artifact.scene.numerics.of_method(method).step
            table.add_row(f"{name}: {scene}", method, f"{dt * 1e3:g}", f"{per_step(artifact, ends):.0f}", inside)
            table.add_row("", f"{method}, C export", f"{dt * 1e3:g}", f"{per_step_alone(artifact, ends):.0f}", "")
    console = Console(highlight=False, width=140)
    console.print(provenance(FLAGS), markup=False)
    console.print(table)


if __name__ == "__main__":
    main()
