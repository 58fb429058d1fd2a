"""Choices of `method: auto` beside the best of an exhaustive search: `make choice`.

The search tries every reduced model of every method with steps that fall by 9 %.  The choice tries the last reduced model of each kind of
motion with steps that fall by a factor of 1.4.  Both measure against the same truth and are timed in one run, in turns.  What was measured
is kept in results/choice, so that an interrupted run goes on; the rows are kept in docs/bench/choice.json, each with its machine and
version.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial
from typing import Any

import click
from rich.console import Console
from rich.table import Table

from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.methods import METHODS
from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model
from cutjoint.model.records import Model, Scene
from cutjoint.package.errors import RunError
from cutjoint.package.locations import __version__
from cutjoint.reduce.choose import Candidate, choose, searches, timed, trials_by
from cutjoint.reduce.measure import Reference, find_reference, time_run
from cutjoint.reduce.sequence import ReducedModel, reduction_sequence
from cutjoint.reduce.trials import Steps, at_step
from cutjoint.run.scenes import find_scene
from cutjoint.toolchain.cache import runtime_digest
from cutjoint_bench.machine import machine
from cutjoint_bench.store import Record, Store
from cutjoint_bench.studies.checkout import DOCS, MODELS, RESULTS

#: Model, scene (the only one of its model where there is none), end in s (the scene's where there is none), tolerance in m and rad.
SCENES = (
    ("pendulum", None, None, 1e-3), ("four_bar", None, None, 1e-3), ("slider_crank", None, None, 1e-3), ("flyball", None, None, 1e-4),
    ("iltis", "iavsd_inphase_5", None, 1e-3), ("iltis", "simul1", 4.0, 1e-2), ("iltis", "simul2", 4.0, 1e-2),
    ("iltis", "simul3", 4.0, 1e-2),
)  # fmt: skip

FINE = 2**0.125

#: Rounds of timing, in turns, of what was picked and what is best where they differ.
ROUNDS = 8


KEPT = DOCS / "choice.json"


@click.command()
@click.option("--only", multiple=True, metavar="NAME", help="Models or scenes to measure; the file keeps the others.")
def main(only: tuple[str, ...]) -> None:
    """Measure what is not yet measured, print a row for each scene, and keep the results."""
    store = Store(RESULTS / "choice" / "measurements.jsonl")
    rows: dict[str, Record] = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {}
    for name, scene, end, tolerance in SCENES:
        model = read_model(MODELS / f"{name}.yaml")
        found = find_scene(model, scene)
        if only and not {name, found.name} & set(only):
            continue
        wanted = replace(found, method="auto", accuracy=tolerance, end=found.end if end is None else end)
        rows[f"{name} {found.name}"] = Comparison(model=model, scene=wanted, store=store).row()
        KEPT.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    _print(list(rows.values()))


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

    def row(self) -> Record:
        """The picked candidate and the best one, the distance of both from the truth, and their times in s."""
        picked = choose(self.model, self.scene).chosen
        return self._get({"picked": asdict(picked), "rounds": ROUNDS}, partial(self._compare, picked))

    def _compare(self, picked: Candidate) -> Record:
        tried = list(self._search())
        best = min([*(c for c in tried if not c.failure), picked], key=lambda c: c.seconds)
        different = list(dict.fromkeys((c.method, c.variant, c.steps) for c in (picked, best)))
        times = [[self._seconds(*of) for of in different] for _ in range(ROUNDS)]
        fastest = [min(column) for column in zip(*times, strict=True)]
        seconds = [fastest[0], fastest[-1]]
        return {
            "model": self.model.name, "scene": self.scene.name, "end": self.scene.end, "tolerance": self.scene.accuracy,
            "picked": asdict(picked), "best": asdict(best), "candidates": [asdict(c) for c in tried],
            "settled": self.truth.change, "seconds": seconds, "ratio": seconds[0] / seconds[1], "machine": dict(machine()),
            "version": __version__, "runtime": runtime_digest(),
        }  # fmt: skip

    def _search(self) -> Iterator[Candidate]:
        fastest: Candidate | None = None
        for method in METHODS:
            for variant in self._variants(method):
                of = {"variant": variant.name, "method": method, "fastest": fastest and asdict(fastest)}
                for found in (Candidate(**record) for record in self._get(of, partial(self._try, variant, fastest))["candidates"]):
                    if not found.failure and (fastest is None or found.seconds < fastest.seconds):
                        fastest = found
                    yield found

    def _try(self, variant: ReducedModel, fastest: Candidate | None) -> Record:
        by = trials_by(variant)
        tried = [(find, by(integrator)) for find, integrator in searches(variant)]
        found = [(find(variant, self.scene, {}, self.truth, trials, ratio=FINE, fastest=fastest), trials) for find, trials in tried]
        return {"candidates": [asdict(timed(c, None if c.failure else trials.compiled, {})) for c, trials in found]}

    def _variants(self, method: str) -> list[ReducedModel]:
        try:
            return reduction_sequence(self.model, self.scene, method, approximate=True)
        except (ModelError, RunError):
            return []

    def _seconds(self, method: str, name: str, steps: Steps) -> float:
        variant = next(r for r in self._variants(method) if r.name == name)
        return time_run(at_step(compile_scene(variant.model, variant.scene, CompileOptions(method=method)), steps), steps).seconds

    def _get(self, of: dict[str, Any], make: Any) -> Record:
        about = {"model": self.model.content, "scene": repr(asdict(self.scene)), "version": __version__, "runtime": runtime_digest(), **of}
        return self.store.get(about, make)


def _print(rows: list[Record]) -> None:
    table = Table(title="method auto beside an exhaustive search", title_justify="left", box=None)
    for heading in ("scene", "accuracy", "picked", "error", "ms", "best of all", "ms", "ratio"):
        table.add_column(heading, justify="left")
    for row in rows:
        picked, best = ([c["method"], c["variant"], str(Candidate(**c).steps)] for c in (row["picked"], row["best"]))
        mine, theirs = (f"{1e3 * seconds:.3g}" for seconds in row["seconds"])
        table.add_row(
            f"{row['model']} {row['scene']}", f"{row['tolerance']:g}", ", ".join(picked), f"{row['picked']['error']:.1e}", mine,
            ", ".join(best), theirs, f"{row['ratio']:.2f}",
        )  # fmt: skip
    Console(highlight=False, width=160).print(table)


if __name__ == "__main__":
    main()
