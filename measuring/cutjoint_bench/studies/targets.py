"""Target errors of outputs beside true ones, and what they cost.  `python -m cutjoint_bench.studies.targets`.

Each output of the models of files, and each objective of it, is asked for within some shares of the output's largest value, alone, by
interpreted programs. The true error is the distance from `dormand-prince` at 1e-12; the cost is the number of evaluations of all runs, and
of those that a user without targets takes: accuracies of positions from 1e-2 on, a tenth each time, until the output's true error is within
the target; of an objective also that with the same target of the whole output.
"""

from __future__ import annotations

import json
from pathlib import Path
from statistics import median
from typing import Any

import click
import numpy as np

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.formulate.events import jump_times
from cutjoint.model.read import read_model
from cutjoint.model.targets import OBJECTIVES, split_target
from cutjoint.package.errors import CutjointError
from cutjoint.run import accuracy, simulator_run
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from cutjoint_bench.studies.provenance import provenance

MODELS = ("press", "four_bar", "slider_crank", "six_bar", "andrews", "delta", "axle", "car", "flyball", "gantry", "leg", "excavator")
SHARES = (1e-2, 1e-4, 1e-6)
#: Errors below this share of the largest value are rounding, and the reference's.
LEAST = 1e-9


class _Counted:
    """Evaluations of all runs that an accurate run takes."""

    def __init__(self) -> None:
        self.number = 0

    def start(self, *arguments: object, **named: object) -> Trajectory:
        run = simulator_run.start(*arguments, **named)  # type: ignore[arg-type]
        self.number += run.evaluations
        return run


def _run(artifact: Artifact, asked: float | dict[str, float]) -> tuple[Trajectory, int]:
    counted = _Counted()
    accuracy.start, before = counted.start, accuracy.start  # type: ignore[attr-defined]
    try:
        run = simulate(artifact, accuracy=asked, check=False)
        run.error  # noqa: B018 -- its runs are counted too
    finally:
        accuracy.start = before  # type: ignore[attr-defined]
    return run, counted.number


def _true(run: Trajectory, reference: Trajectory, name: str, jumps: tuple[float, ...]) -> float:
    times, here, there = np.intersect1d(np.round(run.t, 9), np.round(reference.t, 9), return_indices=True)
    smooth = ~np.isin(times, np.round(jumps, 9))
    return float(np.max(np.abs(run[name][here] - reference[name][there])[smooth]))


def _true_of(run: Trajectory, reference: Trajectory, target: str, jumps: tuple[float, ...]) -> float:
    objective, output = split_target(target)
    if not objective:
        return _true(run, reference, output, jumps)
    value = OBJECTIVES[objective]
    return abs(float(value(run[output]) - value(reference[output])))


def judge(name: str) -> list[dict[str, Any]]:
    """The pairs of outputs and targets of a model's first scene."""
    model = read_model(Path("models") / f"{name}.yaml")
    scene = next(iter(model.scenes.values()))
    artifact, jumps = compile_interpreted(model, scene), tuple(jump_times(model, scene))
    reference = simulate(artifact, integrator="dormand-prince", tolerance=1e-12, error=False)
    ladder = [_run(artifact, 10.0**-level) for level in range(2, 9)]
    rows: list[dict[str, Any]] = []
    for output in reference.columns:
        size = float(np.max(np.abs(reference[output])))
        for share in SHARES if size > 0 else ():
            target, whole = share * size, None
            for asked in (output, *(f"{objective}({output})" for objective in OBJECTIVES)):
                about = {"model": name, "output": asked, "share": share}
                try:
                    run, evaluations = _run(artifact, {asked: target})
                except CutjointError as error:
                    rows.append({**about, "failure": str(error)})
                    continue
                whole = evaluations if asked == output else whole
                true = _true_of(run, reference, asked, jumps)
                usual = next((n for r, n in ladder if r.failure is None and _true_of(r, reference, asked, jumps) <= target), None)
                rows.append({
                    **about, "converged": run.error.converged, "true": true / target, "estimated": run.error[asked] / target,
                    "evaluations": evaluations, "usual": usual, "whole": whole, "above rounding": true > LEAST * size,
                })  # fmt: skip
    return rows


@click.command()
@click.argument("models", nargs=-1)
@click.option("--out", type=click.Path(path_type=Path), default=Path("results/targets.json"), show_default=True)
def main(models: tuple[str, ...], out: Path) -> None:
    """Print how many targets are met, and their cost."""
    rows = []
    for name in models or MODELS:
        try:
            rows += judge(name)
        except CutjointError as error:
            print(f"{name}: {error}", flush=True)
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(json.dumps(rows, indent=1), encoding="utf-8")
        print(name, len(rows), flush=True)
    print(provenance(()))
    for kind in ("outputs", *OBJECTIVES):
        _print(kind, [row for row in rows if (split_target(row["output"])[0] or "outputs") == kind])


def _print(kind: str, rows: list[dict[str, Any]]) -> None:
    done = [row for row in rows if "true" in row]
    met = [row for row in done if row["converged"]]
    kept = [row for row in met if row["true"] <= 1]
    ratios = [row["estimated"] / row["true"] for row in met if row["above rounding"] and row["true"] > 0]
    costs = [row["evaluations"] / row["usual"] for row in kept if row["usual"]]
    print(f"{kind}: pairs {len(rows)}, failed {len(rows) - len(done)}, converged {len(met)}")
    print(f"of the converged: within the target {len(kept)}, above a tenth of it {sum(row['true'] >= 0.1 for row in met)}")
    low, near = sum(r < 1 / 3 for r in ratios), sum(0.5 <= r <= 2 for r in ratios)
    print(f"estimate over true error: median {median(ratios):.3g}, below a third {low}, within 2 {near} of {len(ratios)}")
    print(f"evaluations over those by the first sufficient accuracy of positions: median {median(costs):.3g} of {len(costs)}")
    shares = [row["evaluations"] / row["whole"] for row in met if row["whole"]]
    print(f"evaluations over those for the whole output: median {median(shares):.3g}, mean {sum(shares) / len(shares):.3g}")


if __name__ == "__main__":
    main()
