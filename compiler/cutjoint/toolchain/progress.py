"""The progress of the compiler and a forecast of its time, by the times of the same files before.

A caller listens by `listening`.  The seconds of each file are a record of the cache, for all models.  They serve forecasts alone: where the
record is missing or of another machine, nothing else goes wrong.
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from cutjoint.package.errors import ToolchainError
from cutjoint.package.system import processors
from cutjoint.toolchain.cache import cache_folder, digest_of, read_record, write_record


@dataclass(frozen=True, kw_only=True)
class Compiling:
    """Progress of a compilation: ``done`` files of ``total``, and the ``seconds`` that the others take.
    ``seconds`` is None if one of them has not been compiled before. ``share``: parts of the drivers, which all models share, are among the
    others."""

    done: int
    total: int
    seconds: float | None
    share: bool = False


Listener: TypeAlias = Callable[[Compiling], None]

#: The beginning of Ninja's line about a file that it has made, or would make; the file comes last.
STATUS = "[%f/%t] "
#: The prefix of the names of a driver's files.
_DRIVER = "driver/"
#: Typical time per byte of generated code, s; long functions of vehicles take twice as long.
_USUAL = 8e-6

_LINE = re.compile(r"\[\d+/\d+\] .*?(\S+)$")

_listener: ContextVar[Listener | None] = ContextVar("listener", default=None)


@contextmanager
def listening(listener: Listener) -> Iterator[None]:
    """Context in which a listener is called with the progress of compiling."""
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)


def forecast(sources: Mapping[str, int], how: Sequence[str]) -> float:
    """The time to compile ``sources``, given with their bytes, s: as files of these names took, else as generated code usually takes."""
    took = {_source_of(name): seconds / size for name, (seconds, size) in _read().get(digest_of(how), {}).items() if size}
    return _spread([size * took.get(name, _USUAL) for name, size in sources.items()])


def made_file(line: str) -> str | None:
    """The file that a line of Ninja names."""
    found = _LINE.match(line.rstrip())
    return found[1] if found else None


class Watch:
    """Follows Ninja through the ``planned`` files of a project in ``source``, which ``how`` (compiler, flags) says how to compile."""

    def __init__(self, source: Path, how: Sequence[str], planned: Sequence[str]) -> None:
        self._source, self._key, self._total, self._left = source, digest_of(how), len(planned), list(planned)
        self._known: Mapping[str, Any] = _read().get(self._key, {})

    def notify(self) -> None:
        """Report progress to the listener."""
        if (listener := _listener.get()) is not None:
            share = any(name.startswith(_DRIVER) for name in self._left)
            listener(Compiling(done=self._total - len(self._left), total=self._total, seconds=self._seconds(), share=share))

    def finish(self, name: str) -> None:
        """A file has been built."""
        if name in self._left:
            self._left.remove(name)
        self.notify()

    def keep(self, log: Path) -> None:
        """Store the times of files from Ninja's log."""
        lines = [line.split("\t") for line in log.read_text(encoding="utf-8", errors="replace").splitlines() if not line.startswith("#")]
        took = {x[3]: [(int(x[1]) - int(x[0])) / 1000, self._size(x[3])] for x in lines if len(x) == 5}
        every = _read()
        with suppress(ToolchainError):
            write_record(_place(), {**every, self._key: {**every.get(self._key, {}), **took}})

    def _seconds(self) -> float | None:
        if not all(name in self._known for name in self._left):
            return None
        took = ((*self._known[name], self._size(name)) for name in self._left)
        return _spread([seconds * (now / before if before and now else 1.0) for seconds, before, now in took])

    def _size(self, name: str) -> int:
        file = self._source / _source_of(name)
        return file.stat().st_size if file.is_file() else 0


def _source_of(name: str) -> str:
    return "/".join(Path(name.removesuffix(".o")).parts[2:])


def _spread(each: Sequence[float]) -> float:
    """The total time of files that this machine's processors compile in parallel, s."""
    return max(sum(each) / processors(), *each) if each else 0.0


def has_listener() -> bool:
    """Return whether there is a listener."""
    return _listener.get() is not None


def _place() -> Path:
    return cache_folder() / "seconds"


def _read() -> dict[str, Any]:
    return read_record(_place()) or {}
