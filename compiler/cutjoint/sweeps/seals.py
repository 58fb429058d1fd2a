"""Digests inside Parquet files: between rows and footer, where readers pass over them."""

from __future__ import annotations

import os
from hashlib import sha256
from typing import BinaryIO

#: The bytes of a digest, those behind a footer (its length and a mark), and how many are read at a time.
_DIGEST, _TAIL, _BLOCK = 32, 8, 1 << 20


def seal(file: BinaryIO, label: str) -> None:
    """Put the digest of a ``label`` and of all its bytes into a Parquet file that is open for reading and writing."""
    footer = _find_footer(file)
    digest = _digest(file, label, footer, footer)
    file.seek(footer)
    rest = file.read()
    file.seek(footer)
    file.write(digest + rest)


def is_sealed(file: BinaryIO, label: str) -> bool:
    """True where a file is, byte by byte, as it was sealed with that label."""
    footer = _find_footer(file)
    rows = footer - _DIGEST
    if rows < 0:
        return False
    file.seek(rows)
    return file.read(_DIGEST) == _digest(file, label, rows, footer)


def _find_footer(file: BinaryIO) -> int:
    """The place at which a file's footer would begin; below 0 where it cannot have one."""
    size = file.seek(0, os.SEEK_END)
    if size < _TAIL:
        return -1
    file.seek(size - _TAIL)
    return size - _TAIL - int.from_bytes(file.read(4), "little")


def _digest(file: BinaryIO, label: str, rows: int, footer: int) -> bytes:
    """The digest of a label, of the bytes up to the end of ``rows`` and of those from the ``footer`` on."""
    digest = sha256(label.encode())
    file.seek(0)
    left = rows
    while left and (block := file.read(min(left, _BLOCK))):
        digest.update(block)
        left -= len(block)
    file.seek(footer)
    while block := file.read(_BLOCK):
        digest.update(block)
    return digest.digest()
