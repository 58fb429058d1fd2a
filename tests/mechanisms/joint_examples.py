"""An example of each joint kind: the fields that it has in a model file beside those of all joints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

EXAMPLES: Mapping[str, dict[str, Any]] = {
    "fixed": {},
    "revolute": {"axis": [1, 2, 3]},
    "prismatic": {"axis": [-1, 2, 3]},
    "cylindrical": {"axis": [1, 2, -3]},
    "screw": {"axis": [1, 0.5, 0], "pitch": 0.2},
    "universal": {"axis": [0, 0.6, 0.8], "axis_2": [1, 0, 0]},
    "constant_velocity": {"axis": [0, 0.6, 0.8], "axis_2": [0.1, 0.6, 0.8]},
    "planar": {"axis": [0.2, 0.1, 3]},
    "spherical": {},
    "point_on_line": {"axis": [1, 2, 3]},
    "point_on_plane": {"axis": [2, -1, 3]},
    "parallel_axes": {"axis": [1, -2, 0.5]},
    "distance": {"to": [0.4, 0.7, 0.2]},
    "free": {},
}
