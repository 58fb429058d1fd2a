"""Digests by which entries of the cache are found."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence, Set
from functools import cache
from pathlib import Path

from cutjoint.package.locations import runtime_folder

#: Parts of the runtime that only one kind of simulator has: batches, and the interpreter.
_PARTS = ("batch", "interpreter")


def digest_of(parts: Sequence[str]) -> str:
    """A digest of texts, as names of files have it."""
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:32]


@cache
def runtime_digest(*, part: str = "") -> str:
    """A digest of the runtime's headers and sources; of those that only one kind of simulator has, with its ``part``."""
    return tree_digest(runtime_folder(), left_out={*_PARTS} - {part})


def tree_digest(folder: Path, *, left_out: Set[str] = frozenset()) -> str:
    """A digest of the C++ in a folder and of its projects, but for folders and files of some names."""
    files = sorted(p for p in folder.rglob("*") if p.suffix in (".hpp", ".cpp", ".txt", ".cmake"))
    files = [p for p in files if left_out.isdisjoint(p.relative_to(folder).with_suffix("").parts)]
    return digest_of([text for p in files for text in (str(p.relative_to(folder)), p.read_text(encoding="utf-8"))])
