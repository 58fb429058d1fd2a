"""Fuzzes expressions, files, mechanisms, calls, disks, caches, parts and signals: `make fuzz`, or `python -m tests.fuzz SECONDS [SEED]`.

Prints what was tried, accepted and refused, and the slowest inputs; every input that fails is kept in tests/fuzz/corpus with its seed.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass, field
from itertools import islice
from multiprocessing import get_context

import click

from cutjoint_bench.prebuild import end_with_parent

from .kinds import KINDS
from .tally import Tally

#: Model files that a process tries at once; of other kinds by their `Kind.share` more or less.
CHUNK = 10
#: Chunks for each process, before fresh ones take their place, since SymPy's caches grow.
CHUNKS = 500
#: Seconds between reports.
REPORT = 600.0


@dataclass
class Progress:
    """How far the fuzzing of some kinds is, each from the same ``first`` seed to its ``count``, if it has one."""

    first: int
    counts: Mapping[str, float]
    begun: dict[str, int] = field(default_factory=dict)
    tallies: dict[str, Tally] = field(default_factory=dict)

    def chunks(self) -> Iterator[tuple[str, range]]:
        """Which seeds of which kind come next: always of the kind that is the farthest behind its share."""
        while behind := [name for name, count in self.counts.items() if self.begun.get(name, 0) < count]:
            name = min(behind, key=lambda n: self.begun.get(n, 0) / KINDS[n].share)
            begin = self.begun.get(name, 0)
            end = int(min(begin + max(1, CHUNK * KINDS[name].share), self.counts[name]))
            self.begun[name] = end
            yield name, range(self.first + begin, self.first + end)

    def add(self, name: str, tally: Tally) -> None:
        """Count what a chunk gave."""
        self.tallies.setdefault(name, Tally()).add(tally)

    def print(self) -> None:
        """The figures of all kinds so far."""
        for name in self.counts:
            print(self.tallies.get(name, Tally()).summary(name), flush=True)


def try_chunk(name: str, seeds: range) -> tuple[str, Tally]:
    """What happens to the inputs of some seeds."""
    tally = Tally()
    for seed in seeds:
        tally.run(KINDS[name], seed)
    return name, tally


def fuzz(progress: Progress, *, seconds: float, jobs: int) -> None:
    """Try inputs until the time is over or all counts are reached.

    Raises:
        click.ClickException: a process died, which no input may bring about.
    """
    end, report = time.monotonic() + seconds, time.monotonic() + REPORT
    chunks = progress.chunks()
    while time.monotonic() < end and (first := list(islice(chunks, jobs * CHUNKS))):
        with ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), initializer=end_with_parent) as pool:
            waiting, running = iter(first), dict[Future[tuple[str, Tally]], tuple[str, range]]()
            while True:
                while time.monotonic() < end and len(running) < 2 * jobs and (chunk := next(waiting, None)):
                    running[pool.submit(try_chunk, *chunk)] = chunk
                if not running:
                    break
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    _take(progress, future, running)
                if time.monotonic() > report:
                    report += REPORT
                    progress.print()


def _take(progress: Progress, future: Future[tuple[str, Tally]], running: dict[Future[tuple[str, Tally]], tuple[str, range]]) -> None:
    try:
        progress.add(*future.result())
    except BrokenExecutor:
        tried = ", ".join(f"{name} {seeds.start}..{seeds.stop - 1}" for name, seeds in running.values())
        raise click.ClickException(f"a process died with one of these seeds: {tried}") from None
    del running[future]


def _counts(_: click.Context, __: click.Parameter, given: tuple[str, ...]) -> dict[str, float]:
    counts = {}
    for text in given:
        name, _, number = text.partition("=")
        if name not in KINDS or not number.isascii() or not number.isdigit():
            raise click.BadParameter(f"'{text}': write KIND=NUMBER, with a kind of {', '.join(KINDS)}")
        counts[name] = float(number)
    return counts


@click.command()
@click.argument("seconds", type=click.FloatRange(min=0), default=300.0)
@click.argument("seed", type=click.IntRange(min=0), default=lambda: int(time.time()))
@click.option("--jobs", type=click.IntRange(min=1, max=256), default=1, show_default=True, help="Processes.")
@click.option("--kind", "kinds", type=click.Choice(list(KINDS)), multiple=True, help="Only these kinds; all otherwise.")
@click.option("--count", "counts", callback=_counts, multiple=True, metavar="KIND=NUMBER", help="Inputs of a kind after which it ends.")
def main(seconds: float, seed: int, jobs: int, kinds: tuple[str, ...], counts: dict[str, float]) -> None:
    """Fuzz for so many SECONDS, from the first SEED on (the clock's otherwise); status 1 when something failed."""
    progress = Progress(first=seed, counts={name: counts.get(name, float("inf")) for name in kinds or KINDS})
    print(f"seeds from {seed} on", flush=True)
    try:
        fuzz(progress, seconds=seconds, jobs=jobs)
    finally:
        progress.print()
    sys.exit(1 if any(tally.failed for tally in progress.tallies.values()) else 0)
