"""Plates on rods between universal and spherical joints, which are as light as asked."""

from __future__ import annotations

import json

import numpy as np


def rods_text(rods: int = 5, *, mass: float = 0.0, plates: int = 1, seed: int = 0, scene: str = '{"end": 0.3, "output_step": 0.05}') -> str:
    """A stack of plates, each on so many rods (five leave it one way to move), whose ends are drawn; rods of no ``mass`` are massless."""
    rng = np.random.default_rng(seed)
    bodies, joints = {}, {}
    below, foot = "ground", np.zeros(3)
    for p in range(plates):
        plate, middle = f"plate{p}", foot + np.array([0, 0, 1])
        bodies[plate] = {"mass": 3, "centre_of_mass": [*middle], "inertia": [0.5, 0.45, 0.58]}
        for k in range(rods):
            name, turn = f"rod{p}{k}", 2 * np.pi * (k + rng.uniform(-0.2, 0.2)) / rods
            ring = np.array([np.cos(turn), np.sin(turn), 0])
            low = foot + 0.6 * ring + rng.uniform(-0.15, 0.15, 3)
            high = middle + 0.4 * np.roll(ring, 1) * [1, 1, 0] + rng.uniform(-0.15, 0.15, 3)
            along = (high - low) / np.linalg.norm(high - low)
            axis = np.cross(along, [1, 0, 0])
            light = {"mass": mass, "inertia": [mass / 10] * 3} if mass else {"massless": True}
            bodies[name] = {**light, "centre_of_mass": [*((low + high) / 2)]}
            axes = {"axis": [*axis], "axis_2": [*np.cross(along, axis)]}
            joints[f"u{p}{k}"] = {"kind": "universal", "bodies": [below, name], "at": [*low], **axes}
            joints[f"s{p}{k}"] = {"kind": "spherical", "bodies": [name, plate], "at": [*high]}
        below, foot = plate, middle
    outputs = [f"plate{plates - 1}.{x}" for x in "xyz"]
    parts = {"bodies": bodies, "joints": joints, "outputs": outputs, "scenes": {"run": json.loads(scene)}}
    return json.dumps({"cutjoint": 1, "name": "rods", "gravity": [0, 0, -9.81], **parts}, indent=1)
