"""Fuzzes expressions, files, calls, disks, caches and signals: `make fuzz`, or `python -m benchmarks.fuzz SECONDS [SEED]`.

Prints what was tried, accepted and refused, and the slowest inputs; every input that fails is kept in tests/fuzz/corpus with its seed.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass, field
from multiprocessing import get_context

import click
from tests.fuzz.kinds import KINDS
from tests.fuzz.tally import Tally

#: Inputs of one kind that a process tries at once, for each of `Kind.share`.
CHUNK = 10
#: Chunks that a process tries before a fresh one takes its place, since SymPy's caches grow.
CHUNKS = 500


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
    """Try inputs until the time is over or all counts are reached."""
    end, report = time.monotonic() + seconds, time.monotonic() + 600
    chunks = progress.chunks()
    running: set[Future[tuple[str, Tally]]] = set()
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), max_tasks_per_child=CHUNKS) as pool:
        while True:
            while time.monotonic() < end and len(running) < 2 * jobs and (chunk := next(chunks, None)):
                running.add(pool.submit(try_chunk, *chunk))
            if not running:
                return
            done, running = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                progress.add(*future.result())
            if time.monotonic() > report:
                report += 600
                progress.print()


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
    fuzz(progress, seconds=seconds, jobs=jobs)
    progress.print()
    sys.exit(1 if any(tally.failed for tally in progress.tallies.values()) else 0)


if __name__ == "__main__":
    main()
