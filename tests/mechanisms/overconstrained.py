"""Planar linkages in space whose loops have more equations than they need."""

from __future__ import annotations

import numpy as np

_HEAD = """cutjoint: 1
name: {name}
gravity: [0, -9.81, 0]
bodies:
"""
_BODY = "  {name}: {{mass: 1, centre_of_mass: [{x}, {y}, 0], inertia: [0.1, 0.1, 0.1]}}\n"
_PIN = "  {name}: {{kind: revolute, bodies: [{base}, {follower}], at: [{x}, {y}, 0], axis: [0, 0, 1]{cut}}}\n"

#: The ends of the cranks, from their ground pins: upright, or so that all pins are in line.
UPRIGHT, IN_LINE = (0.0, 1.0), (1.5, 0.0)


def parallel_cranks_text(cranks: int, crank: tuple[float, float] = UPRIGHT, *, cut: str = ", cut: true") -> str:
    """A rigid coupler on parallel cranks of one length that stand one metre apart.

    Two cranks guide the coupler; every further one brings two equations in the plane, of which one says nothing new.
    """
    dx, dy = crank
    bodies = "".join(_BODY.format(name=f"crank_{i}", x=i + dx / 2, y=dy / 2) for i in range(cranks))
    bodies += _BODY.format(name="coupler", x=dx + (cranks - 1) / 2, y=dy)
    pins = "".join(_PIN.format(name=f"pin_{i}", base="ground", follower=f"crank_{i}", x=i, y=0, cut="") for i in range(cranks))
    pins += "".join(
        _PIN.format(name=f"closure_{i}", base="coupler", follower=f"crank_{i}", x=i + dx, y=dy, cut=cut if i else "")
        for i in range(cranks)
    )
    return f"{_HEAD.format(name='parallel_cranks')}{bodies}\njoints:\n{pins}"


#: Corners of closed chains of links of one length, with hinges across both links that meet there.  Bennett's four and Bricard's six move
#: with one degree of freedom, though counting gives none: every pose of their motion has equations that say nothing new.
BENNETT = ((1.0, 0.0, 0.3), (0.0, 1.0, -0.3), (-1.0, 0.0, 0.3), (0.0, -1.0, -0.3))
BRICARD = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (1.0, 1.0, 1.0), (0.0, 1.0, 1.0), (0.0, 0.0, 1.0))


def skew_chain_text(corners: tuple[tuple[float, ...], ...], scene: str) -> str:
    """A closed chain of links of 1 kg under gravity; its first link is the ground."""
    points = np.array(corners)
    last, following = np.roll(points, 1, axis=0), np.roll(points, -1, axis=0)
    axes = np.cross(points - last, following - points)
    names = ["ground", *(f"link_{i}" for i in range(len(points) - 1)), "ground"]
    bodies = "".join(
        f"  link_{i}: {{mass: 1, centre_of_mass: {centre.tolist()}, inertia: [0.1, 0.1, 0.1]}}\n"
        for i, centre in enumerate(((points + following) / 2)[:-1])
    )
    joints = "".join(
        f"  hinge_{i}: {{kind: revolute, bodies: [{names[i]}, {names[i + 1]}], at: {point.tolist()}, axis: {axes[i].tolist()}}}\n"
        for i, point in enumerate(points)
    )
    return (
        f"cutjoint: 1\nname: skew_chain\ngravity: [1, 0.3, -9.81]\nbodies:\n{bodies}joints:\n{joints}"
        f"outputs: [link_1.x, link_1.y, link_1.z]\nscenes: {{run: {scene}}}\n"
    )
