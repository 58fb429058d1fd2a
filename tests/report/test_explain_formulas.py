"""Every formula that `explain` prints, read back, has the value of the block that is compiled."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy

from cutjoint.compile.systems import formulate_system
from cutjoint.elements.interaction import Mechanics
from cutjoint.elements.interactions.line_force import LineForce
from cutjoint.formulate.inputs import TIME
from cutjoint.formulate.records import Equations
from cutjoint.methods import METHODS
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import Model, Scene
from cutjoint.program.blocks import Block
from cutjoint.program.interpret import interpret_blocks
from cutjoint.program.lower import reachable_blocks
from cutjoint.report.explain import views
from cutjoint.report.explain.document import derive, explain, printed
from cutjoint.run.scenes import find_scene
from cutjoint.topology.build import build_topology
from tests.conftest import MODELS
from tests.mechanisms import random_models

Array = np.ndarray

#: What is left of a formula after its names: commands, numbers, braces.
_TOKEN = r"\\begin\{\w+\}|\\end\{\w+\}|\\mathbf\{1\}|\\text\{[^}]*\}|\\[A-Za-z]+|\d[\d.]*(?:e-?\d+)?|\S"

_MARK = r"[\d:,]+"

#: Commands behind a value.
_BEHIND = r"\\end|\\text\{(if|otherwise| and| or)"


class Reading:
    """A reader of printed formulas: all values are matrices, and a scalar among matrices is a multiple of the unit matrix."""

    def __init__(self, values: dict[str, Array], functions: dict[str, Callable[..., float]]) -> None:
        self._values, self._functions = values, functions
        self._names = re.compile("|".join([*(self._pattern(name) for name in sorted(values, key=len, reverse=True)), _TOKEN]))

    @staticmethod
    def _pattern(name: str) -> str:
        if name.endswith(" }"):
            return re.escape(name[:-2]) + rf"(?:, {_MARK})? \}}"
        return re.escape(name[:-1]) + rf"(?:,{_MARK})?\}}" if name.endswith("}") else re.escape(name) + rf"(?:_\{{{_MARK}\}})?(?!\w)"

    def value(self, text: str) -> Array:
        self._tokens = [*self._names.findall(re.sub(r"\\left\b|\\right\b", "", re.sub(r" \\cdot 10\^{(-?\d+)}", r"e\1", text))), "$"]
        value = self._sum()
        assert self._tokens == ["$"], self._tokens
        return value

    @property
    def _next(self) -> str:
        return self._tokens[0]

    def _take(self, *expected: str) -> str:
        assert not expected or self._next in expected, self._tokens
        return self._tokens.pop(0)

    def _inside(self, start: str = "{", end: str = "}") -> Array:
        self._take(start)
        value = self._sum()
        self._take(end)
        return value

    def _sum(self) -> Array:
        sign = -1 if self._next == "-" and self._take() else 1
        value = sign * self._vectors()
        while self._next in ("+", "-"):
            sign = 1 if self._take() == "+" else -1
            value, other = _alike(value, self._vectors())
            value = value + sign * other
        return value

    def _vectors(self) -> Array:
        value = self._product()
        while self._next in (r"\cdot", r"\times"):
            if self._take() == r"\times":
                value = np.cross(value.ravel(), self._product().ravel())[:, None]
            else:
                other = self._product()
                value = value * other if 1 in (value.size, other.size) else value.T @ other
        return value

    def _product(self) -> Array:
        value = self._power()
        ends = (r"\cdot", r"\times", r"\lt", r"\le", r"\cr", r"\rvert")
        while self._next[0] not in "+-)}&,$" and self._next not in ends and not re.match(_BEHIND, self._next):
            other = self._power()
            value = value * other if 1 in (value.size, other.size) else value @ other
        return value

    def _power(self) -> Array:
        value = self._one()
        while self._next == "^":
            self._take()
            if self._next == "T":
                self._take()
                value = value.T
                continue
            self._take("{")
            if self._tokens[:3] == ["-", "T", "}"]:
                value, self._tokens = np.linalg.inv(value).T, self._tokens[3:]
                continue
            exponent = self._sum()
            self._take("}")
            value = np.linalg.inv(value) if value.size > 1 else value**exponent
        return value

    def _one(self) -> Array:
        token = self._take()
        if (name := self._named(token)) is not None:
            return name
        match token:
            case r"\frac":
                return self._inside() / self._inside()
            case r"\sqrt":
                return np.sqrt(self._inside())
            case r"\lvert":
                value = np.abs(self._sum())
                self._take(r"\rvert")
                return value
            case r"\tilde":
                x, y, z = self._inside().ravel()
                return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
            case "(":
                self._tokens.insert(0, "(")
                return self._inside("(", ")")
            case r"\mathbf{1}":
                return np.ones((1, 1))
            case r"\text{diag}":
                return np.diag(self._inside("(", ")").ravel())
            case r"\text{L}":
                return _factor(self._inside("(", ")"))[0]
            case r"\text{D}":
                for _ in "^{-1}":
                    self._take()
                return 1 / _factor(self._inside("(", ")"))[1]
            case r"\begin{cases}":
                return self._cases()
            case r"\begin{bmatrix}":
                return self._matrix()
        if token == "1" and self._next == "_":
            size = int(self._tokens[2])
            self._tokens = self._tokens[4:]
            return np.eye(size)
        if token == "0" and self._next == "_":
            height, width = (int(self._tokens[i]) for i in (2, 4))
            self._tokens = self._tokens[6:]
            return np.zeros((height, width))
        if token[0].isdigit():
            return np.array([[float(token)]])
        return self._call(self._functions[token])

    def _named(self, token: str) -> Array | None:
        if token in self._values:
            return self._values[token]
        for cut in re.finditer(r", ?|_\{", token):
            found = re.fullmatch(rf"({_MARK})( ?\}}+)", token[cut.end() :])
            name = token[: cut.start()] + (found[2] if found and cut[0] != "_{" else "")
            if found and name in self._values:
                mark, value = found[1], self._values[name]
                break
        else:
            return None
        spans = [slice(int(a) - 1, int(b or a)) for a, _, b in (mark.partition(":") for mark in mark.split(","))]
        return value[tuple(spans)] if len(spans) == 2 else value[spans[0]] if value.shape[1] == 1 else value[:, spans[0]]

    def _call(self, function: Callable[..., float]) -> Array:
        self._take("(")
        arguments = [self._sum()]
        while self._next == ",":
            self._take()
            arguments.append(self._sum())
        self._take(")")
        return np.array([[function(*(x.item() for x in arguments))]])

    def _cases(self) -> Array:
        chosen = None
        while True:
            value = self._sum()
            self._take("&")
            holds = self._take(r"\text{if }", r"\text{otherwise}") != r"\text{if }" or self._condition()
            chosen = value if chosen is None and holds else chosen
            if self._take(r"\cr", r"\end{cases}") != r"\cr":
                assert chosen is not None
                return chosen

    def _condition(self) -> bool:
        if self._next == r"\neg":
            self._take()
            self._take("(")
            holds = not self._condition()
            self._take(")")
        elif (both := self._joined()) is not None:
            return both
        else:
            left, mark, right = self._sum().item(), self._take(r"\lt", r"\le"), self._sum().item()
            holds = left < right if mark == r"\lt" else left <= right
        return holds

    def _joined(self) -> bool | None:
        """Two conditions in brackets; None of one that begins with a bracket by chance."""
        before = list(self._tokens)
        if self._next == "(":
            try:
                self._take("(")
                left = self._condition()
                self._take(")")
                word = self._take(r"\text{ and }", r"\text{ or }")
                self._take("(")
                right = self._condition()
                self._take(")")
            except AssertionError:
                self._tokens = before
            else:
                return left and right if word == r"\text{ and }" else left or right
        return None

    def _matrix(self) -> Array:
        rows = [[self._sum()]]
        while (mark := self._take("&", r"\cr", r"\end{bmatrix}")) != r"\end{bmatrix}":
            if mark == "&":
                rows[-1].append(self._sum())
            else:
                rows.append([self._sum()])
        heights = [max(x.shape[0] for x in row) for row in rows]
        widths = [max(x.shape[1] for x in column) for column in zip(*rows, strict=True)]
        for _ in rows:  # a multiple of the unit matrix is as high as wide
            for i, row in enumerate(rows):
                for j, x in enumerate(row):
                    if x.size == 1 and x.item() != 0:
                        heights[i] = widths[j] = max(heights[i], widths[j])
        return np.block([
            [x * np.eye(h, w) if x.size == 1 else x if x.any() else np.zeros((h, w)) for x, w in zip(row, widths, strict=True)]
            for row, h in zip(rows, heights, strict=True)
        ])


def _alike(a: Array, b: Array) -> tuple[Array, Array]:
    shape = max(a.shape, b.shape)
    return tuple(x * np.eye(*shape) if x.size == 1 < np.prod(shape) else x for x in (a, b))  # type: ignore[return-value]


def _factor(m: Array) -> tuple[Array, Array]:
    """L and the column D of m = L D L^T."""
    lower = np.linalg.cholesky(m)
    root = np.diag(lower)
    return lower / root, (root**2)[:, None]


class Road:
    """Answers of a road that no formula repeats by chance."""

    def __getattr__(self, name: str) -> Callable[..., float]:
        return lambda x, y, *orders: 0.01 * len(name) + 0.003 * x - 0.002 * y + 0.05 * sum(map(float, orders))


def compare(equations: Equations) -> int:
    """Read every formula for random inputs; how many there were."""
    formulas = printed(equations)
    rng = np.random.default_rng(3)
    blocks = reachable_blocks(formulas.defined)
    inputs = {str(x.data): rng.uniform(0.2, 1.0, x.shape[0]) for x in blocks if x.op == "symbol"}
    inputs |= {name: x / np.linalg.norm(x) for name, x in inputs.items() if name.startswith("q:") and len(x) == 4}
    computed = interpret_blocks(blocks, inputs, _Roads())
    values = {name: computed[block] for block, name in formulas.names.items() if block in computed}
    reading = Reading(values, functions_of(blocks))
    for block in formulas.defined:
        text = formulas.define(block)
        expected = computed[block]
        found = np.broadcast_to(reading.value(text), expected.shape) if expected.size == 1 or text == "0" else reading.value(text)
        if found.size == 1:  # a multiple of the unit matrix
            found = found * np.eye(*expected.shape)
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9 * max(1.0, np.abs(expected).max())), (formulas.names[block], text)
    assert len(set(formulas.names.values())) == len(formulas.names)
    return len(formulas.defined)


class _Roads(dict[str, Any]):
    def __missing__(self, name: str) -> Road:
        return Road()


def functions_of(blocks: list[Block]) -> dict[str, Callable[..., float]]:
    """The functions that formulas call, by what is printed for them."""
    known = {rf"\{name}": getattr(np, name) for name in ("sin", "cos", "tan", "exp")}
    for block in blocks:
        if block.op == "call":
            name = block.data[0]  # type: ignore[index]
            key = rf"\text{{ {name.replace('_', ' ').replace('.', ' ')} }}"
            if name.startswith("road_"):
                known[key] = lambda *x, name=name: getattr(Road(), name.removeprefix("road_"))(*x)
            elif hasattr(np, {"atan": "arctan", "asin": "arcsin", "acos": "arccos", "atan2": "arctan2"}.get(name, name)):
                known[key] = getattr(np, {"atan": "arctan", "asin": "arcsin", "acos": "arccos", "atan2": "arctan2"}.get(name, name))
    return known


@pytest.fixture(autouse=True)
def all_digits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(views, "DIGITS", 17)


def equations_of(model: Model, scene: Scene, method: str) -> Equations:
    start, _ = derive(build_topology(model), scene)
    return formulate_system(start, method, ())[0] if METHODS[method].has_system else start


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", ["press", "flyball"])
def test_printed_formulas(name: str, method: str) -> None:
    model = read_model(MODELS / f"{name}.yaml")
    assert compare(equations_of(model, find_scene(model, next(iter(model.scenes))), method)) > 20


@pytest.mark.parametrize("method", METHODS)
def test_printed_formulas_of_every_force(method: str) -> None:
    """A random mechanism with loops, all kinds of forces, guides and parameters."""
    model = random_models.random_loops(1)
    scene = random_models.scene({"drive": 0.1 + sympy.sin(2 * TIME) / 5})
    assert compare(equations_of(model, scene, method)) > 100


STATES = """
cutjoint: 1
name: states
gravity: [0, 0, -9.81]
parameters: {gain: {value: 2, binding: param}}
bodies: {arm: {mass: 2, centre_of_mass: [1, 0, 0], inertia: [0.1, 0.2, 0.3]}}
joints: {pin: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: [0, 1, 0]}}
states: {lag: {rate: gain*(pin.angle - lag), start: 0}}
forces: {motor: {kind: joint_force, joint: pin, law: "-lag + where(rate > 0, 3, -rate)"}}
scenes: {fall: {end: 1}}
"""


def test_printed_formulas_of_states() -> None:
    model = read_model_text(STATES, "states.yaml")
    assert compare(equations_of(model, model.scenes["fall"], "recursive"))


def test_a_printed_formula_is_what_is_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The spring pulls three times as much: nothing but its equations is changed."""
    act = LineForce.act

    def more(self: LineForce, force: Any, m: Mechanics) -> dict[str, Block]:
        return act(self, replace(force, law=3.0 * force.law), m)

    model = read_model(MODELS / "press.yaml")
    before = explain(model, model.scenes["turn"])
    monkeypatch.setattr(LineForce, "act", more)
    after = explain(model, model.scenes["turn"])
    changed = [line for line, old in zip(after.splitlines(), before.splitlines(), strict=True) if line != old]
    assert any(r"\text{ force spring }" in line for line in changed)
    with monkeypatch.context() as undone:
        undone.setattr(LineForce, "act", act)
        assert explain(model, model.scenes["turn"]) == before
