"""Reports of a bench on its work while it runs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from rich.progress import BarColumn, SpinnerColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn

from cutjoint.commands.options import shown_progress


class Say(Protocol):
    """Receives the present work, and the finished ``share`` of the whole, 0 to 1, where that is known."""

    def __call__(self, text: str, /, *, share: float | None = None) -> None: ...


def silently(text: str, /, *, share: float | None = None) -> None:
    """Reports nothing."""


def part_of(say: Say, number: int, count: int) -> Say:
    """Reports the shares of one of ``count`` equal parts as those of the whole."""

    def say_part(text: str, /, *, share: float | None = None) -> None:
        say(text, share=None if share is None else (number + share) / count)

    return say_part


@contextmanager
def progress_bar() -> Iterator[Say]:
    """A bar on standard error; off a terminal a line from time to time."""
    columns = (SpinnerColumn(), BarColumn(bar_width=20), TaskProgressColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with shown_progress(*columns) as progress:
        task = progress.add_task("preparing", total=1.0)

        def say(text: str, /, *, share: float | None = None) -> None:
            progress.update(task, description=text, completed=share)

        yield say
