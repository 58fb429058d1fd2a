"""The common parts of commands: reports of errors, progress, values of parameters."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import wraps
from math import ceil
from pathlib import Path
from threading import Event, Thread
from time import monotonic
from typing import TYPE_CHECKING, Any

import click
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress, ProgressColumn, Task, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from cutjoint.model.ranges import fault_of
from cutjoint.model.text import escaped_lines, is_number, read_number
from cutjoint.package.errors import CutjointError, RunError
from cutjoint.run.outputs import descriptor_of

if TYPE_CHECKING:
    from cutjoint.model.records import Model, Scene
    from cutjoint.view.views import ViewSpec


class _PlainConsole(Console):
    """Prints texts as they are but for control characters: names in files and arguments do not move a terminal."""

    def print(self, *objects: Any, markup: bool | None = False, **how: Any) -> None:
        super().print(*(escaped_lines(x) if isinstance(x, str) else x for x in objects), markup=markup, **how)

    def print_each(self, parts: Iterable[object]) -> None:
        """Print tables and other parts, each on lines of its own."""
        for part in parts:
            self.print(part if isinstance(part, Table) else str(part))


#: Seconds between two progress lines.
EVERY = 10.0

out = _PlainConsole(highlight=False, soft_wrap=True)
err = _PlainConsole(stderr=True, highlight=False, soft_wrap=True)


def reports_errors(command: Callable[..., Any]) -> Callable[..., Any]:
    """Errors that the user can correct end in their message and exit status 1."""

    @wraps(command)
    def wrapped(*args: Any, **kwargs: Any) -> Any:
        try:
            return command(*args, **kwargs)
        except (click.ClickException, KeyboardInterrupt, SystemExit):
            raise
        except (CutjointError, OSError) as error:
            err.print(describe_error(error))
            raise SystemExit(1) from None

    return wrapped


def describe_error(error: BaseException) -> str:
    """The text of an error, followed by the partial results and where they are."""
    return "\n".join([str(error), *getattr(error, "__notes__", ())])


def is_watched() -> bool:
    """Return whether a person sees what happens: scripts get the same bytes on all machines, however fast, and leave no process behind."""
    return err.is_terminal


def message_console(*outputs: Path | None) -> _PlainConsole:
    """The console for messages: standard error if standard output takes results."""
    return err if any(path is not None and descriptor_of(path) == 1 for path in outputs) else out


def choose_case(model: "Model", name: str | None) -> "tuple[Model, Scene]":
    """The scene of that name and the model with its guides; without a name the first scene, with a message if there are others.
    Raises RunError: there is no such scene."""
    from cutjoint.run.scenes import find_case

    case, chosen = find_case(model, next(iter(model.scenes), None) if name is None else name)
    if name is None and len(model.scenes) > 1:
        err.print(f"scene {chosen.name}, the first of {len(model.scenes)}; choose another with --scene")
    return case, chosen


@contextmanager
def progress_bar(label: str) -> Iterator[Callable[[float], None]]:
    """A progress bar on standard error; yields the function that moves it. Compilation meanwhile is counted, with a forecast."""
    from cutjoint.toolchain.progress import Compiling, listening

    with shown_progress(*Progress.get_default_columns()[:-1], _Remaining()) as bar:
        words = escape(escaped_lines(label))
        task = bar.add_task(words, total=None, end=None)

        def count(now: Compiling) -> None:
            end = None if now.seconds is None else monotonic() + now.seconds
            described = f"{words} and, once, the parts common to all models" if now.share else words
            bar.update(task, total=now.total, completed=now.done, end=end, description=described)

        with listening(count):
            yield lambda share: bar.update(task, total=1.0, completed=share, end=None)


def write_view(view: Path, name: str, show: "Callable[[], ViewSpec]", *outputs: Path | None) -> None:
    """Write what ``show`` gives of the model of a ``name`` as a page or a glTF file; ``outputs`` are other files of the command."""
    from cutjoint.view.views import write_shown

    with progress_bar(f"drawing {name}"):
        write_shown(view, show())
    message_console(view, *outputs).print(f"view: {view}")


@contextmanager
def shown_progress(*columns: ProgressColumn) -> Iterator[Progress]:
    """Progress bars on standard error; without a terminal, a line every few seconds."""
    with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as bar:
        ended = Event()
        writer = Thread(target=_write_lines, args=(bar, ended), daemon=True)
        if not err.is_terminal:
            writer.start()
        try:
            yield bar
        finally:
            ended.set()
            if writer.ident is not None:
                writer.join()


def _write_lines(bar: Progress, ended: Event) -> None:
    begun = monotonic()
    while not ended.wait(EVERY):
        for task in bar.tasks:
            share = "" if task.total is None else f" {task.percentage:.0f} %,"
            err.print(Text(f"{Text.from_markup(task.description)}:{share} {monotonic() - begun:.0f} s so far"))


class _Remaining(TimeRemainingColumn):
    """The remaining time: a forecast if there is one, else extrapolated from the elapsed time."""

    def render(self, task: Task) -> Text:
        """Render the time as minutes and seconds."""
        if (end := task.fields["end"]) is None:
            return super().render(task)
        minutes, seconds = divmod(max(0, ceil(end - monotonic())), 60)
        return Text(f"{minutes // 60:d}:{minutes % 60:02d}:{seconds:02d}", style="progress.remaining")


def read_parameters(changes: tuple[str, ...], option: str = "--set") -> dict[str, float]:
    """The values of NAME=VALUE by name: numbers in SI units, or other notations of model files, `Quantity` with a unit.
    Raises RunError: an argument is not NAME=VALUE, a value is not finite, or a name has two."""
    parameters: dict[str, float] = {}
    for change in changes:
        name, _, text = change.partition("=")
        try:
            value = _read_value(text.strip())
            fault = fault_of(value)
        except ValueError as error:
            fault = f"{f'{error}; ' if text.strip() else ''}write NAME=NUMBER, with a unit or without"
        if not fault and name in parameters:
            fault = f"'{name}' is set twice; write one of the two"
        if fault:
            raise RunError(f"{option} {change}: {fault}")
        parameters[name] = value
    return parameters


def read_masses(links: tuple[str, ...]) -> dict[str, float]:
    """The masses (kg) of --link-mass by the names of bodies. Raises RunError: as of `read_parameters`, or a mass has another unit."""
    masses = read_parameters(links, "--link-mass")
    from cutjoint.model.expressions.units import fault_of_dimension

    for name, mass in masses.items():
        if fault := fault_of_dimension(mass, "kg"):
            raise RunError(f"--link-mass {name}: {fault}")
    return masses


def _read_value(text: str) -> float:
    """A number as typed, or an expression of a model file without names; ValueError otherwise."""
    if not text or is_number(text):
        return read_number(text)
    from cutjoint.model.expressions.parse import read_term
    from cutjoint.model.expressions.units import Quantity

    term = read_term(text, {})
    assert term.number is not None  # an expression without names is a number
    return term.number if term.dimension is None else Quantity.of(term.number, term.dimension, text)
