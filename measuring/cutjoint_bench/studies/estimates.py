"""Estimated errors of runs beside true ones: models, methods and integrators.  `make errors`.

Models are those of files, and mechanisms with dead centres, massless rods and friction whose numbers are drawn (`estimate_models`).
results/estimates keeps what runs have shown, so that an interrupted study goes on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import cache, partial
from itertools import islice
from math import isnan, nan
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.table import Table

import cutjoint
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.formulate.events import jump_times
from cutjoint.methods import INTEGRATORS, METHODS, Implementation
from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import STEP, Model, Scene
from cutjoint.package.errors import RunError
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from cutjoint.toolchain.cache import digest_of
from cutjoint_bench.estimate_models import draws
from cutjoint_bench.progress import Say, progress_bar
from cutjoint_bench.store import Store
from cutjoint_bench.studies.checkout import RESULTS
from cutjoint_bench.studies.provenance import provenance

#: An estimate is near the true error within this factor.
NEAR = 5.0
#: An estimate of less than this share of the true error misleads, unless it says that it has not converged.
FAR = 0.1
#: No more than one run in two hundred that says that it has converged may tell less than this share.
SHORT = 1 / 3
#: True errors below this share of what outputs of the unit reach are the reference's too, or rounding of what is zero by symmetry.
LEAST = 1e-8
#: True errors below this are nobody's concern, SI units: a mechanism at rest moves by as much.
FLOOR = 1e-8
#: Settings of references, the first that reaches the end: error control stops at some singular poses that equal steps go through.
REFERENCES: tuple[dict[str, float | str], ...] = (
    {"integrator": "dormand-prince", "tolerance": 1e-11}, {"integrator": "rk4", "dt": 1e-4}, {"integrator": "rk4", "dt": 5e-5},
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Judgement:
    """The estimates of a run: for each output the estimated over the true error, without errors below LEAST and FLOOR."""

    ratios: Sequence[float] = ()
    largest: float = nan
    converged: bool = False
    failure: str = ""

    @property
    def near(self) -> int:
        """Number of estimates that are near."""
        return sum(1 / NEAR <= ratio <= NEAR for ratio in self.ratios)

    @property
    def cautious(self) -> int:
        """Number of estimates that are larger than near."""
        return sum(ratio > NEAR for ratio in self.ratios)

    @property
    def is_short(self) -> bool:
        """True where the run says that it has converged, and tells too little of an output."""
        return self.converged and min(self.ratios, default=1.0) < SHORT

    @property
    def misleading(self) -> int:
        """Number of estimates that promise too much silently."""
        return sum(ratio < FAR for ratio in self.ratios) if self.converged else 0


def settings_of(method: str, scene: Scene) -> Iterator[tuple[str, dict[str, float | str]]]:
    """Names and settings of the runs of a method: by default, and by each of its integrators, with equal steps where it has them."""
    yield "default", {}
    dt = min(scene.numerics.of_method(method).step, scene.output_step, STEP)
    for integrator in INTEGRATORS.values():
        if integrator.supports(METHODS[method], Implementation.GENERATED):
            if integrator.adaptive:
                yield integrator.name, {"integrator": integrator.name, "tolerance": 1e-6}
            else:
                yield f"{integrator.name}, {1e3 * dt:g} ms", {"integrator": integrator.name, "dt": dt}


def judge(
    run: Trajectory, reference: Trajectory, jumps: Sequence[float] = (), *, unknown: Mapping[str, float] | None = None
) -> Judgement:  # fmt: skip
    """The estimates of a run against a reference at common times, but for those of ``jumps``.

    ``unknown`` are the reference's own errors.
    """
    if run.failure is not None:
        return Judgement(failure=str(run.failure))
    estimate, ratios, largest = run.error, [], 0.0
    times, here, there = np.intersect1d(np.round(run.t, 9), np.round(reference.t, 9), return_indices=True)
    smooth = ~np.isin(times, np.round(jumps, 9))
    here, there = here[smooth], there[smooth]
    sizes: dict[str, float] = {}
    for name, unit in reference.units.items():
        sizes[unit] = max(sizes.get(unit, 0.0), float(np.max(np.abs(reference[name]))))
    for name in run.columns:
        size = sizes[run.units[name]]
        true = float(np.max(np.abs(run[name][here] - reference[name][there])))
        if true > max(LEAST * size, FLOOR, 3 * (unknown or {}).get(name, 0.0)):
            ratios.append(estimate[name] / true)
            largest = max(largest, true / size)
    return Judgement(ratios=ratios, largest=largest, converged=estimate.converged)


@dataclass(frozen=True, kw_only=True)
class Row:
    """The judgement of a run by a method with its settings."""

    method: str
    settings: str
    judgement: Judgement


def judge_scene(model: Model, scene: Scene) -> Iterator[Row]:
    """The runs of a scene by all methods."""
    artifact = compile_scene(model, scene)
    runs = (simulate(artifact, error=False, check=False, **how) for how in REFERENCES)  # type: ignore[arg-type]
    reference, jumps = next((run for run in runs if run.failure is None), None), jump_times(model, scene)
    if reference is None:
        yield Row(method="recursive", settings="", judgement=Judgement(failure="no reference reached the end"))
        return
    for method in METHODS:
        try:
            artifact = compile_scene(model, scene, CompileOptions(method=method))
        except (ModelError, RunError) as error:
            yield Row(method=method, settings="", judgement=Judgement(failure=str(error)))
            continue
        for name, settings in settings_of(method, scene):
            run = simulate(artifact, check=False, **settings)  # type: ignore[arg-type]
            yield Row(method=method, settings=name, judgement=judge(run, reference, jumps))


def judge_parameters(
    compiled: Callable[[], Mapping[str, Artifact]], scene: Scene, parameters: Mapping[str, float], *, integrators: bool = True
) -> Iterator[Row]:
    """The runs of a mechanism with these numbers by all methods, by default and by all ``integrators``.

    There are none where friction holds what moves: it has no motion to compare with.
    """
    artifacts = compiled()
    reference, other = (
        simulate(artifacts["recursive"], parameters=parameters, integrator="dormand-prince", tolerance=x, error=False, check=False)
        for x in (1e-12, 1e-11)
    )
    if reference.failure or other.failure:
        return
    unknown = {name: float(np.max(np.abs(reference[name] - other[name]))) for name in reference.columns}
    for method, artifact in artifacts.items():
        for name, settings in islice(settings_of(method, scene), None if integrators else 1):
            run = simulate(artifact, parameters=parameters, check=False, **settings)  # type: ignore[arg-type]
            yield Row(method=method, settings=name, judgement=judge(run, reference, unknown=unknown))


def _interpreted(model: Model, scene: Scene) -> Mapping[str, Artifact]:
    """The programs of a mechanism by the methods that have it; nothing is compiled."""
    artifacts = {}
    for method in METHODS:
        with suppress(ModelError, RunError):
            artifacts[method] = compile_interpreted(model, scene, method=method)
    return artifacts


def judge_draws(count: int, seed: int, store: Store, say: Say, *, integrators: bool = True) -> Iterator[Row]:
    """All runs of the mechanisms whose numbers are drawn; those that are stored are not taken again."""
    all_ = list(draws(count, seed))
    for number, draw in enumerate(all_):
        model = read_model_text(draw.text, f"{draw.name}.yaml")
        (scene,) = model.scenes.values()
        compiled = cache(partial(_interpreted, model, scene))
        for i, parameters in enumerate(draw.parameters):
            say(f"{draw.name}, draw {i + 1}", share=(number + i / count) / len(all_))
            of = {"model": draw.text, "parameters": parameters, "integrators": integrators}
            yield from _stored(store, of, partial(judge_parameters, compiled, scene, parameters, integrators=integrators))


@cache
def _code() -> str:
    """A digest of the compiler, whose rules are judged, and of this file."""
    files = [*sorted(Path(cutjoint.__file__).parent.rglob("*.py")), Path(__file__)]
    return digest_of([path.read_text(encoding="utf-8") for path in files])


def _stored(store: Store, of: Mapping[str, Any], judge_all: Callable[[], Iterator[Row]]) -> list[Row]:
    """Results that runs have shown, with this code, compiler and machine."""
    about = {**of, "made": provenance(()), "code": _code()}
    record = store.get(about, lambda: {"rows": [asdict(row) for row in judge_all()]})
    return [Row(**{**row, "judgement": Judgement(**row["judgement"])}) for row in record["rows"]]


def _drawn(count: int, rows: Sequence[Row], seed: int) -> Table:
    """A row for each method with its settings, over all mechanisms."""
    found: dict[tuple[str, str], list[Judgement]] = {}
    for row in rows:
        found.setdefault((row.method, row.settings), []).append(row.judgement)
    few = ("method", "steps", "runs", "failed", "converged", f"a run below {SHORT:.2g}", f"below {FAR:g}")
    headings = (*few, f"within {NEAR:g}", "median", "5 to 95 %")
    table = Table(*headings, title=f"dead centres, massless rods, friction: {count} draws each, seed {seed}", box=None)
    for (method, name), all_ in found.items():
        ratios = [ratio for j in all_ for ratio in j.ratios]
        low, middle, high = np.quantile(ratios, [0.05, 0.5, 0.95]) if ratios else (nan, nan, nan)
        table.add_row(
            method, name, str(len(all_)), str(sum(bool(j.failure) for j in all_)), str(sum(j.converged for j in all_)),
            str(sum(j.is_short for j in all_)), str(sum(j.misleading > 0 for j in all_)), f"{sum(j.near for j in all_)} of {len(ratios)}",
            f"{middle:.2g}", f"{low:.2g} to {high:.2g}",
        )  # fmt: skip
    return table


def _row(judgement: Judgement) -> tuple[str, ...]:
    if judgement.failure:
        return ("", "", "", judgement.failure)
    ratios = judgement.ratios
    spread = f"{min(ratios):.2g} to {max(ratios):.2g}" if ratios else ""
    largest = "" if isnan(judgement.largest) else f"{judgement.largest:.1e}"
    words = ("" if judgement.converged else "not converged", f"{judgement.misleading} mislead" if judgement.misleading else "")
    return (largest, f"{judgement.near} of {len(ratios)}", spread, ", ".join(filter(None, words)))


@click.command()
@click.argument("models", nargs=-1, type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--scene", "scenes", multiple=True, help="Scenes to take; all by default.")
@click.option("--draws", "count", default=4, help="Draws of each mechanism whose numbers are drawn.", show_default=True)
@click.option("--seed", default=1, help="Of the draws.", show_default=True)
@click.option("--drawn-only", is_flag=True, help="Leave out the files.")
@click.option("--default-only", is_flag=True, help="Leave out runs of draws that name an integrator.")
def main(models: tuple[Path, ...], scenes: tuple[str, ...], count: int, seed: int, drawn_only: bool, default_only: bool) -> None:
    """Judge estimated errors of all methods and integrators on MODELS, by default those of models/, and on mechanisms that are drawn."""
    console, judgements, store = Console(highlight=False, width=200), [], Store(RESULTS / "estimates" / "measurements.jsonl")
    judged = f"of outputs with a true error above {FLOOR:g} and {LEAST:g} of the largest of their unit"
    console.print(f"{provenance(())}; estimated over true errors, {judged}", markup=False)
    with progress_bar() as say:
        for path in () if drawn_only else models or sorted(Path("models").glob("*.yaml")):
            model = read_model(path)
            for scene in (scene for scene in model.scenes.values() if not scenes or scene.name in scenes):
                say(title := f"{model.name}, {scene.name}")
                of = {"model": model.text, "scene": scene.name}
                rows = _stored(store, of, partial(judge_scene, model, scene))
                console.print(_of_scene(title, rows))
                judgements += [row.judgement for row in rows]
        if count:
            rows = list(judge_draws(count, seed, store, say, integrators=not default_only))
            console.print(_drawn(count, rows, seed))
            judgements += [row.judgement for row in rows]
    console.print(_summary(judgements), markup=False)


def _of_scene(title: str, rows: Sequence[Row]) -> Table:
    table = Table("method", "steps", "largest error", f"within {NEAR:g}", "ratios", "", title=title, box=None)
    for row in rows:
        table.add_row(row.method, row.settings, *_row(row.judgement))
    return table


def _summary(judgements: Sequence[Judgement]) -> str:
    estimates, near = sum(len(j.ratios) for j in judgements), sum(j.near for j in judgements)
    cautious, misleading = sum(j.cautious for j in judgements), sum(j.misleading for j in judgements)
    failed, converged = sum(bool(j.failure) for j in judgements), sum(j.converged for j in judgements)
    short, far = sum(j.is_short for j in judgements), sum(j.misleading > 0 for j in judgements)
    return (
        f"{near} of {estimates} estimates within a factor of {NEAR:g}, {cautious} larger; "
        f"{misleading} below {FAR:g} of the true error without the words 'not converged'; {failed} of {len(judgements)} runs failed; "
        f"of {converged} that have converged, {short} tell less than {SHORT:.2g} of a true error, {far} less than {FAR:g}"
    )  # fmt: skip


if __name__ == "__main__":
    main()
