"""The rungs of a scene's ladder as contenders: what each pass leaves of the model, by every method."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial

from cutjoint.methods import METHODS
from cutjoint.pipeline import compile_scene, generate
from cutjoint.reduce.ladder import APPROXIMATIONS, ROLLING, STEPS, Rung, climb
from cutjoint.run.errors import RunError
from cutjoint_bench.own import OwnRunner, identity
from cutjoint_bench.records import Case, Contender

#: What a rung is called after: all passes.
NAMES = tuple(step.name for step in (*STEPS, *APPROXIMATIONS, ROLLING))


class NoRungError(RunError):
    """A scene's ladder has no rung of that name."""


def rung_contenders() -> Iterator[Contender]:
    """Each pass with each method; those that leave a scene as it is refuse it."""
    for method in METHODS:
        for name in NAMES:
            yield Contender(
                name=f"{method}/{name.replace(' ', '-')}", label=f"{method}, {name}", group="rungs",
                prepare=partial(_prepare, method=method, name=name), identify=partial(_identify, method=method, name=name),
            )  # fmt: skip


def _prepare(case: Case, *, method: str, name: str) -> OwnRunner:
    rung = _rung(case, method, name)
    return OwnRunner(artifact=compile_scene(rung.model, rung.scene, method=method), parameters=case.parameters)


def _identify(case: Case, *, method: str, name: str) -> Mapping[str, str]:
    rung = _rung(case, method, name)
    return identity(generate(rung.model, rung.scene, rung.scene.outputs, method=method)[-1])


def _rung(case: Case, method: str, name: str) -> Rung:
    """The rung of that name.

    Raises:
        NoRungError: there is none.
    """
    rung = next((rung for rung in _ladder(case, method) if rung.name == name), None)
    if rung is None:
        raise NoRungError(f"the pass '{name}' leaves this scene as it is")
    return rung


#: The last case's ladders by method: its rungs are asked for one after the other.
_LAST: dict[tuple[int, str], tuple[Case, list[Rung]]] = {}


def _ladder(case: Case, method: str) -> list[Rung]:
    key = (id(case), method)
    if key not in _LAST:
        rungs = climb(case.model, replace(case.scene, outputs=case.outputs), method, approximate=True)
        _LAST.clear()
        _LAST[key] = (case, rungs)  # holds the case, so that no other one gets its id
    return _LAST[key][1]
