"""Ours and peers, each with tuned steps, in turns at equal errors: `python -m cutjoint_bench.studies.beside vehicle chain`.

Every contender runs with steps, or tolerances, from long to short ones, and each run is compared with the reference.  At each error the
fastest setting of a contender that is as accurate then runs in turns with those of all others.  Clocks count the processor's time, and the
least time of a setting counts: other work of the machine does little to it.  Timed runs have few rows.  docs/bench/beside.json keeps all.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from fractions import Fraction
from math import isnan, nan
from pathlib import Path
from statistics import quantiles
from tempfile import TemporaryDirectory
from typing import Any

import click

from cutjoint.model.errors import ModelError
from cutjoint.package.errors import RunError, ToolchainError
from cutjoint.run.result_files import write_whole
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from cutjoint.run.simulator import SimulatorError
from cutjoint.toolchain.compiler import find_compiler
from cutjoint_bench.contenders import choose
from cutjoint_bench.cutjoint_contenders import OwnRunner
from cutjoint_bench.errors import measure_errors
from cutjoint_bench.findings import TARGETS, Spot
from cutjoint_bench.peer_contenders import PeerRunner
from cutjoint_bench.records import Case
from cutjoint_bench.reference import Reference, find_reference
from cutjoint_bench.steps import exact
from cutjoint_bench.studies.checkout import DOCS
from cutjoint_bench.studies.provenance import provenance
from cutjoint_bench.studies.report import STUDIES

KEPT = DOCS / "beside.json"
#: Turns at most, and at least of settings whose runs take longer than so many seconds together.
TURNS, FEW_TURNS, PATIENCE = 10, 3, 4.0
ERRORS = TARGETS[:4]

#: Steps over the distance of rows, longest first.
SHARES = (
    *(Fraction(n, 4) for n in (40, 32, 24, 20, 16, 12, 10, 8, 6, 5, 4)), Fraction(4, 5), Fraction(2, 3),
    *(Fraction(2, n) for n in (4, 5, 6, 8, 10, 12, 16, 20, 24, 32, 40, 50, 64, 80, 100)),
)  # fmt: skip
#: The distance of rows in timed runs, over that of the case.
FEWER = 20

OURS = ("functions", "recursive/dormand-prince", "recursive/rk4")
#: What a user takes who asks for an accuracy, in this order.
ASKED = ("recursive/dormand-prince/functions", "recursive/dormand-prince")


@contextmanager
def processor_clocks() -> Iterator[None]:
    """Clocks of programs that begin within count the processor's time.

    Raises:
        click.ClickException: they do not, on this system.
    """
    with TemporaryDirectory() as folder:
        library = Path(folder) / "processor_clock.so"
        source = Path(__file__).with_name("processor_clock.c")
        subprocess.run([*find_compiler().command, "-O2", "-shared", "-fPIC", str(source), "-o", str(library)], check=True)
        os.environ["LD_PRELOAD"] = str(library)
        try:
            waiting = "import time; a = time.monotonic(); time.sleep(0.2); print(time.monotonic() - a)"
            if float(subprocess.run([sys.executable, "-c", waiting], capture_output=True, check=True).stdout) > 0.1:
                raise click.ClickException("clocks of programs cannot be replaced here")
            yield
        finally:
            del os.environ["LD_PRELOAD"]


@dataclass(frozen=True, kw_only=True)
class AskedRunner:
    """A user's run by default settings: ``dt`` is the accuracy that is asked for, m."""

    runner: OwnRunner
    tolerances: dict[float, float] = field(default_factory=dict)

    def __call__(self, dt: float) -> Trajectory:
        """The run by the tolerance with which `simulate` meets an accuracy; alone, since the search for it has other work to time."""
        if dt not in self.tolerances:
            steps = self._simulate(accuracy=dt).steps
            tried = (10.0**-power for power in range(1, 14))
            self.tolerances[dt] = next(t for t in tried if self._simulate(tolerance=t, error=False).steps == steps)
        return self._simulate(tolerance=self.tolerances[dt], error=False)

    def _simulate(self, **how: Any) -> Trajectory:
        of = self.runner
        return simulate(of.artifact, integrator=of.integrator, parameters=of.parameters, check=False, **how)


AnyRunner = OwnRunner | PeerRunner | AskedRunner


def prepare(case: Case, study: str) -> dict[str, AnyRunner]:
    """The contenders that take a case, by name."""
    runners: dict[str, AnyRunner] = {}
    for contender in choose([*OURS, "peer"]):
        try:
            runner = contender.prepare(case)
        except (RunError, ModelError, ToolchainError) as error:
            click.echo(f"{study}: {contender.name}: {error}", err=True)
            continue
        assert isinstance(runner, OwnRunner | PeerRunner)
        runners[contender.name] = runner
    usual = next(runners[name] for name in ASKED if name in runners)
    assert isinstance(usual, OwnRunner)
    return {**runners, "asked": AskedRunner(runner=usual)}


def with_rows(runner: AnyRunner, row: float) -> AnyRunner:
    """A contender whose rows are so far apart, s."""
    if isinstance(runner, PeerRunner):
        return replace(runner, row=row)
    if isinstance(runner, AskedRunner):
        return replace(runner, runner=replace(runner.runner, artifact=runner.runner.artifact.with_rows(row)))
    return replace(runner, artifact=runner.artifact.with_rows(row))


def find_motion(case: Case, runners: dict[str, AnyRunner]) -> Reference:
    """The exact motion where it is known; else ours with tight steps and exact loops, as far as it is from Pinocchio's."""
    if case.motion is not None:
        return find_reference(case)
    ours, theirs = runners["recursive/dormand-prince"], runners["pinocchio/dormand_prince"]
    assert isinstance(ours, OwnRunner)
    assert isinstance(theirs, PeerRunner)
    run, other = OwnRunner.__call__(replace(ours, tolerance=1e-12), case.scene.output_step), theirs.run(case.scene.output_step, 1e-11)
    reference = Reference(t=run.t, columns=run.columns, position_apart=nan, velocity_apart=nan, provenance={})
    apart = measure_errors(case, other, reference)
    return replace(reference, position_apart=apart.position, velocity_apart=apart.velocity)


def tune(case: Case, name: str, runner: AnyRunner, reference: Reference, most_seconds: float) -> Iterator[Spot]:
    """Runs from long steps to short ones, until one is as accurate as wanted or takes longer than ``most_seconds``."""
    steps = ERRORS if name == "asked" else [float(share * exact(case.scene.output_step)) for share in SHARES]
    for dt in steps:
        try:
            run = runner(dt)
        except SimulatorError:
            continue
        if run.failure is not None:
            continue
        spot = Spot(run.seconds, name, dt, measure_errors(case, run, reference).position)
        click.echo(f"  {name} {1e3 * dt:.4g}: {1e3 * spot.seconds:.3g} ms, {spot.error:.2g} m", err=True)
        yield spot
        if name != "asked" and (run.seconds > most_seconds or spot.error <= ERRORS[-1]):
            return


def at_error(spots: list[Spot], error: float) -> Spot | None:
    """The fastest that is as accurate; of what a user asks for, that of this error."""
    return min((s for s in spots if s.error <= error and (s.contender != "asked" or s.dt == error)), default=None)


def measure(case: Case, runners: dict[str, AnyRunner], reference: Reference, most_seconds: float) -> list[dict[str, Any]]:
    """The fastest setting of each contender at each error, with the seconds of each turn."""
    tuned = {name: list(tune(case, name, runner, reference, most_seconds)) for name, runner in runners.items()}
    found = [(error, spot) for error in ERRORS for spots in tuned.values() if (spot := at_error(spots, error)) is not None]
    timed = {name: with_rows(runner, FEWER * case.scene.output_step) for name, runner in runners.items()}
    seconds: dict[tuple[str, float], list[float]] = {(spot.contender, spot.dt): [] for _, spot in found}
    for turn in range(TURNS):
        for (name, dt), before in seconds.items():
            if turn < FEW_TURNS or sum(before) < PATIENCE:
                before.append(timed[name](dt).seconds)
    return [
        {"error": error, "contender": s.contender, "dt": s.dt, "reached": s.error, "seconds": seconds[s.contender, s.dt]}
        for error, s in found
    ]  # fmt: skip


def rows(measured: list[dict[str, Any]]) -> Iterator[list[str]]:
    """For each error: ours, what a user gets, each kind of peer; the fastest peer over both, with quartiles of the turns."""
    kinds = dict.fromkeys(_kind(m["contender"]) for m in measured)
    yield ["error, m", *kinds, "fastest peer over ours, quartiles", "over what is asked for"]
    for error in ERRORS:
        here = [m for m in measured if m["error"] == error]
        best = {kind: min((m for m in here if _kind(m["contender"]) == kind), key=_least, default=None) for kind in kinds}
        peer = min((m for kind, m in best.items() if m and kind not in ("ours", "asked")), key=_least, default=None)
        cells = ["" if m is None else _cell(m) for m in best.values()]
        yield [f"{error:g}", *cells, *(_ratio(peer, best.get(kind)) for kind in ("ours", "asked"))]


def _kind(contender: str) -> str:
    tool, _, integrator = contender.partition("/")
    if tool == "pinocchio":
        return "Pinocchio, `lcaba`" if integrator.startswith("lcaba") else "Pinocchio"
    return {"mujoco": "MuJoCo", "exudyn": "Exudyn", "asked": "asked"}.get(tool, "ours")


def _least(m: dict[str, Any]) -> float:
    return float(min(m["seconds"]))


def _cell(m: dict[str, Any]) -> str:
    return f"{1e3 * _least(m):.3g} (`{m['contender']}`, {1e3 * m['dt']:.3g}; {m['reached']:.1e})"


def _ratio(peer: dict[str, Any] | None, ours: dict[str, Any] | None) -> str:
    if peer is None or ours is None:
        return ""
    low, _, high = quantiles([b / a for a, b in zip(ours["seconds"], peer["seconds"], strict=False)], n=4)
    return f"{_least(peer) / _least(ours):.3g} ({low:.3g} .. {high:.3g})"


@click.command()
@click.argument("studies", type=click.Choice(("vehicle", "chain", "verification", "governor")), nargs=-1, required=True)
@click.option("--most-seconds", default=2.0, show_default=True, help="Steps that take longer are not shortened.")
def main(studies: tuple[str, ...], most_seconds: float) -> None:
    """Print a table for each case, as soon as it is measured."""
    kept: dict[str, Any] = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {}
    click.echo(provenance())
    for study in studies:
        for case in STUDIES[study]().cases:
            runners = prepare(case, study)
            reference = find_motion(case, runners)
            apart = None if isnan(reference.position_apart) else reference.position_apart
            click.echo(f"{case.name}: references {apart} m apart", err=True)
            with processor_clocks():
                measured = measure(case, runners, reference, most_seconds)
            kept[case.name] = {"provenance": provenance(), "references_apart": apart, "measured": measured}
            write_whole(KEPT, json.dumps(kept, indent=1) + "\n")
            click.echo(f"\n{case.name}\n" + "\n".join(f"| {' | '.join(row)} |" for row in rows(measured)))


if __name__ == "__main__":
    main()
