"""The begin of simulations of generated code that has no run file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, kw_only=True)
class Beginning:
    """The settings, parameters and start of a simulation until its host changes them, in SI units.

    ``closure`` to ``frequency`` are of the cut joints of the recursive equations, ``dt`` to ``spectral_radius`` of the steps; a penalty
    of None follows from masses or is found by the run.  ``pose`` is that of the scene.  ``positions`` and ``rates`` are by
    "joint.component", ``roads`` by tyres: the pieces "left" and "right", and whether the contact is a "disc".
    """

    integrator: str
    closure: str
    closure_penalty: float | None
    damping_ratio: float
    frequency: float
    dt: float
    penalty: float | None
    tolerance: float
    iterations: int
    multiplier_updates: int
    fixed_cost: bool
    events: bool | None
    absolute_tolerance: float | None
    spectral_radius: float | None
    end: float
    output_step: float
    pose: str
    parameters: Mapping[str, float]
    positions: Mapping[str, float]
    rates: Mapping[str, float]
    roads: Mapping[str, Mapping[str, Any]]
