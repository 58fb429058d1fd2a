"""A kind of input that is fuzzed, and what has happened to the inputs of one kind."""

from __future__ import annotations

import hashlib
import random
import re
import time
import traceback
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from .limits import HangError, at_most

CORPUS = Path(__file__).parent / "corpus"
SHOWN = 3


@dataclass(frozen=True, kw_only=True)
class Kind:
    """Inputs of one kind.

    ``make`` has one from a random number generator, as text, and compiles what the check needs.  ``check`` has why it was refused, nothing
    where it was not, and raises where it was neither accepted nor refused as it should be.
    ``suffix`` is that of a kept input.  ``share`` is of the fuzzing's time, beside those of the other kinds, ``limit`` the seconds after
    which one hangs, of the process's work unless it waits for others.
    """

    name: str
    suffix: str
    make: Callable[[random.Random], str]
    check: Callable[[str], tuple[str, ...]]
    share: float = 1.0
    limit: float = 60.0
    waits: bool = True

    def try_one(self, text: str) -> tuple[str, ...]:
        """Check a text, which ends in time."""
        with at_most(self.limit, busy=not self.waits):
            return self.check(text)

    def corpus(self) -> list[Path]:
        """The inputs that failed once."""
        return sorted(CORPUS.glob(f"*{self.suffix}"))


@dataclass(kw_only=True)
class Tally:
    """Outcomes of inputs, counted; ``messages`` and ``reasons`` count refusals and failures by their text without names and numbers.

    ``failed`` has the seeds of all failures; inputs are kept of the first with each reason.  ``seconds`` are all on the clock, ``checked``
    those of the checks.
    """

    tried: int = 0
    accepted: int = 0
    failed: list[int] = field(default_factory=list)
    messages: Counter[str] = field(default_factory=Counter)
    reasons: Counter[str] = field(default_factory=Counter)
    slowest: list[tuple[float, int]] = field(default_factory=list)
    seconds: float = 0.0
    checked: float = 0.0

    def add(self, other: Tally) -> None:
        """Count what another tally has."""
        self.tried += other.tried
        self.accepted += other.accepted
        self.failed += other.failed
        self.messages += other.messages
        self.reasons += other.reasons
        self.seconds += other.seconds
        self.checked += other.checked
        self.slowest = sorted([*self.slowest, *other.slowest], reverse=True)[:SHOWN]

    def run(self, kind: Kind, seed: int) -> None:
        """One input."""
        start = time.monotonic()
        text = kind.make(random.Random(seed))
        begin = time.monotonic()
        problems: tuple[str, ...] = ()
        try:
            problems = kind.try_one(text)
            self.accepted += not problems
        except (Exception, HangError) as error:
            self._fail(kind, seed, text, error)
        self.tried += 1
        self.messages.update({_plain(problem.split(": ", 2)[-1]) for problem in problems})
        seconds = time.monotonic() - begin
        self.checked += seconds
        self.seconds += begin + seconds - start
        self.slowest = sorted([*self.slowest, (seconds, seed)], reverse=True)[:SHOWN]

    def _fail(self, kind: Kind, seed: int, text: str, error: BaseException) -> None:
        self.failed.append(seed)
        reason = _plain(f"{kind.name}: {type(error).__name__} {str(error)[:200]}")
        self.reasons[reason] += 1
        if reason not in _KNOWN:
            _KNOWN.add(reason)
            print(f"{kind.name}, seed {seed}: kept as {_keep(kind, seed, text)}\n{traceback.format_exc(limit=-4)}", flush=True)

    def summary(self, name: str) -> str:
        """The figures in a few lines."""
        slow = ", ".join(f"{seconds:.2f} s (seed {seed})" for seconds, seed in self.slowest)
        refused = self.tried - self.accepted - len(self.failed)
        lines = [
            f"{name}: {self.tried} tried in {self.seconds:.0f} s, {self.accepted} accepted, {refused} refused with {len(self.messages)} "
            f"different messages, {len(self.failed)} failed; {1000 * self.checked / max(1, self.tried):.1f} ms each, slowest {slow}"
        ]
        return "\n".join([*lines, *(f"    {count} times {reason}" for reason, count in self.reasons.most_common())])


#: The reasons of failures that this process has met.
_KNOWN: set[str] = set()


def _plain(text: str) -> str:
    """A message without names and numbers."""
    return re.sub(r"'[^']*'|\"[^\"]*\"|[-+.\d]+", "_", text)


def _keep(kind: Kind, seed: int, text: str) -> str:
    """Put an input into the corpus, and its seed into the list there."""
    content = text.encode("utf-8", "surrogateescape")
    path = CORPUS / f"found_{hashlib.sha256(content).hexdigest()[:12]}{kind.suffix}"
    if not path.exists():
        path.write_bytes(content)
        with (CORPUS / "seeds.csv").open("a", encoding="utf-8") as seeds:
            seeds.write(f"{path.name},{kind.name},{seed}\n")
    return path.name
