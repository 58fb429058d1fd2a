"""Samples of controllers at a state, by all formulations: the quantities that outputs report there, accelerations and reactions too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import sympy

from cutjoint.analysis.natural import call
from cutjoint.formulate.implicit.equations import formulate_implicit
from cutjoint.formulate.natural.equations import formulate_lagrangian
from cutjoint.formulate.records import SystemEquations
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.model.expressions.parse import quantity_symbol, sample_symbol
from cutjoint.model.records import Controller, DiscreteState, Model, Output, Reaction, Signal
from cutjoint.topology.build import build_topology
from tests.formulate.test_natural import without_rod_forces
from tests.mechanisms import random_models


def sampling(model: Model, *reactions: str) -> tuple[Model, tuple[Output, ...]]:
    """The model with a controller that computes a multiple of each of many outputs from each other, and these."""
    span, joint = model.span, next(j for j in model.joints if not j.cut)
    reaction = Reaction(name="felt", joint=joint.name, body=model.bodies[0].name, direction=None, span=span)
    body = model.bodies[-1].name
    asked = [("felt", q) for q in reactions] + [(body, q) for q in ("x", "vy", "wz", "az", "ay", "roll")]
    asked += [(force.name, next(iter(force.quantities))) for force in model.forces]
    signals, states = [], []
    for i, (element, quantity) in enumerate(asked):
        below = signals[-1].symbol if signals else sympy.Integer(0)
        symbol = sample_symbol("all", f"s{i}")
        signals.append(Signal(name=f"all.s{i}", symbol=symbol, value=2 * quantity_symbol(element, quantity) - below, unit="", span=span))
        states.append(DiscreteState(name=f"s{i}", symbol=quantity_symbol("all", f"s{i}"), start=sympy.Integer(0), next=symbol, unit=""))
    controller = Controller(name="all", every=0.1, offset=0.0, signals=tuple(signals), discrete_states=tuple(states), span=span)
    outputs = tuple(Output(element=element, quantity=quantity, span=span) for element, quantity in asked)
    return replace(model, reactions=(*model.reactions, reaction), controllers=(controller,)), outputs


def in_a_row(reported: np.ndarray) -> np.ndarray:
    """The signals by the outputs that they read."""
    found = []
    for value in reported:
        found.append(2 * value - (found[-1] if found else 0))
    return np.array(found)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("method", ["recursive-newton", "augmented", "classical"])
def test_samples_are_what_outputs_report(method: str, seed: int) -> None:
    """Natural coordinates do not have the reaction of any joint."""
    reactions = ("Fx", "Fz", "My") if method == "recursive-newton" else ()
    model, outputs = sampling(without_rod_forces(random_models.random_loops(seed)), *reactions)
    start = formulate_recursive(build_topology(model), random_models.scene(), outputs)
    equations: SystemEquations
    equations = formulate_implicit(start, outputs) if method == "recursive-newton" else formulate_lagrangian(start, method, outputs)
    rng = np.random.default_rng(seed)
    n, m = equations.unknowns, len(equations.equation_names)
    sizes = {"q": len(equations.coordinate_names), "v": n, "vdot": n, "lambda": m}
    state = {name: rng.normal(size=size) for name, size in sizes.items()}
    reported, computed = call(equations, "report", state)["column"], call(equations, "sample", state)["next_discrete"]
    assert np.abs(computed - in_a_row(reported)).max() <= 1e-12 * np.abs(reported).max() * len(outputs)
