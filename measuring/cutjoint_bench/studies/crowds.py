"""Cold runs of many bodies without loops: `python -m cutjoint_bench.studies.crowds`.

A chain, each body hinged to the one before; a star, each hinged to the ground about an axis of its own; arms of three hinges with springs.
Each run has an empty cache but for the parts that are common to all models.  Seconds are of the processor, compilers included.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from collections.abc import Callable, Iterator
from math import cos, pi, sin
from pathlib import Path
from tempfile import TemporaryDirectory

import click

_INERTIA = "inertia: [0.01, 0.1, 0.1, 0, 0, 0]"


def chain(n: int) -> Iterator[tuple[str, str, str]]:
    """The body, the joint and the force of each part."""
    for i in range(n):
        before = f"b{i - 1}" if i else "ground"
        yield (
            f"b{i}: {{mass: 1, centre_of_mass: [{i + 0.5}, 0, 0], {_INERTIA}}}",
            f"j{i}: {{kind: revolute, bodies: [{before}, b{i}], at: [{i}, 0, 0], axis: y}}", "",
        )  # fmt: skip


def star(n: int) -> Iterator[tuple[str, str, str]]:
    """As above."""
    for i in range(n):
        c, s = (f(2 * pi * i / n) for f in (cos, sin))
        yield (
            f"b{i}: {{mass: 1, centre_of_mass: [{1.5 * c:.9f}, {1.5 * s:.9f}, 0], {_INERTIA}}}",
            f"j{i}: {{kind: revolute, bodies: [ground, b{i}], at: [{c:.9f}, {s:.9f}, 0], axis: [{-s:.9f}, {c:.9f}, 0]}}", "",
        )  # fmt: skip


def arms(n: int) -> Iterator[tuple[str, str, str]]:
    """As above, three parts of each arm."""
    for i in range(n):
        for j, axis in enumerate("zyy"):
            before = f"b{i}_{j - 1}" if j else "ground"
            yield (
                f"b{i}_{j}: {{mass: {1 + 0.01 * i}, centre_of_mass: [{0.5 + j}, {2 * i}, 0], {_INERTIA}}}",
                f"j{i}_{j}: {{kind: revolute, bodies: [{before}, b{i}_{j}], at: [{j}, {2 * i}, 0], axis: {axis}}}",
                f"f{i}_{j}: {{kind: joint_force, joint: j{i}_{j}, law: -2*rate - 20*(position - 0.3*sin(3*t + {i}))}}",
            )  # fmt: skip


def text_of(name: str, parts: Iterator[tuple[str, str, str]], end: float) -> str:
    """The model file."""
    bodies, joints, forces = ([f"  {line}" for line in lines if line] for lines in zip(*parts, strict=True))
    sections = (("bodies", bodies), ("joints", joints), ("forces", forces))
    lines = [line for section, of in sections if of for line in (f"{section}:", *of)]
    first = bodies[0].split(":")[0].strip()
    return "\n".join([
        "cutjoint: 1", f"name: {name}", "gravity: [0, 0, -9.81]", *lines, f"outputs: [{first}.z]", f"scenes: {{run: {{end: {end}}}}}", ""
    ])  # fmt: skip


@click.command()
@click.option("--bodies", default=2000, show_default=True, help="Bodies of the chain and of the star.")
def main(bodies: int) -> None:
    """Print the processor time of each run."""
    makes: tuple[tuple[str, Callable[[int], Iterator[tuple[str, str, str]]], int, float], ...] = (
        ("once", chain, 2, 0.01), ("chain", chain, bodies, 0.01), ("star", star, bodies, 0.1),
        ("arms", arms, 1, 0.1), ("arms", arms, 64, 0.1),
    )  # fmt: skip
    with TemporaryDirectory() as folder:
        for name, make, number, end in makes:
            file = Path(folder) / f"{name}{number}.yaml"
            file.write_text(text_of(file.stem, make(number), end), encoding="utf-8")
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            program = Path(sys.executable).with_name("cutjoint")
            command = [str(part) for part in (program, "simulate", file, "--no-error", "--out", file.with_suffix(".csv"))]
            subprocess.run(command, check=True, capture_output=True, env={**os.environ, "CUTJOINT_CACHE": f"{folder}/cache"})
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            if name != "once":  # its cache has the common parts from then on
                print(f"{name} of {number}: {after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime:.1f} s")


if __name__ == "__main__":
    main()
