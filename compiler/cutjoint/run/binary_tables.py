"""Tables of runs as Parquet, Arrow and NumPy files: the file's ending says which; all others are text."""

import json
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cutjoint.package.extensions import find_package
from cutjoint.run.outputs import OutputError

Array = NDArray[np.float64]


#: Their endings.
BINARY = (".parquet", ".arrow", ".npy")


def require_writer(path: Path) -> None:
    """Check that a table's ending is text, or one whose package is there. Raises OutputError: PyArrow is not installed."""
    if path.suffix in (".parquet", ".arrow"):
        _arrow(path)


def encoded(path: Path, units: Mapping[str, str], rows: Array) -> bytes:
    """The content of a table with this ending: ``rows`` (rows, columns) over the names in ``units``."""
    file = BytesIO()
    if path.suffix == ".npy":  # a record for each row, whose fields are the columns
        np.save(file, np.ascontiguousarray(rows).view([(name, np.float64) for name in units]).reshape(-1))
        return file.getvalue()
    pa = _arrow(path)
    fields = [pa.field(name, pa.float64(), nullable=False, metadata={"unit": unit} if unit else None) for name, unit in units.items()]
    # pandas takes its attributes from there
    schema = pa.schema(fields, metadata={"PANDAS_ATTRS": json.dumps({"units": dict(units)})})
    table = pa.table([pa.array(column) for column in np.ascontiguousarray(rows.T)], schema=schema)
    if path.suffix == ".parquet":
        pa.parquet.write_table(table, file, compression="zstd")
    else:
        with pa.ipc.new_file(file, schema) as writer:
            writer.write_table(table)
    return file.getvalue()


def read_columns(path: Path) -> dict[str, Array]:
    """The columns of such a table, by name."""
    if path.suffix == ".npy":
        table = np.load(path, allow_pickle=False)
        return {name: table[name] for name in table.dtype.names or ()}
    pa = _arrow(path)
    read = pa.parquet.read_table if path.suffix == ".parquet" else pa.feather.read_table
    table = read(path)
    return {name: table[name].to_numpy() for name in table.column_names}


def _arrow(path: Path) -> Any:
    advice = "pip install 'cutjoint[data]', or write a table in .csv or .npy"
    error = OutputError(f"{path}: tables in {path.suffix} need PyArrow, which is not installed; {advice}")
    return find_package("pyarrow", "pyarrow.feather", "pyarrow.ipc", "pyarrow.parquet", otherwise=error)
