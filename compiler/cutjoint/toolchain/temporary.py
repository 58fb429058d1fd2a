"""Temporary folders; those of a killed process are removed by the next one.

Each folder has a lock file next to it, which its process locks.  An unlocked lock file belongs to a process that has ended.
"""

import atexit
import os
import re
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from secrets import token_hex

from filelock import FileLock, Timeout

from cutjoint.package.errors import ToolchainError
from cutjoint.package.system import IS_WINDOWS, user

#: The prefix of lock files, including the cache's, and of the temporary folders next to them.
PREFIX = "cutjoint-"

#: Paths that CMake, Ninja, the shell and the compiler all take as they are.  In others CMake splits at semicolons, and the shell that
#: Ninja calls runs what stands in $().
_PLAIN = re.compile(r"[A-Za-z0-9/._+-]+")

#: The folders that this process has made and not yet removed.
_in_use: set[Path] = set()


@contextmanager
def temporary_folder(parent: Path | None = None) -> Iterator[Path]:
    """A new folder in ``parent``, or in the system's place for temporary files; it is gone afterwards."""
    place = Path(tempfile.gettempdir() if parent is None else parent).absolute()
    _remove_stale_once(place)
    folder = place / f"{PREFIX}{token_hex(8)}"
    with locked(folder.with_suffix(".lock")):
        _in_use.add(folder)
        try:
            folder.mkdir(mode=0o700)
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)
            _in_use.discard(folder)


@contextmanager
def plain_folder(preferred: Path) -> Iterator[Path]:
    """A new temporary folder with a plain path: in the preferred place, else in one of the system's.
    Raises ToolchainError: no place with a plain path can be written."""
    places = [preferred, *map(Path, (tempfile.gettempdir(), "/tmp", "/var/tmp"))]
    parent = next((p.resolve() for p in places if is_plain(p) and os.access(p, os.W_OK | os.X_OK)), None)
    if parent is None:
        tried = ", ".join(dict.fromkeys(map(str, places)))
        raise ToolchainError(f"no place to build in: {tried}; set $TMPDIR to a folder that can be written, of letters, digits and ._+-")
    with temporary_folder(parent) as folder:
        yield folder


def is_plain(path: Path) -> bool:
    """Return whether all tools of a build take a path as it is, and the target of its links."""
    return all(_PLAIN.fullmatch(str(p)) for p in (path.absolute(), path.resolve()))


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold a lock; its file is there for no longer than that, unless the process is killed."""
    with FileLock(path, mode=0o664):  # members of a group that shares a cache use it in turn
        try:
            yield
        finally:
            # Windows removes it itself; where the folder is there a signal came while it was removed, which the end or the next does
            if not IS_WINDOWS and not path.with_suffix("").is_dir():
                path.unlink(missing_ok=True)


def remove_stale(place: Path) -> None:
    """Remove this user's unused locks and their temporary folders; the lock of one that cannot be removed stays for the next attempt."""
    for lock in place.glob(f"{PREFIX}*.lock"):
        with suppress(OSError, Timeout):
            if lock.lstat().st_uid == user():
                with FileLock(lock, blocking=False):
                    if lock.with_suffix("").is_dir():
                        shutil.rmtree(lock.with_suffix(""))
                    lock.unlink(missing_ok=True)


_remove_stale_once = cache(remove_stale)


@atexit.register
def _remove_all() -> None:
    """Remove folders that a signal kept, and those of threads that nobody waits for."""
    for folder in list(_in_use):
        shutil.rmtree(folder, ignore_errors=True)
        folder.with_suffix(".lock").unlink(missing_ok=True)
