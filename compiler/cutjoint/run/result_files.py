"""Result files: written under a temporary name in the destination's folder and renamed when they are complete."""

import json
import os
import stat
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from errno import ENXIO
from math import isfinite
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, cast

import numpy as np

from cutjoint.package.system import IS_WINDOWS, lock, number_for_child, open_flags, set_mode
from cutjoint.run.binary_tables import BINARY, Array, encoded, require_writer
from cutjoint.run.outputs import OutputError, descriptor_of, error_of, is_stream, partial_of, reason_of, resolved, units_of
from cutjoint.run.results import ErrorEstimate

Units = Mapping[str, str]


class TableFile:
    """A table that is being written.

    Rows go to `partial_of` the table, which is renamed when the table is complete: an earlier table stays until then. Otherwise the rows
    stay in that file, and `reason_of` says why. Links are followed. Raises OutputError: the file cannot be written, or another process
    writes it.
    """

    def __init__(self, path: Path, units: Units | None = None) -> None:
        self.path = path
        self._target, self._units = resolved(path) if path.is_symlink() else path, units
        self._partial = partial_of(self._target)
        with naming_output(path):
            self._target.parent.mkdir(parents=True, exist_ok=True)
            mode = _mode_of(self._target)
            self.file = _lock(self._partial)
            if mode is not None:
                set_mode(self.file.fileno(), mode)
            self.file.truncate(0)
            for stale in (reason_of(self._target), units_of(self._partial)):
                stale.unlink(missing_ok=True)

    def finish(self) -> Path:
        """Complete the table, and return its file."""
        if self._units is not None:
            write_whole(units_of(self._target), _as_json(self._units))
        with naming_output(self.path):
            self._close_early()
            self._partial.replace(self._target)
        self.file.close()
        return self.path

    def leave(self, reason: str) -> Path | None:
        """Close the incomplete table for a ``reason``; return the file with its rows, None if there are none."""
        if not (os.fstat(self.file.fileno()).st_size if self._target.suffix in BINARY else _cut_to_lines(self.file)):
            self._close_early()
            self._partial.unlink(missing_ok=True)
            self.file.close()
            return None
        self.file.close()
        with suppress(OutputError):  # a full disk has no room for accompanying files
            write_whole(reason_of(self._target), f"{reason}\n")
            if self._units is not None:
                write_whole(units_of(self._partial), _as_json(self._units))
        return self._partial

    def _close_early(self) -> None:
        """Close the file where the system cannot rename an open one; elsewhere its lock lasts until the rename."""
        if IS_WINDOWS:
            self.file.close()


class Stream:
    """A table that is written directly to a device, a pipe or an open descriptor. Raises OutputError: it cannot be opened."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.file = _open_stream(path)

    def finish(self) -> Path:
        """Complete the table."""
        self.file.close()
        return self.path

    def leave(self, reason: str) -> Path | None:
        """Stop writing; the reader keeps the part that was written."""
        self.file.close()
        return None


def open_table(path: Path, units: Units | None = None) -> TableFile | Stream:
    """Open a table for writing; a second file has the ``units``. Raises OutputError: it cannot be written, or another process writes it."""
    return Stream(path) if is_stream(path) else TableFile(path, units)


def write_table(path: Path, units: Units, rows: Iterable[Iterable[str | float]], *names: str) -> Path:
    """Write a complete table, whose first columns may be words with ``names``, and a file with its units.
    Raises OutputError: it cannot be written."""
    lines = ((x if isinstance(x, str) else repr(float(x) + 0.0) for x in row) for row in rows)
    with whole_table(path, units) as table:
        write_all(table.file, "".join(f"{','.join(line)}\n" for line in ((*names, *units), *lines)).encode())
    return path


@contextmanager
def whole_table(path: Path, units: Units) -> Iterator[TableFile | Stream]:
    """A table that is complete unless an error occurs, which then says where the rows are."""
    table = open_table(path, units)
    try:
        yield table
        table.finish()
    except BaseException as error:
        if left := table.leave(str(error) or "interrupted"):
            error.add_note(f"the rows up to then are in {left}")
        raise


class RunTables:
    """The tables of one run, which its simulator writes; without `finish` they are incomplete.

    The simulator also writes the rows of ``out`` as doubles into a private file; binary formats are encoded from it.
    """

    def __init__(self, units: Units | None, *, out: Path | None, **others: Path | None) -> None:
        self._tables: dict[str, TableFile | Stream] = {}
        self._units = units
        self._written = units is not None and out is not None and out.suffix in BINARY
        try:
            if out is not None:
                if self._written:
                    require_writer(out)
                self._tables["out"] = open_table(out, units)
            for name, path in others.items():
                if path is not None:
                    self._tables[name] = open_table(path)
            self._rows = cast(BinaryIO, tempfile.TemporaryFile(buffering=0))  # noqa: SIM115
        except BaseException as error:
            self._written = False
            self.leave(str(error))
            raise

    def rows(self, columns: int) -> Array:
        """The rows of the table ``out`` so far, (rows, columns), the time first."""
        return read_rows(self._rows, columns)

    @property
    def places(self) -> dict[str, Any]:
        """The part of a run file with the paths of the tables."""
        places = {name: place_of(table.file, str(table.path)) for name, table in self._tables.items() if name != "out" or not self._written}
        return {**places, "out_rows": place_of(self._rows, "the temporary table")}

    def finish(self, size: int | None = None) -> Path | None:
        """Complete all tables; return the file of ``out``, whose text has ``size`` bytes.
        Raises OutputError: it has another size, or cannot be written."""
        while self._tables and (name := next(reversed(self._tables))) != "out":  # the last one
            self._tables.pop(name).finish()
        if not self._tables:
            return None
        table = self._tables["out"]
        if self._written:
            self._encode(table)
        elif size is not None and isinstance(table, TableFile) and size != (found := os.fstat(table.file.fileno()).st_size):
            raise OutputError(f"{table.path}: {size} bytes were written and {found} are there; has another program changed the table?")
        del self._tables["out"]
        return table.finish()

    def leave(self, reason: str) -> Path | None:
        """Close the incomplete tables for a ``reason``; return the file with the rows of ``out``, None if there are none."""
        left = None
        while self._tables:  # "out" comes last
            name, table = self._tables.popitem()
            if name == "out" and self._written:
                try:
                    self._encode(table)
                except OutputError:  # an incomplete table is removed
                    table.file.truncate(0)
            left = table.leave(reason)
        return left

    def _encode(self, table: TableFile | Stream) -> None:
        """Write the rows so far in the table's format, or nothing without rows."""
        assert self._units is not None
        rows = self.rows(len(self._units))
        with naming_output(table.path):
            write_all(table.file, encoded(table.path, self._units, rows) if rows.size else b"")

    def __enter__(self) -> "RunTables":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._tables and error is not None and (left := self.leave(str(error) or "interrupted")):
            error.add_note(f"the rows up to then are in {left}")
        self._rows.close()


def read_rows(file: BinaryIO, columns: int) -> Array:
    """The complete rows of doubles in a file, (rows, columns)."""
    file.seek(0)
    content, row = bytearray(file.read()), 8 * columns
    return np.frombuffer(content[: len(content) // row * row]).reshape(-1, columns)


def write_error(table: Path, error: ErrorEstimate | None, implementation: str) -> None:
    """Write the error estimate of a table and the implementation of its run to a file next to it; not for streams.
    Raises OutputError: it cannot be written."""
    if is_stream(table):
        return
    path = error_of(resolved(table))
    with naming_output(path):
        path.unlink(missing_ok=True)
    if error is not None:
        largest = {name: value if isfinite(value) else None for name, value in error.max_error.items()}
        warnings = {"warnings": error.warnings} if error.warnings else {}
        about = {"converged": error.converged, "implementation": implementation, "max_error": largest, "units": dict(error.units)}
        write_whole(path, _as_json({**about, **warnings}))


def write_whole(path: Path, content: str | bytes) -> Path:
    """Write a file atomically: an earlier one survives a failure; a stream is written directly.
    Raises OutputError: it cannot be written."""
    data = content.encode() if isinstance(content, str) else content
    if is_stream(path):
        with _open_stream(path) as stream, naming_output(path):
            write_all(stream, data)
        return path
    with _written_beside() as write:
        write(path, data)
    return path


def write_files(folder: Path, files: Mapping[str, str | bytes], modes: Mapping[str, int] | None = None) -> None:
    """Write files by name into a folder, all or none; ``modes`` are permissions of some.
    Raises OutputError: one cannot be written, and all stay unchanged."""
    with _written_beside() as write:
        for name, content in files.items():
            write(folder / name, content.encode() if isinstance(content, str) else content, (modes or {}).get(name))


@contextmanager
def _written_beside() -> Iterator[Callable[..., None]]:
    """Yield a function that writes a temporary file in the folder of a path; at the end rename all files, or none after an error."""
    written: list[tuple[Path, Path, Path]] = []

    def write(path: Path, data: bytes, mode: int | None = None) -> None:
        target = resolved(path)
        beside = target.with_name(f".{target.name[:100]}.{os.urandom(6).hex()}")
        with naming_output(path):
            target.parent.mkdir(parents=True, exist_ok=True)
            earlier = _mode_of(target)
            written.append((path, beside, target))
            with beside.open("xb", buffering=0) as file:
                write_all(file, data)
                if (kept := earlier if mode is None else mode) is not None:
                    set_mode(file.fileno(), kept)

    try:
        yield write
        while written:
            path, beside, target = written[0]
            with naming_output(path):
                beside.replace(target)
            written.pop(0)
    finally:
        for _, beside, _ in written:
            beside.unlink(missing_ok=True)


def write_all(file: BinaryIO, data: bytes) -> None:
    """Write all of ``data`` unbuffered."""
    rest = memoryview(data)
    while rest:
        rest = rest[file.write(rest) :]


def _as_json(content: Mapping[str, Any]) -> str:
    return json.dumps(dict(content), indent=2) + "\n"


@contextmanager
def naming_output(path: Path) -> Iterator[None]:
    """Convert system errors to `OutputError`."""
    try:
        yield
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror or error}") from None


def _mode_of(file: Path) -> int | None:
    """The permissions of a file to be replaced, None if there is none; a read-only file may not be replaced."""
    if not file.exists():
        return None
    if file.is_dir() or not os.access(file, os.W_OK):
        file.open("ab").close()  # raises the reason
    return stat.S_IMODE(file.stat().st_mode)


def _lock(path: Path) -> BinaryIO:
    """Open and lock a file against other processes that use the same lock."""
    while True:
        number = os.open(path, open_flags("O_RDWR", "O_CREAT", "O_NOFOLLOW"), 0o666)
        file = cast(BinaryIO, os.fdopen(number, "r+b", buffering=0))
        try:
            lock(number)
            if os.path.samestat(os.fstat(number), os.stat(path)):
                return file
        except BlockingIOError:
            file.close()
            raise OutputError(f"{path}: another run writes this file; wait for it, or write elsewhere") from None
        except FileNotFoundError:
            pass
        file.close()  # the other run has just finished and renamed it


def _open_stream(path: Path) -> BinaryIO:
    with naming_output(path):
        return cast(BinaryIO, os.fdopen(_stream_number(path), "wb", buffering=0))


def _stream_number(path: Path) -> int:
    """A descriptor for writing to a stream; a pipe without a reader blocks, which a message reports."""
    number = descriptor_of(path)
    if number is not None:
        return os.dup(number)
    try:
        opened = os.open(path, open_flags("O_WRONLY", "O_NONBLOCK", "O_NOCTTY"))
    except OSError as error:
        if error.errno != ENXIO or not path.is_fifo():
            raise
        print(f"{path}: waiting for a reader of this pipe", file=sys.stderr, flush=True)
        return os.open(path, os.O_WRONLY)
    if not IS_WINDOWS:
        os.set_blocking(opened, True)
    return opened


def place_of(file: BinaryIO, name: str) -> dict[str, Any]:
    """An open file in a run file, with its name for messages."""
    return {"descriptor": number_for_child(file), "name": name.encode("utf-8", "backslashreplace").decode()}


def _cut_to_lines(file: BinaryIO) -> bool:
    """Truncate a file after its last complete line; return whether there is one."""
    end = file.seek(0, os.SEEK_END)
    while end > 0:
        begin = max(0, end - 65536)
        file.seek(begin)
        newline = file.read(end - begin).rfind(b"\n")
        if newline >= 0:
            file.truncate(begin + newline + 1)
            return True
        end = begin
    return False
