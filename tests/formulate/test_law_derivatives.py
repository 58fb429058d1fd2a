"""Derivatives of laws a thousand times beyond usual arguments, and beside what choices leave out: finite, and the same in three ways."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import pytest
import sympy

from cutjoint.formulate.translate import Translator
from cutjoint.model.expressions.operations import Term
from cutjoint.model.expressions.parse import read_term, variable
from cutjoint.model.read import read_model_text
from cutjoint.program.blocks import BindingTime, Builder
from cutjoint.program.differentiate import Differentiator
from cutjoint.program.elimination import adjoint, derivatives
from cutjoint.program.interpret import interpret_blocks
from cutjoint.program.lower import Lowering
from tests.oracles.scalars import interpret_scalars

#: Stribeck friction, the library's contact, a driven brush wheel, and a clutch.
LAWS = """
cutjoint: 1
name: laws
gravity: [0, 0, -9.81]
parameters: {pedal: {value: 0, binding: input}}
bodies:
  block: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [0.01, 0.01, 0.01]}
  ball: {mass: 1, centre_of_mass: [1, 0, 0.2], inertia: [0.01, 0.01, 0.01]}
joints:
  rail: {kind: prismatic, bodies: [ground, block], at: [0, 0, 0], axis: x}
  p: {kind: planar, bodies: [ground, ball], at: [1, 0, 0.2], axis: y}
submodels: {contact_law: {include: library/contact_law}, clutch: {include: library/clutch}, wheel: {include: library/wheel_brush}}
instances:
  grip: {use: contact_law, with: {deflection: sole.deflection, deflection_rate: sole.deflection_rate, vx: sole.vx, vy: sole.vy,
         stiffness: 1e5, damping: 0.3, friction: 0.4}}
  clutch: {use: clutch, with: {engine_speed: p.angle_rate, gearbox_speed: w.rolling.bearing.angle_rate, pedal: pedal}}
  w: {use: wheel, connect: {carrier: block}, with: {x: 0, y: 0, z: 0.3, radius: 0.3, mass: 20, spin_inertia: 1, cross_inertia: 0.5,
      stiffness: 2e5, slip_stiffness: 2e6, cornering_stiffness: 1e5}}
forces:
  f: {kind: joint_friction, joint: rail, coefficient: 0.2, static: 0.3, stribeck_speed: 0.01}
  sole: {kind: contact, bodies: [ground, ball], at: [0, 0, 0], normal: z, along: x, centre: [1, 0, 0.2], radius: 0.2,
         force: [grip.Fx, grip.Fy, grip.Fz]}
scenes: {run: {end: 0.1}}
"""
#: Forms of laws over a, b; each has a value and a derivative at a = 0.
FORMS = (
    "3*exp(-b**2)", "b*exp(-a)", "where(a > 0, b/a, 0)", "where(a > 0, 2*b*sqrt(a) + b**2/a, b)", "min(b/max(a, 1e-9), 2)",
    "where(a > 0, b/a + where(b > 1, sqrt(a), 0)/a, 0)", "where(a < 1, exp(a), 3 - exp(-a))", "where(a > 0, log(a)*b, 0)",
)  # fmt: skip


def laws() -> Iterator[tuple[str, sympy.Expr]]:
    """All laws of the model, by name."""
    model = read_model_text(LAWS, "laws.yaml")
    yield from ((f"state {s.name}", s.rate) for s in model.states)
    yield from ((f"signal {s.name}", s.value) for s in model.signals)
    for force in model.forces:
        yield from ((f"force {force.name}", law) for name in force.element.laws if isinstance(law := getattr(force, name), sympy.Expr))


def by_three_ways(expression: sympy.Expr) -> Iterator[tuple[Mapping[str, float], float, list[list[float]]]]:
    """At random places the arguments, the value, and derivatives forwards, from the result on and by elimination."""
    names = sorted(map(str, expression.free_symbols))
    b, lowering = Builder(), Lowering()
    columns = [b.symbol(name, 1, BindingTime.ITERATION) for name in names]
    values = {symbol: columns[names.index(str(symbol))] for symbol in expression.free_symbols}
    block = Translator(b, values).scalar(expression)
    forward = Differentiator(b, columns).jacobian(block)
    lowering.lower([block, *columns])
    ((root,),) = lowering.elements[block]
    graph, places = lowering.graph, [lowering.elements[c][0][0] for c in columns]
    reverse, eliminated = adjoint(graph, {root: graph.const(1.0)}, places), derivatives(graph, [root], places)[0]
    rng = np.random.default_rng(5)
    for trial in range(24):
        x = 10 ** rng.uniform(-3, 5, len(names)) * rng.choice((-1, 1), len(names))
        if trial % 4 == 0:
            x[rng.integers(len(names))] = 0
        at = {name: np.array([value]) for name, value in zip(names, x, strict=True)}
        found = interpret_blocks([block, *forward.values()], at, {})
        scalars = interpret_scalars(graph, [*reverse.values(), *eliminated.values()], at, {})
        ways = [float(found[forward[c]].item()) if c in forward else 0.0 for c in columns]
        behind = [[float(np.sum(scalars[d[n]])) if n in d else 0.0 for n in places] for d in (reverse, eliminated)]
        yield dict(zip(names, map(float, x), strict=True)), float(found[block].item()), [ways, *behind]


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_derivatives_of_laws_are_finite_far_beyond_usual_arguments() -> None:
    tried = 0
    for name, law in laws():
        for x, value, ways in by_three_ways(law) if law.free_symbols else ():
            if np.isfinite(value) and 0 not in x.values():
                assert np.isfinite(ways).all(), (name, x)
            if np.isfinite(ways[0]).all():
                scale = max(map(abs, ways[0]))
                assert ways == [pytest.approx(ways[0], rel=1e-6, abs=1e-12 * scale)] * 3, (name, x)
                tried += 1
    assert tried > 500


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("text", FORMS)
def test_a_choice_leaves_out_derivatives_that_have_no_value(text: str) -> None:
    law = read_term(text, {name: Term(variable(name)) for name in "ab"}).value
    for x, value, ways in by_three_ways(law):
        if np.isfinite(value):
            assert np.isfinite(ways).all(), x
            assert ways == [pytest.approx(ways[0], rel=1e-9)] * 3, x
