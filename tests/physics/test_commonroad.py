"""States alone: the 29 of CommonRoad's multi-body vehicle have the rates that its package computes."""

from __future__ import annotations

import csv

import numpy as np
import pytest

from cutjoint.analysis.closing import make_inputs
from cutjoint.formulate.inputs import INPUTS as GIVEN
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.model.read import read_model
from cutjoint.program.interpret import interpret_blocks
from cutjoint.topology.build import build_topology
from tests.mechanisms.commonroad import INPUTS, MODEL, NUMBERS, OWN, OWN_INPUT, STATES


def numbers() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """States, inputs and rates, a row for each case."""
    with NUMBERS.open(newline="") as stream:
        head, *rows = csv.reader(line for line in stream if not line.startswith("#"))
    assert tuple(head) == (*STATES, *INPUTS, *(f"{name}'" for name in STATES))
    table = np.array(rows, dtype=float)
    return table[:, :29], table[:, 29:31], table[:, 31:]


def test_rates_are_those_of_the_package() -> None:
    """At the state of the package's own test and at 20 by chance, slow cars and wheels that turn backwards among them."""
    states, inputs, rates = numbers()
    assert (tuple(states[0]), tuple(inputs[0])) == (OWN, OWN_INPUT)
    model = read_model(MODEL)
    equations = formulate_recursive(build_topology(model), model.scenes["drive"], ())
    given = make_inputs(equations, np.zeros(0), np.zeros(0))
    given |= {f"v:{name}": states[:, i : i + 1] for i, name in enumerate(STATES)}
    nothing = np.zeros(len(inputs))
    given[GIVEN] = np.column_stack([column for value in inputs.T for column in (value, nothing, nothing)])
    results = equations.function("evaluate").results
    values = interpret_blocks(results.values(), given, {})
    found = np.column_stack([np.broadcast_to(values[results[f"vdot:{name}"]].reshape(-1), len(states)) for name in STATES])
    assert found == pytest.approx(rates, rel=1e-12, abs=0)
