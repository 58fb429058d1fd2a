"""Figures of an axle in a pose: wheels, steering axis, roll centre, support angles, ratios; see docs/how-to/suspension-kinematics.md.

x is forward, y to the left, z up, all fixed in the chassis; the road is the plane along x through both contact centres.
"""

from collections.abc import Iterator
from itertools import chain

import numpy as np

from cutjoint.analysis.closing import Array
from cutjoint.tasks.kinematics.axles import Axle, Wheel
from cutjoint.tasks.kinematics.linkage import Pose, WheelState, side_of

_UP = np.array([0.0, 0.0, 1.0])
#: Smaller relative changes count as zero.
_NOTHING = 1e-9

#: The units of figures of a wheel and of an axle, without those of springs and of the steering joint; "1" of ratios.
WHEEL_UNITS = {
    "travel": "m", "camber": "rad", "toe": "rad", "caster": "rad", "kingpin_inclination": "rad", "scrub_radius": "m", "caster_trail": "m",
    "brake_support_angle": "rad", "drive_support_angle": "rad", "anti_brake": "1", "anti_drive": "1",
}  # fmt: skip
AXLE_UNITS = {"roll": "rad", "track": "m", "roll_centre_height": "m", "roll_centre_y": "m", "ackermann": "1"}
STEER, STEERING_RATIO, MOTION_RATIO = "steer", "steering_ratio", "motion_ratio"


def units_of(axle: Axle) -> dict[str, str]:
    """The columns of an axle with their units, in the order of tables."""
    sides = [f"{side_of(axle, wheel)}.{name}" for name in wheel_figures(axle) for wheel in axle.wheels]
    units = {column: WHEEL_UNITS[column.partition(".")[2]] for column in sides}
    units |= {f"{spring.name}.{MOTION_RATIO}": "1" for spring in axle.springs}
    units |= {name: AXLE_UNITS[name] for name in AXLE_UNITS if name != "ackermann" or _has_ackermann(axle)}
    if axle.steering is not None:
        units |= {STEER: axle.steering_unit, STEERING_RATIO: {"rad": "1", "m": "m/rad"}[axle.steering_unit]}
    return units


def wheel_figures(axle: Axle) -> tuple[str, ...]:
    """The names of the figures of each wheel."""
    steered = ("caster", "kingpin_inclination", "scrub_radius", "caster_trail") if axle.steering is not None else ()
    anti = ("anti_brake", "anti_drive") if axle.wheelbase is not None else ()
    return ("travel", "camber", "toe", *steered, "brake_support_angle", "drive_support_angle", *anti)


def _has_ackermann(axle: Axle) -> bool:
    return axle.steering is not None and axle.wheelbase is not None


def find_figures(axle: Axle, pose: Pose, share: float) -> dict[str, float]:
    """All figures of a pose by their columns; NaN where one has no value."""
    figures = dict(chain.from_iterable(_of_wheel(axle, pose, i, share) for i in (0, 1)))
    figures |= {f"{spring.name}.{MOTION_RATIO}": _motion_ratio(pose, spring.name) for spring in axle.springs}
    return figures | dict(_of_axle(axle, pose))


# A wheel


def camber(wheel: WheelState) -> float:
    """The angle between wheel plane and z, rad, positive where the top leans outwards."""
    return float(-np.arcsin(wheel.outward[2]))


def steer_angle(wheel: WheelState, side: int) -> float:
    """The angle from x to the wheel plane about z, rad, positive to the left."""
    x, y = side * wheel.outward[:2]
    return float(np.arctan2(-x, y))


def contact(wheel: Wheel, state: WheelState) -> Array:
    """The contact centre (3,): the lowest point of the wheel's circle."""
    return np.asarray(state.centre - wheel.radius * _upright(state.outward))


def _upright(outward: Array) -> Array:
    """The unit vector in the wheel plane that is nearest to z."""
    across = _UP - outward[2] * outward
    return np.asarray(across / np.linalg.norm(across))


def contact_velocity(wheel: Wheel, state: WheelState, by: int) -> Array:
    """Derivative of the contact centre by a prescribed coordinate; the contact stays at the lowest point while the wheel rotates."""
    e, rotation_rate = state.outward, state.rotation_rate[:, by]
    rate = np.cross(rotation_rate, e)
    across = _UP - e[2] * e
    change = (-rate[2] * e - e[2] * rate) / np.linalg.norm(across)
    up = _upright(e)
    return np.asarray(state.velocity[:, by] - wheel.radius * (change - up * (up @ change)))


def _of_wheel(axle: Axle, pose: Pose, i: int, share: float) -> Iterator[tuple[str, float]]:
    wheel, state = axle.wheels[i], pose.wheels[i]
    side = side_of(axle, wheel)
    figures = {
        "travel": pose.prescribed[i], "camber": camber(state), "toe": -wheel.side * steer_angle(state, wheel.side),
        **_support(axle, wheel, state, i, share), **(_steering_axis(axle, wheel, state, pose, i) if axle.steering is not None else {}),
    }  # fmt: skip
    yield from ((f"{side}.{name}", float(figures[name])) for name in wheel_figures(axle))


def _support(axle: Axle, wheel: Wheel, state: WheelState, i: int, share: float) -> dict[str, float]:
    """The angles of the paths of contact centre and wheel centre in side view, and their shares of what the axle load changes by."""
    sign = 1 if axle.is_front else -1
    point = state.velocity[:, i] + np.cross(state.rotation_rate[:, i], contact(wheel, state) - state.centre)
    slopes = {"brake": sign * point[0] / point[2], "drive": sign * state.velocity[0, i]}
    angles = {f"{name}_support_angle": float(np.arctan(slope)) for name, slope in slopes.items()}
    if axle.wheelbase is None:
        return angles
    return angles | {f"anti_{name}": share * slope * axle.wheelbase / axle.height for name, slope in slopes.items()}


def _steering_axis(axle: Axle, wheel: Wheel, state: WheelState, pose: Pose, i: int) -> dict[str, float]:
    """The axis about which the carrier rotates under steering at constant length of its first spring.
    Without a spring, the wheel centre keeps its height."""
    change = next((c for spring in axle.springs if abs((c := pose.changes[spring.name])[i]) > 1e-3), None)
    back = 0.0 if change is None else change[2] / change[i]
    rotation_rate = state.rotation_rate[:, 2] - back * state.rotation_rate[:, i]
    velocity = state.velocity[:, 2] - back * state.velocity[:, i]
    if not np.linalg.norm(rotation_rate) > _NOTHING:
        return dict.fromkeys(("caster", "kingpin_inclination", "scrub_radius", "caster_trail"), np.nan)
    point = state.centre + np.cross(rotation_rate, velocity) / (rotation_rate @ rotation_rate)
    axis = rotation_rate * np.sign(rotation_rate[2])
    ground = contact(wheel, state)
    offset = point + axis * (ground[2] - point[2]) / axis[2] - ground
    outward = state.outward * [1, 1, 0]
    outward /= np.linalg.norm(outward)
    forward = wheel.side * np.cross(outward, _UP)
    return {
        "caster": float(np.arctan2(-axis[0], axis[2])), "kingpin_inclination": float(np.arctan2(-wheel.side * axis[1], axis[2])),
        "scrub_radius": float(-offset @ outward), "caster_trail": float(offset @ forward),
    }  # fmt: skip


# An axle


def _motion_ratio(pose: Pose, spring: str) -> float:
    """The change of a spring's length per travel of the wheel with the largest effect; positive if the spring shortens in bump."""
    left, right = pose.changes[spring][:2]
    return float(-(left if abs(left) >= abs(right) else right))


def _of_axle(axle: Axle, pose: Pose) -> Iterator[tuple[str, float]]:
    grounds = [contact(wheel, state) for wheel, state in zip(axle.wheels, pose.wheels, strict=True)]
    across = grounds[0] - grounds[1]
    roll = -np.arctan2(across[2], across[1])
    yield "roll", float(roll)
    yield "track", float(np.hypot(across[1], across[2]))
    y, z = _roll_centre(axle, pose, grounds)
    road = grounds[1][2] + across[2] / across[1] * (y - grounds[1][1])
    yield "roll_centre_height", float((z - road) * np.cos(roll))
    yield "roll_centre_y", float(y)
    if _has_ackermann(axle):
        yield "ackermann", _ackermann(axle, pose, float(across[1])) if pose.prescribed[2] else np.nan
    if axle.steering is not None:
        yield STEER, float(pose.prescribed[2])
        rate = np.mean([_steer_rate(state) for state in pose.wheels])
        yield STEERING_RATIO, float(1 / rate) if abs(rate) > _NOTHING else np.nan


def _roll_centre(axle: Axle, pose: Pose, grounds: list[Array]) -> Array:
    """Point (y, z) in which the normals to the paths of both contact centres intersect; NaN if they are parallel."""
    paths = np.array([contact_velocity(wheel, state, i)[1:] for i, (wheel, state) in enumerate(zip(axle.wheels, pose.wheels, strict=True))])
    if abs(np.linalg.det(paths)) <= _NOTHING:
        return np.full(2, np.nan)
    return np.linalg.solve(paths, np.array([path @ ground[1:] for path, ground in zip(paths, grounds, strict=True)]))


def _steer_rate(state: WheelState) -> float:
    """The derivative of the steer angle by the steering joint, at constant height of the wheel centre."""
    x, y = state.outward[:2]
    dx, dy = np.cross(state.rotation_rate[:, 2], state.outward)[:2]
    return float((x * dy - y * dx) / (x * x + y * y))


def _ackermann(axle: Axle, pose: Pose, track: float) -> float:
    """The difference of the steer angles by that of wheels that roll about one point on the line of the other axle; NaN straight on."""
    angles = [abs(steer_angle(state, wheel.side)) for wheel, state in zip(axle.wheels, pose.wheels, strict=True)]
    mean = np.mean([steer_angle(state, wheel.side) for wheel, state in zip(axle.wheels, pose.wheels, strict=True)])
    inner, outer = angles if mean > 0 else angles[::-1]
    assert axle.wheelbase is not None
    if not min(inner, outer) > 1e-4:
        return np.nan
    ideal = np.arctan2(1.0, 1 / np.tan(inner) + track / axle.wheelbase)
    return float((inner - outer) / (inner - ideal))
