"""Tables in files: comma-separated numbers below a line of names, each with the unit of its column, such as ``travel [mm]``.

Lines that are empty or start with ``#`` do not count.
"""

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

from cutjoint.model.document.source import Path
from cutjoint.model.document.values import MAX_FIELD, MAX_GRID, MAX_TABLE
from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.expressions.units import Dimension, Quantity, UnitError, measure
from cutjoint.model.records import Span
from cutjoint.model.text import is_number

MAX_ROWS = 50_000  #: rows of a table below its names
_MAX_REPORTED = 20  #: problems of one table that are reported

_HEADER = re.compile(r"([^\[\]]+?)\s*(?:\[\s*([^\[\]]*?)\s*\])?")
#: The places of values, and those of keys.
Places: TypeAlias = tuple[dict[Path, Span], dict[Path, Span]]


@dataclass(frozen=True)
class Cell:
    """The text of a cell without the blanks around it, and its place."""

    text: str
    span: Span


@dataclass(frozen=True)
class Column:
    """A column; ``values`` are in SI units if it has numbers.
    ``dimension`` is that of its unit, None without one; ``span`` is the place of its name."""

    name: str
    span: Span
    dimension: Dimension | None
    cells: tuple[Cell, ...]
    values: tuple[float, ...]


@dataclass(frozen=True)
class Csv:
    """A table by columns; ``file`` is the name that its places carry."""

    file: str
    columns: tuple[Column, ...]

    @property
    def names(self) -> list[str]:
        """The names of the columns."""
        return [column.name for column in self.columns]


def read_csv(text: str, file: str, element: str, texts: tuple[str, ...] = ()) -> Csv:
    """Read a table for an ``element``; the columns of ``texts`` have texts, all others numbers.
    Raises ModelError: all that is wrong with it."""
    return _Reading(file, element, texts).table(text)


class _Reading:
    def __init__(self, file: str, element: str, texts: tuple[str, ...]) -> None:
        self.file, self.element, self.texts = file, element, texts
        self.problems: list[Problem] = []

    def table(self, text: str) -> Csv:
        lines = list(self._lines(text))
        if len(lines) < 2:
            start = Span(file=self.file, line=1, column=1)
            self._fail(start, "the table has no rows", "write a line of names, and a row of numbers below it")
            raise ModelError(self.problems)
        header, *rows = lines
        if len(rows) > MAX_ROWS:
            self._fail(rows[MAX_ROWS][0].span, f"the table has more than {MAX_ROWS} rows", "leave some out")
        else:
            self._check_rows(header, rows)
        if self.problems:
            raise ModelError(self.problems)
        columns = tuple(self._column(cell, tuple(row[i] for row in rows)) for i, cell in enumerate(header))
        for i, column in enumerate(columns):
            if column.name and column.name in (other.name for other in columns[:i]):
                self._fail(column.span, f"two columns are called '{column.name}'", "rename one of them")
        if self.problems:
            raise ModelError(self.problems[:_MAX_REPORTED])
        return Csv(self.file, columns)

    def _fail(self, span: Span, message: str, hint: str) -> None:
        self.problems.append(Problem(span=span, element=self.element, message=message, hint=hint))

    def _lines(self, text: str) -> Iterator[list[Cell]]:
        """The cells of each line that counts."""
        for number, line in enumerate(text.replace("\r\n", "\n").split("\n"), start=1):
            if line.strip() and not line.lstrip().startswith("#"):
                yield list(self._cells(line, number))

    def _cells(self, line: str, number: int) -> Iterator[Cell]:
        column = 1
        for part in line.split(","):
            text = part.strip(" \t")
            indent = len(part) - len(part.lstrip(" \t")) if text else 0
            yield Cell(text, Span(file=self.file, line=number, column=column + indent))
            column += len(part) + 1

    def _check_rows(self, header: list[Cell], rows: list[list[Cell]]) -> None:
        if len(header) == 1 and ";" in header[0].text:
            self._fail(header[0].span, "commas separate the cells of a table, and decimals have a point", "replace semicolons by commas")
            return
        for row in rows:
            if len(row) != len(header) and len(self.problems) < _MAX_REPORTED:
                message = f"the row has {len(row)} cells, the line of names {len(header)}"
                self._fail(row[min(len(row), len(header)) - 1].span, message, "write as many")

    def _column(self, header: Cell, cells: tuple[Cell, ...]) -> Column:
        match = _HEADER.fullmatch(header.text)
        if match is None or '"' in header.text or not header.text.isprintable():
            self._fail(header.span, f"'{header.text}' is not a column's name", "write for example travel [mm], without quotes")
            return Column("", header.span, None, cells, ())
        if match[1] in self.texts:
            return Column(match[1], header.span, None, cells, ())
        factor = self._unit(header.span, match[2])
        values = tuple(self._value(cell, match[2], factor) for cell in cells)
        return Column(match[1], header.span, None if match[2] is None else factor, cells, values)

    def _unit(self, span: Span, unit: str | None) -> Dimension | None:
        try:
            return None if unit is None else measure(1.0, unit).dimension
        except UnitError as error:
            self._fail(span, str(error), "write for example [mm] or [N*s/m]")
            return None

    def _value(self, cell: Cell, unit: str | None, dimension: Dimension | None) -> float:
        if not is_number(cell.text):
            problem, hint = ("a cell is empty", "write a number, or leave the row out") if not cell.text else (
                f"'{cell.text[:30]}' is not a number", "write plain decimal numbers, such as -0.5 or 1e-3"
            )  # fmt: skip
            self._fail(cell.span, problem, hint)
            return math.nan
        value = float(cell.text)
        if dimension is not None and unit is not None:
            try:
                value = Quantity.of(measure(value, unit).value, dimension, f"{cell.text} {unit}")
            except UnitError:
                value = math.inf
        if not math.isfinite(value):
            self._fail(cell.span, f"'{cell.text[:30]}' is out of range", "write a smaller number")
        return value


# Tables of laws and roads: their columns as lists; of two variables a row of the file for each pair.


def as_lists(columns: Mapping[str, Column], element: str, *, is_law: bool = True) -> tuple[dict[str, Any], Places]:
    """The lists of a table by name, and their places, for an ``element``: a table of a law, or of heights of a road.
    Raises ModelError: it has too many rows, or not one for each pair of two variables."""
    others = [name for name in columns if name != "value"]
    limit = MAX_FIELD if not is_law else MAX_GRID if len(others) == 2 else MAX_TABLE
    for column in columns.values():
        if len(column.cells) > limit:
            message = f"the table has {len(column.cells)} rows, and {'a law' if is_law else 'a road'} at most {limit} points"
            hint = "leave rows out where the curve is straight" if is_law else "take a coarser grid"
            raise ModelError([Problem(span=column.cells[limit].span, element=element, message=message, hint=hint)])
    heads: dict[Path, Span] = {(name,): column.span for name, column in columns.items()}
    if "value" in columns and len(others) == 2:
        grid = _Grid(others[0], columns[others[0]], others[1], columns[others[1]], columns["value"], element)
        return grid.lists(), ({**heads, **grid.places()}, heads)
    cells: dict[Path, Span] = {(name, i): cell.span for name, column in columns.items() for i, cell in enumerate(column.cells)}
    return {name: column.values for name, column in columns.items()}, ({**heads, **cells}, heads)


@dataclass(frozen=True)
class _Grid:
    """Values over two variables, in rows that are sorted by the first, then by the second one."""

    first: str
    firsts: Column
    second: str
    seconds: Column
    values: Column
    element: str

    def lists(self) -> dict[str, Any]:
        """The values of both variables, and a row of values for each of the first one."""
        problems = list(self._faults())
        if problems:
            raise ModelError(problems[:1])
        width = self._width
        starts = range(0, len(self.firsts.values), width)
        return {
            self.first: tuple(self.firsts.values[start] for start in starts),
            self.second: self.seconds.values[:width],
            "value": tuple(self.values.values[start : start + width] for start in starts),
        }

    def places(self) -> dict[Path, Span]:
        """The places of all that `lists` has."""
        width, found = self._width, dict[Path, Span]()
        for row, (first, second, value) in enumerate(zip(self.firsts.cells, self.seconds.cells, self.values.cells, strict=True)):
            i, j = divmod(row, width)
            found.setdefault((self.first, i), first.span)
            found.setdefault(("value", i), value.span)
            found.setdefault((self.second, j), second.span)
            found["value", i, j] = value.span
        return found

    @property
    def _width(self) -> int:
        """The number of rows that have the first variable's first value."""
        values = self.firsts.values
        return next((row for row, value in enumerate(values) if value != values[0]), len(values))

    def _faults(self) -> Iterator[Problem]:
        """Rows that are not sorted, and those with another value of the second variable than the grid has there."""
        width, first, second = self._width, self.firsts.values, self.seconds.values
        for row in range(1, len(first)):
            before, is_new = row - 1, row % width == 0
            if (first[row] != first[before]) is not is_new:
                yield self._hole(row)
            elif is_new and first[row] < first[before]:
                yield self._unsorted(row, self.firsts)
            elif not is_new and second[row] <= second[before]:
                yield self._unsorted(row, self.seconds)
            elif second[row] != second[row % width]:
                yield self._hole(row)
        if len(first) % width:
            yield self._hole(len(first) - 1)

    def _hole(self, row: int) -> Problem:
        message = f"the table has a hole: it needs a row for each pair of {self.first} and {self.second}"
        hint = f"write the same values of {self.second} for each of {self.first}"
        return Problem(span=self.seconds.cells[row].span, element=self.element, message=message, hint=hint)

    def _unsorted(self, row: int, column: Column) -> Problem:
        message = f"'{column.cells[row].text}' is not larger than the value before"
        return Problem(column.cells[row].span, self.element, message, f"sort the rows by {self.first}, then by {self.second}")
