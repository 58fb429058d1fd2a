"""Folding: isomorphic subtrees in lanes compute what they computed one by one."""

from __future__ import annotations

import numpy as np
import pytest

from cutjoint.compile.derivation import derive
from cutjoint.compile.pipeline import generate
from cutjoint.compile.systems import formulate_system
from cutjoint.formulate.lanes import find_corresponding
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.model.read import read_model, read_model_text
from cutjoint.program.blocks import BindingTime, Block, Builder, Label
from cutjoint.program.fold import fold
from cutjoint.program.interpret import interpret_blocks
from cutjoint.program.lower import reachable_blocks
from cutjoint.program.schedule import schedule
from cutjoint.run.scenes import find_scene
from cutjoint.topology.build import build_topology
from tests.compile_run.generated import FlatRoad, random_states
from tests.conftest import MODELS
from tests.mechanisms.four_bar import four_bar_text
from tests.oracles.scalars import interpret_scalars


def formulate(text: str, scene: str) -> RecursiveEquations:
    model = read_model_text(text, "model.yaml")
    chosen = find_scene(model, scene)
    return formulate_recursive(build_topology(model), chosen, ())


def pendulums(count: int) -> str:
    """Double pendulums side by side, joined by a spring to the first one's ground, each with other numbers."""
    arms = "".join(
        f"  upper_{i}: {{mass: {1 + i}, centre_of_mass: [{i}, -0.5, 0], inertia: [1, 1, 1]}}\n"
        f"  lower_{i}: {{mass: 2, centre_of_mass: [{i}, -1.5, 0.1], inertia: [0.5, 0.4, 0.3]}}\n"
        for i in range(count)
    )
    joints = "".join(
        f"  pin_{i}: {{kind: revolute, bodies: [ground, upper_{i}], at: [{i}, 0, 0], axis: [0, 0, {(-1) ** i}]}}\n"
        f"  ball_{i}: {{kind: spherical, bodies: [upper_{i}, lower_{i}], at: [{i}, -1, 0]}}\n"
        for i in range(count)
    )
    return f"cutjoint: 1\nname: pendulums\ngravity: [0, -9.81, 0]\nbodies:\n{arms}joints:\n{joints}scenes:\n  swing: {{end: 1}}\n"


def geared(count: int) -> str:
    """Pendulums with hinges in place of balls, and a gear of its own ratio between the two of each."""
    hinge = "axis: [0, 0, 1], kind: revolute,"
    gears = "".join(f"  mesh_{i}: {{joints: [ball_{i}, pin_{i}], ratio: {1 + i / 10}}}\n" for i in range(count))
    return pendulums(count).replace("kind: spherical,", hinge).replace("scenes:", f"gears:\n{gears}scenes:")


DAMPED = """\
cutjoint: 1
name: damped
gravity: [0, -9.81, 0]
bodies:
  bar: {mass: 5, centre_of_mass: [0, 0, 0], inertia: [2, 2, 2]}
joints:
  slide: {kind: prismatic, bodies: [ground, bar], at: [0, 0, 0], axis: [1, 0, 0]}
signals:
  sway: bar.vx/3
submodels:
  arm:
    connectors: [carrier]
    parameters: [stiff, sway]
    bodies:
      rod: {mass: 2, centre_of_mass: [1, -0.5, 0.2], inertia: [0.5, 0.4, 0.3]}
    joints:
      pin: {kind: revolute, bodies: [carrier, rod], at: [1, 0, 0.2], axis: [0, 0, 1]}
    forces:
      drag: {kind: joint_force, joint: pin, law: -torque}
    states:
      lag: {start: 0.1, rate: turns - 3*lag}
    signals:
      turns: pin.angle_rate + sway*rod.vx
      torque: stiff*atan(lag) + turns**3
instances:
  one: {use: arm, connect: {carrier: bar}, with: {stiff: 2, sway: sway}}
  two: {use: arm, connect: {carrier: bar}, with: {stiff: 5, sway: sway}, mirror: z}
scenes:
  swing: {end: 1}
"""

#: Arms with controllers that keep a memory, which laws of the arms read.
SAMPLED = DAMPED.replace("law: -torque", "law: -torque - brake.pull").replace(
    "    signals:\n      turns",
    "    controllers:\n      brake: {every: 5 ms, signals: {pull: 0.4*kept + lag}, memory: {kept: {start: 0.2, next: 0.9*kept + turns}}}\n"
    "    signals:\n      turns",
)

def with_a_rack() -> str:
    """The car whose front wheels are steered by a rack that slides by itself, with a spring."""
    text = (MODELS / "car.yaml").read_text().replace("bodies:\n", "bodies:\n  rack: {mass: 3, centre_of_mass: [1.12, 0, 0.31]}\n", 1)
    text = text.replace("joints:\n", "joints:\n  slide: {kind: prismatic, bodies: [chassis, rack], at: [1.12, 0, 0.31], axis: y}\n", 1)
    spring = "forces:\n  centring: {kind: joint_force, joint: slide, law: -2e4*position - 300*rate}\n"
    text = text.replace("submodels:\n", f"{spring}submodels:\n", 1)
    return text.replace("steering: chassis", "steering: rack", 2)


CASES = {
    "arms with signals and states": (lambda: DAMPED, "swing"),
    "arms with controllers": (lambda: SAMPLED, "swing"),
    "iltis, straight": (lambda: (MODELS / "iltis.yaml").read_text(), "simul1s"),
    "iltis, steering": (lambda: (MODELS / "iltis.yaml").read_text(), "iavsd_sine_2mm"),
    "7 pendulums in groups of 4, 2 and 1": (lambda: pendulums(7), "swing"),
    "4 geared pendulums": (lambda: geared(4), "swing"),
    "car whose corners are two subtrees each": (lambda: (MODELS / "car.yaml").read_text(), "drop"),
    "car whose front sides share a rack that slides": (with_a_rack, "drop"),
    "axle whose sides share a rack and a stabiliser": (lambda: (MODELS / "axle.yaml").read_text(), "chirp"),
}


@pytest.mark.parametrize("case", CASES)
def test_folded_program_computes_the_same(case: str) -> None:
    text, scene = CASES[case]
    equations = formulate(text(), scene)
    evaluate = equations.functions[0]
    folded = fold(equations.builder, find_corresponding(equations.builder.quantities, equations.topology), evaluate.results)
    program = schedule(equations.builder, [("plain", evaluate.results), ("folded", folded)])
    assert program.instructions("folded") < 0.7 * program.instructions("plain")
    for state in random_states(equations, 2, seed=3):
        inputs = {**inputs_of(equations, state), "numerics": np.array([1e4, 1.0, 10.0])}
        roads = {name: FlatRoad() for name in equations.roads}
        plain = interpret_blocks(evaluate.results.values(), inputs, roads)
        lanes = interpret_blocks(folded.values(), inputs, roads)
        results = program.function("folded").results
        scalars = interpret_scalars(program.graph, [r.scalar for r in results], inputs, roads)
        for target, block in evaluate.results.items():
            expected = plain[block]
            scale = max(1.0, float(np.abs(expected).max()))
            assert lanes[folded[target]] == pytest.approx(expected, abs=1e-10 * scale), target
            found = np.array([scalars[r.scalar] for r in results if r.target == target])
            assert found == pytest.approx(expected.ravel(), abs=1e-10 * scale), target


def inputs_of(equations: RecursiveEquations, state: object) -> dict[str, np.ndarray]:
    from cutjoint.analysis.closing import make_inputs

    inputs = make_inputs(equations, state.q, state.v)  # type: ignore[attr-defined]
    for closure in equations.closures:
        inputs[f"lambda:{closure.joint}"] = state.multipliers[closure.first : closure.first + len(closure.names)]  # type: ignore[attr-defined]
    return inputs | {"t": np.array([state.t]), "motion": np.ones(1)}  # type: ignore[attr-defined]


def test_the_suspensions_take_the_instructions_of_one() -> None:
    """Four suspensions in four lanes: less than a third of the instructions, and the same operations within a twentieth."""
    equations = formulate((MODELS / "iltis.yaml").read_text(), "simul1")
    evaluate = equations.functions[0]
    folded = fold(equations.builder, find_corresponding(equations.builder.quantities, equations.topology), evaluate.results)
    program = schedule(equations.builder, [("plain", evaluate.results), ("folded", folded)])
    assert program.instructions("folded") < 0.33 * program.instructions("plain")
    assert program.operations("folded") == pytest.approx(program.operations("plain"), rel=0.05)


def test_the_members_of_a_chain_are_not_taken() -> None:
    """Each coupler of the N-four-bar hangs on the crank before it."""
    equations = formulate(four_bar_text(7), "swing")
    assert equations.topology.classes
    assert find_corresponding(equations.builder.quantities, equations.topology) == []


@pytest.mark.parametrize("method", ["recursive", "recursive-newton", "augmented"])
def test_lanes_do_not_depend_on_labels(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Labels are for readers: with names that say nothing, the two arms of the governor share the same lanes."""
    model = read_model(MODELS / "flyball.yaml")
    _, named, source = generate(model, model.scenes["govern"], (), method=method)
    monkeypatch.setattr(Builder, "label", _garbled)
    _, garbled, other = generate(model, model.scenes["govern"], (), method=method)
    assert source.files.keys() == other.files.keys()
    assert source.files != other.files
    assert any(node.lanes == 2 for node in named.graph.nodes)
    assert garbled.graph.nodes == named.graph.nodes
    assert garbled.functions == named.functions


def _garbled(builder: Builder, block: Block, name: str, **_: tuple[str, ...]) -> Block:
    builder.labels.setdefault(block, Label(text=f"x{len(builder.labels)}"))
    return block


def test_members_that_depend_on_each_other_stay_as_they_are() -> None:
    b = Builder()
    x = b.symbol("x", 3, BindingTime.ITERATION)
    first = b.scale(b.number(2.0), x)
    second = b.scale(b.number(3.0), first)
    results = {"y": b.add(first, second)}
    assert fold(b, [(first, second)], results) == results


def small(differ: str) -> tuple[Builder, dict[str, object], list[tuple[object, ...]]]:
    """Two members x_k -> y_k that differ in the way named."""
    b = Builder()
    x = [b.symbol(f"x{k}", 3, BindingTime.ITERATION) for k in range(2)]
    p = b.symbol("p", 3, BindingTime.ITERATION)
    y = {
        "constants": [b.add(b.scale(b.number(k + 2.0), x[k]), p) for k in range(2)],
        "signs": [b.cross(p, b.neg(x[0])), b.cross(p, x[1])],
        "the sign of a sum": [b.neg(b.add(b.scale(b.number(2.0), x[0]), p)), b.add(b.scale(b.number(3.0), x[1]), p)],
        "a missing term": [b.add(b.scale(b.number(2.0), x[0]), p), b.scale(b.number(3.0), x[1])],
        "an outside block": [b.cross(x[0], p), b.cross(x[1], b.scale(b.number(2.0), p))],
        "an operation": [b.cross(x[0], p), b.add(x[1], p)],
        "a shape": [b.mul(b.skew(x[0]), b.add(x[0], p)), b.mul(x[1], b.add(b.dot(x[1], p), b.dot(p, p)))],
    }[differ]
    return b, {"sum": b.add(y[0], y[1]), "first": y[0]}, [tuple(y)]  # type: ignore[return-value]


@pytest.mark.parametrize(
    "differ", ["constants", "signs", "the sign of a sum", "a missing term", "an outside block", "an operation", "a shape"]
)
def test_members_may_differ_in(differ: str) -> None:
    b, results, families = small(differ)
    folded = fold(b, families, results)  # type: ignore[arg-type]
    rng = np.random.default_rng(0)
    inputs = {name: rng.normal(size=3) for name in ("x0", "x1", "p")}
    plain = interpret_blocks(results.values(), inputs, {})  # type: ignore[arg-type]
    lanes = interpret_blocks(folded.values(), inputs, {})
    program = schedule(b, [("folded", folded)])
    scalars = interpret_scalars(program.graph, [r.scalar for r in program.functions[0].results], inputs, {})
    for target, block in results.items():
        expected = plain[block].ravel()  # type: ignore[index]
        assert lanes[folded[target]].ravel() == pytest.approx(expected, rel=1e-14)
        found = [scalars[r.scalar] for r in program.functions[0].results if r.target == target]
        assert found == pytest.approx(expected, rel=1e-14)


def test_the_negation_of_a_sum_stands_beside_a_sum() -> None:
    """Both in lanes from their arguments on: nothing else is gathered."""
    b, results, families = small("the sign of a sum")
    program = schedule(b, [("folded", fold(b, families, results))])  # type: ignore[arg-type]
    gathered = [node.args for node in program.graph.nodes if node.op == "gather"]
    assert {program.graph.nodes[a].op for args in gathered for a in args} == {"symbol"}


@pytest.mark.parametrize("case", ["a term twice", "a member in two families"])
def test_each_term_of_a_sum_counts_once(case: str) -> None:
    """A term that stands in lanes is taken out of a sum as often as it stands there."""
    b = Builder()
    p, q, r = (b.call("sin", b.symbol(f"x{k}", 1, BindingTime.ITERATION)) for k in range(3))
    terms, families = ([p, q, p, q, p], [(p, q)]) if case == "a term twice" else ([p, q, r], [(p, q), (q, r)])
    results = {"sum": b.total(terms)}
    folded = fold(b, families, results)
    inputs = {f"x{k}": np.array([0.3 + k]) for k in range(3)}
    expected = interpret_blocks(results.values(), inputs, {})[results["sum"]]
    assert interpret_blocks(folded.values(), inputs, {})[folded["sum"]] == pytest.approx(expected, rel=1e-14)


def test_families_of_several_widths_in_one_sum() -> None:
    """Four in lanes and two in lanes are added across by themselves, also where they are numbers."""
    b = Builder()
    x = [b.call("sin", b.symbol(f"x{k}", 1, BindingTime.ITERATION)) for k in range(6)]
    terms = [b.mul(b.number(k + 0.5), block) for k, block in enumerate(x)]
    numbers = [b.scale(b.const([[k + 0.25]]), b.call("sin", b.number(k + 1.0))) for k in range(6)]
    results = {"sum": b.total(terms), "number": b.total(numbers)}
    folded = fold(b, [tuple(part[i:j]) for part in (terms, numbers) for i, j in ((0, 4), (4, 6))], results)
    program = schedule(b, [("folded", folded)])
    inputs = {f"x{k}": np.array([0.3 + k]) for k in range(6)}
    expected = interpret_blocks(results.values(), inputs, {})
    scalars = interpret_scalars(program.graph, [r.scalar for r in program.functions[0].results], inputs, {})
    for result in program.functions[0].results:
        assert scalars[result.scalar] == pytest.approx(float(expected[results[result.target]][0, 0]), rel=1e-14)


def test_blocks_of_several_widths_do_not_mix() -> None:
    b = Builder()
    two, three = (b.lane_const([b.number(float(k)) for k in range(lanes)]) for lanes in (2, 3))
    with pytest.raises(AssertionError, match=r"add of blocks with \[2, 3\] lanes"):
        b.add(two, three)


def test_lanes_bring_no_inputs_of_other_functions() -> None:
    """A term of one member that another function alone has the inputs for: the first function computes its own alone."""
    b = Builder()
    x, y, w = (b.symbol(name, 1, BindingTime.ITERATION) for name in "xyw")
    own, foreign = b.mul(x, y), b.mul(x, w)
    folded = fold(b, [(own, foreign)], {"first": b.add(own, x)})
    assert w not in reachable_blocks(folded.values())
    both = fold(b, [(own, foreign)], {"second": b.add(own, foreign)})
    assert any(block.lanes for block in reachable_blocks(both.values()))


def test_an_axle_folds_with_its_tangent() -> None:
    model = read_model(MODELS / "axle.yaml")
    scene = find_scene(model, "chirp")
    plain, folded = (generate(model, scene, scene.outputs, method="recursive-newton", lanes=lanes) for lanes in (False, True))
    assert folded[1].instructions("linearise") < 0.7 * plain[1].instructions("linearise")
    assert "weights" not in folded[2].files["system_dynamic_residual.cpp"]


def test_the_augmented_tangent_of_an_axle_folds() -> None:
    """Joints that stand alike on the chassis are no nodes of its basis, and members that depend on each other cost the others no lanes."""
    model = read_model(MODELS / "axle.yaml")
    scene = find_scene(model, "chirp")
    equations, _ = formulate_system(derive(model, scene, ()), "augmented", ())
    b, results = equations.builder, equations.function("linearise").results
    folded = fold(b, find_corresponding(b.quantities, equations.topology), results)
    plain, lanes = (schedule(b, [("linearise", r)]).instructions("linearise") for r in (results, folded))
    assert lanes < 0.92 * plain
    rng = np.random.default_rng(0)
    symbols = {block.data: rng.standard_normal(block.shape[0]) for block in reachable_blocks(results.values()) if block.op == "symbol"}
    expected, found = (interpret_blocks(r.values(), symbols, {}) for r in (results, folded))
    for target, block in results.items():
        assert found[folded[target]] == pytest.approx(expected[block], rel=1e-9, abs=1e-6), target


def test_one_family_of_dependent_members_leaves_the_others_their_lanes() -> None:
    b = Builder()
    x = [b.symbol(f"x{k}", 3, BindingTime.ITERATION) for k in range(2)]
    first = b.scale(b.number(2.0), x[0])
    second = b.scale(b.number(3.0), first)
    free = tuple(b.cross(b.scale(b.number(4.0 + k), x[k]), x[k]) for k in range(2))
    results = {"y": b.add(first, second), "z": b.add(*free)}
    folded = fold(b, [(first, second), free], results)
    assert folded["y"] == results["y"]
    assert any(block.lanes for block in reachable_blocks([folded["z"]]))
