"""Machines at their smallest: nothing moves freely, nothing is jointed, one body; motions are closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import cutjoint
from cutjoint.compile.options import CompileOptions
from cutjoint.run.results import Trajectory
from cutjoint.run.scenes import find_scene
from cutjoint.topology.reading import read_model_text
from tests.physics.simulation import compile_scene, completed, simulate, with_numerics

_EVERY = [
    ("recursive", "trapezoidal"), ("recursive", "rk4"), ("recursive", "dormand-prince"), ("recursive", "dop853"),
    ("recursive-newton", "trapezoidal"), ("recursive-newton", "radau5"), ("recursive-newton", "radau5-fixed"),
    ("recursive-newton", "generalised-alpha"), ("augmented", "trapezoidal"), ("classical", "trapezoidal"),
]  # fmt: skip
_SLIDE = "s: {kind: prismatic, bodies: [ground, a], at: [0, 0, 0], axis: x, guide: 0.1*sin(10*t)}"
_STATE = "{start: 0 m, rate: a.vx - w/0.1}"


def _text(joint: str = _SLIDE, state: str = "", mass: str = "mass: 1") -> str:
    states, read = (f"states: {{w: {state}}}\n", ", w.value") if state else ("", "")
    return (
        "cutjoint: 1\nname: g\ngravity: [0, 0, 0]\nbodies:\n"
        f"  a: {{{mass}, centre_of_mass: [0, 0, 0]}}\njoints:\n  {joint}\n{states}outputs: [a.x{read}]\n"
        f"scenes:\n  m: {{end: 0.1, output_step: 0.1}}\n"
    )


def _run(text: str, method: str, integrator: str = "trapezoidal") -> Trajectory:
    model = read_model_text(text, "g.yaml")
    artifact = compile_scene(model, find_scene(model, None), CompileOptions(method=method))
    step = None if integrator in ("dormand-prince", "dop853", "radau5") else 1e-3
    return completed(simulate(with_numerics(artifact, integrator=integrator, dt=step)))


def _filtered(t: float) -> float:
    """w' = cos(10 t) - 10 w from w(0) = 0."""
    return float((np.cos(10 * t) + np.sin(10 * t) - np.exp(-10 * t)) / 20)


@pytest.mark.parametrize(("method", "integrator"), _EVERY)
def test_states_run_beside_a_motion_that_is_wholly_prescribed(method: str, integrator: str) -> None:
    text = _text(state=_STATE)
    run = _run(text, method, integrator)
    assert run["a.x"][-1] == pytest.approx(0.1 * np.sin(1.0), abs=1e-14)
    assert run["w.value"][-1] == pytest.approx(_filtered(0.1), abs=2e-5)  # the trapezoidal rule by 1 ms
    drives = cutjoint.inverse_dynamics(read_model_text(text, "g.yaml"))
    assert drives["s"] == pytest.approx(-10 * np.sin(10 * drives.t), abs=1e-9)


@pytest.mark.parametrize(("method", "integrator"), _EVERY)
def test_a_prescribed_motion_alone_runs(method: str, integrator: str) -> None:
    run = _run(_text(), method, integrator)
    assert run["a.x"][-1] == pytest.approx(0.1 * np.sin(1.0), abs=1e-14)


def test_nothing_that_moves_has_no_modes() -> None:
    modes = cutjoint.find_modes(read_model_text(_text(), "g.yaml"))
    assert (modes.degrees_of_freedom, len(modes.modes)) == (0, 0)


@pytest.mark.parametrize("method", ["augmented", "classical"])
def test_a_plate_flies_alone(method: str) -> None:
    """A body whose mass lies in a plane, and that nothing holds: it spans three places of the four."""
    text = _text("s: {kind: free, bodies: [ground, a], at: [0, 0, 0]}", mass="mass: 1, inertia: [1, 2, 3]")
    run = _run(text.replace("end: 0.1", "end: 0.1, rates: {s.vx: 2}"), method)
    assert run["a.x"][-1] == pytest.approx(0.2, abs=1e-12)
