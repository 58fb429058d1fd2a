"""The ways in which closed loops assemble, beside intersections of circles, and scenes that start in each of them."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.typing import NDArray

from cutjoint import find_initial_state, read_model_text
from cutjoint.cli import main
from cutjoint.run.run_file import find_assemblies

_FOUR_BAR = """
cutjoint: 1
name: bars
gravity: [0, 0, -9.81]
points: {A: [0, 0, 0], B: [0, 0, 0.3], C: [0.8, 0, 0.6], D: [0.7, 0, 0]POINTS}
bodies:
  crank: {massless: true, centre_of_mass: B}
  coupler: {massless: true, centre_of_mass: C}
  rocker: {mass: 1, centre_of_mass: {midpoint: [C, D]}, inertia: [0.01, 0.01, 0.01]}
  BODIES
joints:
  a: {kind: revolute, bodies: [ground, crank], at: A, axis: y}
  b: {kind: revolute, bodies: [crank, coupler], at: B, axis: y}
  c: {kind: revolute, bodies: [coupler, rocker], at: C, axis: y, cut: true}
  d: {kind: revolute, bodies: [rocker, ground], at: D, axis: y}
  JOINTS
scenes:
  s: {end: 1, SCENE}
"""
_SLIDER_CRANK = """
cutjoint: 1
name: crank
gravity: [0, 0, -9.81]
points: {O: [0, 0, 0], P: [0, 0, 0.1], Q: [0.3, 0, 0.02]}
bodies:
  crank: {massless: true, centre_of_mass: P}
  rod: {massless: true, centre_of_mass: Q}
  slider: {mass: 1, centre_of_mass: Q}
joints:
  turn: {kind: revolute, bodies: [ground, crank], at: O, axis: y}
  big_end: {kind: revolute, bodies: [crank, rod], at: P, axis: y}
  pin: {kind: revolute, bodies: [rod, slider], at: Q, axis: y, cut: true}
  slide: {kind: prismatic, bodies: [ground, slider], at: Q, axis: x}
scenes: {s: {end: 1, SCENE}}
"""

Point = NDArray[np.float64]


def four_bar(points: str = "", bodies: str = "", joints: str = "") -> str:
    return _FOUR_BAR.replace("POINTS", points).replace("  BODIES\n", bodies).replace("  JOINTS\n", joints)


def starts(text: str, scene: str, names: list[str], *, kept: tuple[str, ...]) -> list[list[float]]:
    """Values at the starts of scenes with the positions of each assembly, sorted."""
    model, rows = read_model_text(text.replace("SCENE", scene), "m.yaml"), []
    found = find_assemblies(model, model.scenes["s"])
    assert (found.kept, found.is_continuum) == (kept, False)
    assert min(assembly.found for assembly in found.assemblies) >= 3
    for assembly in found.assemblies:
        positions = ", ".join(f"{name}: {value}" for name, value in assembly.positions.items())
        chosen = f"positions: {{{positions}}}, near: [{', '.join(found.follow)}]"
        state = find_initial_state(read_model_text(text.replace("SCENE", chosen), "m.yaml"))
        rows.append([state[name] for name in names])
    return in_order(rows)


def in_order(rows: Iterable[Iterable[float]]) -> list[list[float]]:
    return sorted((list(row) for row in rows), key=lambda row: np.round(row, 4).tolist())


def meet(one: Point, radius: float, other: Point, length: float) -> list[Point]:
    """The intersections of two circles in the plane x z."""
    along = other - one
    far = np.hypot(*along)
    part = (radius**2 - length**2 + far**2) / (2 * far)
    if (square := radius**2 - part**2) < 0:
        return []
    return [one + (part * along + sign * np.sqrt(square) * np.array([-along[1], along[0]])) / far for sign in (-1, 1)]


def far(one: Point, other: Point) -> float:
    return float(np.hypot(*(one - other)))


_A, _B, _C, _D = (np.array(p) for p in ([0, 0], [0, 0.3], [0.8, 0.6], [0.7, 0]))
_CRANKED = 0.3 * np.array([np.sin(np.pi / 9), np.cos(np.pi / 9)])


def test_a_four_bar() -> None:
    by_circles = in_order(meet(_CRANKED, far(_B, _C), _D, far(_C, _D)))
    found = starts(four_bar(), "positions: {a.angle: 20 deg}", ["coupler.x", "coupler.z"], kept=("a.angle",))
    assert np.allclose(found, by_circles, atol=1e-9)


def test_a_slider_crank() -> None:
    P, rod = 0.1 * np.array([np.sin(np.pi / 6), np.cos(np.pi / 6)]), np.hypot(0.3, 0.08)
    reach = np.sqrt(rod**2 - (0.02 - P[1]) ** 2)
    found = starts(_SLIDER_CRANK, "positions: {turn.angle: 30 deg}", ["slider.x"], kept=("turn.angle",))
    assert np.allclose(found, [[P[0] - reach], [P[0] + reach]], atol=1e-9)


@pytest.mark.slow
def test_a_watt_six_bar() -> None:
    """A second dyad, between the coupler and the rocker."""
    E, F, G = (np.array(p) for p in ([0.5, 0.8], [1.1, 0.5], [1.2, 1.0]))
    text = four_bar(
        ", E: [0.5, 0, 0.8], F: [1.1, 0, 0.5], G: [1.2, 0, 1.0]",
        "  one: {massless: true, centre_of_mass: G}\n  two: {mass: 1, centre_of_mass: G, inertia: [0.01, 0.01, 0.01]}\n",
        "  e: {kind: revolute, bodies: [coupler, one], at: E, axis: y}\n  f: {kind: revolute, bodies: [rocker, two], at: F, axis: y}\n"
        "  g: {kind: revolute, bodies: [one, two], at: G, axis: y, cut: true}\n",
    )  # fmt: skip

    def turned(point: Point, of: tuple[Point, Point], to: tuple[Point, Point]) -> Point:
        """A point of a body that two of its points carry along; complex numbers turn it."""
        z = [complex(*p) for p in (point, *of, *to)]
        moved = z[3] + (z[0] - z[1]) * (z[4] - z[3]) / (z[2] - z[1])
        return np.array([moved.real, moved.imag])

    by_circles = []
    for C in meet(_CRANKED, far(_B, _C), _D, far(_C, _D)):
        ends = turned(E, (_B, _C), (_CRANKED, C)), turned(F, (_D, _C), (_D, C))
        by_circles += [[*C, *at] for at in meet(ends[0], far(E, G), ends[1], far(F, G))]
    found = starts(text, "positions: {a.angle: 20 deg}", ["coupler.x", "coupler.z", "one.x", "one.z"], kept=("a.angle",))
    assert len(by_circles) == 4
    assert np.allclose(found, in_order(by_circles), atol=1e-9)


@pytest.mark.slow
def test_a_five_bar_whose_end_is_given() -> None:
    """Each of both arms has two poses."""
    text = """
cutjoint: 1
name: five
gravity: [0, 0, -9.81]
points: {A: [0, 0, 0], B: [-0.2, 0, 0.4], C: [0.3, 0, 0.7], D: [0.8, 0, 0.4], E: [0.6, 0, 0]}
bodies:
  ab: {massless: true, centre_of_mass: B}
  bc: {mass: 3, centre_of_mass: C, inertia: [0.03, 0.03, 0.03]}
  cd: {mass: 3, centre_of_mass: C, inertia: [0.03, 0.03, 0.03]}
  de: {massless: true, centre_of_mass: D}
joints:
  a: {kind: revolute, bodies: [ground, ab], at: A, axis: y}
  b: {kind: revolute, bodies: [ab, bc], at: B, axis: y}
  c: {kind: revolute, bodies: [bc, cd], at: C, axis: y, cut: true}
  d: {kind: revolute, bodies: [cd, de], at: D, axis: y}
  e: {kind: revolute, bodies: [de, ground], at: E, axis: y}
scenes: {s: {end: 1, SCENE}}
"""
    tip, (A, B, C, D, E) = np.array([0.25, 0.65]), (np.array(p) for p in ([0, 0], [-0.2, 0.4], [0.3, 0.7], [0.8, 0.4], [0.6, 0]))
    arms = meet(A, far(A, B), tip, far(B, C)), meet(E, far(D, E), tip, far(C, D))
    by_circles = in_order([*one, *other] for one, other in product(*arms))
    found = starts(text, "assemble: {bc.x: 0.25, bc.z: 0.65}", ["ab.x", "ab.z", "de.x", "de.z"], kept=())
    assert np.allclose(found, by_circles, atol=5e-6)  # positions have digits of 1e-4 deg


@pytest.mark.heavy
def test_four_loops() -> None:
    """Four pairs of links from a slide to the ground, of which each has two poses."""
    text = ["cutjoint: 1\nname: dyads\ngravity: [0, 0, -9.81]\nbodies:\n  slide: {mass: 1, centre_of_mass: [0, 0, 0]}\n"]
    text += [f"  a{x}: {{massless: true, centre_of_mass: [{x}.3, 0, 0.4]}}\n"
             f"  b{x}: {{mass: 1, centre_of_mass: [{x}.3, 0, 0.4], inertia: [0.01, 0.01, 0.01]}}\n" for x in range(4)]  # fmt: skip
    text += ["joints:\n  way: {kind: prismatic, bodies: [ground, slide], at: [0, 0, 0], axis: z}\n"]
    text += [f"  p{x}: {{kind: revolute, bodies: [slide, a{x}], at: [{x}, 0, 0], axis: y}}\n"
             f"  q{x}: {{kind: revolute, bodies: [a{x}, b{x}], at: [{x}.3, 0, 0.4], axis: y}}\n"
             f"  r{x}: {{kind: revolute, bodies: [b{x}, ground], at: [{x}.6, 0, 0.1], axis: y, cut: true}}\n"
             for x in range(4)]  # fmt: skip
    text += ["scenes: {s: {end: 1, SCENE}}\n"]
    one, other, knee = np.array([0, 0.05]), np.array([0.6, 0.1]), np.array([0.3, 0.4])
    both = meet(one, far(knee, np.zeros(2)), other, far(knee, other))
    by_circles = in_order([x for i, point in enumerate(points) for x in (i + point[0], point[1])] for points in product(both, repeat=4))
    names = [f"b{x}.{axis}" for x in range(4) for axis in "xz"]
    found = starts("".join(text), "positions: {way.displacement: 0.05}", names, kept=("way.displacement",))
    assert np.allclose(found, by_circles, atol=5e-6)  # positions have digits of 1e-4 deg


def test_the_command_lists_them(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(_SLIDER_CRANK.replace("SCENE", "positions: {turn.angle: 30 deg}"), encoding="utf-8")
    lines = CliRunner().invoke(main, ["check", str(tmp_path / "m.yaml"), "--assemblies"]).output.splitlines()
    first = lines.index("assemblies: 2, from 128 random starts, with turn.angle kept")
    assert all("positions: {turn.angle: 30 deg, " in line and "near: [" in line for line in lines[first + 1 : first + 3])
