"""First-order states beside a mechanism, made here without a model file: every walker of states takes them along.

A pendulum is turned by a motor whose torque lags behind a wish, T x' = wish(t) - x; beside it a number decays, and another
grows three times as fast from a half on.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene as compile_code
from cutjoint.export.fmu.archive import make_fmu
from cutjoint.methods import METHODS
from cutjoint.model.errors import ModelError
from cutjoint.model.expressions.parse import variable
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import VALUE, FirstOrderState, Model, Output
from cutjoint.reduce.sequence import STEPS
from cutjoint.run.results import Trajectory
from cutjoint.run.scenes import find_scene
from cutjoint.run.simulation import simulate
from cutjoint.stepping.load import load_scene
from cutjoint.tasks.states import find_scene_equilibrium, find_scene_modes
from tests.conftest import MODELS, needs_cpp
from tests.fmu.slaves import write
from tests.physics.simulation import compile_scene

TEXT = """
cutjoint: 1
name: lagging
gravity: [0, 0, -9.81]
parameters:
  lag: {value: 0.2, unit: s, binding: param}
bodies:
  arm: {shapes: [{rod: {from: [0, 0, 0], to: [0.4, 0, 0]}, mass: 1.5}]}
  tip: {shapes: [{rod: {from: [0.4, 0, 0], to: [0.7, 0, 0]}, mass: 0.5}]}
joints:
  pivot: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: [0, 1, 0]}
  hinge: {kind: fixed, bodies: [arm, tip], at: [0.4, 0, 0]}
forces:
  motor: {kind: joint_force, joint: pivot, law: -2*rate - 1*position}
outputs: [pivot.angle, pivot.angle_rate, motor.force]
scenes:
  run: {end: 1.0, output_step: 0.05, numerics: {dt: 2.5e-4}}
"""

TIME = sympy.Symbol("t", real=True)
TORQUE, DECAY, RAMP = (sympy.Symbol(f"s_{name}", real=True) for name in ("torque", "decay", "ramp"))

#: Weight of the arms about the pivot (N m) and moment of inertia (kg m^2), by hand.
WEIGHT = 9.81 * (1.5 * 0.2 + 0.5 * 0.55)
INERTIA = 1.5 * 0.4**2 / 3 + 0.5 * (0.3**2 / 12 + 0.55**2)


def wish(t: float) -> float:
    return -4 + 3 * np.sin(5 * t)


@cache
def lagging() -> Model:
    """The pendulum with its states."""
    model = read_model_text(TEXT, "lagging.yaml")
    span = model.forces[0].span
    lag = next(p.symbol for p in model.parameters)
    wanted = -4 + 3 * sympy.sin(5 * TIME) - TORQUE
    rising = sympy.Piecewise((sympy.Integer(1), sympy.StrictLessThan(RAMP, sympy.Rational(1, 2))), (sympy.Integer(3), True))
    states = (
        FirstOrderState(name="torque", symbol=TORQUE, rate=wanted / lag, initial=sympy.Float(-1), unit="N*m", span=span),
        FirstOrderState(name="decay", symbol=DECAY, rate=-DECAY, initial=1 + 5 * lag, unit="", span=span),
        FirstOrderState(name="ramp", symbol=RAMP, rate=rising, initial=sympy.Integer(0), unit="", span=span),
    )
    motor = replace(model.forces[0], law=model.forces[0].law + TORQUE)
    scene = model.scenes["run"]
    columns = tuple(Output(element=state.name, quantity=VALUE, span=span) for state in states)
    scene = replace(scene, outputs=(*scene.outputs, *columns))
    return replace(model, forces=(motor,), states=states, scenes={"run": scene})


@cache
def exact() -> dict[str, np.ndarray]:
    """The angle and the states by SciPy, from equations by hand: the axis y turns x to -z."""

    def derive(t: float, y: np.ndarray) -> list[float]:
        angle, rate, torque, decay = y
        return [rate, (torque - 2 * rate - angle + WEIGHT * np.cos(angle)) / INERTIA, (wish(t) - torque) / 0.2, -decay]

    t = np.linspace(0, 1, 21)
    found = solve_ivp(derive, (0, 1), [0, 0, -1, 2], t_eval=t, rtol=1e-12, atol=1e-12).y
    return {"pivot.angle": found[0], "torque.value": found[2], "decay.value": found[3], "ramp.value": t + 2 * np.maximum(t - 0.5, 0)}


def require_exact(run: Trajectory, within: float) -> None:
    assert run.failure is None, str(run.failure)
    for name, values in exact().items():
        assert np.abs(run.columns[name] - values).max() < within, name


def at_rest() -> Model:
    """The model without the ramp, which never rests, in a scene that begins at rest."""
    model = lagging()
    scene = model.scenes["run"]
    still = replace(scene, pose="equilibrium", outputs=scene.outputs[:-1])
    return replace(model, states=model.states[:2], scenes={"run": still})


#: Steps that end at events are as exact as their rule; others are wrong by a part of the step in which the ramp bends by 2.
CROSSED = 2.1 * 2.5e-4

RUNS = {
    "recursive": {"trapezoidal": CROSSED, "rk4": 1e-9, "dormand-prince": 1e-7, "dop853": 1e-7},
    "recursive-newton": {"trapezoidal": CROSSED, "radau5-fixed": 1e-7, "radau5": 1e-7, "generalised-alpha": CROSSED},
    "augmented": {"trapezoidal": CROSSED},
    "classical": {"trapezoidal": CROSSED},
}


@pytest.mark.parametrize(("method", "integrator"), [(method, integrator) for method, rules in RUNS.items() for integrator in rules])
def test_methods_and_integrators_take_states_along(method: str, integrator: str) -> None:
    options = {"tolerance": 1e-9} if integrator in ("dormand-prince", "dop853", "radau5") else {}
    artifact = compile_scene(lagging(), lagging().scenes["run"], CompileOptions(method=method))
    require_exact(simulate(artifact, integrator=integrator, error=False, **options), RUNS[method][integrator])


@needs_cpp
@pytest.mark.parametrize("method", list(METHODS))
def test_generated_code_has_the_motion_of_the_interpreter(method: str) -> None:
    scene, options = lagging().scenes["run"], CompileOptions(method=method)
    runs = [simulate(each(lagging(), scene, options), integrator="trapezoidal", error=False) for each in (compile_scene, compile_code)]
    for name, column in runs[0].columns.items():
        assert np.abs(column - runs[1].columns[name]).max() < 1e-9, name


@pytest.mark.parametrize("method", list(METHODS))
def test_loops_move_as_without_states(method: str) -> None:
    model = read_model(MODELS / "slider_crank.yaml")
    scene = replace(find_scene(model, None), end=0.1)
    decay = replace(lagging().states[1], initial=sympy.Integer(2), span=model.span)
    beside = replace(model, states=(decay,))
    column = Output(element=decay.name, quantity=VALUE, span=model.span)
    alone, both = (
        simulate(compile_scene(m, s, CompileOptions(method=method)), integrator="trapezoidal", error=False)
        for m, s in ((model, scene), (beside, replace(scene, outputs=(*scene.outputs, column))))
    )
    assert np.abs(both.columns["decay.value"] - 2 * np.exp(-both.t)).max() < 1e-6
    for name, values in alone.columns.items():
        assert np.abs(both.columns[name] - values).max() <= 1e-9 * np.abs(values).max(), name


SMALL = """
cutjoint: 1
name: small
gravity: [0, 0, -9.81]
bodies: {bob: {mass: 0.01, centre_of_mass: [0.01, 0, 0]}}
joints: {pin: {kind: revolute, bodies: [ground, bob], at: [0, 0, 0], axis: [0, 1, 0]}}
states: {decay: {start: 2, rate: -decay}}
forces: {motor: {kind: joint_force, joint: pin, law: "-1e-4*decay"}}
outputs: [pin.angle, decay.value]
scenes: {run: {end: 0.2, output_step: 0.01}}
"""


@pytest.mark.parametrize("method", list(METHODS))
def test_mechanisms_far_from_a_metre_take_states_along(method: str) -> None:
    """A pendulum of a centimetre, beside SciPy."""
    model = read_model_text(SMALL, "small.yaml")
    run = simulate(compile_scene(model, model.scenes["run"], CompileOptions(method=method)), integrator="trapezoidal", dt=1e-4, error=False)
    assert np.abs(run.columns["decay.value"] - 2 * np.exp(-run.t)).max() < 1e-8
    known = solve_ivp(
        lambda t, y: [y[1], (0.01 * 9.81 * 0.01 * np.cos(y[0]) - 2e-4 * np.exp(-t)) / (0.01 * 0.01**2)], (0, 0.2), [0, 0],
        t_eval=run.t, rtol=1e-10, atol=1e-10,
    ).y[0]  # fmt: skip
    assert np.abs(run.columns["pin.angle"] - known).max() < 1e-3


def test_the_start_follows_from_parameters() -> None:
    run = simulate(compile_scene(lagging(), lagging().scenes["run"]), parameters={"lag": 0.4}, error=False)
    assert run.columns["decay.value"][0] == 3.0


def test_a_pose_at_rest_has_states_at_rest() -> None:
    found = find_scene_equilibrium(at_rest(), at_rest().scenes["run"]).values
    assert found["arm.pitch"] == pytest.approx(WEIGHT * np.cos(found["arm.pitch"]) - 4, abs=1e-6)
    run = simulate(compile_scene(at_rest(), at_rest().scenes["run"]), error=False)
    assert run.columns["torque.value"][0] == pytest.approx(-4, abs=1e-6)
    assert run.columns["decay.value"][0] == pytest.approx(0, abs=1e-6)


#: A block on a spring beside a volume of oil that a force compresses; pressures are of 1 bar, if what is typical is believed.
SQUEEZED = """
cutjoint: 1
name: squeezed
gravity: [0, 0, -9.81]
parameters: {F: {value: FORCE, unit: N}}
bodies: {block: {mass: 2, centre_of_mass: [0, 0, 0]}}
joints: {rail: {kind: prismatic, bodies: [ground, block], at: [0, 0, 0], axis: z}}
forces: {spring: {kind: joint_force, joint: rail, law: -900*position - 5*rate}}
states: {p: {start: 3 bar, rate: (F - p*1e-4)/1e-9, nominal: 1 bar}}
outputs: [block.z, p.value]
scenes: {rest: {end: 1, pose: equilibrium}}
"""


@pytest.mark.parametrize("force", [150.0, 1e5])
def test_a_state_rests_far_from_its_nominal_value(force: float) -> None:
    model = read_model_text(SQUEEZED.replace("FORCE", str(force)), "squeezed.yaml")
    found = find_scene_equilibrium(model, model.scenes["rest"]).values
    assert found["p.value"] == pytest.approx(force * 1e4, rel=1e-6)
    assert found["block.z"] == pytest.approx(-2 * 9.81 / 900, abs=1e-9)


def test_modes_have_the_rates_of_states() -> None:
    modes = find_scene_modes(at_rest(), at_rest().scenes["run"])
    assert modes.degrees_of_freedom == 1
    angle = find_scene_equilibrium(at_rest(), at_rest().scenes["run"]).values["arm.pitch"]
    swinging = np.roots([INERTIA, 2, 1 + WEIGHT * np.sin(angle)])
    found = [mode.eigenvalue for mode in modes.modes]
    for value in (-1, -5, *(x for x in swinging if x.imag >= 0)):
        assert min(abs(value - x) for x in found) < 1e-6 * abs(value), value


@needs_cpp
@pytest.mark.parametrize("method", ["recursive", "recursive-newton"])
def test_a_simulation_that_a_host_holds_has_states(method: str) -> None:
    """Snapshots go on bit by bit; derivatives are those of the equations by hand."""
    sim = load_scene(lagging(), lagging().scenes["run"], method=method, linearise=True)
    sim.reset()
    for _ in range(400):
        sim.step()
    taken = sim.snapshot()
    ends = []
    for _ in range(2):
        sim.advance(0.4)
        ends.append(sim.outputs.array.copy())
        sim.restore(taken)
    assert np.array_equal(*ends)
    space, angle = sim.linearise(), float(sim.outputs["pivot.angle"])
    assert space.states[-3:] == ("torque.value", "decay.value", "ramp.value")
    by_hand = np.array([
        [0, 1, 0, 0, 0], [-(1 + WEIGHT * np.sin(angle)) / INERTIA, -2 / INERTIA, 1 / INERTIA, 0, 0], [0, 0, -5, 0, 0], [0, 0, 0, -1, 0],
        [0, 0, 0, 0, 0],
    ])  # fmt: skip
    np.testing.assert_allclose(space.A, by_hand, rtol=0, atol=1e-6)


@needs_cpp
def test_hosts_of_fmus_integrate_states(tmp_path: Path) -> None:
    fmpy = pytest.importorskip("fmpy")
    for kind in ("me", "cs"):
        file = write(make_fmu(lagging(), lagging().scenes["run"], version=2, kind=kind), tmp_path)
        options = {"fmi_type": "ModelExchange", "relative_tolerance": 1e-10, "record_events": False} if kind == "me" else {}
        table = fmpy.simulate_fmu(str(file), stop_time=1.0, output_interval=0.05, **options)
        for name, values in exact().items():
            assert np.abs(table[name] - values).max() < (1e-6 if kind == "me" else CROSSED), (kind, name)


def test_reductions_leave_states() -> None:
    model, scene = lagging(), lagging().scenes["run"]
    for step in STEPS:
        if step.motion == "exact" and (outcome := step.reduce(model, scene)).done:
            model, scene = outcome.model, outcome.scene
    require_exact(simulate(compile_scene(model, scene), integrator="dormand-prince", tolerance=1e-9, error=False), 1e-7)


SCALES = """\
cutjoint: 1
name: scales
gravity: [0, 0, -9.81]
bodies:
  arm: {mass: 1, centre_of_mass: [0.5, 0, 0], inertia: [0.1, 0.1, 0.1]}
joints:
  pivot: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: y}
states:
  pressure: {start: 0 Pa, rate: "100*(HIGH*sin(60*t) - pressure)", nominal: HIGH Pa}
  film: {start: LOW m, rate: -30*film, nominal: LOW m}
outputs: [pivot.angle, pressure.value, film.value]
scenes:
  run: {end: 0.5, output_step: 0.01}
"""


def scaled(high: float, low: float, nominals: bool = True) -> Model:
    text = SCALES if nominals else SCALES.replace(", nominal: HIGH Pa", "").replace(", nominal: LOW m", "")
    return read_model_text(text.replace("HIGH", repr(high)).replace("LOW", repr(low)), "scales.yaml")


@pytest.mark.parametrize(
    ("method", "integrator"),
    [("recursive", "dormand-prince"), ("recursive", "dop853"), ("recursive-newton", "radau5")],
)
def test_states_of_all_sizes_have_one_tolerance(method: str, integrator: str) -> None:
    """Of a pressure and a film with nominals, both powers of two, steps are those of states near 1, to the last bit but for the scale.

    Without them a pressure takes shorter steps than it needs, and a film, below the tolerance, longer ones.
    """
    one, two, large, small = (
        simulate(compile_scene(m, m.scenes["run"], CompileOptions(method=method)), integrator=integrator, tolerance=1e-6, error=False)
        for m in (scaled(1.0, 1.0), scaled(2.0**17, 2.0**-20), *(scaled(size, 2.0**-20, nominals=False) for size in (2.0**17, 2.0**-20)))
    )
    assert one.failure is None
    assert small.steps < one.steps == two.steps < large.steps
    assert (one["pressure.value"] * 2.0**17 == two["pressure.value"]).all()
    assert (one["film.value"] * 2.0**-20 == two["film.value"]).all()
    assert (one["pivot.angle"] == two["pivot.angle"]).all()
    exact = 2.0**-20 * np.exp(-30 * one.t)
    assert np.abs(two["film.value"] - exact).max() < 1e-5 * 2.0**-20 < np.abs(small["film.value"] - exact).max()


@pytest.mark.parametrize(("method", "tolerance"), [("recursive", 1e-6), ("recursive-newton", 1e-10)])
def test_states_of_all_sizes_end_iterations_alike(method: str, tolerance: float) -> None:
    """A pressure whose rate is large does not let the motion go with less: iterates are those of states near 1, to the last bit but for
    the scale.  Newton's iteration is done behind two passes at wider tolerances, whatever the sizes."""
    one, two, loose = (
        simulate(
            compile_scene(m, m.scenes["run"], CompileOptions(method=method)), integrator="trapezoidal", dt=2e-3, tolerance=tolerance,
            error=False,
        )
        for m in (scaled(1.0, 1.0), scaled(2.0**17, 2.0**-20), scaled(2.0**17, 2.0**-20, nominals=False))
    )
    assert one.failure is None
    assert loose.evaluations != one.evaluations == two.evaluations
    assert (one["pressure.value"] * 2.0**17 == two["pressure.value"]).all()
    assert (one["pivot.angle"] == two["pivot.angle"]).all()


@pytest.mark.parametrize(
    ("nominal", "message"),
    [
        ("0", "nominal must be greater than zero; write how large the state usually is, such as nominal: 2 bar"),
        ("2 bar", "nominal needs m, got N/m^2"),
    ],
)
def test_nominals_that_are_none(nominal: str, message: str) -> None:
    with pytest.raises(ModelError) as raised:
        read_model_text(SCALES.replace("nominal: LOW m", f"nominal: {nominal}").replace("HIGH", "1").replace("LOW", "1"), "m.yaml")
    assert [f"m.yaml:10:47: state 'film': {message}"] == str(raised.value).splitlines()


@pytest.mark.parametrize(("method", "integrator"), [("recursive", "dormand-prince"), ("recursive-newton", "radau5")])
def test_steps_are_as_short_as_a_state_needs(method: str, integrator: str) -> None:
    """A number that follows a fast wave, while the mechanism rests: x' = 100 (sin 60 t - x)."""
    model = lagging()
    fast = replace(model.states[1], name="fast", symbol=DECAY, rate=100 * (sympy.sin(60 * TIME) - DECAY), initial=sympy.Integer(0))
    scene = replace(model.scenes["run"], outputs=(Output(element="fast", quantity=VALUE, span=model.span),))
    still = replace(model, gravity=(sympy.Integer(0),) * 3, states=(fast,), forces=(replace(model.forces[0], law=-variable("rate")),))
    run = simulate(compile_scene(still, scene, CompileOptions(method=method)), integrator=integrator, tolerance=1e-8, error=False)
    assert run.failure is None
    t, share = run.t, 100 / (100**2 + 60**2)
    expected = share * (100 * np.sin(60 * t) - 60 * np.cos(60 * t) + 60 * np.exp(-100 * t))
    assert np.abs(run.columns["fast.value"] - expected).max() < 1e-6


PUMP = """\
cutjoint: 1
name: pump
gravity: [0, 0, -9.81]
bodies: {rotor: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [0.02, 0.02, 0.02]}}
joints: {shaft: {kind: revolute, bodies: [ground, rotor], at: [0, 0, 0], axis: [0, 0, 1]}}
states:
  filled: {start: 0 m^3, rate: {table: {file: data/pump.csv, shaft.angle_rate: speed, value: flow}, interpolation: linear}}
  again: {start: 0 m^3, rate: fed}
  warm: {start: 300, rate: {table: {t: [0, 1], warm: [0, 400], value: [[0, -4], [4, 0]]}, interpolation: linear}}
signals: {fed: {table: {shaft.angle_rate: [0, 50*pi/3, 100*pi/3], value: [0, 15e-5, 1/3000]}, interpolation: linear}}
outputs: [filled.value, warm.value, again.value]
scenes: {run: {end: 1, rates: {shaft.angle_rate: 60}}}
"""
PUMPED = "speed [rpm], flow [l/min]\n-1000, -20\n0, 0\n500, 9\n1000, 20\n"


def pump(folder: Path, text: str = PUMP, table: str = PUMPED) -> Model:
    (folder / "data").mkdir(exist_ok=True)
    (folder / "data" / "pump.csv").write_text(table, encoding="utf-8")
    (folder / "m.yaml").write_text(text, encoding="utf-8")
    return read_model(folder / "m.yaml")


def test_a_table_is_a_rate_or_a_signal(tmp_path: Path) -> None:
    """A pump that turns at 60 rad/s, 573 rpm, has 9 + 11 (573 - 500)/500 l/min; warm' = 4 t - warm/100 by hand."""
    model = pump(tmp_path)
    run = simulate(compile_scene(model, model.scenes["run"]), integrator="dormand-prince", tolerance=1e-10, error=False)
    rpm = 60 * 30 / np.pi
    assert run["filled.value"][-1] == pytest.approx((9 + 11 * (rpm - 500) / 500) / 60e3, rel=1e-9)
    assert run["again.value"][-1] == pytest.approx(run["filled.value"][-1], rel=1e-9)
    assert run["warm.value"][-1] == pytest.approx(4 * 100 - 4 * 1e4 * (1 - np.exp(-0.01)) + 300 * np.exp(-0.01), rel=1e-9)


def test_a_signal_has_the_unit_of_its_table(tmp_path: Path) -> None:
    inline = "{shaft.angle_rate: [0, 50*pi/3, 100*pi/3], value: [0, 15e-5, 1/3000]}"
    assert inline in PUMP
    text = PUMP.replace(inline, "{file: data/pump.csv, shaft.angle_rate: speed, value: flow}")
    assert {signal.name: signal.unit for signal in pump(tmp_path, text).signals} == {"fed": "m^3/s"}
    with pytest.raises(ModelError, match=r"m\.yaml:8:30: state 'again': rate needs N\*s/m, got m\^3/s"):
        pump(tmp_path, text.replace("again: {start: 0 m^3", "again: {start: 0 kg"))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("value: flow", "value: floe", "m.yaml:7:94: state 'filled': the file 'data/pump.csv' has no column 'floe'; did you mean 'flow'?"),
        ("angle_rate: speed", "angle: speed",
            "pump.csv:1:1: state 'filled': rate.table.shaft.angle needs an angle or a plain number, got 1/s"),
        ("0 m^3", "0 kg", "pump.csv:1:14: state 'filled': rate.table.value needs N*s/m, got m^3/s"),
        ("500, 9", "500,", "pump.csv:4:5: state 'filled': a cell is empty; write a number, or leave the row out"),
        ("{t: [0, 1], ", "{now: [0, 1], ", "m.yaml:9:42: state 'warm': rate.table.now: unknown symbol 'now'"),
    ],
)  # fmt: skip
def test_tables_that_are_no_rates(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in PUMP + PUMPED
    with pytest.raises(ModelError) as raised:
        pump(tmp_path, PUMP.replace(old, new), PUMPED.replace(old, new))
    assert message in str(raised.value)
