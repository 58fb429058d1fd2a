"""Estimated errors of runs against exact ones, also beside jumps, and what counts as converged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console
from scipy.linalg import expm

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.model.read import read_model, read_model_text
from cutjoint.report.tables import error_facts
from cutjoint.run.accuracy import compare, differences
from cutjoint.run.results import Columns, Trajectory
from cutjoint.run.simulation import simulate
from cutjoint_bench.estimate_models import LAWS, MECHANISMS
from cutjoint_bench.studies.estimates import judge
from tests.physics.simulation import compile_scene, completed
from tests.physics.test_accuracy import _RUN, OSCILLATOR, oscillator, true_errors


def test_the_finer_run_of_steps_that_do_not_divide_a_run_ends_with_it() -> None:
    """Two steps of 10 ms for 15 ms end at 20 ms, where a finer run of 15 ms has no row: the errors were 0."""
    model = read_model_text(OSCILLATOR.replace("SCENE", ""), "oscillator.yaml")
    run = completed(simulate(compile_interpreted(model, model.scenes["swing"]), end=0.015, dt=0.01))
    assert run.t[-1] == 0.02
    error = abs(run["block.x"][-1] - 0.1 * np.cos(0.4))
    assert error > 1e-5
    assert run.error is not None
    assert 0.8 * error < run.error.max_error["block.x"] < 1.3 * error


def test_half_turns_of_either_sign_are_one_attitude() -> None:
    """A pendulum beyond a quarter turn about y has roll and yaw of half a turn, whose sign was rounding: errors of 6.28 rad."""
    text = """
cutjoint: 1
name: over
gravity: [0, 0, -9.81]
bodies: {arm: {mass: 1, centre_of_mass: [0.5, 0, 0], inertia: [0.01, 0.02, 0.03]}}
joints: {hinge: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: y}}
outputs: [arm.roll, arm.pitch, arm.yaw]
scenes: {turn: {end: 1, rates: {hinge.angle_rate: 8}, positions: {hinge.angle: -0.1}}}
"""
    model = read_model_text(text, "over.yaml")
    artifact = compile_interpreted(model, model.scenes["turn"], method="augmented")
    one = completed(simulate(artifact, dt=1e-3))
    signs = np.where(np.arange(one.t.size) % 2, one["arm.yaw"], -one["arm.yaw"])
    other = replace(one, columns=Columns({**one.columns, "arm.yaw": signs}))
    assert np.ptp(one["arm.yaw"]) > 3
    assert differences((), one, other)["arm.yaw"] < 1e-9


@pytest.mark.parametrize("stride", [3, 27, 101, 300])
def test_runs_are_compared_where_steps_of_both_end(stride: int) -> None:
    """27 steps of 1 ms between samples are 13 or 14 of 2 ms: the runs had few common times, or the start alone, and seemed to differ there
    less than from finer runs at all times: "do not converge"."""
    model = read_model_text(OSCILLATOR.replace("output_step: 10 ms", f"output_step: {stride} ms").replace("SCENE", ""), "oscillator.yaml")
    run = completed(simulate(compile_interpreted(model, model.scenes["swing"]), end=0.303, dt=1e-3))
    assert run.error.converged
    for name, error in true_errors(run).items():
        assert error / 3 < run.error[name] < 3 * error


@pytest.mark.parametrize(
    ("method", "settings"),
    [
        ("recursive", {"dt": 1e-3}), ("recursive", {"dt": 5e-3}), ("recursive", {"integrator": "rk4", "dt": 5e-3}),
        ("recursive", {"integrator": "dormand-prince", "tolerance": 1e-4}),
        ("recursive", {"integrator": "dormand-prince", "tolerance": 1e-8}),
        ("recursive", {}), ("augmented", {}), ("recursive-newton", {}),
        ("recursive-newton", {"dt": 2e-3}), ("recursive-newton", {"integrator": "radau5-fixed", "dt": 5e-3}),
        ("recursive-newton", {"integrator": "generalised-alpha", "dt": 1e-3}),
    ],
)  # fmt: skip
def test_estimates_are_near_the_true_error(method: str, settings: dict[str, float]) -> None:
    """Errors of radau5, the rule of recursive-newton without settings, fall with the power 5/4 of its tolerance; estimates take 1."""
    most = 5 if method != "recursive-newton" or settings else 5 * 10**0.25
    run = completed(simulate(oscillator(method), **settings))
    assert run.error.converged
    for name, error in true_errors(run).items():
        assert error / 5 < run.error[name] < most * error


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("mechanism", ["yoke", "crank", "light crank", "rocker"])
def test_what_has_converged_is_not_told_too_small(mechanism: str, law: str) -> None:
    """Dead centres, a rod without mass, friction and a stop: two runs with one tolerance of the iteration could agree by it, so that the
    stricter one's error seemed a seventh of their difference."""
    model = read_model_text(MECHANISMS[mechanism].replace("LAW", LAWS[law]), "drawn.yaml")
    (scene,) = model.scenes.values()
    artifacts = {method: compile_interpreted(model, scene, method=method) for method in ("recursive", "recursive-newton")}
    for speed, friction, width in ((10.0, 0.8, 0.01), (7.3, 0.2, 0.03)):
        how = {"parameters": {"speed": speed, "friction": friction, "width": width}}
        reference = simulate(artifacts["recursive"], integrator="dormand-prince", tolerance=1e-12, error=False, **how)
        equal = {"integrator": "trapezoidal", "dt": 1e-3}
        for method, settings in (("recursive", {}), ("recursive-newton", {}), ("recursive-newton", equal)):
            run = completed(simulate(artifacts[method], **settings, **how))
            judgement = judge(run, reference)
            assert not judgement.is_short, (method, settings, speed, judgement)


@pytest.mark.parametrize(
    ("mechanism", "law", "numbers"),
    [
        ("yoke", "steep, stop", (5.792468214320875, 0.20542386799405382, 0.3063218736417642, 511.5532881337676)),
        ("light crank", "steep, stop", (13.401328945761097, 2.02952664791266, 0.041700791059654185, 931.1425992278683)),
        ("light crank", "Coulomb, stop", (13.122434853483938, 1.8377291971110565, 0.1551816354301156, 2219.324215347329)),
    ],
)
def test_differences_that_fall_faster_than_the_order_agree_by_chance(
    mechanism: str, law: str, numbers: tuple[float, float, float, float]
) -> None:  # fmt: skip
    """Equal steps of order 2 whose differences fell by eight and nine over a stop were once believed to leave a third of them."""
    model = read_model_text(MECHANISMS[mechanism].replace("LAW", LAWS[law]), "drawn.yaml")
    (scene,) = model.scenes.values()
    how = {"parameters": dict(zip(("speed", "friction", "width", "stiffness"), numbers, strict=True))}
    run = completed(simulate(compile_interpreted(model, scene, method="augmented"), **how))
    exact = compile_interpreted(model, scene)
    reference = simulate(exact, integrator="dormand-prince", tolerance=1e-12, error=False, **how)
    judgement = judge(run, reference)
    assert judgement.converged
    assert judgement.ratios
    assert not judgement.is_short, judgement


#: A block on a spring that dry friction of 0.2 N brakes: it turns back each pi/20 s, when the friction jumps to the other side.
RUBBED = OSCILLATOR.replace(
    'law: "-400*position"}}', 'law: "-400*position"}, rub: {kind: joint_force, joint: rail, law: "-0.2*sign(rate)"}}'
).replace("[block.x, block.vx]", "[block.x, rub.force]")  # fmt: skip


def rubbed(method: str, late: float, steps: int | None, targets: dict[str, float] | None = None) -> tuple[Trajectory, float]:
    """A run with its tenth row so ``late`` (s) behind the turn, with ``steps`` between rows, and the true error of its friction."""
    row = (np.pi / 20 + late) / 10
    text = RUBBED.replace("SCENE", "").replace("end: 3, output_step: 10 ms", f"end: {15 * row!r} s, output_step: {row!r} s")
    model = read_model_text(text, "rubbed.yaml")
    (scene,) = model.scenes.values()
    run = completed(simulate(compile_interpreted(model, scene, method=method), dt=None if steps is None else row / steps, accuracy=targets))
    exact = np.where(run.t < np.pi / 20, 0.2, -0.2)
    return run, float(np.max(np.abs(run["rub.force"] - exact)[1:]))


@pytest.mark.parametrize(
    ("method", "steps", "late"),
    [
        ("recursive", 10, 1e-9), ("recursive", 10, 1e-6), ("augmented", 10, 1e-7), ("augmented", None, 1e-9),
        ("recursive-newton", 10, 1e-9),
    ],
)  # fmt: skip
def test_a_row_beside_a_jump_may_have_its_other_side(method: str, steps: int | None, late: float) -> None:
    """All runs turn back a little late and agree on the side that the row has not: the friction was reported to have no error."""
    run, error = rubbed(method, late, steps)
    assert error == pytest.approx(0.4)
    assert run.error.converged
    assert run.error["rub.force"] == pytest.approx(0.4)
    assert run.error["block.x"] < 1e-4


@pytest.mark.parametrize(("target", "met"), [(0.1, False), (0.5, True)])
def test_a_target_is_not_met_by_a_row_that_may_have_the_other_side(target: float, met: bool) -> None:
    run, error = rubbed("augmented", 1e-9, None, {"rub.force": target})
    assert error == pytest.approx(0.4)
    assert run.error.converged is met
    assert run.error.targets == {"rub.force": target}


@pytest.mark.parametrize(("method", "steps"), [("recursive", 10), ("recursive", None), ("augmented", None), ("recursive-newton", None)])
@pytest.mark.parametrize("late", [-1e-4, 1e-4])
def test_a_row_farther_from_a_jump_than_its_time_is_wrong_has_its_own_side(method: str, steps: int | None, late: float) -> None:
    run, error = rubbed(method, late, steps)
    assert error < 1e-9
    assert run.near_jumps
    assert run.error["rub.force"] < 1e-9


def test_places_converge_beside_an_output_that_does_not() -> None:
    """A signal has a thousand periods within the rounding of the place that it follows, and moves nothing."""
    text = OSCILLATOR.replace("SCENE", "").replace("[block", "[noise.value, block")
    text = text.replace("forces:", "signals: {noise: sin(1e18*block.x)}\nforces:")
    model = read_model_text(text, "noise.yaml")
    run = simulate(compile_interpreted(model, model.scenes["swing"]))
    assert run.error.converged
    assert run.error.rough == ("noise.value",)
    assert true_errors(run)["block.x"] < run.error.goal


@pytest.mark.parametrize(("size", "converged"), [(1.0, True), (1e-6, False)])
def test_rounding_of_what_is_zero_by_symmetry_falls_no_further(size: float, converged: bool) -> None:
    """Three runs with errors of ``far`` that fall by four and noise of 1e-11 in ``across`` that does not: beside a metre it is rounding."""
    t, rng = np.linspace(0, 1, 50), np.random.default_rng(0)

    def run(level: int) -> Trajectory:
        columns = {"far": size * (np.sin(t) + 1e-3 * 4.0**-level * t), "across": 1e-11 * rng.standard_normal(t.size)}
        units = {"far": "m", "across": "m"}
        return Trajectory(t=t, columns=columns, units=units, steps=1, evaluations=1, seconds=0.0, undetermined=(), failure=None)

    assert compare(run(0), run, remaining=0.25)[0].converged is converged


def test_runs_that_agree_by_chance_do_not_promise_much() -> None:
    """Behind its singular poses errors of the four-bar follow from where steps happen to fall: 1 ms and 0.5 ms agree ten times as well as
    either with shorter ones."""
    model = read_model("models/four_bar.yaml")
    artifact = compile_scene(model, model.scenes["swing"])
    run, finer, reference = (
        completed(simulate(artifact, integrator="rk4", dt=dt, error=error)) for dt, error in ((1e-3, True), (5e-4, False), (5e-5, False))
    )
    assert not np.array_equal(run["tip.vx"], finer["tip.vx"])
    for name in ("tip.x", "tip.y", "tip.vx", "tip.vy"):
        assert run.error[name] > 0.2 * np.max(np.abs(run[name] - reference[name]))


#: The oscillator with a damper that a controller samples so often that its samples bound all steps.
SAMPLED = """
cutjoint: 1
name: sampled
gravity: [0, 0, 0]
bodies: {block: {mass: 1, centre_of_mass: [0, 0, 0]}}
joints: {rail: {kind: prismatic, bodies: [ground, block], at: [0, 0, 0], axis: [1, 0, 0]}}
forces: {spring: {kind: joint_force, joint: rail, law: "-400*position + damper.push"}}
controllers: {damper: {every: 5 ms, signals: {push: -2*block.vx}}}
outputs: [block.x, block.vx]
scenes: {swing: {end: 1, output_step: 10 ms, positions: {rail.displacement: 0.1}, numerics: {solver_tolerance: 1.0e-5}}}
"""


@pytest.mark.parametrize("method", ["recursive", "recursive-newton"])
@pytest.mark.parametrize("scene", ["numerics: {solver_tolerance: 1.0e-5}", "accuracy: 1.0e-3"])
def test_runs_whose_steps_end_at_samples_are_not_told_to_be_exact(method: str, scene: str) -> None:
    """Beside the matrix exponential from sample to sample, with the push of each held."""
    model = read_model_text(SAMPLED.replace("numerics: {solver_tolerance: 1.0e-5}", scene), "sampled.yaml")
    run = simulate(compile_interpreted(model, model.scenes["swing"], method=method))
    over = expm(np.array([[0, 1, 0], [-400, 0, 1], [0, 0, 0]]) * 5e-3)
    states = [np.array([0.1, 0.0])]
    for _ in range(200):
        x, v = states[-1]
        states.append((over @ [x, v, -2 * v])[:2])
    exact = np.array(states)[::2]
    for i, name in enumerate(("block.x", "block.vx")):
        true = float(np.abs(run[name] - exact[:, i]).max())
        assert run.error[name] > true / 3
        assert run.error[name] > 0


def test_outputs_that_are_far_off_are_named_beside_places_that_have_converged() -> None:
    t = np.linspace(0, 1, 11)
    place, force = np.sin(t), 100 * np.sin(t)
    runs = {n: replace(_RUN, t=t, columns=Columns({"b.x": place + 1e-9 * 4**-n, "s.force": force + 40 * 4.0**-n})) for n in (-1, 0, 1)}
    estimate = compare(runs[0], runs.get, remaining=0.25)[0]
    assert estimate.converged
    assert estimate.rough == ("s.force",)
    console = Console(width=300)
    with console.capture() as said:
        console.print(error_facts(estimate))
    assert "but not s.force: errors above a tenth of their largest values" in said.get()


def test_what_stands_still_has_converged() -> None:
    """Speeds and accelerations in an equilibrium are zero but for rounding, and have no value of their unit to be compared with."""
    held = compile_scene(still := read_model_text(HUNG, "hung.yaml"), still.scenes["rest"])
    for dt in (None, 1e-3):
        run = completed(simulate(held, dt=dt))
        assert run.error.converged
        assert run.error.rough == ()
        assert max(np.abs(run[name]).max() for name in ("a.vz", "j.angle_rate", "a.az")) < 1e-6


#: A body on a spring at rest: 2 kg at 0.3 m.
HUNG = """
cutjoint: 1
name: hung
gravity: [0, 0, -9.81]
bodies: {a: {mass: 2, centre_of_mass: [0.3, 0, 0], inertia: [0.01, 0.02, 0.02]}}
joints: {j: {kind: revolute, bodies: [ground, a], at: [0, 0, 0], axis: y, spring: {stiffness: 20, damping: 1}}}
outputs: [a.x, a.z, a.vz, j.angle_rate, a.az]
scenes: {rest: {end: 2, output_step: 10 ms, pose: equilibrium}}
"""


@pytest.mark.parametrize("share", [0.01, 0.5])
def test_a_rate_that_is_far_off_is_named_beside_places_that_have_converged(share: float) -> None:
    """A millimetre to and fro, ten times a second, has a rate of 63 mm/s."""
    t = np.linspace(0, 1, 101)
    units = {"b.x": "m", "b.vx": "m/s"}
    place, rate = 1e-3 * np.sin(20 * np.pi * t), 0.02 * np.pi * np.cos(20 * np.pi * t)
    runs = {
        n: replace(_RUN, t=t, units=units, columns=Columns({"b.x": place + 1e-9 * 4.0**-n, "b.vx": rate * (1 + share * 4.0**-n)}))
        for n in (-1, 0, 1)
    }
    assert compare(runs[0], runs.get, remaining=0.25)[0].rough == (("b.vx",) if share > 0.1 else ())


@pytest.mark.parametrize(("size", "converged"), [(5e-4, False), (5e-6, True)])
def test_differences_that_fall_no_further_are_small_below_a_hundred_thousandth(size: float, converged: bool) -> None:
    """Runs with finer and finer steps that go to and fro by so much of what the output reaches."""
    t = np.linspace(0, 1, 11)
    runs = {n: replace(_RUN, t=t, columns=Columns({"b.x": np.sin(t) + size * (n % 2)})) for n in (-1, 0, 1)}
    assert compare(runs[0], runs.get, remaining=0.25)[0].converged is converged
