"""Numbers of a file that become parameters: their names, their values, and that nothing else changes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.compile.options import CompileOptions
from cutjoint.model.errors import ModelError
from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import Binding, Model
from cutjoint.run.simulation import simulate
from tests.conftest import ROOT, needs_cpp
from tests.physics.simulation import compile_model, compile_scene

MODELS = sorted((ROOT / "models").glob("*.yaml"))
PRESS = ROOT / "models" / "press.yaml"


def expressions(part: Any, place: str = "") -> Iterator[tuple[str, Any]]:
    """All numbers and expressions of a model, with where they stand."""
    if isinstance(part, sympy.Basic | int | float) and not isinstance(part, bool):
        yield place, part
    elif is_dataclass(part):
        for field in fields(part):
            if field.name not in ("parameters", "span", "symbol", "moving"):
                yield from expressions(getattr(part, field.name), f"{place}.{field.name}")
    elif isinstance(part, dict):
        for key, value in part.items():
            yield from expressions(value, f"{place}.{key}")
    elif isinstance(part, tuple | list):
        for i, value in enumerate(part):
            yield from expressions(value, f"{place}.{i}")


def at(expression: Any, known: dict[Any, float]) -> float:
    """The value of an expression with parameters at theirs and variables at 0.37."""
    return evaluate(expression, {**dict.fromkeys(expression.free_symbols, 0.37), **known})


def values_of(model: Model) -> dict[Any, float]:
    return {p.symbol: p.value for p in model.parameters if p.binding is Binding.PARAM}


@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.stem)
def test_a_tunable_model_with_the_numbers_of_the_file_is_the_model(path: Path) -> None:
    plain, tunable = read_model(path), read_model(path, tunable=["*"])
    assert len(tunable.parameters) > len(plain.parameters)
    before, now = dict(expressions(plain)), dict(expressions(tunable))
    known = {p.symbol: p.value for p in plain.parameters} | values_of(tunable)
    assert before.keys() == now.keys()
    changed = 0
    for place, value in before.items():
        was, found = (at(sympy.sympify(x), known) for x in (value, now[place]))
        changed += now[place] != value
        assert np.isclose(was, found, rtol=1e-12, atol=1e-12, equal_nan=True), place
    assert changed > 5


def test_names_are_those_of_places() -> None:
    names = {p.name for p in read_model(PRESS, tunable=["*"]).parameters}
    assert names >= {"crank.mass", "crank.inertia.1", "A.z", "press.gravity.z", "turn.rates.pin.angle_rate"}
    tunable = [p.name for p in read_model(PRESS, tunable=["*.mass", "A.?"]).parameters if p.name not in ("stiffness", "damping")]
    assert sorted(tunable) == ["A.x", "A.y", "A.z", "crank.mass", "rod.mass", "slider.mass"]


@pytest.mark.parametrize(("pattern", "name", "value"), [
    ("turn.rates.pin.angle_rate", "turn.rates.pin.angle_rate", 10.0), ("*.rates.*", "turn.rates.pin.angle_rate", 10.0),
    ("press.gravity.z", "press.gravity.z", -9.81),
])  # fmt: skip
def test_numbers_of_scenes_and_gravity_are_tunable_by_name(pattern: str, name: str, value: float) -> None:
    *_, added = read_model(PRESS, tunable=[pattern]).parameters
    assert (added.name, added.value) == (name, value)


SUBMODEL = """\
cutjoint: 1
name: pair
gravity: [0, 0, -9.81]
submodels:
  arm:
    connectors: [base]
    parameters: [stiffness, reach]
    bodies: {bar: {mass: 2, centre_of_mass: [0, 0, reach], inertia: [1, 1, 1]}}
    joints: {pin: {kind: revolute, bodies: [base, bar], at: [0, 0, 0], axis: [0, 1, 0], spring: {stiffness: stiffness, damping: 3}}}
instances:
  left: {use: arm, connect: {base: ground}, with: {stiffness: 40 N*m, reach: -0.5}BINDING}
  right: {use: arm, connect: {base: ground}, with: {stiffness: 50 N*m, reach: -0.5}}
outputs: [left.pin.angle, right.pin.angle]
scenes: {swing: {end: 0.2, output_step: 10 ms, positions: {left.pin.angle: 1, right.pin.angle: 1}, numerics: {dt: 1 ms}}}
"""


def test_an_instance_is_tunable_by_one_word() -> None:
    model = read_model_text(SUBMODEL.replace("BINDING", ", binding: param"), "pair.yaml")
    found = {p.name: (p.value, p.unit) for p in model.parameters}
    assert found["left.stiffness"] == (40.0, "N*m")
    assert found["left.reach"] == (-0.5, "")
    assert found["left.bar.mass"] == (2.0, "kg")
    assert not any(name.startswith("right") for name in found)


def test_a_pattern_opens_the_arguments_of_instances() -> None:
    model = read_model_text(SUBMODEL.replace("BINDING", ""), "pair.yaml", tunable=["*.stiffness"])
    assert [p.name for p in model.parameters] == ["left.stiffness", "right.stiffness"]


DEFAULTED = """\
cutjoint: 1
name: rack
gravity: [0, 0, -9.81]
submodels: {steering: {include: library/rack_steering}}
instances: {steering: {use: steering, connect: {chassis: ground}, with: {angle: 0.1}BINDING}}
outputs: [steering.slide.displacement]
scenes: {run: {end: 0.1}}
"""


def test_defaults_are_tunable_by_a_pattern_alone() -> None:
    """Expressions over an opened one go along; an instance with a binding opens what stands there."""
    model = read_model_text(DEFAULTED.replace("BINDING", ""), "rack.yaml", tunable=["steering.column"])
    assert [(p.name, p.value) for p in model.parameters] == [("steering.column", 120.0)]
    (force,) = model.forces
    assert model.parameters[0].symbol in force.law.free_symbols
    whole = read_model_text(DEFAULTED.replace("BINDING", ", binding: param"), "rack.yaml")
    assert "steering.angle" in {p.name for p in whole.parameters}
    assert not {"steering.column", "steering.mass"} & {p.name for p in whole.parameters}


def test_a_pattern_without_a_number_is_reported() -> None:
    with pytest.raises(ModelError) as caught:
        read_model(PRESS, tunable=["*.mass", "crank.mas"])
    (problem,) = caught.value.problems
    assert problem.message == "no constant that could be tunable is called 'crank.mas'"
    assert problem.hint == "did you mean 'crank.mass'?"


@needs_cpp
@pytest.mark.parametrize("method", ["recursive", "recursive-newton", "augmented"])
def test_runs_with_other_numbers_are_those_of_another_file(method: str, tmp_path: Path) -> None:
    text = PRESS.read_text(encoding="utf-8")
    other = text.replace("rod: {mass: 1,", "rod: {mass: 3,").replace("B: [0.3, 0, 0]", "B: [0.3, 0, 0.11]")
    assert other.count("0.11]") == 1
    assert "mass: 3" in other
    artifact = compile_model(PRESS, tunable=["*.mass", "B.?"], method=method)
    run = simulate(artifact, parameters={"rod.mass": 3, "B.z": 0.11}, error=False, dt=1e-3, end=0.5)
    model = read_model_text(other, "other.yaml")
    wanted = simulate(compile_scene(model, model.scenes["turn"], CompileOptions(method=method)), error=False, dt=1e-3, end=0.5)
    for name in run.columns:
        assert np.max(np.abs(run[name] - wanted[name])) < 1e-6 * (1 + np.max(np.abs(wanted[name])))


@needs_cpp
def test_the_command_opens_and_says_the_price(tmp_path: Path) -> None:
    out = tmp_path / "run.csv"
    done = CliRunner().invoke(main, ["simulate", str(PRESS), "--tunable", "*.mass", "--set", "rod.mass=2", "--out", str(out)])
    assert done.exit_code == 0, done.output
    refused = CliRunner().invoke(main, ["simulate", str(PRESS), "--set", "rod.mass=2", "--out", str(out)])
    assert refused.exit_code == 1
    folder = tmp_path / "folder"
    done = CliRunner().invoke(main, ["compile", str(PRESS), "--tunable", "*.mass", "--out", str(folder)])
    assert done.exit_code == 0, done.output
    assert "3 constants are tunable; 230 without" in done.output
    assert "crank.mass" in (folder / "press.run").read_text(encoding="utf-8")
