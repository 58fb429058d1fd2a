"""Advice after a run that failed: it was tried, or is said not to be; another integrator takes over where nobody chose one."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.integrate import solve_ivp

from cutjoint.cli import main
from cutjoint.compile.derivation import derive
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.compile.pipeline import compile_scene
from cutjoint.methods import METHODS
from cutjoint.model.read import read_model, read_model_text
from cutjoint.report.tables import run_facts
from cutjoint.run.artifact import Artifact, make_simulator_run, start_of
from cutjoint.run.failures import FailedRunError
from cutjoint.run.fallbacks import Fallback, Trials, try_fallbacks, with_trials
from cutjoint.run.results import FailureReport
from cutjoint.run.scenes import find_case, find_scene, with_closure
from cutjoint.run.settings import Options
from cutjoint.run.simulation import simulate
from cutjoint.run.simulator import SimulatorError
from cutjoint.run.simulator_run import SimulatorRun, Start, start
from cutjoint.tasks.batch import compile_scene_batch, simulate_batch
from cutjoint.tasks.realtime import run_in_real_time
from tests.conftest import MODELS, needs_cpp

pytestmark = needs_cpp

#: A block on a rail, a tree: with dry friction the law has no value that keeps it at rest, and with a stiff spring short steps are needed.
BLOCK = """
cutjoint: 1
name: block
gravity: [0, 0, 0]
parameters: {friction: {value: 2, binding: param}, stiffness: {value: 0, binding: param}}
bodies: {block: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}}
joints: {slide: {kind: prismatic, bodies: [ground, block], at: [0, 0, 0], axis: [1, 0, 0]}}
forces:
  contact: {kind: joint_force, joint: slide, law: "where(rate > 0, -friction, friction) - stiffness*position**3"}
outputs: [block.x, block.vx]
scenes: {stop: {end: 1, output_step: 0.1, rates: {slide.displacement_rate: 1}}}
"""
STEP_SIZE_TOO_SMALL = "the run stands still: its steps have become too short for it to reach its end"
#: In a step of 10 ms no iteration converges with it.
STIFF = {"friction": 0.0, "stiffness": 1e12}


@cache
def block() -> Artifact:
    model = read_model_text(BLOCK, "block.yaml")
    return compile_scene(model, model.scenes["stop"])


@cache
def press(closure: str) -> Artifact:
    model = read_model(MODELS / "press.yaml")
    scene = find_scene(model, None)
    given = with_closure(scene, closure)
    return compile_scene(model, replace(given, numerics=replace(given.numerics, penalty=1e6 if closure == "penalty" else None)))


FAILING = {
    "tree": (block, Options(dt=0.01), STIFF),
    "tree, error control": (block, Options(integrator="dormand-prince"), {}),
    "loop, penalty": (lambda: press("penalty"), Options(dt=1e-3), {"stiffness": 1e9}),
    "loop, proximal": (lambda: press("proximal"), Options(dt=1e-3), {"stiffness": 1e9}),
}


@pytest.mark.parametrize("case", FAILING)
def test_what_is_said_to_help_helps(case: str) -> None:
    compiled, options, parameters = FAILING[case]
    plan = make_simulator_run(compiled(), options, parameters)
    trials = try_fallbacks(plan, start(plan))
    assert trials is not None
    assert trials.helped

    def ends(fallback: Fallback) -> bool:
        other = fallback.plan
        return start(replace(other, run_file=replace(other.run_file, end=trials.past))).failure is None

    assert all(ends(fallback) for fallback in trials.helped)
    assert not any(ends(fallback) for fallback in trials.failed)
    words = " ".join(fallback.words for fallback in (*trials.helped, *trials.failed))
    assert ("penalty" in words) == (case == "loop, penalty")


def test_the_message_has_what_was_tried_and_what_was_not() -> None:
    with pytest.raises(FailedRunError) as error:
        simulate(press("penalty"), dt=1e-3, parameters={"stiffness": 1e9})
    assert re.search(r"tried up to 0\.021 s: integrator dormand-prince, integrator dop853 and dt 0\.0001 go on", str(error.value))
    assert "; try: closure proximal; no results were written" in str(error.value)
    with pytest.raises(FailedRunError) as error:
        simulate(block(), dt=0.01, parameters=STIFF)
    assert not re.search("penalty|closure|spring", str(error.value))
    assert "method" not in str(error.value).partition("try: ")[2]


def test_no_method_sends_to_one_that_sends_back() -> None:
    """Methods that nobody has tried for a failure, by the advice of each method for the same failure."""
    failure, plan = FailureReport(message="", time=1.0, step=5, element="a", residual=1.0, advice="try: a smaller dt"), _press_plan()
    nothing = Trials(past=1.0, helped=(), failed=(), skipped=())
    advice = {method: with_trials(failure, replace(plan, method=method), nothing).advice for method in METHODS}
    named = {method: set(re.findall(r"method ([a-z-]+)", text)) for method, text in advice.items()}
    assert any(named.values())
    assert not [(one, other) for one in METHODS for other in named[one] if one in named[other]]


def _press_plan() -> SimulatorRun:
    model = read_model(MODELS / "press.yaml")
    return make_simulator_run(compile_interpreted(model, find_scene(model, None)), Options())


#: The sources of messages by the methods that have them.
SOURCES = {
    "recursive": ("stepping/trapezoidal.hpp", "runge_kutta/*.hpp"), "recursive-newton": ("newton/recursive_newton.hpp", "radau/*.hpp"),
    "classical": ("newton/classical.hpp",),
}  # fmt: skip


def test_no_message_names_the_method_that_has_it() -> None:
    """The advice of each cause beside the methods whose headers have that cause."""
    core = Path("runtime/include/cutjoint/core")
    text = (core / "simulation/fault.hpp").read_text(encoding="utf-8")
    shared = re.search(r'shorter_steps = "(.*)"', text)
    assert shared is not None
    table = text.partition("advice_of(const Fault& fault)")[2].replace("shorter_steps", shared[1])
    named = {
        cause: {m for m in METHODS if re.search(rf"methods?\b.*[ ,]{m}(?![-a-z])", advice)}
        for causes, advice in re.findall(r"((?:case Cause::\w+:\s*)+)return ([^;]*(?:;[^\n]*)?)", table)
        for cause in re.findall(r"::(\w+)", causes)
    }  # fmt: skip
    found = 0
    for method, patterns in SOURCES.items():
        for path in (path for pattern in patterns for path in core.glob(pattern)):
            causes = re.findall(r"Cause::(\w+)", path.read_text(encoding="utf-8"))
            found += sum(bool(named.get(cause)) for cause in causes)
            assert not [cause for cause in causes if method in named.get(cause, ())], path
    assert found >= 5
    assert named["pose_singular"] == {"augmented", "recursive"}


def test_what_nobody_chose_gives_way_to_what_can() -> None:
    """2 N stop 1 kg at 1 m/s after 0.5 s and 0.25 m; steps that end where the law jumps never leave that place."""
    for check in (True, False):
        run = simulate(block(), check=check)
        assert run["block.x"][-1] == pytest.approx(0.25, abs=2e-3)
        assert run.fallback.startswith("events crossed, since dormand-prince stopped: 'contact' (block.yaml:9)")
        assert "; make its law continuous there, or let steps go over it" in run.fallback
        assert np.isfinite(run.error["block.x"])
        assert any("since dormand-prince stopped" in str(cell) for cell in run_facts(block().compilation, run).columns[1].cells)
    with pytest.raises(FailedRunError, match=r"tried up to .* events crossed"):
        simulate(block(), integrator="dormand-prince")
    assert simulate(block(), integrator="dormand-prince", check=False).failure is not None


@pytest.mark.parametrize("accuracy", [1e-5, 1e-8])
def test_what_takes_over_keeps_the_accuracy(accuracy: float) -> None:
    """The block stops at 0.25 m; the same steps for all accuracies leave 1.6e-8 m."""
    model = read_model_text(BLOCK, "block.yaml")
    run = simulate(compile_interpreted(model, model.scenes["stop"]), accuracy=accuracy, end=0.51)
    assert run.fallback.startswith("events crossed")
    assert abs(run["block.x"][-1] - 0.25) < accuracy
    assert run.error["block.x"] < accuracy
    assert run.error.converged
    assert run.error.goal == accuracy


def test_a_method_that_somebody_names_stays(tmp_path: Path) -> None:
    model, out = tmp_path / "block.yaml", tmp_path / "run.csv"
    model.write_text(BLOCK, encoding="utf-8")
    for more, status in (((), 0), (("--method", "recursive"), 1), (("--integrator", "dormand-prince"), 1)):
        done = CliRunner().invoke(main, ["simulate", str(model), "--out", str(out), *more])
        assert done.exit_code == status, done.output
        assert ("since dormand-prince stopped" in done.output) == (status == 0)
        assert (tmp_path / "run.partial.csv").exists() == (status == 1)


def test_nothing_is_tried_against_the_clock_and_in_batches() -> None:
    times = run_in_real_time(block(), dt=0.01, parameters=STIFF, check=False)
    model = read_model_text(BLOCK, "block.yaml")
    batch = simulate_batch(compile_scene_batch(model, model.scenes["stop"]), [STIFF], dt=0.01, check=False)
    for failure in (times.failure, batch.failures[0], simulate(block(), dt=0.01, parameters=STIFF, check=False).failure):
        assert failure is not None
        assert failure.advice == ("a force, parameter or input may be out of its range; try: a smaller dt, or compiling with the method"
                                  " recursive-newton, as for stiff models")  # fmt: skip


def test_a_trial_that_takes_too_long_is_ended() -> None:
    plan = make_simulator_run(block(), Options(dt=1e-6, end=1e6, integrator="trapezoidal"), {"friction": 0.0})
    with pytest.raises(SimulatorError):
        start(plan, seconds=0.05)


@pytest.mark.parametrize(
    ("begin", "said"),
    [
        (Start(at_rest=False, closes_loops=True), "2, minimum norm: one.angle_rate, other.angle_rate"),
        (Start(at_rest=False, closes_loops=False), "2, zero: one.angle_rate, other.angle_rate"),
        (Start(at_rest=True, closes_loops=True), ""),
    ],
)  # fmt: skip
def test_speeds_that_the_run_has_chosen_are_named(begin: Start, said: str) -> None:
    run = replace(simulate(block()), undetermined=("one.angle_rate", "other.angle_rate"))
    table = run_facts(replace(block().compilation, start=begin), run)
    rows = dict(zip(table.columns[0].cells, table.columns[1].cells, strict=True))
    assert rows.get("initial velocities not specified", "") == said


@pytest.mark.parametrize(
    ("model", "at_rest", "closes_loops"), [("pendulum", True, False), ("four_bar", False, True), ("press", False, True)]
)
def test_what_the_speeds_at_a_start_follow_from(model: str, at_rest: bool, closes_loops: bool) -> None:
    checked = read_model(MODELS / f"{model}.yaml")
    scene = find_scene(checked, None)
    assert start_of(derive(checked, scene, scene.outputs)) == Start(at_rest=at_rest, closes_loops=closes_loops)


@pytest.mark.parametrize(
    ("words", "at_rest"), [("lock: [slide]", True), ('drive: {slide: "0.1*t"}', False), ("drive: {slide: push}", False)]
)
def test_joints_that_a_scene_locks_give_no_speed(words: str, at_rest: bool) -> None:
    text = BLOCK.replace("parameters: {", "parameters: {push: {value: 0, unit: m, binding: input}, ")
    text = re.sub("scenes: .*", f"scenes: {{held: {{end: 1, {words}}}}}", text)
    case, scene = find_case(read_model_text(text, "held.yaml"), "held")
    assert start_of(derive(case, scene, scene.outputs)).at_rest is at_rest


#: Two pendulums whose knee does not move at the start, and is held there by friction that is the sign of its speed.
STUCK = """
cutjoint: 1
name: stuck
gravity: [0, 0, -9.81]
bodies:
  upper: {mass: 2, centre_of_mass: [0, 0, -0.15], inertia: [0.03, 0.05, 0.03]}
  lower: {mass: 1, centre_of_mass: [0, 0, -0.4], inertia: [0.01, 0.01, 0.001]}
joints:
  top: {kind: revolute, bodies: [ground, upper], at: [0, 0, 0], axis: [0, 1, 0]}
  knee: {kind: revolute, bodies: [upper, lower], at: [0, 0, -0.2], axis: [0, 1, 0]}
forces: {dry: {kind: joint_force, joint: knee, law: "-20*sign(rate)"}}
outputs: [top.angle]
scenes: {swing: {end: 2, output_step: 0.01, rates: {top.angle_rate: 6}}}
"""


@pytest.mark.parametrize(
    ("method", "integrator", "events"),
    [("recursive-newton", "radau5", "located"), ("recursive-newton", "radau5", "crossed"), ("recursive", "dormand-prince", "located")],
)
def test_a_run_that_would_not_end_stops_and_says_why(method: str, integrator: str, events: str) -> None:
    """Friction that holds a joint from the start."""
    model = read_model_text(STUCK, "stuck.yaml")
    (scene,) = model.scenes.values()
    compiled = compile_interpreted(model, scene, method=method)
    run = start(make_simulator_run(compiled, Options(integrator=integrator, events=events)), seconds=300)
    assert run.evaluations < 10**6
    assert run.failure is not None
    assert run.failure.message in ("'dry' (stuck.yaml:11) switches to and fro without end", STEP_SIZE_TOO_SMALL)
    assert run.failure.advice
    assert ("sign(rate)" in run.failure.advice) == (run.failure.message == STEP_SIZE_TOO_SMALL)


def test_a_run_that_stands_still_is_reported_what_was_tried() -> None:
    model = read_model_text(STUCK, "stuck.yaml")
    (scene,) = model.scenes.values()
    for method, other in (("recursive", "recursive-newton"), ("recursive-newton", "recursive")):
        compiled = [compile_interpreted(model, scene, method=each) for each in (other, method)][1]  # the other's simulator is there now
        with pytest.raises(FailedRunError) as error:
            simulate(compiled)
        # a trial by crossed events takes about as long as it may
        goes_on = method == "recursive" and "tried up to 0.01 s: events crossed goes on" in str(error.value)
        assert goes_on or re.search(rf"tried without success: .* method {other}(;|,| and )", str(error.value))
        assert not re.search("try: .*method", str(error.value))


#: A leg that its guide turns away from a brace of two bars, until these are in line.
BRACE = """
cutjoint: 1
name: brace
gravity: [0, 0, -9.81]
points: {A: [0, 0, 0], B: [0, 0, -0.8], K: [0.5, 0, -0.5]}
bodies:
  leg: {mass: 5, centre_of_mass: B, inertia: [1, 1, 1]}
  upper: {mass: 1, centre_of_mass: K, inertia: [0.1, 0.1, 0.1]}
  lower: {mass: 1, centre_of_mass: K, inertia: [0.1, 0.1, 0.1]}
joints:
  trunnion: {kind: revolute, bodies: [ground, leg], at: A, axis: y, guide: 0.5*t}
  top: {kind: revolute, bodies: [ground, upper], at: [0.8, 0, 0], axis: y}
  knee: {kind: revolute, bodies: [upper, lower], at: K, axis: y}
  foot: {kind: revolute, bodies: [lower, leg], at: B, axis: y}
outputs: [trunnion.angle, knee.angle]
scenes: {retract: {end: 2, output_step: 0.1}}
"""


@pytest.mark.parametrize("method", ["recursive", "recursive-newton"])
def test_a_guide_that_leads_a_loop_past_its_reach_is_named(method: str) -> None:
    """The run ends where foot and top are as far apart as the bars together: law of cosines with the sides 0.8, 0.8."""
    model = read_model_text(BRACE, "brace.yaml")
    with pytest.raises(FailedRunError, match="the guide of 'trunnion' may exceed the reach of the links") as error:
        simulate(compile_interpreted(model, model.scenes["retract"], method=method))
    longest = 2 * np.hypot(0.3, 0.5)
    angle = np.arccos(1 - longest**2 / (2 * 0.8**2)) - np.pi / 2
    assert error.value.trajectory.failure.time == pytest.approx(2 * angle, abs=2e-3)


#: A crank as long as half a bar leads its end C along z; where the foot passes the crank's axis, both could turn together.
SCOTT_RUSSELL = """
cutjoint: 1
name: scott
gravity: [0, 0, -9.81]
points: {A: [0, 0, 0], B: [0.3, 0, 0.2], C: [0, 0, 0.4], D: [0.6, 0, 0]}
bodies:
  crank: {mass: 1, centre_of_mass: B, inertia: [0.01, 0.01, 0.01]}
  bar: {mass: 2, centre_of_mass: C, inertia: [0.03, 0.03, 0.03]}
  foot: {mass: 0.3, centre_of_mass: D, inertia: [0.001, 0.001, 0.001]}
joints:
  o: {kind: revolute, bodies: [ground, crank], at: A, axis: y}
  b: {kind: revolute, bodies: [crank, bar], at: B, axis: y}
  d: {kind: revolute, bodies: [bar, foot], at: D, axis: y}
  ds: {kind: prismatic, bodies: [ground, foot], at: D, axis: x}
forces: {lift: {kind: joint_force, joint: ds, law: "-200*(position + 0.4)"}}
outputs: [bar.x, bar.z, foot.x]
scenes: {run: {end: 0.4, output_step: 10 ms}}
"""


def slides(t: np.ndarray) -> np.ndarray:
    """The foot's place with one coordinate, the bar's angle: M(p) p'' = -M'(p) p'^2/2 - U'(p)."""
    length = np.hypot(0.6, 0.4)

    def rate(_: float, x: np.ndarray) -> list[float]:
        c, s = np.cos(x[0]), np.sin(x[0])
        mass = length**2 / 4 + 0.04 + length**2 * (2 * c**2 + 0.3 * s**2)
        force = 9.81 * 2.5 * length * c - 200 * (length * c - 0.2) * length * s
        return [x[1], (length**2 * 1.7 * c * s * x[1] ** 2 - force) / mass]

    found = solve_ivp(rate, (0, t[-1]), [np.arctan2(0.4, 0.6), 0.0], t_eval=t, rtol=1e-11, atol=1e-12)
    return np.asarray(length * np.cos(found.y[0]))


@pytest.mark.parametrize(("method", "integrator"), [("recursive", "dormand-prince"), ("recursive-newton", "radau5")])
def test_a_singular_pose_is_crossed(method: str, integrator: str) -> None:
    """The foot goes on beyond the crank's axis."""
    model = read_model_text(SCOTT_RUSSELL, "scott.yaml")
    run = simulate(compile_interpreted(model, model.scenes["run"], method=method), integrator=integrator)
    assert run["foot.x"].min() < -0.05
    assert run["foot.x"] == pytest.approx(slides(run.t), abs=1e-4)
    assert run["bar.x"] == pytest.approx(np.zeros(len(run.t)), abs=1e-4)
    assert np.hypot(run["foot.x"], run["bar.z"]) == pytest.approx(np.full(len(run.t), np.hypot(0.6, 0.4)), abs=1e-4)
