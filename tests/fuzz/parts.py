"""Parts of sweeps that are damaged before a call and while it runs: the table is the right one or the call fails, and nothing is lost."""

from __future__ import annotations

import json
import random
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.sweeps.damaged import CUTS, DAMAGES, PARTS, Harm, begin, call, files, require_sound, write_study


def make(rng: random.Random) -> str:
    """Damage to the parts of an earlier call (none where there was none), and after so many parts of this one, as JSON."""
    files(CUTS)  # what it needs is compiled then
    names = list(DAMAGES)
    before = rng.choices(names, k=rng.randrange(4))
    meanwhile = {str(rng.randrange(1, 8)): rng.choice(names) for _ in range(rng.randrange(3))}
    return json.dumps({"begun": rng.random() < 0.9, "before": before, "meanwhile": meanwhile, "seed": rng.randrange(10**6)})


def check(text: str) -> tuple[str, ...]:
    """The reason why a call failed; raises where it gives another table, no reason, or less than there was."""
    case = json.loads(text)
    with TemporaryDirectory() as name:
        folder = Path(name)
        harm = Harm(begin(folder) if case["begun"] else folder / PARTS, random.Random(case["seed"]))
        write_study(folder)
        for damage in case["before"] if case["begun"] else ():
            harm.do(damage)
        done = call(folder, lambda number: harm.do(case["meanwhile"][str(number)]) if str(number) in case["meanwhile"] else None)
        require_sound(folder, done, harm.users)
        return () if done.exit_code == 0 else (done.output.strip(),)
