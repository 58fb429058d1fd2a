"""Inputs are read at every step: from a scene's laws, or from what a run gives instead, by all methods and integrators."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from scipy.interpolate import CubicHermiteSpline

from cutjoint.cli import main
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.methods import INTEGRATORS, METHODS, Implementation, names_of
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model, Scene
from cutjoint.package.errors import RunError
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from cutjoint.tasks.batch import compile_scene_batch, simulate_batch
from cutjoint_bench.generic.artifact import compile_generic
from tests.conftest import needs_cpp, with_heavy
from tests.mechanisms.driven import DRIVEN, LIFT, PUSH, guided, orders, table
from tests.physics.simulation import completed

pytestmark = needs_cpp

TABLES = {"lift": table(LIFT), "push": table(PUSH)}

MAKERS: dict[Implementation, Callable[[Model, Scene, str], Artifact]] = {
    Implementation.GENERATED: lambda model, scene, method: compile_scene(model, scene, CompileOptions(method=method)),
    Implementation.INTERPRETED: lambda model, scene, method: compile_interpreted(model, scene, method=method),
    Implementation.GENERIC: lambda model, scene, method: compile_generic(model, scene, method=method),
}

#: Each method with generated code, by the interpreter and by the generic solver where it has one.
WAYS = [
    *((method, how) for how in (Implementation.GENERATED, Implementation.INTERPRETED) for method in METHODS),
    *((method, Implementation.GENERIC) for method in METHODS if METHODS[method].has_generic),
]


@cache
def model() -> Model:
    return read_model_text(DRIVEN, "driven.yaml")


@cache
def compiled(scene: str, method: str = "recursive", how: Implementation = Implementation.INTERPRETED) -> Artifact:
    return MAKERS[how](model(), model().scenes[scene], method)


def run(scene: str, method: str = "recursive", how: Implementation = Implementation.INTERPRETED, **given: Any) -> Trajectory:
    return completed(simulate(compiled(scene, method, how), error=False, **given))


def furthest(one: Trajectory, other: Trajectory) -> float:
    assert np.array_equal(one.t, other.t)
    return max(float(np.abs(one.columns[name] - other.columns[name]).max()) for name in one.columns)


@pytest.mark.parametrize(
    ("method", "how"),
    with_heavy(WAYS, *(way for way in WAYS if way[1] == Implementation.GENERIC or way == ("classical", Implementation.GENERATED)
                       or way == ("augmented", Implementation.GENERATED))),
)
def test_tables_drive_a_run_as_the_laws_that_they_follow(method: str, how: Implementation) -> None:
    """The other scene has no laws: a cubic table through a polynomial of third degree is that polynomial, to rounding."""
    for integrator in names_of(INTEGRATORS, lambda i: i.supports(METHODS[method], how)):
        by_scene = run("lawful", method, how, integrator=integrator)
        by_tables = run("free", method, how, integrator=integrator, inputs=TABLES)
        assert furthest(by_scene, by_tables) < 1e-9
        found, t = by_scene.columns, by_scene.t
        for name, wanted in guided(orders(LIFT, t), t).items():
            assert found[name] == pytest.approx(wanted, abs=1e-6)
        force = 3 * PUSH(t) - 20 * found["slider.x"] - PUSH(t) * found["slider.vx"]
        assert found["thrust.force"] == pytest.approx(force, abs=1e-9)


def test_a_run_holds_inputs_that_it_gives_and_leaves_the_others() -> None:
    held = run("lawful", parameters={"push": 1.0}, inputs={"lift": 0.1})
    assert furthest(held, run("free")) < 1e-12
    only_push = run("lawful", inputs={"push": 1.0})
    for name, wanted in guided(orders(LIFT, only_push.t), only_push.t).items():
        assert only_push.columns[name] == pytest.approx(wanted, abs=1e-9)
    assert furthest(only_push, run("lawful")) > 0.1


def test_the_interpolations_are_those_of_scipy() -> None:
    t, value = np.array([0, 0.3, 0.55, 1.2]), np.array([0.2, 0.5, -0.1, 0.3])
    cubic = CubicHermiteSpline(t, value, np.gradient(value, t, edge_order=2))
    found = run("free", inputs={"lift": {"t": t, "value": value}})
    inner = np.flatnonzero(~np.isclose(found.t, 0.3) & ~np.isclose(found.t, 0.55))  # the acceleration jumps there
    for name, wanted in guided((cubic(found.t), cubic(found.t, 1), cubic(found.t, 2)), found.t).items():
        assert found.columns[name][inner] == pytest.approx(wanted[inner], abs=1e-9)
    linear = run("free", inputs={"push": {"t": t, "value": value, "interpolation": "linear"}})
    push = np.interp(linear.t, t, value)
    force = 3 * push - 20 * linear.columns["slider.x"] - push * linear.columns["slider.vx"]
    assert linear.columns["thrust.force"] == pytest.approx(force, abs=1e-9)


def test_cases_of_a_batch_hold_inputs_each_their_own() -> None:
    cases = [{"push": 0.5 * k, "gain": 2.0 + k} for k in range(11)]
    batch = simulate_batch(compile_scene_batch(model(), model().scenes["lawful"]), cases, threads=2)
    for number, case in enumerate(cases):
        alone = run("lawful", parameters=case)
        for name in ("slider.x", "bob.z", "shoulder.angle"):
            assert batch.end[name][number] == pytest.approx(alone.columns[name][-1], abs=1e-8)


def test_the_command_line_holds_inputs_with_and_without_its_cache(tmp_path: Path) -> None:
    file = tmp_path / "driven.yaml"
    file.write_text(DRIVEN)
    asked = ["simulate", str(file), "--scene", "lawful", "--no-error", "--set", "push=1.5", "--set", "gain=2"]
    tables = []
    for out in (tmp_path / "first.csv", tmp_path / "second.csv"):
        done = CliRunner().invoke(main, [*asked, "--out", str(out)])
        assert done.exit_code == 0, done.output
        tables.append(out.read_bytes())
    assert tables[0] == tables[1]
    header, *rows = tables[0].decode().splitlines()
    last = dict(zip(header.split(","), map(float, rows[-1].split(",")), strict=True))
    assert last["slider.x"] == pytest.approx(run("lawful", parameters={"push": 1.5, "gain": 2.0}).columns["slider.x"][-1], abs=1e-8)


def test_the_command_line_takes_units_as_a_model_file_does(tmp_path: Path) -> None:
    """Of a run that is kept as of one that is not: the second of each pair is the first in SI units."""
    file = tmp_path / "driven.yaml"
    file.write_text(DRIVEN)

    def call(*changes: str) -> Result:
        options = [text for change in changes for text in ("--set", change)]
        run = ["simulate", str(file), "--scene", "lawful", "--no-error", "--out", str(tmp_path / "t.csv")]
        return CliRunner().invoke(main, [*run, *options])

    def rows(*changes: str) -> bytes:
        assert (done := call(*changes)).exit_code == 0, done.output
        return (tmp_path / "t.csv").read_bytes()

    for _ in range(2):
        assert rows("lift=250mrad", "push= 20 cN", "gain=3 m") == rows("lift=0.25", "push=0.2", "gain=3")
        assert rows("lift=1/4") == rows("lift=0.25") != rows("lift=0.2")
        for wrong, words in (
            ("lift=2 N", f"{file}:6:3: parameter 'lift' needs an angle or a plain number, got N: 2 N"),
            ("lift=2 furlongg", "--set lift=2 furlongg: unknown unit 'furlongg'; write NAME=NUMBER, with a unit or without"),
            ("lift=1e", "--set lift=1e: '1e' is not an expression; write NAME=NUMBER, with a unit or without"),
        ):
            assert words in call(wrong).output


@pytest.mark.parametrize("how", with_heavy([Implementation.INTERPRETED, Implementation.GENERIC], Implementation.GENERIC))
def test_inputs_drive_what_submodels_have(how: Implementation) -> None:
    """Two carts pushed by an input: x = integral of f/m, once by its law and once by twice that; the trajectory of a guide follows too."""
    text = """
cutjoint: 1
name: carts
gravity: [0, 0, 0]
parameters: {push: {value: 0, unit: N, binding: input}, twice: 2*push}
submodels:
  cart:
    parameters: [thrust, course, side]
    bodies: {box: {mass: 2, centre_of_mass: [0, side, 0]}, load: {massless: true}}
    joints:
      track: {kind: prismatic, bodies: [ground, box], at: [0, side, 0], axis: [1, 0, 0]}
      lift: {kind: prismatic, bodies: [box, load], at: [0, side, 0], axis: [0, 1, 0], guide: course}
    forces: {drive: {kind: joint_force, joint: track, law: thrust}}
    outputs: [box.x, lift.displacement_rate]
instances:
  left: {use: cart, with: {thrust: push, course: "0.1*push", side: 1}}
  right: {use: cart, with: {thrust: twice, course: "0.1*push", side: 1}, mirror: y}
scenes:
  go: {end: 1, output_step: 0.1, inputs: {push: "6*t"}, numerics: {dt: 0.001}}
"""
    carts = read_model_text(text, "carts.yaml")
    found = completed(simulate(MAKERS[how](carts, carts.scenes["go"], "recursive"), error=False))
    assert found.columns["left.box.x"] == pytest.approx(found.t**3 / 2, abs=1e-6)
    assert found.columns["right.box.x"] == pytest.approx(found.t**3, abs=1e-6)
    assert found.columns["left.lift.displacement_rate"] == pytest.approx(np.full(found.t.size, 0.6), abs=1e-12)
    assert found.columns["right.lift.displacement_rate"] == pytest.approx(np.full(found.t.size, 0.6), abs=1e-12)


WRONG = [
    ({"lfit": 1.0}, "model 'driven' has no input 'lfit'; it has lift, push"),
    ({"gain": 1.0}, "model 'driven' has no input 'gain'; it has lift, push"),
    ({"lift": float("nan")}, "input 'lift': nan is not a finite number; write a plain number in SI units"),
    ({"lift": "high"}, "input 'lift': 'high' is not a number"),
    ({"lift": {"t": [0, 1]}}, "input 'lift': the table has no 'value'; give as many values as times"),
    ({"lift": {"t": [0, 1], "values": [0, 1]}},
     "input 'lift': unknown key 'values'; a table has t, value, and perhaps rate and interpolation"),
    ({"lift": {"t": [0], "value": [0]}}, "input 'lift': 1 time; a table has two or more, a constant is a number"),
    ({"lift": {"t": [0, 1], "value": [0, 1, 2]}}, "input 'lift': 2 times and 3 of 'value'; give one for each time"),
    ({"lift": {"t": [0, 1], "value": [0, 1], "rate": [0]}}, "input 'lift': 2 times and 1 of 'rate'; give one for each time"),
    ({"lift": {"t": [0, 1], "value": [0, float("inf")]}},
     "input 'lift': value[1]: inf is not a finite number; write a plain number in SI units"),
    ({"lift": {"t": 1, "value": [0, 1]}}, "input 'lift': t: not a list of numbers"),
    ({"lift": {"t": [0, 0.7, 0.5, 1], "value": [0, 1, 2, 3]}},
     "input 'lift': t = 0.5 s stands after 0.7 s; put the times in ascending order, each once"),
    ({"lift": {"t": [0, 0.5], "value": [0, 1]}},
     "input 'lift': the table covers from 0 s to 0.5 s, the run from 0 to 1 s; extend the table"),
    ({"lift": {"t": [0.1, 1], "value": [0, 1]}},
     "input 'lift': the table covers from 0.1 s to 1 s, the run from 0 to 1 s; extend the table"),
    ({"lift": {"t": [0, 1], "value": [0, 1], "interpolation": "step"}},
     "input 'lift': interpolation 'step' is not one of cubic, linear"),
    ({"lift": {"t": [0, 1], "value": [0, 1], "rate": [0, 0], "interpolation": "linear"}},
     "input 'lift': a linear table has no rates of its own; leave out rate, or make it cubic"),
]  # fmt: skip


@pytest.mark.parametrize(("given", "message"), WRONG)
def test_what_is_wrong_with_inputs(given: dict[str, Any], message: str) -> None:
    with pytest.raises(RunError) as error:
        simulate(compiled("free"), inputs=given)
    assert str(error.value) == message


def test_an_input_is_given_once() -> None:
    with pytest.raises(RunError, match="input 'push' is given twice; give it in one of the two ways"):
        simulate(compiled("free"), parameters={"push": 1.0}, inputs={"push": 2.0})
