"""Interactions of the tests alone: a file each is all that methods, `explain` and the viewer need.

Motions are those of Lagrange's equations written by hand, with forces from differences of potentials.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.conftest import needs_cpp
from tests.model.test_new_kind import answers

pytestmark = needs_cpp

METHODS = ("recursive", "recursive-newton", "augmented", "classical")

MODEL = """
cutjoint: 1
name: bent
gravity: [0, 0, -9.81]
bodies:
  upper: {mass: 2, centre_of_mass: [0.5, 0, 0], inertia: [0.1, 0.2, 0.3]}
  lower: {mass: 1, centre_of_mass: [1.0, 0.4, 0], inertia: [0.05, 0.03, 0.04]}
joints:
  pin: {kind: revolute, bodies: [ground, upper], at: [0, 0, 0], axis: [0, 1, 0]}
  hinge: {kind: revolute, bodies: [upper, lower], at: [1, 0, 0], axis: [0, 0, 1]}
forces:
  beam:
    kind: beam
    bodies: [ground, lower]
    body: upper
    from: [-0.2, 0.3, 0.1]
    at: [0.6, 0.1, 0.2]
    to: [1.1, 0.7, -0.1]
    law: 30*position + 2*rate
  turn: {kind: pointer, bodies: [upper, lower], axis: [0, 1, 0], towards: [0.6, 0.8, 0], stiffness: 4, damping: 0.3}
scenes:
  fall:
    end: 0.4
    output_step: 0.1
    numerics: {dt: 0.0005}
    outputs: [pin.angle, hinge.angle, beam.Fx, beam.Fy, beam.Fz, turn.Mx, turn.My, turn.Mz]
"""

READ = """
import json
import tests.mechanisms.new_interactions
import numpy as np
from cutjoint.compile.options import CompileOptions
from cutjoint.report.explain.document import explain
from cutjoint.run.simulation import simulate
from cutjoint.topology.reading import read_model_text
from cutjoint.view.drawing import draw
from cutjoint.view.forces import Arrows
from cutjoint.view.views import _placed, show_start
from tests.physics.simulation import compile_scene, completed

model = read_model_text(MODEL, "bent.yaml")
scene = model.scenes["fall"]
runs = {}
for method in METHODS:
    run = completed(simulate(compile_scene(model, scene, CompileOptions(method=method))))
    runs[method] = {o.column: run.columns[o.column].tolist() for o in scene.outputs}
shown = show_start(model, scene, {})
placed = _placed(shown, shown.poses, shown.t)
arrow, = Arrows(
    model=model, scene=placed.scene, numbers=placed.numbers, sizes=placed.sizes, poses=placed.poses, up=np.array([0.0, 0.0, 1.0]),
    columns={("beam", f"F{axis}"): np.array([size]) for axis, size in zip("xyz", (3.0, 4.0, 0.0))},
).all()
print(json.dumps({
    "runs": runs,
    "nodes": {n.name: [n.translation[0].tolist(), n.about["element"]] for n in draw(placed, shown.t).nodes if "beam" in n.name},
    "arrow": [arrow.translation[0].tolist(), arrow.about["newton"]],
    "sliders": [other["name"] for other in shown.sliders.facts["others"]],
    "texts": {method: explain(model, scene, method) for method in ("recursive", "augmented")},
}))
"""


@pytest.fixture(scope="module")
def seen() -> dict[str, Any]:
    """The answers of a process in which the interactions are registered before models are read."""
    return answers(f"METHODS = {METHODS!r}\nMODEL = {MODEL!r}\n{READ}")


# Lagrange's equations by hand

HINGE, X, Y, Z = np.array([1.0, 0, 0]), *np.eye(3)


def turned(axis: np.ndarray, angle: float, v: np.ndarray) -> np.ndarray:
    return v * np.cos(angle) + np.cross(axis, v) * np.sin(angle) + axis * (axis @ v) * (1 - np.cos(angle))


def on_upper(q: np.ndarray, p: np.ndarray) -> np.ndarray:
    return turned(Y, q[0], p)


def on_lower(q: np.ndarray, p: np.ndarray) -> np.ndarray:
    return on_upper(q, HINGE + turned(Z, q[1], p - HINGE))


def bend(q: np.ndarray) -> np.ndarray:
    first, middle, last = np.array([-0.2, 0.3, 0.1]), np.array([0.6, 0.1, 0.2]), np.array([1.1, 0.7, -0.1])
    return first + on_lower(q, last) - 2 * on_upper(q, middle)


def jacobian(f: Any, q: np.ndarray, h: float = 1e-5) -> np.ndarray:
    return np.stack([(f(q + h * e) - f(q - h * e)) / (2 * h) for e in np.eye(2)], axis=-1)


def potential(q: np.ndarray) -> np.ndarray:
    towards, axis = on_upper(q, np.array([0.6, 0.8, 0])), on_upper(q, turned(Z, q[1], Y))
    heights = 2 * on_upper(q, 0.5 * X)[2] + on_lower(q, np.array([1.0, 0.4, 0]))[2]
    return 15 * bend(q) @ bend(q) - 4 * towards @ axis + 9.81 * heights


def mass(q: np.ndarray) -> np.ndarray:
    """The mass matrix: both axes of rotation, and the hinge's lever."""
    axes = np.stack([Y, on_upper(q, Z)], axis=1)
    upper, lower = jacobian(lambda q: on_upper(q, 0.5 * X), q), jacobian(lambda q: on_lower(q, np.array([1.0, 0.4, 0])), q)
    R = np.stack([on_upper(q, turned(Z, q[1], e)) for e in np.eye(3)], axis=1)
    M = 2 * upper.T @ upper + lower.T @ lower + axes.T @ R @ np.diag([0.05, 0.03, 0.04]) @ R.T @ axes
    M[0, 0] += 0.2
    return np.asarray(M)


def accelerations(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    by_q, slope = jacobian(mass, q, 1e-4), jacobian(bend, q)
    coriolis = np.einsum("ijk,j,k->i", by_q, v, v) - np.einsum("jki,j,k->i", by_q, v, v) / 2
    damping = 2 * slope.T @ slope @ v + np.array([0, 0.3 * v[1]])
    return np.asarray(np.linalg.solve(mass(q), -coriolis - damping - jacobian(potential, q)))


@pytest.fixture(scope="module")
def motion() -> np.ndarray:
    """Both angles at each row, (rows, 2)."""
    found = solve_ivp(
        lambda t, y: [*y[2:], *accelerations(y[:2], y[2:])], (0, 0.4), np.zeros(4), rtol=1e-9, atol=1e-11, t_eval=np.linspace(0, 0.4, 5)
    )
    return np.asarray(found.y.T)


@pytest.mark.parametrize("method", METHODS)
def test_motions_are_those_of_lagranges_equations(seen: dict[str, Any], motion: np.ndarray, method: str) -> None:
    """The error of a step of 0.5 ms, second order with a frequency of some 10 rad/s, is below 1e-5."""
    run = seen["runs"][method]
    assert np.abs(motion[-1, :2]).min() > 0.1
    assert np.stack([run["pin.angle"], run["hinge.angle"]], axis=1) == pytest.approx(motion[:, :2], abs=1e-5)


@pytest.mark.parametrize("method", METHODS)
def test_reports_are_forces_and_torques(seen: dict[str, Any], motion: np.ndarray, method: str) -> None:
    run = seen["runs"][method]
    q, v = motion[-1, :2], motion[-1, 2:]
    F = -30 * bend(q) - 2 * jacobian(bend, q) @ v
    towards, axis = on_upper(q, np.array([0.6, 0.8, 0])), on_upper(q, turned(Z, q[1], Y))
    T = 4 * np.cross(axis, towards) - 0.3 * v[1] * on_upper(q, Z)
    assert [run[f"beam.F{axis}"][-1] for axis in "xyz"] == pytest.approx(F, abs=1e-3)
    assert [run[f"turn.M{axis}"][-1] for axis in "xyz"] == pytest.approx(T, abs=1e-4)


def test_each_shape_is_drawn_and_follows_sliders(seen: dict[str, Any]) -> None:
    places = {name: (pytest.approx(place), element) for name, (place, element) in seen["nodes"].items()}
    assert places == {"beam": ([0.6, 0.1, 0.2], "beam"), "beam 2": ([0.6, 0.1, 0.2], "beam")}
    assert seen["sliders"] == ["beam", "beam 2"]


def test_the_arrow_is_on_the_follower(seen: dict[str, Any]) -> None:
    place, newton = seen["arrow"]
    assert place == pytest.approx([1.1, 0.7, -0.1])
    assert newton == pytest.approx(5)


def test_explain_prints_what_it_computes(seen: dict[str, Any]) -> None:
    takes = {"recursive": r"\text{ dQ1 beam upper } &=", "augmented": r"\text{ force beam beam 1 end 1 } &="}
    for method, text in seen["texts"].items():
        force = text.partition("\n### Force\n")[2].partition("\n### ")[0]
        beam, turn = (force.partition(f"#### `{name}`")[2].partition("####")[0] for name in ("beam", "turn"))
        assert "`F = law(p_1 + p_3 - 2 p_2)`" in beam
        assert re.search(r"2 x_\{\d+,3\} \+ 30 x_\{\d+,3\}", beam)
        assert takes[method] in beam
        assert re.search(r"&= 4 \\left\(.* \\times .*\) - 0.3 \\left\(", turn)
