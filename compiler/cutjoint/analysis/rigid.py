"""Geometry that is slightly off: axes (`skew`), and points that hold a mechanism without freedom only just."""

from __future__ import annotations

import numpy as np

from cutjoint.analysis.closing import close_loops, design_coordinates
from cutjoint.analysis.mobility import Mobility
from cutjoint.analysis.skew import describe_skew
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.topology.geometry import evaluate

#: Loops that open by less than this share of the mechanism's size (at most 1 m) hold a speed of 1 m/s or rad/s only just.
_NEAR = 0.01


def describe_geometry(equations: RecursiveEquations, mobility: Mobility) -> str:
    """The fault in a mechanism's geometry that is slightly off, and its remedy; "" without one."""
    return describe_skew(equations, mobility) or _describe_rigidity(equations, mobility)


def _describe_rigidity(equations: RecursiveEquations, mobility: Mobility) -> str:
    """The speed of a rigid mechanism that the loops hold only just, and places to look at; "" where they hold all well."""
    if mobility.degrees_of_freedom or not mobility.closed or any(joint.guide for joint in equations.topology.model.joints):
        return ""  # what guides drive is held by them, near dead centres too
    start = close_loops(equations, design_coordinates(equations))
    if start is None or not start[1].size:
        return ""
    opening, values, speeds = np.linalg.svd(start[1], full_matrices=False)
    if values[-1] > _NEAR * min(1.0, _extent(equations)):
        return ""
    speed, row = int(np.abs(speeds[-1]).argmax()), int(np.abs(opening[:, -1]).argmax())
    rate = values[-1] / abs(speeds[-1, speed])
    return (
        f"rigid only just: at a speed of 1 at '{equations.speed_names[speed]}' the loops open by {rate:.2g} m/s or rad/s, "
        f"most at '{equations.equation_names[row]}'; hinges that are nearly on one line, or points that are nearly in one plane, do that: "
        f"look at the points and axes of these joints"
    )


def _extent(equations: RecursiveEquations) -> float:
    """The largest distance (m) along an axis between joints."""
    model = equations.topology.model
    points = np.array([evaluate(model, joint.at) for joint in model.joints])
    return float((points.max(axis=0) - points.min(axis=0)).max())
