"""The oracle's own tyre, from the formulas of the IAVSD benchmark."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

Array = np.ndarray


class Flat:
    """A road at height zero."""

    def height(self, x: float, y: float) -> float:
        """Height, m."""
        return 0.0

    def slope(self, x: float, y: float) -> float:
        """dz/dx."""
        return 0.0


def road_normal(centre: Array, road: Flat) -> Array:
    """The road's upward normal below a point."""
    slope = road.slope(centre[0], centre[1])
    return np.array([-slope, 0.0, 1.0]) / np.hypot(1.0, slope)


def wheel_distance(centre: Array, axis: Array, road: Flat) -> float:
    """The way from a wheel's centre to the road's plane under it, along the line in the wheel's plane that crosses the road's contours."""
    n = road_normal(centre, road)
    down = n - (n @ axis) * axis
    down /= np.linalg.norm(down)
    return float((centre[2] - road.height(centre[0], centre[1])) * n[2] / (n @ down))


def tyre_contact(c: Mapping[str, float], centre: Array, velocity: Array, axis: Array, road: Flat) -> tuple[Array, Array, Array]:
    """Contact point, force and moment of the road on a wheel with a point contact below its centre.

    Vertical spring on the road's height, along the normal; Calspan lateral force and aligning moment (Frik, Leister, Schwartz,
    1993): the lateral force saturates at g = 1 where the demand is three times the friction limit.  A standing wheel, one that
    rolls forward at no more than 0.1 m/s, is a spring along the normal through its centre.
    """
    n = road_normal(centre, road)
    clearance = centre[2] - road.height(centre[0], centre[1])
    e_x = np.cross(axis, n) / np.linalg.norm(np.cross(axis, n))
    e_y, e_z = np.cross(n, e_x), np.cross(e_x, axis)
    load = max(0.0, c["stiffness"] * (c["radius"] - clearance) * n[2])
    forward, sideways = velocity @ e_x, velocity @ e_y
    if forward <= 0.1:
        return centre, load * n, np.zeros(3)
    # the road's plane under the centre, met along the wheel's own plane
    contact = centre - (clearance * n[2] / (n @ e_z)) * e_z
    friction = (c["B1"] * load + c["B3"] + c["B4"] * load**2) * c["SN"] * load
    if friction <= 0:
        return contact, load * n, np.zeros(3)
    slip, camber = np.arctan2(sideways, forward), np.arctan((n @ axis) / (n @ e_z))
    low = min(load, c["A2"])
    cornering = c["A0"] + c["A1"] * low * (c["A2"] - low) / c["A2"]
    thrust = c["A3"] * (c["A4"] - low) * low / c["A4"]
    demand = -(cornering * slip + thrust * camber) / friction
    g = demand - demand * abs(demand) / 3 + demand**3 / 27 if abs(demand) < 3 else np.sign(demand)
    side = friction * g
    return contact, load * n + side * e_y, (c["AF1"] * load + c["AF2"] * abs(side)) * side * n
