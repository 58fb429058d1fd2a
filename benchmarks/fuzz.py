"""Fuzzes expressions and model files for a given time: `make fuzz`, or `python -m benchmarks.fuzz SECONDS [FIRST_SEED]`.

Prints what was tried, accepted and refused, and the slowest inputs; every input that fails is kept in tests/fuzz/corpus.
"""

from __future__ import annotations

import hashlib
import random
import re
import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from tests.fuzz.chain import run_chain
from tests.fuzz.expressions import any_text
from tests.fuzz.models import any_model
from tests.fuzz.pipeline import compile_text

CORPUS = Path(__file__).resolve().parents[1] / "tests" / "fuzz" / "corpus"
SHOWN = 3


@dataclass
class Tally:
    """What has happened to the inputs of one kind; ``messages`` counts the refusals by their text without names and numbers."""

    suffix: str
    make: Callable[[random.Random], str]
    check: Callable[[str], tuple[str, ...]]
    tried: int = 0
    accepted: int = 0
    failed: int = 0
    messages: Counter[str] = field(default_factory=Counter)
    slowest: list[tuple[float, int]] = field(default_factory=list)

    def run(self, seed: int) -> None:
        """One input."""
        text = self.make(random.Random(seed))
        begin = time.process_time()
        try:
            problems = self.check(text)
        except Exception:
            self.failed += 1
            path = CORPUS / f"found_{hashlib.sha256(text.encode('utf-8', 'replace')).hexdigest()[:12]}{self.suffix}"
            path.write_text(text, encoding="utf-8", errors="replace")
            print(f"seed {seed}: kept as {path.name}\n{traceback.format_exc(limit=-4)}", flush=True)
            problems = ("failed",)
        self.tried += 1
        self.accepted += not problems
        self.messages.update({re.sub(r"'[^']*'|[-+.\d]+", "_", p.split(": ", 2)[-1]) for p in problems if p != "failed"})
        self.slowest = sorted([*self.slowest, (time.process_time() - begin, seed)], reverse=True)[:SHOWN]

    def summary(self, name: str) -> str:
        """The figures in a few lines."""
        slow = ", ".join(f"{seconds:.2f} s (seed {seed})" for seconds, seed in self.slowest)
        refused = self.tried - self.accepted - self.failed
        return (
            f"{name}: {self.tried} tried, {self.accepted} accepted, {refused} refused with {len(self.messages)} different messages, "
            f"{self.failed} failed; slowest {slow}"
        )


def _check_text(text: str) -> tuple[str, ...]:
    message = run_chain(text)
    return (message,) if message else ()


def _check_model(text: str) -> tuple[str, ...]:
    return compile_text(text).problems


def main() -> int:
    """Status 0 when nothing failed."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 300.0
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else int(time.time())
    tallies = {"expressions": Tally(".txt", any_text, _check_text), "model files": Tally(".yaml", any_model, _check_model)}
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        tallies["model files"].run(seed)
        for offset in range(3):
            tallies["expressions"].run(3 * seed + offset)
        seed += 1
    for name, tally in tallies.items():
        print(tally.summary(name))
    return 1 if any(tally.failed for tally in tallies.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
