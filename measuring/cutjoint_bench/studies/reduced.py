"""Errors of reduced models' outputs: adjoint times dropped terms beside the true difference from the full model.

`python -m cutjoint_bench.studies.reduced`.  A run of the reduced model is followed by the full model: at each of SAMPLES equal times it is
put into the reduced model's state, takes the interval, and what it has come to less the reduced model's state is the effect of the dropped
terms.  The sum of these, each times the derivative of an objective with respect to the full model's state, and the difference of both
models' outputs in the same states estimate the error of the objective.  Objectives are the end value, maximum, integral and RMS of outputs.
Scenes: those of models/ that have an approximate reduced model, and a double pendulum with a stiff joint that is frozen.
Results are kept in results/reduced.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import click
import numpy as np
from rich.console import Console
from rich.table import Table

from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model, Scene
from cutjoint.package.errors import CutjointError
from cutjoint.reduce import freeze
from cutjoint.reduce.sequence import ReducedModel, reduction_sequence
from cutjoint.stepping.load import load_scene
from cutjoint.stepping.simulation import Simulation
from cutjoint.toolchain.cache import digest_of, runtime_digest
from cutjoint_bench.estimate_models import MECHANISMS
from cutjoint_bench.progress import progress_bar
from cutjoint_bench.store import Record, Store
from cutjoint_bench.studies.checkout import MODELS, RESULTS
from cutjoint_bench.studies.goals import OBJECTIVES, SAMPLES, Array, gradient_of, value_of
from cutjoint_bench.studies.provenance import provenance

TOLERANCE = 1e-9  #: of all runs
OUTPUTS = 4  #: judged outputs of a scene, at equal distances in its list
#: Differences below this share of an output's largest value, or below the second number (SI units), are not judged.
LEAST, FLOOR = 1e-6, 1e-9
JUDGED = 1  #: the number of what is kept: another one where runs and estimates change


@dataclass(frozen=True, kw_only=True)
class Case:
    """A scene, and the largest motion of a joint that is frozen."""

    name: str
    load: Callable[[], tuple[Model, Scene]]
    idle: float = freeze.IDLE


def cases() -> Iterator[Case]:
    """All scenes."""
    for name, scene, end in (("axle", "bump", None), ("axle", "chirp", 1.0), ("car", "drop", None), ("iltis", "iavsd_inphase_5", 1.0)):
        yield Case(name=f"{name} {scene}", load=partial(_of_file, MODELS / f"{name}.yaml", scene, end))
    for stiffness in (300.0, 1e3, 1e4):
        for damping in (2.0, 20.0):
            yield Case(name=f"pendulums {stiffness:g} N m, {damping:g} N m s", load=partial(_stiff, stiffness, damping), idle=0.05)


def _of_file(path: Path, scene: str, end: float | None) -> tuple[Model, Scene]:
    model = read_model_text(path.read_text(encoding="utf-8"), str(path))
    found = model.scenes[scene]
    return model, replace(found, end=end or found.end)


def _stiff(stiffness: float, damping: float) -> tuple[Model, Scene]:
    """Two pendulums that a stiff joint keeps in line."""
    text = MECHANISMS["pendulums"].replace("LAW", f"-{stiffness}*position - {damping}*rate").replace(
        "knee.angle, lower.vx, drag.force", "lower.x, lower.vx")  # fmt: skip
    model = read_model_text(text, "pendulums.yaml")
    return model, next(iter(model.scenes.values()))


@contextmanager
def _limits(case: Case) -> Iterator[None]:
    before, freeze.IDLE = freeze.IDLE, case.idle
    try:
        yield
    finally:
        freeze.IDLE = before


def judge(case: Case) -> list[Record]:
    """The objectives of a case by each approximate reduced model."""
    model, scene = case.load()
    with _limits(case):
        full, *variants = reduction_sequence(model, scene, approximate=True)
    rows = list[Record]()
    if approximate := [v for v in variants if v.motion == "approximate"]:
        sim = _loaded(full, scene.end)
        for variant in approximate:
            rows += _compare(case, sim, _loaded(variant, scene.end), variant.name)
    return rows


def _loaded(variant: ReducedModel, end: float) -> Simulation:
    sim = load_scene(variant.model, variant.scene, method="recursive", integrator="dormand-prince", linearise=True, flags=("-O1",))
    return sim.reset(dt=end / SAMPLES, tolerance=TOLERANCE)


def _compare(case: Case, full: Simulation, reduced: Simulation, name: str) -> list[Record]:
    outputs = [o for o in full.outputs if o in set(reduced.outputs)][:: max(1, len(full.outputs) // OUTPUTS)][:OUTPUTS]
    full.reset()
    start, found = full.snapshot(), list[Array]()
    exact = _samples(full, outputs)
    reduced.reset()
    full.restore(start)
    places = [list(full.outputs).index(output) for output in outputs]
    snapshots, values, times = list[bytes](), list[Array](), list[float]()
    for i in range(SAMPLES + 1):
        if i:
            reduced.step()
        found.append(reduced.outputs.array[[list(reduced.outputs).index(output) for output in outputs]])
        _put(full, reduced)
        snapshots.append(full.snapshot())
        values.append(full.outputs.array[places])
        times.append(full.time)
    at, followed, own = np.array(times), np.array(values), np.array(found)
    weights = {(o, k): gradient_of(o, at, followed[:, k]) for o in OBJECTIVES for k in range(len(outputs))}
    sums = dict.fromkeys(weights, 0.0)
    for i in range(-1, SAMPLES):
        change = _dropped(full, start, snapshots, i)
        derivatives = full.forward_sensitivities(SAMPLES - 1 - i, outputs, list(full.states)).derivatives
        for (objective, k), weight in weights.items():
            sums[objective, k] += float(weight[i + 1 :] @ (derivatives[:, k] @ change))
    rows = list[Record]()
    for (objective, k), estimate in sums.items():
        of_reduced, of_followed, of_full = (value_of(objective, at, column[:, k]) for column in (own, followed, exact))
        size = float(np.max(np.abs(exact[:, k]))) * (at[-1] if objective == "integral" else 1.0)
        rows.append({
            "case": case.name, "pass": name, "objective": objective, "output": outputs[k], "size": size, "true": of_full - of_reduced,
            "estimate": estimate + of_followed - of_reduced,
        })  # fmt: skip
    return rows


def _samples(sim: Simulation, outputs: Sequence[str]) -> Array:
    places, rows = [list(sim.outputs).index(output) for output in outputs], [sim.outputs.array]
    for _ in range(SAMPLES):
        sim.step()
        rows.append(sim.outputs.array)
    return np.array(rows)[:, places]


def _put(full: Simulation, reduced: Simulation) -> None:
    """Put the full model into the reduced model's state; joints that this lacks stay where they are, at rest, unless loops move them."""
    q, v = full.coordinates.array.copy(), np.zeros_like(full.speeds.array)
    for array, of, to in ((q, reduced.coordinates, full.coordinates), (v, reduced.speeds, full.speeds)):
        places = {name: i for i, name in enumerate(to)}
        for name, value in of.items():
            if name in places:
                array[places[name]] = value
    full.set_state(reduced.time, q, v)
    independent = {re.sub(r"\.turn_([xyz])_rate$", r".w\1", name) for name in reduced.states}
    known = [name for name in full.speeds if name in independent]
    full.choose_independent(known if len(known) == int(full.library.dofs or 0) else None)
    full.set_states(full.states.array.copy(), reduced.time)


def _dropped(full: Simulation, start: bytes, snapshots: Sequence[bytes], i: int) -> Array:
    """The full model's state after the interval i from the reduced model's, less the reduced model's; the latter is then the state.

    Before the first interval it is the difference of the starts.
    """
    full.restore(snapshots[i + 1])
    q, v, time = full.coordinates.array.copy(), full.speeds.array.copy(), full.time
    if i < 0:
        full.restore(start)
        full.choose_independent()
    else:
        full.restore(snapshots[i])
        full.step()
    exact = full.states.array.copy()
    full.set_state(time, q, v)
    change: Array = exact - full.states.array
    return change


@click.command(help=__doc__)
@click.option("--only", multiple=True, metavar="TEXT", help="Cases whose names contain it.")
def main(only: tuple[str, ...]) -> None:
    """Judge what is not yet judged, and print a table."""
    store, rows, failures = Store(RESULTS / "reduced" / "measurements.jsonl"), list[Record](), list[str]()
    chosen = [case for case in cases() if not only or any(text in case.name for text in only)]
    code = digest_of([str(JUDGED), runtime_digest()])
    with progress_bar() as say:
        for i, case in enumerate(chosen):
            say(case.name, share=i / len(chosen))
            found = store.get({"case": case.name, "code": code, "made": provenance(())}, partial(_made, case))
            rows += found["rows"]
            failures += [f"{case.name}: {found['failure']}"] if found["failure"] else []
    console = Console(highlight=False, width=200)
    console.print(str(provenance(())), markup=False)
    console.print(_table(rows))
    for failure in failures:
        console.print(failure, markup=False)


def _made(case: Case) -> Record:
    try:
        return {"rows": judge(case), "failure": ""}
    except (CutjointError, ValueError) as error:
        return {"rows": [], "failure": str(error)}


def _table(rows: Sequence[Record]) -> Table:
    table = Table(title="estimated over true differences of objectives", title_justify="left", box=None)
    for heading in ("case", "pass", "pairs", "largest, share of the output", "within 2", "below 1/3", "5 to 95 %"):
        table.add_column(heading)
    groups: dict[tuple[str, str], list[Record]] = {}
    for row in rows:
        if abs(row["true"]) > max(LEAST * row["size"], FLOOR):
            for key in ((row["case"], row["pass"]), ("all", row["pass"]), ("all", "all")):
                groups.setdefault(key, []).append(row)
    for key, group in sorted(groups.items()):
        ratios = np.array([row["estimate"] / row["true"] for row in group])
        low, high = np.quantile(ratios, [0.05, 0.95])
        table.add_row(
            *key, str(len(group)), f"{max(abs(row['true']) / row['size'] for row in group):.1e}",
            f"{100 * float(np.mean((ratios >= 0.5) & (ratios <= 2))):.0f} %", str(int(np.sum(~(ratios >= 1 / 3)))),
            f"{low:.2g} to {high:.2g}",
        )  # fmt: skip
    return table


if __name__ == "__main__":
    main()
