"""A step that leads to where a law has no value fails with the law, its element and its line, by all methods and integrators."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene, generate
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.package.errors import RunError
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import FailureReport
from cutjoint.run.simulation import simulate
from cutjoint.tasks.batch import compile_scene_batch, simulate_batch
from tests.conftest import needs_cpp

pytestmark = needs_cpp

#: A body that falls from 0.5 m to `zero`, below which the root of its height has no value; free it would take
#: sqrt(2 0.8/9.81) s = 0.40 s, and the logarithm, that of a branch that is not taken where it has no value, pulls a little.
FALLING = """\
cutjoint: 1
name: falling
gravity: [0, 0, -9.81]
parameters: {zero: {value: -0.3, unit: m, binding: param}}
bodies: {hub: {mass: 1, centre_of_mass: [0, 0, 1], inertia: [1, 1, 1]}}
joints: {rail: {kind: prismatic, bodies: [ground, hub], at: [0, 0, 0], axis: [0, 0, 1]}}
forces:
  push: {kind: joint_force, joint: rail, law: "0.1*sqrt(position - zero)"}
  other: {kind: joint_force, joint: rail, law: "where(position > 0.4, log(position - 0.4), 0)"}
outputs: [hub.z]
scenes: {fall: {end: 1, output_step: 0.01, positions: {rail.displacement: 0.5}, numerics: {dt: 2 ms}}}
"""

MESSAGE = "the law of 'push' (falling.yaml:8) has no finite value: the argument of sqrt leaves its domain"


@cache
def falling(law: str = "0.1*sqrt(position - zero)") -> Model:
    return read_model_text(FALLING.replace("0.1*sqrt(position - zero)", law), "falling.yaml")


@cache
def compiled(method: str, law: str = "0.1*sqrt(position - zero)") -> Artifact:
    return compile_scene(falling(law), falling(law).scenes["fall"], CompileOptions(method=method))


def check(failure: FailureReport | None, message: str, time: float) -> None:
    assert failure is not None
    assert failure.message == message
    assert failure.element == "push"
    assert failure.time == pytest.approx(time, abs=0.02)
    assert failure.residual <= 0
    assert failure.advice.startswith("give the law a value wherever the motion may lead")


@pytest.mark.parametrize(
    ("method", "how"),
    [
        ("recursive", {}), ("recursive", {"integrator": "rk4"}), ("recursive", {"integrator": "dormand-prince"}),
        ("recursive", {"events": "located"}), ("augmented", {}), ("classical", {}), ("recursive-newton", {}),
        ("recursive-newton", {"integrator": "radau5"}),
        ("recursive-newton", {"integrator": "generalised-alpha"}),
    ],
)  # fmt: skip
def test_the_law_is_named(method: str, how: dict[str, Any]) -> None:
    run = simulate(compiled(method), **how, check=False)
    check(run.failure, MESSAGE, 0.39)
    assert run.t[-1] > 0.36


@pytest.mark.parametrize("method", ["recursive", "classical"])
def test_the_law_is_named_at_the_start(method: str) -> None:
    run = simulate(compiled(method), parameters={"zero": 1.0}, check=False)
    check(run.failure, MESSAGE, 0.0)


@pytest.mark.parametrize(
    ("law", "what"),
    [
        ("log(position)", "the argument of log"), ("asin(1.2 - position)", "the argument of asin"),
        ("position**1.5", "the argument of **"), ("1/sqrt(position)", "the argument of sqrt"),
    ],
)  # fmt: skip
def test_every_function_with_a_domain(law: str, what: str) -> None:
    """Their margins, by the description of what is generated; how they are reported is the same for all."""
    model = falling(law)
    equations, program, _ = generate(model, model.scenes["fall"], model.scenes["fall"].outputs)
    named = {d.function: d for d in equations.domains if d.element == "push"}
    assert what in named
    assert named[what].place == "falling.yaml:8"
    assert "domains" in program.functions or program.operations("domains") >= 0


def test_models_without_such_laws_have_no_such_function() -> None:
    text = FALLING.replace("0.1*sqrt(position - zero)", "position**2 - zero").replace("log(position - 0.4)", "position")
    model = read_model_text(text, "falling.yaml")
    equations, _, source = generate(model, model.scenes["fall"], model.scenes["fall"].outputs)
    assert equations.domains == ()
    assert not any("domains" in content for content in source.files.values())


def test_runs_of_a_batch_name_the_law() -> None:
    artifact = compile_scene_batch(falling(), falling().scenes["fall"])
    done = simulate_batch(artifact, [{"zero": -0.3}, {"zero": -100.0}], threads=1, check=False)
    check(done.failures[0], MESSAGE, 0.39)
    assert done.failures[1] is None


@pytest.mark.parametrize("zero", ["0", "-0.3"])
def test_pivots_are_chosen_in_poses_in_which_laws_have_values(zero: str, recwarn: pytest.WarningsRecorder) -> None:
    model = read_model_text(FALLING.replace("value: -0.3", f"value: {zero}"), "falling.yaml")
    generate(model, model.scenes["fall"], model.scenes["fall"].outputs, method="classical")
    assert not recwarn.list


def test_a_law_without_a_value_in_any_of_them_is_refused() -> None:
    model = read_model_text(FALLING.replace("value: -0.3", "value: 0.6"), "falling.yaml")
    words = "falling.yaml:8: 'push': its law has no finite value or derivative in the design position and near it, where classical chooses"
    with pytest.raises(RunError, match=f"^{words} its pivots: the argument of sqrt leaves its domain there; give it one there"):
        generate(model, model.scenes["fall"], model.scenes["fall"].outputs, method="classical")


@pytest.mark.parametrize("kind", ["state", "signal"])
def test_a_rate_or_a_signal_without_a_value_is_named(kind: str) -> None:
    """x' = -sqrt(x - 0.5) - 1 from 1: with u = sqrt(x - 0.5) the root ends after 2 (u - log(1 + u)), u from sqrt(0.5)."""
    rate, signal = ("-sqrt(level - 0.5) - 1", "") if kind == "state" else ("-root - 1", "signals: {root: sqrt(level - 0.5)}\n")
    states = f"states: {{level: {{start: 1, rate: {rate}}}}}\n{signal}"
    text = FALLING.replace("forces:", f"{states}forces:").replace("0.1*sqrt(position - zero)", "0")
    model = read_model_text(text, "falling.yaml")
    failure = simulate(compile_scene(model, model.scenes["fall"]), check=False).failure
    name, line = ("level", 7) if kind == "state" else ("root", 8)
    assert failure is not None
    assert failure.message == f"the law of '{name}' (falling.yaml:{line}) has no finite value: the argument of sqrt leaves its domain"
    u = 0.5**0.5
    assert failure.time == pytest.approx(2 * (u - np.log(1 + u)), abs=0.01)
