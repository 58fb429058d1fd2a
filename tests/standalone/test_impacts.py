"""Guides whose rates jump by the scene's law, in every host: momentum carries over as in runs of the command line, and by hand."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

import cutjoint
from cutjoint.compile.c_export import make_standalone
from cutjoint.compile.pipeline import generate
from cutjoint.emit.classes import MOST_LANES
from cutjoint.export.fmu.archive import Fmu, make_fmu
from cutjoint.model.read import read_model_text
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint.run.scenes import find_scene
from cutjoint.tasks.batch import compile_scene_batch, simulate_batch
from cutjoint.topology.build import build_topology
from cutjoint.topology.reading import read_model
from tests.conftest import needs_cpp
from tests.fmu.slaves import OK, started
from tests.oracles.dense import DenseMechanism
from tests.physics.test_impacts import struck_at_rest

from .c_exports import compile_object, folder_of, foreign_symbols, write

pytestmark = needs_cpp

#: The times at which the guide begins to move (s): within a step, and at the end of one.
BETWEEN, AT_A_STEP = 0.2037, 0.2

#: Methods and integrators of hosts, with the events that runs of the command line find by them.
RULES = [
    ("recursive", "trapezoidal", "crossed"), ("recursive", "rk4", "located"), ("recursive", "dormand-prince", "located"),
    ("recursive-newton", "trapezoidal", "crossed"), ("recursive-newton", "radau5-fixed", "located"),
    ("recursive-newton", "radau5", "located"), ("augmented", "trapezoidal", "crossed"),
]  # fmt: skip
#: Integrators whose steps are as long as a tolerance allows.
ADAPTIVE = ("dormand-prince", "radau5")
every_rule = pytest.mark.parametrize(("method", "integrator", "events"), RULES)

#: A four-bar whose crank a guide turns, at once by RATE; a weight hangs on its rocker.
FOUR_BAR = """\
cutjoint: 1
name: jerked
gravity: [0, 0, -9.81]
parameters:
  begin: {value: BEGIN, unit: s, binding: param}
bodies:
  crank: {mass: 1, centre_of_mass: [0, 0, 0.1], inertia: [0.01, 0.02, 0.01]}
  coupler: {mass: 2, centre_of_mass: [0.25, 0, 0.25], inertia: [0.03, 0.05, 0.03]}
  rocker: {mass: 1.5, centre_of_mass: [0.5, 0, 0.15], inertia: [0.02, 0.03, 0.02]}
  weight: {mass: 0.5, centre_of_mass: [0.5, 0, 0.1], inertia: [0.002, 0.003, 0.002]}
joints:
  motor: {kind: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: [0, 1, 0], guide: "where(t < begin, 0, 3*(t - begin))"}
  elbow: {kind: revolute, bodies: [crank, coupler], at: [0, 0, 0.2], axis: [0, 1, 0]}
  wrist: {kind: revolute, bodies: [coupler, rocker], at: [0.5, 0, 0.3], axis: [0, 1, 0]}
  base: {kind: revolute, bodies: [ground, rocker], at: [0.5, 0, 0], axis: [0, 1, 0]}
  pin: {kind: revolute, bodies: [rocker, weight], at: [0.5, 0, 0.3], axis: [0, 1, 0]}
outputs: [rocker.vx, rocker.x, weight.vx, weight.vz, pin.angle, pin.angle_rate]
scenes:
  run: {end: 0.4, output_step: 0.02, numerics: {dt: 0.002, solver_tolerance: 1.0e-8}}
"""

#: A cart on a rail that a guide moves, and a rod on it that turns freely.
CART = """\
cutjoint: 1
name: jerked
gravity: [0, 0, 0]
bodies:
  cart: {mass: 3, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}
  rod: {mass: 2, centre_of_mass: [0, 0, -0.5], inertia: [0.2, 0.3, 0.1]}
joints:
  rail: {kind: prismatic, bodies: [ground, cart], at: [0, 0, 0], axis: [1, 0, 0], guide: "where(t < BEGIN, 0, 2*(t - BEGIN))"}
  pin: {kind: revolute, bodies: [cart, rod], at: [0, 0, 0], axis: [0, 1, 0]}
outputs: [cart.vx, pin.angle, pin.angle_rate]
scenes:
  run: {end: 0.4, output_step: 0.02, numerics: {dt: 0.002, solver_tolerance: 1.0e-8}}
"""


#: The folder of the models' files.
_FOLDER = TemporaryDirectory()


@cache
def _file(text: str, begin: float) -> Path:
    path = Path(_FOLDER.name) / f"{sha256(text.encode()).hexdigest()[:8]}_{begin}.yaml"
    path.write_text(text.replace("BEGIN", repr(begin)), encoding="utf-8")
    return path


@cache
def _loaded(text: str, begin: float, method: str, integrator: str) -> cutjoint.Simulation:
    return cutjoint.load(_file(text, begin), method=method, integrator=integrator)


@cache
def _compiled(text: str, begin: float, method: str) -> Artifact:
    return cutjoint.compile_model(_file(text, begin), method=method)


@cache
def _fmu(text: str, begin: float, version: int, method: str, integrator: str) -> Fmu:
    model = read_model(_file(text, begin))
    return make_fmu(model, find_scene(model, None), version=version, method=method, integrator=integrator)


def _run(
    text: str, begin: float, method: str, integrator: str, events: str, parameters: Mapping[str, float] | None = None
) -> Trajectory:  # fmt: skip
    return cutjoint.simulate(_compiled(text, begin, method), integrator=integrator, events=events, error=False, parameters=parameters or {})


@every_rule
@pytest.mark.parametrize("begin", [BETWEEN, AT_A_STEP])
@pytest.mark.parametrize("text", [CART, FOUR_BAR], ids=["cart", "four_bar"])
def test_steps_are_those_of_the_command_line(text: str, begin: float, method: str, integrator: str, events: str) -> None:
    """Bit by bit, but for steps as long as a tolerance allows, which hosts end at rows."""
    run, sim = _run(text, begin, method, integrator, events), _loaded(text, begin, method, integrator).reset()
    assert len(run.statistics.impacts) == 1
    for i, t in enumerate(run.t):
        sim.advance(float(t))
        row = [run[name][i] for name in run.columns]
        if integrator in ADAPTIVE:
            np.testing.assert_allclose(sim.outputs.array, row, rtol=1e-6, atol=1e-6)
        else:
            assert list(sim.outputs.array) == row, t


@every_rule
@pytest.mark.parametrize("begin", [BETWEEN, AT_A_STEP])
def test_a_cart_takes_its_rod_along(method: str, integrator: str, events: str, begin: float) -> None:
    """The rod's momentum about its pin stays that of rest, I w = m l u."""
    m, arm, u, own = 2.0, 0.5, 2.0, 0.3
    sim = _loaded(CART, begin, method, integrator).reset()
    sim.advance(begin + 1e-3)
    assert sim.outputs["cart.vx"] == pytest.approx(u, rel=1e-9)
    assert sim.outputs["pin.angle_rate"] == pytest.approx(m * arm * u / (own + m * arm**2), rel=1e-4)


@every_rule
def test_a_loop_is_struck_as_by_dense_algebra(method: str, integrator: str, events: str) -> None:
    """The four-bar stands still until its crank turns, so that speeds behind the jump are those of one solve; steps behind it are short."""
    text = FOUR_BAR.replace("t < begin", f"t < {BETWEEN}").replace("t - begin", f"t - {BETWEEN}")
    model = read_model_text(text.replace("BEGIN", "0"), "jerked.yaml")
    exact, _ = struck_at_rest(DenseMechanism(build_topology(model), model.scenes["run"]), BETWEEN)
    sim = _loaded(FOUR_BAR, BETWEEN, method, integrator).reset().copy().reset(dt=1e-5)
    sim.advance(BETWEEN + 1e-5)
    for body in ("rocker", "weight"):
        assert sim.outputs[f"{body}.vx"] == pytest.approx(exact[body][0], rel=1e-4), body
    assert sim.outputs["pin.angle_rate"] == pytest.approx(exact["weight"][4] - exact["rocker"][4], rel=1e-4)


@every_rule
def test_the_code_takes_no_memory(method: str, integrator: str, events: str, tmp_path: Path) -> None:
    place = write(folder_of(CART.replace("BEGIN", "0.2"), "jerked.yaml", None, integrator, method), tmp_path)
    made = compile_object(place, "jerked", flags=("-O1",))
    assert not foreign_symbols(made, "jerked")


@every_rule
def test_a_snapshot_before_a_jump_and_one_behind_it_go_on_alike(method: str, integrator: str, events: str) -> None:
    sim = _loaded(FOUR_BAR, BETWEEN, method, integrator).reset().copy()
    sim.parameters["begin"] = AT_A_STEP
    sim.reset()
    for until in (AT_A_STEP - 2e-3, AT_A_STEP, AT_A_STEP + 2e-3):
        sim.advance(until)
        saved, other = sim.snapshot(), sim.copy()
        for each in (sim, other):
            each.advance(until + 1e-2)
        assert np.array_equal(sim.outputs.array, other.outputs.array), until
        sim.restore(saved)


@every_rule
def test_a_host_goes_back_behind_a_jump(method: str, integrator: str, events: str) -> None:
    """Steps from a state before the jump, which the host sets, meet it again."""
    sim = _loaded(CART, BETWEEN, method, integrator).reset()
    sim.advance(0.3)
    rate = sim.outputs["pin.angle_rate"]
    early = sim.copy().reset()
    early.advance(0.1)
    sim.set_state(0.1, early.coordinates.array.copy(), early.speeds.array.copy())
    assert sim.outputs["pin.angle_rate"] == pytest.approx(0, abs=1e-9)
    sim.advance(0.3)
    assert sim.outputs["pin.angle_rate"] == pytest.approx(rate, rel=1e-6)


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize(("method", "integrator", "events"), [RULES[0], RULES[2], RULES[5], RULES[6]])
def test_an_fmu_has_the_rows_of_a_run(version: int, method: str, integrator: str, events: str) -> None:
    run, slave = _run(FOUR_BAR, BETWEEN, method, integrator, events), started(_fmu(FOUR_BAR, BETWEEN, version, method, integrator))
    for i in range(1, len(run.t)):
        (now,) = slave.get("time")
        assert slave.step(now, float(run.t[i]) - now) == OK, slave.log
        np.testing.assert_allclose(slave.get(*run.columns), [run[name][i] for name in run.columns], rtol=1e-6, atol=1e-7)


def test_an_event_of_an_fmu_is_the_impact() -> None:
    slave = started(_fmu(CART, BETWEEN, 3, "recursive", "dormand-prince"), events=True, early=True)
    assert slave.call("EnterStepMode") == OK
    assert slave.step(0.0, 0.4) == OK
    assert slave.event
    assert slave.early
    assert slave.last == pytest.approx(BETWEEN, abs=1e-9)
    assert slave.get("pin.angle_rate") == [pytest.approx(2.5, rel=1e-9)]


@pytest.mark.parametrize(("method", "integrator"), [RULES[2][:2], RULES[4][:2]])
def test_a_loaded_simulation_tells_of_the_event(method: str, integrator: str) -> None:
    sim = _loaded(CART, BETWEEN, method, integrator).reset()
    assert sim.advance_to_event(0.4) == "rail"
    assert sim.time == pytest.approx(BETWEEN, abs=1e-9)
    assert sim.outputs["pin.angle_rate"] == pytest.approx(2.5, rel=1e-9)


BEGINS = (0.1013, 0.2037)


@pytest.mark.parametrize(("integrator", "events"), [("trapezoidal", "crossed"), ("dormand-prince", "located")])
def test_a_sweep_has_the_rows_of_single_runs(integrator: str, events: str, tmp_path: Path) -> None:
    """One by one, since lanes have no impacts, as the manifest says."""
    outputs = ["rocker.vx", "weight.vx", "pin.angle"]
    study = {
        "cutjoint_study": 1, "model": str(_file(FOUR_BAR, BETWEEN)), "parameters": {"begin": list(BEGINS)}, "design": "grid",
        "trajectories": {"outputs": outputs}, "integrator": integrator,
    }  # fmt: skip
    done = cutjoint.sweep(study, tmp_path / "out.parquet")
    assert done.manifest["lanes"] == {"run": 1}
    assert done.manifest["integrator"] == {"run": integrator}
    for i, begin in enumerate(BEGINS):
        run = _run(FOUR_BAR, BETWEEN, "recursive", integrator, events, {"begin": begin})
        assert [impact.time for impact in run.statistics.impacts] == [pytest.approx(begin, abs=1e-9)]
        for name in outputs:
            np.testing.assert_allclose(done[f"{name}(t)"][i], run[name], rtol=1e-6, atol=1e-6)


def test_a_batch_and_a_rollout_have_the_ends_of_single_runs() -> None:
    model = read_model(_file(FOUR_BAR, BETWEEN))
    done = simulate_batch(compile_scene_batch(model, find_scene(model, None)), [{"begin": begin} for begin in BEGINS])
    assert not done.side_by_side
    sim = _loaded(FOUR_BAR, BETWEEN, "recursive", "trapezoidal").reset()
    many = cutjoint.rollout(sim, 200, parameters={"begin": BEGINS})
    for i, begin in enumerate(BEGINS):
        run = _run(FOUR_BAR, BETWEEN, "recursive", "trapezoidal", "crossed", {"begin": begin})
        assert done.end["weight.vx"][i] == pytest.approx(run["weight.vx"][-1], rel=1e-9)
        assert many[i, -1, list(sim.outputs).index("weight.vx")] == pytest.approx(run["weight.vx"][-1], rel=1e-9)


@pytest.mark.parametrize(("text", "lanes"), [(CART, 0), (CART.replace("where(t < BEGIN, 0, 2*(t - BEGIN))", "sin(t)"), MOST_LANES)])
def test_only_guides_that_may_jump_keep_runs_out_of_lanes(text: str, lanes: int) -> None:
    model = read_model(_file(text, BETWEEN))
    scene = find_scene(model, None)
    assert make_standalone(generate(model, scene, scene.outputs), equal_steps=True, side_by_side=True).parts.lanes == lanes
