"""What was measured, kept line by line, so that an interrupted bench goes on where it stopped."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

Record = dict[str, Any]


class Store:
    """A file with a record a line: its key, what it is of, and the result."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._known: dict[str, Record] = {}
        path.parent.mkdir(parents=True, exist_ok=True)
        text = path.read_text(encoding="utf-8") if path.exists() else ""
        for line in text.splitlines():
            self._take(line)
        if text and not text.endswith("\n"):
            self._append("\n")  # others may write too

    def _take(self, line: str) -> None:
        try:
            record = json.loads(line)
        except json.JSONDecodeError:  # the end of a run that was broken off
            return
        self._known[record["key"]] = record

    def get(self, of: Mapping[str, Any], make: Callable[[], Record]) -> Record:
        """The result of what ``of`` describes in full; made and kept if there is none yet."""
        key = sha256(json.dumps(of, sort_keys=True).encode()).hexdigest()[:32]
        if key not in self._known:
            record = {"key": key, "of": dict(of), "result": make()}
            self._append(json.dumps(record) + "\n")
            self._known[key] = record
        result: Record = self._known[key]["result"]
        return result

    def _append(self, text: str) -> None:
        with self._path.open("a", encoding="utf-8") as stream:
            stream.write(text)


def write_whole(path: Path, text: str) -> Path:
    """Write a file so that nobody sees half of it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f"{path.name}.part")
    part.write_text(text, encoding="utf-8", newline="\n")
    part.replace(path)
    return path
