"""Errors of objectives by adjoint-weighted local errors beside true ones, and what steps chosen by them save.

`python -m cutjoint_bench.studies.goals`.  An objective is the end value, maximum, integral or RMS of an output over SAMPLES equal
intervals, or the time of the first event.  Its error is estimated as the sum over intervals of (derivative of the objective with respect to
the state at the interval's end) * (local error of the interval); the local error is the difference from a run of this interval alone with
half the step, extrapolated, or with a tolerance FINER times as tight.  The true error is that against a run with a far smaller step.
Models: those of models/, the mechanisms of `estimate_models`, and trees and loops of tests/mechanisms/random_models.py.
Results are kept in results/goals, so that an interrupted study goes on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from math import inf, isfinite, log10, nan
from pathlib import Path
from time import perf_counter

import click
import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import Model, Output, Scene
from cutjoint.package.errors import CutjointError
from cutjoint.run import accuracy
from cutjoint.stepping.load import load_scene
from cutjoint.stepping.simulation import Simulation
from cutjoint.toolchain.cache import digest_of, runtime_digest
from cutjoint_bench.estimate_models import draws
from cutjoint_bench.progress import progress_bar
from cutjoint_bench.store import Record, Store
from cutjoint_bench.studies.checkout import MODELS, RESULTS
from cutjoint_bench.studies.goal_tables import FLOOR, LEAST, estimates_table, savings_table
from cutjoint_bench.studies.provenance import provenance

Array = NDArray[np.float64]

#: Models of files, and the scene of each, by default its first.
FILES: Mapping[str, str | None] = {
    "pendulum": None, "slider_crank": None, "press": None, "flyball": None, "andrews": None, "delta": None, "leg": None, "excavator": None,
    "gantry": None, "axle": "bump", "car": None, "four_bar": None,
}  # fmt: skip
SEED, TREES, LOOPS = 1, range(6), range(4)  #: of the drawn mechanisms, random trees and random loops
SAMPLES = 40
JUDGED = 1  #: the number of what is kept: another one where runs and estimates change
TOLERANCE, FINER = 1e-5, 1e-3  #: of judged runs by dormand-prince, and the tolerance of their local errors by that
#: Halvings of the interval until rk4's outputs change by less than this share; more halvings of references.
CLOSE, HALVINGS, MORE = 1e-3, 8, 4
OBJECTIVES = ("end", "maximum", "integral", "rms")
#: Steps chosen by the weights: the tolerance of the run that has them, tolerances of the ladder, accuracies as shares of the objective, and
#: the largest change of a tolerance.
PILOT, LADDER, SHARES, MOST = 1e-3, tuple(10.0 ** (-k / 4) for k in range(8, 49)), (1e-4, 1e-6, 1e-8), 1e4


@dataclass(frozen=True, kw_only=True)
class Case:
    """A scene whose objectives are judged."""

    name: str
    kind: str
    text: str
    load: Callable[[], tuple[Model, Scene]]
    parameters: Mapping[str, float]


def cases() -> Iterator[Case]:
    """All scenes."""
    for name, scene in FILES.items():
        path = MODELS / f"{name}.yaml"
        yield Case(name=name, kind="models", text=path.read_text(encoding="utf-8"), load=partial(_of_file, path, scene), parameters={})
    for draw in draws(1, SEED):
        load = partial(_of_text, draw.text, draw.name)
        yield Case(name=draw.name, kind="drawn", text=draw.text, load=load, parameters=draw.parameters[0])
    for kind, seeds in (("random_tree", TREES), ("random_loops", LOOPS)):
        for seed in seeds:
            yield Case(name=f"{kind} {seed}", kind="random", text="", load=partial(_random, kind, seed), parameters={})


def _of_file(path: Path, scene: str | None) -> tuple[Model, Scene]:
    model = read_model(path)
    return model, model.scenes[scene] if scene else next(iter(model.scenes.values()))


def _of_text(text: str, name: str) -> tuple[Model, Scene]:
    model = read_model_text(text, f"{name}.yaml")
    return model, next(iter(model.scenes.values()))


def _random(kind: str, seed: int) -> tuple[Model, Scene]:
    models = import_module("tests.mechanisms.random_models")
    model = getattr(models, kind)(seed)
    body = model.bodies[-1].name
    outputs = tuple(Output(element=body, quantity=quantity, span=models.NOWHERE) for quantity in ("x", "vz"))
    scene = replace(models.scene(), outputs=outputs)
    return replace(model, scenes={scene.name: scene}), scene


# Objectives


def value_of(objective: str, times: Array, values: Array) -> float:
    """An objective of samples."""
    weights = np.full(len(times), times[1] - times[0])
    weights[[0, -1]] /= 2
    if objective == "end":
        return float(values[-1])
    if objective == "maximum":
        return float(values.max())
    if objective == "integral":
        return float(weights @ values)
    return float(np.sqrt(weights @ values**2 / weights.sum()))


def gradient_of(objective: str, times: Array, values: Array) -> Array:
    """The derivatives of an objective with respect to samples."""
    weights = np.full(len(times), times[1] - times[0])
    weights[[0, -1]] /= 2
    if objective == "integral":
        return weights
    if objective == "rms":
        size = value_of("rms", times, values)
        return weights * values / (weights.sum() * size) if size > 0 else 0 * values
    chosen: Array = np.zeros(len(values))
    chosen[-1 if objective == "end" else int(values.argmax())] = 1.0
    return chosen


# Runs


@dataclass(frozen=True, kw_only=True)
class Sampled:
    """A run: samples, and for each interval the snapshot before it and the evaluations of the interval."""

    times: Array
    values: Array
    snapshots: Sequence[bytes]
    evaluations: Array
    event: float = nan

    def objective(self, name: str, output: int) -> float:
        return self.event if name == "event" else value_of(name, self.times, self.values[:, output])


@dataclass(kw_only=True)
class Runs:
    """Runs of a loaded scene from one start, over equal intervals of ``steps`` steps each (one of an adaptive integrator)."""

    sim: Simulation
    start: bytes
    interval: float
    outputs: Sequence[str]
    adaptive: bool
    steps: int = 1

    def set(self, tolerance: float, halvings: int) -> int:
        """Set the tolerance, or the step, and return the steps of an interval."""
        if self.adaptive:
            self.sim._call(self.sim.library.set_tolerance, tolerance, tolerance)
            return 1
        steps: int = 2**halvings
        self.sim._call(self.sim.library.set_step, self.interval / steps)
        return steps

    def take(self, tolerance: float, halvings: int) -> int:
        """Go over an interval, and return the evaluations."""
        number: int = 0
        for _ in range(self.set(tolerance, halvings)):
            self.sim.step()
            number += int(self.sim.last_step.evaluations)
        return number

    def run(self, tolerance: float | Array, halvings: int = 0) -> Sampled:
        """A run with one tolerance, or with one for each interval."""
        sim = self.sim
        sim.restore(self.start)
        places = [list(sim.outputs).index(name) for name in self.outputs]
        times, values, snapshots, evaluations = [sim.time], [sim.outputs.array[places]], list[bytes](), list[int]()
        for each in np.broadcast_to(tolerance, SAMPLES):
            if sim.is_ill_conditioned:
                sim.choose_independent()
            snapshots.append(sim.snapshot())
            evaluations.append(self.take(float(each), halvings))
            times.append(sim.time)
            values.append(sim.outputs.array[places])
        return Sampled(times=np.array(times), values=np.array(values), snapshots=snapshots, evaluations=np.array(evaluations))

    def event_after(self, snapshot: bytes, tolerance: float, halvings: int) -> float:
        """The time of the first event after a snapshot; NaN without one."""
        self.sim.restore(snapshot)
        self.set(tolerance, halvings)
        end = self.sim.time + 1.0001 * self.interval
        return self.sim.time if self.sim.advance_to_event(end) else nan

    def first_event(self, path: Sampled, tolerance: float, halvings: int) -> tuple[int, float]:
        """The interval and the time of a run's first event that is none of the start."""
        if not self.sim.library.steps.finds_events or not self.sim.library.names["event"]:
            return -1, nan
        for i, snapshot in enumerate(path.snapshots):
            time = self.event_after(snapshot, tolerance, halvings)
            if isfinite(time) and i > 0:
                return i, time
        return -1, nan


Parts = Mapping[tuple[str, int], Array]


def weigh(runs: Runs, path: Sampled, tolerance: float, halvings: int) -> tuple[Parts, Parts]:
    """Contributions of the intervals of a run to the error of each (objective, output), and their sizes without cancellation.

    They are local errors of the intervals times the derivatives of objectives with respect to the state at their ends.
    """
    sim, outputs = runs.sim, range(len(runs.outputs))
    of = {(o, k): gradient_of(o, path.times, path.values[:, k]) for o in OBJECTIVES for k in outputs}
    at, time = runs.first_event(path, tolerance, halvings)
    parts = {key: np.zeros(SAMPLES) for key in (*of, *([("event", 0)] if at > 0 else []))}
    sizes = {key: np.zeros(SAMPLES) for key in of}
    for i in range(SAMPLES):
        error = _local_error(runs, path.snapshots[i], tolerance, halvings)
        steps, left = runs.set(tolerance, halvings), SAMPLES - 1 - i
        events = 1 if i < at else 0
        found = sim.forward_sensitivities(steps * left, runs.outputs, list(sim.states), every=steps, events=events)
        for (objective, k), weights in of.items():
            adjoint = weights[i + 1 :] @ found.derivatives[:, k]
            parts[objective, k][i], sizes[objective, k][i] = adjoint @ error, np.abs(adjoint) @ np.abs(error)
        if found.events is not None and len(found.events.times):
            parts["event", 0][i] = found.events.derivatives_of_times[0] @ error
        elif i == at:
            parts["event", 0][i] = runs.event_after(path.snapshots[i], *_finer(tolerance, halvings)) - time
    return parts, sizes


def _finer(tolerance: float, halvings: int) -> tuple[float, int]:
    return max(FINER * tolerance, 1e-13), halvings + 1


def _local_error(runs: Runs, before: bytes, tolerance: float, halvings: int) -> Array:
    """The exact end of an interval less that of the run, in independent coordinates of its beginning; the state is then the run's end."""
    sim = runs.sim
    sim.restore(before)
    runs.take(*_finer(tolerance, halvings))
    exact = sim.states.array.copy()
    sim.restore(before)
    runs.take(tolerance, halvings)
    change: Array = exact - sim.states.array
    return change if runs.adaptive else change * 16 / 15


# Judging


def loaded(case: Case, integrator: str) -> tuple[Runs, Model, Scene]:
    """The runs of a case."""
    model, scene = case.load()
    sim = load_scene(model, scene, method="recursive", integrator=integrator, linearise=True, adjoint=True, flags=("-O1",))
    for name, value in case.parameters.items():
        sim.parameters[name] = value
    interval = scene.end / SAMPLES
    sim.reset(dt=interval).choose_independent()
    names = list(dict.fromkeys((next(iter(sim.outputs)), list(sim.outputs)[-1])))
    return Runs(sim=sim, start=sim.snapshot(), interval=interval, outputs=names, adaptive=integrator == "dormand-prince"), model, scene


def judge(case: Case, integrator: str) -> list[Record]:
    """The objectives of a case: estimates and true errors."""
    runs, _, _ = loaded(case, integrator)
    halvings = 0 if runs.adaptive else _halvings(runs)
    path = runs.run(TOLERANCE, halvings)
    finest, fine = (runs.run(*how) for how in _references(runs, halvings))
    second = runs.run(TOLERANCE / 10, halvings + 1)
    parts, _ = weigh(runs, path, TOLERANCE, halvings)
    price = _price(runs, halvings)
    rows = []
    for (objective, k), each in parts.items():
        if objective == "event":
            value, true, other, twin = (runs.first_event(p, *how)[1] for p, how in (
                (path, (TOLERANCE, halvings)), *zip((finest, fine), _references(runs, halvings), strict=True),
                (second, (TOLERANCE / 10, halvings + 1))))  # fmt: skip
            size, column = max(value, 1e-3), nan
        else:
            value, true, other, twin = (p.objective(objective, k) for p in (path, finest, fine, second))
            size = float(np.max(np.abs(path.values[:, k]))) * (path.times[-1] if objective == "integral" else 1.0)
            column = float(np.max(np.abs(path.values[:, k] - second.values[:, k])))
            column *= path.times[-1] if objective == "integral" else 1.0
        rows.append({
            "case": case.name, "kind": case.kind, "integrator": integrator, "objective": objective, "output": runs.outputs[k],
            "states": len(runs.sim.states), "size": size, "true": true - value, "unknown": abs(true - other), "estimate": float(each.sum()),
            "absolute": float(np.abs(each).sum()), "second run": twin - value, "column": column, "evaluations": int(path.evaluations.sum()),
            "evaluations of the second": int(second.evaluations.sum()), **price,
        })  # fmt: skip
    return rows


def _references(runs: Runs, halvings: int) -> tuple[tuple[float, int], tuple[float, int]]:
    return ((1e-12, 0), (1e-11, 0)) if runs.adaptive else ((0.0, halvings + MORE), (0.0, halvings + MORE - 1))


def _halvings(runs: Runs) -> int:
    """The fewest halvings of the interval at which one more changes outputs by less than CLOSE."""
    last = None
    for halvings in range(HALVINGS + 1):
        try:
            run = runs.run(0.0, halvings)
        except CutjointError:
            continue
        size = np.abs(run.values).max(axis=0)
        if last is not None and (np.abs(run.values - last.values).max(axis=0) <= CLOSE * size).all():
            return halvings - 1
        last = run
    return HALVINGS


def _price(runs: Runs, halvings: int) -> Record:
    """What derivatives of one objective cost, as multiples of the run: adjoint, and forward with respect to all states."""
    sim = runs.sim
    sim.restore(runs.start)
    names = list(sim.states)

    def least(call: Callable[[], object]) -> float:
        found = []
        for _ in range(3):
            sim.restore(runs.start)
            runs.set(TOLERANCE, halvings)
            begun = perf_counter()
            call()
            found.append(perf_counter() - begun)
        return min(found)

    steps = 1 if runs.adaptive else 2**halvings
    plain = least(lambda: sim.run(SAMPLES * steps))
    try:
        adjoint = least(
            lambda: sim.adjoint_sensitivities(SAMPLES * steps, runs.outputs[:1], names, "end", every=steps)) / plain  # fmt: skip
    except CutjointError:
        adjoint = nan
    forward = least(lambda: sim.forward_sensitivities(SAMPLES * steps, runs.outputs[:1], names, every=steps)) / plain
    return {"adjoint": adjoint, "forward": forward}


# Steps chosen by the weights


def save(case: Case) -> list[Record]:
    """Evaluations with which each objective keeps accuracies, by several ways to choose the tolerance of dormand-prince.

    *uniform* and *weighed* are the coarsest single runs of a ladder of tolerances from which on all finer ones keep the accuracy; weighed
    tolerances differ between intervals so that the sum of evaluations is least for the sum of the contributions.  *column* and *objective*
    are all runs of the product's rule, tolerances of 1e-2, 1e-3, ... until the error of the whole column, or of the objective, is small.
    """
    runs, _, _ = loaded(case, "dormand-prince")
    path, finest = runs.run(PILOT), runs.run(1e-12)
    _, sizes = weigh(runs, path, PILOT, 0)
    uniform = [_tried(runs, np.full(SAMPLES, tolerance)) for tolerance in LADDER]
    adjoint, rows = _price(runs, 0)["adjoint"], []
    for (objective, k), parts in sizes.items():
        span = path.times[-1] if objective == "integral" else 1.0
        size, true = span * float(np.max(np.abs(finest.values[:, k]))), finest.objective(objective, k)
        if not parts.max() > max(LEAST * size, FLOOR):
            continue
        factors = _factors(parts, path.evaluations)
        weighed = [_tried(runs, np.minimum(tolerance * factors, LADDER[0])) for tolerance in LADDER]
        errors = [[inf if p is None else abs(p.objective(objective, k) - true) for p in tried] for tried in (uniform, weighed)]
        for share in SHARES:
            target = share * size
            found = {name: _coarsest(tried, error, target) for name, tried, error in zip(("uniform", "weighed"), (uniform, weighed), errors,
                strict=True)}  # fmt: skip
            for name in ("column", "objective"):
                change = partial(_change_of_column, k, span) if name == "column" else partial(_change_of_objective, k, objective)
                for way, leaps in ((name, False), (f"{name} leaping", True)):
                    evaluations, returned = refined(uniform[::4], change, target, leaps=leaps)
                    found[f"by {way}"] = evaluations
                    found[f"error by {way}"] = abs(returned.objective(objective, k) - true) / target if returned else nan
            rows.append({
                "case": case.name, "kind": case.kind, "objective": objective, "output": runs.outputs[k], "share": share, "adjoint": adjoint,
                "pilot": int(path.evaluations.sum()), **found,
            })  # fmt: skip
    return rows


def _factors(parts: Array, evaluations: Array) -> Array:
    """Factors of the intervals' tolerances with which the sum of evaluations is least for a sum of contributions.

    Evaluations go with the power -1/5 of a factor, contributions with the factor.
    """
    factors = (evaluations / np.maximum(parts, 1e-12 * parts.max())) ** (5 / 6)
    limited: Array = np.minimum(factors / factors.min(), MOST)
    return limited


def _tried(runs: Runs, tolerances: Array) -> Sampled | None:
    try:
        return runs.run(tolerances)
    except CutjointError:
        return None


def _change_of_column(k: int, span: float, one: Sampled, other: Sampled) -> float:
    return span * float(np.max(np.abs(one.values[:, k] - other.values[:, k])))


def _change_of_objective(k: int, objective: str, one: Sampled, other: Sampled) -> float:
    return abs(one.objective(objective, k) - other.objective(objective, k))


def _coarsest(tried: Sequence[Sampled | None], errors: Sequence[float], target: float) -> float:
    """The fewest evaluations of a run from which on all finer ones of the ladder keep the target."""
    keeping = len(errors)
    while keeping > 0 and errors[keeping - 1] <= target:
        keeping -= 1
    return min((float(path.evaluations.sum()) for path in tried[keeping:] if path is not None), default=nan)


def refined(
    ladder: Sequence[Sampled | None], change: Callable[[Sampled, Sampled], float], target: float, *, leaps: bool
) -> tuple[float, Sampled | None]:  # fmt: skip
    """Evaluations of all runs until one has an error below the target by `run.accuracy`'s rule, and that run.

    With ``leaps`` tolerances are left out whose errors are too large by the difference of the last two runs.
    """
    spent, last, before, place = 0.0, None, nan, 0
    while place < len(ladder):
        path, step = ladder[place], 1
        if path is None:
            last, before, place = None, nan, place + 1
            continue
        spent += float(path.evaluations.sum())
        if last is not None:
            apart = change(last, path)
            own = max(apart / (1 - accuracy.STRICTER.remaining), before / 7 if isfinite(before) else 0.0)
            if own <= 0.7 * target:
                return spent, last
            if isfinite(before) and accuracy._remaining_error(accuracy.STRICTER, apart, before, 1.0) <= target:
                return spent, path
            tenth = accuracy.STRICTER.remaining
            if leaps and isfinite(before) and apart > 0 and (left := log10(0.7 * target / (apart * accuracy.STRICTER.trusted))) < -1:
                step = int(left / log10(tenth))
            before = apart if step == 1 else nan
        last, place = path, min(place + step, max(place + 1, len(ladder) - 2))
    return spent, None


# The command


@click.command(help=__doc__)
@click.option("--only", multiple=True, metavar="TEXT", help="Cases whose names contain it.")
@click.option("--kind", "kinds", multiple=True, type=click.Choice(["models", "drawn", "random"]), help="Kinds of cases; all by default.")
def main(only: tuple[str, ...], kinds: tuple[str, ...]) -> None:
    """Judge what is not yet judged, and print tables."""
    store = Store(RESULTS / "goals" / "measurements.jsonl")
    judged, saved, failures = list[Record](), list[Record](), list[str]()
    chosen = [c for c in cases() if (not only or any(text in c.name for text in only)) and (not kinds or c.kind in kinds)]
    code = digest_of([str(JUDGED), runtime_digest()])
    with progress_bar() as say:
        for i, case in enumerate(chosen):
            say(case.name, share=i / len(chosen))
            for rows, name, make in (
                *((judged, integrator, partial(judge, case, integrator)) for integrator in ("dormand-prince", "rk4")),
                (saved, "steps", partial(save, case)),
            ):
                about = {"case": case.name, "text": case.text, "parameters": dict(case.parameters), "what": name, "code": code,
                         "made": provenance(())}  # fmt: skip
                found = store.get(about, partial(_made, make))
                rows += found["rows"]
                failures += [f"{case.name}, {name}: {found['failure']}"] if found["failure"] else []
    console = Console(highlight=False, width=200)
    console.print(str(provenance(())), markup=False)
    console.print(estimates_table(judged))
    console.print(savings_table(saved))
    for failure in failures:
        console.print(failure, markup=False)


def _made(make: Callable[[], list[Record]]) -> Record:
    try:
        return {"rows": make(), "failure": ""}
    except (CutjointError, ValueError) as error:
        return {"rows": [], "failure": str(error)}


if __name__ == "__main__":
    main()
