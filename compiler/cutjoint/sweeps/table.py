"""The table of a sweep: Parquet, in parts while it grows and one file when it is whole, with the manifest in the file.

Parts are written beside and renamed: one that is there is whole.  The bytes of the whole table follow from its rows and the manifest,
whatever parts there were.
"""

from __future__ import annotations

import fcntl
import json
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from cutjoint.run.errors import RunError
from cutjoint.run.outputs import OutputError, is_stream, resolved
from cutjoint.run.result_files import naming_output, write_whole
from cutjoint.sweeps.records import Kind, Study
from cutjoint.sweeps.work import Rows

#: The key of the manifest in a table's metadata.
MANIFEST = b"cutjoint"

#: Bytes of a group of rows, and how many rows it has at most; readers take the groups that they need.
_GROUP_BYTES, _GROUP_ROWS = 16_000_000, 65_536

#: What stands beside a table while it grows.
_FILE = "manifest.json"


def arrow() -> Any:
    """PyArrow.

    Raises:
        RunError: it is not installed.
    """
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise RunError("tables of sweeps need PyArrow: pip install 'cutjoint[sweep]'") from None
    return pyarrow


@dataclass(frozen=True, kw_only=True)
class Layout:
    """The columns of a study's table.

    Number of the run, variables, why and when it failed, objectives, trajectories (their expressions with "(t)").  Units stand in the
    metadata of the fields.
    """

    study: Study
    manifest: Mapping[str, Any]

    @cached_property
    def schema(self) -> Any:
        """The schema with the manifest."""
        pa, study = arrow(), self.study

        def field(name: str, kind: Any, unit: str = "") -> Any:
            return pa.field(name, kind, metadata={"unit": unit} if unit else None)

        variables = [field(v.name, pa.string() if v.kind is Kind.SCENE else pa.float64(), v.unit) for v in study.variables]
        objectives = [field(o.name, pa.float64(), o.unit) for o in study.objectives]
        shown = [field(f"{study.series[i].text}(t)", pa.list_(pa.float64()), study.series[i].unit) for i in study.trajectories]
        text = json.dumps(self.manifest, indent=2)
        return pa.schema(
            [field("run", pa.int64()), *variables, field("failure", pa.string()), field("failure_time", pa.float64(), "s"), *objectives,
             *shown],
            metadata={MANIFEST: text},
        )  # fmt: skip

    @property
    def row_bytes(self) -> int:
        """About how many bytes a row takes."""
        lengths = [-(-_rows_of(scene) // self.study.every) + 1 for scene in self.study.scenes]
        return 8 * (4 + len(self.study.variables) + len(self.study.objectives) + len(self.study.trajectories) * max(lengths))

    @property
    def group_rows(self) -> int:
        """How many rows a group has."""
        return max(1, min(_GROUP_ROWS, _GROUP_BYTES // self.row_bytes))

    def table(self, rows: Rows) -> Any:
        """The rows of a chunk as a table."""
        pa, study = arrow(), self.study
        numbers = pa.array(np.arange(rows.first, rows.first + len(rows.values)))
        variables = [self._variable(v.kind, rows.values[:, i]) for i, v in enumerate(study.variables)]
        objectives = [_nullable(rows.objectives[:, j]) for j in range(len(study.objectives))]
        offsets = pa.array(np.concatenate([[0], np.cumsum(rows.lengths)]).astype(np.int32))
        shown = [pa.ListArray.from_arrays(offsets, pa.array(values)) for values in rows.trajectories]
        columns = [numbers, *variables, pa.array(rows.failures, pa.string()), _nullable(rows.times), *objectives, *shown]
        return pa.Table.from_arrays(columns, schema=self.schema)

    def _variable(self, kind: Kind, values: Any) -> Any:
        if kind is not Kind.SCENE:
            return arrow().array(values)
        return arrow().array([self.study.scenes[int(i)].name for i in values], arrow().string())


def _rows_of(scene: Any) -> int:
    return int(scene.end / scene.output_step) + 2


def _nullable(values: Any) -> Any:
    return arrow().array(values, from_pandas=True)


class Parts:
    """The folder beside a table in which it grows; one command at a time writes it.

    Raises:
        OutputError: it cannot be written, another command writes it, or it is of another study.
    """

    def __init__(self, out: Path, layout: Layout) -> None:
        self.out, self.layout = resolved(out), layout
        self.folder = self.out.with_name(f"{self.out.name}.parts")
        with naming_output(self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)
            self._lock = os.open(self.folder / ".lock", os.O_RDWR | os.O_CREAT, 0o666)
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self._take_over()
        except BlockingIOError:
            os.close(self._lock)
            raise OutputError(f"{self.folder}: another sweep writes this; wait for it, or write elsewhere") from None
        except BaseException:
            os.close(self._lock)
            raise

    def _take_over(self) -> None:
        """Begin, or go on where an earlier call stopped."""
        file, text = self.folder / _FILE, json.dumps(self.layout.manifest, indent=2) + "\n"
        if file.exists():
            require_same(read_json(file), self.layout.manifest, self.folder)
        else:
            write_whole(file, text)
        for leftover in self.folder.glob(".*.parquet.*"):
            leftover.unlink()

    def ranges(self) -> list[tuple[int, int]]:
        """The runs whose rows are there: from the first of each part to the one behind the last, in order."""
        found = []
        for path in sorted(self.folder.glob("*-*.parquet")):
            first, last = (int(text) for text in path.stem.split("-"))
            if self._is_sound(path, last - first):
                found.append((first, last))
            else:
                path.unlink()
        return found

    def _is_sound(self, path: Path, rows: int) -> bool:
        pq, pa = arrow().parquet, arrow()
        try:
            with pq.ParquetFile(path) as file:
                return bool(file.metadata.num_rows == rows and file.schema_arrow.equals(self.layout.schema))
        except (OSError, pa.ArrowInvalid):
            return False

    def write(self, rows: Rows) -> None:
        """The rows of a chunk.

        Raises:
            OutputError: they cannot be written.
        """
        first, last = rows.first, rows.first + len(rows.values)
        buffer = arrow().BufferOutputStream()
        arrow().parquet.write_table(self.layout.table(rows), buffer, compression="zstd")
        write_whole(self._part(first, last), buffer.getvalue().to_pybytes())

    def _part(self, first: int, last: int) -> Path:
        return self.folder / f"{first:012d}-{last:012d}.parquet"

    def finish(self) -> Path:
        """All rows are there: one file of them, in order, and no parts.

        Raises:
            OutputError: it cannot be written.
        """
        pq, layout = arrow().parquet, self.layout
        whole = self.folder / "whole.partial"
        with naming_output(self.out):
            with pq.ParquetWriter(whole, layout.schema, compression="zstd") as writer:
                for group in _regrouped(self._tables(), layout.group_rows):
                    writer.write_table(group, row_group_size=layout.group_rows)
            whole.replace(self.out)
        self.close()
        shutil.rmtree(self.folder, ignore_errors=True)
        return self.out

    def _tables(self) -> Iterator[Any]:
        for first, last in self.ranges():
            yield arrow().parquet.read_table(self._part(first, last), schema=self.layout.schema)

    def close(self) -> None:
        """Let others write."""
        with suppress(OSError):
            os.close(self._lock)


def _regrouped(tables: Iterator[Any], size: int) -> Iterator[Any]:
    """The same rows in tables of ``size`` rows, the last one shorter."""
    pa, held, rows = arrow(), [], 0
    for table in tables:
        held.append(table)
        rows += table.num_rows
        while rows >= size:
            joined = pa.concat_tables(held)
            yield joined.slice(0, size).combine_chunks()
            held, rows = [joined.slice(size)], rows - size
    if rows:
        yield pa.concat_tables(held).combine_chunks()


def require_same(found: Mapping[str, Any], asked: Mapping[str, Any], place: Path) -> None:
    """Check that rows that are there are of the same study.

    Raises:
        OutputError: they are not; it says what differs.
    """
    differing = [key for key in asked if found.get(key) != asked[key]]
    if differing:
        raise OutputError(f"{place} has rows of another sweep: {', '.join(differing)} differ; remove it, or write elsewhere")


def is_whole(out: Path, layout: Layout) -> bool:
    """Whether a table is there with all rows of a study."""
    target, pa = resolved(out), arrow()
    if not target.is_file():
        return False
    try:
        with pa.parquet.ParquetFile(target) as file:
            found, wanted = file.schema_arrow, layout.schema
            same = found.equals(wanted) and (found.metadata or {}).get(MANIFEST) == wanted.metadata[MANIFEST]
            return bool(same and file.metadata.num_rows == layout.study.runs)
    except (OSError, pa.ArrowInvalid):
        return False


def read_json(path: Path) -> dict[str, Any]:
    """A manifest; empty where it is none."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def require_file(out: Path) -> None:
    """Check that a table can stand at a path.

    Raises:
        OutputError: it is a device, a pipe or a folder.
    """
    if is_stream(out) or out.is_dir():
        raise OutputError(f"{out}: the table of a sweep is a file, which is renamed when it is whole; write the name of one")


def require_room(layout: Layout, out: Path) -> None:
    """Check that a table, and its parts beside it, fit on the disk.

    Raises:
        RunError: they do not; it names the line of the design.
    """
    folder = next(parent for parent in resolved(out).parents if parent.exists())
    needed, free = 2 * layout.row_bytes * layout.study.runs, shutil.disk_usage(folder).free
    if needed > free:
        raise RunError(
            f"{layout.study.span}: design: {layout.study.runs} runs take about {needed / 1e9:.3g} GB at {folder}, which has "
            f"{free / 1e9:.3g} GB left; write fewer runs or thinner trajectories, or write elsewhere"
        )


def missing(done: Sequence[tuple[int, int]], runs: int) -> list[tuple[int, int]]:
    """The ranges of runs that are not in ``done``, which is in order."""
    gaps, at = [], 0
    for first, last in done:
        if first > at:
            gaps.append((at, first))
        at = max(at, last)
    return [*gaps, (at, runs)] if at < runs else gaps
