"""Mass, centre and inertia of bodies: any frame, any point, and shapes; the oracle is a cubature of points that is exact for them."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from cutjoint.model.elements.mass import can_exist
from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.expressions.parse import parameter_symbol
from cutjoint.model.records import Body

from .pendulum import check, problem, read

MASS = "mass: arm_mass, centre_of_mass: [1, 0, 0], inertia: [0.1, 0.2, 0.2]"
FRAME = np.array([[2, 2, 1], [-2, 1, 2], [1, -2, 2]]).T / 3  # columns: x, y, z
AXES = dict(zip("xyz", FRAME.T.tolist(), strict=True))
ENTRIES = ((0, 0, 0, 1, 1, 2), (0, 1, 2, 1, 2, 2))

Points = list[tuple[float, np.ndarray]]


def body(arm: dict[str, Any]) -> Body:
    return read(MASS, json.dumps(arm)[1:-1]).bodies[0]


def numbers(found: Body, values: dict[Any, float] | None = None) -> tuple[float, np.ndarray, np.ndarray]:
    def number(expression: Any) -> float:
        return evaluate(expression, values or {})

    xx, yy, zz, xy, xz, yz = map(number, found.inertia)
    return number(found.mass), np.array(list(map(number, found.centre_of_mass))), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def of_points(points: Points) -> tuple[float, np.ndarray, np.ndarray]:
    mass = sum(m for m, _ in points)
    centre = sum(m * p for m, p in points) / mass
    arms = [(m, p - centre) for m, p in points]
    return mass, centre, sum(m * (d @ d * np.eye(3) - np.outer(d, d)) for m, d in arms)


def assert_same(found: tuple[float, np.ndarray, np.ndarray], expected: tuple[float, np.ndarray, np.ndarray]) -> None:
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-13, atol=1e-14)


# Points with the moments of a shape up to the second


def cuboid(mass: float, sides: list[float], centre: list[float], turn: np.ndarray) -> Points:
    corners = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    return [(mass / 8, centre + turn @ (corner * sides / np.sqrt(12))) for corner in corners]


def cylinder(mass: float, radius: float, length: float, centre: list[float], turn: np.ndarray) -> Points:
    ring = [(np.cos(a), np.sin(a)) for a in 2 * np.pi * np.arange(5) / 5]
    return [
        (mass / 10, centre + turn @ [side * length / np.sqrt(12), radius * c / np.sqrt(2), radius * s / np.sqrt(2)])
        for side in (-1, 1) for c, s in ring
    ]  # fmt: skip


def ball(mass: float, radius: float, centre: list[float]) -> Points:
    return [(mass / 6, centre + sign * radius * np.sqrt(3 / 5) * axis) for axis in np.eye(3) for sign in (-1, 1)]


def rod(mass: float, start: list[float], end: list[float]) -> Points:
    middle, half = (np.array(start) + end) / 2, (np.array(end) - start) / 2
    return [(mass / 2, middle + sign * half / np.sqrt(3)) for sign in (-1, 1)]


BOX, CENTRE = [0.2, 0.3, 0.5], [0.1, 0.2, 0.3]
SHAPES: dict[str, tuple[dict[str, Any], Points]] = {
    "box": ({"box": BOX, "density": 1000, "at": CENTRE}, cuboid(30, BOX, CENTRE, np.eye(3))),
    "turned box": ({"box": BOX, "mass": 3, "at": CENTRE, "x": AXES["x"], "y": AXES["y"]}, cuboid(3, BOX, CENTRE, FRAME)),
    "box by x and z": ({"box": BOX, "mass": 3, "at": CENTRE, "x": AXES["x"], "z": AXES["z"]}, cuboid(3, BOX, CENTRE, FRAME)),
    "cylinder": (
        {"cylinder": {"radius": 0.1, "length": 0.4}, "density": 500, "at": CENTRE, "axis": AXES["x"]},
        cylinder(500 * np.pi * 0.004, 0.1, 0.4, CENTRE, FRAME),
    ),
    "sphere": ({"sphere": 0.3, "density": 100, "at": CENTRE}, ball(400 * np.pi * 0.009, 0.3, CENTRE)),
    "rod": ({"rod": {"from": CENTRE, "to": [1, -1, 2]}, "mass": 2}, rod(2, CENTRE, [1, -1, 2])),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_one_shape(shape: str) -> None:
    part, points = SHAPES[shape]
    assert_same(numbers(body({"shapes": [part]})), of_points(points))


def test_shapes_make_a_body_together() -> None:
    parts = [part for part, _ in SHAPES.values()] + [{"point": [2, 3, 4], "mass": 0.7}]
    points = [point for _, points in SHAPES.values() for point in points] + [(0.7, np.array([2.0, 3.0, 4.0]))]
    assert_same(numbers(body({"shapes": parts})), of_points(points))


def test_holes_take_mass_away() -> None:
    """A box with a box cut from its end is the rest of the box."""
    steel = {"density": 7850}
    whole = {"box": [3, 1, 1], "at": [1.5, 0, 0], **steel}
    end = {"box": [1, 1, 1], "at": [2.5, 0, 0], "hole": True, **steel}
    rest = {"box": [2, 1, 1], "at": [1, 0, 0], **steel}
    assert_same(numbers(body({"shapes": [whole, end]})), numbers(body({"shapes": [rest]})))


def test_shapes_may_depend_on_parameters() -> None:
    found = body({"shapes": [{"sphere": "arm_mass/4", "density": 3, "at": CENTRE}, {"point": [0, 0, 0], "mass": "arm_mass"}]})
    values = {parameter_symbol("arm_mass"): 2.0}
    assert_same(numbers(found, values), of_points([*ball(4 * np.pi / 8, 0.5, CENTRE), (2.0, np.zeros(3))]))


# Frames and points


@pytest.mark.parametrize("form", ["matrix", "framed", "principal"])
def test_inertia_about_any_point(form: str) -> None:
    points = cuboid(3, BOX, CENTRE, FRAME)
    if form != "principal":
        points.append((0.5, np.array([0.4, 0.5, -0.2])))
    mass, centre, own = of_points(points)
    about = np.array([-0.3, 0.7, 0.2]) if form != "principal" else centre + 0.4 * FRAME[:, 2]
    arm = about - centre
    J = own + mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    turned = FRAME.T @ J @ FRAME
    inertia = {
        "matrix": J[ENTRIES[0], ENTRIES[1]][[0, 3, 5, 1, 2, 4]].tolist(),
        "framed": {"matrix": turned[ENTRIES[0], ENTRIES[1]][[0, 3, 5, 1, 2, 4]].tolist(), "y": AXES["y"], "z": AXES["z"]},
        "principal": {"principal": np.diag(turned).tolist(), "x": AXES["x"], "y": AXES["y"]},
    }[form]
    found = numbers(body({"mass": mass, "centre_of_mass": centre.tolist(), "inertia": inertia, "about": about.tolist()}))
    assert_same(found, (mass, centre, own))


PROBLEMS = [
    ("mass: 2, centre_of_mass: [1, 0, 0], inertia: [0.1, 1, 1], about: §[0, 0, 0]",
     "@: body 'arm': no body has this inertia about this point; about its centre of mass a principal moment of inertia is "
     "negative: -1, -1, 0.1 kg m2; check about and mass"),
    ("mass: 2, centre_of_mass: [1, 0, 0], about: [0, 0, 0]",
     "11:3: body 'arm': 'about' belongs to an inertia; add inertia, or remove about"),
    ("shapes: [{sphere: 1, mass: 1, at: [0, 0, 0]}], mass: 1", "11:3: body 'arm': its shapes give mass, centre and inertia; remove mass"),
    ("shapes: §[]", "@: body 'arm': shapes needs at least 1 item, got 0"),
    ("shapes: [§{cube: 1}]", "@: body 'arm': shapes needs one of box, cylinder, sphere, rod, point"),
    ("shapes: [§{sphere: 1, at: [0, 0, 0]}]", "@: body 'arm': shapes needs either density or mass"),
    ("shapes: [{sphere: §-1, mass: 1, at: [0, 0, 0]}]", "@: body 'arm': shapes: sphere must be greater than zero"),
    ("shapes: [{sphere: 1, density: §-1, at: [0, 0, 0]}]",
     "@: body 'arm': shapes: density must be greater than zero; write hole: true for what is missing"),
    ("shapes: [{sphere: 1, density: §1 kg, at: [0, 0, 0]}]", "@: body 'arm': shapes.density needs kg/m^3, got kg"),
    ("shapes: §[{sphere: 1, mass: 1, at: [0, 0, 0], hole: true}]", "@: body 'arm': the shapes have no mass: -1 kg together"),
    ("shapes: [{rod: {from: [0, 0, 0], to: §[0, 0, 0]}, mass: 1}]", "@: body 'arm': from and to are the same point; a rod has two ends"),
    ("shapes: [{box: [1, 1, 1], mass: 1, at: [0, 0, 0], x: [1, 0, 0], z: §[1, 0, 1]}]",
     "@: body 'arm': the directions x and z are not perpendicular"),
]  # fmt: skip


@pytest.mark.parametrize(("new", "expected"), PROBLEMS)
def test_problems(new: str, expected: str) -> None:
    check(MASS, new, expected)


def test_a_hole_larger_than_its_body_has_no_inertia() -> None:
    shapes = "shapes: [{point: [0, 0, 0], mass: 9}, {sphere: 1, mass: 1, at: [0, 0, 0], hole: true}]"
    assert "a principal moment of inertia is negative" in problem(MASS, shapes)


def test_many_bodies_at_once() -> None:
    """Bodies beside points with masses of either sign: the signs of their second moments tell impossible inertias."""
    random = np.random.default_rng(5)
    directions = np.linalg.qr(random.normal(size=(400, 3, 3)))[0]
    seconds = random.uniform(-0.3, 1, (400, 3))  # sums of m x^2 along three directions
    around = directions @ ((seconds.sum(axis=1)[:, None] - seconds)[:, :, None] * directions.transpose(0, 2, 1))
    masses = random.choice([2.0, 0.0, -1.0, np.nan, 1e51], 400, p=[0.6, 0.2, 0.1, 0.05, 0.05])
    inertias = around[:, [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    inertias[::37, 4] = np.inf
    positive, sums = (seconds >= 0).all(axis=1), np.stack([seconds[:, i] + seconds[:, j] for i, j in ((0, 1), (0, 2), (1, 2))])
    expected = np.where(masses == 2, positive, (masses == 0) & (sums >= 0).all(axis=0)) & np.isfinite(inertias).all(axis=1)
    assert np.array_equal(can_exist(masses, inertias), expected)
    assert len(can_exist(np.zeros(0), np.zeros((0, 6)))) == 0
