"""Exudyn as a peer: it runs what is exported, and agrees with cutjoint's recursive method.

Joints are algebraic equations in Exudyn.  It finds the terms of their second derivative that depend on speeds by differences, so that
accelerations of moving loops agree to about 1e-7 of the largest.  Both of its integrators are of second order: the difference to a run of
cutjoint with a smaller step falls by four when the step is halved.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import sympy

from cutjoint.export.exudyn import script_name
from cutjoint.export.exudyn_laws import function
from cutjoint.export.peers import PEERS
from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model_text
from cutjoint.model.records import JointKind
from cutjoint.run.scenes import find_scene
from cutjoint_bench.peers.run import run_peer
from tests.export.cases import rotor, turning_loop
from tests.export.own import Case, both_accelerations, case_of, exported, largest_differences, moving, vehicle, wheel
from tests.mechanisms.random_models import random_tree

pytest.importorskip("exudyn")

NAMES = ("pendulum", "four_bar", "andrews", "slider_crank", "flyball")


@pytest.mark.parametrize("name", NAMES)
def test_accelerations_at_the_start(name: str, tmp_path: Path) -> None:
    found, own = both_accelerations("exudyn", case_of(name), tmp_path)
    assert np.abs(found - own).max() < 1e-7 * np.abs(own).max()


#: The larger step of two and that of cutjoint (s), the end (s), and the largest difference of a column with the smaller step (SI units).
RUNS = {
    "pendulum": (2e-3, 1e-4, 1.0, 5e-5),
    "four_bar": (2e-3, 1e-4, 0.5, 1e-5),
    "andrews": (1e-5, 5e-7, 0.01, 2e-8),
    "slider_crank": (2e-3, 1e-4, 1.0, 1e-3),
    "flyball": (1e-3, 5e-5, 0.2, 2e-4),
}


@pytest.mark.parametrize("integrator", PEERS["exudyn"].integrators)
@pytest.mark.parametrize("name", NAMES)
def test_short_trajectories(name: str, integrator: str, tmp_path: Path) -> None:
    dt, own_dt, end, largest = RUNS[name]
    coarse, fine = (
        max(largest_differences("exudyn", case_of(name), tmp_path, dt=step, own_dt=own_dt, end=end, integrator=integrator).values())
        for step in (dt, dt / 2)
    )
    assert fine < largest
    assert 3.5 < coarse / fine < 4.5


#: Trees without screws, forces on coordinates of free joints, and guides that turn; the third one has a guide.
@pytest.mark.parametrize("seed", [5, 8, 3, 14, 17])
def test_random_trees_with_all_forces(seed: int, tmp_path: Path) -> None:
    model = random_tree(seed)
    found, own = both_accelerations("exudyn", Case(model=model, scene=moving(model, seed), parameters={}), tmp_path)
    assert np.abs(found - own).max() < 1e-7 * np.abs(own).max()


#: A random loop closed by each kind of cut joint.
LOOPS = {
    JointKind.FIXED: ("branch", 0), JointKind.REVOLUTE: ("branch", 3), JointKind.PRISMATIC: ("ground", 0),
    JointKind.CYLINDRICAL: ("branch", 0), JointKind.UNIVERSAL: ("ground", 3), JointKind.PLANAR: ("branch", 4),
    JointKind.SPHERICAL: ("ground", 0), JointKind.POINT_ON_LINE: ("ground", 1), JointKind.DISTANCE: ("branch", 2),
}  # fmt: skip


@pytest.mark.parametrize("kind", LOOPS)
def test_random_loops(kind: JointKind, tmp_path: Path) -> None:
    found, own = both_accelerations("exudyn", turning_loop(kind, *LOOPS[kind]), tmp_path)
    assert np.abs(found - own).max() < 1e-7 * np.abs(own).max()


@pytest.mark.parametrize("speed", ["8", "0.05"])
@pytest.mark.parametrize("road", ["point", "disc"])
def test_a_wheel_on_a_road(road: str, speed: str, tmp_path: Path) -> None:
    found, own = both_accelerations("exudyn", wheel(road, speed), tmp_path)
    np.testing.assert_allclose(found, own, rtol=1e-12, atol=1e-10)


def test_an_angle_goes_on_beyond_a_turn(tmp_path: Path) -> None:
    """Two rules of second order at the same step of 0.1 ms, at 30 rad/s."""
    differences = largest_differences("exudyn", rotor(), tmp_path, dt=1e-4, own_dt=1e-4, end=1.0, integrator="generalized_alpha")
    assert all(x < 1e-4 for x in differences.values()), differences


def test_the_vehicle_on_a_bump(tmp_path: Path) -> None:
    """0.6 mm in 0.3 s, to the error of second order at steps of 2 ms."""
    differences = largest_differences(
        "exudyn", vehicle("iavsd_inphase_5"), tmp_path, dt=2e-3, own_dt=5e-4, end=0.3, integrator="generalized_alpha"
    )
    assert differences["chassis.x"] < 2e-6
    assert differences["chassis.z"] < 5e-6


def test_a_guided_rack_steers(tmp_path: Path) -> None:
    differences = largest_differences(
        "exudyn", vehicle("iavsd_sine_2mm", rack=0.5), tmp_path, dt=2e-3, own_dt=5e-4, end=0.3, integrator="generalized_alpha"
    )
    assert differences["chassis.y"] < 1e-6


def test_redundant_equations_are_left_out_and_named() -> None:
    case = case_of("four_bar")
    exported = PEERS["exudyn"].export(case.model, case.scene, {}, case.outputs)
    assert exported.differences == (
        "Equations of cut joints that follow from the others are left out, since Exudyn wants independent ones "
        "(closure_1: along, turn 1, turn 2; closure_2: along, turn 1, turn 2).",
    )


def test_a_run_that_breaks_down_keeps_its_rows(tmp_path: Path) -> None:
    """Equations on velocities alone have no solution in the pose at t = 1.2282 s, in which all bars are in line."""
    folder = exported("exudyn", case_of("four_bar"), tmp_path)
    run = run_peer(PEERS["exudyn"], folder, dt=2e-3, end=2.0, integrator="trapezoidal_index2", output_step=2e-3)
    assert run.failure is not None
    assert run.failure.message == "a step did not converge at t = 1.228 s"
    assert run.t.size == run.steps + 1 == 614


ODD = """
cutjoint: 1
name: odd
gravity: [0, 0, -9.81]
bodies:
  nut: {mass: 1, centre_of_mass: [0, 0, 0.1], inertia: [1, 1, 1]}
  arm: {mass: 1, centre_of_mass: [0, 0, 0.2], inertia: [1, 1, 1]}
  kite: {mass: 1, centre_of_mass: [0, 0, 0.3], inertia: [1, 1, 1]}
joints:
  thread: {kind: screw, bodies: [ground, nut], at: [0, 0, 0], axis: [0, 0, 1], pitch: 0.01}
  motor: {kind: revolute, bodies: [nut, arm], at: [0, 0, 0.2], axis: [0, 1, 0], guide: "sin(t)"}
  sky: {kind: free, bodies: [ground, kite], at: [0, 0, 0.3]}
forces: {lift: {kind: joint_force, joint: sky, coordinate: z, law: 9.81}}
"""


def test_what_exudyn_does_not_have() -> None:
    model = read_model_text(ODD, "odd.yaml")
    with pytest.raises(ModelError) as refused:
        PEERS["exudyn"].export(model, find_scene(model, None), {}, ())
    assert str(refused.value).splitlines() == [
        "odd.yaml:10:3: joint 'thread': Exudyn has no joint of kind screw; write a revolute or a cylindrical joint",
        "odd.yaml:11:3: joint 'motor': a joint of kind revolute that time moves is not exported to Exudyn; guide a prismatic joint, or "
        "give its input a constant value",
        "odd.yaml:13:10: force 'lift': a force on a coordinate of a joint of kind free is not exported; write a load or a point_spring "
        "instead",
    ]


def test_a_script_hides_no_module() -> None:
    assert [script_name(name) for name in ("press", "random", "exudyn")] == ["press.py", "random_model.py", "exudyn_model.py"]


def test_laws_in_python() -> None:
    x = sympy.Symbol("x", real=True)
    choice = sympy.Piecewise((x, x < -0.1), (2 * x, True))
    texts = {
        0.1 + sympy.Float(0.2): "lambda x, t: 0.30000000000000004",
        x**3 / 3: "lambda x, t: (1.0/3.0)*x**3.0",
        sympy.pi * sympy.sqrt(x): "lambda x, t: 3.141592653589793*math.sqrt(x)",
        sympy.Abs(x) ** sympy.Float(1.5): "lambda x, t: abs(x)**1.5",
        choice: "lambda x, t: ((x) if (x < (-0.1)) else (2.0*x))",
    }
    assert {law: function(["x"], law) for law in texts} == texts
    assert function((), x, 2 * x) == "lambda t: (x, 2.0*x)"
