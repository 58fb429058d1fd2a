"""The owners whose files are trusted: this user and root, if nobody else could have written or exchanged them.

A digest beside a file shows damage.  It shows no intent: who can write the file can write the digest.  So each folder, link and file that a
path leads through is looked at, from the root on.  Where nobody else can write any of them, nobody else can exchange a file between its
check and its use.  A group that shares a cache on purpose is named by $CUTJOINT_CACHE_GROUP.
"""

import os
import shlex
import stat
import sys
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from cutjoint.package.errors import ToolchainError
from cutjoint.package.system import IS_WINDOWS, user

if sys.platform != "win32":
    import grp
    import pwd

#: The environment variable with the name or number of a group that shares the cache.
GROUP = "CUTJOINT_CACHE_GROUP"

#: The largest number of links on a path, as in Linux.
_MOST_LINKS = 40


@dataclass(frozen=True, kw_only=True)
class Trust:
    """The owners and writers of the files of a ``store``; ``installed`` if it is the installation's.  Files of one of ``groups`` may be
    written by its members, and files of the group that ``shares`` the store may have any owner."""

    store: Path
    installed: bool
    owners: frozenset[int]
    groups: frozenset[int]
    shares: int | None

    def require(self, path: Path) -> None:
        """Check all that a path in the store leads through; what is not there is no fault.
        Raises ToolchainError: somebody else owns a part of it, or can write there."""
        if IS_WINDOWS:  # access lists keep others out of a user's folders
            return
        top, host = self.store.resolve(), Path("/").lstat().st_uid
        for part, found, is_last in _parts(path):
            is_inside = is_last or part.is_relative_to(top)
            if not self._is_owner(found) and (is_inside or found.st_uid != host):  # in a user namespace the host's root has another number
                raise self._fault(part, f"belongs to {_user(found.st_uid)}", "have it removed" if is_inside else "")
            if not stat.S_ISLNK(found.st_mode) and (is_inside or not found.st_mode & stat.S_ISVTX):
                self._require_unwritable(part, found, top)

    def settle(self, path: Path) -> None:
        """Let nobody else write a new folder or file of the store, but the group that shares it."""
        if IS_WINDOWS:
            return
        mode = path.stat().st_mode & ~(stat.S_IWGRP | stat.S_IWOTH)
        if self.shares is not None:
            os.chown(path, -1, self.shares)
            mode |= (mode & (stat.S_IRUSR | stat.S_IXUSR)) >> 3  # the group reads what its owner reads
            mode |= stat.S_IWGRP | stat.S_ISGID if stat.S_ISDIR(mode) else 0
        path.chmod(stat.S_IMODE(mode))

    def _is_owner(self, found: os.stat_result) -> bool:
        return found.st_uid in self.owners or (self.shares is not None and found.st_gid == self.shares)

    def _require_unwritable(self, part: Path, found: os.stat_result, top: Path) -> None:
        place = f"-R go-w {shlex.quote(str(top))}" if part.is_relative_to(top) else f"go-w {shlex.quote(str(part))}"
        remedy = f"chmod {place} if nobody else has written there"
        if found.st_mode & stat.S_IWOTH:
            raise self._fault(part, "can be written by everybody", remedy)
        if found.st_mode & stat.S_IWGRP and found.st_gid not in self.groups:
            group = _group(found.st_gid)
            sharing = "" if self.installed else f"set ${GROUP}={group} if that group shares it on purpose"
            raise self._fault(part, f"can be written by group '{group}'", remedy, sharing)

    def _fault(self, part: Path, reason: str, *remedies: str) -> ToolchainError:
        kind, other = ("library", f"remove {self.store}") if self.installed else ("cache", "set $CUTJOINT_CACHE to a folder of your own")
        return ToolchainError(f"the {kind} {self.store} is not safe: {part} {reason}; {', or '.join(x for x in (*remedies, other) if x)}")


def trust_of(store: Path, *, installed: bool) -> Trust:
    """The users trusted with a store: this user and root; for the installation's store also users who can write the installation.
    Raises ToolchainError: there is no group of the name in $CUTJOINT_CACHE_GROUP."""
    shares = None if IS_WINDOWS else _shared_by()
    owners, groups = {0, user()}, {g for g in (_private_group(user()), shares) if g is not None}
    if installed:
        with suppress(OSError):  # a missing place has no files
            found = os.stat(sys.prefix)
            owners.add(found.st_uid)
            groups |= {found.st_gid} if found.st_mode & stat.S_IWGRP else set()
    return Trust(store=store, installed=installed, owners=frozenset(owners), groups=frozenset(groups), shares=None if installed else shares)


def _parts(path: Path) -> Iterator[tuple[Path, os.stat_result, bool]]:
    """The places that a path leads through, links too, in their order, up to a missing one; and whether it is where the path ends."""
    here, left, links = Path("/"), deque(path.absolute().parts[1:]), 0
    yield here, here.lstat(), False
    while left and links <= _MOST_LINKS:
        name = left.popleft()
        if name == "..":
            here = here.parent
            continue
        part = here / name
        try:
            found = part.lstat()
            target = Path(os.readlink(part)) if stat.S_ISLNK(found.st_mode) else None
        except OSError:
            return
        yield part, found, not left and target is None
        if target is None:
            here = part
        else:
            links += 1
            here = Path("/") if target.is_absolute() else here
            left.extendleft(reversed([x for x in target.parts if x != "/"]))


def _shared_by() -> int | None:
    """The number of the group that shares the cache; None if it belongs to the user only."""
    requested = os.environ.get(GROUP, "")
    if not requested or (requested.isascii() and requested.isdigit()):
        return int(requested) if requested else None
    try:
        return grp.getgrnam(requested).gr_gid
    except KeyError:
        raise ToolchainError(f"{GROUP}={requested}: no such group; set it to the group that shares the cache, or unset it") from None


@cache
def _private_group(number: int) -> int | None:
    """The group that has a user's name and nobody else; many systems let it write the user's files."""
    if IS_WINDOWS:
        return None
    with suppress(KeyError):
        known = pwd.getpwuid(number)
        group = grp.getgrgid(known.pw_gid)
        if known.pw_uid and group.gr_name == known.pw_name and set(group.gr_mem) <= {known.pw_name}:
            return group.gr_gid
    return None


def _user(number: int) -> str:
    with suppress(KeyError):
        return f"user '{pwd.getpwuid(number).pw_name}'"
    return f"user {number}"


def _group(number: int) -> str:
    with suppress(KeyError):
        return grp.getgrgid(number).gr_name
    return str(number)
