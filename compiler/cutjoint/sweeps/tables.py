"""Tables of numbers that users write: names above columns."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from math import isfinite, nan
from pathlib import Path

import numpy as np

from cutjoint.model.text import read_number
from cutjoint.sweeps.records import Array

#: Notes what is wrong, and what to do.
Fail = Callable[[str, str], None]


def read_numbers(path: Path, fail: Fail) -> tuple[list[str], Array]:
    """Names and numbers (rows, names) of a CSV file (SI units); blank lines count not.  ``fail`` is told what is wrong, with its line."""
    empty: tuple[list[str], Array] = ([], np.zeros((0, 0)))
    if path.is_char_device():
        fail(f"{path} is a device, which has no end", "name a file")
        return empty
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            reader = csv.reader(stream, skipinitialspace=True)
            rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader if any(cell.strip() for cell in row)]
    except OSError as error:
        fail(f"{path} cannot be read: {error.strerror}", "write its path from the folder of the study")
        return empty
    except (UnicodeDecodeError, csv.Error) as error:
        fail(f"{path} is not a table in UTF-8: {error}", "save it as CSV UTF-8, with commas")
        return empty
    if len(rows) < 2:
        fail(f"{path} has no runs", "write names in the first line and a line of numbers for each run")
        return empty
    names = rows[0][1]
    return names, np.array([_numbers(f"{path}:{line}", names, row, fail) for line, row in rows[1:]], dtype=float)


def _numbers(place: str, names: Sequence[str], row: Sequence[str], fail: Fail) -> list[float]:
    if len(row) != len(names):
        fail(f"{place}: {len(row)} values for {len(names)} names", "write one for each")
        return [nan] * len(names)
    values = []
    for name, text in zip(names, row, strict=True):
        try:
            values.append(read_number(text))
        except ValueError:
            values.append(nan)
        if not isfinite(values[-1]):
            fail(f"{place}: {name}: '{text[:40]}' is not a finite number", "write a plain number in SI units")
    return values
