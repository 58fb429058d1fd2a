"""Pages that were written before, read again as a run to lie under another one.  Like a model file a page is data: nothing of it runs."""

import base64
import json
import re
from binascii import Error as EncodingError
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

from cutjoint.package.errors import RunError
from cutjoint.view.glb import read_glb
from cutjoint.view.gltf import packed
from cutjoint.view.records import Array

#: The largest size of a page, bytes: more than any that is written.
_LARGEST = 60_000_000


@dataclass(frozen=True, kw_only=True)
class GhostRun:
    """A run of a page: its ``name`` for people, its animation as a .glb file, and columns over times ``t`` (s) with units, by name."""

    name: str
    glb: bytes
    t: Array
    columns: Mapping[str, Array]
    units: Mapping[str, str]


def read_page(path: Path, option: str) -> GhostRun:
    """The run of a page. Raises RunError: the file is no such page, or a page without a run."""
    try:
        with path.open("rb") as file:
            content = file.read(_LARGEST + 1)
        if len(content) > _LARGEST:
            raise ValueError
        return _read(path.name, content.decode("utf-8"))
    except (ValueError, LookupError, TypeError, AttributeError, EncodingError, RecursionError):
        raise RunError(f"{option} {path}: not a page of a run; write one with simulate --view") from None


def _read(file: str, text: str) -> GhostRun:
    about = json.loads(_element(text, "about"))
    glb, table = (base64.b64decode(_element(text, name), validate=True) for name in ("glb", "table"))
    names = [str(column["name"]) for column in about["columns"]]
    rows = np.frombuffer(table, "<f4").reshape(len(names) + 1, -1).astype(np.float64)
    if about["motions"] or rows.shape[1] < 2 or not np.isfinite(rows[0]).all() or not (np.diff(rows[0]) > 0).all():
        raise ValueError
    what = ", ".join(str(about[key]) for key in ("title", "scene", "note") if about[key])
    return GhostRun(
        name=f"{file}: {what}", glb=_copied(glb), t=rows[0], columns=dict(zip(names, rows[1:], strict=True)),
        units={name: str(column["unit"]) for name, column in zip(names, about["columns"], strict=True)},
    )  # fmt: skip


def _element(text: str, name: str) -> str:
    found = re.search(f'<script type="application/[a-z-]+" id="{name}"(?: data-crc="([0-9]+)")?>([^<]*)</script>', text)
    if found is None or (found[1] and int(found[1]) != crc32(found[2].encode())):
        raise ValueError(name)
    return found[2]


def _copied(content: bytes) -> bytes:
    """A .glb file with what is known of a sound one: no material, image or extension of a page gets into another."""
    glb = read_glb(content)
    for i, accessor in enumerate(glb.document.accessors):  # normals and those of other scenes too
        glb.numbers(i, accessor.type)
        if not all(isinstance(extent, list) and {*map(type, extent)} <= {int, float} for extent in (accessor.min, accessor.max)):
            raise ValueError
    sum(1 for _ in glb.triangles())  # reads all of them
    for animation in glb.document.animations:
        for channel in animation["channels"]:
            sampler, target = animation["samplers"][channel["sampler"]], channel["target"]
            times = glb.numbers(sampler["input"], "SCALAR")
            moves = glb.numbers(sampler["output"], "VEC4" if target["path"] == "rotation" else "VEC3")
            indices = channel["sampler"], sampler["input"], sampler["output"], target["node"]
            known = target["path"] in ("translation", "rotation", "scale") and sampler.get("interpolation", "LINEAR") in ("LINEAR", "STEP")
            if not known or min(indices) < 0 or target["node"] >= len(glb.document.nodes) or len(moves) != len(times):
                raise ValueError
    copy = glb.document.model_dump(by_alias=True, exclude_unset=True, exclude_none=True, exclude={"extensions_required"})
    if not _is_whole(copy):
        raise ValueError
    return packed(copy, glb.binary)


def _is_whole(part: Any) -> bool:
    """Whether no null stands in it, at which a page's script would fail."""
    return part is not None and all(map(_is_whole, part.values() if isinstance(part, dict) else part if isinstance(part, list) else ()))
