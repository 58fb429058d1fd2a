"""The catalogue of methods, integrators, closures, solvers and number types, and what follows from it."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from itertools import product
from typing import Any

import click
import pytest

from cutjoint.cli import main
from cutjoint.methods import (
    AUTO,
    CLOSURES,
    DEFAULT_CLOSURE,
    DEFAULT_INTEGRATOR,
    DEFAULT_METHOD,
    DEFAULT_PRECISION,
    DEFAULT_SOLVER,
    IMPLEMENTATIONS,
    INTEGRATORS,
    METHODS,
    PRECISIONS,
    SOLVERS,
    STEPS,
    Events,
    Implementation,
    Integrator,
)
from cutjoint.model.document.model_file import json_schema
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Scene
from cutjoint.package.errors import RunError
from cutjoint.run.run_file import make_run_file
from cutjoint.run.settings import Options
from tests.conftest import ROOT
from tests.run.test_failing_starts import PENDULUM
from tests.runtime.test_tables import table

MODEL = read_model_text(PENDULUM, "pendulum.yaml")


def names(part: Any) -> set[str]:
    """The texts that a part of a schema allows."""
    found = {part["const"]} if "const" in part else set(part.get("enum", ()))
    return found.union(*(names(x) for x in part.get("anyOf", ())))


def test_model_files_take_the_names_of_the_catalogue() -> None:
    parts = json.loads(json_schema())["$defs"]
    numerics, scene = parts["Numerics"]["properties"], parts["Scene"]["properties"]
    assert names(numerics["closure"]) == set(CLOSURES)
    assert names(numerics["integrator"]) == set(INTEGRATORS)
    assert names(numerics["events"]) == set(Events)
    assert names(numerics["methods"]["propertyNames"]) == set(METHODS)
    assert names(scene["method"]) == {AUTO, *METHODS}


def test_records_name_what_there_is() -> None:
    for method in METHODS.values():
        assert set(method.closures) <= set(CLOSURES)
        assert any(method.name in i.methods for i in INTEGRATORS.values())
    for name, solver in IMPLEMENTATIONS.load("generic").solvers.items():
        assert METHODS[name].has_generic
        assert SOLVERS[solver].suits(METHODS[name])
    for integrator in INTEGRATORS.values():
        assert set(integrator.methods) <= set(METHODS)
        assert set(integrator.closures) <= set(CLOSURES)
    catalogues = (METHODS, INTEGRATORS, CLOSURES, SOLVERS, PRECISIONS)
    defaults = (DEFAULT_METHOD, DEFAULT_INTEGRATOR, DEFAULT_CLOSURE, DEFAULT_SOLVER, DEFAULT_PRECISION)
    assert all(name in catalogue for name, catalogue in zip(defaults, catalogues, strict=True))
    assert all(record.name == name for catalogue in catalogues for name, record in catalogue.items())


@pytest.mark.parametrize("integrator", INTEGRATORS.values(), ids=INTEGRATORS)
def test_a_row_of_an_integrator_reaches_all_that_follow_from_it(integrator: Integrator) -> None:
    """Exports, the reader of run files, drivers, help and docs know the name; its C++ is there."""
    name, runtime = integrator.name, ROOT / "runtime"
    tables = (runtime / "include/cutjoint/core/runge_kutta/tables.hpp").read_text(encoding="utf-8")
    assert tuple(method for method, steps in STEPS.items() if name in steps) == integrator.methods
    for steps in integrator.steps.values():
        text = (runtime / "include" / steps.header).read_text(encoding="utf-8")
        assert re.search(rf"(class|using) {steps.name.partition('<')[0]}\b", text)
        assert all(f"struct {table} {{" in tables for table in re.findall(r"runge_kutta::(\w+)", steps.name))
    assert f'IntegratorRow{{"{name}",' in (runtime / "include/cutjoint/integrator_table.hpp").read_text(encoding="utf-8")
    assert f"\n| `{name}` | " in (ROOT / "docs/reference/integrators.md").read_text(encoding="utf-8")
    for command in ("simulate", "compile", "export", "couple", "gradient"):
        found = main.get_command(click.Context(main), command)
        assert found is not None
        assert name in next(p.type for p in found.params if p.name == "integrator").choices  # type: ignore[attr-defined]
    assert integrator.order
    assert integrator.about


@pytest.mark.parametrize("integrator", [i for i in INTEGRATORS.values() if "ExplicitSteps" in str(i.steps)], ids=lambda i: i.name)
def test_the_row_of_an_explicit_integrator_is_that_of_its_table(integrator: Integrator) -> None:
    """Order, error estimate, and room for its stages.  C99 has the steps of one table, whatever the name of another."""
    (steps,) = integrator.steps.values()
    name = steps.name.rpartition("::")[2].removesuffix(">")
    found = table(name)
    text = (ROOT / "runtime/include/cutjoint/core/runge_kutta/tables.hpp").read_text(encoding="utf-8")
    struct = text.partition(f"struct {name} {{")[2].partition("using Row")[0]
    assert f"int order = {integrator.order.partition('(')[0]};" in struct
    assert f"adaptive = {str(integrator.adaptive).lower()};" in struct
    assert steps.stages >= len(found["nodes"][0]) + max(0, len(found["dense"]) - 1)
    c99 = (ROOT / "templates/c99/rk4.jinja").read_text(encoding="utf-8")
    in_c = [fractions(x) for x in re.findall(r"(?:nodes|weights)\[\d\] = \{(.*?)\}", c99)]
    in_table = [found["nodes"][0][1:-1], found["weights"][-1]]
    assert integrator.c99 == (in_c == in_table)


def fractions(text: str) -> list[Fraction]:
    """Numbers of C as they are meant."""
    return [Fraction(a) / Fraction(b or "1") for a, b in re.findall(r"([\d.]+)(?: / ([\d.]+))?", text)]


def test_every_method_takes_the_default_integrator() -> None:
    assert set(INTEGRATORS[DEFAULT_INTEGRATOR].methods) == set(METHODS)
    assert set(INTEGRATORS[DEFAULT_INTEGRATOR].closures) == set(CLOSURES)


def asked() -> Iterator[Options]:
    """Each integrator with each wish for events, with and without a fixed number of iterations, and nothing at all."""
    for integrator, events, iterations in product((None, *INTEGRATORS), (None, *Events), (None, 3)):
        yield Options(integrator=integrator, events=events, iterations=iterations)


def reported(scene: Scene, method: str, implementation: Implementation, options: Options) -> dict[str, Any] | str:
    """The entries of the run file, or what is wrong with the options."""
    try:
        return make_run_file(MODEL, scene, {}, task="simulate", method=method, implementation=implementation, options=options).entries()
    except RunError as error:
        return str(error)


@pytest.mark.parametrize("implementation", Implementation)
@pytest.mark.parametrize("closure", CLOSURES)
@pytest.mark.parametrize("method", METHODS)
def test_every_choice_has_a_run_file_or_a_way_out(method: str, closure: str, implementation: Implementation) -> None:
    """A run file has every choice, or a message names what there is instead."""
    rest = MODEL.scenes["rest"]
    scene = replace(rest, numerics=replace(rest.numerics, closure=closure))
    alternatives = {*METHODS, *CLOSURES, *INTEGRATORS, *Events}
    for options in asked():
        found = reported(scene, method, implementation, options)
        if isinstance(found, str):
            wrong = {options.integrator or DEFAULT_INTEGRATOR, options.events}
            assert words(found) & (alternatives - wrong), found
            continue
        numerics = found["numerics"]
        assert found["integrator"] == options.integrator or options.integrator is None
        assert options.events is None or bool(numerics["events"]) == (options.events == Events.LOCATED)
        assert (numerics["fixed_cost"], numerics["iterations"]) == ((True, 3) if options.iterations else (False, scene.numerics.iterations))
        assert (found["solver"] is not None) == (METHODS[method].has_system and INTEGRATORS[found["integrator"]].uses_solver)


def words(message: str) -> set[str]:
    return {word.strip(",;:.") for word in message.split()}


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_scenes_integrator_is_meant_for_the_methods_that_it_takes(integrator: str) -> None:
    rest = MODEL.scenes["rest"]
    scene = replace(rest, numerics=replace(rest.numerics, integrator=integrator))
    for method, implementation in product(METHODS, Implementation):
        found = reported(scene, method, implementation, Options())
        assert isinstance(found, dict)
        known = INTEGRATORS[integrator]
        takes = method in known.methods and (implementation is not Implementation.GENERIC or known.has_generic)
        assert (found["integrator"] == integrator) or not takes
        assert takes or found["integrator"] == reported(rest, method, implementation, Options())["integrator"]


def test_all_settings_of_an_integrator_are_in_its_run_file() -> None:
    settings = {name for i in INTEGRATORS.values() for name in i.settings}
    for integrator in INTEGRATORS.values():
        found = reported(MODEL.scenes["rest"], integrator.methods[0], Implementation.GENERATED, Options(integrator=integrator.name))
        assert isinstance(found, dict)
        assert {name for name in settings if found["numerics"][name] is not None} == set(integrator.settings)

