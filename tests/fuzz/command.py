"""Fuzzes all kinds of inputs, each for its share of the time: `make fuzz SECONDS=600 SEED=1`, or `python -m tests.fuzz SECONDS [SEED]`.

Prints what was tried in how many seconds, accepted and refused, and the slowest inputs; every input that fails is kept in
tests/fuzz/corpus with its seed.
"""

from __future__ import annotations

import os
import random
import sys
import time
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait
from multiprocessing import get_context
from typing import TypeAlias

import click

from cutjoint_bench.prebuild import end_with_parent
from tests.view.browser import CHROMIUM

from .kinds import KINDS
from .tally import Tally
from .turns import Turns

#: Seconds after which fresh processes take their place, since SymPy's caches grow.
LIFE = 600.0
#: Seconds between reports.
REPORT = 300.0

_Running: TypeAlias = dict[Future[Tally], tuple[str, range]]


def prepare(names: Sequence[str]) -> None:
    """Compile what inputs of kinds need, as far as it is not in the cache, so that this takes no kind's time."""
    with processes(1) as pool:
        for made in [pool.submit(_make_one, name) for name in names]:
            made.result()


def _make_one(name: str) -> None:
    KINDS[name].make(random.Random(0))


def processes(jobs: int) -> ProcessPoolExecutor:
    """A pool of so many processes."""
    return ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), initializer=_begin)


def _begin() -> None:
    """Let a process end with this one, out of reach of a signal that ends the fuzzing: an input must not take it for its own."""
    os.setpgrp()
    end_with_parent()


def try_turn(name: str, seeds: range) -> Tally:
    """Run the inputs of some seeds."""
    tally = Tally()
    for seed in seeds:
        tally.run(KINDS[name], seed)
    return tally


def fuzz(turns: Turns, tallies: dict[str, Tally], *, seconds: float, jobs: int) -> None:
    """Try inputs until the time is over or all counts are reached; ``tallies`` by kind get what was found.

    Raises:
        click.ClickException: a process died, which no input may bring about.
    """
    end, report = time.monotonic() + seconds, time.monotonic() + REPORT
    while turn := turns.next(end - time.monotonic()):
        fresh = time.monotonic() + LIFE
        with processes(jobs) as pool:
            running: _Running = {}
            while turn or running:
                if turn:
                    running[pool.submit(try_turn, *turn)] = turn
                if len(running) == jobs or not turn:
                    for future in wait(running, return_when=FIRST_COMPLETED).done:
                        _take(turns, tallies, future, running)
                turn = turns.next(end - time.monotonic()) if time.monotonic() < fresh else None
                if time.monotonic() > report:
                    report += REPORT
                    print_all(tallies)


def _take(turns: Turns, tallies: dict[str, Tally], future: Future[Tally], running: _Running) -> None:
    name, seeds = running[future]
    try:
        tally = future.result()
    except BrokenExecutor:
        tried = ", ".join(f"{name} {seeds.start}..{seeds.stop - 1}" for name, seeds in running.values())
        raise click.ClickException(f"a process died with one of these seeds: {tried}") from None
    del running[future]
    turns.end(name, len(seeds), seconds=tally.seconds, checked=tally.checked)
    tallies.setdefault(name, Tally()).add(tally)


def print_all(tallies: dict[str, Tally]) -> None:
    """The figures of all kinds so far."""
    for name, tally in tallies.items():
        print(tally.summary(name), flush=True)


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
    """Fuzz for so many SECONDS, from the first SEED on (the clock's otherwise); status 1 when something failed.

    What all inputs need is compiled before, where it is not in the cache.
    """
    names = tuple(name for name in kinds or KINDS if name != "meshes" or CHROMIUM is not None)
    if CHROMIUM is None:
        print("without meshes, whose pages need Chromium")
    tallies = {name: Tally() for name in names}
    print(f"seeds from {seed} on", flush=True)
    prepare(names)
    try:
        fuzz(Turns.of(seed, {name: KINDS[name].share for name in names}, counts), tallies, seconds=seconds, jobs=jobs)
    finally:
        print_all(tallies)
    sys.exit(1 if any(tally.failed for tally in tallies.values()) else 0)
