"""Explicit integrators as programs: what they refuse, how they fail, that they repeat themselves to the bit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from cutjoint.methods import INTEGRATORS
from cutjoint.package.errors import RunError
from cutjoint.report.tables import run_facts
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint.run.run_file import make_run_file
from cutjoint.run.simulation import simulate
from cutjoint_bench.generic.artifact import compile_generic_model
from tests.conftest import MODELS, with_heavy
from tests.mechanisms.bouncing import bouncing_text
from tests.physics.simulation import compile_model, compile_text, completed

SLIDE = """
cutjoint: 1
name: slide
gravity: [0, 0, 0]
bodies:
  block: {mass: 1, centre_of_mass: [0, 0, 0]}
joints:
  slide: {kind: prismatic, bodies: [ground, block], at: [0, 0, 0], axis: [1, 0, 0]}
forces:
  friction: {kind: joint_force, joint: slide, law: "LAW"}
outputs: [block.x, block.vx]
scenes:
  stop: {end: 1, output_step: 0.1, rates: {slide.displacement_rate: 1}}
"""


#: The explicit Runge-Kutta methods.
EXPLICIT = [i.name for i in INTEGRATORS.values() if i.methods == ("recursive",)]


def cells(run: Trajectory) -> bytes:
    return b"".join(column.tobytes() for column in (run.t, *run.columns.values()))


@pytest.mark.parametrize("integrator", EXPLICIT)
@pytest.mark.parametrize(("model", "scene", "end"), [("slider_crank", None, 1.0), ("iltis", "iavsd_inphase_5", 0.4)])
def test_runs_repeat_themselves_to_the_bit(integrator: str, model: str, scene: str | None, end: float) -> None:
    artifact = compile_model(MODELS / f"{model}.yaml", scene=scene)
    one, other = (completed(simulate(artifact, integrator=integrator, end=end)) for _ in range(2))
    assert cells(one) == cells(other)
    assert (one.steps, one.evaluations, one.statistics) == (other.steps, other.evaluations, other.statistics)


@pytest.mark.parametrize("compiled", with_heavy([partial(compile_model, method="augmented"), compile_generic_model], compile_generic_model))
def test_what_explicit_integrators_take(compiled: Callable[[Path], Artifact]) -> None:
    artifact = compiled(MODELS / "pendulum.yaml")
    with pytest.raises(RunError, match=r"the integrator rk4 (is for|needs generated code of) the method recursive"):
        simulate(artifact, integrator="rk4")


def test_an_unknown_integrator() -> None:
    with pytest.raises(RunError, match=r"no integrator 'euler'; there is trapezoidal, rk4, dormand-prince, dop853, radau5, radau5-fixed"):
        simulate(compile_model(MODELS / "pendulum.yaml"), integrator="euler")


def test_the_scene_may_name_the_integrator(tmp_path: Path) -> None:
    """With its tolerances."""
    numerics = "numerics: {dt: 0.01, integrator: dormand-prince, solver_tolerance: 1e-7, absolute_tolerance: 1e-9}"
    path = tmp_path / "bounce.yaml"
    path.write_text(bouncing_text(0, 0.5).replace("numerics: {dt: 0.01}", numerics), encoding="utf-8")
    artifact = compile_model(path)
    asked = simulate(replace(artifact, scene=replace(artifact.scene, numerics=replace(artifact.scene.numerics, integrator="trapezoidal"))),
                     integrator="dormand-prince")  # fmt: skip
    assert cells(completed(simulate(artifact))) == cells(completed(asked))
    file = make_run_file(artifact.topology.model, artifact.scene, {}, task="simulate")
    assert (file.settings.tolerance, file.settings.absolute_tolerance, file.settings.dt) == (1e-7, 1e-9, 0.05)


@pytest.mark.heavy
def test_the_generic_solver_keeps_the_trapezoidal_rule(tmp_path: Path) -> None:
    path = tmp_path / "bounce.yaml"
    numerics = "numerics: {dt: 0.01, integrator: dormand-prince, solver_tolerance: 1e-7, absolute_tolerance: 1e-9}"
    path.write_text(bouncing_text(0, 0.5).replace("numerics: {dt: 0.01}", numerics), encoding="utf-8")
    assert completed(simulate(compile_generic_model(path))).statistics.events == 0


def test_a_tighter_absolute_tolerance_takes_more_steps(tmp_path: Path) -> None:
    artifact = compile_text(tmp_path, bouncing_text(0, 0.5))
    steps = []
    for absolute in (1e-4, 1e-6, 1e-8):
        numerics = replace(artifact.scene.numerics, tolerance=1e-4, absolute_tolerance=absolute)
        own = replace(artifact, scene=replace(artifact.scene, numerics=numerics))
        steps.append(completed(simulate(own, integrator="dormand-prince")).steps)
    assert steps[0] < steps[1] < steps[2]


@pytest.mark.parametrize("integrator", EXPLICIT)
@pytest.mark.parametrize("speed", [1, 0.77, -0.3])
def test_dry_friction_that_sticks_is_reported_by_name(speed: float, integrator: str, tmp_path: Path) -> None:
    """Both sides of rest push back to it: the law has no value that keeps it there.  2 N stop 1 kg at 1 m/s after 0.5 s."""
    text = SLIDE.replace("LAW", "where(rate > 0, -2, 2)").replace("displacement_rate: 1}", f"displacement_rate: {speed}}}")
    failure = simulate(compile_text(tmp_path, text), integrator=integrator, dt=0.01, check=False).failure
    assert failure is not None
    assert failure.message.startswith("'friction' (")
    assert "model.yaml:10" in failure.message
    assert failure.message.endswith("switches to and fro without end")
    assert failure.advice == "make its law continuous there, or let steps go over it with events: crossed"
    assert failure.element == "friction"
    assert failure.time == pytest.approx(abs(speed) / 2, abs=50 * 1e-3 * 0.01)  # 50 times within a thousandth of a step


def test_what_fails_within_a_step_is_reported_with_its_number(tmp_path: Path) -> None:
    """The accelerations are found anew at an event, where nothing knows how many steps there were."""
    artifact = compile_text(tmp_path, SLIDE.replace("LAW", "where(position > 0.255, sqrt(0.2 - position), 0)"))
    failure = simulate(artifact, events="located", dt=0.01, check=False).failure
    assert failure is not None
    assert "no finite value" in failure.message
    assert (failure.step, failure.time) == (26, pytest.approx(0.255))


def test_a_force_without_bound_leaves_no_step_small_enough(tmp_path: Path) -> None:
    """x = 1 - t pulls itself to the origin by -1/x: the speed grows without bound before t = 1."""
    law = "-1/(position + 1 - 1)".replace("position + 1 - 1", "position")
    text = SLIDE.replace("LAW", law).replace("rates: {slide.displacement_rate: 1}", "positions: {slide.displacement: 0.5}")
    run = simulate(compile_text(tmp_path, text), integrator="dormand-prince", check=False)
    assert run.failure is not None
    assert run.failure.message == "no step is small enough for the tolerance"
    # 0.5 sqrt(pi/2): a mass falls to a pull of 1/x
    assert run.failure.time == pytest.approx(0.5 * np.sqrt(np.pi / 2), abs=1e-3)
    assert run.t[-1] == pytest.approx(0.6)
    assert np.isfinite(run["block.x"]).all()


def test_a_stiff_model_is_reported() -> None:
    """The governor's fastest eigenvalue is -8075 1/s: steps of 3.3/8075 s, whatever the tolerance asks."""
    artifact = compile_model(MODELS / "flyball.yaml")
    run = completed(simulate(artifact, integrator="dormand-prince", tolerance=1e-5, end=0.5))
    assert run.statistics.stiff_steps > 0.9 * run.steps
    assert run.steps == pytest.approx(0.5 * 8075 / 3.3, rel=0.5)
    facts = run_facts(artifact.compilation, run)
    assert any("limited by stability, not accuracy" in str(cell) for cell in facts.columns[1].cells)
    failure = simulate(artifact, integrator="rk4", dt=1e-3, end=0.5, check=False, error=False).failure
    assert failure is not None
    assert failure.message == "the accelerations have no finite value"
    assert failure.advice == "try: a smaller dt, or compiling with the method recursive-newton, as for stiff models"
    failure = simulate(artifact, integrator="rk4", dt=1e-3, end=0.5, check=False).failure
    assert failure is not None
    assert failure.message.startswith("the motion runs away: since t = 0.001 s its energy comes from no force")


def test_events_are_reported(tmp_path: Path) -> None:
    artifact = compile_text(tmp_path, bouncing_text(0, 0.5))
    facts = run_facts(artifact.compilation, completed(simulate(artifact, integrator="dormand-prince")))
    assert "4: floor 4" in list(facts.columns[1].cells)
