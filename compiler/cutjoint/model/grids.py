"""The columns of a file's table as the lists that a law's table has; of two variables a row of the file for each pair."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

from cutjoint.model.csv_table import Column
from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.records import Span
from cutjoint.model.source import Path
from cutjoint.model.values import MAX_GRID, MAX_TABLE

#: The places of values, and those of keys.
Places: TypeAlias = tuple[dict[Path, Span], dict[Path, Span]]


def as_lists(columns: Mapping[str, Column], element: str) -> tuple[dict[str, Any], Places]:
    """The lists of a table by name, and their places, for an ``element``.

    Raises:
        ModelError: it has too many rows, or not one for each pair of two variables.
    """
    others = [name for name in columns if name != "value"]
    limit = MAX_GRID if len(others) == 2 else MAX_TABLE
    for column in columns.values():
        if len(column.cells) > limit:
            message = f"the table has {len(column.cells)} rows, and a law at most {limit} points"
            hint = "leave rows out where the curve is straight"
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
        return Problem(
            span=column.cells[row].span, element=self.element, message=message, hint=f"sort the rows by {self.first}, then by {self.second}"
        )
