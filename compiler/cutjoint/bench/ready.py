"""What a bench needs before its clock runs, on all cores: references, simulators, and outcomes that no clock measures.

What is made is kept in the cache and in the store, where `cutjoint.bench.study.perform` finds it.  What fails here fails there again, with
its message in its place.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path

from cutjoint.bench.failures.atlas import Grid, map_case, with_value
from cutjoint.bench.failures.trials import Situation, try_situation
from cutjoint.bench.records import Case, Contender
from cutjoint.bench.store import Store
from cutjoint.bench.study import Plan, Say, atlas_reference, case_reference, find_drift, find_limits, grid_of, has_limits

Task = Callable[[], object]


def make_ready(plans: Sequence[Plan], measurements: Path, say: Say = lambda _: None) -> None:
    """Make what the plans' clocks need not wait for; ``measurements`` is the file of the store."""
    with ProcessPoolExecutor(len(os.sched_getaffinity(0)), mp_context=get_context("spawn")) as pool:
        for words, tasks in (("references and simulators", _first_tasks(plans)), ("outcomes", _second_tasks(plans, measurements))):
            jobs = [pool.submit(task) for task in tasks]
            for done, _ in enumerate(as_completed(jobs)):
                say(f"{words}: {done + 1} of {len(jobs)}")


def _first_tasks(plans: Sequence[Plan]) -> Iterator[Task]:
    """References, which take longest, first."""
    for plan in plans:
        for case in plan.cases:
            yield partial(_refer, plan, case)
            if plan.atlas:
                grid = grid_of(plan, case)
                yield from (partial(_refer_atlas, plan, with_value(case, grid.parameter, value)) for value in grid.values)
    for plan in plans:
        yield from (partial(_compile, case, contender) for case in plan.cases for contender in plan.contenders)


def _refer(plan: Plan, case: Case) -> None:
    case_reference(plan, case)


def _refer_atlas(plan: Plan, case: Case) -> None:
    atlas_reference(plan)(case)


def _compile(case: Case, contender: Contender) -> None:
    contender.prepare(case)


def _second_tasks(plans: Sequence[Plan], measurements: Path) -> Iterator[Task]:
    """What takes simulators and references."""
    for plan in plans:
        for case in plan.cases if plan.atlas else ():
            grid = grid_of(plan, case)
            yield from (partial(_map, plan, case, replace(grid, methods=(method,)), measurements) for method in grid.methods)
        yield from (partial(_try, situation, measurements) for situation in plan.situations)
        yield from (partial(_drift, case, measurements) for case in plan.cases if plan.drift)
        yield from (
            partial(_limit, plan, case, contender, measurements)
            for case in plan.cases for contender in plan.contenders if has_limits(plan, contender)
        )  # fmt: skip


def _map(plan: Plan, case: Case, grid: Grid, measurements: Path) -> None:
    map_case(case, grid, Store(measurements), refer=atlas_reference(plan))


def _try(situation: Situation, measurements: Path) -> None:
    try_situation(situation, Store(measurements))


def _drift(case: Case, measurements: Path) -> None:
    find_drift(case, Store(measurements))


def _limit(plan: Plan, case: Case, contender: Contender, measurements: Path) -> None:
    find_limits(plan, case, contender, contender.prepare(case), case_reference(plan, case), Store(measurements))
