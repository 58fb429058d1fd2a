"""Generated code, compiled by both compilers with all warnings as errors, against the interpreter of the block IR."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cutjoint.compile.pipeline import compile_model, generate
from cutjoint.elements.joints import JOINTS
from cutjoint.emit import view
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import JointKind, Numerics
from cutjoint.run.scenes import find_scene
from tests.compile_run.generated import examined, interpret, random_states, run_evaluate, run_functions
from tests.conftest import MODELS, with_heavy
from tests.mechanisms import random_models
from tests.mechanisms.chains import pendulums_in_a_row
from tests.mechanisms.four_bar import four_bar_text

#: With the paper's penalty of 1e9 N/m against masses of 1 to 1000 kg, doubles keep about 1e-16 * 1e9 of the accelerations, twice in
#: the elimination; with 1e4 the code itself is compared.  Corrections are differences of frequency squared times penalty: all models have
#: the paper's frequency of 10 1/s.
TOLERANCE = {1e4: 1e-10, 1e9: 1e-6}


@pytest.mark.parametrize("compiler", ["g++", "clang++"])
@pytest.mark.parametrize(("model", "scene"), with_heavy(
    [("four_bar", "swing"), ("iltis", "simul1s"), ("iltis", "iavsd_sine_2mm")], ("iltis", "iavsd_sine_2mm")
))  # fmt: skip
def test_generated_code_equals_the_interpreter(monkeypatch: pytest.MonkeyPatch, compiler: str, model: str, scene: str) -> None:
    monkeypatch.setenv("CXX", compiler)
    artifact = compile_model(MODELS / f"{model}.yaml", scene=scene)
    assert compiler.rstrip("+")[:5] in artifact.binary.compiler
    states = random_states(artifact.equations, 3, seed=1)
    flat = replace(artifact.scene, road=replace(artifact.scene.road, left=(), right=()))
    for penalty, tolerance in TOLERANCE.items():
        at = replace(flat, numerics=replace(flat.numerics, penalty=penalty, frequency=10.0))
        found = run_evaluate(examined(artifact.source, artifact.binary.flags), artifact.topology.model, at, states)
        for state, results in zip(states, found, strict=True):
            expected = interpret(replace(artifact.equations, scene=at), state)
            for name, values in expected.items():
                exact = name in ("residual", "rate")
                scale = max(1.0, float(np.abs(values).max(initial=0.0)))
                assert np.abs(results[name] - values).max(initial=0.0) <= (1e-12 if exact else tolerance) * scale, name


@pytest.mark.parametrize("compiler", ["g++", "clang++"])
def test_long_functions_are_compiled_in_parts(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, compiler: str) -> None:
    monkeypatch.setenv("CXX", compiler)
    monkeypatch.setattr(view, "LONG", 20)
    monkeypatch.setattr(view, "PART", 10)
    model = read_model(MODELS / "four_bar.yaml")
    flat = find_scene(model, "swing")
    flat = replace(flat, numerics=replace(flat.numerics, penalty=1e4, frequency=10.0))
    equations, _, source = generate(model, flat, ())
    labels = re.findall(r"CUTJOINT_PART\(part_(\d+)\)", source.files["evaluate.cpp"])
    assert len(labels) > 3
    assert sorted(set(map(int, labels))) == list(map(int, labels))
    states = random_states(equations, 3, seed=5)
    for state, results in zip(states, run_functions(source, tmp_path, model, flat, states), strict=True):
        for name, values in interpret(equations, state).items():
            assert np.abs(results[name] - values).max(initial=0.0) <= 1e-10 * max(1.0, float(np.abs(values).max(initial=0.0))), name


@pytest.mark.heavy
@pytest.mark.skipif("avx2" not in Path("/proc/cpuinfo").read_text(), reason="the processor has no AVX2")
def test_lanes_in_avx2_registers_equal_the_interpreter() -> None:
    """With AVX2 the lanes are one register, and their sines come from libmvec, exact to 4 units in the last place."""
    artifact = compile_model(MODELS / "iltis.yaml", scene="simul1s", flags=("-O1", "-mavx2", "-mfma"))
    numerics = replace(artifact.scene.numerics, penalty=1e4)
    flat = replace(artifact.scene, numerics=numerics, road=replace(artifact.scene.road, left=(), right=()))
    states = random_states(artifact.equations, 3, seed=4)
    found = run_evaluate(examined(artifact.source, artifact.binary.flags), artifact.topology.model, flat, states)
    for state, results in zip(states, found, strict=True):
        for name, values in interpret(replace(artifact.equations, scene=flat), state).items():
            assert np.abs(results[name] - values).max() <= 1e-10 * max(1.0, float(np.abs(values).max())), name


@pytest.mark.parametrize("kind", list(JOINTS))
@pytest.mark.parametrize("closed", with_heavy([True, False], False))
def test_every_joint_kind_compiles_and_equals_the_interpreter(kind: str, closed: bool, tmp_path: Path) -> None:
    """Trees with joints of one kind, and a loop that a cut joint of the kind closes."""
    if closed and kind is JointKind.FREE:
        pytest.skip("closes no loop")
    model = random_models.loop_with(kind, "roots", 1) if closed else random_models.tree_with(kind, True, 1)
    scene = replace(random_models.scene(), numerics=Numerics(penalty=1e4, closure="penalty"))
    equations, _, source = generate(model, scene, ())
    states = random_states(equations, 2, seed=2)
    for state, results in zip(states, run_functions(source, tmp_path, model, scene, states), strict=True):
        for name, values in interpret(replace(equations, scene=scene), state).items():
            scale = max(1.0, float(np.abs(values).max(initial=0.0)))
            assert np.abs(results[name] - values).max(initial=0.0) <= 1e-9 * scale, name
        assert list(results["kinetic"]) == [results["energy"][0], -1.0]  # without the power


#: Its kinetic energy follows from time alone, and the power of its forces does not.
_GUIDED = """
cutjoint: 1
name: guided
gravity: [0, 0, -9.81]
bodies: {mass: {mass: 2, centre_of_mass: [1, 0, 0]}}
joints: {slide: {kind: prismatic, bodies: [ground, mass], at: [1, 0, 0], axis: z, guide: 0.1*sin(t)}}
states: {pressure: {start: 1 Pa, rate: 100 - 3*pressure}}
forces: {pull: {kind: load, body: mass, at: [1, 0, 0], force: [0, 0, 3*pressure]}}
scenes: {run: {end: 1}}
"""


def test_kinetic_energy_is_stored_where_it_is_computed_by_no_statement(tmp_path: Path) -> None:
    """The function that may end early does so behind the kinetic energy only."""
    model = read_model_text(_GUIDED, "guided.yaml")
    scene = replace(find_scene(model, None), numerics=Numerics(penalty=1e4, closure="penalty"))
    equations, _, source = generate(model, scene, ())
    states = random_states(equations, 3, seed=2)
    for state, results in zip(states, run_functions(source, tmp_path, model, scene, states), strict=True):
        assert results["energy"][0] == pytest.approx((0.1 * np.cos(state.t)) ** 2, rel=1e-14)
        assert results["kinetic"][0] == results["energy"][0]


def test_a_second_compilation_is_found_in_the_cache() -> None:
    """Of a model that is read and derived anew; tests/toolchain says from what the cache is filled."""
    first, second = (compile_model(MODELS / "four_bar.yaml", scene="swing").binary for _ in range(2))
    assert not second.fresh
    assert second.path == first.path


@pytest.mark.parametrize("compiler", ["g++", "clang++"])
@pytest.mark.parametrize(("text", "single"), [
    (four_bar_text(8), "q_crank_4_"), (pendulums_in_a_row(12, stiffnesses=True), "Dinv_link_4"),
    (pendulums_in_a_row(12, joint="spherical"), "q_pin_4_"),
], ids=["four-bar", "springs", "balls"])  # fmt: skip
def test_loops_equal_the_interpreter(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, compiler: str, text: str, single: str) -> None:
    monkeypatch.setenv("CXX", compiler)
    (tmp_path / "row.yaml").write_text(text, encoding="utf-8")
    artifact = compile_model(tmp_path / "row.yaml", scene="swing")
    code = artifact.source.files["evaluate.cpp"]
    assert "for (int k = 0; k < " in code
    assert single not in code
    states = random_states(artifact.equations, 3, seed=9)
    flat = replace(artifact.scene, numerics=replace(artifact.scene.numerics, penalty=1e4, frequency=10.0))
    found = run_evaluate(examined(artifact.source, artifact.binary.flags), artifact.topology.model, flat, states)
    for state, results in zip(states, found, strict=True):
        for name, values in interpret(replace(artifact.equations, scene=flat), state).items():
            assert np.abs(results[name] - values).max(initial=0.0) <= 1e-10 * max(1.0, float(np.abs(values).max(initial=0.0))), name
