"""The programs of examples/ run, and do what they say."""

from __future__ import annotations

import json
import re
import runpy
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cutjoint
from cutjoint.compile.c_export import make_standalone
from cutjoint.compile.pipeline import generate
from cutjoint.methods import DEFAULT_METHOD
from cutjoint.model.expressions.tunable import with_inputs
from cutjoint.topology.reading import read_model
from cutjoint.view.live import Poses
from tests.conftest import MODELS, ROOT, needs_cpp
from tests.standalone.c_exports import compile_object, link, run, write

pytestmark = needs_cpp

EXAMPLES = ROOT / "examples"


@pytest.fixture(scope="module")
def iltis(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the Iltis, on a flat road unless its host gives another, with its object file."""
    model = with_inputs(read_model(MODELS / "iltis.yaml"), terrain=["*"])
    scene = model.scenes["simul3"]
    generated = generate(model, scene, scene.outputs, method=DEFAULT_METHOD, poses=True)
    place = write(make_standalone(generated, equal_steps=True), tmp_path_factory.mktemp("iltis"))
    compile_object(place, "iltis")
    return place


def program(iltis: Path, name: str) -> Path:
    return link(iltis, name, ["-I.", EXAMPLES / f"{name}.c", "iltis.o"])


def python(*words: object) -> str:
    return subprocess.run([sys.executable, *map(str, words)], check=True, capture_output=True, text=True, cwd=ROOT).stdout


def test_the_vehicle_follows_its_driver_also_from_another_process(iltis: Path) -> None:
    lines = run(program(iltis, "steer")).splitlines()
    left, yaw, speed = (float(x) for x in re.findall(r"-?\d+\.\d+", lines[-1]))
    assert left == pytest.approx(2.0, abs=0.1)
    assert yaw == pytest.approx(0.0, abs=0.01)
    assert speed == pytest.approx(7.0, abs=0.2)
    apart = python(EXAMPLES / "udp_driver.py", program(iltis, "udp_vehicle"))
    assert float(re.findall(r": (-?[\d.e-]+) m", apart)[0]) == pytest.approx(left, abs=5e-4)


def test_a_vehicle_against_the_clock_catches_up_and_drops_what_is_too_much(iltis: Path) -> None:
    paced = program(iltis, "paced_vehicle")
    begun = time.perf_counter()
    view = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    view.bind(("127.0.0.1", 0))
    driven = python(EXAMPLES / "udp_driver.py", paced, "2.5", view.getsockname()[1])
    assert time.perf_counter() - begun > 2.4
    left = float(re.findall(r": (-?[\d.e-]+) m", driven)[0])
    assert left == pytest.approx(0.0195, abs=0.002)  # the driver leaves the lane after two seconds
    wheels = []
    poses, seen = Poses(read_model(MODELS / "iltis.yaml"), pytest.fail), []
    with view:
        view.setblocking(False)
        with suppress(BlockingIOError):  # there are as many as the system keeps
            while True:
                datagram = view.recv(65536)
                assert poses.receive(datagram)
                seen.append(json.loads(poses.wait(len(seen))[1]))
                wheels.append(np.frombuffer(datagram[16:]).reshape(-1, 16)[3, :3])  # front left
    (x, y, z), loaded = np.transpose(wheels), 0.364325 - (1260 + 4 * 63.35) * 9.81 / 4 / 460000
    height = np.where(x > 2, 0.02 * (1 - np.cos(0.8 * (x - 2))), 0) * np.cos(0.3 * y)
    assert height.max() > 0.03
    assert np.abs(z - loaded - height).max() < 0.003  # by what the load changes: a tyre gives way by 8 mm at rest
    assert len(seen) > 20
    assert [round(1e3 * each[0]) for each in seen] == sorted({round(1e3 * each[0]) for each in seen})
    assert seen[-1][1][0] > seen[0][1][0] + 1.0  # the chassis drives on
    with subprocess.Popen([paced, "9", "1.0"], stdout=subprocess.PIPE, text=True) as alone:  # nobody listens there
        time.sleep(0.5)
        alone.send_signal(signal.SIGSTOP)
        time.sleep(0.2)
        alone.send_signal(signal.SIGCONT)
        said = alone.communicate(timeout=60)[0]
    assert alone.returncode == 0
    caught_up, dropped = (int(x) for x in re.findall(r"(\d+) (?:steps|dropped)", said))
    assert caught_up >= 9
    assert dropped >= 28  # steps of 5 ms
    silent = subprocess.run([paced], capture_output=True, text=True, check=False)
    assert silent.returncode == 2
    assert silent.stderr.startswith("usage: ")


def test_computed_torque_moves_a_closed_loop_as_wanted() -> None:
    missed, gap = (float(x) for x in re.findall(r"within ([\d.e-]+) ", python(EXAMPLES / "computed_torque.py")))
    assert missed < 2e-4  # rad; torques are held for 1 ms, while accelerations change by 64 * 0.3 rad/s3
    assert gap < 1e-12


def test_the_pole_stands() -> None:
    cart, pole = (float(x) for x in re.findall(r"at (-?[\d.e-]+) ", python(EXAMPLES / "balance.py")))
    assert abs(cart) < 0.02
    assert abs(pole) < 1e-3


def test_the_pole_swings_up() -> None:
    missed, most = (float(x) for x in re.findall(r"-?\d[\d.]*(?:e[-+]\d+)?", python(EXAMPLES / "swing_up.py")))
    assert missed < 1e-3  # of half a turn: without exact derivatives Gauss-Newton steps do not get there
    assert 5 < most < 30  # N


def test_an_environment_of_gymnasium_balances_poles_and_starts_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "16 of 16 poles stand" in python(EXAMPLES / "cart_pole_env.py")
    monkeypatch.syspath_prepend(str(EXAMPLES))
    from cart_pole_env import CartPoles

    envs, other = CartPoles(3, most=40), CartPoles(3, most=40)
    first, _ = envs.reset(seed=5)
    assert np.array_equal(first, other.reset(seed=5)[0])
    assert first in envs.observation_space
    push = np.array([[10.0], [0.0], [-1.0]])
    ends = np.zeros((60, 3), int)
    for k in range(60):
        seen, rewards, fallen, cut, _ = envs.step(push)
        assert np.array_equal(seen, other.step(push)[0])
        ends[k] = fallen + 2 * cut
        if k and ends[k - 1].any():
            new = ends[k - 1] > 0
            assert (rewards[new] == 0).all()
            assert (abs(seen[new]) <= 0.1).all()
    assert ends[:, 0].max() == 1  # pushed over
    assert (envs.steps < 40).all()


def test_stiffer_springs_move_the_slider_less() -> None:
    travel = [float(x) for x in re.findall(r": ([\d.]+) m", python(EXAMPLES / "study.py"))]
    assert len(travel) == 5
    assert travel == sorted(travel, reverse=True)


def test_the_axles_of_the_study(tmp_path: Path) -> None:
    """A few of them: in equilibrium the tyres carry the weight, and toe follows from the heights of the tie rods."""
    text = (EXAMPLES / "axle" / "study.yaml").read_text(encoding="utf-8").replace("sobol: 100000", "sobol: 16")
    text = text.replace("model: axle.yaml", f"model: {EXAMPLES / 'axle' / 'axle.yaml'}")
    text += "trajectories: {outputs: [left.tyre.force + right.tyre.force, left.upright.yaw]}\n"
    (tmp_path / "study.yaml").write_text(text, encoding="utf-8")
    done = cutjoint.sweep(tmp_path / "study.yaml", tmp_path / "out.parquet")
    assert done.failures == [None] * 16
    weight = (120 + 1 + 2 * (0.8 + 0.6 + 9 + 0.3)) * 9.81
    loads, yaws = (done[f"{name}(t)"] for name in ("left.tyre.force + right.tyre.force", "left.upright.yaw"))
    for forces, yaw, steer in zip(loads, yaws, done["bump_steer"], strict=True):
        assert forces[0] == pytest.approx(weight, rel=1e-6)
        assert steer == pytest.approx(np.degrees(yaw.max() - yaw.min()), rel=1e-12)


def test_the_page_of_the_axles_is_small() -> None:
    page = ROOT / "docs" / "sweep" / "axle.html"
    assert page.stat().st_size <= 500_000
    assert "100000 runs" in page.read_text(encoding="utf-8")


def test_a_spring_and_a_point_are_found_from_a_motion() -> None:
    """Noise of 0.1 mm in 101 samples leaves 0.1 % of each."""
    stiffness, place, runs = (float(x) for x in re.findall(r"\d+\.?\d*", python(EXAMPLES / "identify.py")))
    assert (stiffness, place) == (pytest.approx(1600, rel=5e-3), pytest.approx(0.11, rel=1e-3))
    assert runs < 30


def test_a_crane_stops_without_a_swing() -> None:
    """Forces at 120 knots, of which some are at their bound."""
    missed, most, runs = (float(x) for x in re.findall(r"\d[\d.]*(?:e[-+]\d+)?", python(EXAMPLES / "crane.py")))
    assert missed < 1e-8
    assert most == 12.0
    assert runs < 30


@pytest.mark.heavy
def test_hardpoints_take_bump_steer_out_of_an_axle() -> None:
    """The mean of squares of a thousandfold steer (rad) and of the chassis' acceleration (m/s2)."""
    before, after, runs = (float(x) for x in re.findall(r"\d+\.?\d*", python(EXAMPLES / "hardpoints.py")))
    assert before == pytest.approx(5.89, rel=1e-3)
    assert after < 2.9
    assert runs < 100


@pytest.mark.heavy
@pytest.mark.parametrize("package", ["jax", "casadi", "torch"])
def test_gradients_in_other_packages(package: str) -> None:
    """The derivatives of a mean square, beside differences of runs."""
    pytest.importorskip(package)
    found = [float(x) for x in re.findall(r"(-?[\d.e-]+) m(?:\^2)? per", python(EXAMPLES / f"gradient_{package}.py"))]
    sim = cutjoint.load(ROOT / "models" / "press.yaml", integrator="rk4", linearise=True, tunable=["A.z"])

    def mean_square(stiffness: float, height: float) -> float:
        sim.parameters.update({"stiffness": stiffness, "A.z": height})
        start = sim.reset(dt=1e-3).outputs["slider.x"]
        return float(np.mean(np.append(start, sim.run(400)[9::10, sim.outputs.place("slider.x")]) ** 2))

    differences = [
        (mean_square(2002.0, 0.1) - mean_square(1998.0, 0.1)) / 4.0,
        (mean_square(2000.0, 0.1001) - mean_square(2000.0, 0.0999)) / 2e-4,
    ]
    assert found == pytest.approx(differences, rel=1e-3)  # four printed digits


@pytest.mark.heavy
def test_jax_maps_over_runs() -> None:
    """`vmap` of a gradient under `jit` has the rows of single calls."""
    jax = pytest.importorskip("jax")
    known = runpy.run_path(str(EXAMPLES / "gradient_jax.py"))
    slope = jax.jit(jax.grad(lambda x: (known["course"](x) ** 2).mean()))
    x = np.array([[2000.0, 0.1], [2500.0, 0.1], [2000.0, 0.11]])
    assert np.asarray(jax.jit(jax.vmap(slope))(x)) == pytest.approx(np.array([slope(row) for row in x]), rel=1e-12)


@pytest.mark.heavy
def test_pytorch_checks_the_trajectory_of_the_press() -> None:
    torch = pytest.importorskip("torch")
    known = runpy.run_path(str(EXAMPLES / "gradient_torch.py"))
    ones = torch.ones(2, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda x: known["Course"].apply(x * known["SCALES"]), ones)

    def loss(x: Any) -> Any:
        return known["Course"].apply(x * known["SCALES"]).sum() + (x**2).sum()

    with pytest.raises(RuntimeError, match="once_differentiable"):  # where it took the slopes for constants: 2 on the diagonal alone
        torch.autograd.functional.hessian(loss, ones.detach())


@pytest.mark.heavy
def test_other_packages_refuse_second_derivatives() -> None:
    jax = pytest.importorskip("jax")
    known = runpy.run_path(str(EXAMPLES / "gradient_jax.py"))
    with pytest.raises((TypeError, ValueError)):
        jax.hessian(lambda x: known["course"](x).sum())(np.array([2000.0, 0.1]))
    with pytest.raises((TypeError, ValueError)):
        jax.jacrev(jax.grad(lambda x: known["course"](x).sum()))(np.array([2000.0, 0.1]))


@pytest.mark.heavy
def test_casadi_refuses_second_derivatives() -> None:
    casadi = pytest.importorskip("casadi")
    known = runpy.run_path(str(EXAMPLES / "gradient_casadi.py"))
    with pytest.raises(RuntimeError):
        casadi.Function("h", [known["x"]], [casadi.hessian(casadi.sum1(known["course"](known["x"])), known["x"])[0]])
