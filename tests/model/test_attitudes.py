"""Initial attitudes: three forms of one rotation, beside SciPy's, and what is wrong with them."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cutjoint.elements.joint import ATTITUDE
from cutjoint.model.read import read_model_text
from cutjoint.package.errors import RunError
from cutjoint.run.run_file import make_run_file

from .pendulum import check

TOP = """\
cutjoint: 1
name: top
gravity: [0, 0, -9.81]
parameters:
  bend: {value: 0.3, unit: rad, binding: param}
  lean: {value: 20, unit: deg}
bodies:
  body: {mass: 1, centre_of_mass: [0, 0, 0.1], inertia: [0.1, 0.1, 0.1]}
joints:
  ball: {kind: spherical, bodies: [ground, body], at: [0, 0, 0]}
scenes:
  spin: {end: 1, positions: {ball.attitude: ATTITUDE}}
"""


def attitude_of(written: object, **changes: float) -> Rotation:
    """The rotation that a run file has for what is written."""
    text = TOP.replace("ATTITUDE", written if isinstance(written, str) else json.dumps(written))
    model = read_model_text(text, "top.yaml")
    positions = make_run_file(model, model.scenes["spin"], changes, task="simulate").positions
    assert set(positions) == {f"ball.{name}" for name in ATTITUDE}
    quaternion = [positions[f"ball.{name}"] for name in ATTITUDE]
    assert np.linalg.norm(quaternion) == pytest.approx(1, abs=1e-15)
    return Rotation.from_quat(np.roll(quaternion, -1))


def assert_same(found: Rotation, expected: Rotation) -> None:
    assert (found * expected.inv()).magnitude() == pytest.approx(0, abs=1e-14)


@pytest.mark.parametrize("vector", [[0.3, -1.2, 2], [0, 0, 0], [1e-9, 0, 2e-9], [0, 3.5, 0], [1e-200, 0, 0]])
def test_a_rotation_vector(vector: list[float]) -> None:
    assert_same(attitude_of({"rotation_vector": vector}), Rotation.from_rotvec(vector))


@pytest.mark.parametrize("order", ["xyz", "xzy", "yxz", "yzx", "zxy", "zyx", "xyx", "xzx", "yxy", "yzy", "zxz", "zyz"])
def test_euler_angles_turn_about_axes_that_are_carried_along(order: str) -> None:
    assert_same(attitude_of({"euler": [0.3, -1.2, 2], "order": order}), Rotation.from_euler(order.upper(), [0.3, -1.2, 2]))


def test_a_quaternion_gets_its_length_back() -> None:
    assert_same(attitude_of({"quaternion": [0.7071, 0, -0.7071, 0]}), Rotation.from_rotvec([0, -np.pi / 2, 0]))


def test_attitudes_follow_parameters_at_run_time() -> None:
    written = "{euler: [bend, lean, 10 deg], order: zyx}"
    assert_same(attitude_of(written), Rotation.from_euler("ZYX", [0.3, np.radians(20), np.radians(10)]))
    assert_same(attitude_of(written, bend=-1.0), Rotation.from_euler("ZYX", [-1, np.radians(20), np.radians(10)]))
    assert_same(attitude_of("{rotation_vector: [bend, 0, 0]}", bend=0.0), Rotation.identity())


FIELD = "positions.ball.attitude"
GIVEN = "positions: 'ball.attitude':"
UNIT = "write one of length 1, within 0.001"
EXAMPLE = "write for example {euler: [yaw, pitch, roll], order: zyx}"


def test_a_quaternion_whose_length_a_parameter_spoils() -> None:
    with pytest.raises(RunError) as error:
        attitude_of("{quaternion: [cos(bend), sin(0.3), 0, 0]}", bend=1.0)
    assert str(error.value) == f"top.yaml:12:3: scene 'spin': {GIVEN} the quaternion has the length 0.61584; {UNIT}"


FORMS = "write one of rotation_vector, euler and quaternion"


@pytest.mark.parametrize(
    ("written", "expected"),
    [
        ("{quaternion: §[1, 0, 0, 1]}", f"{GIVEN} the quaternion has the length 1.41421; {UNIT}"),
        ("{quaternion: §[0, 0, 0, 0]}", f"{GIVEN} the quaternion has the length 0; {UNIT}"),  # SymPy's of a half turn
        ("§{quaternion: [1, 0, 0, 0], euler: [0, 0, 0], order: xyz}", f"{FIELD} has euler and quaternion; {FORMS}"),
        ("§{order: xyz}", f"{FIELD} has no attitude; {FORMS}"),
        ("§{euler: [0, 0, 0]}", f"{FIELD}: 'euler' and 'order' belong together; {EXAMPLE}"),
        ("{quaternion: §[1, 0, 0]}", f"{FIELD}.quaternion needs four numbers; write [w, x, y, z], the scalar first"),
        ("{rotation_vector: [0, §1 m, 0]}", f"{FIELD}.rotation_vector needs an angle or a plain number, got m"),
        ("{rotation_vector: [0, §nope, 0]}", f"{FIELD}.rotation_vector: unknown symbol 'nope'; symbols here: bend, lean, pi"),
        ("{rotation_vector: [0, §-1e7, 0]}", f"{GIVEN} an angle of -1e+07 rad has no exact sine and cosine; "
         "take whole turns away, so that it is at most 1e+06 rad"),
        ("{euler: [0, §1e7, 0], order: xyx}", f"{GIVEN} an angle of 1e+07 rad has no exact sine and cosine; "
         "take whole turns away, so that it is at most 1e+06 rad"),
        ("§0.5", "positions: 'ball.attitude' is an attitude; write {rotation_vector: ...}, {euler: ..., order: ...} or {quaternion: ...}"),
    ],
)
def test_what_is_wrong_with_an_attitude(written: str, expected: str) -> None:
    check("ATTITUDE", written, f"@: scene 'spin': {expected}", TOP)


def test_what_a_start_cannot_be_sought_near() -> None:
    """Coordinates without a position, and places that are assembled."""
    scene, given = "ball.attitude: ATTITUDE}", "ball.attitude: {rotation_vector: [0, 0, 0]}}"
    check(scene, f"{given}, near: [ball.attitude, §ball.angle]",
          "@: scene 'spin': near: 'ball.angle' is not among the positions; did you mean 'ball.attitude'?", TOP)  # fmt: skip
    reported = "near: where 'assemble' is, all that has no position may move; remove 'near' and its positions"
    check(scene, f"{given}, assemble: {{body.x: 1}}, near: §[ball.attitude]", f"@: scene 'spin': {reported}", TOP)


def test_what_has_no_attitude() -> None:
    text = TOP.replace("spherical,", "revolute, axis: [0, 0, 1],")
    message = "positions: the revolute joint 'ball' has no 'attitude'; positions: angle"
    check("ball.attitude: ATTITUDE", "§ball.attitude: {quaternion: [1, 0, 0, 0]}", f"@: scene 'spin': {message}", text)
    check("ball.attitude: ATTITUDE", "ball.angle: §{quaternion: [1, 0, 0, 0]}",
          "@: scene 'spin': positions: 'ball.angle' is a number; write a number", text)  # fmt: skip
