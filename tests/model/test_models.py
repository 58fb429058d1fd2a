"""The example models load, with everything in them."""

from __future__ import annotations

from pathlib import Path

import pytest
import sympy

from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.expressions.parse import variable
from cutjoint.model.read import read_model
from cutjoint.model.records import AxialForce, Binding, BodyLoad, JointKind, Model, PointSpring, SegmentKind, Span, Tyre

MODELS = Path(__file__).parents[2] / "models"


@pytest.fixture(scope="module")
def iltis() -> Model:
    return read_model(MODELS / "iltis.yaml")


@pytest.fixture(scope="module")
def four_bar() -> Model:
    return read_model(MODELS / "four_bar.yaml")


def named(items: tuple, name: str):
    return next(item for item in items if item.name == name)


def floats(vector: tuple) -> list[float]:
    return [float(component) for component in vector]


def test_iltis_has_all_elements(iltis: Model) -> None:
    assert len(iltis.bodies) == 2 + 4 * 4
    assert len(iltis.joints) == 2 + 4 * 6
    assert sum(joint.cut is True for joint in iltis.joints) == 8
    assert len(iltis.forces) == 1 + 4 * 4
    assert len(iltis.reactions) == 4
    assert iltis.markers == ()


def test_elements_come_in_the_files_order(iltis: Model) -> None:
    assert [body.name for body in iltis.bodies[:7]] == [
        "chassis", "rack", "front_left.arm", "front_left.carrier", "front_left.leaf_link",
        "front_left.tie_rod", "front_right.arm",
    ]  # fmt: skip


def test_parameters_are_si_with_their_binding(iltis: Model) -> None:
    gain = named(iltis.parameters, "speed_gain")
    assert (gain.value, gain.unit, gain.binding) == (2e4, "N*s/m", Binding.PARAM)
    assert named(iltis.parameters, "rack_displacement").binding is Binding.INPUT
    assert gain.symbol == sympy.Symbol("p_speed_gain", real=True)


def test_instances_connect_their_bodies(iltis: Model) -> None:
    ball = named(iltis.joints, "front_right.tie_rod_ball")
    assert (ball.base, ball.follower) == ("rack", "front_right.tie_rod")
    assert named(iltis.joints, "rear_right.tie_rod_ball").base == "chassis"
    assert named(iltis.reactions, "rear_left.leaf_axial").joint == "rear_left.leaf_hinge"


def test_instance_arguments_reach_points_and_constants(iltis: Model) -> None:
    assert floats(named(iltis.joints, "rear_left.arm_hinge").at) == [-1.047, 0.259, 0.302]
    assert float(named(iltis.forces, "rear_left.tyre").constants["radius"]) == 0.363812
    assert floats(named(iltis.bodies, "front_left.arm").centre_of_mass) == pytest.approx([0.970, 0.4155, 0.2655], abs=1e-15)


def test_principal_inertia_is_rotated(iltis: Model) -> None:
    arm = named(iltis.bodies, "front_left.arm")
    y, z = 0.313, -0.073
    h = y * y + z * z
    expected = [
        0.052099,
        (0.023235 * y * y + 0.068864 * z * z) / h,
        (0.023235 * z * z + 0.068864 * y * y) / h,
        0,
        0,
        (0.023235 - 0.068864) * y * z / h,
    ]
    assert floats(arm.inertia) == pytest.approx(expected, abs=1e-15)


def test_the_mirrored_side_mirrors(iltis: Model) -> None:
    left, right = named(iltis.bodies, "front_left.arm"), named(iltis.bodies, "front_right.arm")
    signs = [1, 1, 1, -1, 1, -1]
    assert floats(right.inertia) == [s * i for s, i in zip(signs, floats(left.inertia), strict=True)]
    assert floats(named(iltis.joints, "front_right.arm_hinge").axes[0]) == [-1, 0, 0]
    assert [floats(axis) for axis in named(iltis.joints, "front_right.tie_rod_joint").axes] == [
        [-1, 0, 0],
        [0, 0, -1],
    ]
    assert floats(named(iltis.forces, "front_right.tyre").axis) == [0, 1, 0]
    assert floats(named(iltis.forces, "front_right.leaf").axis) == [0, 0, -1]
    left_way, right_way = (floats(named(iltis.reactions, f"front_{side}.leaf_axial").direction) for side in ("left", "right"))
    assert right_way == [left_way[0], -left_way[1], left_way[2]]


def test_laws_have_the_values_of_the_file(iltis: Model) -> None:
    shock, leaf = named(iltis.forces, "rear_left.shock"), named(iltis.forces, "rear_left.leaf")
    assert isinstance(shock, PointSpring)
    assert isinstance(leaf, AxialForce)
    length, rate = variable("length"), variable("rate")
    spring = -4.0092e6 + 2.8397e7 * 0.42 - 6.7061e7 * 0.42**2 + 5.2796e7 * 0.42**3
    damper_at_a_tenth = 994.5627 + 339.5572 - 59.83225 - 39.5651
    for speed, damper in (
        (-1.0, -416.42 - 1844.3),
        (0.1, damper_at_a_tenth),
        (0.5, 1919.1638 + 0.5 * 1634.727),
    ):
        value = evaluate(shock.law, {length: 0.42, rate: speed})
        assert value == pytest.approx(spring + damper, abs=1e-6)
    assert evaluate(leaf.law, {variable("travel"): 0.1}) == pytest.approx(35906 * 0.045)


def test_forces_keep_their_switches(iltis: Model) -> None:
    load = named(iltis.forces, "speed_controller")
    assert isinstance(load, BodyLoad)
    assert (load.axes, load.active) == ("global", False)
    assert not named(iltis.forces, "rear_right.bumper").active
    tyre = named(iltis.forces, "rear_right.tyre")
    assert isinstance(tyre, Tyre)
    assert set(tyre.constants) == {
        "stiffness", "radius", "spin_inertia", "A0", "A1", "A2", "A3", "A4", "B1", "B3", "B4", "SN", "AF1", "AF2",
    }  # fmt: skip


def test_scenes_of_the_iltis(iltis: Model) -> None:
    assert list(iltis.scenes) == [
        "iavsd_equilibrium", "iavsd_inphase_5", "iavsd_sine_2mm", "simul1", "simul1s", "simul2", "simul3",
    ]  # fmt: skip
    bumpers = {f"{corner}_{side}.bumper" for corner in ("front", "rear") for side in ("left", "right")}
    assert iltis.scenes["simul1s"].switches == dict.fromkeys({"speed_controller", *bumpers}, True)
    wave = iltis.scenes["iavsd_inphase_5"].road
    assert wave.left == wave.right
    assert (wave.left[0].kind, wave.left[0].length, wave.left[0].rise) == (SegmentKind.COSINE, 5.0, 0.1)
    assert (wave.start, wave.contact) == (0.97, "point")
    ramp = iltis.scenes["simul1"]
    assert sum(segment.length for segment in ramp.road.left) == 10 + 2 + 4 * 1.5
    assert sum(segment.rise for segment in ramp.road.left) == 0
    assert (ramp.numerics.dt, ramp.output_step, ramp.pose) == (0.0075, 0.0075, "equilibrium")
    assert iltis.scenes["iavsd_sine_2mm"].rates == {"chassis_free.vx": 20}


def test_inputs_are_functions_of_time(iltis: Model) -> None:
    t = variable("t")
    slalom = iltis.scenes["simul3"].inputs["rack_displacement"]
    assert evaluate(slalom, {t: 0.5}) == 0
    assert evaluate(slalom, {t: 2.0}) == pytest.approx(0.0175)
    assert evaluate(slalom, {t: 4.0}) == pytest.approx(-0.035)


def test_outputs_are_the_models_then_each_instances(iltis: Model) -> None:
    columns = [output.column for output in iltis.scenes["simul2"].outputs]
    assert len(columns) == 12 + 4 * 7
    assert columns[11:14] == ["chassis.az", "front_left.tyre.Fz", "front_left.tyre.Fy"]


def test_elements_know_their_line(iltis: Model) -> None:
    file = str(MODELS / "iltis.yaml")
    lines = (MODELS / "iltis.yaml").read_text().splitlines()
    for element in (*iltis.bodies, *iltis.joints, *iltis.forces):
        assert element.span.file == file
        own = element.name.split(".")[-1]
        assert lines[element.span.line - 1][element.span.column - 1 :].startswith(own)


def test_the_four_bar_loads(four_bar: Model) -> None:
    assert [body.name for body in four_bar.bodies] == [
        "crank_0.bar", "crank_1.bar", "crank_2.bar", "coupler_1.bar", "coupler_2.bar",
    ]  # fmt: skip
    assert len(four_bar.joints) == 7
    assert {joint.kind for joint in four_bar.joints} == {JointKind.REVOLUTE}
    twelfth = sympy.Rational(1, 12)
    assert four_bar.bodies[0].inertia == (twelfth, 0, twelfth, 0, 0, 0)
    assert four_bar.bodies[3].inertia == (0, twelfth, twelfth, 0, 0, 0)
    assert four_bar.scenes["swing"].rates["crank_1.pin.angle_rate"] == -1
    assert named(four_bar.joints, "coupler_2.pin").base == "crank_1.bar"
    assert four_bar.markers[0].span == Span(file=str(MODELS / "four_bar.yaml"), line=34, column=3)


def test_a_text_reads_the_same_every_time(iltis: Model) -> None:
    assert read_model(MODELS / "iltis.yaml") == iltis
