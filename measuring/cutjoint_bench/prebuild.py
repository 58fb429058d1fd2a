"""Preparation of a bench before its clock runs, on all cores: references, simulators, and outcomes that no clock measures.

What is made goes to the cache and to the store, where `cutjoint_bench.study.perform` finds it.  What fails here fails there again, with
its message in its place.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import replace
from functools import partial
from multiprocessing import active_children, get_context, parent_process
from pathlib import Path
from threading import Thread

from cutjoint.model.errors import ModelError
from cutjoint.package.errors import RunError, ToolchainError
from cutjoint_bench.failures.atlas import Grid, map_case, with_value
from cutjoint_bench.failures.trials import Situation, try_situation
from cutjoint_bench.progress import Say, silently
from cutjoint_bench.records import Case, Contender
from cutjoint_bench.store import Store
from cutjoint_bench.study import Plan, atlas_reference, case_reference, find_drift, find_limits, grid_of, has_limits

Task = Callable[[], object]


def prebuild(plans: Sequence[Plan], measurements: Path, say: Say = silently) -> None:
    """Make what the plans' clocks need not wait for; ``measurements`` is the file of the store.

    Raises:
        RunError: an atlas is to vary a parameter that the model does not have.
    """
    stages = {"references and simulators": list(_first_tasks(plans)), "outcomes": list(_second_tasks(plans, measurements))}
    pool = ProcessPoolExecutor(len(os.sched_getaffinity(0)), mp_context=get_context("spawn"), initializer=end_with_parent)
    try:
        for words, tasks in stages.items():
            _do_all(pool, tasks, words, say)
    except BrokenProcessPool:  # a process was killed, for want of memory say; the bench makes itself what is missing
        say("a process was killed; going on with one")
    except BaseException:
        for process in active_children():
            process.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def end_with_parent() -> None:
    """Let this process of a pool end when the process that made it has, by whatever means; simulators that it runs end then too."""
    parent = parent_process()
    assert parent is not None

    def watch() -> None:
        parent.join()
        os._exit(1)

    Thread(target=watch, daemon=True).start()


def _do_all(pool: ProcessPoolExecutor, tasks: Sequence[Task], words: str, say: Say) -> None:
    jobs: list[Future[object]] = [pool.submit(task) for task in tasks]
    for done, job in enumerate(as_completed(jobs), start=1):
        if isinstance(error := job.exception(), BrokenProcessPool):
            raise error
        say(f"{words}: {done} of {len(jobs)}", share=done / len(jobs))


def _first_tasks(plans: Sequence[Plan]) -> Iterator[Task]:
    """References, which take longest, first."""
    begun: list[tuple[Case, str, bool]] = []
    for plan in plans:
        for case in (*plan.cases, *_atlas_cases(plan)):
            asked = (case, plan.reference, plan.atlas)
            if asked not in begun:
                begun.append(asked)
                yield partial(_refer, plan, case)
    for plan in plans:
        for case in plan.cases:
            yield from (partial(_compile, case, together) for together in _together(plan.contenders))


def _atlas_cases(plan: Plan) -> Iterator[Case]:
    for case in plan.cases if plan.atlas else ():
        grid = grid_of(plan, case)
        yield from (with_value(case, grid.parameter, value) for value in grid.values)


def _together(contenders: Sequence[Contender]) -> list[list[Contender]]:
    """Groups of contenders that one process should prepare: the reduced models of a method are steps of one reduction sequence."""
    found: dict[tuple[str, str], list[Contender]] = {}
    for contender in contenders:
        part = contender.name.partition("/")[0] if contender.group == "reductions" else contender.name
        found.setdefault((contender.group, part), []).append(contender)
    return list(found.values())


def _refer(plan: Plan, case: Case) -> None:
    find = atlas_reference(plan) if plan.atlas else partial(case_reference, plan)
    find(case)


def _compile(case: Case, contenders: Sequence[Contender]) -> None:
    for contender in contenders:
        with suppress(RunError, ModelError, ToolchainError):  # also NoReductionError
            contender.prepare(case)


def _second_tasks(plans: Sequence[Plan], measurements: Path) -> Iterator[Task]:
    """Tasks that take simulators and references."""
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
