"""From the state of a model whose loops functions close to that of the same spanning tree with the loops' equations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from cutjoint.analysis.body_poses import find_followers
from cutjoint.formulate.layout import Chart
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.formulate.recursive.kinematics import derive_poses
from cutjoint.model.records import Model
from cutjoint.topology.records import Topology


def without_functions(topology: Topology) -> Model:
    """The model with the equations of all loops, cut where it is cut beside its functions: the joints of the tree stay the same."""
    cut = {joint.name for joint in (*topology.cuts, *topology.held)}
    joints = tuple(replace(joint, cut=joint.name in cut) for joint in topology.model.joints)
    return replace(topology.model, joints=joints, assemblies=())


def state_of_loops(
    functions: RecursiveEquations, loops: RecursiveEquations, kept: Mapping[str, Any], parameters: Mapping[str, float]
) -> dict[str, Any]:  # fmt: skip
    """The state (``begin`` of a run file) from which a run goes on by the equations of ``loops``: one that a run with ``functions`` has
    ``kept``, with open ``parameters`` (SI units)."""
    t, q, v = (np.array([kept[name]], dtype=float) for name in ("t", "q", "v"))
    places = dict(zip(functions.coordinate_names, q[0], strict=True))
    speeds = dict(zip(functions.speed_names, v[0], strict=True))
    followers = find_followers(derive_poses(functions.topology, functions.scene), t, q, v, parameters)
    charts: Mapping[str, Chart] = {chart.joint: chart for chart in loops.charts}
    for joint, (place, rate) in followers.items():
        chart = charts[joint]
        places |= {f"{joint}.{name}": value for name, value in zip(chart.coordinate_names, place[0], strict=True)}
        speeds |= {f"{joint}.{name}": value for name, value in zip(chart.speed_names, rate[0], strict=True)}
    return {
        "t": kept["t"], "q": {name: float(places[name]) for name in loops.coordinate_names},
        "v": {name: float(speeds[name]) for name in loops.speed_names}, "held": kept["held"],
    }  # fmt: skip
