"""`cutjoint sweep`."""

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from rich.progress import BarColumn, MofNCompleteColumn, SpinnerColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from cutjoint.commands import options, table
from cutjoint.package.errors import RunError, plural
from cutjoint.run.outputs import OutputError, require_apart
from cutjoint.run.result_files import write_whole
from cutjoint.sweeps.designs import QUANTILES, find_indices, find_tolerance
from cutjoint.sweeps.reading import read_study
from cutjoint.sweeps.records import Study
from cutjoint.sweeps.run import Progress as OnProgress
from cutjoint.sweeps.run import Sweep, perform_study, steps_of
from cutjoint.view.views import read_ghost

#: Number of reasons of failures to print, and the pattern of numbers, by which similar reasons may differ.
_REASONS = 5
_LARGEST = 10
_NUMBER = re.compile(r"[-+]?[\d.]+(?:e[-+]?\d+)?")


@table.command("sweep")
def command(
    study: Path, out: Path | None, scheduler: str | None, threads: int | None, view: Path | None, replay: int | None,
    ghost_page: Path | None, replays: int, functions: Path | None,
) -> None:  # fmt: skip
    """Make all runs of STUDY, a file of variables, a design and objectives, and write a table with a row for each.

    A repeated call continues where the last one stopped.
    """
    out = Path(f"{study.stem}.parquet") if out is None else out
    if threads is not None and scheduler is not None:
        raise RunError("--threads applies to this machine; the workers of --scheduler have their own")
    read = read_study(study, functions=functions)
    options.err.print_each(read.model.notes)
    model = study.parent / read.model.span.file
    require_apart({"the study": study, "the model": model, "the page of another run": ghost_page},
        documents=[("--out", out), ("--view", view)])
    if replay is not None:
        from cutjoint.sweeps.page import replay as replay_run

        view = Path(f"{study.stem}-run-{replay}.html") if view is None else view
        ghost = read_ghost(ghost_page, view)
        with options.progress_bar(f"running {read.model.name}"):
            replay_run(read, replay, view, ghost)
        options.out.print(f"view: {view}")
        return
    if ghost_page is not None:
        raise RunError(f"--ghost {ghost_page}: it needs --replay, whose page shows it")
    if view is not None and view.suffix != ".html":
        raise OutputError(f"--view {view}: no such kind of file; write a name that ends in .html")
    with _progress(read) as (advance, note):
        done = perform_study(read, out, scheduler=scheduler, threads=threads, progress=advance, note=note)
    _report(read, done)
    if "sobol_indices" in done.manifest["design"]:
        _print_indices(read, done)
    if "tolerances" in done.manifest["design"]:
        _print_tolerances(read, done)
    if view is not None:
        _write_page(read, done, view, f"cutjoint sweep {study}", replays)


def _write_page(study: Study, done: Sweep, view: Path, command: str, replays: int) -> None:
    """The page of a sweep and the pages of its best and worst runs, which it links."""
    from cutjoint.sweeps.page import make_page, replay_runs, runs_to_replay

    folder, runs = view.with_name(f"{view.stem}-runs"), runs_to_replay(study, done, replays)
    with _progress(study) as (advance, _):
        ran = replay_runs(study, runs, folder, lambda number: advance(number, len(runs))) if runs else {}
    options.out.print(f"view: {write_whole(view, make_page(study, done, command, ran))}")
    if ran:
        options.out.print(f"replays: {len(ran)} of the best and worst runs in {folder}")


@contextmanager
def _progress(study: Study) -> Iterator[tuple[OnProgress, Callable[[str], None]]]:
    """A bar with a forecast, and the function that writes a line above it."""
    columns = (
        SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("runs,"), TimeElapsedColumn(),
        TextColumn("passed,"), TimeRemainingColumn(), TextColumn("left"),
    )  # fmt: skip
    with options.shown_progress(*columns) as bar:
        task = bar.add_task(f"compiling {study.model.name}", total=None)

        def advance(done: int, runs: int) -> None:
            bar.update(task, description=study.model.name, total=runs, completed=done)

        yield advance, lambda text: bar.console.print(text)


def _report(study: Study, done: Sweep) -> None:
    failed = sum(failure is not None for failure in done.failures)
    if done.performed:
        each = done.seconds / done.performed
        options.out.print(f"{done.performed} runs in {done.elapsed:.3g} s, {1e3 * each:.3g} ms of worker time each")
    else:
        options.out.print("all runs were already done")
    options.out.print(f"results: {done.path}, {plural(study.runs, 'run')}, {plural(len(done.table.column_names), 'column')}")
    options.out.print_each(f"steps of scene '{scene}': {how}" for scene, how in steps_of(done.manifest).items())
    if failed:
        options.out.print(f"{failed} of them failed:")
        for runs in sorted(_group_by_reason(done.failures), key=len, reverse=True)[:_REASONS]:
            like = f"run {runs[0]}" if len(runs) == 1 else f"{len(runs)} like run {runs[0]}"
            options.out.print(f"  {like}: {done.failures[runs[0]]}")


def _print_indices(study: Study, done: Sweep) -> None:
    for objective in study.objectives:
        found = find_indices(done, objective.name)
        title = f"Sobol' indices of {objective.name}, {found.points} points"
        facts = Table("variable", "first order", "95 %", "total", "95 %", title=title, title_justify="left", box=None)
        for i in np.argsort(-found.total, kind="stable"):
            intervals = [f"{low:.3f} to {high:.3f}" for low, high in (found.first_interval[:, i], found.total_interval[:, i])]
            facts.add_row(found.variables[i], f"{found.first[i]:.3f}", intervals[0], f"{found.total[i]:.3f}", intervals[1])
        options.out.print(facts)


def _print_tolerances(study: Study, done: Sweep) -> None:
    """The distribution of each objective by Monte Carlo and by first order, and the variables with the largest parts of the variance."""
    for objective in study.objectives:
        found, unit = find_tolerance(done, objective.name, objective.limits), f" {objective.unit}" if objective.unit else ""
        facts = Table("", "Monte Carlo", "first order", title=f"{objective.name},{unit or ' 1'}", title_justify="left", box=None)
        facts.add_row("mean", f"{found.mean:.6g}", f"{found.first_mean:.6g}, second order {found.second_mean:.6g}")
        facts.add_row("standard deviation", f"{found.deviation:.4g}", f"{found.first_deviation:.4g}")
        for share, value in zip(QUANTILES, found.quantiles, strict=True):
            facts.add_row(f"quantile {100 * share:.3g} %", f"{value:.6g}", "")
        if objective.limits is not None:
            facts.add_row(f"yield, {objective.limits[0]:g} to {objective.limits[1]:g}", f"{found.passed:.2%}", f"{found.first_passed:.2%}")
        for i in np.argsort(-found.shares, kind="stable")[:_LARGEST]:
            facts.add_row(f"variance by {found.variables[i]}", "", f"{found.shares[i]:.1%}")
        options.out.print(facts)


def _group_by_reason(failures: Sequence[str | None]) -> list[list[int]]:
    """Failed runs in groups whose reasons differ by numbers only."""
    found: dict[str, list[int]] = {}
    for run, failure in enumerate(failures):
        if failure is not None:
            found.setdefault(_NUMBER.sub("", failure), []).append(run)
    return list(found.values())
