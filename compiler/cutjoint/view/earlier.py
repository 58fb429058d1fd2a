"""Pages that were written before, read again as a run to lie under another one.  Like a model file a page is data: nothing of it runs."""

from __future__ import annotations

import base64
import json
import re
import struct
from binascii import Error as EncodingError
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cutjoint.run.errors import RunError
from cutjoint.view.records import Array

#: Bytes of a page: more than any that is written.
_LARGEST = 60_000_000


@dataclass(frozen=True, kw_only=True)
class Earlier:
    """A run of a page: its ``name`` for people, the .glb file, times (s), and columns by name."""

    name: str
    glb: bytes
    t: Array
    columns: Mapping[str, Array]


def read_page(path: Path, option: str) -> Earlier:
    """The run of a page.

    Raises:
        RunError: the file is no such page, or a page without a run.
    """
    try:
        with path.open("rb") as file:
            content = file.read(_LARGEST + 1)
        if len(content) > _LARGEST:
            raise ValueError
        return _read(path.name, content.decode("utf-8"))
    except (ValueError, KeyError, TypeError, AttributeError, EncodingError, RecursionError, struct.error):
        raise RunError(f"{option} {path}: not a page of a run; write one with simulate --view") from None


def _read(file: str, text: str) -> Earlier:
    about = json.loads(_part(text, "about"))
    glb, table = (base64.b64decode(_part(text, name), validate=True) for name in ("glb", "table"))
    _require_alone(glb)
    names = [str(column["name"]) for column in about["columns"]]
    rows = np.frombuffer(table, "<f4").reshape(len(names) + 1, -1).astype(np.float64)
    if about["motions"] or rows.shape[1] < 2 or not np.isfinite(rows[0]).all() or not (np.diff(rows[0]) > 0).all():
        raise ValueError
    what = ", ".join(str(about[key]) for key in ("title", "scene", "note") if about[key])
    return Earlier(name=f"{file}: {what}", glb=glb, t=rows[0], columns=dict(zip(names, rows[1:], strict=True)))


def _part(text: str, name: str) -> str:
    found = re.search(f'<script type="application/[a-z-]+" id="{name}">([^<]*)</script>', text)
    if found is None:
        raise ValueError(name)
    return found[1]


def _require_alone(glb: bytes) -> None:
    """Check that a .glb file asks for nothing that is not in it."""
    magic, version, size, length = struct.unpack_from("<4sIII", glb)
    document: dict[str, Any] = json.loads(glb[20 : 20 + length])
    outside = [part for part in document.get("buffers", []) if "uri" in part]
    if (magic, version, size) != (b"glTF", 2, len(glb)) or outside or document.keys() & {"images", "textures", "extensionsUsed"}:
        raise ValueError
