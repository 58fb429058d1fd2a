"""The files that a command writes: never an input of it, nor one file twice."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from pathlib import Path

from cutjoint.package.errors import CutjointError

#: Endings of result files, which the names of accompanying files do not contain.
ENDINGS = (".csv", ".parquet", ".arrow", ".npy")


class OutputError(CutjointError, ValueError):
    """A file that is no valid output, or could not be written."""


@dataclass(frozen=True, kw_only=True)
class _Written:
    """A file that a command writes: its option, such as ``--out run.csv``, the file, and which part of the output it is."""

    requested: str
    path: Path
    part: str = ""


def units_of(table: Path) -> Path:
    """The file with the units of a table: ``run.units.json`` of ``run.csv``, ``run.k1.units.json`` of ``run.k1``."""
    return table.with_name(f"{_stem(table)}.units.json")


def error_of(table: Path) -> Path:
    """The file that says how wrong a table is: ``run.error.json`` of ``run.csv``."""
    return table.with_name(f"{_stem(table)}.error.json")


def partial_of(table: Path) -> Path:
    """The file with the rows of an incomplete table: ``run.partial.csv`` of ``run.csv``, ``run.k1.partial.csv`` of ``run.k1``."""
    return table.with_name(f"{_stem(table)}.partial{table.suffix if table.suffix in ENDINGS else '.csv'}")


def reason_of(table: Path) -> Path:
    """The file with the reason why a table is incomplete: ``run.partial.txt`` of ``run.csv``."""
    return table.with_name(f"{_stem(table)}.partial.txt")


def _stem(table: Path) -> str:
    return (table.stem if table.suffix in ENDINGS else table.name.removesuffix(".csv")) or table.name


def resolved(path: Path) -> Path:
    """The target of a path, through links, whether or not it exists."""
    return Path(os.path.realpath(path))


def is_stream(path: Path) -> bool:
    """Return whether a path leads to a device, a pipe or an open descriptor: it is written to but never replaced."""
    return descriptor_of(path) is not None or (os.path.exists(path) and not os.path.isfile(path) and not os.path.isdir(path))


def descriptor_of(path: Path) -> int | None:
    """The open descriptor of this process that a path such as /dev/stdout names."""
    names = {"/dev/stdin": 0, "/dev/stdout": 1, "/dev/stderr": 2}
    text = os.path.abspath(path)
    for _ in range(8):  # a link to /dev/stdout counts too
        if text in names:
            return names[text]
        folder, name = os.path.split(text)
        if folder in ("/dev/fd", "/proc/self/fd", f"/proc/{os.getpid()}/fd") and name.isdecimal():
            return int(name)
        if not os.path.islink(text):
            return None
        text = os.path.normpath(os.path.join(folder, os.readlink(text)))
    return None


def require_apart(
    inputs: Mapping[str, Path | None], *, tables: Mapping[str, Path | None] | None = None,
    documents: Iterable[tuple[str, Path | None]] = (), plots: Path | None = None,
) -> None:  # fmt: skip
    """Check that no output of a command is one of its inputs or another output, by device and inode or by resolved path.

    Args:
        inputs: files that are read, by what they are, as ``the model``.
        tables: results of a run, by option; units and unfinished tables stand beside them.
        documents: other files, each with its option.
        plots: the folder of plots.

    Raises:
        OutputError: with a line for each output in conflict.
    """
    written = [*_of_tables(tables or {}), *([_Written(requested=f"{o} {p}", path=p)] for o, p in documents if p is not None)]
    found = [] if plots is None else sorted(plots.glob("*.png"))
    pictures = [_Written(requested=f"--plots {plots}", path=path, part="the pictures") for path in found]
    problems = [problem for files in (*written, pictures) if (problem := _clash_with_inputs(files, inputs))]
    problems += [problem for one, other in combinations(written, 2) if (problem := _clash(one, other))]
    if plots is not None:
        problems += [problem for files in written if (problem := _clash_with_plots(files, pictures, plots))]
    if problems:
        raise OutputError("\n".join(problems))


def require_folder(path: Path) -> None:
    """Make a folder for results, if it is not there. Raises OutputError: there is something else, or it cannot be made or written."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot make the folder {path}: {error.strerror or error}") from None
    if not os.access(path, os.W_OK | os.X_OK):
        raise OutputError(f"cannot write into the folder {path}: Permission denied")


def _of_tables(tables: Mapping[str, Path | None]) -> Iterator[list[_Written]]:
    for option, path in tables.items():
        if path is None:
            continue
        requested = f"{option} {path}"
        if is_stream(path):
            yield [_Written(requested=requested, path=path)]
            continue
        partial = partial_of(resolved(path))
        beside = {
            "the units": units_of(resolved(path)), "the errors": error_of(resolved(path)), "the rows of an unfinished table": partial,
            "the units of an unfinished table": units_of(partial), "the reason for an unfinished table": reason_of(resolved(path)),
        }  # fmt: skip
        files = [_Written(requested=requested, path=file, part=part) for part, file in beside.items()]
        yield [_Written(requested=requested, path=path), *files]


def _clash_with_inputs(files: Sequence[_Written], inputs: Mapping[str, Path | None]) -> str:
    """Describe an output that has an input among its files; "" if none does."""
    for file, (what, path) in product(files, inputs.items()):
        if path is not None and _same(file.path, path):
            there = f"{file.part} would go to {file.path}, which" if file.part else "that"
            return f"{file.requested}: {there} is {what}; write the results elsewhere"
    return ""


def _clash(files: Sequence[_Written], others: Sequence[_Written]) -> str:
    """Describe two outputs that share a file, or of which one contains the other; "" if there are none."""
    for one, other in product(files, others):
        if _same(one.path, other.path):
            one, other = (other, one) if other.part and not one.part else (one, other)
            there = f"{one.part} of {one.requested} go there" if one.part else f"that is {one.requested} too"
            return f"{other.requested}: {there}; write the two to different files"
    one, other = files[0], others[0]
    if resolved(one.path) in resolved(other.path).parents or resolved(other.path) in resolved(one.path).parents:
        return f"{other.requested}: one of this and {one.requested} is a folder of the other; write the two to different places"
    return ""


def _clash_with_plots(files: Sequence[_Written], pictures: Sequence[_Written], plots: Path) -> str:
    """Describe an output that is a plot or the plots' folder; "" if there is none."""
    target, folder = resolved(files[0].path), resolved(plots)
    if target == folder or target in folder.parents:
        return f"--plots {plots}: {files[0].requested} is a file there; write the two to different places"
    if target.parent == folder and target.suffix == ".png":
        return f"--plots {plots}: {files[0].requested} lies among the pictures; write the two to different places"
    return _clash(pictures, files) if pictures else ""


def _same(one: Path, other: Path) -> bool:
    """Return whether two paths lead to one file; devices such as a terminal or /dev/null can take several tables."""
    try:
        found = os.stat(one)
        return not stat.S_ISCHR(found.st_mode) and os.path.samestat(found, os.stat(other))
    except OSError:
        return resolved(one) == resolved(other)
