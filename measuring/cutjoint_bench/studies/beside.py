"""Ours and the fastest peer in turns, at equal errors: `python -m cutjoint_bench.studies.beside vehicle chain`.

The report measures one contender after the other, for an hour; what else the machine does meanwhile is in its ratios.  Here the fastest
points of the report's summary that are as accurate as asked for, ours and a peer's, run one after the other, again and again: medians of
their times, and of the ratios of each turn with its quartiles.  Only on a machine that does nothing else: a core that is shared makes long
runs longer than short ones, by which ratios get too large; those of the least times do less.
"""

from __future__ import annotations

import json
from pathlib import Path
from statistics import median, quantiles

import click

from cutjoint_bench.contenders import choose
from cutjoint_bench.findings import Spot
from cutjoint_bench.records import Case, Runner
from cutjoint_bench.report.summary import fastest_of
from cutjoint_bench.studies.checkout import SUMMARY
from cutjoint_bench.studies.provenance import provenance
from cutjoint_bench.studies.report import STUDIES

TURNS = 15


def in_turns(case: Case, runners: dict[str, Runner], two: tuple[Spot, Spot]) -> list[tuple[float, float]]:
    """Seconds of both in each turn; a first one warms up."""
    for spot in two:
        if spot.contender not in runners:
            (contender,) = choose([spot.contender])
            runners[spot.contender] = contender.prepare(case)
    turns = [(seconds(runners, two[0]), seconds(runners, two[1])) for _ in range(TURNS + 1)]
    return turns[1:]


def seconds(runners: dict[str, Runner], spot: Spot) -> float:
    """Of a run to its end, which it came to when the report was made."""
    run = runners[spot.contender](spot.dt)
    if run.failure is not None:
        raise click.ClickException(f"{spot.contender} at {spot.dt:g} s fails now ({run.failure}): make the report first")
    return run.seconds


#: The studies that have peers.
WITH_PEERS = ("vehicle", "chain", "verification", "governor")


@click.command()
@click.argument("studies", type=click.Choice(WITH_PEERS), nargs=-1, required=True)
@click.option("--summary", type=click.Path(exists=True, path_type=Path), default=SUMMARY, show_default=True,
              help="Of a report with peers.")
def main(studies: tuple[str, ...], summary: Path) -> None:
    """Print a row for each case and error, as soon as it is measured."""
    click.echo(provenance())
    _print("case", "error, m", "ours", "ms", "peer", "ms", "peer over ours", "quartiles", "of the least times")
    known = json.loads(summary.read_text(encoding="utf-8"))
    for study in studies:
        for case in STUDIES[study]().cases:
            runners: dict[str, Runner] = {}
            for error, ours, peer in fastest_of(known, study, case.name):
                turns = in_turns(case, runners, (ours, peer))
                low, middle, high = quantiles([b / a for a, b in turns], n=4)
                mine, theirs = zip(*turns, strict=True)
                times, least = [f"{median(t) * 1e3:.3g}" for t in (mine, theirs)], min(theirs) / min(mine)
                names = [f"{spot.contender}, {spot.dt * 1e3:.3g} ms" for spot in (ours, peer)]
                _print(case.name, f"{error:g}", names[0], times[0], names[1], times[1], f"{middle:.1f}", f"{low:.1f} .. {high:.1f}",
                       f"{least:.1f}")  # fmt: skip


def _print(*cells: str) -> None:
    click.echo(f"| {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
