"""Tests of Exudyn alone; `test_peers.py` has the tests of all peers."""

from __future__ import annotations

import pytest
import sympy

from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model_text
from cutjoint.run.scenes import find_scene
from cutjoint_bench.export.exudyn import script_name
from cutjoint_bench.export.exudyn_laws import function
from cutjoint_bench.export.peers import PEERS
from tests.export.own import case_of


def test_redundant_equations_are_left_out_and_named() -> None:
    case = case_of("four_bar")
    exported = PEERS["exudyn"].export(case.model, case.scene, {}, case.outputs)
    assert exported.differences == (
        "Equations of cut joints that follow from the others are left out, since Exudyn wants independent ones "
        "(closure_1: along, turn 1, turn 2; closure_2: along, turn 1, turn 2).",
    )


ODD = """
cutjoint: 1
name: odd
gravity: [0, 0, -9.81]
bodies:
  nut: {mass: 1, centre_of_mass: [0, 0, 0.1], inertia: [1, 1, 1]}
  arm: {mass: 1, centre_of_mass: [0, 0, 0.2], inertia: [1, 1, 1]}
  kite: {mass: 1, centre_of_mass: [0, 0, 0.3], inertia: [1, 1, 1]}
joints:
  thread: {kind: screw, bodies: [ground, nut], at: [0, 0, 0], axis: [0, 0, 1], pitch: 0.01}
  motor: {kind: revolute, bodies: [nut, arm], at: [0, 0, 0.2], axis: [0, 1, 0], guide: "sin(t)"}
  sky: {kind: free, bodies: [ground, kite], at: [0, 0, 0.3]}
forces: {lift: {kind: joint_force, joint: sky, coordinate: z, law: 9.81}}
"""


def test_what_exudyn_does_not_have() -> None:
    model = read_model_text(ODD, "odd.yaml")
    with pytest.raises(ModelError) as refused:
        PEERS["exudyn"].export(model, find_scene(model, None), {}, ())
    assert str(refused.value).splitlines() == [
        "odd.yaml:10:3: joint 'thread': Exudyn has no joint of kind screw; write a revolute or a cylindrical joint",
        "odd.yaml:11:3: joint 'motor': a joint of kind revolute that time moves is not exported to Exudyn; guide a prismatic joint, or "
        "give its input a constant value",
        "odd.yaml:13:10: force 'lift': a force on a coordinate of a joint of kind free is not exported; write a load or a point_spring "
        "instead",
    ]


def test_a_script_hides_no_module() -> None:
    assert [script_name(name) for name in ("press", "random", "exudyn")] == ["press.py", "random_model.py", "exudyn_model.py"]


def test_laws_in_python() -> None:
    x = sympy.Symbol("x", real=True)
    choice = sympy.Piecewise((x, x < -0.1), (2 * x, True))
    texts = {
        0.1 + sympy.Float(0.2): "lambda x, t: 0.30000000000000004",
        x**3 / 3: "lambda x, t: (1.0/3.0)*x**3.0",
        sympy.pi * sympy.sqrt(x): "lambda x, t: 3.141592653589793*math.sqrt(x)",
        sympy.Abs(x) ** sympy.Float(1.5): "lambda x, t: abs(x)**1.5",
        choice: "lambda x, t: ((x) if (x < (-0.1)) else (2.0*x))",
    }
    assert {law: function(["x"], law) for law in texts} == texts
    assert function((), x, 2 * x) == "lambda t: (x, 2.0*x)"
