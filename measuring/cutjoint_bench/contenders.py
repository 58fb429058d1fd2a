"""The contenders by name.  A method of the compiler is one as soon as the pipeline knows it, a peer as soon as it is exported to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from cutjoint.package.errors import RunError
from cutjoint_bench.asked_contenders import asked_contenders
from cutjoint_bench.cutjoint_contenders import cutjoint_contenders, precision_contenders
from cutjoint_bench.peer_contenders import peer_contenders
from cutjoint_bench.records import Contender
from cutjoint_bench.reductions import reduced_contenders

_ALL = (*cutjoint_contenders(), *reduced_contenders(), *asked_contenders(), *precision_contenders(), *peer_contenders())

CONTENDERS: Mapping[str, Contender] = {c.name: c for c in _ALL}


def choose(names: Sequence[str]) -> list[Contender]:
    """The contenders of these names; a group's name stands for all that it has and that are available.

    Raises:
        RunError: there is none of a name.
    """
    chosen: dict[str, Contender] = {}
    for name in names:
        found = [c for c in CONTENDERS.values() if name in (c.name, c.group) and (c.name == name or c.available())]
        if not found:
            raise RunError(f"no contender '{name}'; there is {', '.join(CONTENDERS)}; groups: {', '.join(groups())}")
        chosen |= {c.name: c for c in found}
    return list(chosen.values())


def groups() -> list[str]:
    """The groups of contenders."""
    return list(dict.fromkeys(c.group for c in CONTENDERS.values()))
