"""Measurements from files: CSV, Parquet, Arrow and NumPy tables, and MDF4."""

import csv
from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

import numpy as np

from cutjoint.fits.records import Array
from cutjoint.model.errors import nearest
from cutjoint.package.errors import RunError, plural
from cutjoint.package.extensions import find_package
from cutjoint.run.binary_tables import BINARY, read_columns

#: From the name of a column to its times, as they stand in the file, and its values, NaN where one is missing.
Columns: TypeAlias = Callable[[str], tuple[Array, Array]]


def read_data(path: Path, time: str) -> Columns:
    """The columns of a file; ``time`` is that of a table's times, "" of a table without.
    Raises RunError: it cannot be read, or has no such column; the message names the file."""
    try:
        return _mdf(path) if path.suffix.lower() in (".mf4", ".mdf", ".dat") else _table(path, time)
    except FileNotFoundError:
        raise RunError(f"there is no file {path}; write its path from the folder of the study") from None
    except (OSError, UnicodeDecodeError, csv.Error, ValueError) as error:
        raise RunError(f"{path}: it cannot be read: {error}") from None


def _table(path: Path, time: str) -> Columns:
    found = read_columns(path) if path.suffix in BINARY else _csv(path)

    def column(name: str) -> tuple[Array, Array]:
        for each in filter(None, (name, time)):
            if each not in found:
                raise RunError(f"{path}: there is no column '{each}'; {nearest(each, found, 'it has')}")
        values = np.asarray(found[name], dtype=float)
        return np.asarray(found[time], dtype=float) if time else np.arange(len(values), dtype=float), values

    return column


def _csv(path: Path) -> dict[str, Array]:
    """The columns of a text table; an empty cell is a missing sample.  Columns without names are called by their numbers, from 1."""
    with path.open(encoding="utf-8-sig", newline="") as stream:
        first = stream.readline()
        stream.seek(0)
        rows = csv.reader(stream, skipinitialspace=True, delimiter=next((mark for mark in ",;\t" if mark in first), " "))
        read = [(rows.line_num, [cell.strip() for cell in row]) for row in rows if row]
    if not read:
        raise ValueError("it is empty; write a line of names, then a line of numbers for each sample")
    names = read.pop(0)[1] if not all(map(_is_number, read[0][1])) else [str(i + 1) for i in range(len(read[0][1]))]
    if twice := [name for i, name in enumerate(names) if name and name in names[:i]]:
        raise ValueError(f"two columns are named '{twice[0]}'; rename or remove one")
    for line, row in read:
        if len(row) != len(names):
            raise ValueError(f"line {line} has {plural(len(row), 'value')} for {plural(len(names), 'name')}")
        if wrong := [cell for cell in row if not _is_number(cell)]:
            raise ValueError(f"line {line}: '{wrong[0]}' is no number; below its first line of names it has numbers alone, as in 0.5")
    numbers = np.array([[float(cell) if cell else np.nan for cell in row] for _, row in read]).reshape(-1, len(names))
    return dict(zip(names, numbers.T, strict=True))


def _is_number(cell: str) -> bool:
    try:
        float(cell or 0)
    except ValueError:
        return False
    return True


def _mdf(path: Path) -> Columns:
    words = f"{path}: MDF files need the package asammdf: pip install 'cutjoint[mdf]'"
    asammdf = find_package("asammdf", otherwise=RunError(words))
    try:
        file = asammdf.MDF(path)
    except asammdf.blocks.utils.MdfException as error:
        raise ValueError(error) from None

    def column(name: str) -> tuple[Array, Array]:
        if (count := len(file.channels_db.get(name, ()))) > 1:
            raise RunError(f"{path}: {count} groups have a channel '{name}'; save one of them alone, for example by MDF.filter of asammdf")
        if not count:
            raise RunError(f"{path}: there is no channel '{name}'; {nearest(name, file.channels_db, 'it has')}")
        if (found := file.get(name)).samples.dtype.kind not in "biuf" or found.samples.ndim != 1:
            raise RunError(f"{path}: the samples of channel '{name}' are no numbers")
        return np.asarray(found.timestamps, dtype=float), np.asarray(found.samples, dtype=float)

    return column
