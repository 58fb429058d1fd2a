"""Measurements stored line by line, so that an interrupted bench goes on where it stopped."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any

Record = dict[str, Any]


class Store:
    """A file with a record a line: its key, what it is of, the result, and a digest of these; other lines are passed over."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._known: dict[str, Record] = {}
        path.parent.mkdir(parents=True, exist_ok=True)
        text = path.read_text(encoding="utf-8", errors="replace") if path.exists() else ""
        for line in text.splitlines():
            self._take(line)
        if text and not text.endswith("\n"):
            self._append("\n")  # others may write too

    def _take(self, line: str) -> None:
        with suppress(ValueError, TypeError, KeyError, AttributeError, RecursionError):  # broken off, or damaged
            record = json.loads(line)
            if record.pop("digest") == _digest(record):
                self._known[record["key"]] = record

    def get(self, of: Mapping[str, Any], make: Callable[[], Record]) -> Record:
        """The result of what ``of`` describes in full; made and stored if there is none yet."""
        key = _digest(of)
        if key not in self._known:
            record = {"key": key, "of": dict(of), "result": make()}
            self._append(json.dumps({**record, "digest": _digest(record)}) + "\n")
            self._known[key] = record
        result: Record = self._known[key]["result"]
        return result

    def _append(self, text: str) -> None:
        with self._path.open("a", encoding="utf-8") as stream:
            stream.write(text)


def _digest(data: Mapping[str, Any]) -> str:
    return sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()[:32]
