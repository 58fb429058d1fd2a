"""Integrators that locate events: their order across changes of formula, against exact motions and against SciPy's."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cutjoint.compile.options import CompileOptions
from cutjoint.model.read import read_model_text
from cutjoint.run.artifact import Artifact
from cutjoint.run.scenes import find_scene, with_closure
from tests.mechanisms.bouncing import GRAVITY, MASS, bouncing_text, exact_bounces
from tests.mechanisms.swaying import swaying_text
from tests.mechanisms.switching import PULSES, TABLE, WHEEL, pulsed, swing_over_knots, wheel_heights
from tests.physics.simulation import compile_model, compile_scene, completed, simulate

#: Integrators with steps of equal length, as long as the tolerance allows, and the method that has both.
EQUAL = {"rk4": "recursive", "radau5-fixed": "recursive-newton"}
ADAPTIVE = {"dormand-prince": "recursive", "dop853": "recursive", "radau5": "recursive-newton"}

#: Rules of order 2, whose steps end at events if that is asked for.
RULES = (("trapezoidal", "recursive"), ("trapezoidal", "recursive-newton"), ("generalised-alpha", "recursive-newton"))

#: The remainder of an implicit stage's iteration beside the errors that are looked at.
TIGHT: dict[str, dict[str, float]] = {"rk4": {}, "radau5-fixed": {"tolerance": 1e-12}}


def compiled(folder: Path, text: str, method: str) -> Artifact:
    path = folder / "model.yaml"
    path.write_text(text, encoding="utf-8")
    return compile_model(path, method=method)


def errors_of(error: Callable[..., float], integrator: str, steps: Sequence[float]) -> list[float]:
    return [error(integrator=integrator, dt=dt, **TIGHT[integrator]) for dt in steps]


def check_orders(errors: Sequence[float], integrator: str) -> None:
    """Check the order of each halving of the step; with rk4 it depends more on where in their steps the events lie."""
    orders = [float(np.log2(a / b)) for a, b in pairwise(errors)]
    least, most = {"rk4": (3.5, 5.3), "radau5-fixed": (4.5, 5.4)}[integrator]
    assert all(least < order < most for order in orders), (orders, errors)


def check_proportional(error: Callable[..., float], integrator: str, tolerances: Sequence[float], within: float) -> None:
    """Errors over tolerance stay within a factor, over decades of tolerance: the sign of an order that is kept everywhere.

    Steps of radau5 have order 5 and an estimate of order 3: its errors fall with the power 5/4."""
    power = 1.25 if integrator == "radau5" else 1.0
    ratios = [error(integrator=integrator, tolerance=tolerance) / tolerance**power for tolerance in tolerances]
    assert np.max(ratios) < within * np.min(ratios), ratios  # of nan too, which max passes over


def bouncing_error(folder: Path, damping: float, method: str) -> Callable[..., float]:
    """Errors of the heights; events are as many as the motion has, or none where steps go over them."""
    artifact = compiled(folder, bouncing_text(damping, 0.5), method)

    def error(**how: Any) -> float:
        run = completed(simulate(artifact, **how))
        heights, switched = exact_bounces(run.t, damping, 0.5)
        reported = {} if how.get("events") == "crossed" else {"floor": switched}
        assert (run.statistics.events, run.statistics.events_by_element) == (sum(reported.values()), reported)
        return float(np.abs(run["mass.z"] - heights).max())

    return error


@pytest.mark.parametrize("damping", [0.0, 10.0])
@pytest.mark.parametrize("integrator", EQUAL)
def test_order_across_contacts_that_are_made_and_lost(integrator: str, damping: float, tmp_path: Path) -> None:
    """With damping the force jumps when the stop is met.  Steps that ignored events would be of order 2 without damping and 1 with it."""
    steps = {"rk4": (5e-3, 2.5e-3, 1.25e-3, 6.25e-4), "radau5-fixed": (2.5e-3, 1.25e-3, 6.25e-4)}[integrator]
    check_orders(errors_of(bouncing_error(tmp_path, damping, EQUAL[integrator]), integrator, steps), integrator)


@pytest.mark.parametrize("damping", [0.0, 10.0])
@pytest.mark.parametrize("integrator", ADAPTIVE)
def test_errors_follow_the_tolerance_across_contacts(integrator: str, damping: float, tmp_path: Path) -> None:
    tolerances = (1e-4, 1e-6, 1e-8, 1e-10) if ADAPTIVE[integrator] == "recursive-newton" else (1e-6, 1e-8, 1e-10, 1e-12)
    check_proportional(bouncing_error(tmp_path, damping, ADAPTIVE[integrator]), integrator, tolerances, 4.0)


@pytest.mark.parametrize("damping", [0.0, 10.0])
@pytest.mark.parametrize(("integrator", "method"), RULES)
def test_order_of_rules_across_contacts(integrator: str, method: str, damping: float, tmp_path: Path) -> None:
    error = bouncing_error(tmp_path, damping, method)
    check_order_2([error(integrator=integrator, events="located", tolerance=1e-12, dt=dt) for dt in (2.5e-3, 1.25e-3, 6.25e-4)])


@pytest.mark.parametrize(("integrator", "method"), RULES)
def test_order_of_rules_across_breaks_of_the_road(integrator: str, method: str, tmp_path: Path) -> None:
    artifact = compiled(tmp_path, WHEEL, method)
    heights = wheel_heights(np.arange(21) * 0.05)

    def error(dt: float) -> float:
        run = completed(simulate(artifact, integrator=integrator, events="located", tolerance=1e-12, dt=dt))
        assert run.statistics.events_by_element["tyre"] >= 4
        return float(np.abs(run["hub.z"] - heights).max())

    check_order_2([error(dt) for dt in (2.5e-3, 1.25e-3, 6.25e-4)])


@pytest.mark.parametrize(
    ("integrator", "method", "closure"), [*((*rule, "penalty") for rule in RULES), ("trapezoidal", "recursive", "proximal")],
)  # fmt: skip
def test_order_of_rules_with_loops(integrator: str, method: str, closure: str, tmp_path: Path) -> None:
    """Against the explicit method of order 5; stabilised loops stay as open as the step leaves them, all others are closed."""
    truth = completed(simulate(compiled(tmp_path, swaying_text(), "recursive"), integrator="dormand-prince", tolerance=1e-11))
    model = read_model_text(swaying_text(), "swaying.yaml")
    artifact = compile_scene(model, with_closure(find_scene(model, None), closure), CompileOptions(method=method))

    def error(dt: float) -> float:
        run = completed(simulate(artifact, integrator=integrator, events="located", tolerance=1e-9, dt=dt, steps=tmp_path / "steps.csv"))
        assert run.statistics.events == truth.statistics.events >= 2
        if closure == "proximal" or method == "recursive-newton":
            assert run.statistics.residuals.position < 1e-10
        return float(np.abs(run["tip.x"] - truth["tip.x"]).max())

    check_order_2([error(dt) for dt in (2e-3, 1e-3, 5e-4)])


def test_factors_are_kept_where_no_event_is(tmp_path: Path) -> None:
    """The length of a row, a difference of times, has their rounding."""
    text = swaying_text().replace("at: -0.1", "at: -10")
    artifact = compiled(tmp_path, text, "recursive-newton")
    crossed, located = (completed(simulate(artifact, dt=1e-3, events=events)) for events in ("crossed", "located"))
    assert located.statistics.events == 0
    assert located.statistics.factorisations <= crossed.statistics.factorisations + 2


def check_order_2(errors: Sequence[float]) -> None:
    """Check that each halving of the step shows order 2."""
    orders = [float(np.log2(a / b)) for a, b in pairwise(errors)]
    assert all(1.85 < order < 2.25 for order in orders), (orders, errors)


@pytest.mark.parametrize("integrator", [*EQUAL, *ADAPTIVE])
def test_steps_that_go_over_contacts_are_less_accurate(integrator: str, tmp_path: Path) -> None:
    """Steps of equal length have errors of first order there, others what their estimate overlooks."""
    error = bouncing_error(tmp_path, 10.0, {**EQUAL, **ADAPTIVE}[integrator])
    located, crossed = (error(integrator=integrator, events=events, dt=5e-3, tolerance=1e-6) for events in ("located", "crossed"))
    assert located < 1e-4
    assert 20 * located < crossed < 0.2


@pytest.mark.parametrize("integrator", [*EQUAL, *ADAPTIVE])
def test_order_across_the_knots_of_a_table(integrator: str, tmp_path: Path) -> None:
    """The monotone cubic of a table has jumps in its second derivative."""
    artifact = compiled(tmp_path, TABLE, {**EQUAL, **ADAPTIVE}[integrator])
    places = swing_over_knots(np.arange(31) * 0.1)

    def error(**how: Any) -> float:
        return float(np.abs(completed(simulate(artifact, **how))["mass.x"] - places).max())

    if integrator == "rk4":
        check_orders(errors_of(error, integrator, (1e-2, 5e-3, 2.5e-3)), integrator)
    elif integrator == "radau5-fixed":  # where in their steps 25 knots lie, moves the errors by a third: the order over three halvings
        first, last = errors_of(error, integrator, (1e-2, 1.25e-3))
        assert np.log2(first / last) / 3 == pytest.approx(5, abs=0.2)
    else:
        check_proportional(error, integrator, (1e-5, 1e-6, 1e-7, 1e-8) if integrator == "radau5" else (1e-7, 1e-8, 1e-9, 1e-10), 6.0)


@pytest.mark.parametrize("integrator", [*EQUAL, *ADAPTIVE])
def test_order_across_breaks_of_the_road(integrator: str, tmp_path: Path) -> None:
    artifact = compiled(tmp_path, WHEEL, {**EQUAL, **ADAPTIVE}[integrator])
    heights = wheel_heights(np.arange(21) * 0.05)

    def error(**how: Any) -> float:
        run = completed(simulate(artifact, **how))
        assert run.statistics.events_by_element["tyre"] >= 4
        assert run["tyre.Fz"].min() > 0
        return float(np.abs(run["hub.z"] - heights).max())

    if integrator in EQUAL:
        check_orders(errors_of(error, integrator, (1e-2, 5e-3, 2.5e-3)), integrator)
    else:
        check_proportional(error, integrator, (1e-5, 1e-7, 1e-9), 6.0)


@pytest.mark.parametrize(("integrator", "stages", "share"), [("dormand-prince", 6, 0.6), ("dop853", 12, 0.6)])
def test_attempts_end_before_the_first_stage_outside(integrator: str, stages: int, share: float, tmp_path: Path) -> None:
    """An attempt that is taken again costs less than its stages; each event begins with an evaluation, its interpolant may take three."""
    run = completed(simulate(compiled(tmp_path, TABLE, "recursive"), integrator=integrator, tolerance=1e-4))
    assert run.statistics.events == 25
    between = 3 * run.steps if integrator == "dop853" else 0
    again = run.evaluations - stages * run.steps - run.statistics.events - 3
    assert again < share * stages * run.statistics.rejected + between


@pytest.mark.parametrize(
    ("method", "how"),
    [
        ("recursive", {"integrator": "rk4", "dt": 0.1}), ("recursive", {"integrator": "dormand-prince"}),
        ("recursive-newton", {"integrator": "radau5-fixed", "dt": 0.1, "tolerance": 1e-10}), ("recursive-newton", {"integrator": "radau5"}),
        *((method, {"integrator": integrator, "dt": 0.1, "tolerance": 1e-12, "events": "located"}) for integrator, method in RULES),
    ],
    ids=lambda x: x if isinstance(x, str) else x["integrator"],
)  # fmt: skip
def test_steps_end_where_a_function_of_time_jumps(method: str, how: dict[str, Any], tmp_path: Path) -> None:
    """Piecewise parabolas, which the methods have exactly: what is left is where the jumps are."""
    run = completed(simulate(compiled(tmp_path, PULSES, method), **how))
    places, speeds = pulsed(run.t)
    assert run.statistics.events == 2
    assert run["mass.vx"] == pytest.approx(speeds, abs=1e-12)
    assert run["mass.x"] == pytest.approx(places, abs=1e-12)


@pytest.mark.parametrize("integrator", ["radau5-fixed", "radau5"])
def test_a_stiff_contact_within_a_step(integrator: str, tmp_path: Path) -> None:
    """A mass falls on a stop and comes to rest there: the damper takes its speed in a ten-thousandth of 10 ms, the spring takes 10 ms."""
    stiffness, damping = 1e8, 1e6
    text = bouncing_text(damping, 0.5).replace("stiffness: 2000.0", f"stiffness: {stiffness:.1e}")
    run = completed(simulate(compiled(tmp_path, text, "recursive-newton"), integrator=integrator, dt=0.01, tolerance=1e-6))
    falls = np.sqrt(2 * 0.5 / GRAVITY)
    flight = run.t < falls
    assert run["mass.z"][flight] == pytest.approx(0.5 - GRAVITY * run.t[flight] ** 2 / 2, abs=1e-6)
    assert run["mass.z"][-1] == pytest.approx(-MASS * GRAVITY / stiffness, abs=1e-6)
    assert np.abs(run["mass.z"][~flight]).max() < 1e-4


def _slide(law: str, start: str = "") -> str:
    return f"""
cutjoint: 1
name: slide
gravity: [0, 0, 0]
bodies: {{block: {{mass: 1, centre_of_mass: [0, 0, 0]}}}}
joints: {{s: {{kind: prismatic, bodies: [ground, block], at: [0, 0, 0], axis: x}}}}
forces: {{push: {{kind: joint_force, joint: s, law: "{law}"}}}}
outputs: [block.x, block.vx]
scenes: {{run: {{end: 2, output_step: 0.1{start}}}}}
"""


@pytest.mark.parametrize(("integrator", "most"), [("dormand-prince", 3.0), ("dop853", 0.5)])
def test_a_force_that_jumps_at_the_start_is_no_part_of_the_first_step(integrator: str, most: float, tmp_path: Path) -> None:
    """A first stage before the jump adds 10 times the tolerance by dormand-prince, whose estimate sees an eightieth of it."""
    artifact = compiled(tmp_path, _slide("where(t > 0, 10, 0) - 40*position"), "recursive")
    for tolerance in (1e-6, 1e-8):
        run = simulate(artifact, integrator=integrator, tolerance=tolerance, error=False)
        assert np.abs(run["block.x"] - 0.25 * (1 - np.cos(np.sqrt(40) * run.t))).max() < most * tolerance


@pytest.mark.parametrize(("integrator", "method", "how"), [
    ("trapezoidal", "recursive", {"dt": 1e-3, "events": "located"}),
    ("generalised-alpha", "recursive-newton", {"dt": 1e-3, "events": "located"}),
    ("dormand-prince", "recursive", {"tolerance": 1e-6}), ("radau5", "recursive-newton", {"tolerance": 1e-6}),
])  # fmt: skip
def test_a_force_that_fades_out_is_no_event(integrator: str, method: str, how: dict[str, Any], tmp_path: Path) -> None:
    """The argument of `max` approaches zero and stays there but for rounding: steps end nowhere near (868 attempts before)."""
    artifact = compiled(tmp_path, _slide("max(1 - tanh(14*position), 0)", ", rates: {s.displacement_rate: 1}"), method)
    run = simulate(artifact, integrator=integrator, error=False, **how)
    assert run["block.vx"][-1] == pytest.approx(np.sqrt(1 + 2 * np.log(2) / 14), abs=1e-5)  # by the work of the force
    assert run.statistics.rejected < 30
    assert run.statistics.events == 0
