"""`cutjoint kinematics` against a linkage that is known by hand, and against SciPy's solution of the links as distances of points."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.typing import NDArray
from scipy.optimize import brentq, fsolve
from scipy.spatial.transform import Rotation

from cutjoint.cli import main
from cutjoint.tasks.kinematics.sweep import AxleKinematics, find_kinematics
from tests.conftest import DATA, MODELS

Array = NDArray[np.float64]

#: Rounding of closed loops (1e-12) times the lengths of levers, with two digits to spare.
CLOSED = 1e-10


# A double wishbone whose hinges are parallel: each point of the carrier moves in a plane, about a point that two lines have in common

#: y and z of the arms' points, of the contact centre and the wheel's centre; the hinges rise by TILT to the front.
LOWER_IN, LOWER_OUT, UPPER_IN, UPPER_OUT = (np.array(p) for p in ([0.3, 0.25], [0.7, 0.2], [0.35, 0.5], [0.68, 0.52]))
CONTACT, CENTRE = np.array([0.75, 0.0]), np.array([0.75, 0.3])
TILT = 0.06

PLANE = """
cutjoint: 1
name: plane
gravity: [0, 0, -9.81]
parameters: {{tilt: {tilt}}}
bodies:
  hull: {{mass: 700, centre_of_mass: [0, 0, 0.45], inertia: [100, 300, 300]}}
joints:
  free: {{kind: free, bodies: [ground, hull], at: [0, 0, 0.45]}}
submodels:
  corner:
    connectors: [hull]
    parameters: [x0]
    points:
      {{A: [x0, 0.3, 0.25], B: [x0, 0.7, 0.2], C: [x0, 0.35, 0.5], D: [x0, 0.68, 0.52], W: [x0, 0.75, 0.3], S: [x0, 0.4, 0.8],
       T: [x0, 0.5, 0.225]}}
    bodies:
      lower: {{mass: 3, centre_of_mass: A, inertia: [0.1, 0.1, 0.1]}}
      upper: {{mass: 3, centre_of_mass: C, inertia: [0.1, 0.1, 0.1]}}
      carrier: {{mass: 20, centre_of_mass: W, inertia: [1, 1, 1]}}
    joints:
      lower_hinge: {{kind: revolute, bodies: [hull, lower], at: A, axis: [cos(tilt), 0, sin(tilt)]}}
      upper_hinge: {{kind: revolute, bodies: [hull, upper], at: C, axis: [cos(tilt), 0, sin(tilt)]}}
      lower_outer: {{kind: revolute, bodies: [lower, carrier], at: B, axis: [cos(tilt), 0, sin(tilt)]}}
      upper_outer: {{kind: revolute, bodies: [upper, carrier], at: D, axis: [cos(tilt), 0, sin(tilt)]}}
    forces:
      spring: {{kind: point_spring, bodies: [hull, lower], from: S, to: T, law: {{stiffness: 20000, free_length: 0.6}}}}
      tyre: {{kind: load, body: carrier, at: W, force: [0, 0, "2e5*max(0.3 - z, 0)"]}}
instances:
  front_left: {{use: corner, connect: {{hull: hull}}, with: {{x0: 1.2}}}}
  front_right: {{use: corner, connect: {{hull: hull}}, with: {{x0: 1.2}}, mirror: y}}
  rear_left: {{use: corner, connect: {{hull: hull}}, with: {{x0: -1.3}}}}
  rear_right: {{use: corner, connect: {{hull: hull}}, with: {{x0: -1.3}}, mirror: y}}
scenes: {{rest: {{end: 1}}}}
"""


def plane(folder: Path, tilt: float, **how: object) -> AxleKinematics:
    file = folder / "plane.yaml"
    file.write_text(PLANE.format(tilt=tilt), encoding="utf-8")
    return find_kinematics(file, points=3, **{"axle": "front", **how})  # type: ignore[arg-type]


def meeting(a: Array, b: Array, c: Array, d: Array) -> Array:
    """The point that the lines a-b and c-d have in common."""
    s = np.linalg.solve(np.array([b - a, c - d]).T, c - a)[0]
    return np.asarray(a + s * (b - a))


def middle(found: AxleKinematics, column: str) -> float:
    return float(found.sweeps["travel"][column][1])


def test_roll_centre_and_ratios_are_those_of_the_instant_centre(tmp_path: Path) -> None:
    """The wheel turns about the point in which the arms' lines meet; the line from there to the contact centre cuts y = 0."""
    found = plane(tmp_path, 0.0)
    pole = meeting(LOWER_IN, LOWER_OUT, UPPER_IN, UPPER_OUT)
    height = CONTACT[1] + (pole - CONTACT)[1] / (pole - CONTACT)[0] * (0 - CONTACT[0])
    assert middle(found, "roll_centre_height") == pytest.approx(height, abs=CLOSED)
    assert middle(found, "roll_centre_y") == pytest.approx(0, abs=CLOSED)
    for name in ("brake_support_angle", "drive_support_angle", "anti_brake", "anti_drive", "toe", "camber"):
        assert middle(found, f"left.{name}") == pytest.approx(0, abs=CLOSED)
    turn = 1 / (CENTRE - pole)[0]  # of the carrier about x by the centre's rise
    lower = turn * (LOWER_OUT - pole)[0] / (LOWER_OUT - LOWER_IN)[0]
    foot, top = np.array([0.5, 0.225]), np.array([0.4, 0.8])
    arm, line = foot - LOWER_IN, (foot - top) / np.linalg.norm(foot - top)
    shortening = -lower * (line @ np.array([-arm[1], arm[0]]))
    assert middle(found, "front_left.spring.motion_ratio") == pytest.approx(shortening, abs=CLOSED)
    assert middle(found, "front_right.spring.motion_ratio") == pytest.approx(shortening, abs=CLOSED)


@pytest.mark.parametrize(("axle", "sign"), [("front", 1), ("rear", -1)])
def test_support_angles_are_the_tilt_of_the_hinges(axle: str, sign: int, tmp_path: Path) -> None:
    """All points move across the hinges' direction: forwards by -tan(tilt) as they rise, in every pose."""
    found = plane(tmp_path, TILT, axle=axle, share=0.6, radius=0.3)
    columns = found.sweeps["travel"]
    for name in ("brake", "drive"):
        assert columns[f"left.{name}_support_angle"] == pytest.approx(np.full(3, -sign * TILT), abs=CLOSED)
    masses = np.array([700, *4 * [3, 3, 20]])
    height = masses @ np.array([0.45, *4 * [0.25, 0.5, 0.3]]) / masses.sum()
    anti = -sign * 0.6 * np.tan(TILT) * 2.5 / height
    assert columns["right.anti_brake"] == pytest.approx(np.full(3, anti), abs=CLOSED)


TURNING = """
    submodels:
      wheel: {include: library/wheel_mf62}
    instances:
      w: {use: wheel, connect: {carrier: carrier}, with: {x: x0, y: 0.75, z: 0.3}, properties: mf62.tir}
"""


def test_wheels_that_turn_are_those_of_an_axle(tmp_path: Path) -> None:
    """Wheels of the library in bearings of the carriers, beside loads on the carriers of which the other tests know the kinematics."""
    shutil.copy(DATA / "tyres" / "mf62.tir", tmp_path)
    before, after = re.split(r"\n      tyre: .*\n", PLANE.format(tilt=TILT))
    (tmp_path / "turning.yaml").write_text(before + TURNING + after, encoding="utf-8")
    for axle in ("front", "rear"):
        found = find_kinematics(tmp_path / "turning.yaml", points=3, axle=axle, share=0.6)
        expected = plane(tmp_path, TILT, axle=axle, share=0.6)
        assert set(found.sweeps["travel"]) == set(expected.sweeps["travel"])
        for name, column in expected.sweeps["travel"].items():
            if "anti" not in name:  # the wheels have masses of their own, so that the vehicle's height is another
                assert found.sweeps["travel"][name] == pytest.approx(column, abs=CLOSED), name


# Left corners as links between points, solved by SciPy: six distances and heights for the six numbers of a carrier's pose


@dataclass(frozen=True)
class Links:
    """Points of a corner: ``arms`` keep the distances of the carrier's points from the chassis', ``rod`` that of T2 from T1."""

    points: Mapping[str, Array]
    arms: tuple[tuple[str, str], ...]
    rod: tuple[str, str]
    wheel: str

    def pose(self, travel: float, rack: float) -> tuple[Array, Array]:
        """The rotation and the shift of the carrier after a rise of its wheel's centre and a displacement of the rack, m."""
        names = (*(a for a, _ in self.arms), self.rod[0], self.wheel)

        def length(now: Mapping[str, Array], a: str, b: str, moved: float = 0.0) -> float:
            return float(np.linalg.norm(now[a] - self.points[b] - [0, moved, 0]))

        def gaps(x: Array) -> list[float]:
            rotation, shift = Rotation.from_rotvec(x[:3]).as_matrix(), x[3:]
            now = {name: rotation @ self.points[name] + shift for name in names}
            links = [length(now, a, b) - length(self.points, a, b) for a, b in self.arms]
            rod = length(now, *self.rod, rack) - length(self.points, *self.rod)
            return [*links, rod, float(now[self.wheel][2] - self.points[self.wheel][2] - travel)]

        x = fsolve(gaps, np.array([0, 0, 0, 0, 0, travel]), xtol=1e-13)
        assert np.abs(gaps(x)).max() < 1e-13
        return Rotation.from_rotvec(x[:3]).as_matrix(), x[3:]


def hinged(**points: list[float]) -> dict[str, Array]:
    """Points, and on either side of each, P, two more along x, P+ and P-: links to both are an arm on a hinge there."""
    found = {name: np.array(p) for name, p in points.items()}
    return found | {f"{name}{sign}": p + np.array([side, 0, 0]) for name, p in found.items() for sign, side in (("+", 0.1), ("-", -0.1))}


#: models/iltis.yaml in front, and models/car.yaml behind, with the radius of its wheels.
ILTIS = Links(
    hinged(B=[0.97, 0.259, 0.302], D1=[0.97, 0.572, 0.229], S=[0.97, 0.1585, 0.6], D2=[0.97, 0.488, 0.531], T1=[0.83, 0.07, 0.6],
           T2=[0.83, 0.448, 0.531], C=[0.97, 0.615, 0.356]),
    (("D1", "B+"), ("D1", "B-"), ("D2", "S+"), ("D2", "S-")), ("T2", "T1"), "C",
)  # fmt: skip
CAR = Links(
    hinged(A=[-1.3, 0.33, 0.24], B=[-1.29, 0.69, 0.22], C=[-1.3, 0.4, 0.5], D=[-1.31, 0.66, 0.52], T1=[-1.43, 0.38, 0.31],
           T2=[-1.43, 0.68, 0.31], W=[-1.3, 0.74, 0.35]),
    (("B", "A+"), ("B", "A-"), ("D", "C+"), ("D", "C-")), ("T2", "T1"), "W",
)  # fmt: skip


@pytest.mark.parametrize(("model", "axle", "radius", "links"), [
    ("iltis", "front", 0.356, ILTIS), ("car", "rear", 0.3, CAR), ("car", "rear_left.carrier,rear_right.carrier", 0.3, CAR),
])  # fmt: skip
def test_wheels_of_other_models_stand_as_their_links_say(model: str, axle: str, radius: float, links: Links) -> None:
    found = find_kinematics(MODELS / f"{model}.yaml", axle=axle, radius=radius, points=5, travel=0.04, steer_travel=0.015)
    for name, columns in found.sweeps.items():
        for i, travel in enumerate(columns["left.travel"]):
            rotation, shift = links.pose(travel, columns["steer"][i] if "steer" in columns else 0.0)
            e = rotation[:, 1]
            assert columns["left.camber"][i] == pytest.approx(-np.arcsin(e[2]), abs=1e-10)
            assert columns["left.toe"][i] == pytest.approx(np.arctan2(e[0], e[1]), abs=1e-10)
            down = e[2] * e - [0, 0, 1]
            ground = rotation @ links.points[links.wheel] + shift + radius * down / np.linalg.norm(down)
            if name == "travel":
                assert columns["track"][i] == pytest.approx(2 * ground[1], abs=1e-10)


# The axle of models/axle.yaml with its coilover, and rates by differences

POINTS = {name: np.array(p) for name, p in {
    "LF": [0.12, 0.20, 0.11], "LR": [-0.16, 0.20, 0.11], "LB": [0.01, 0.555, 0.12], "UF": [0.10, 0.24, 0.26], "UR": [-0.14, 0.24, 0.25],
    "UB": [-0.01, 0.535, 0.31], "TI": [0.07, 0.20, 0.14], "TO": [0.075, 0.55, 0.155], "PO": [0, 0.52, 0.14], "PR": [0, 0.28, 0.42],
    "RP": [0, 0.24, 0.40], "SR": [0, 0.22, 0.45], "SC": [0, 0.02, 0.46], "W": [0, 0.60, 0.23],
}.items()}  # fmt: skip
RADIUS = 0.23


@dataclass(frozen=True)
class Corner:
    """The left upright after a rise of its wheel's centre and a displacement of the rack, m."""

    travel: float
    rack: float

    def place(self, name: str) -> Array:
        rotation, shift = self.pose
        return np.asarray(rotation @ POINTS[name] + shift)

    @property
    def pose(self) -> tuple[Array, Array]:
        return _solved(self.travel, self.rack)

    @property
    def outward(self) -> Array:
        return self.pose[0][:, 1]

    @property
    def contact(self) -> Array:
        e = self.outward
        down = e[2] * e - [0, 0, 1]
        return np.asarray(self.place("W") + RADIUS * down / np.linalg.norm(down))

    @property
    def spring(self) -> float:
        """The length of the coilover: the lower arm's turn, then the rocker's, by the length of the pushrod."""
        hinge = POINTS["LF"] - POINTS["LR"]
        n, before, now = hinge / np.linalg.norm(hinge), POINTS["LB"] - POINTS["LF"], self.place("LB") - POINTS["LF"]
        before, now = (v - (v @ n) * n for v in (before, now))
        angle = float(np.arctan2(np.cross(before, now) @ n, before @ now))
        foot, length = _about(hinge, "LF", "PO", angle), np.linalg.norm(POINTS["PR"] - POINTS["PO"])
        x = np.array([1.0, 0, 0])
        rocker = brentq(lambda a: np.linalg.norm(_about(x, "RP", "PR", a) - foot) - length, -0.9, 0.9, xtol=1e-15, rtol=1e-14)
        return float(np.linalg.norm(_about(x, "RP", "SR", rocker) - POINTS["SC"]))


def _about(axis: Array, at: str, point: str, angle: float) -> Array:
    turn = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).as_matrix()
    return np.asarray(POINTS[at] + turn @ (POINTS[point] - POINTS[at]))


@cache
def _solved(travel: float, rack: float) -> tuple[Array, Array]:
    arms = (("LB", "LF"), ("LB", "LR"), ("UB", "UF"), ("UB", "UR"))
    return Links(POINTS, arms, ("TO", "TI"), "W").pose(travel, rack)


@pytest.fixture(scope="module")
def axle() -> AxleKinematics:
    return find_kinematics(MODELS / "axle.yaml", travel=0.03, steer_travel=0.015, points=7)


def left_corners(found: AxleKinematics) -> Iterator[tuple[str, int, Corner]]:
    for name, columns in found.sweeps.items():
        yield from ((name, i, Corner(t, s)) for i, (t, s) in enumerate(zip(columns["left.travel"], columns["steer"], strict=True)))


def slope(value: Callable[[Corner], Array | float], at: Corner, *, rack: bool = False) -> Array:
    """The derivative by the travel or the rack, by differences of the fourth order."""
    h = 3e-4
    moved = {k: np.asarray(value(Corner(at.travel + k * h * (not rack), at.rack + k * h * rack))) for k in (-2, -1, 1, 2)}
    return np.asarray((8 * (moved[1] - moved[-1]) - moved[2] + moved[-2]) / (12 * h))


#: Errors of differences of the fourth order: 1e-12 of rounding by the step, and h^4/30 times a fifth derivative, of the coilover 3e7 1/m^4.
DIFFERENCES = 2e-8


def test_wheels_stand_as_the_links_say(axle: AxleKinematics) -> None:
    for name, i, corner in left_corners(axle):
        columns, e = axle.sweeps[name], corner.outward
        assert columns["left.camber"][i] == pytest.approx(-np.arcsin(e[2]), abs=1e-10)
        assert columns["left.toe"][i] == pytest.approx(np.arctan2(e[0], e[1]), abs=1e-10)
        if name == "travel":
            assert columns["track"][i] == pytest.approx(2 * corner.contact[1], abs=1e-10)
        mirrored = axle.sweeps[name]["right.camber"][::-1] if name != "travel" else columns["right.camber"]
        assert columns["left.camber"][i] == pytest.approx(mirrored[i], abs=1e-10)


def test_the_steering_axis_leads_through_the_balls(axle: AxleKinematics) -> None:
    """With the coilover at its length the arms stand still, and the upright turns about the line through its two balls."""
    for name, i, corner in left_corners(axle):
        columns, lower, upper = axle.sweeps[name], corner.place("LB"), corner.place("UB")
        k, ground, e = upper - lower, corner.contact, corner.outward
        assert columns["left.caster"][i] == pytest.approx(np.arctan2(-k[0], k[2]), abs=1e-9)
        assert columns["left.kingpin_inclination"][i] == pytest.approx(np.arctan2(-k[1], k[2]), abs=1e-9)
        offset = lower + k * (ground[2] - lower[2]) / k[2] - ground
        outward = np.array([e[0], e[1], 0]) / np.hypot(e[0], e[1])
        assert columns["left.scrub_radius"][i] == pytest.approx(-offset @ outward, abs=1e-9)
        assert columns["left.caster_trail"][i] == pytest.approx(offset @ [outward[1], -outward[0], 0], abs=1e-9)


def test_rates_are_those_of_the_links(axle: AxleKinematics) -> None:
    for name, i, corner in left_corners(axle):
        columns = axle.sweeps[name]
        if name == "travel":
            path = slope(lambda c: c.contact, corner)
            assert columns["roll_centre_height"][i] == pytest.approx(corner.contact[1] * path[1] / path[2], abs=DIFFERENCES)
            centre = slope(lambda c: c.place("W"), corner)
            assert np.tan(columns["left.drive_support_angle"][i]) == pytest.approx(centre[0], abs=DIFFERENCES)
            fixed = np.linalg.solve(corner.pose[0], corner.contact - corner.pose[1])
            point = slope(lambda c, fixed=fixed: c.pose[0] @ fixed + c.pose[1], corner)  # type: ignore[misc]
            assert np.tan(columns["left.brake_support_angle"][i]) == pytest.approx(point[0] / point[2], abs=DIFFERENCES)
            ratio = slope(lambda c: c.spring, corner)
            assert columns["left.coilover.motion_ratio"][i] == pytest.approx(-ratio, abs=DIFFERENCES)
            steered = slope(lambda c: np.arctan2(-c.outward[0], c.outward[1]), corner, rack=True)
            assert columns["steering_ratio"][i] == pytest.approx(1 / steered, abs=DIFFERENCES)


def test_ackermann_is_one_where_the_wheels_roll_about_one_point() -> None:
    """The angles of the Iltis' front wheels, their difference by that of wheels about a point on the rear axle's line."""
    found = find_kinematics(MODELS / "iltis.yaml", axle="front", points=3)
    columns = found.sweeps["steer"]
    assert np.isnan(columns["ackermann"][1])
    outer, inner = sorted([abs(columns["left.toe"][2]), abs(columns["right.toe"][2])])
    wheelbase = 0.970 + 1.047
    radius = wheelbase / np.tan(inner)
    grounds = columns["track"][2] * np.cos(columns["roll"][2])
    ideal = np.arctan(wheelbase / (radius + grounds))
    assert columns["ackermann"][2] == pytest.approx((inner - outer) / (inner - ideal), rel=1e-9)


# The command


def test_the_command_draws_a_picture_of_each_sweep(tmp_path: Path) -> None:
    done = CliRunner().invoke(main, ["kinematics", str(MODELS / "axle.yaml"), "--points", "3", "--plots", str(tmp_path)])
    assert done.exit_code == 0, done.output
    assert sorted(p.name for p in tmp_path.iterdir()) == ["roll.png", "steer.png", "travel.png"]


def test_the_command_writes_a_table(tmp_path: Path) -> None:
    out = tmp_path / "axle.csv"
    done = CliRunner().invoke(main, ["kinematics", str(MODELS / "axle.yaml"), "--points", "3", "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert sorted(p.name for p in tmp_path.iterdir()) == ["axle.csv", "axle.units.json"]
    head, *rows = out.read_text(encoding="utf-8").splitlines()
    assert {row.partition(",")[0] for row in rows} == {"travel", "roll", "steer"}
    found = find_kinematics(MODELS / "axle.yaml", points=3)
    values = [float(x) for x in rows[-1].split(",")[1:]]
    assert values == [pytest.approx(found.sweeps["steer"][c][-1], nan_ok=True) for c in head.split(",")[1:]]


@pytest.mark.parametrize(("model", "words", "text"), [
    ("press", [], "no axle: no pair of forces of kind tyre or wheel, or called tyre, stands left and right of y = 0"),
    ("iltis", [], "--axle is one of front, rear, or two bodies that carry wheels"),
    ("iltis", ["--axle", "middle"], "no axle 'middle'; --axle is one of front, rear"),
    ("iltis", ["--axle", "front_left.carrier,nobody"], "--axle: no body 'nobody'"),
    ("iltis", ["--axle", "front_left.carrier,front_left.carrier"], "give two bodies, the left one and the right one; a single corner"),
    ("iltis", ["--axle", "front_right.carrier,front_left.carrier"], "is not left of that of 'front_left.carrier'; exchange them"),
    ("car", ["--axle", "front", "--steer", "rack"], "--steer rack: the axle has no such joint with one coordinate; it has"),
    ("axle", ["--steer", "left.rocker_hinge"], "its joints do not let the left wheel and the steering joint move by themselves"),
])  # fmt: skip
def test_what_an_axle_lacks_is_said(model: str, words: list[str], text: str) -> None:
    done = CliRunner().invoke(main, ["kinematics", str(MODELS / f"{model}.yaml"), *words])
    assert done.exit_code == 1
    assert text in " ".join(done.output.split())


def test_a_rack_without_a_guide_is_found_or_asked_for(tmp_path: Path) -> None:
    """It is the only slider along y on the chassis; one that rises to the side steers where it is named."""
    text = (MODELS / "axle.yaml").read_text(encoding="utf-8").replace(", guide: steer", "")
    file, slide = tmp_path / "axle.yaml", "at: [0.07, 0, 0.14], axis: [0, 1, 0]}"
    assert text.count(slide) == 1
    file.write_text(text, encoding="utf-8")
    found = CliRunner().invoke(main, ["kinematics", str(file), "--points", "3"])
    assert ["steered", "by", "rack_slide"] in [line.split() for line in found.output.splitlines()]
    file.write_text(text.replace(slide, slide.replace("[0, 1, 0]", "[0, 1, 0.2]")), encoding="utf-8")
    done = CliRunner().invoke(main, ["kinematics", str(file)])
    assert "its wheels move although their heights are prescribed" in done.output
    assert CliRunner().invoke(main, ["kinematics", str(file), "--points", "3", "--steer", "rack_slide"]).exit_code == 0


def test_a_sweep_ends_where_the_loops_do_not_close() -> None:
    found = find_kinematics(MODELS / "axle.yaml", travel=0.06, points=5)
    assert found.limits == (
        "travel: the loops do not close beyond -0.03 m of -0.06 m", "roll: the loops do not close beyond -0.03 m of -0.06 m",
        "roll: the loops do not close beyond 0.03 m of 0.06 m",
    )  # fmt: skip
