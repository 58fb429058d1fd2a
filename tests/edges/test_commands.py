"""Every command with every option that takes a path, a number or a text, over a table of bad values: a message and status 1 or 2,
soon, and nothing of the user's is lost."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from pathlib import Path

import click
import pytest

from tests.conftest import needs_cpp

from .calling import call, compile_first, faults, set_up
from .commands import LONG, READ, call_with, commands, is_path, options, reads_model
from .values import FOLDER, MODEL, bad_values

pytestmark = needs_cpp


@pytest.mark.parametrize(("name", "option"), list(options()), ids=lambda x: x if isinstance(x, str) else x.name)
def test_bad_values(name: str, option: click.Parameter, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compile_first(name)
    monkeypatch.chdir(tmp_path)
    found = []
    for i, (value, refused) in enumerate(bad_values(option, reads_model=reads_model(name))):
        if name in LONG and not refused:
            continue
        before = set_up(tmp_path / str(i))
        ended = call(call_with(name, [(option, value)]))
        found += [f"{value[:40]!r}: {fault}" for fault in faults(ended, before if reads_model(name) else {}, refused=refused)]
        if ended.status is None:
            break  # the next one would take as long
    assert not found, "\n".join(found)


def pairs() -> Iterator[tuple[str, click.Parameter, click.Parameter]]:
    """Two paths of one command, at least one of which it writes."""
    for name, command in commands().items():
        written = [o for o in command.params if is_path(o, written=True)]
        read = [o for o in command.params if is_path(o, written=False)]
        yield from ((name, one, other) for one, other in combinations(written, 2))
        yield from ((name, one, other) for one in read for other in written)


@pytest.mark.parametrize(("name", "one", "other"), list(pairs()), ids=lambda x: x if isinstance(x, str) else x.name)
def test_two_paths_are_not_one(
    name: str, one: click.Parameter, other: click.Parameter, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A command writes neither over its inputs nor over another output of its own, however the two are spelled."""
    monkeypatch.chdir(tmp_path)
    before = set_up(tmp_path / "in")
    same = "both" if is_path(one, written=True) else READ.get(one.name or "", MODEL)
    ended = call(call_with(name, [(one, same), (other, f"{FOLDER}/../{same}")]))
    assert not list(faults(ended, before, refused=True))
