"""Stored results of a study: which of them are of this version."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import product
from typing import Any

from cutjoint.model.errors import ModelError
from cutjoint.package.errors import RunError
from cutjoint.toolchain.cache import runtime_digest
from cutjoint_bench.contenders import CONTENDERS
from cutjoint_bench.cutjoint_contenders import identify_code
from cutjoint_bench.failures.trials import case_of
from cutjoint_bench.generic.build import measuring_digest
from cutjoint_bench.records import Case, Contender
from cutjoint_bench.reductions import NoReductionError
from cutjoint_bench.study import Plan, grid_of

Data = Mapping[str, Any]

#: A result's name, what it was measured with, and a function that finds what that is now.
Measured = tuple[str, Mapping[str, str], Callable[[], Mapping[str, str]]]


def find_outdated(plan: Plan, data: Data) -> list[str]:
    """Missing parts of a study's stored data, and those measured with other generated code, another runtime or another peer than now.

    Compiles nothing: code is generated anew and its digest compared.
    """
    return [*_missing(plan, data), *(name for name, was, find in _measured(plan, data) if not _is_same(was, find))]


def _missing(plan: Plan, data: Data) -> Iterator[str]:
    """Parts of the plan that the data does not have."""
    known = {(case["name"], line["contender"]) for case in data["cases"] for line in case["lines"]}
    for case, contender in product(plan.cases, plan.contenders):
        if (case.name, contender.name) not in known and _suits(contender, case):
            yield f"{case.name}, {contender.label} (not measured)"
    mapped = {atlas["name"] for atlas in data["atlases"]}
    yield from (f"{case.name} (no map)" for case in plan.cases if plan.atlas and case.name not in mapped)
    tried = {row["name"] for row in data["situations"]}
    yield from (f"{situation.name} (not tried)" for situation in plan.situations if situation.name not in tried)


def _suits(contender: Contender, case: Case) -> bool:
    """True if a case has what a contender runs; reduced models are those of some scenes only."""
    try:
        contender.identify(case)
    except NoReductionError:
        return False
    except (RunError, ModelError):
        return True  # its line says why it cannot run
    return True


def _measured(plan: Plan, data: Data) -> Iterator[Measured]:
    cases = {case.name: case for case in plan.cases}
    for stored in (c for c in data["cases"] if c["name"] in cases):
        case = cases[stored["name"]]
        for line in (x for x in stored["lines"] if "configuration" in x):
            contender = CONTENDERS.get(line["contender"])
            find = (lambda c=contender, x=case: c.identify(x)) if contender else dict
            yield f"{case.name}, {line['label']}", line["configuration"], find
    for atlas in (a for a in data["atlases"] if a["name"] in cases):
        case, grid = cases[atlas["name"]], grid_of(plan, cases[atlas["name"]])
        for method, precision in product(grid.methods, grid.precisions):
            name = f"{method}, {precision}"
            if name not in atlas["refused"]:
                yield f"{case.name}, map of {name}", atlas["code"].get(name, {}), _code(case, method, precision)
    yield from _kept_trials(plan, data)


def _kept_trials(plan: Plan, data: Data) -> Iterator[Measured]:
    situations = {situation.name: situation for situation in plan.situations}
    known = {(row["name"], row["method"], row["precision"]): row["code"] for row in data["situations"] if row["code"]}
    for (name, method, precision), was in known.items():
        if name in situations:
            yield f"{name}, {method}, {precision}", was, _code(case_of(situations[name]), method, precision)


def _code(case: Case, method: str, precision: str) -> Callable[[], Mapping[str, str]]:
    return lambda: identify_code(case, method=method, precision=precision)


def _is_same(was: Mapping[str, str], find: Callable[[], Mapping[str, str]]) -> bool:
    if "version" not in was and was.get("runtime") not in (runtime_digest(), measuring_digest()):
        return False  # whatever the generated code is
    try:
        now = find()
    except (RunError, ModelError):
        return False
    return bool(now) and all(was.get(name) == value for name, value in now.items())
