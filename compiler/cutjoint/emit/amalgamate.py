"""The headers of the runtime's core as one text without includes of each other."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from cutjoint.package.locations import runtime_folder

_OWN = re.compile(r'#include "(cutjoint/[^"]+)"\n')
_STANDARD = re.compile(r"#include <([^>]+)>\n")


@dataclass(frozen=True, kw_only=True)
class Amalgamation:
    """Headers of the standard library by name, ``top``, the text outside of namespaces, and ``body``, the text inside."""

    standard: tuple[str, ...]
    top: str
    body: str


def amalgamate(headers: Iterable[str]) -> Amalgamation:
    """Headers of the runtime, such as ``cutjoint/core/state.hpp``, each behind those that it includes."""
    texts: dict[str, str] = {}
    for header in headers:
        _add(header, texts)
    standard: set[str] = set()
    top, body = [], []
    for text in texts.values():
        bare = _OWN.sub("", text.replace("#pragma once\n", ""))
        if "namespace cutjoint" in bare:
            standard |= set(_STANDARD.findall(bare))
            body.append(_STANDARD.sub("", bare))
        else:
            top.append(bare)
    return Amalgamation(standard=tuple(sorted(standard)), top=_joined(top), body=_joined(body))


def _add(header: str, texts: dict[str, str]) -> None:
    if header in texts:
        return
    text = (runtime_folder() / "include" / header).read_text(encoding="utf-8")
    for other in _OWN.findall(text):
        _add(other, texts)
    texts[header] = text


def _joined(texts: Iterable[str]) -> str:
    """Texts behind each other, with one empty line at most."""
    return re.sub(r"\n{3,}", "\n\n", "\n".join(texts)).strip("\n") + "\n"
