"""Parts of a sweep's table: files in a folder that become the table when all rows are complete.

Parts are written under temporary names and renamed.  Each has a digest of its rows, its runs and the sweep's key.  Parts that do not
match are set aside, and their runs are repeated.
"""

import json
import os
import re
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from io import BytesIO
from itertools import chain, count
from pathlib import Path
from typing import Any

from cutjoint.package.system import lock, open_flags
from cutjoint.run.outputs import OutputError, resolved
from cutjoint.run.result_files import naming_output, write_whole
from cutjoint.sweeps.table import Layout, arrow, is_sealed, key_of, manifest_text, parts_label, seal
from cutjoint.sweeps.work import Rows

#: File names in the folder of parts, and of parts; unfinished files have a longer name.
_MANIFEST, _LOCK, _WHOLE = "manifest.json", ".lock", "whole.partial"
_PART = re.compile(r"(\d{12})-(\d{12})\.parquet", re.ASCII)
_UNFINISHED = re.compile(rf"\.(?:\d{{12}}-\d{{12}}\.parquet|{re.escape(_MANIFEST)})\.[0-9a-f]{{12}}", re.ASCII)

#: The reason that a part is set aside.
_UNFIT = "is damaged, renamed or of another sweep"


class Parts:
    """The folder of a table's parts, which one command at a time writes.  ``note`` is called when a part is set aside.
    Raises OutputError: it cannot be written, another command writes it, or it is of another study."""

    def __init__(self, out: Path, layout: Layout, note: Callable[[str], None]) -> None:
        self.out, self.layout, self._note = resolved(out), layout, note
        self.folder = self.out.with_name(f"{self.out.name}.parts")
        self.aside = self.out.with_name(f"{self.out.name}.aside")
        with naming_output(self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)
            self._lock = os.open(self.folder / _LOCK, open_flags("O_RDWR", "O_CREAT"), 0o666)
        try:
            lock(self._lock)
            self._resume()
        except BlockingIOError:
            os.close(self._lock)
            raise OutputError(f"{self.folder}: another sweep writes this; wait for it, or write elsewhere") from None
        except BaseException:
            os.close(self._lock)
            raise

    def _resume(self) -> None:
        file = self.folder / _MANIFEST
        if (found := _read_manifest(file)) is not None:
            require_same(found, self.layout.manifest, self.folder)
            return
        if os.path.lexists(file):
            self._set_aside(file, "is damaged")
        write_whole(file, manifest_text({"key": self.layout.key, **self.layout.manifest}) + "\n")

    def ranges(self) -> list[tuple[int, int]]:
        """The runs whose rows are there: from the first of each part to the one behind the last, in order.

        Files of no part of the sweep are set aside, unfinished ones of an earlier call are removed.
        """
        found, at = [], 0
        for path in self._paths():
            named = _PART.fullmatch(path.name)
            if named is None:
                self._set_aside(path, "is no part of a sweep")
                continue
            first, last = int(named[1]), int(named[2])
            if _read_part(path, self._label(first, last)) is None:
                self._set_aside(path, _UNFIT)
            elif first < at:
                self._set_aside(path, "has runs that another part has too")
            else:
                found.append((first, last))
                at = last
        return found

    def _paths(self) -> list[Path]:
        """The files in the folder, in order, but the manifest and hidden files; unfinished ones are removed."""
        with naming_output(self.folder):
            paths = sorted(self.folder.iterdir())
        for path in paths:
            if _UNFINISHED.fullmatch(path.name) or (path.name == _WHOLE and path.is_file()):
                with suppress(OSError):
                    path.unlink()
        return [path for path in paths if not path.name.startswith(".") and path.name != _MANIFEST and os.path.lexists(path)]

    def _set_aside(self, path: Path, why: str) -> None:
        """Move something out of the folder under an unused name, with a message."""
        with naming_output(self.aside):
            self.aside.mkdir(exist_ok=True)
            names = chain([path.name], (f"{path.name}.{i}" for i in count(1)))
            place = next(self.aside / name for name in names if not os.path.lexists(self.aside / name))
            with suppress(FileNotFoundError):
                shutil.move(path, place)
        self._note(f"{path} {why}: it is now {place}" + ("" if why != _UNFIT else ", and its runs are repeated"))

    def write(self, rows: Rows) -> None:
        """The rows of a chunk. Raises OutputError: they cannot be written."""
        first, last = rows.first, rows.first + len(rows.values)
        buffer = BytesIO()
        arrow().parquet.write_table(self.layout.table(rows), buffer, compression="zstd")
        seal(buffer, self._label(first, last))
        path = self._part(first, last)
        if os.path.lexists(path):
            self._set_aside(path, "has come in place of a part")
        write_whole(path, buffer.getvalue())

    def _part(self, first: int, last: int) -> Path:
        return self.folder / f"{first:012d}-{last:012d}.parquet"

    def _label(self, first: int, last: int) -> str:
        return parts_label(self.layout.key, first, last)

    def finish(self) -> list[tuple[int, int]]:
        """One file of all rows, in order, and no parts; where rows are missing the ranges of their runs, and no file.
        Raises OutputError: it cannot be written, or rows vanish meanwhile."""
        ranges = self.ranges()
        if gaps := missing(ranges, self.layout.study.runs):
            return gaps
        pq, layout, whole = arrow().parquet, self.layout, self.folder / _WHOLE
        with naming_output(self.out):
            with pq.ParquetWriter(whole, layout.schema, compression="zstd") as writer:
                for group in _regrouped(self._tables(ranges), layout.group_rows):
                    writer.write_table(group, row_group_size=layout.group_rows)
            with whole.open("r+b") as file:
                seal(file, layout.label)
            whole.replace(self.out)
        self._remove(ranges)
        self.close()
        return []

    def _tables(self, ranges: Sequence[tuple[int, int]]) -> Iterator[Any]:
        for first, last in ranges:
            content = _read_part(self._part(first, last), self._label(first, last))
            if content is None:
                raise self.incomplete([(first, last)])
            yield arrow().parquet.read_table(arrow().BufferReader(content), schema=self.layout.schema)

    def incomplete(self, gaps: Sequence[tuple[int, int]]) -> OutputError:
        """The error for rows that have disappeared."""
        return OutputError(f"{self.folder}: {count_runs(gaps)} completed runs have disappeared; find the cause, and repeat the call")

    def _remove(self, ranges: Sequence[tuple[int, int]]) -> None:
        """Remove what the sweep has put into the folder, and the folder if nothing else is there."""
        manifest = self.folder / _MANIFEST
        if os.path.lexists(manifest) and _read_manifest(manifest) != self.layout.manifest:
            self._set_aside(manifest, "is damaged, or of another sweep")
        for path in (*(self._part(first, last) for first, last in ranges), manifest, self.folder / _LOCK):
            with suppress(OSError):
                path.unlink()
        with suppress(OSError):
            self.folder.rmdir()
        if self.folder.exists():
            self._note(f"{self.folder} stays: it has files that are not of the sweep")

    def close(self) -> None:
        """Release the lock."""
        with suppress(OSError):
            os.close(self._lock)


def count_runs(ranges: Sequence[tuple[int, int]]) -> int:
    """The number of runs in ranges."""
    return sum(last - first for first, last in ranges)


def _read_part(path: Path, label: str) -> bytes | None:
    """The content of a part; None if its digest does not match the label."""
    try:
        content = path.read_bytes() if path.is_file() else b""
    except OSError:
        return None
    return content if is_sealed(BytesIO(content), label) else None


def _regrouped(tables: Iterator[Any], size: int) -> Iterator[Any]:
    """Regroup rows into tables of ``size`` rows; the last one may be shorter."""
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
    """Check that rows that are there are of the same study. Raises OutputError: they are not; it says what differs."""
    differing = [key for key in asked if found.get(key) != asked[key]]
    if differing:
        raise OutputError(f"{place} has rows of another study: {', '.join(differing)} differ; remove it, or write elsewhere")


def require_parts_of(out: Path, asked: Mapping[str, Any]) -> None:
    """Check that parts of a table, if there are any, are of the same study. Raises OutputError: they are not; RunError: no PyArrow."""
    arrow()
    folder = resolved(out).with_name(f"{resolved(out).name}.parts")
    require_same(_read_manifest(folder / _MANIFEST) or asked, asked, folder)


def _read_manifest(path: Path) -> dict[str, Any] | None:
    """The manifest of parts; None if there is none or it is damaged."""
    try:
        found = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None
    except (OSError, ValueError, RecursionError):
        return None
    if not isinstance(found, dict):
        return None
    key = found.pop("key", None)
    return found if key == key_of(found) else None


def missing(done: Sequence[tuple[int, int]], runs: int) -> list[tuple[int, int]]:
    """The ranges of runs that are not in the ordered ranges ``done``."""
    gaps, at = [], 0
    for first, last in done:
        if first > at:
            gaps.append((at, first))
        at = max(at, last)
    return [*gaps, (at, runs)] if at < runs else gaps
