"""Natural coordinates against the recursive formulation, which shares no equation with them, and against differences.

A state of the tree is placed in natural coordinates.  There all constraints hold, as many are independent as the degrees of freedom tell,
and the motion that M qdd + Phi_q^T lambda = Q asks for is that of the recursive formulation, in every reported quantity.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import sympy

from cutjoint.analysis.closing import design_coordinates, evaluate_closures, explore, retract
from cutjoint.analysis.natural import call, closed_states, constraint_jacobian, dependent_equations
from cutjoint.elements.joints import JOINTS
from cutjoint.formulate.natural.equations import LagrangianEquations, formulate_lagrangian
from cutjoint.formulate.natural.nodes import NodeKind
from cutjoint.formulate.records import NAMES
from cutjoint.model.errors import ModelError
from cutjoint.model.expressions.quantities import quantities
from cutjoint.model.read import read_model
from cutjoint.model.records import JointForce, JointKind, Model, Output, Scene, Tyre
from cutjoint.run.scenes import find_scene
from cutjoint.sparse.pattern import Pattern, make_pattern, places
from cutjoint.sparse.pattern import dense as full
from cutjoint.topology.build import build_topology
from tests.conftest import with_heavy
from tests.mechanisms import random_models
from tests.mechanisms.random_models import CUT_KINDS, MEASURED, NOWHERE, TIME, TREE_KINDS, K, scene, workshop
from tests.oracles.dense import Instant, Numerics
from tests.oracles.evaluation import BlockMechanism

Array = np.ndarray
MODELS = Path(__file__).parents[2] / "models"
SCENE = scene({"drive": 0.1 + sympy.sin(2 * TIME) / 5})
#: No stabilisation: what is solved is Phidd = 0.
EXACT = Numerics(penalty=1e5, damping_ratio=0.0, frequency=0.0)
TIME_NOW = 0.37


class Hills:
    """A road with height, slope and curvature."""

    def height(self, x: float, y: float) -> float:
        return 0.01 * np.sin(3 * x)

    def slope(self, x: float, y: float) -> float:
        return 0.03 * np.cos(3 * x)

    height_dx = slope

    def slope_dx(self, x: float, y: float) -> float:
        return -0.09 * np.sin(3 * x)


@dataclass(frozen=True)
class Pair:
    """Both formulations of a model."""

    recursive: BlockMechanism
    natural: LagrangianEquations
    pattern: Pattern
    roads: dict[str, Hills]

    @property
    def parameters(self) -> Array:
        return self.recursive.parameters

    @property
    def n(self) -> int:
        return len(self.natural.coordinate_names)

    @property
    def m(self) -> int:
        return len(self.natural.equation_names)

    def call(self, function: str, **arrays: Array) -> dict[str, Array]:
        now = {"t": np.array([TIME_NOW]), "motion": np.array([1.0]), "penalty": np.array([0.0]), "parameters": self.parameters}
        return call(self.natural, function, {**now, **arrays}, self.roads)

    def jacobian(self, q: Array, t: float) -> Array:
        """Phi_q, (m, n)."""
        if self.m == 0:
            return np.zeros((0, self.n))
        return np.broadcast_to(self.call("apply_jacobian_transposed", q=q, w=np.eye(self.m), t=np.array([t]))["force"], (self.m, self.n))

    def tangent(self, q: Array, v: Array, vdot: Array, weights: tuple[float, float, float]) -> Array:
        values = self.call("linearise", q=q, v=v, vdot=vdot, weights=np.array(weights))["tangent"]
        return full(self.pattern, values)


def make_pair(
    model: Model, chosen: Scene, outputs: tuple[Output, ...], method: str = "augmented", parameters: dict[str, float] | None = None
) -> Pair:
    topology = build_topology(model)
    roads = {f.name: Hills() for f in model.forces if isinstance(f, Tyre)}
    recursive = BlockMechanism(topology, chosen, outputs=outputs, roads=roads, parameters=parameters)
    natural = formulate_lagrangian(recursive.equations, method, outputs)
    size = len(natural.coordinate_names) + (len(natural.equation_names) if method == "classical" else 0)
    entries = [name.removeprefix("tangent:").split(",") for name in natural.function("linearise").results if name.startswith("tangent:")]
    pattern = make_pattern(size, [(int(i), int(j)) for i, j in entries], symmetric=method == "augmented")
    return Pair(recursive, natural.with_tangent(places(pattern)), pattern, roads)


def reported(model: Model) -> tuple[Output, ...]:
    """Every quantity that natural coordinates tell, but reactions."""
    rods = {j.name for j in model.joints if not j.element.is_measured}
    tree = [t.joint for t in build_topology(model).tree if t.joint.name not in rods]
    forces = [f for f in model.forces if not (isinstance(f, JointForce) and f.joint in rods)]
    elements = (*model.bodies, *model.markers, *forces, *tree, *model.gears)
    return tuple(Output(element=e.name, quantity=q, span=NOWHERE) for e in elements for q in quantities(e))


def without_rod_forces(model: Model) -> Model:
    rods = {j.name for j in model.joints if not j.element.is_measured}
    return replace(model, forces=tuple(f for f in model.forces if not (isinstance(f, JointForce) and f.joint in rods)))


def states(pair: Pair, seed: int) -> list[Instant]:
    """Closed poses with consistent speeds; of a tree any."""
    rng = np.random.default_rng(seed)
    equations = pair.recursive.equations
    found = []
    poses = [p.q for p in explore(equations)[:3] if p.closed] if equations.closures else [design_coordinates(equations)]
    for q in poses:
        if not equations.closures:
            q = retract(equations, q, 0.4 * rng.standard_normal(equations.speeds))
        v = rng.standard_normal(equations.speeds)
        if equations.closures:
            at = Instant(q=q, v=v, t=0.0)
            rate = pair.recursive.solve(at, np.zeros(len(equations.equation_names)), EXACT).rate
            v = v - np.linalg.pinv(evaluate_closures(equations, q)[1], rcond=1e-9) @ rate
        found.append(Instant(q=q, v=v, t=0.0))
    return found


def recursive_report(pair: Pair, at: Instant) -> dict[str, float]:
    """All quantities and the energy, with the accelerations of the augmented iteration carried to its end."""
    multipliers = np.zeros(len(pair.recursive.equations.equation_names))
    for _ in range(60):
        solution = pair.recursive.solve(at, multipliers, EXACT)
        multipliers = multipliers + solution.correction
    energy = pair.recursive.energy(at, solution.vdot, multipliers, EXACT)
    return pair.recursive.report(at, solution.vdot, multipliers, EXACT) | energy


def natural_report(pair: Pair, at: Instant) -> dict[str, float]:
    """All quantities and the energy, with the accelerations of [M, Phi_q^T; Phi_q, 0]."""
    now = {"t": np.array([at.t])}
    placed = pair.call("initial_coordinates", relative_q=at.q, relative_v=at.v, **now)
    q, v = placed["q"], placed["v"]
    zero = np.zeros(pair.n)
    closed = pair.call("constraint_residual", q=q, v=v, vdot=zero, **now)
    if pair.m:
        assert np.abs(closed["residual"]).max() < 1e-9
        assert np.abs(closed["rate"]).max() < 1e-8
    M = pair.tangent(q, v, zero, (0.0, 0.0, 0.0))
    J = pair.jacobian(q, at.t)
    force = pair.call("dynamic_residual", q=q, v=v, vdot=zero, **now)["force_residual"]
    scale = np.abs(M).max()
    K = np.block([[M, scale * J.T], [scale * J, np.zeros((pair.m, pair.m))]])
    bend = closed.get("curvature", np.zeros(0))
    x = np.linalg.lstsq(K, np.concatenate([-force, -scale * bend]), rcond=1e-13)[0]
    assert np.abs(K @ x - np.concatenate([-force, -scale * bend])).max() < 1e-7 * max(np.abs(force).max(), 1.0)
    solved = {"q": q, "v": v, "vdot": x[: pair.n], "lambda": scale * x[pair.n :], **now}
    column = pair.call("report", **solved)["column"]
    energy = dict(zip(NAMES, pair.call("energy", **solved)["energy"], strict=True))
    return {c.name: float(value) for c, value in zip(pair.natural.columns, column, strict=True)} | energy


def compare(model: Model, seed: int, chosen: Scene = SCENE, tolerance: float = 1e-6) -> None:
    model = without_rod_forces(model)
    pair = make_pair(model, chosen, reported(model))
    compared = 0
    for at in states(pair, seed):
        expected, found = recursive_report(pair, at), natural_report(pair, at)
        size = max(abs(x) for name, x in expected.items() if name.rpartition(".")[2] in ("ax", "ay", "az"))
        for name, value in found.items():
            if np.isnan(expected[name]):
                continue
            assert value == pytest.approx(expected[name], rel=tolerance, abs=tolerance * max(size, 1.0)), name
            compared += 1
    assert compared > 0


@pytest.mark.parametrize("direction", ["normal", "reversed"])
@pytest.mark.parametrize("kind", TREE_KINDS)
def test_tree_joint(kind: JointKind, direction: str) -> None:
    compare(random_models.tree_with(kind, direction == "reversed", 1), 1)


@pytest.mark.parametrize("closing", ["branch", "roots", "parent"])
@pytest.mark.parametrize("kind", CUT_KINDS)
def test_cut_joint(kind: JointKind, closing: str) -> None:
    compare(random_models.loop_with(kind, closing, CUT_KINDS.index(kind)), 2)


@pytest.mark.parametrize("seed", [0, 2])
def test_random_tree(seed: int) -> None:
    compare(random_models.random_tree(seed), seed)


@pytest.mark.parametrize("seed", [1, 3, 4])
def test_coupled_loops(seed: int) -> None:
    compare(random_models.random_loops(seed), seed)


@pytest.mark.parametrize("kind", MEASURED)
def test_guided_joint(kind: JointKind) -> None:
    w = workshop(0, f"guided {kind}")
    w.grow(w.guided(w.guided(w.grow("ground"), kind), kind))
    w.load_all()
    compare(w.model(), 0)


@pytest.mark.parametrize("bent", [False, True])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_geared_tree(seed: int, bent: bool) -> None:
    model = random_models.random_tree(seed)
    compare(random_models.with_gears(model, seed, [kind for kind in JOINTS if JOINTS[kind].is_measured], bent), seed)


@pytest.mark.parametrize("seed", [0, 1])
def test_contacts(seed: int) -> None:
    compare(random_models.with_contacts(random_models.random_tree(seed), seed), seed)


@pytest.mark.parametrize("seed", [0, 1])
def test_ball_springs(seed: int) -> None:
    compare(random_models.with_ball_springs(random_models.random_tree(seed), seed), seed)


def determined(pair: Pair, at: Instant) -> set[str]:
    """The columns that multipliers which change no force on the coordinates do not change."""
    placed = pair.call("initial_coordinates", relative_q=at.q, relative_v=at.v, t=np.array([at.t]))
    J = constraint_jacobian(pair.natural, {"q": placed["q"]})
    idle = np.linalg.svd(J.T)[2][np.linalg.matrix_rank(J, tol=1e-8) :]
    state = {"q": placed["q"], "v": placed["v"], "vdot": np.zeros(pair.n)}
    columns = [pair.call("report", **state, **{"lambda": multipliers})["column"] for multipliers in (np.zeros(pair.m), *idle)]
    return {c.name for i, c in enumerate(pair.natural.columns) if all(abs(x[i] - columns[0][i]) < 1e-8 for x in columns)}


#: The place at which a loop is closed, and the seed of its model.
LOOPS = (("branch", 3), ("roots", 0), ("roots", 5), ("parent", 2))


@pytest.mark.parametrize(
    "kind",
    with_heavy(
        [kind for kind in CUT_KINDS if kind is not K.FIXED],
        K.CYLINDRICAL, K.PRISMATIC, K.PLANAR, K.UNIVERSAL, K.SCREW, K.POINT_ON_LINE, K.DISTANCE,
    ),
)
def test_reaction_of_a_cut_joint(kind: JointKind) -> None:
    """A reaction that natural coordinates have and mechanics determines is that of the recursive formulation."""
    compared = 0
    for closing, seed in LOOPS:
        model = without_rod_forces(random_models.loop_with(kind, closing, seed))
        outputs = tuple(Output(element=r.name, quantity="force", span=NOWHERE) for r in model.reactions)
        with suppress(ModelError):
            pair = make_pair(model, SCENE, outputs)
            for at in states(pair, seed):
                expected, found, known = recursive_report(pair, at), natural_report(pair, at), determined(pair, at)
                for name in known:
                    bound = 1e-5 * max(1.0, abs(expected[name]))
                    assert found[name] == pytest.approx(expected[name], abs=bound), (closing, seed, name)
                    compared += 1
    assert compared > 0


# Models of the repository

SCENES = [("iltis", "simul3"), ("iltis", "simul1s"), ("four_bar", "swing"), ("andrews", None), ("flyball", None), ("slider_crank", None)]


def from_file(name: str, chosen: str | None, method: str = "augmented") -> Pair:
    model = read_model(MODELS / f"{name}.yaml")
    found = find_scene(model, chosen)
    return make_pair(model, found, found.outputs, method)


@pytest.mark.parametrize(("name", "chosen"), SCENES)
def test_model(name: str, chosen: str | None) -> None:
    """The scene's own outputs, among them the leaf springs' reactions."""
    pair = from_file(name, chosen)
    for at in states(pair, 3):
        expected, found = recursive_report(pair, at), natural_report(pair, at)
        for column, value in found.items():
            assert value == pytest.approx(expected[column], rel=1e-6, abs=1e-5), column


@pytest.mark.parametrize(
    ("name", "chosen", "coordinates", "equations", "freedom"),
    [("iltis", "simul1", 75, 65, 10), ("four_bar", "swing", 13, 14, 1), ("andrews", None, 34, 36, 1), ("flyball", None, 24, 20, 4)],
)
def test_coordinates_and_equations(name: str, chosen: str | None, coordinates: int, equations: int, freedom: int) -> None:
    pair = from_file(name, chosen)
    assert (pair.n, pair.m) == (coordinates, equations)
    for state in closed_states(pair.natural):
        J = constraint_jacobian(pair.natural, {"q": state.q})
        assert coordinates - np.linalg.matrix_rank(J, tol=1e-6) == freedom


def test_equations_that_depend_on_others_are_found() -> None:
    """A plane mechanism in space: three bodies of the squeezer, and both couplers of the four-bar, are held in their plane twice."""
    for name, expected in (("four_bar", 2), ("andrews", 3), ("iltis", 0)):
        pair = from_file(name, "simul1" if name == "iltis" else None, "classical")
        found = dependent_equations(pair.natural, closed_states(pair.natural))
        assert len(found) == expected
        assert all("crank" in equation and "axis" in equation for equation in found)
        kept = formulate_lagrangian(pair.recursive.equations, "classical", pair.natural.outputs, left_out=found)
        assert len(kept.equation_names) == pair.m - expected
        assert set(kept.equation_names) == set(pair.natural.equation_names) - set(found)
        for state in closed_states(kept):
            J = constraint_jacobian(kept, {"q": state.q})
            assert np.linalg.matrix_rank(J, tol=1e-6) == len(J)


def differences(pair: Pair, q: Array, v: Array, vdot: Array) -> tuple[Array, Array, Array, Array]:
    """M, C, K and Phi_q by central differences of balance and residual, multipliers zero."""
    h = 1e-6

    def matrix(name: str) -> tuple[Array, Array]:
        moved = {"q": q, "v": v, "vdot": vdot}
        moved[name] = moved[name] + h * np.multiply.outer([1, -1], np.eye(pair.n))
        values = pair.call("dynamic_residual", **moved)
        both = (np.broadcast_to(values[of], (2, pair.n, values[of].shape[-1])) for of in ("force_residual", "residual"))
        forces, gaps = ((up - down).T / (2 * h) for up, down in both)
        return forces, gaps

    (K, J), (C, _), (M, _) = matrix("q"), matrix("v"), matrix("vdot")
    return M, C, K, J


def moving_state(pair: Pair, name: str) -> tuple[Array, Array, Array]:
    """Off the constraints, and with a car at speed."""
    rng = np.random.default_rng(5)
    state = closed_states(pair.natural)[0]
    q, v, vdot = state.q + 1e-2 * rng.standard_normal(pair.n), rng.standard_normal(pair.n), rng.standard_normal(pair.n)
    if name == "iltis":
        for i, coordinate in enumerate(pair.natural.coordinate_names):
            kind = next(n.kind for n in pair.natural.layout.coordinates if coordinate.startswith(n.name))
            v[i] = 0.1 * v[i] + (5.0 if coordinate.endswith(".x") and kind is NodeKind.POINT else 0.0)
    return q, v, vdot


@pytest.mark.parametrize(("name", "chosen"), SCENES)
def test_tangents(name: str, chosen: str | None) -> None:
    """The symmetric part of M + c C + k K and Phi_q^T Phi_q of the augmented method, the whole matrix of the classical one."""
    damping, stiffness, constraint = 0.01, 0.003, 2.0
    for method in ("augmented", "classical"):
        pair = from_file(name, chosen, method)
        q, v, vdot = moving_state(pair, name)
        M, C, K, J = differences(pair, q, v, vdot)
        A = M + damping * C + stiffness * K
        expected = (A + A.T) / 2 + constraint * J.T @ J
        if method == "classical":
            expected = np.block([[A, constraint * J.T], [constraint * J, np.zeros((pair.m, pair.m))]])
        found = pair.tangent(q, v, vdot, (damping, stiffness, constraint))
        assert np.abs(found - expected).max() < 2e-8 * np.abs(expected).max()


@pytest.mark.parametrize("balls", [False, True])
@pytest.mark.parametrize("seed", [1, 3])
def test_tangents_of_random_models(seed: int, balls: bool) -> None:
    model = without_rod_forces(random_models.random_loops(seed))
    pair = make_pair(random_models.with_ball_springs(model, seed) if balls else model, SCENE, (), "classical")
    rng = np.random.default_rng(seed)
    q, v, vdot = (rng.standard_normal(pair.n) for _ in range(3))
    M, C, K, J = differences(pair, q, v, vdot)
    A = M + 0.1 * C + 0.01 * K
    expected = np.block([[A, J.T], [J, np.zeros((pair.m, pair.m))]])
    found = pair.tangent(q, v, vdot, (0.1, 0.01, 1.0))
    assert np.abs(found - expected).max() < 1e-7 * np.abs(expected).max()


def test_an_open_parameter_moves_the_points() -> None:
    """Natural coordinates follow a geometry that is known only when parameters are loaded."""
    model = without_rod_forces(random_models.random_loops(1))
    pair = make_pair(model, SCENE, ())
    design = design_coordinates(pair.recursive.equations)
    values = [pair.call("initial_coordinates", relative_q=design, parameters=np.array([size]))["q"] for size in (1.15, 1.4)]
    assert np.abs(values[0] - values[1]).max() > 0.01
    for q, size in zip(values, (1.15, 1.4), strict=True):
        shapes = pair.call("constraint_residual", q=q, parameters=np.array([size]))["residual"]
        guided = [i for i, name in enumerate(pair.natural.equation_names) if "guide" in name]
        assert np.abs(np.delete(shapes, guided)).max() < 1e-9


COINCIDENT = """
cutjoint: 1
name: coincident
gravity: [0, 0, -9.81]
parameters: {reach: {value: 0.3, unit: m, binding: param}}
bodies:
  arm: {mass: 2, centre_of_mass: [0.1, 0.1, 0], inertia: [0.1, 0.2, 0.3]}
joints:
  ball: {kind: spherical, bodies: [ground, arm], at: [0.3, 0, 0]}
forces:
  spring: {kind: point_spring, bodies: [ground, arm], from: [1, 1, 1], to: [reach, 0, 0], law: "50*length"}
scenes: {swing: {end: 1}}
"""


@pytest.mark.parametrize("reach", [0.3, 0.36])
def test_points_that_coincide_by_a_default_alone_stay_apart(reach: float, tmp_path: Path) -> None:
    """A spring's end that a tunable parameter puts into the joint, or beside it."""
    path = tmp_path / "coincident.yaml"
    path.write_text(COINCIDENT, encoding="utf-8")
    model = read_model(path)
    pair = make_pair(model, model.scenes["swing"], reported(model), parameters={"reach": reach})
    (at,) = states(pair, 1)
    expected, found = recursive_report(pair, at), natural_report(pair, at)
    for name, value in found.items():
        assert value == pytest.approx(expected[name], rel=1e-9, abs=1e-9), name


def test_a_rod_has_no_angles() -> None:
    model = random_models.tree_with(K.DISTANCE, False, 1)
    rod = next(j for j in model.joints if j.kind is K.DISTANCE)
    output = Output(element=rod.name, quantity="angle_1", span=NOWHERE)
    with pytest.raises(ModelError, match="do not have the coordinates of a distance joint"):
        make_pair(without_rod_forces(model), SCENE, (output,))
