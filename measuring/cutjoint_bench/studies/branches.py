"""Branches that runs take at singular poses: mechanisms, starting poses, methods, integrators and steps.  `make branches`.

At a singular pose two motions cross that both keep the equations of the loops.  Of each mechanism one expression over the outputs is zero
on the branch that the motion comes from, so that no reference is needed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.table import Table

from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.methods import INTEGRATORS, METHODS, Implementation
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from cutjoint_bench.studies.provenance import provenance

Columns = Mapping[str, np.ndarray]

#: Steps, s.
STEPS = (0.02, 0.01, 0.005, 0.002, 0.001)
#: Tolerances of integrators with steps of their own.
TOLERANCES = (1e-3, 1e-4, 1e-6)
#: Angles of the first crank at the start, rad from the design position.
STARTS = (0.0, 0.2, -0.3)
#: A run has left its branch where the expression comes to more than this.
LEFT = 0.05

_BAR = "  {name}: {{mass: 1, centre_of_mass: [{x}, {y}, 0], inertia: [0.001, 0.1, 0.1]}}\n"
_PIN = "  {name}: {{kind: revolute, bodies: [{bodies}], at: [{x}, {y}, 0], axis: [0, 0, 1]}}\n"


def _model(name: str, bars: Sequence[tuple[str, float, float]], joints: str, outputs: str, *, gravity: float = 0.0) -> str:
    bodies = "".join(_BAR.format(name=bar, x=x, y=y) for bar, x, y in bars)
    return (
        f"cutjoint: 1\nname: {name}\ngravity: [0, {-gravity}, 0]\nbodies:\n{bodies}joints:\n{joints}outputs: [{outputs}]\n"
        f"scenes: {{turn: {{end: 4, output_step: 0.02, positions: {{pin.angle: START}}, rates: {{pin.angle_rate: 2}}}}}}\n"
    )  # fmt: skip


def _pin(name: str, bodies: str, x: float, y: float) -> str:
    return _PIN.format(name=name, bodies=bodies, x=x, y=y)


#: A crank and a rod of one length on a slider: at right angles to the slide the rod may stay on the crank.
EQUAL_BARS = _model(
    "equal_bars", [("crank", 0.5, 0), ("rod", 1.5, 0), ("slider", 2, 0)],
    _pin("pin", "ground, crank", 0, 0) + _pin("elbow", "crank, rod", 1, 0) + _pin("wrist", "rod, slider", 2, 0)
    + "  rail: {kind: prismatic, bodies: [ground, slider], at: [2, 0, 0], axis: [1, 0, 0]}\n",
    "pin.angle, slider.x",
)  # fmt: skip
#: Two parallel cranks: in line with the ground the second one may turn the other way.
PARALLEL_CRANKS = _model(
    "parallel_cranks", [("crank", 0, 0.5), ("coupler", 1, 1), ("follower", 2, 0.5)],
    _pin("pin", "ground, crank", 0, 0) + _pin("left", "crank, coupler", 0, 1) + _pin("right", "coupler, follower", 2, 1)
    + _pin("foot", "ground, follower", 2, 0),
    "pin.angle, coupler.yaw",
)  # fmt: skip
#: Four bars of one length: a rhombus, whose coupler may fold onto the ground's direction.
RHOMBUS = _model(
    "rhombus", [("crank", 0, 0.5), ("coupler", 0.5, 1), ("follower", 1, 0.5)],
    _pin("pin", "ground, crank", 0, 0) + _pin("left", "crank, coupler", 0, 1) + _pin("right", "coupler, follower", 1, 1)
    + _pin("foot", "ground, follower", 1, 0),
    "pin.angle, coupler.yaw",
)  # fmt: skip
#: Two windows of the N-four-bar, which fall.
WINDOWS = _model(
    "windows", [("crank", 0, 0.5), ("first", 0.5, 1), ("middle", 1, 0.5), ("second", 1.5, 1), ("last", 2, 0.5)],
    _pin("pin", "ground, crank", 0, 0) + _pin("a", "crank, first", 0, 1) + _pin("b", "first, middle", 1, 1)
    + _pin("c", "ground, middle", 1, 0) + _pin("d", "middle, second", 1, 1) + _pin("e", "second, last", 2, 1)
    + _pin("f", "ground, last", 2, 0),
    "pin.angle, first.yaw, second.yaw", gravity=9.81,
)  # fmt: skip

#: The text of each mechanism, and what is zero on its branch.
MECHANISMS: Mapping[str, tuple[str, Callable[[Columns], np.ndarray]]] = {
    "equal bars": (EQUAL_BARS, lambda c: c["slider.x"] - 2 * np.cos(c["pin.angle"])),
    "parallel cranks": (PARALLEL_CRANKS, lambda c: c["coupler.yaw"]),
    "rhombus": (RHOMBUS, lambda c: c["coupler.yaw"]),
    "two windows": (WINDOWS, lambda c: np.abs(c["first.yaw"]) + np.abs(c["second.yaw"])),
}


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The outcome of a run: ``kind`` is "stays", "stops", "leaves and says so" or "leaves"."""

    kind: str
    largest: float = 0.0


def settings_of(method: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """An integrator's name and its settings."""
    for integrator in INTEGRATORS.values():
        if integrator.supports(METHODS[method], Implementation.GENERATED):
            name, values = ("tolerance", TOLERANCES) if integrator.adaptive else ("dt", STEPS)
            yield from ((integrator.name, {"integrator": integrator.name, name: value}) for value in values)


def judge(run: Trajectory, zero: Callable[[Columns], np.ndarray]) -> Outcome:
    """The branch that a run took, and whether it says so."""
    largest = float(np.abs(zero(run.columns)).max()) if len(run.t) else 0.0
    if largest < LEFT:
        return Outcome(kind="stays" if run.failure is None else "stops", largest=largest)
    says = run.failure is not None or not run.error.converged
    return Outcome(kind="leaves and says so" if says else "leaves", largest=largest)


def search(model: Model, zero: Callable[[Columns], np.ndarray]) -> Iterator[tuple[str, str, dict[str, Any], Outcome]]:
    """Method, integrator, settings and outcome of each run of a model."""
    (scene,) = model.scenes.values()
    for method in METHODS:
        artifact = compile_scene(model, scene, CompileOptions(method=method))
        for integrator, settings in settings_of(method):
            yield method, integrator, settings, judge(simulate(artifact, check=False, **settings), zero)


KINDS = ("stays", "stops", "leaves and says so", "leaves")


@click.command()
@click.argument("names", nargs=-1, type=click.Choice(list(MECHANISMS)))
def main(names: tuple[str, ...]) -> None:
    """Count the branches that runs of MECHANISMS take, all by default."""
    console, total = Console(highlight=False, width=160), Counter[str]()
    console.print(f"{provenance(())}; starts at {STARTS} rad, steps {STEPS} s, tolerances {TOLERANCES}", markup=False)
    for name in names or MECHANISMS:
        text, zero = MECHANISMS[name]
        found: dict[tuple[str, str], Counter[str]] = {}
        for start in STARTS:
            for method, integrator, settings, outcome in search(read_model_text(text.replace("START", str(start)), f"{name}.yaml"), zero):
                found.setdefault((method, integrator), Counter())[outcome.kind] += 1
                if outcome.kind == "leaves":
                    console.print(f"{name} from {start}: {method} {settings} leaves by {outcome.largest:.2g}", markup=False)
        table = Table("method", "integrator", *KINDS, title=name, box=None)
        for (method, integrator), counts in found.items():
            table.add_row(method, integrator, *(str(counts[kind] or "") for kind in KINDS))
            total += counts
        console.print(table)
    console.print(", ".join(f"{kind} {total[kind]}" for kind in KINDS))


if __name__ == "__main__":
    main()
