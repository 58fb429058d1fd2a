"""The tables of a batch: parameters in, results of runs out; CSV."""

import csv
import io
from collections.abc import Callable, Mapping, Sequence
from math import isfinite, nan
from pathlib import Path
from types import TracebackType
from typing import Any

from cutjoint.model.records import Model
from cutjoint.model.text import read_number
from cutjoint.package.errors import RunError, plural
from cutjoint.run.outputs import OutputError
from cutjoint.run.result_files import open_table, write_all
from cutjoint.run.run_file import parameter_values
from cutjoint.run.simulator import failure_of

#: The values that the results of a run have for each column, and their names in a table.
_KINDS = {"end": "end", "min": "minimum", "max": "maximum"}
#: Called with a fault and what to do.
Fail = Callable[[str, str], None]


def read_cases(path: Path, model: Model) -> list[dict[str, float]]:
    """The cases of a table with parameters as columns and a row (SI units) for each run; blank lines are skipped.
    Raises RunError: a name or a number is wrong; the message has its line."""

    def fail(message: str, hint: str) -> None:
        raise RunError(f"{message}; {hint}")

    (line, names), *rows = read_rows(path, fail)
    place = f"{path}:{line}"
    for i, name in enumerate(names):
        if not name:
            fail(f"{place}: column {i + 1} has no name", "write a parameter above it, or remove the comma")
        if name in names[:i]:
            fail(f"{place}: parameter '{name}' stands above two columns", "remove one")
        try:
            parameter_values(model, {name: 0.0})
        except RunError as error:
            raise RunError(f"{place}: {error}") from None
    return [dict(zip(names, read_numbers(f"{path}:{line}", names, row, fail), strict=True)) for line, row in rows]


def read_rows(path: Path, fail: Fail) -> list[tuple[int, list[str]]]:
    """The lines of a CSV file that are not blank, the names first, each with its number; none after a fault."""
    if path.is_char_device():
        fail(f"{path}: a device, which has no end", "name a file")
        return []
    fault: tuple[str, str] | None = None
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            reader = csv.reader(stream, skipinitialspace=True)
            rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader if any(cell.strip() for cell in row)]
    except OSError as error:
        fault = f"{path} cannot be read: {error.strerror}", "write the path of a table; in a study, from the study's folder"
    except (UnicodeDecodeError, csv.Error) as error:
        fault = f"{path}: not a table in UTF-8: {error}", "save it as CSV UTF-8, with commas"
    if fault is None:
        if len(rows) > 1:
            return rows
        fault = f"{path}: no runs", "write the names of parameters in the first line and a line of numbers for each run"
    fail(*fault)
    return []


def read_numbers(place: str, names: Sequence[str], row: Sequence[str], fail: Fail) -> list[float]:
    """The numbers of a line, NaN after a fault."""
    if len(row) != len(names):
        fail(f"{place}: {plural(len(row), 'value')} for {plural(len(names), 'column')}", f"write values of {', '.join(names)}")
        return [nan] * len(names)
    values = []
    for name, text in zip(names, row, strict=True):
        try:
            values.append(read_number(text))
        except ValueError:
            values.append(nan)
        if not isfinite(values[-1]):
            fail(f"{place}: column '{name}': '{text[:40]}' is not a finite number", "write a plain number in SI units")
    return values


class CaseTable:
    """The table of a batch's results: a row for each case with its parameters, how its run ended, and values of each column.

    Rows are in the order of the ``cases``; each is written as soon as its results and all earlier ones are available. A second file has the
    units. Raises OutputError: the table cannot be written.
    """

    def __init__(self, path: Path, cases: Sequence[Mapping[str, float]], units: Mapping[str, str]) -> None:
        self._cases = cases
        self._blank = [None] * len(units)
        self._waiting: dict[int, Mapping[str, Any]] = {}
        self._written = 0
        columns = {f"{name}.{kind}": unit for name, unit in units.items() for kind in _KINDS}
        self._table = open_table(path, columns)
        self._write([[*(cases[0] if cases else ()), "run.failure", "run.evaluations", *columns]])

    def take(self, first: int, results: Sequence[Mapping[str, Any]]) -> None:
        """The results of the cases from ``first`` on."""
        self._waiting.update(enumerate(results, first))
        rows = []
        while self._written in self._waiting:
            rows.append(self._row(self._written))
            self._written += 1
        self._write(rows)

    def finish(self) -> Path:
        """Complete the table, and return its file."""
        return self._table.finish()

    def _row(self, number: int) -> list[str]:
        result = self._waiting.pop(number)
        columns = zip(*(result.get(kind, self._blank) for kind in _KINDS.values()), strict=True)
        values = ["" if value is None else repr(float(value)) for column in columns for value in column]
        return [*map(repr, self._cases[number].values()), str(failure_of(result) or ""), str(result.get("evaluations", 0)), *values]

    def _write(self, rows: Sequence[Sequence[str]]) -> None:
        text = io.StringIO(newline="")
        csv.writer(text, lineterminator="\n").writerows(rows)
        try:
            write_all(self._table.file, text.getvalue().encode())
        except OSError as error:
            raise OutputError(f"cannot write {self._table.path}: {error.strerror}") from None

    def __enter__(self) -> "CaseTable":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """Leave the completed rows of an interrupted batch in a file, including those that waited for earlier ones."""
        if error is None:
            return
        if not isinstance(error, OutputError):
            self._write([self._row(number) for number in sorted(self._waiting)])
        if left := self._table.leave(str(error) or "interrupted"):
            with left.open(encoding="utf-8", newline="") as table:
                rows = sum(1 for _ in csv.reader(table)) - 1
            error.add_note(f"the results of {rows} of {plural(len(self._cases), 'run')} are in {left}")
