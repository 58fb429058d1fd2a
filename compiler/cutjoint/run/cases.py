"""The tables of a batch: parameters in, how runs ended out; CSV."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Mapping, Sequence
from math import isfinite
from pathlib import Path

from cutjoint.model.numbers import read_number
from cutjoint.model.records import Model
from cutjoint.run.results import Array, Batch
from cutjoint.run.run_file import RunError, parameter_values


def read_cases(path: Path, model: Model) -> list[dict[str, float]]:
    """The cases of a table with a parameter's name above each column and a row of numbers (SI units) for each run; blank lines count not.

    Raises:
        RunError: a name or a number is none, with the line where it stands.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            reader = csv.reader(stream, skipinitialspace=True)
            rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader if any(cell.strip() for cell in row)]
    except (UnicodeDecodeError, csv.Error) as error:
        raise RunError(f"{path}: not a table in UTF-8: {error}; save it as CSV UTF-8, with commas") from None
    if len(rows) < 2:
        raise RunError(f"{path}: no runs; write the names of parameters in the first line and a line of numbers for each run")
    line, names = rows[0]
    _check_names(f"{path}:{line}", names, model)
    return [_case(f"{path}:{line}", names, row) for line, row in rows[1:]]


def _check_names(place: str, names: Sequence[str], model: Model) -> None:
    for i, name in enumerate(names):
        if not name:
            raise RunError(f"{place}: column {i + 1} has no name; write a parameter above it, or take the comma away")
        if name in names[:i]:
            raise RunError(f"{place}: parameter '{name}' stands above two columns; leave one away")
        try:
            parameter_values(model, {name: 0.0})
        except RunError as error:
            raise RunError(f"{place}: {error}") from None


def _case(place: str, names: Sequence[str], row: Sequence[str]) -> dict[str, float]:
    if len(row) != len(names):
        raise RunError(f"{place}: {len(row)} values for {len(names)} parameters; write one for each of {', '.join(names)}")
    return {name: _number(place, name, text) for name, text in zip(names, row, strict=True)}


def _number(place: str, name: str, text: str) -> float:
    try:
        value = read_number(text)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise RunError(f"{place}: parameter '{name}': '{text}' is not a finite number; write a plain number in SI units")
    return value


def write_results(batch: Batch, path: Path) -> None:
    """A row for each run: its parameters, what became of it, and end, smallest and largest value of each column; units beside it."""
    tables = [(f"{name}.{kind}", values[name], unit) for name, unit in batch.units.items() for kind, values in _kinds(batch)]
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow([*batch.names, "run.failure", "run.evaluations", *(name for name, _, _ in tables)])
        for i, case in enumerate(batch.cases):
            values = [_text(float(table[i])) for _, table, _ in tables]
            writer.writerow([*map(repr, case.values()), batch.failures[i] or "", batch.evaluations[i], *values])
    units = {name: unit for name, _, unit in tables}
    path.with_suffix(".units.json").write_text(json.dumps(units, indent=2) + "\n", encoding="utf-8")


def _kinds(batch: Batch) -> Iterable[tuple[str, Mapping[str, Array]]]:
    return ("end", batch.end), ("min", batch.smallest), ("max", batch.largest)


def _text(value: float) -> str:
    return repr(value) if isfinite(value) else ""
