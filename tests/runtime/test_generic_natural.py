"""The generic solver in natural coordinates, which interprets a system at run time, against the interpreter of the block IR."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cutjoint.analysis.closing import evaluate_scene_inputs, explore
from cutjoint.analysis.natural import closed_states, dependent_equations
from cutjoint.elements.joints import JOINTS
from cutjoint.formulate.inputs import tunable_parameters
from cutjoint.formulate.natural.equations import LagrangianEquations, formulate_lagrangian
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.methods import Implementation
from cutjoint.model.errors import ModelError
from cutjoint.model.expressions.quantities import quantities
from cutjoint.model.read import read_model
from cutjoint.model.records import COORDINATES, GROUND, JointForce, JointKind, Model, Output, Reaction, Scene
from cutjoint.package.locations import runtime_folder
from cutjoint.program.interpret import interpret_blocks
from cutjoint.run.results import read_table
from cutjoint.run.run_file import make_run_file
from cutjoint.run.settings import Options
from cutjoint.run.simulator import SimulatorError, call_simulator, failure_of
from cutjoint.toolchain.compiler import find_compiler
from cutjoint.topology.build import build_topology
from cutjoint_bench.generic import RUNTIME
from cutjoint_bench.generic.build import build_generic
from cutjoint_bench.generic.mechanism import describe_generic
from cutjoint_bench.generic.system import describe_generic_natural
from tests.conftest import MODELS
from tests.formulate.test_reports import with_reactions
from tests.mechanisms import random_models
from tests.mechanisms.random_models import CUT_KINDS, MEASURED, NOWHERE, TREE_KINDS, K, workshop
from tests.oracles.dense import DenseMechanism, Instant
from tests.oracles.reports import reported

from .test_generic_mechanism import FLAT, STEPPED, WAVY, Road

pytestmark = [
    pytest.mark.skipif(shutil.which("g++") is None and shutil.which("clang++") is None, reason="needs a C++ compiler"),
    pytest.mark.heavy,  # compiling the generic solver takes minutes
]

METHODS = ("augmented", "classical")

#: Largest difference relative to the largest element; sums of some thousand terms in another order, and lengths that are small differences.
EXACT = 1e-9


class Ground:
    """A road with its derivatives."""

    def __init__(self, road: Road) -> None:
        self._road = road
        self.height, self.slope = road.height, road.slope

    def height_dx(self, x: float, y: float) -> float:
        return self._road._at(x, y).slope(x)

    def slope_dx(self, x: float, y: float) -> float:
        """Of an arc d/dx (c - x)/root = -b^2/root^3."""
        piece = self._road._at(x, y)
        if self._road.disc or piece.kind == "line":
            return 0.0
        if piece.kind == "cosine":
            return piece.b * piece.c**2 * np.cos(piece.c * (x - piece.start))
        return -(piece.b**2) / np.sqrt(max(piece.b**2 - (x - piece.c) ** 2, 1e-12)) ** 3


@pytest.fixture(scope="session")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A program around the generic solver."""
    target = tmp_path_factory.mktemp("generic_natural") / "evaluate"
    source = Path(__file__).with_name("generic_natural.cpp")
    subprocess.run(
        [*find_compiler().command,
         "-std=c++20", "-O1", "-Wall", "-Wextra", "-Werror", "-Wno-maybe-uninitialized", "-isystem", "/usr/include/eigen3",
         f"-I{RUNTIME / 'include'}", f"-I{runtime_folder() / 'include'}", str(source), "-o", str(target)],
        check=True,
    )  # fmt: skip
    return target


@dataclass(frozen=True)
class Case:
    """A system, ready for both implementations."""

    equations: LagrangianEquations
    road: Road = FLAT
    factor: float = 1.01

    @property
    def parameters(self) -> dict[str, float]:
        """Values that differ from the defaults, so that a default taken for a value shows."""
        return {p.name: self.factor * p.value for p in tunable_parameters(self.equations.topology.model)}


def make_case(
    model: Model, scene: Scene, method: str, road: Road = FLAT, *, wanted: Sequence[Output] | None = None, factor: float = 1.01
) -> Case:
    """A model with every quantity that natural coordinates tell."""
    scene = without_rods(model, scene)
    start = formulate_recursive(build_topology(model), scene, ())
    outputs = tuple(all_outputs(model) if wanted is None else wanted)
    try:
        return Case(formulate_lagrangian(start, method, outputs), road, factor)
    except ModelError as error:  # reactions of joints where others meet their bodies
        known = tuple(o for o in outputs if f"reaction '{o.element}'" not in {p.element for p in error.problems})
        if len(known) == len(outputs):
            raise
        return make_case(model, scene, method, road, wanted=known, factor=factor)


def without_rods(model: Model, scene: Scene) -> Scene:
    """The scene without forces on coordinates of distance joints, which have no attitude."""
    rods = {j.name for j in model.joints if not j.element.is_measured}
    off = {f.name: False for f in model.forces if isinstance(f, JointForce) and f.joint in rods}
    return replace(scene, switches={**scene.switches, **off})


def all_outputs(model: Model) -> list[Output]:
    """Every quantity of every element but cut joints and the rods of distance joints."""
    topology, joints = build_topology(model), {j.name: j for j in model.joints}
    tree = [t.joint for t in topology.tree if t.joint.element.is_measured]
    cuts = {j.name for j in topology.cuts}
    reactions = [r for r in model.reactions if r.joint in cuts and joints[r.joint].kind is not K.FIXED]
    rods = {j.name for j in model.joints if not j.element.is_measured}
    forces = [f for f in model.forces if not (isinstance(f, JointForce) and f.joint in rods)]
    elements = (*model.bodies, *model.markers, *forces, *tree, *model.gears)
    others = [o for r in reactions for o in forces_of(r)]
    return others + [Output(element=e.name, quantity=q, span=NOWHERE) for e in elements for q in quantities(e)]


# States and both evaluations


def random_state(case: Case, seed: int) -> dict[str, Any]:
    """Natural coordinates off the constraints, and relative ones."""
    equations, rng = case.equations, np.random.default_rng(seed)
    n, m = len(equations.coordinate_names), len(equations.equation_names)
    dense = DenseMechanism(equations.topology, equations.scene)
    relative_q, relative_v = random_models.state(dense.layout, dense.nq, dense.nv, rng)
    t, motion = np.array([rng.uniform(0.1, 2.0)]), np.array([float(seed != 1)])
    state = {"relative_q": relative_q, "relative_v": relative_v, "t": t, "motion": motion}
    placed = interpret(case, "initial_coordinates", state)
    return {
        **state, "q": placed["q"] + 0.05 * rng.standard_normal(n), "v": placed["v"] + rng.standard_normal(n),
        "vdot": rng.standard_normal(n), "lambda": rng.standard_normal(m), "w": rng.standard_normal(m), "penalty": np.array([0.7]),
        "weights": np.array([0.3, 0.2, 0.6]),
    }  # fmt: skip


#: The array that holds an input symbol's column, by what its name begins with.
ARRAYS = {"node": "q", "node_rate": "v", "node_acceleration": "vdot", "lambda": "lambda", "w": "w", "q": "relative_q", "v": "relative_v"}


def interpret(case: Case, function: str, state: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The results of a function by array, by the interpreter of the block IR; the tangent is dense."""
    equations = case.equations
    inputs = {"parameters": np.array(list(case.parameters.values())), **{k: np.asarray(v, dtype=float) for k, v in state.items()}}
    for symbol, slot in equations.slots.items():
        array = state.get(ARRAYS.get(symbol.partition(":")[0], ""))
        inputs[symbol] = np.zeros(len(slot.names)) if array is None else array[slot.offset : slot.offset + len(slot.names)]
    inputs |= evaluate_scene_inputs(equations, inputs["parameters"], float(inputs["t"][0]))
    results = equations.function(function).results
    values = interpret_blocks(results.values(), inputs, dict.fromkeys(equations.roads, Ground(case.road)))
    n, m, c = len(equations.coordinate_names), len(equations.equation_names), len(equations.columns)
    sizes = {"q": n, "v": n, "force_residual": n, "force": n, "residual": m, "rate": m, "curvature": m, "column": c}
    found = {array: np.zeros(size) for array, size in sizes.items()}
    size = n if equations.method == "augmented" else n + m
    found["tangent"] = np.zeros((size, size))
    for name, block in results.items():
        if name.startswith("tangent:"):
            row, column = map(int, name.removeprefix("tangent:").split(","))
            found["tangent"][row, column] = values[block][0, 0]
        else:
            slot = equations.slots[name]
            found[slot.array][slot.offset : slot.offset + len(slot.names)] = values[block][:, 0]
    return found


def run_generic(program: Path, case: Case, states: Sequence[Mapping[str, np.ndarray]], folder: Path) -> dict[str, Any]:
    """The generic solver's results."""
    scalars = ("t", "motion", "penalty")
    task = {
        "model": describe_generic_natural(case.equations), "parameters": case.parameters,
        "roads": {name: case.road.described() for name in case.equations.roads},
        "states": [{k: float(v[0]) if k in scalars else v.tolist() for k, v in state.items()} for state in states],
    }  # fmt: skip
    (folder / "task.json").write_text(json.dumps(task))
    done = subprocess.run([program, folder / "task.json"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    results: dict[str, Any] = json.loads(done.stdout)
    return results


def dense_tangent(results: Mapping[str, Any], values: Sequence[float]) -> np.ndarray:
    """The tangent of the generic solver's pattern, where no entry stands twice."""
    first, rows = results["first"], results["row"]
    size = len(first) - 1
    assert first[-1] == len(rows) == len(values)
    matrix = np.zeros((size, size))
    for column in range(size):
        own = rows[first[column] : first[column + 1]]
        assert own == sorted(set(own))
        assert all(row >= column for row in own) or not results["symmetric"]
        matrix[own, column] = values[first[column] : first[column + 1]]
    return matrix


def check_agreement(program: Path, case: Case, folder: Path, count: int = 2) -> None:
    states = [random_state(case, seed) for seed in range(count)]
    results = run_generic(program, case, states, folder)
    assert results["coordinates"] == list(case.equations.coordinate_names)
    assert results["equations"] == list(case.equations.equation_names)
    assert results["symmetric"] is (case.equations.method == "augmented")
    assert results["loading"] == 0
    for state, found in zip(states, results["states"], strict=True):
        assert found["allocations"] == 0
        check_state(case, state, {**found, "tangent": dense_tangent(results, found["tangent"])})


def check_state(case: Case, state: Mapping[str, np.ndarray], found: Mapping[str, Any]) -> None:
    place, balance, linear, close, pull, report = (
        interpret(case, f, state) for f in (
            "initial_coordinates", "dynamic_residual", "linearise", "constraint_residual", "apply_jacobian_transposed", "report"
        )
    )
    wanted = {
        "q": place["q"], "v": place["v"], "balance": balance["force_residual"], "residual": balance["residual"],
        "linear_balance": linear["force_residual"], "linear_residual": linear["residual"], "tangent": linear["tangent"],
        "phi": close["residual"], "rate": close["rate"], "curvature": close["curvature"], "force": pull["force"],
    }  # fmt: skip
    for name, value in wanted.items():
        difference = np.abs(np.array(found[name]) - value).max(initial=0.0)
        assert difference <= EXACT * np.abs(value).max(initial=1.0), f"{name} differs by {difference:.2e}"
    reactions = {r.name for r in case.equations.topology.model.reactions}
    for output, one, other in zip(case.equations.outputs, found["column"], report["column"], strict=True):
        if output.element not in reactions:  # see test_reactions
            assert one == pytest.approx(other, rel=EXACT, abs=EXACT), output.column


MODEL_CASES: Mapping[str, tuple[str, str, Road]] = {
    "iltis in the slalom": ("iltis", "simul3", FLAT),
    "iltis with bumpers over steps": ("iltis", "simul1s", STEPPED),
    "iltis steered on a wavy road": ("iltis", "iavsd_sine_2mm", WAVY),
    **{name: (name, "", FLAT) for name in ("four_bar", "pendulum", "andrews", "flyball", "slider_crank")},
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", MODEL_CASES)
def test_models(name: str, method: str, program: Path, tmp_path: Path) -> None:
    file, chosen, road = MODEL_CASES[name]
    model = read_model(MODELS / f"{file}.yaml")
    scene = model.scenes[chosen] if chosen else next(iter(model.scenes.values()))
    check_agreement(program, make_case(model, scene, method, road), tmp_path)


@pytest.mark.parametrize("is_reversed", [False, True], ids=["forward", "reversed"])
@pytest.mark.parametrize("kind", TREE_KINDS)
def test_tree_joints_and_forces(kind: JointKind, is_reversed: bool, program: Path, tmp_path: Path) -> None:
    model = random_models.tree_with(kind, is_reversed, 1)
    check_agreement(program, make_case(model, random_models.scene(), METHODS[is_reversed]), tmp_path)


@pytest.mark.parametrize("kind", CUT_KINDS)
def test_cut_joints(kind: JointKind, program: Path, tmp_path: Path) -> None:
    check_agreement(program, make_case(random_models.loop_with(kind, "twice", 0), random_models.scene(), "classical"), tmp_path)


@pytest.mark.parametrize("seed", range(6))
def test_coupled_loops(seed: int, program: Path, tmp_path: Path) -> None:
    """Nested loops with guides, massless links and points that several bodies share."""
    check_agreement(program, make_case(random_models.random_loops(seed), random_models.scene(), METHODS[seed % 2]), tmp_path)


@pytest.mark.parametrize("seed", range(6))
def test_geared_tree(seed: int, program: Path, tmp_path: Path) -> None:
    model = random_models.with_gears(random_models.random_tree(seed), seed, [kind for kind in JOINTS if JOINTS[kind].is_measured])
    assert model.gears
    check_agreement(program, make_case(model, random_models.scene(), METHODS[seed % 2]), tmp_path)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("kind", MEASURED)
def test_guided_joints(kind: JointKind, method: str, program: Path, tmp_path: Path) -> None:
    w = workshop(0, f"guided {kind}")
    body = w.guided(w.grow(GROUND, K.REVOLUTE), kind)
    w.grow(body, K.SPHERICAL)
    model = w.model()
    position, rate = random_models.variable("position"), random_models.variable("rate")
    coordinate = COORDINATES[kind][-1]
    brake = JointForce(
        name="brake", joint=model.joints[1].name, coordinate=coordinate, unit=JOINTS[kind].units[coordinate],
        law=-3 * position - rate**3, active=True, span=NOWHERE,
    )  # fmt: skip
    model = replace(model, forces=(brake,))
    check_agreement(program, make_case(model, random_models.scene(), method), tmp_path)


def test_left_out_equations(program: Path, tmp_path: Path) -> None:
    """A system from which dependent equations were taken out."""
    model = read_model(MODELS / "four_bar.yaml")
    scene = next(iter(model.scenes.values()))
    whole = make_case(model, scene, "classical").equations
    left_out = whole.equation_names[1::4]
    case = Case(formulate_lagrangian(whole.start, "classical", whole.outputs, left_out=left_out))
    assert [name for name in whole.equation_names if name not in left_out] == list(case.equations.equation_names)
    check_agreement(program, case, tmp_path)


# Runs of the generic simulator

SOLVERS = {"augmented": ("cholmod", "eigen-ldlt"), "classical": ("klu", "umfpack", "eigen-lu")}


@pytest.mark.parametrize(("method", "solver"), [(method, solver) for method, solvers in SOLVERS.items() for solver in solvers])
def test_runs_with_a_library_solver(method: str, solver: str, tmp_path: Path) -> None:
    """The four-bar linkage as in the recursive method with the same step, but for what the two rules differ in, of second order."""
    wanted = run_four_bar(tmp_path, "recursive", None)
    found = run_four_bar(tmp_path, method, solver)
    assert wanted.keys() == found.keys()
    assert len(found["tip.x"]) > 50
    for name in ("tip.x", "tip.y"):
        assert found[name] == pytest.approx(wanted[name], abs=1e-4), name


def test_has_no_factorisation_of_its_own(tmp_path: Path) -> None:
    with pytest.raises(SimulatorError, match="no solver 'emitted' in this simulator, which has eigen-lu, klu, umfpack"):
        run_four_bar(tmp_path, "classical", "emitted")


def run_four_bar(folder: Path, method: str, solver: str | None) -> Mapping[str, np.ndarray]:
    """The columns of a second of its motion."""
    model = read_model(MODELS / "four_bar.yaml")
    scene = replace(next(iter(model.scenes.values())), end=1.0)
    start = formulate_recursive(build_topology(model), scene, ())
    if method == "recursive":
        described = describe_generic(start.topology, scene, scene.outputs)
    else:
        equations = formulate_lagrangian(start, method, scene.outputs)
        dependent = dependent_equations(equations, closed_states(equations)) if method == "classical" else []
        described = describe_generic_natural(formulate_lagrangian(start, method, scene.outputs, left_out=dependent))
    (folder / "model.json").write_text(json.dumps(described))
    run_file = make_run_file(
        model, scene, {}, task="simulate", method=method, options=Options(solver=solver), out=str(folder / "table.csv"),
        implementation=Implementation.GENERIC,
    )
    summary = call_simulator(build_generic().path, {**run_file.entries(), "model": str(folder / "model.json")})
    assert failure_of(summary) is None
    return read_table(folder / "table.csv")[1]


# Reactions, against the recursive formulation where the mechanism moves as it must

SHARING = (K.SPHERICAL, K.UNIVERSAL)
ACROSS = (K.PRISMATIC, K.CYLINDRICAL, K.SCREW, K.PLANAR, K.POINT_ON_LINE, K.DISTANCE)


#: A screw does not close the guided loop.
CLOSED = [(kind, closing) for kind in (*SHARING, *ACROSS) for closing in ("roots", "guided") if (kind, closing) != (K.SCREW, "guided")]


@pytest.mark.parametrize(("kind", "closing"), CLOSED)
def test_reactions(kind: JointKind, closing: str, program: Path, tmp_path: Path) -> None:
    model = with_reactions(random_models.loop_with(kind, closing, 0))
    across = {j.name for j in model.joints if j.cut or j.kind in ACROSS}
    wanted = [o for r in model.reactions if r.joint in across for o in forces_of(r)]
    case = make_case(model, random_models.scene(), "classical", wanted=wanted, factor=1.0)
    assert case.equations.outputs
    state, expected = moving_state(case)
    (found,) = run_generic(program, case, [state], tmp_path)["states"]
    for output, value in zip(case.equations.outputs, found["column"], strict=True):
        wanted_value = expected[output.element, output.quantity]
        assert value == pytest.approx(wanted_value, rel=1e-6, abs=1e-6 * np.abs(state["lambda"]).max()), output.column


def forces_of(reaction: Reaction) -> list[Output]:
    """The components of the force."""
    names = [q for q in quantities(reaction) if q[0] in "fF"]
    return [Output(element=reaction.name, quantity=q, span=NOWHERE) for q in names]


def moving_state(case: Case) -> tuple[dict[str, np.ndarray], dict[tuple[str, str], float]]:
    """A closed pose with the speeds, accelerations and multipliers of its motion, and what the dense oracle reports there.

    The directions of some cut joints have three equations where two would do; that leaves moments undetermined, but no force.
    """
    equations = case.equations
    dense = DenseMechanism(equations.topology, equations.scene)
    at = Instant(q=explore(equations.start)[-1].q, v=np.zeros(dense.nv))
    closures = dense.closures(at)
    jacobian = closures.jacobian
    free = np.linalg.svd(jacobian)[2][np.linalg.matrix_rank(jacobian, tol=1e-8) :].T
    v = np.linalg.lstsq(jacobian, -closures.rate, rcond=None)[0] + free @ np.random.default_rng(0).standard_normal(free.shape[1])
    at = Instant(q=at.q, v=v)
    motion, closures = dense.motion(at), dense.closures(at)
    M, bias = dense.inertia(motion)
    vdot, multipliers = solve_motion(M, jacobian, dense.applied(at, motion) - bias, -closures.drift)
    return natural_state(case, at), reported(dense, at, vdot, multipliers)


def natural_state(case: Case, at: Instant) -> dict[str, np.ndarray]:
    n, m = len(case.equations.coordinate_names), len(case.equations.equation_names)
    zero = {"vdot": np.zeros(n), "lambda": np.zeros(m), "w": np.zeros(m), "penalty": np.zeros(1), "weights": np.array([0.0, 0.0, 1.0])}
    state = {"relative_q": at.q, "relative_v": at.v, "t": np.array([at.t]), "motion": np.array([at.motion]), **zero}
    placed = interpret(case, "initial_coordinates", state)
    state |= {"q": placed["q"], "v": placed["v"]}
    linear, close = interpret(case, "linearise", state), interpret(case, "constraint_residual", state)
    assert np.abs(close["residual"]).max() < 1e-8
    assert np.abs(close["rate"]).max() < 1e-7
    K = linear["tangent"]
    vdot, multipliers = solve_motion(K[:n, :n], K[n:, :n], -linear["force_residual"], -close["curvature"])
    return {**state, "vdot": vdot, "lambda": multipliers}


def solve_motion(M: np.ndarray, jacobian: np.ndarray, force: np.ndarray, bend: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """M vdot + J^T lambda = force, J vdot = bend."""
    m = len(jacobian)
    system = np.block([[M, jacobian.T], [jacobian, np.zeros((m, m))]])
    solution, *_ = np.linalg.lstsq(system, np.concatenate([force, bend]), rcond=1e-12)
    return solution[: len(M)], solution[len(M) :]
