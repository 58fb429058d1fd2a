"""A call of the command line in this process, on the files of a user, and what is wrong with its end."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.commands import options
from tests.fuzz.limits import HangError, at_most, at_most_bytes
from tests.fuzz.press import press

from .commands import good_calls
from .values import DATA, FIT, FOLDER, HARD_LINK, LINK, MODEL, ROBOT, STUDY, TABLE

#: Seconds that a call may take on an idle machine.
LIMIT = 10.0
#: Bytes that it may take.
MEMORY = 16 * 2**30


#: Two runs of the model.
_STUDY = f"""
cutjoint_study: 1
model: {MODEL}
end: 0.01
parameters: {{stiffness: [1000, 3000]}}
objectives: {{top: {{maximum: slider.x}}}}
"""


#: A fit of one number to three samples.
_FIT = f"""
cutjoint_fit: 1
model: {MODEL}
integrator: rk4
dt: 1 ms
parameters: {{stiffness: {{from: 100, to: 1e4}}}}
experiments: {{run: {{data: {DATA}, from: 0, signals: {{slider.x: {{deviation: 1e-2}}}}}}}}
"""


@dataclass(frozen=True, kw_only=True)
class Ended:
    """The end of a call: its ``status``, all that it ``said``, and the ``error`` where it did not end by itself."""

    status: int | None
    said: str
    error: str


def set_up(folder: Path) -> dict[str, bytes]:
    """Write a user's files into a folder: a model, two links to it, a table of cases, a study; returns the content of each by its name."""
    folder.mkdir()
    os.chdir(folder)
    Path(MODEL).write_text(press(), encoding="utf-8")
    Path(TABLE).write_text("stiffness\n1000\n3000\n", encoding="utf-8")
    Path(STUDY).write_text(_STUDY, encoding="utf-8")
    Path(FIT).write_text(_FIT, encoding="utf-8")
    Path(DATA).write_text("t,slider.x\n0.1,0.36\n0.15,0.35\n0.2,0.3\n", encoding="utf-8")
    Path(ROBOT).write_text('<robot name="robot"><link name="base"/></robot>', encoding="utf-8")
    Path(LINK).symlink_to(MODEL)
    Path(HARD_LINK).hardlink_to(MODEL)
    Path("loop").symlink_to("loop")
    Path(FOLDER).mkdir()
    return {name: Path(name).read_bytes() for name in (MODEL, TABLE, STUDY, FIT, DATA, ROBOT, LINK, HARD_LINK)}


@cache
def compile_first(name: str = "*") -> None:
    """Call a command, or every one, with good values, but for what takes minutes: what it compiles is in the cache then."""
    before = os.getcwd()
    try:
        with TemporaryDirectory() as folder:
            for i, words in enumerate(words for words in good_calls() if name in ("*", words[0])):
                set_up(Path(folder) / str(i))
                result = CliRunner().invoke(main, words)
                assert result.exit_code == 0, f"{' '.join(words)}: {result.output[-600:]}"
    finally:
        os.chdir(before)


def call(words: Sequence[str]) -> Ended:
    """Call a command; on a busy machine it may take as much longer."""
    busy = max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))
    for console in (options.out, options.err):
        console._buffer.clear()  # what an earlier call could not print, which another process would not have
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            with at_most(LIMIT * busy), at_most_bytes(MEMORY):
                result = CliRunner().invoke(main, list(words))
        except HangError as hang:
            return Ended(status=None, said="", error=str(hang))
    error = "" if isinstance(result.exception, SystemExit | None) else f"{type(result.exception).__name__}: {result.exception}"
    said = "".join([result.output, *(f"{w.category.__name__}: {w.message}" for w in caught if issubclass(w.category, RuntimeWarning))])
    return Ended(status=result.exit_code, said=said, error=error)


def faults(ended: Ended, before: Mapping[str, bytes], *, refused: bool) -> Iterator[str]:
    """Faults of the end of a call; ``before`` has the files that it leaves alone."""
    if ended.error:
        yield ended.error[:300]
    elif ended.status not in ((1, 2) if refused else (0, 1, 2)):
        yield f"status {ended.status}"
    elif ended.status and not ended.said.strip():
        yield "no message"
    yield from (f"says {word!r}: {ended.said[:300]!r}" for word in ("Traceback", "Warning", "please report", "\x1b") if word in ended.said)
    yield from (f"{name} is another file now" for name, content in before.items() if not _same(Path(name), content))


def _same(path: Path, content: bytes) -> bool:
    return path.is_file() and path.read_bytes() == content
