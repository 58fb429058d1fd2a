"""Model exchange: minimal coordinates, events, derivatives, against closed forms, the command line and FMPy's CVode."""

from __future__ import annotations

import ctypes
import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cutjoint.compile.pipeline import compile_scene
from cutjoint.export.fmu.archive import make_fmu
from cutjoint.model.read import read_model_text
from cutjoint.reduce.guards import guard_forces
from cutjoint.run.results import Trajectory
from cutjoint.run.scenes import find_scene
from cutjoint.run.simulation import simulate
from tests.conftest import needs_cpp, with_heavy
from tests.mechanisms.bouncing import exact_bounces
from tests.reduce.test_guards import TEXT as HAMMER

from .exchange import Array, Exchange
from .slaves import DISCARD, ERROR, OK, Slave, advanced, fmu_of, started, text_of, write

pytestmark = needs_cpp

versions = pytest.mark.parametrize("version", [2, 3])
VALID = [
    ("press", None, "both"), ("press", None, "me"), ("spinning", None, "both"), ("bounce", None, "both"), ("driven", "free", "both"),
    ("swaying", None, "both"), ("iltis", "simul1", "both"),
]  # fmt: skip


def exact_run(name: str, scene: str | None, **settings: float) -> Trajectory:
    """A run of the command line with small tolerances."""
    model = read_model_text(text_of(name), f"{name}.yaml")
    artifact = compile_scene(model, find_scene(model, scene))
    return simulate(artifact, integrator="dormand-prince", tolerance=1e-11, error=False, **settings)


def outputs_of(instance: Slave) -> dict[str, float]:
    names = [v.name for v in instance.fmu.interface.outputs]
    return dict(zip(names, instance.get(*names), strict=True))


@pytest.mark.parametrize(("name", "scene", "kind"), with_heavy(VALID, VALID[-1]))
@versions
def test_fmpy_finds_nothing_wrong(version: int, name: str, scene: str | None, kind: str, tmp_path: Path) -> None:
    validation = pytest.importorskip("fmpy.validation")
    file = write(fmu_of(name, version, scene, kind=kind), tmp_path, sources=True, binary=False)
    assert validation.validate_fmu(str(file)) == []


@pytest.mark.parametrize(("name", "version"), [("press", 2), ("press", 3), ("spinning", 3), ("swaying", 2)])
def test_cvode_has_the_motion_of_the_command_line(name: str, version: int, tmp_path: Path) -> None:
    fmpy = pytest.importorskip("fmpy")
    known = exact_run(name, None)
    table = fmpy.simulate_fmu(
        str(write(fmu_of(name, version, kind="both"), tmp_path)), fmi_type="ModelExchange", stop_time=known.t[-1],
        output_interval=known.t[1], relative_tolerance=1e-10, record_events=False,
    )  # fmt: skip
    assert len(table) == len(known.t)
    for column, values in known.columns.items():
        assert np.abs(table[column] - values).max() <= 1e-6 * max(1.0, np.abs(values).max()), column


@pytest.mark.heavy
def test_cvode_crosses_poses_with_several_ways_on(tmp_path: Path) -> None:
    """Three cranks of 1 m and 1 kg turn as one, with couplers that only translate: a pendulum of inertia 3 kg m2, which passes stretched
    parallelograms where the cranks lie."""
    fmpy = pytest.importorskip("fmpy")
    file = write(fmu_of("four_bar", 3, kind="me"), tmp_path)
    table = fmpy.simulate_fmu(str(file), stop_time=4.0, output_interval=0.02, relative_tolerance=1e-10, record_events=False)

    def derive(_: float, y: Array) -> Array:
        return np.array([y[1], 3.5 * 9.81 / 3 * np.sin(y[0])])

    known = solve_ivp(derive, (0.0, 4.0), [0.0, -1.0], t_eval=np.minimum(table["time"], 4.0), method="DOP853", rtol=1e-12, atol=1e-12).y
    assert np.sum(np.diff(np.sign(np.cos(known[0]))) != 0) == 4
    for name, values in (("crank_0.pin.angle", known[0]), ("crank_0.pin.angle_rate", known[1]), ("tip.x", -np.sin(known[0]))):
        assert np.abs(table[name] - values).max() < 1e-6, name


def test_cvode_finds_contacts_and_leaves_them(tmp_path: Path) -> None:
    fmpy = pytest.importorskip("fmpy")
    file = write(fmu_of("bounce", 2, kind="both"), tmp_path)
    table = fmpy.simulate_fmu(
        str(file), fmi_type="ModelExchange", stop_time=1.5, output_interval=0.01, relative_tolerance=1e-10, record_events=False
    )
    heights, switched = exact_bounces(table["time"], 5.0, 0.3)
    assert switched > 3
    assert np.abs(table["mass.z"] - heights).max() < 1e-7


@versions
def test_indicators_change_their_sign_at_contact(version: int) -> None:
    instance = Exchange(fmu_of("bounce", version, kind="both")).begin()
    assert instance.events > 0
    signs = []
    for height in (0.1, 1e-9, -1e-9, -0.1):
        assert instance.put(0.0, [height, 0.0]) == OK
        signs.append(instance.vector("GetEventIndicators", instance.events) > 0)
    assert (signs[0] == signs[1]).all()
    assert (signs[2] == signs[3]).all()
    assert (signs[1] != signs[2]).any()


@versions
def test_states_are_chosen_anew_as_a_ball_turns_and_the_motion_stays(version: int) -> None:
    known, instance = exact_run("spinning", None), Exchange(fmu_of("spinning", version, kind="both")).begin()
    assert instance.states == 8
    instance.integrate(1.0, 1000)
    assert instance.rechosen > 3
    for name, value in outputs_of(instance).items():
        assert value == pytest.approx(known[name][-1], rel=1e-7, abs=1e-7), name


@pytest.mark.heavy
def test_the_vehicle_by_an_integrator_of_the_host() -> None:
    known, instance = exact_run("iltis", "simul1", end=0.6), Exchange(fmu_of("iltis", 3, "simul1", kind="both")).begin()
    assert instance.states == 20
    instance.integrate(0.6, 1200)
    for name, value in outputs_of(instance).items():
        assert value == pytest.approx(known[name][-1], rel=1e-7, abs=1e-5), name


def test_inputs_that_move_guides_have_their_rates() -> None:
    instance = Exchange(fmu_of("driven", 3, "free", kind="both")).begin()
    assert instance.set(lift=0.4) == OK
    given = {"der(lift)": 0.7, "der(lift,2)": -0.3}
    for name, value in given.items():
        assert instance.set_reference(instance.references[name], value) == OK
    time, x = 0.5, instance.x
    assert instance.put(time, x) == OK
    angle, rate, shoulder = 0.4 + 0.2 * time * 0.16, 0.2 * 0.16 + (1 + 0.4 * time * 0.4) * 0.7, outputs_of(instance)
    spin = 0.8 * 0.4 * 0.7 + 0.4 * time * 0.7**2 - (1 + 0.4 * time * 0.4) * 0.3
    assert shoulder["shoulder.angle"] == pytest.approx(angle, rel=1e-14)
    assert shoulder["shoulder.angle_rate"] == pytest.approx(rate, rel=1e-14)
    assert shoulder["arm.az"] == pytest.approx(-0.5 * (np.cos(angle) * spin - np.sin(angle) * rate**2), rel=1e-12)
    by_rates = instance.directional(["shoulder.angle_rate", "arm.az"], ["der(lift)", "der(lift,2)"], [1.0, 2.0])
    turned, spun = 1 + 0.4 * time * 0.4, 2 * (0.8 * 0.4 / 2 + 0.4 * time * 0.7) + 2 * (1 + 0.4 * time * 0.4)
    assert by_rates == pytest.approx([turned, -0.5 * (np.cos(angle) * spun - 2 * np.sin(angle) * rate * turned)], rel=1e-12)


@versions
def test_directional_derivatives_are_those_of_a_closed_form(version: int) -> None:
    instance = Exchange(fmu_of("pendulum", version, kind="both")).begin()
    angle, rate = 0.7, -1.3  # from the rod along -x
    assert instance.put(0.0, [angle, rate]) == OK
    assert instance.derive(0.0, np.array([angle, rate])) == pytest.approx([rate, 9.81 * np.cos(angle)], rel=1e-12)
    found = instance.directional(["der(state[1])", "der(state[2])", "bob.y", "bob.vy"], ["state[1]", "state[2]"], [2.0, 3.0])
    y, vy = -2.0 * np.cos(angle), 2.0 * np.sin(angle) * rate - 3.0 * np.cos(angle)
    assert found == pytest.approx([3.0, -2.0 * 9.81 * np.sin(angle), y, vy], rel=1e-13)
    assert instance.x.tolist() == [angle, rate]


def matrix(instance: Exchange, unknowns: list[str], knowns: list[str]) -> Array:
    return np.array([instance.directional(unknowns, [known], [1.0]) for known in knowns]).T


def test_derivatives_with_loops_are_limits_of_differences() -> None:
    instance = Exchange(fmu_of("spinning", 3, kind="both")).begin()
    instance.integrate(0.02, 20)
    interface, x = instance.fmu.interface, instance.x
    unknowns = [v.name for v in (*interface.derivatives, *interface.outputs)]
    knowns = [v.name for v in (*interface.states, *interface.inputs)]
    found = matrix(instance, unknowns, knowns)

    def values(y: Array, pull: float) -> Array:
        assert instance.set(pull=pull) == OK
        return np.array([*instance.derive(0.02, y), *instance.get()])

    def changed(direction: Array, step: float) -> Array:
        parts = [values(x + sign * step * direction[:-1], sign * step * direction[-1]) for sign in (1.0, -1.0)]
        return (parts[0] - parts[1]) / (2 * step)

    for j, direction in enumerate(np.eye(len(knowns))):
        steps = [changed(direction, 8e-3 / 2**k) for k in range(4)]
        for order in (4, 16, 64):  # Richardson's extrapolation
            steps = [(order * b - a) / (order - 1) for a, b in pairwise(steps)]
        assert found[:, j] == pytest.approx(steps[0], rel=1e-7, abs=1e-7 * np.abs(found).max()), knowns[j]


@versions
def test_derivatives_by_parameters_are_those_of_motions_that_are_linear_in_them(version: int) -> None:
    """Accelerations and forces are linear in the stiffness: a difference is the derivative."""
    instance = Exchange(fmu_of("press", version, kind="both")).begin()
    instance.integrate(0.02, 20)
    x, unknowns = instance.x, ["der(state[1])", "der(state[2])", "spring.force"]

    def values(stiffness: float) -> Array:
        assert instance.call("EnterEventMode") == instance.set(stiffness=stiffness) == instance.call("EnterContinuousTimeMode") == OK
        return np.array([*instance.derive(0.02, x), instance.get()[3]])

    derivatives = (values(3000.0) - values(2000.0)) / 1000.0
    assert abs(derivatives[1]) > 1e-4
    assert instance.directional(unknowns, ["stiffness"], [1.0]) == pytest.approx(derivatives, rel=1e-10, abs=1e-12)
    both = instance.directional(unknowns, ["stiffness", "state[1]"], [2.0, 3.0])
    assert both == pytest.approx(2.0 * derivatives + 3.0 * instance.directional(unknowns, ["state[1]"], [1.0]), rel=1e-10)


@pytest.mark.parametrize("name", ["press", "spinning", "driven"])
def test_what_changes_depends_on_what_was_changed(name: str) -> None:
    """The structure says at least as much as changes."""
    fmu = fmu_of(name, 3, "free" if name == "driven" else None, kind="both")
    instance = Exchange(fmu).begin()
    instance.integrate(0.01, 10)
    variables = fmu.interface.variables
    unknowns = {i: v for i, v in enumerate(variables) if v.causality == "output" or v.derives is not None}
    for known, variable in enumerate(variables):
        is_state = known in {v.derives for v in variables if v.derives is not None}
        if not (is_state or known in range(*_inputs(fmu))):
            continue
        status, found = instance.ask_directional(list(unknowns), [known], [1.0])
        assert status == OK, instance.log
        changing = {v.name for (_, v), value in zip(unknowns.items(), found, strict=True) if abs(value) > 1e-7}
        assert changing <= {v.name for v in unknowns.values() if known in v.following}, variable.name


def test_speeds_of_a_loop_depend_on_its_places() -> None:
    """A speed that is read as it is depends on all states: another one is independent elsewhere.  Nothing is compiled."""
    model = read_model_text(text_of("press").replace("outputs: [pin.angle,", "outputs: [elbow.angle_rate, pin.angle,"), "press.yaml")
    variables = make_fmu(model, find_scene(model, None), version=3, kind="both").interface.variables
    places, speeds = ({i for i, v in enumerate(variables) if v.name == f"state[{k}]"} for k in (1, 2))
    (following,) = (set(v.following) for v in variables if v.name == "elbow.angle_rate")
    assert following == places | speeds


def _inputs(fmu) -> tuple[int, int]:  # type: ignore[no-untyped-def]
    first = next((i for i, v in enumerate(fmu.interface.variables) if v.causality == "input"), 0)
    return first, first + len(fmu.interface.inputs)


@versions
def test_co_simulation_beside_model_exchange_is_that_alone(version: int) -> None:
    both, alone = started(fmu_of("press", version, kind="both")), started(fmu_of("press", version))
    assert advanced(both, 20, 0.01) == advanced(alone, 20, 0.01)
    state, rate = both.get("state[1]", "der(state[1])")
    assert both.get("state[2]") == [rate]
    assert advanced(both, 20, 0.01, 0.2) == advanced(alone, 20, 0.01, 0.2)
    assert both.get("state[1]") != [state]


@versions
def test_states_that_loops_cannot_reach_are_discarded_and_leave_the_instance(version: int) -> None:
    instance = Exchange(fmu_of("spinning", version, kind="both")).begin()
    x, name = instance.x, "GetDerivatives" if version == 2 else "GetContinuousStateDerivatives"
    known, room, discarded = instance.derive(0.0, x), (ctypes.c_double * 8)(), 0
    for turn in np.random.default_rng(0).uniform(-2.0, 2.0, (40, 4)):
        assert instance.put(0.0, [*turn, *x[4:]]) == OK
        status = instance.call(name, room, ctypes.c_size_t(8))
        if status != OK:
            assert status == DISCARD
            assert instance.log[-1].startswith(f"fmi{version}{name}: at 0 s: the ")
            discarded += "the loop cannot close from the given coordinates: 'far." in instance.log[-1]
    assert discarded > 3
    assert instance.derive(0.0, x) == pytest.approx(known, rel=1e-9, abs=1e-9)


@versions
def test_saved_states_go_on_bit_by_bit(version: int) -> None:
    fmu = fmu_of("spinning", version, kind="both")
    instance = Exchange(fmu).begin()
    instance.integrate(0.2, 100)
    state, x = instance.save(), instance.x
    instance.integrate(0.4, 100, 0.2)
    known, rechosen = (instance.x.tolist(), outputs_of(instance)), instance.rechosen
    assert rechosen > 0
    assert instance.restore(state) == OK
    assert instance.x.tolist() == x.tolist()
    instance.integrate(0.4, 100, 0.2)
    assert (instance.x.tolist(), outputs_of(instance)) == known
    other = Slave(fmu)
    status, copy = other.deserialise(instance.serialise(state))
    assert status == OK
    assert other.restore(copy) == ERROR
    assert other.log[-1] == "restore: the state is that of model exchange"


def test_loops_of_a_hundred_metres_follow_states_in_one_go() -> None:
    """The slider of a press a thousand times as large, which is 380 m away where its crank points along the rail, by Pythagoras."""
    text = text_of("press").replace("0.1]", "100]").replace("[0.3,", "[300,").replace("[0.8,", "[800,").replace("0.48}", "480}")
    model = read_model_text(text, "press.yaml")
    instance = Exchange(make_fmu(model, find_scene(model, None), version=3, kind="me")).begin()
    for angle in (0.5, 1.5, 0.1):
        slider = 100 * np.sin(angle) + np.sqrt(300**2 + 100**2 - (100 * np.cos(angle)) ** 2)
        assert instance.put(0.0, [angle, 0.0]) == OK
        assert instance.get("pin.angle", "slider.x") == pytest.approx([angle, slider], abs=1e-9)


@versions
def test_a_force_that_was_left_out_and_would_act_ends_the_simulation_as_it_ends_a_step(version: int) -> None:
    model = read_model_text(HAMMER, "hammer.yaml")
    reduced = guard_forces(model, model.scenes["swing"], ("floor",))
    fmu = make_fmu(reduced.model, reduced.scene, version=version, kind="both")
    slave, instance, step, until = Slave(fmu), Exchange(fmu), 1e-3, 0
    assert slave.set(depth=0.1) == slave.initialise() == instance.set(depth=0.1) == OK
    while slave.step(until * step, step) == OK:
        until += 1
    assert until > 50
    instance.begin()
    for i in range(until):
        instance.integrate((i + 1) * step, 1, i * step)
        assert not instance.ended
    instance.integrate((until + 1) * step, 1, until * step)
    assert instance.ended
    said = "a guard is violated: the force would act, or the equation stands open: 'floor' (hammer.yaml:"
    assert said in slave.log[-1]
    assert instance.log[-1].startswith(f"fmi{version}CompletedIntegratorStep: at ")
    assert said in instance.log[-1]
    assert instance.call("Terminate") == OK


@versions
def test_states_and_parameters_are_values_too(version: int) -> None:
    """Hosts may set them one by one between steps: the derivatives are those of both given as the standard has it."""
    asked, other = Exchange(fmu_of("press", version, kind="me")), Exchange(fmu_of("press", version, kind="me")).begin()
    assert asked.initialise() == asked.set(stiffness=1500.0) == asked.update() == asked.call("EnterContinuousTimeMode") == OK
    known, before = asked.derive(0.0, np.array([0.3, 8.0])), other.derive(0.0, np.array([0.3, 8.0]))
    assert other.set(stiffness=1500.0) == OK
    assert all(other.set_reference(other.references[f"state[{i + 1}]"], value) == OK for i, value in enumerate((0.3, 8.0)))
    found = other.vector("GetDerivatives" if version == 2 else "GetContinuousStateDerivatives")
    assert found.tolist() == known.tolist()
    assert abs(before[1] - known[1]) > 1.0
    slope = other.directional(["der(state[2])"], ["integrator.step"], [1.0])
    assert slope.tolist() == [0.0]  # of the host's own integrator


@pytest.mark.parametrize("version", [2, 3])
def test_casadi_differentiates_an_fmu(version: int, tmp_path: Path) -> None:
    """Its function of states, and by FMI 2 of parameters, forward, backward and its Jacobian, beside differences of its values."""
    casadi = pytest.importorskip("casadi")
    dae = casadi.DaeBuilder("press", str(write(fmu_of("press", version, kind="me"), tmp_path)))
    inputs = ["x", "p"] if version == 2 else ["x"]
    f = dae.create("f", inputs, ["ode", "y"], {})
    at = [np.array([0.3, 10.0]), np.array([2000.0, 0.01, 1e-7, 1e-7])][: len(inputs)]
    values = f(*at)
    blocks = f.jacobian()(*at, *values)  # of each result by each argument
    rng = np.random.default_rng(0)
    ways = [rng.normal(size=2), np.array([1e3 * rng.normal(), 0, 0, 0])][: len(inputs)]

    def course(change: float) -> Array:
        return np.concatenate([np.array(part)[:, 0] for part in f(*(x + change * way for x, way in zip(at, ways, strict=True)))])

    ends = [course(1e-3 * k) for k in (-2, -1, 1, 2)]
    wanted = (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / 12e-3
    rows = [sum(np.array(blocks[len(inputs) * i + j]) @ way for j, way in enumerate(ways)) for i in range(2)]
    assert np.concatenate(rows) == pytest.approx(wanted, rel=1e-7, abs=1e-7)
    along = f.forward(1)(*at, *values, *ways)
    assert np.concatenate([np.array(part)[:, 0] for part in along]) == pytest.approx(wanted, rel=1e-7, abs=1e-7)
    weights = [rng.normal(size=2), rng.normal(size=4)]
    back = f.reverse(1)(*at, *values, *weights)
    found = sum(np.array(part)[:, 0] @ way for part, way in zip([back] if version == 3 else back, ways, strict=True))
    assert found == pytest.approx(np.concatenate(weights) @ wanted, rel=1e-7)


@versions
def test_wrong_calls(version: int) -> None:
    instance = Exchange(fmu_of("press", version, kind="both"))
    numbers, two, one = (ctypes.c_double * 2)(0.1, math.nan), ctypes.c_size_t(2), ctypes.c_size_t(1)
    assert instance.call("SetContinuousStates", numbers, two) == instance.call("EnterContinuousTimeMode") == ERROR
    assert instance.log[-1].endswith("not allowed before initialization mode")
    assert instance.initialise() == OK
    assert instance.step(0.0, 0.01) == instance.call("SetContinuousStates", numbers, two) == ERROR
    assert instance.log[-1].endswith("not allowed in event mode")
    assert instance.set(stiffness=1500.0) == OK
    assert instance.set_reference(instance.references["state[1]"], 0.0) == ERROR
    assert "a state can be set in continuous-time mode only: value reference" in instance.log[-1]
    assert instance.update() == instance.call("EnterContinuousTimeMode") == OK
    x = instance.x.tolist()
    for call, words in (
        (lambda: instance.call("SetContinuousStates", numbers, two), "the value is not finite: state 2"),
        (lambda: instance.call("SetContinuousStates", numbers, one), "the array must have 2 numbers"),
        (lambda: instance.call("GetContinuousStates", None, two), "the array must have 2 numbers"),
        (lambda: instance.call("SetTime", ctypes.c_double(math.inf)), "the time is not finite"),
        (lambda: instance.set_reference(instance.references["der(state[1])"], 0.0), "only parameters, inputs and states can be set, which"),
        (lambda: instance.set_reference(instance.references["state[1]"], math.nan), "the value is not finite: value reference"),
        (lambda: instance.call("EnterContinuousTimeMode"), "not allowed in continuous-time mode"),
        (lambda: instance.ask_directional([1], [instance.references["state[1]"]], [1.0])[0], "value reference 1 is no output"),
        (lambda: instance.ask_directional([instance.references["slider.x"]], [0], [1.0])[0], "value reference 0 is no state"),
        (lambda: instance.ask_directional([instance.references["slider.x"]], [99], [1.0])[0], "value reference 99 is no state"),
    ):  # fmt: skip
        assert call() == ERROR
        assert words in instance.log[-1]
    assert instance.x.tolist() == x
    simulated = started(fmu_of("press", version, kind="both"))
    assert simulated.call("GetContinuousStates", numbers, two) == simulated.call("EnterEventMode") == ERROR
    assert not Exchange(fmu_of("press", version)).exists
    assert not Slave(fmu_of("press", version, kind="me")).exists
