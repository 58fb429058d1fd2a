"""Mass matrix, force and Jacobians of points by independent coordinates: beside sums over bodies, velocities of poses and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import cutjoint
from cutjoint.methods import linearised_methods
from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.read import read_model_text
from cutjoint.run.scenes import find_scene
from cutjoint.stepping.load import load_scene
from tests.conftest import MODELS, ROOT, needs_cpp, with_heavy
from tests.fmu.slaves import text_of

pytestmark = needs_cpp

CART_POLE = ROOT / "examples" / "cart_pole.yaml"


def turn_of(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """The rotation of a unit quaternion w, x, y, z."""
    w, (x, y, z) = quaternion[0], quaternion[1:]
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


@pytest.mark.parametrize("method", linearised_methods())
def test_a_cart_with_a_pole(method: str) -> None:
    sim = cutjoint.load(CART_POLE, method=method, linearise=True, poses=True)
    sim.reset(coordinates={"pin.angle": 0.4}, speeds={"pin.angle_rate": 0.7})
    sim.inputs["push"] = 1.5
    mass, force = sim.equations_of_motion()
    M, m, h, inertia, g = 1.0, 0.2, 0.5, 0.2 * 0.5**2 / 3, 9.81  # the pole is a rod of length 2 h
    c, s = np.cos(0.4), np.sin(0.4)
    assert mass == pytest.approx(np.array([[M + m, m * h * c], [m * h * c, inertia + m * h**2]]), rel=1e-13)
    assert force == pytest.approx([1.5 + m * h * s * 0.7**2, m * g * h * s], rel=1e-12)
    near = sim.linearise()
    assert near.B[2:, 0] == pytest.approx(np.linalg.solve(mass, sim.point_jacobian("cart")[0]), rel=1e-12)


@pytest.mark.parametrize(("name", "steps"), with_heavy([("press", 100), ("flyball", 100), ("spinning", 40)], ("spinning", 40)))
def test_bodies_move_and_weigh_as_their_jacobians_say(name: str, steps: int) -> None:
    model = read_model_text(text_of(name), f"{name}.yaml")
    sim = load_scene(model, find_scene(model, None), linearise=True, poses=True).reset()
    for _ in range(steps):
        sim.step()
    f = sim.equations_of_motion()[0].shape[0]
    rates = sim.states.array[f : 2 * f]
    known = {p.symbol: float(p.value) for p in model.parameters}
    total = np.zeros((f, f))
    for body in model.bodies:
        place = sim.poses.place(body.name)
        J = sim.point_jacobian(body.name)
        moved = np.concatenate([sim.poses.velocity[place], sim.poses.angular_velocity[place]])
        assert J @ rates == pytest.approx(moved, rel=1e-10, abs=1e-10 * np.abs(moved).max())
        R = turn_of(sim.poses.attitude[place])
        arm = R @ np.array([0.1, -0.2, 0.3])
        other = sim.point_jacobian(body.name, sim.poses.point[place] + [0.1, -0.2, 0.3])
        assert other[3:].tolist() == J[3:].tolist()
        assert other[:3] == pytest.approx(J[:3] + np.cross(J[3:].T, arm).T, rel=1e-12, abs=1e-12)
        xx, yy, zz, xy, xz, yz = (evaluate(x, known) for x in body.inertia)
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        total += evaluate(body.mass, known) * J[:3].T @ J[:3] + J[3:].T @ R @ inertia @ R.T @ J[3:]
    mass, force = sim.equations_of_motion()
    assert mass == pytest.approx(total, rel=1e-9, abs=1e-9 * np.abs(total).max())
    assert mass.tolist() == mass.T.tolist()
    assert force.shape == (f,)


def test_who_asks_changes_nothing() -> None:
    sims = [cutjoint.load(MODELS / "press.yaml", linearise=True, poses=True).reset() for _ in range(2)]
    for step in range(20):
        if step % 5 == 0:
            sims[0].equations_of_motion()
            sims[0].point_jacobian("slider")
        for sim in sims:
            sim.step()
    assert sims[0].coordinates.array.tolist() == sims[1].coordinates.array.tolist()
    assert sims[0].speeds.array.tolist() == sims[1].speeds.array.tolist()


def test_what_cannot_be_asked_is_reported() -> None:
    plain = cutjoint.load(CART_POLE).reset()
    with pytest.raises(TypeError, match="linearise=True"):
        plain.equations_of_motion()
    with pytest.raises(TypeError, match="poses=True"):
        cutjoint.load(CART_POLE, linearise=True).reset().point_jacobian("cart")
    both = cutjoint.load(CART_POLE, linearise=True, poses=True)
    with pytest.raises(cutjoint.SimulationError, match="reset"):
        both.equations_of_motion()
    both.reset()
    with pytest.raises(KeyError, match="cart"):
        both.point_jacobian("card")
    room = np.zeros(12)
    for place, point, words in ((-1, room.ctypes.data, "out of range"), (99, room.ctypes.data, "out of range"), (0, None, "array")):
        status = both.library.point_jacobian(both.address, place, point, room.ctypes.data)
        assert words in both.library.status_text(status).decode()
    assert both.library.equations_of_motion(both.address, None, None) == 0
    with pytest.raises(ValueError, match="three"):
        both.point_jacobian("cart", [1.0, 2.0])
