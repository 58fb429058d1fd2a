"""Sweeps of an axle: both wheels up and down, one up and the other down, and the steering to and fro."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cutjoint.analysis.closing import Array
from cutjoint.model.ranges import fault_of_setting
from cutjoint.package.errors import RunError
from cutjoint.package.locations import AnyPath
from cutjoint.run.inputs import given_inputs
from cutjoint.run.results import Columns
from cutjoint.run.run_file import parameter_values
from cutjoint.tasks.kinematics.axles import Axle, Values, find_axle
from cutjoint.tasks.kinematics.figures import find_figures, units_of
from cutjoint.tasks.kinematics.linkage import Linkage, Pose
from cutjoint.topology.reading import read_model

TRAVEL, ROLL, STEERING = "travel", "roll", "steer"
#: The column of what changes in each sweep.
LEADING = {TRAVEL: "left.travel", ROLL: "roll", STEERING: "steer"}
#: The travel of the steering joint where nobody says it, m and rad.
_TURNS = {"m": 0.02, "rad": 0.5}


@dataclass(frozen=True, kw_only=True)
class AxleKinematics:
    """The figures of an axle: ``sweeps`` "travel", "roll" and, of a steered axle, "steer", each columns (rows,) by name with ``units``.

    ``limits`` say where a sweep ended before its end.
    """

    axle: Axle
    sweeps: Mapping[str, Mapping[str, Array]]
    units: Mapping[str, str]
    limits: tuple[str, ...]


def find_kinematics(
    path: AnyPath, *, axle: str | None = None, travel: float = 0.05, turn: float | None = None, points: int = 21,
    steer: str | None = None, radius: float | None = None, share: float = 1.0, parameters: Mapping[str, float] | None = None,
) -> AxleKinematics:  # fmt: skip
    """The kinematics of an axle of a model file, the only one if none is named, over ``travel`` (m) up and down and ``turn`` (m or rad) of
    its steering joint to either side, at so many ``points`` each.

    Raises:
        ModelError: the file is wrong.
        RunError: there is no such axle or joint, the axle has a freedom of its own, or a parameter cannot be set.
    """
    for name, value in (("travel", travel), ("turn", turn), ("points", points), ("radius", radius), ("share", share)):
        if value is not None and (fault := fault_of_setting(name, value)):
            raise RunError(f"{name}: {fault}")
    model, changes = read_model(path), parameters or {}
    values = Values(model, parameter_values(model, changes) | given_inputs(model, changes))
    found = find_axle(model, values, axle, radius=radius, steer=steer)
    linkage = Linkage(found)
    ends = {TRAVEL: np.array([travel, travel, 0.0]), ROLL: np.array([-travel, travel, 0.0])}
    if found.steering is not None:
        ends[STEERING] = np.array([0.0, 0.0, _TURNS[found.steering_unit] if turn is None else turn])
    units, start = units_of(found), linkage.design()
    sweeps: dict[str, Mapping[str, Array]] = {}
    limits: list[str] = []
    for name, end in ends.items():
        poses = _sweep(linkage, start, end[: linkage.held], points // 2, name, limits)
        rows = [find_figures(found, pose, share) for pose in poses]
        sweeps[name] = Columns({column: np.array([row[column] for row in rows]) for column in units})
    return AxleKinematics(axle=found, sweeps=sweeps, units=Columns(units), limits=tuple(limits))


def _sweep(linkage: Linkage, start: Pose, end: Array, rows: int, name: str, limits: list[str]) -> list[Pose]:
    """The poses from one end through the start to the other."""
    ways = []
    for sign in (-1, 1):
        way = linkage.follow(start, sign * end, rows)
        if len(way) < rows:
            wanted, unit = np.abs(end).max(), linkage.axle.steering_unit if name == STEERING else "m"
            at = sign * wanted * len(way) / rows
            limits.append(f"{name}: the loops do not close beyond {at:.4g} {unit} of {sign * wanted:.4g} {unit}")
        ways.append(way)
    return [*reversed(ways[0]), start, *ways[1]]

