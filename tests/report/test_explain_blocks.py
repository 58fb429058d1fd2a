"""Formulas of forces that `explain` prints, read back, have the values of closed forms and of the compiler."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from cutjoint.elements.interaction import Mechanics
from cutjoint.elements.interactions import LineForce
from cutjoint.elements.interactions.road_contact import calspan
from cutjoint.model.read import read_model_text
from cutjoint.program.blocks import BindingTime, Block, Builder
from cutjoint.program.interpret import interpret_blocks
from cutjoint.report.explain.document import explain

MODEL = """
cutjoint: 1
name: forces
gravity: [0, 0, -9.81]
bodies:
  arm: {mass: 2, centre_of_mass: [1, 0, 0], inertia: [0.1, 0.2, 0.3]}
  wheel: {mass: 1, centre_of_mass: [1, 0, 1], inertia: [0.1, 0.2, 0.1]}
joints:
  pin: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: [0, 1, 0]}
  hub: {kind: revolute, bodies: [arm, wheel], at: [1, 0, 1], axis: [0, 1, 0]}
forces:
  spring: {kind: point_spring, bodies: [ground, arm], from: [0, 0, 1], to: [1, 0, 0.5], law: 30*(length - 0.2) + 2*rate}
  foot:
    kind: contact
    bodies: [ground, arm]
    at: [0, 0, -1]
    normal: z
    centre: [1, 0, -0.5]
    radius: 0.3
    force: [-vx, -0.5*vy, 100*deflection + 3*deflection_rate]
  gust: {kind: load, body: arm, at: [1, 0, 0], force: [0, "exp(-vx)", 0]}
  ram: {kind: axial_force, bodies: [arm, wheel], origin: [0.5, 0, 0], point: [1, 0, 0.8], axis: [1, 0, 0], law: 5 - 3*travel}
  tyre:
    kind: tyre
    body: wheel
    centre: [1, 0, 1]
    axis: y
    radius: 0.364
    stiffness: 460000
    calspan: {A0: 2625, A1: 14.47, A2: 12930, A3: 2.29, A4: 18175, B1: -4.64e-5, B3: 1.216, B4: 2.18e-11, SN: 1.0274, AF1: -1.71e-5,
              AF2: 1.71e-5}
scenes: {fall: {end: 1}}
"""

TOKEN = re.compile(r"\\begin\{\w+\}|\\end\{\w+\}|\\text\{[^}]*\}|\\[A-Za-z]+|[\d.]+(?:e-?\d+)?|[A-Za-z]|\S")


class Reading:
    """A reader of printed formulas with numbers for their letters."""

    def __init__(self, text: str, values: dict[str, Any]) -> None:
        plain = re.sub(r"\\left\b|\\right\b", "", re.sub(r" \\cdot 10\^{(-?\d+)}", r"e\1", text))
        self._tokens, self._values = [*TOKEN.findall(plain), "$"], values

    @property
    def _next(self) -> str:
        return self._tokens[0]

    def _take(self, *expected: str) -> str:
        assert not expected or self._next in expected, self._tokens
        return self._tokens.pop(0)

    def _braced(self, read: Callable[[], Any] | None = None) -> Any:
        self._take("{", "(")
        value = (read or self.sum)()
        self._take("}", ")")
        return value

    def sum(self) -> Any:
        sign = -1 if self._next == "-" and self._take() else 1
        value = sign * self._vectors()
        while self._next in ("+", "-"):
            value = value + self._vectors() if self._take() == "+" else value - self._vectors()
        return value

    def _vectors(self) -> Any:
        value = self._product()
        while self._next in (r"\cdot", r"\times"):
            value = np.dot(value, self._product()) if self._take() == r"\cdot" else np.cross(value, self._product())
        return value

    def _product(self) -> Any:
        value = self._power()
        while re.match(r"\\(?!cdot|times|lt|le\b|cr|end|rVert|rvert|text\{if |text\{otherwise)|[\w(]", self._next):
            other = self._power()
            value = value @ other if np.ndim(value) == 2 and np.ndim(other) else value * other
        return value

    def _power(self) -> Any:
        value = self._one()
        if self._next == "^":
            self._take()
            exponent = self._braced(self._take) if self._next == "{" else self._take()
            value = np.dot(value, value) if exponent == "2" else np.transpose(value)
        return value

    def _one(self) -> Any:
        token = self._take()
        match token:
            case r"\frac":
                return self._braced() / self._braced()
            case r"\sqrt":
                return np.sqrt(self._braced())
            case r"\lVert" | r"\lvert":
                value = np.linalg.norm(self.sum())
                self._take(r"\rVert", r"\rvert")
                return value
            case "(":
                value = self.sum()
                self._take(")")
                return value
            case r"\begin{cases}":
                return self._cases()
            case r"\begin{bmatrix}":
                rows = [self.sum()]
                while self._take(r"\cr", r"\end{bmatrix}") == r"\cr":
                    rows.append(self.sum())
                return np.concatenate([np.broadcast_to(x, 3) for x in rows]) if any(map(np.ndim, rows)) else np.array(rows)
        if token[0].isdigit():
            return float(token)
        return self._named(token)

    def _cases(self) -> Any:
        chosen = None
        while True:
            value = self.sum()
            self._take("&")
            if self._take().startswith(r"\text{if"):
                left, mark, right = self.sum(), self._take(r"\lt", r"\le"), self.sum()
                holds = left < right if mark == r"\lt" else left <= right
            else:
                holds = True
            chosen = value if chosen is None and holds else chosen
            if self._take(r"\cr", r"\end{cases}") != r"\cr":
                return chosen

    def _named(self, token: str) -> Any:
        if token == r"\dot":
            token += self._braced(self._name)
        elif self._next == "_":
            token += self._name("")
        if self._next == "(" and callable(self._values.get(token)):
            return self._values[token](*self._braced(self._arguments))
        if token not in self._values and "," in token:
            stem, _, axis = token.removesuffix("}").rpartition(",")
            return self._values[stem + ("}" if "{" in stem else "")]["xyz".index(axis)]
        return self._values[token]

    def _arguments(self) -> list[Any]:
        found = [self.sum()]
        while self._next == ",":
            self._take()
            found.append(self.sum())
        return found

    def _name(self, start: str | None = None) -> str:
        name = self._take() if start is None else start
        while self._next in ("_", "{"):
            name += self._take()
            if name.endswith("{"):
                while self._next != "}":
                    name += self._take()
                name += self._take()
            elif name.endswith("_") and self._next != "{":
                name += self._take()
        return name


def chapter(kind: str, method: str = "recursive") -> list[str]:
    """The formulas of a kind of force."""
    model = read_model_text(MODEL, "forces.yaml")
    text = explain(model, model.scenes["fall"], method).partition(f"#### {kind}:")[2].partition("####")[0]
    return re.findall(r"^\$\$\n(.*)\n\$\$$", text, re.MULTILINE)


def read(formulas: list[str], values: dict[str, Any]) -> tuple[dict[str, Any], list[np.ndarray]]:
    """The values of all that is defined but not given, and what joins Q, in the order of its lines."""
    equations, joins = [], []
    for line in formulas:
        plain = re.sub(r"^\\begin{aligned} | \\end{aligned}$", "", line)
        if r"\leftarrow" in plain:
            joins.append(re.sub(r"^.*?leftarrow \S+ (\+ )?", "", plain))
        elif r"\partial" not in plain:
            equations += re.split(r" \\cr (?=(?:\\text\{[^}]*\}|\S+) &= )", plain)
    for _ in equations:  # laws stand behind what uses them
        for equation in equations:
            left, right = re.split(r" &?= ", equation, maxsplit=1)
            name = "".join(TOKEN.findall(re.sub(r"\(.*", "", left)))
            if name not in values:
                with contextlib.suppress(KeyError):
                    values[name] = Reading(right, values).sum()
    return values, [Reading(line, values).sum() for line in joins]


def vectors(*names: str) -> dict[str, np.ndarray]:
    """Three numbers each."""
    rng = np.random.default_rng(3)
    return {name: rng.uniform(0.5, 1.5, 3) * (1 + i) for i, name in enumerate(names)}


def wrench(at: np.ndarray, force: np.ndarray) -> np.ndarray:
    return np.concatenate([force, np.cross(at, force)])


def test_a_spring_between_two_points() -> None:
    given = vectors("p_{start}", "p_{end}", r"\dotp_{start}", r"\dotp_{end}")
    start, end, v_start, v_end = given.values()
    found, (follower, base) = read(chapter("Point spring"), dict(given))
    length = np.linalg.norm(end - start)
    n = (end - start) / length
    law = 30 * (length - 0.2) + 2 * n @ (v_end - v_start)
    assert found["F"] == pytest.approx(law)
    assert follower == pytest.approx(wrench(end, -law * n))
    assert base == pytest.approx(-follower)


def test_forces_on_points_do_the_work_of_the_wrenches() -> None:
    """Both bodies move about the pole, and the axis with the base."""
    given = vectors("p_{point}", "p_{origin}", "e_{axis}", r"\omega_{base}", r"\omega_{follower}", "v_{base}", "v_{follower}")
    end, start, axis, w_base, w_follower, v_base, v_follower = given.values()
    _, (follower, base) = read(chapter("Axial force"), dict(given))
    found, (on_end, on_start, on_axis) = read(chapter("Axial force", "augmented"), dict(given))
    assert found["F"] == pytest.approx(5 - 3 * axis @ (end - start))
    power = on_end @ (v_follower + np.cross(w_follower, end)) + on_start @ (v_base + np.cross(w_base, start))
    power += on_axis @ np.cross(w_base, axis)
    assert power == pytest.approx(follower @ [*v_follower, *w_follower] + base @ [*v_base, *w_base])


def test_a_spring_on_points() -> None:
    given = vectors("p_{start}", "p_{end}", r"\dotp_{start}", r"\dotp_{end}")
    _, (follower, _) = read(chapter("Point spring"), dict(given))
    _, (on_end, on_start) = read(chapter("Point spring", "augmented"), dict(given))
    assert on_end == pytest.approx(follower[:3])
    assert on_start == pytest.approx(-on_end)


def test_quantities_that_no_law_reads_are_not_printed() -> None:
    """``exp`` has an x, and vx another."""
    definitions = chapter("Load")[0]
    assert "v_x &=" in definitions
    assert not re.search(r"(^|\W)(x|y|z|v_y|v_z) &=", definitions)


def test_a_ball_on_a_plane() -> None:
    given = vectors("p_{start}", "p_{centre}", r"\dotp_{start}", r"\dotp_{centre}", r"\omega_{base}", r"\omega_{follower}")
    start, centre, v_start, v_centre, w_base, w_follower = given.values()
    n, e_x = np.array([0, 0, 1.0]), np.array([1.0, 0, 0])
    centre[:] = start + np.array([0.3, 0.2, 0.1])
    constants = {"e_{normal}": n, "e_{along}": e_x, r"\text{ ball }": 0.3}
    _, (follower, base) = read(chapter("Contact"), {**given, **constants})
    touching = centre - 0.1 * n
    v = v_centre + np.cross(w_follower, touching - centre) - v_start - np.cross(w_base, touching - start)
    force = np.array([-v[0], -0.5 * v[1], 100 * 0.2 - 3 * v[2]])
    assert follower == pytest.approx(wrench(touching, force))
    assert base == pytest.approx(wrench(touching, -force))


CONSTANTS = {"A0": 2625, "A1": 14.47, "A2": 12930, "A3": 2.29, "A4": 18175, "B1": -4.64e-5, "B3": 1.216, "B4": 2.18e-11, "SN": 1.0274,
             "AF1": -1.71e-5, "AF2": 1.71e-5}  # fmt: skip


@pytest.mark.parametrize(("load", "slip", "camber"), [(3000.0, 0.02, 0.01), (6000.0, -0.04, 0.03), (15000.0, 0.3, -0.02)])
def test_the_printed_tyre_is_the_compiled_one(load: float, slip: float, camber: float) -> None:
    b = Builder()
    column = b.symbol("x", 3, BindingTime.ITERATION)
    results = calspan(b, {n: b.number(c) for n, c in CONSTANTS.items()}, *(b.element(column, i) for i in range(3)))
    computed = interpret_blocks(results, {"x": np.array([load, slip, camber])}, {})
    given = {"F_z": load, r"\text{ slip }": slip, r"\text{ camber }": camber, "v_x": 8.0, "e_{axis}": np.array([0, 1.0, 0])}
    given |= {rf"\text{{ {name} }}": value for name, value in CONSTANTS.items()}
    given |= {rf"\text{{ road {name} }}": lambda x, y: 0.1 for name in ("height", "slope")} | {r"\text{atan}": np.arctan}
    given |= {rf"\text{{ {name} }}": 0.4 for name in ("radius", "stiffness", "spin inertia")} | vectors("p_{centre}", r"\dotp_{centre}")
    found, _ = read(chapter("Tyre"), {**given, r"\dote_{axis}": np.zeros(3)})
    assert found["F_y"] == pytest.approx(float(computed[results[0]][0, 0]), rel=1e-6)
    assert found["M_z"] == pytest.approx(float(computed[results[1]][0, 0]), rel=1e-6)


def test_what_a_force_computes_is_what_is_printed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The spring pulls three times as much: nothing but its equations is changed."""
    before = chapter("Point spring")

    def act(self: LineForce, force: Any, m: Mechanics) -> dict[str, Block]:
        n, values = self._stretch(m)
        law = m.law(force.law, values, self.position)
        m.apply_force_pair(self.start, self.end, m.b.neg(m.b.scale(m.b.mul(m.b.number(3.0), law["force"]), n)))
        return {**law, **values}

    monkeypatch.setattr(LineForce, "act", act)
    after = chapter("Point spring")
    assert r"-3 F n" in after[0]
    assert before[0] == after[0].replace("3 F", "F")
    assert before[1:] == after[1:]


def test_a_spring_off_the_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """A quantity that is computed another way is printed that way."""
    stretch = LineForce._stretch

    def longer(self: LineForce, m: Mechanics) -> tuple[Block, dict[str, Block]]:
        n, values = stretch(self, m)
        return n, {**values, "length": m.b.add(values["length"], m.b.number(0.25))}

    monkeypatch.setattr(LineForce, "_stretch", longer)
    assert r"\text{ length } &= \lVert p_{end} - p_{start} \rVert + 0.25" in chapter("Point spring")[0]


def test_a_quantity_that_is_a_number_is_printed(monkeypatch: pytest.MonkeyPatch) -> None:
    stretch = LineForce._stretch

    def held(self: LineForce, m: Mechanics) -> tuple[Block, dict[str, Block]]:
        n, values = stretch(self, m)
        return n, {**values, "length": m.b.number(0.25)}

    monkeypatch.setattr(LineForce, "_stretch", held)
    formulas = chapter("Point spring")
    assert r"\text{ length } = 0.25" in formulas
    assert any(line.startswith(r"F(\text{ length }, \text{ rate }) =") for line in formulas)
