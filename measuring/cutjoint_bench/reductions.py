"""The models of a scene's reduction sequence as contenders, by every method."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial

from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene, generate
from cutjoint.methods import METHODS
from cutjoint.package.errors import RunError
from cutjoint.reduce.sequence import APPROXIMATIONS, ROLLING, STEPS, ReducedModel, reduction_sequence
from cutjoint_bench.cutjoint_contenders import OwnRunner, identity
from cutjoint_bench.records import Case, Contender

#: The passes, after which reduced models are called.
NAMES = tuple(step.name for step in (*STEPS, *APPROXIMATIONS, ROLLING))


class NoReductionError(RunError):
    """A scene's reduction sequence has no model of that name."""


def reduced_contenders() -> Iterator[Contender]:
    """A contender for each pass and method; it refuses scenes that its pass leaves as they are."""
    for method in METHODS:
        for name in NAMES:
            yield Contender(
                name=f"{method}/{name.replace(' ', '-')}", label=f"{method}, {name}", group="reductions",
                prepare=partial(_prepare, method=method, name=name), identify=partial(_identify, method=method, name=name),
            )  # fmt: skip


def _prepare(case: Case, *, method: str, name: str) -> OwnRunner:
    variant = _variant(case, method, name)
    return OwnRunner(artifact=compile_scene(variant.model, variant.scene, CompileOptions(method=method)), parameters=case.parameters)


def _identify(case: Case, *, method: str, name: str) -> Mapping[str, str]:
    variant = _variant(case, method, name)
    return identity(generate(variant.model, variant.scene, variant.scene.outputs, method=method)[-1])


def _variant(case: Case, method: str, name: str) -> ReducedModel:
    """The reduced model of that name.

    Raises:
        NoReductionError: there is none.
    """
    variant = next((variant for variant in _sequence(case, method) if variant.name == name), None)
    if variant is None:
        raise NoReductionError(f"the pass '{name}' leaves this scene as it is")
    return variant


#: The reduction sequence of the last case and method: its models are asked for one after the other.
_LAST: dict[tuple[int, str], tuple[Case, list[ReducedModel]]] = {}


def _sequence(case: Case, method: str) -> list[ReducedModel]:
    key = (id(case), method)
    if key not in _LAST:
        variants = reduction_sequence(case.model, replace(case.scene, outputs=case.outputs), method, approximate=True)
        _LAST.clear()
        _LAST[key] = (case, variants)  # holds the case, so that no other one gets its id
    return _LAST[key][1]
