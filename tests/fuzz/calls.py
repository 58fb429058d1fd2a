"""Command lines with values from the tables of tests/edges for up to three options."""

from __future__ import annotations

import json
import os
import random
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.edges.calling import call, compile_first, faults, set_up
from tests.edges.commands import LONG, call_with, commands, reads_model
from tests.edges.values import bad_values


def make(rng: random.Random) -> str:
    """The words of a call, as JSON; at least one value is bad where the command would take minutes."""
    compile_first()
    name = rng.choice([n for n in commands() if rng.random() < 0.2 or n not in LONG])
    known = [(option, list(bad_values(option, reads_model=reads_model(name)))) for option in commands()[name].params]
    known = [(option, values) for option, values in known if values]
    chosen = rng.sample(known, min(len(known), rng.choice((1, 1, 2, 3))))
    if name in LONG:
        chosen = [(option, [v for v in values if v[1]]) for option, values in chosen]
    return json.dumps(call_with(name, [(option, rng.choice(values)[0]) for option, values in chosen]))


def check(text: str) -> tuple[str, ...]:
    """The reason why a call was refused; fails where it ends in a traceback, not at all, or with the user's files changed."""
    words = json.loads(text)
    before = os.getcwd()
    with TemporaryDirectory() as folder:
        try:
            content = set_up(Path(folder) / "in")
            ended = call(words)
            found = list(faults(ended, content if reads_model(words[0]) else {}, refused=False))
        finally:
            os.chdir(before)
    assert not found, "; ".join(found)
    return (ended.said.strip().splitlines()[0],) if ended.status else ()
