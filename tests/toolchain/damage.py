"""Ways in which files of a cache come to harm."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any


def _flip(file: Path) -> None:
    """One bit, at the same time of change."""
    before, content = file.stat(), bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)
    os.utime(file, ns=(before.st_atime_ns, before.st_mtime_ns))


def _replace(file: Path, make: Callable[[Path], object]) -> None:
    if file.is_dir() and not file.is_symlink():
        shutil.rmtree(file)
    else:
        file.unlink()
    make(file)


def _full_folder(file: Path) -> None:
    file.mkdir()
    (file / "in the way").touch()


def _digest(file: Path) -> Path:
    return file.with_name(f"{file.name}.sha256")


#: By name, what happens to a file.
DAMAGE: Mapping[str, Callable[[Path], object]] = {
    "gone": Path.unlink,
    "empty": lambda file: file.write_bytes(b""),
    "cut off": lambda file: os.truncate(file, file.stat().st_size // 2),
    "a bit flipped": _flip,
    "not executable": lambda file: file.chmod(0o644),
    "a folder": lambda file: _replace(file, _full_folder),
    "a link to nowhere": lambda file: _replace(file, lambda path: path.symlink_to("nowhere")),
    "a pipe": lambda file: _replace(file, os.mkfifo),
    "folder is a file": lambda file: _replace(file.parent, Path.touch),
    "folder is a link to nowhere": lambda file: _replace(file.parent, lambda path: path.symlink_to("nowhere")),
    "digest gone": lambda file: _digest(file).unlink(),
    "digest empty": lambda file: _digest(file).write_bytes(b""),
    "digest of another": lambda file: _digest(file).write_text(f"{'0' * 64} program\n"),
    "digest no text": lambda file: _digest(file).write_bytes(b"\xff\0"),
    "digest a folder": lambda file: _replace(_digest(file), _full_folder),
}

#: Of other types than what is there.
_OTHERS: tuple[Any, ...] = (None, True, -1, 10**400, 1e308, float("nan"), "", "x" * 100, "\0", [], [[]], {}, {"x": None})


def damaged_records(content: bytes) -> Iterator[bytes]:
    """Contents of a file that has a record in JSON, harmed: other bytes, and at each place of the record other values or none."""
    yield from (b"", b"\0", b"\xff\xfe", b"null", b"[]", b"{}", b"[" * 100_000)
    yield from (content[: len(content) // 2], content.replace(b":", b"\0", 1))
    start = content.index(b"{")
    record = json.loads(content[start:])
    for changed in _changed(record):
        yield content[:start] + json.dumps(changed).encode()


def _changed(value: Any) -> Iterator[Any]:
    """A value with one thing in it changed."""
    yield from (other for other in _OTHERS if repr(other) != repr(value))
    for place in value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ():
        for other in _changed(value[place]):
            copy = value.copy()
            copy[place] = other
            yield copy
        left = value.copy()
        del left[place]
        yield left
