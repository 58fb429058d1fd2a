"""Printed formulas of natural coordinates have the value of compiled code, in states that satisfy no equation."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy

from cutjoint.analysis.natural import call
from cutjoint.elements.joints import JOINTS
from cutjoint.formulate.inputs import TIME, input_functions
from cutjoint.formulate.natural.equations import LagrangianEquations, formulate_lagrangian
from cutjoint.formulate.natural.layout import Layout
from cutjoint.formulate.natural.nodes import Form, Node, NodeKind, NodeName
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.model.records import COORDINATES, Joint, JointForce, JointKind, Model
from cutjoint.report.explain.natural.derivation import derive_natural, form_text
from cutjoint.report.explain.natural.joints import Equation, joint_equations
from cutjoint.report.explain.natural.shapes import explain_shapes
from cutjoint.topology.build import build_topology
from tests.mechanisms import random_models
from tests.mechanisms.random_models import GUIDABLE, TREE_KINDS, K, workshop
from tests.report.test_explain_natural import explained, random_scene

Array = np.ndarray
NOW = 0.37


def places(equations: LagrangianEquations, q: Array) -> dict[str, Array]:
    """Every node's value for given coordinates, with default parameters."""
    layout, values, offset = equations.layout, {}, 0
    for node in layout.coordinates:
        values[node.name] = q[offset : offset + node.size]
        offset += node.size

    def value(node: Node) -> Array:
        if node.name not in values:
            values[node.name] = total(layout, node.parts, value) if node.parts else np.array([layout.value(x) for x in node.place])
        return values[node.name]

    return {node.name: value(node) for node in layout.nodes}


def total(layout: Layout, form: Form, value: Callable[[Node], Array]) -> Array:
    return np.sum([layout.value(c) * value(node) for node, c in form.items()], axis=0)


def state(equations: LagrangianEquations) -> tuple[Array, dict[str, float]]:
    """Random coordinates, which satisfy no equation, and the equations' residuals by name."""
    q = np.random.default_rng(1).standard_normal(len(equations.coordinate_names))
    at = {"q": q, "v": 0 * q, "vdot": 0 * q, "t": np.array([NOW]), "motion": np.array([1.0])}
    return q, dict(zip(equations.equation_names, call(equations, "constraint_residual", at)["residual"], strict=True))


def random_equations(model: Model) -> LagrangianEquations:
    """Without forces on the coordinates that natural coordinates do not have, as those of distance joints."""
    rods = {j.name for j in model.joints if not j.element.is_measured}
    told = replace(model, forces=tuple(f for f in model.forces if not (isinstance(f, JointForce) and f.joint in rods)))
    return formulate_lagrangian(formulate_recursive(build_topology(told), random_scene(), ()), "augmented", ())


#: The meaning of the printed residuals.
RESIDUALS = {
    r"d \cdot t_1": lambda x: x["d"] @ x["t_1"],
    r"d \cdot t_2": lambda x: x["d"] @ x["t_2"],
    r"d \cdot a": lambda x: x["d"] @ x["a"],
    r"d \cdot a - h \varphi": lambda x: x["d"] @ x["a"] - x["h"] * x[r"\varphi"],
    r"d \cdot a - s": lambda x: x["d"] @ x["a"] - x["s"],
    r"d \cdot a - s_{3}": lambda x: x["d"] @ x["a"] - x["s_{3}"],
    r"d \cdot t_1 - s_{1}": lambda x: x["d"] @ x["t_1"] - x["s_{1}"],
    r"d \cdot t_2 - s_{2}": lambda x: x["d"] @ x["t_2"] - x["s_{2}"],
    r"a_b \cdot a_f": lambda x: x["a_b"] @ x["a_f"],
    r"\frac{1}{2} t_1' \cdot t_2 - \frac{1}{2} t_2' \cdot t_1": lambda x: (x["t_1'"] @ x["t_2"] - x["t_2'"] @ x["t_1"]) / 2,
    r"\frac{d \cdot d - l^2}{2 l}": lambda x: (x["d"] @ x["d"] - x["l"] ** 2) / (2 * x["l"]),
    r"f \cdot (b_2 \cos \varphi - b_1 \sin \varphi)": lambda x: (
        x["f"] @ (x["b_2"] * np.cos(x[r"\varphi"]) - x["b_1"] * np.sin(x[r"\varphi"]))
    ),
    r"f_{1} \cdot (b_{12} \cos \varphi_{1} - b_{11} \sin \varphi_{1})": lambda x: (
        x["f_{1}"] @ (x["b_{12}"] * np.cos(x[r"\varphi_{1}"]) - x["b_{11}"] * np.sin(x[r"\varphi_{1}"]))
    ),
    r"f_{2} \cdot (b_{22} \cos \varphi_{2} - b_{21} \sin \varphi_{2})": lambda x: (
        x["f_{2}"] @ (x["b_{22}"] * np.cos(x[r"\varphi_{2}"]) - x["b_{21}"] * np.sin(x[r"\varphi_{2}"]))
    ),
    r"\varphi - \varphi(t)": lambda x: x[r"\varphi"] - x[r"\varphi(t)"],
}


def of_joint(equations: LagrangianEquations, joint: Joint, equation: Equation, values: dict[str, Array]) -> dict[str, Any]:
    """Values of the symbols of an equation at some coordinates."""
    layout = equations.layout

    def on(form: Form) -> Array:
        return total(layout, form, lambda node: values[node.name])

    start, end = layout.point(joint.base, joint.at), layout.point(joint.follower, joint.to or joint.at)
    x: dict[str, Any] = {"d": on(end) - on(start)}
    x["h"] = layout.value(joint.pitch) if joint.pitch is not None else 0.0
    x["l"] = float(sympy.Matrix([layout.value(a - b) for a, b in zip(joint.to, joint.at, strict=True)]).norm()) if joint.to else 0.0
    for symbol, direction in equation.directions:
        x[symbol] = on(layout.direction(carrier(joint, symbol), direction))
    for (element, coordinate), node in layout.angles.items():
        if element == joint.name:
            x[angle_symbol(coordinate)] = values[node.name][0]
    if joint.guide is not None and equation.name.endswith("_guide"):
        guide = joint.guide[COORDINATES[joint.kind].index(equation.name.removesuffix("_guide"))]
        symbol = angle_symbol(equation.name.removesuffix("_guide"))
        now = layout.value(guide.subs(input_functions(equations.topology.model, equations.scene)).subs(TIME, NOW))
        x[f"{symbol}(t)" if joint.kind is K.SCREW else symbol] = now
    return x


def angle_symbol(coordinate: str) -> str:
    word, _, digit = coordinate.partition("_")
    return {"angle": r"\varphi", "displacement": "s"}[word] + (f"_{{{digit}}}" if digit else "")


def carrier(joint: Joint, symbol: str) -> str:
    """The body that carries a direction: the second angle of a universal joint is measured from the follower."""
    on_follower = symbol.endswith("'") or symbol in ("a_f", "f", "f_{1}", "b_{21}", "b_{22}")
    return joint.follower if on_follower else joint.base


def compare_joints(equations: LagrangianEquations) -> int:
    """Every printed residual of a joint has the compiled one's value; how many there were."""
    q, residuals = state(equations)
    values = places(equations, q)
    count = 0
    for joint in equations.topology.model.joints:
        own = joint_equations(equations.layout, joint)
        assert [e.name for e in own] == [name for c in equations.constraints if c.element == joint.name for name in c.names]
        for e in own:
            printed = RESIDUALS[e.residual](of_joint(equations, joint, e, values))
            assert printed == pytest.approx(residuals[f"{joint.name}.{e.name}"], rel=1e-9, abs=1e-9), (joint.name, e.name)
            count += 1
    return count


@pytest.mark.parametrize("kind", [kind for kind in TREE_KINDS if kind not in (K.FIXED, K.SPHERICAL, K.FREE)])
def test_printed_residuals_of_joints(kind: JointKind) -> None:
    assert compare_joints(random_equations(random_models.tree_with(kind, False, 1)))


@pytest.mark.parametrize("kind", [kind for kind in GUIDABLE if JOINTS[kind].is_measured])
def test_printed_residuals_of_guided_joints(kind: JointKind) -> None:
    w = workshop(0, f"guided {kind}")
    w.grow(w.guided(w.guided(w.grow("ground"), kind), kind))
    assert compare_joints(random_equations(w.model()))


def test_printed_residuals_of_loops() -> None:
    assert compare_joints(random_equations(random_models.random_loops(1)))


def design_places(equations: LagrangianEquations) -> dict[str, Array]:
    return {n.name: np.array([equations.layout.value(x) for x in n.place]) for n in equations.layout.nodes}


@pytest.mark.parametrize("name", ["iltis", "four_bar"])
def test_printed_constraints_of_bodies(name: str) -> None:
    """(u_j . u_k - c)/l_jk, half of it where j is k, with j, k and c from the table and the basis from the layout's."""
    one = explained(name, "augmented")
    equations = one.derivation.full
    q, residuals = state(equations)
    values, design = places(equations, q), design_places(equations)
    bases = {row[0]: [c.strip("`") for c in row[2:-1] if c] for row in one.table("body | line | $e_0$")}
    kinds = {n.name: n.kind for n in equations.layout.nodes}

    def way(basis: list[str], k: int, at: dict[str, Array]) -> Array:
        return at[basis[k]] - (at[basis[0]] if kinds[basis[k]] is NodeKind.POINT else 0)

    for equation, _, keeps, value in one.table("equation | line | keeps"):
        body = max((b for b in bases if equation.startswith(f"{b}.")), key=len)
        j, k = (int(i) for i in re.findall(r"u_(\d)", keeps))
        u, w = (way(bases[body], i, values) for i in (j, k))
        lengths = [float(np.linalg.norm(way(bases[body], i, design))) for i in (j, k)]
        are_points = all(kinds[bases[body][i]] is NodeKind.POINT for i in (j, k))
        printed = (u @ w - float(value)) / (max(lengths) if are_points else 1.0) / (2 if j == k else 1)
        assert printed == pytest.approx(residuals[equation], abs=1e-6), equation


def test_printed_combinations_stand_where_the_nodes_stand() -> None:
    iltis = explained("iltis", "augmented")
    design = design_places(iltis.derivation.full)
    rows = iltis.table("node | kind")
    assert len(rows) == 16
    for name, _, _, combination, *_ in rows:
        assert evaluate(combination, design) == pytest.approx(design[name], abs=1e-6), name


def evaluate(combination: str, nodes: dict[str, Array]) -> Array:
    """A printed combination."""
    result = np.zeros(3)
    for sign, factor, name in re.findall(r"(-?)\s*(?:([\d.e-]+)\*)?([a-z][\w.]*)", combination.replace("+ ", "")):
        result += (-1 if sign else 1) * float(factor or 1) * nodes[name]
    return result


def test_a_shared_node_that_the_basis_does_not_have() -> None:
    """A body on a prismatic and a cylindrical joint shares four directions, one of which two equations hold."""
    model = replace(random_models.loop_with(K.CYLINDRICAL, "branch", 1), forces=(), reactions=())
    d = derive_natural(model, random_scene(), "augmented")
    (group,) = (g for g in d.full.layout.groups.values() if g.surplus)
    rows = [row for entry in explain_shapes(d, ()).entries for row in entry.table.rows if "$" not in row[2]]
    (node,) = group.surplus
    assert [row[0] for row in rows] == [f"`{group.name}.{node.name}.{i}`" for i in (1, 2)]
    for _, _, combination, at in rows:
        assert evaluate(combination.strip("`"), design_places(d.full)) == pytest.approx(design_places(d.full)[at.strip("`")], abs=1e-6)


def test_combinations_with_parameters() -> None:
    size = random_models.SIZE.symbol
    ground = tuple(Node(title=NodeName(n), kind=NodeKind.POINT, body="b", place=(0, 0, 0)) for n in "abcde")
    model = random_models.tree_with(K.REVOLUTE, False, 1)
    a, b, c, d, e = ground
    assert form_text({a: -1.0, b: 0.5, c: 1.0 * size, d: 1 - size, e: -2 / (1 + size)}, model) == (
        "`-a + 0.5*b + size*c - (size - 1)*d - 2/(size + 1)*e`"
    )
    assert form_text({a: 1e-15 * size, b: 1}, model) == "`b`"
    assert form_text({}, model) == "0"
