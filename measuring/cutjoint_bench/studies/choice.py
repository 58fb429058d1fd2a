"""Choices of `method: auto` beside the best of a full search: `make choice`.

The search tries every reduced model, with exact and embedded loops, by all methods and all their integrators, events located and
crossed, and each step of the grid, coarsest first, until one keeps the accuracy or takes FAR times the work of another.  Of those whose
estimated work is at most FAR times the least, generated code runs under callgrind; the counts of the scene less those of its first sample
interval are compared.  What was measured is kept in results/choice, so that an interrupted run goes on; the rows are kept in
docs/bench/choice.json, each with its machine and version.  ``--drawn`` takes 30 mechanisms with laws and numbers that are drawn, and
accuracies of 1e-3 to 1e-5; its rows are kept in docs/bench/choice_drawn.json.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial
from math import inf
from resource import RUSAGE_CHILDREN, RUSAGE_SELF, getrusage
from statistics import median
from typing import Any

import click
from numpy.random import default_rng
from rich.console import Console
from rich.table import Table

from cutjoint.compile.derivation import with_requested_loops
from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.methods import INTEGRATORS, METHODS, Events, Implementation, Loops
from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import Model, Scene
from cutjoint.package.errors import EquationsError, RunError
from cutjoint.package.locations import __version__
from cutjoint.reduce.choose import APPROXIMATE_FROM, SHARE, Candidate, Choice, choose, chosen_model, steps_of
from cutjoint.reduce.measure import Reference, distance, find_reference
from cutjoint.reduce.sequence import ReducedModel, reduction_sequence
from cutjoint.reduce.trials import Steps, Trials
from cutjoint.run.artifact import make_simulator_run
from cutjoint.run.run_file import fitting_interval
from cutjoint.run.scenes import find_scene, with_default_closure, with_loops
from cutjoint.run.settings import Options
from cutjoint.run.simulator import SimulatorError
from cutjoint.toolchain.cache import runtime_digest
from cutjoint_bench.estimate_models import draws
from cutjoint_bench.machine import machine
from cutjoint_bench.store import Record, Store
from cutjoint_bench.studies.checkout import DOCS, MODELS, RESULTS
from cutjoint_bench.studies.instructions import FLAGS, count

#: Model, scene (the only one of its model where there is none), end in s (the scene's where there is none), accuracy in m and rad.
SCENES = (
    ("pendulum", None, None, 1e-3), ("four_bar", None, 2.0, 1e-3), ("slider_crank", None, None, 1e-3), ("slider_crank", None, None, 1e-6),
    ("press", None, None, 1e-4), ("six_bar", None, None, 1e-4), ("flyball", None, 0.5, 1e-4), ("andrews", None, None, 1e-4),
    ("delta", None, None, 1e-4), ("stewart", None, None, 1e-4), ("leg", None, None, 1e-4), ("excavator", None, None, 1e-4),
    ("gantry", None, None, 1e-4), ("car", None, None, 1e-4),
    ("axle", "bump", None, 1e-4), ("iltis", "iavsd_inphase_5", None, 1e-3), ("iltis", "simul1", 4.0, 1e-3), ("iltis", "simul3", 4.0, 1e-3),
)  # fmt: skip
SEED = 1  #: of the draws
FAR = 2.5  #: candidates of more estimated work, as multiples of the least, are not counted
KEPT, DRAWN = DOCS / "choice.json", DOCS / "choice_drawn.json"


@click.command()
@click.option("--only", multiple=True, metavar="NAME", help="Models or scenes to measure; the file keeps the others.")
@click.option("--drawn", is_flag=True, help="Take mechanisms with drawn laws and numbers.")
def main(only: tuple[str, ...], drawn: bool) -> None:
    """Measure what is not yet measured, print a row for each scene, and keep the results."""
    store, kept = Store(RESULTS / "choice" / "measurements.jsonl"), DRAWN if drawn else KEPT
    rows: dict[str, Record] = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() else {}
    for name, model, found, accuracy in (_drawn if drawn else _of_models)(only):
        wanted = replace(found, method="auto", accuracy=accuracy)
        rows[f"{name} {found.name} {accuracy:g}"] = Comparison(model=model, scene=wanted, store=store).row()
        kept.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    _print(list(rows.values()))


def _of_models(only: tuple[str, ...]) -> Iterator[tuple[str, Model, Scene, float]]:
    for name, scene, end, accuracy in SCENES:
        if only and not {name, scene} & set(only):
            continue
        model = read_model(MODELS / f"{name}.yaml")
        found = find_scene(model, scene)
        yield name, model, replace(found, end=found.end if end is None else end), accuracy


def _drawn(only: tuple[str, ...]) -> Iterator[tuple[str, Model, Scene, float]]:
    for draw, accuracy in zip(all_ := list(draws(1, SEED)), default_rng(SEED).choice([1e-3, 1e-4, 1e-5], len(all_)), strict=True):
        if only and draw.name not in only:
            continue
        text = draw.text
        for parameter, value in draw.parameters[0].items():
            text = re.sub(rf"\b{parameter}: {{value: [^,]*, binding: param}}", f"{parameter}: {{value: {value}}}", text)
        model = read_model_text(text, f"{draw.name}.yaml")
        (scene,) = model.scenes.values()
        yield draw.name, model, scene, float(accuracy)


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """A scene that method auto chooses for, and that is searched."""

    model: Model
    scene: Scene
    store: Store

    @cached_property
    def truth(self) -> Reference:
        """The standard for errors."""
        return find_reference(self.model, self.scene, {})

    @cached_property
    def variants(self) -> list[ReducedModel]:
        """All reduced models; approximate ones where auto tries them."""
        for method in METHODS:
            try:
                return reduction_sequence(self.model, self.scene, method, approximate=(self.scene.accuracy or 0.0) >= APPROXIMATE_FROM)
            except (ModelError, EquationsError, RunError):
                continue
        return []

    def row(self) -> Record:
        """The picked candidate and the best one with the instructions of their runs, and the CPU seconds of the choice."""
        begin = _cpu_seconds()
        choice = choose(self.model, self.scene)
        seconds = _cpu_seconds() - begin
        return self._get({"picked": asdict(choice.chosen)}, partial(self._compare, choice, seconds))

    def _compare(self, choice: Choice, seconds: float) -> Record:
        picked, tried = choice.chosen, list(self._search())
        good = [c for c in tried if not c.failure]
        least = min(c.work for c in good)
        counted = {self._count(c): c for c in good if c.work <= FAR * least}
        own = self._count(picked)
        best = min(own, *counted)
        return {
            "model": self.model.name, "scene": self.scene.name, "end": self.scene.end, "accuracy": self.scene.accuracy,
            "picked": asdict(picked), "best": asdict(counted.get(best, picked)), "instructions": [own, best], "ratio": own / best,
            "choice_seconds": seconds, "counted": [[number, asdict(c)] for number, c in sorted(counted.items(), key=lambda item: item[0])],
            "settled": self.truth.change, "machine": dict(machine()), "version": __version__, "runtime": runtime_digest(),
        }  # fmt: skip

    def _search(self) -> Iterator[Candidate]:
        least = inf
        for variant, scene, method in self._formulations():
            for found in self._of_method(variant, scene, method, least):
                least = min(least, found.work if not found.failure else inf)
                yield found

    def _formulations(self) -> Iterator[tuple[ReducedModel, Scene, str]]:
        for variant in self.variants:
            for loops in Loops:
                scene = with_loops(variant.scene, loops)
                if loops == Loops.EMBEDDED and not with_requested_loops(variant.model, scene, "recursive").embedded_loops:
                    continue
                for method in METHODS.values():
                    if loops == Loops.EXACT or method.functions:
                        yield variant, scene, method.name

    def _of_method(self, variant: ReducedModel, scene: Scene, method: str, least: float) -> Iterator[Candidate]:
        able = [name for name, i in INTEGRATORS.items() if i.supports(METHODS[method], Implementation.GENERATED)]
        made: dict[str | None, Trials] = {}
        for integrator in able:
            closed = with_default_closure(scene, method, integrator)
            of = {"variant": variant.name, "method": method, "loops": scene.numerics.loops, "integrator": integrator}
            tried = self._get({**of, "least": least}, partial(self._try, variant, closed, method, integrator, made, least))
            yield from map(_candidate, tried["candidates"])

    def _try(
        self, variant: ReducedModel, scene: Scene, method: str, integrator: str, made: dict[str | None, Trials], least: float
    ) -> Record:  # fmt: skip
        found = []
        empty = Candidate(variant=variant.name, method=method, loops=scene.numerics.loops, steps=Steps(integrator=integrator))
        try:
            closure = scene.numerics.closure
            trials = made.get(closure) or made.setdefault(closure, Trials(variant.model, scene, method))
            crossed = trials.artifact.mechanism.indicators and INTEGRATORS[integrator].events is Events.LOCATED
            for events in (None, Events.CROSSED)[: 1 + bool(crossed)]:
                found.append(self._coarsest(replace(empty, steps=Steps(integrator=integrator, events=events)), trials, least))
        except (ModelError, EquationsError, RunError, SimulatorError) as error:
            found.append(replace(empty, failure=str(error)))
        return {"candidates": [asdict(c) for c in found]}

    def _coarsest(self, empty: Candidate, trials: Trials, least: float) -> Candidate:
        nearest = replace(empty, failure="no steps keep the accuracy")
        for steps in steps_of(empty.steps.integrator, fitting_interval(self.model, self.scene), empty.steps.events):
            run = trials.run(steps, {})
            tried = replace(empty, steps=steps, error=distance(run, self.truth.run), work=trials.work(run, steps))
            if not run.fallback and tried.error <= SHARE * (self.scene.accuracy or inf):
                return tried
            if tried.work > FAR * least:  # also of a run that fails: with shorter steps it takes more
                break
            nearest = min(nearest, replace(tried, failure=nearest.failure), key=lambda c: c.error)
        return nearest

    def _count(self, candidate: Candidate) -> int:
        return int(self._get({"counted": asdict(candidate)}, lambda: {"instructions": self._measure(candidate)})["instructions"])

    def _measure(self, candidate: Candidate) -> int:
        reduced = next((v.model, v.scene) for v in self.variants if v.name == candidate.variant)
        choice = Choice(chosen=candidate, evidence=(), reference_change=0.0, reduced=reduced)
        model, scene = chosen_model(choice)
        artifact = compile_scene(model, scene, CompileOptions(method=candidate.method, flags=FLAGS))
        whole, start = (count(make_simulator_run(artifact, Options(end=end)))[0] for end in (scene.end, scene.output_step))
        return whole - start

    def _get(self, of: dict[str, Any], make: Callable[[], Record]) -> Record:
        about = {"model": self.model.content, "scene": repr(asdict(self.scene)), "version": __version__, "runtime": runtime_digest(), **of}
        return self.store.get(about, make)


def _candidate(record: Record) -> Candidate:
    return Candidate(**{**record, "steps": Steps(**record["steps"])})


def _cpu_seconds() -> float:
    return sum(used.ru_utime + used.ru_stime for used in map(getrusage, (RUSAGE_SELF, RUSAGE_CHILDREN)))


def _print(rows: list[Record]) -> None:
    table = Table(title="method auto beside a full search", title_justify="left", box=None)
    for heading in ("scene", "accuracy", "picked", "error", "M instr.", "best of all", "M instr.", "ratio", "choice, CPU s"):
        table.add_column(heading, justify="left")
    for row in rows:
        picked, best = (_candidate(row[name]) for name in ("picked", "best"))
        mine, theirs = (f"{number / 1e6:.3g}" for number in row["instructions"])
        table.add_row(
            f"{row['model']} {row['scene']}", f"{row['accuracy']:g}", _describe(picked), f"{picked.error:.1e}", mine, _describe(best),
            theirs, f"{row['ratio']:.2f}", f"{row['choice_seconds']:.1f}",
        )  # fmt: skip
    console, ratios = Console(highlight=False, width=200), [row["ratio"] for row in rows]
    console.print(table)
    console.print(f"ratio: median {median(ratios):.2f}, largest {max(ratios):.2f} of {len(ratios)}")


def _describe(candidate: Candidate) -> str:
    steps = candidate.steps
    parts = (candidate.method, candidate.variant, candidate.loops, steps.integrator, steps.events, str(steps))
    return ", ".join(part for part in parts if part)


if __name__ == "__main__":
    main()
