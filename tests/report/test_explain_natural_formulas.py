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
from cutjoint.formulate.inputs import TIME, input_functions, input_parameters
from cutjoint.formulate.natural.equations import LagrangianEquations, formulate_lagrangian
from cutjoint.formulate.natural.layout import Layout
from cutjoint.formulate.natural.nodes import Form, Node, NodeKind, NodeName
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.model.records import JointForce, JointKind, Model
from cutjoint.report.explain.blocks import print_residuals
from cutjoint.report.explain.latex import words
from cutjoint.report.explain.natural.derivation import form_text
from cutjoint.topology.build import build_topology
from tests.mechanisms import random_models
from tests.mechanisms.random_models import DRIVE, GUIDABLE, TREE_KINDS, K, workshop
from tests.report.test_explain_blocks import Reading
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


def compare(equations: LagrangianEquations) -> int:
    """Every printed residual, read back, has the compiled one's value; how many there were."""
    q, residuals = state(equations)
    known: dict[str, Any] = {words(name): x if len(x) > 1 else x[0] for name, x in places(equations, q).items()}
    known |= {words(p.name): p.value for p in equations.parameters} | {words("t"): NOW}
    known |= {rf"\{name}": getattr(np, name) for name in ("sin", "cos")}
    model, count = equations.topology.model, 0
    given = input_functions(model, equations.scene)
    known |= {words(p.name): equations.layout.value(given[p.symbol].subs(TIME, NOW)) for p in input_parameters(model)}
    for c in equations.constraints:
        for names, printed in print_residuals(c.residual, c.names, model):
            assert not printed.endswith(" - 0")
            expected = [residuals[f"{c.element}.{name}"] for name in names]
            assert np.ravel(Reading(printed, known).sum()) == pytest.approx(expected, rel=1e-9, abs=1e-9), names
            count += len(names)
    return count


@pytest.fixture(autouse=True)
def all_digits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cutjoint.report.explain.latex.DIGITS", 17)


@pytest.mark.parametrize("kind", [kind for kind in TREE_KINDS if kind not in (K.FIXED, K.SPHERICAL, K.FREE)])
def test_printed_residuals_of_joints(kind: JointKind) -> None:
    assert compare(random_equations(random_models.tree_with(kind, False, 1)))


@pytest.mark.parametrize("kind", [kind for kind in GUIDABLE if JOINTS[kind].is_measured])
def test_printed_residuals_of_guided_joints(kind: JointKind) -> None:
    w = workshop(0, f"guided {kind}")
    w.grow(w.guided(w.guided(w.grow("ground"), kind), kind))
    assert compare(random_equations(w.model()))


def test_printed_residuals_name_the_inputs_of_guides() -> None:
    w = workshop(0, "two inputs")
    other = replace(DRIVE, name="other", symbol=sympy.Symbol("p_other", real=True), value=0.4)
    w.grow(w.guided(w.grow("ground"), K.PRISMATIC), K.PRISMATIC, guide=(2 * other.symbol - DRIVE.symbol,))
    model = w.model()
    equations = random_equations(replace(model, parameters=(*model.parameters, other)))
    printed = " ".join(text for c in equations.constraints for _, text in print_residuals(c.residual, c.names, equations.topology.model))
    assert words("drive") in printed
    assert words("other") in printed
    assert compare(equations)


@pytest.mark.parametrize("model", [random_models.random_loops(1), random_models.loop_with(K.CYLINDRICAL, "branch", 1)], ids=["", "surplus"])
def test_printed_residuals_of_loops(model: Model) -> None:
    assert compare(random_equations(replace(model, reactions=())))


def design_places(equations: LagrangianEquations) -> dict[str, Array]:
    return {n.name: np.array([equations.layout.value(x) for x in n.place]) for n in equations.layout.nodes}


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
