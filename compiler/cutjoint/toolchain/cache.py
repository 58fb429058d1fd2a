"""A cache of files by content keys; digests of texts and of C++ are the keys.

Each file has a file with its digest next to it, and counts as absent if they do not match.

The digest is checked at each use: that takes a millisecond for 1 MB and finds flipped bits, which size and time do not show.  Files are not
flushed to the disk: a file truncated by a power failure does not match its digest.  Files that other users could have written are refused
(`trust`).

Files that all caches share are in a folder of the installation, in the same form.
"""

import hashlib
import json
import os
import shutil
import stat
import sys
from collections.abc import Callable, Iterator, Sequence, Set
from contextlib import ExitStack, contextmanager
from functools import cache
from hashlib import file_digest, sha256
from pathlib import Path
from typing import Any

import platformdirs

from cutjoint.package.errors import ToolchainError
from cutjoint.package.locations import runtime_folder
from cutjoint.toolchain.temporary import PREFIX, locked, plain_folder, temporary_folder
from cutjoint.toolchain.trust import Trust, trust_of


def cache_folder() -> Path:
    """The folder of cached binaries: $CUTJOINT_CACHE, else the user's cache folder."""
    return Path(os.environ.get("CUTJOINT_CACHE") or platformdirs.user_cache_path("cutjoint")).absolute()


def installed_folder() -> Path:
    """The folder of files that all caches share, inside the installation."""
    return Path(sys.prefix) / "share" / "cutjoint"


def is_sound(file: Path) -> bool:
    """True where a file of the cache is there and is as it was stored. Raises ToolchainError: somebody else can write there."""
    beside = _digest_place(file)
    for each in (file, beside):
        _trust_of(each).require(each)
    try:
        return file.is_file() and beside.is_file() and beside.read_text(encoding="ascii", errors="replace") == _describe(file)
    except OSError:
        return False


def find_or_make(file: Path, make: Callable[[Path], Path]) -> bool:
    """Have a file in the cache; returns whether ``make`` made it now.  Of several processes one makes it, the others wait.

    ``make`` gets a temporary folder with a plain path, and returns where the file is that it made. Raises ToolchainError: the file is not
    there and the cache cannot be written, or somebody else can write it.
    """
    if is_sound(file):
        return False
    with exclusive(file):
        if is_sound(file):
            return False
        with plain_folder(_store_of(file)) as folder:
            store(make(folder), file)
        return True


@contextmanager
def exclusive(file: Path) -> Iterator[None]:
    """One process at a time for a file of the cache. Raises ToolchainError: the cache cannot be written."""
    folder = _store_of(file)
    lock = folder / f"{PREFIX}{'-'.join(file.relative_to(folder).with_suffix('').parts)}.lock"
    with ExitStack() as stack:
        with _writing(folder):
            _made(folder)
            stack.enter_context(locked(lock))
        yield


def store(file: Path, target: Path) -> None:
    """Copy a file that was built into the cache with its digest, in place of whatever is there.
    Raises ToolchainError: the file was not built, or the cache cannot be written."""
    if not file.is_file():
        raise ToolchainError(f"the compiler reported no error but made no {file.name}; set $CXX to a C++20 compiler, or unset it")
    place = _store_of(target)
    with _writing(place), temporary_folder(_made(place)) as folder:
        copy, beside = folder / "content", folder / "digest"
        shutil.copy(file, copy)
        beside.write_text(_describe(copy), encoding="ascii")
        _settle(target, copy, beside)
        _clear_place(target)
        copy.replace(target)
        beside.replace(_digest_place(target))


def fetch(file: Path, target: Path) -> bool:
    """Copy a file out of the cache; returns whether the copy is what was stored. Raises ToolchainError: somebody else can write there."""
    if not is_sound(file):
        return False
    try:
        shutil.copy(file, target)
    except FileNotFoundError:  # removed in the meantime
        return False
    return _digest_place(file).read_text(encoding="ascii", errors="replace") == _describe(target)


def read_record(place: Path) -> Any:
    """A record of the cache; None where there is none, or a damaged one. Raises ToolchainError: somebody else can write there."""
    _trust_of(place).require(place)
    try:
        digest, _, text = place.read_bytes().partition(b"\n") if place.is_file() else (b"", b"", b"")
    except OSError:
        return None
    return json.loads(text) if digest.decode("ascii", "replace") == sha256(text).hexdigest() else None


def write_record(place: Path, record: Any) -> None:
    """Put a record, plain data, into the cache: a line with the digest of the JSON that follows, so that both come at once.
    Raises ToolchainError: the cache cannot be written."""
    text = json.dumps(record).encode()
    with _writing(cache_folder()), temporary_folder(_made(cache_folder())) as folder:
        (folder / "record").write_bytes(sha256(text).hexdigest().encode() + b"\n" + text)
        _settle(place, folder / "record")
        _clear_place(place)
        (folder / "record").replace(place)


def require_writable(folder: Path) -> None:
    """Check that files can be stored in a folder. Raises ToolchainError: it cannot be written."""
    with _writing(folder), temporary_folder(_made(folder)):
        pass


def _store_of(file: Path) -> Path:
    """The store that contains a file: the cache or the installation's."""
    return installed_folder() if file.is_relative_to(installed_folder()) else cache_folder()


def _trust_of(file: Path) -> Trust:
    store = _store_of(file)
    return trust_of(store, installed=store == installed_folder())


def _digest_place(file: Path) -> Path:
    return file.with_name(f"{file.name}.sha256")


def _describe(file: Path) -> str:
    with file.open("rb") as stream:
        digest = file_digest(stream, "sha256").hexdigest()
        program = os.fstat(stream.fileno()).st_mode & stat.S_IXUSR
    return f"{digest} {'program' if program else 'data'}\n"


def _made(folder: Path) -> Path:
    """A folder of a store, or the store, which is made if it is not there; refused if somebody else can write there."""
    if not folder.is_dir():
        for part in (*reversed(folder.parents), folder):
            if not part.is_dir():
                part.mkdir(mode=0o755, exist_ok=True)
                if part.is_relative_to(_store_of(folder)):
                    _settle(folder, part)
    _trust_of(folder).require(folder)
    return folder


def _settle(place: Path, *paths: Path) -> None:
    """Give files for a ``place`` in a store the permissions that they have there."""
    for path in paths:
        _trust_of(place).settle(path)


def _clear_place(target: Path) -> None:
    """Remove things of another kind at the places of a file and its folders."""
    store = _store_of(target)
    for part in reversed(target.relative_to(store).parents):
        if not (folder := store / part).is_dir():
            folder.unlink(missing_ok=True)
    _made(target.parent)
    for file in (target, _digest_place(target)):
        if file.is_dir() and not file.is_symlink():
            shutil.rmtree(file)


@contextmanager
def _writing(folder: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        fault = f"the cache {folder} cannot be written: {error.strerror or error}"
        raise ToolchainError(f"{fault}; set $CUTJOINT_CACHE to a folder that can") from error


def digest_of(parts: Sequence[str]) -> str:
    """A digest of texts, as used in file names."""
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:32]


@cache
def runtime_digest(*, part: str = "") -> str:
    """A digest of the runtime's headers and sources; of those that only one kind of simulator has, with its ``part``."""
    return tree_digest(runtime_folder(), left_out={"interpreter"} - {part})


def tree_digest(folder: Path, *, left_out: Set[str] = frozenset()) -> str:
    """A digest of the C++ in a folder and of its projects, but for folders and files of some names."""
    files = sorted(p for p in folder.rglob("*") if p.suffix in (".hpp", ".cpp", ".txt", ".cmake"))
    files = [p for p in files if left_out.isdisjoint(p.relative_to(folder).with_suffix("").parts)]
    return digest_of([text for p in files for text in (str(p.relative_to(folder)), p.read_text(encoding="utf-8"))])
