"""The generic solver, which interprets a model at run time, against the interpreter of the block IR."""

from __future__ import annotations

import json
import math
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cutjoint.analysis.closing import evaluate_scene_inputs
from cutjoint.elements.joints import JOINTS
from cutjoint.formulate.inputs import LAW_TIME, tunable_parameters
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.model.expressions.quantities import quantities
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import GROUND, Model, Output, Scene
from cutjoint.program.interpret import interpret_blocks
from cutjoint.topology.build import build_topology
from cutjoint_bench.generic.build import build_generic
from cutjoint_bench.generic.mechanism import describe_generic
from tests.conftest import needs_cpp
from tests.formulate.test_cut_coordinates import cut_at
from tests.formulate.test_shafts import SHAFTS
from tests.mechanisms import random_models
from tests.mechanisms.cut_coordinates import outputs_of_cuts, with_forces_on_cuts
from tests.mechanisms.joint_examples import EXAMPLES
from tests.mechanisms.random_models import CUT_KINDS, GUIDABLE
from tests.runtime.points import NUMERICS

pytestmark = [needs_cpp, pytest.mark.heavy]  # compiling the generic solver takes minutes

MODELS = Path(__file__).resolve().parents[2] / "models"

#: Largest difference of accelerations and corrections, relative to the largest element, by penalty.  The penalty costs all
#: implementations digits alike: masses are known to about penalty * 1e-16 kg.  The generic one eliminates joint by joint
#: what the block program eliminates at once, so that both roundings count in full.
TOLERANCES = {1e4: 1e-10, 1e9: 4e-7}

#: Tolerances of steps that close the residual, forty times as much: the generic one takes them from two evaluations with forces
#: of penalty times residual, whose difference loses more digits (1.0e-9 was seen at 1e4).
STEPS = {1e4: 4e-9, 1e9: 4e-6}

#: Tolerances of residuals, rates and columns, which have no such loss.
EXACT = 1e-11


@dataclass(frozen=True)
class Piece:
    """A stretch of road, as in runtime/include/cutjoint/core/roads/road.hpp."""

    kind: str
    start: float
    a: float
    b: float
    c: float = 0.0

    def height(self, x: float) -> float:
        match self.kind:
            case "arc":
                return self.a + math.sqrt(max(self.b**2 - (x - self.c) ** 2, 0.0))
            case "cosine":
                return self.a + self.b * (1 - math.cos(self.c * (x - self.start)))
        return self.a + self.b * (x - self.start)

    def slope(self, x: float) -> float:
        match self.kind:
            case "arc":
                return -(x - self.c) / math.sqrt(max(self.b**2 - (x - self.c) ** 2, 1e-12))
            case "cosine":
                return self.b * self.c * math.sin(self.c * (x - self.start))
        return self.b


@dataclass(frozen=True)
class Road:
    """Two tracks of pieces in the order of x."""

    left: tuple[Piece, ...]
    right: tuple[Piece, ...]
    disc: bool = False

    def height(self, x: float, y: float) -> float:
        return self._at(x, y).height(x)

    def slope(self, x: float, y: float) -> float:
        return 0.0 if self.disc else self._at(x, y).slope(x)

    def _at(self, x: float, y: float) -> Piece:
        pieces = self.left if y > 0 else self.right
        return next((p for p in reversed(pieces) if p.start <= x), pieces[0])

    def described(self) -> dict[str, Any]:
        return {"left": [vars(p) for p in self.left], "right": [vars(p) for p in self.right], "disc": self.disc}


FLAT = Road((Piece("line", 0.0, 0.0, 0.0),), (Piece("line", 0.0, 0.0, 0.0),))
WAVY = Road(
    (Piece("line", -1.5, -0.02, 0.01), Piece("cosine", 0.0, 0.0, 0.02, 2.0)),
    (Piece("cosine", -2.0, 0.0, 0.01, 3.0), Piece("line", 0.5, 0.01, -0.03)),
)
STEPPED = Road(
    (Piece("line", -2.0, 0.01, 0.0), Piece("arc", -0.5, -0.35, 0.36, -0.4), Piece("line", 0.0, 0.0, 0.0)),
    (Piece("arc", -2.0, -0.36, 0.37, -1.0), Piece("line", 0.0, 0.02, 0.01)),
    disc=True,
)


@pytest.fixture(scope="session")
def generic() -> Path:
    """The generic solver's binary, the one of `--implementation generic`."""
    return build_generic().path


@dataclass(frozen=True)
class Case:
    """A model in a scene, ready for both implementations."""

    equations: RecursiveEquations
    description: dict[str, Any]
    road: Road
    penalty: float

    @property
    def numerics(self) -> dict[str, float]:
        """Figures of the cut joints; the damping ratio is not one, so that a factor left out shows."""
        return {"penalty": self.penalty, "damping_ratio": 0.7, "frequency": 12.0}

    @property
    def parameters(self) -> dict[str, float]:
        """Values that differ from the defaults, so that a default taken for a value shows."""
        return {p.name: 1.01 * p.value for p in tunable_parameters(self.equations.topology.model)}


def make_case(model: Model, scene: str | Scene, road: Road = FLAT, penalty: float = 1e4, outputs: tuple[Output, ...] = ()) -> Case:
    topology, chosen = build_topology(model), scene if isinstance(scene, Scene) else model.scenes[scene]
    wanted = outputs or chosen.outputs
    equations = formulate_recursive(topology, chosen, wanted, closure="penalty")
    return Case(equations, describe_generic(topology, chosen, wanted), road, penalty)


def random_state(equations: RecursiveEquations, random: np.random.Generator, spread: float) -> dict[str, Any]:
    """A state near the design position."""
    q = spread * random.standard_normal(equations.coordinates)
    for chart in equations.charts:
        if chart.ball:
            first = chart.q + chart.scalars
            q[first] += 1.0
            q[first : first + 4] /= np.linalg.norm(q[first : first + 4])
    return {
        "t": float(random.uniform(0.1, 2.0)),
        "q": q.tolist(),
        "v": random.standard_normal(equations.speeds).tolist(),
        "lambda": (1e3 * random.standard_normal(len(equations.equation_names))).tolist(),
    }


def run_task(generic: Path, case: Case, folder: Path, task: dict[str, Any]) -> dict[str, Any]:
    """The generic solver's summary of a task."""
    (folder / "model.json").write_text(json.dumps(case.description))
    run = {
        "model": str(folder / "model.json"), "parameters": case.parameters, "numerics": NUMERICS,
        "stabilisation": {"closure": "penalty", **case.numerics}, "integrator": "trapezoidal", "solver": None, "pose": "design", "end": 1.0,
        "output_step": 1.0, "roads": {name: case.road.described() for name in case.equations.roads}, **task,
    }  # fmt: skip
    (folder / "run.json").write_text(json.dumps(run))
    done = subprocess.run([generic, folder / "run.json"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    summary: dict[str, Any] = json.loads(done.stdout)
    return summary


def run_generic(generic: Path, case: Case, states: list[dict[str, Any]], folder: Path) -> list[dict[str, np.ndarray]]:
    """The results of the generic solver's task "evaluate"."""
    results = run_task(generic, case, folder, {"task": "evaluate", "states": states})["results"]
    return [{name: np.array(values) for name, values in result.items()} for result in results]


def interpret(case: Case, state: Mapping[str, Any], vdot: np.ndarray) -> dict[str, np.ndarray]:
    """Results of the generic solver's functions by the interpreter of the block IR; the columns are those of the given accelerations."""
    equations = case.equations
    inputs = block_inputs(case, state, vdot)
    residuals = {c.joint: equations.function("constraint_residual").results[f"residual:{c.joint}"] for c in equations.closures}
    gaps = interpret_blocks(residuals.values(), inputs, {})
    inputs |= {f"violation:{joint}": gaps[block][:, 0] for joint, block in residuals.items()}
    results = {name: block for function in equations.functions for name, block in function.results.items()}
    values = interpret_blocks(results.values(), inputs, dict.fromkeys(equations.roads, case.road))

    def gathered(kind: str) -> np.ndarray:
        parts = [values[block].ravel() for name, block in results.items() if name.startswith(f"{kind}:")]
        return np.concatenate([np.zeros(0), *parts])

    named = {kind: gathered(kind) for kind in ("vdot", "correction", "residual", "rate", "dz")}
    return {**named, "columns": gathered("column")}


def block_inputs(case: Case, state: Mapping[str, Any], vdot: np.ndarray) -> dict[str, np.ndarray]:
    equations = case.equations
    q, v, multipliers = (np.array(state[key]) for key in ("q", "v", "lambda"))
    parameters = np.array(list(case.parameters.values()))
    inputs = {
        **evaluate_scene_inputs(equations, parameters, state["t"]), LAW_TIME: np.array([state["t"]]),
        "t": np.array([state["t"]]), "motion": np.ones(1), "parameters": parameters,
        "numerics": np.array(list(case.numerics.values())),
    }  # fmt: skip
    for chart in equations.charts:
        speeds = slice(chart.v, chart.v + len(chart.speed_names))
        inputs[f"q:{chart.joint}"] = q[chart.q : chart.q + chart.scalars + 4 * chart.ball]
        inputs[f"v:{chart.joint}"], inputs[f"vdot:{chart.joint}"] = v[speeds], vdot[speeds]
    for closure in equations.closures:
        inputs[f"lambda:{closure.joint}"] = multipliers[closure.first : closure.first + len(closure.names)]
    return inputs


def check_agreement(generic: Path, case: Case, folder: Path, count: int = 4, spread: float = 0.02) -> None:
    states = [random_state(case.equations, np.random.default_rng(seed), spread) for seed in range(count)]
    for state, found in zip(states, run_generic(generic, case, states, folder), strict=True):
        for name, wanted in interpret(case, state, found["vdot"]).items():
            assert found[name].shape == wanted.shape, name
            own_size = np.maximum(np.abs(wanted), 1.0) if name == "columns" else np.abs(wanted).max(initial=1.0)
            worst = np.abs((found[name] - wanted) / own_size).max(initial=0.0)
            loose = {"vdot": TOLERANCES, "correction": TOLERANCES, "dz": STEPS}.get(name, {})
            tolerance = loose.get(case.penalty, EXACT)
            assert worst <= tolerance, f"{name} differs by {worst:.2e}"


CASES: Mapping[str, tuple[str, str, Road]] = {
    "iltis with bumpers over steps": ("iltis", "simul1s", STEPPED),
    "iltis steered on a wavy road": ("iltis", "iavsd_sine_2mm", WAVY),
    "iltis in the slalom": ("iltis", "simul3", FLAT),
    "four_bar": ("four_bar", "swing", FLAT),
}


@pytest.mark.parametrize("penalty", TOLERANCES)
@pytest.mark.parametrize("name", CASES)
def test_agrees_with_the_block_interpreter_on_models(
    name: str, penalty: float, generic: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Loops are resolved in global axes, as the generic solver does it."""
    monkeypatch.setattr("cutjoint.formulate.recursive.equations.resolving_body", lambda topology: GROUND)
    model, scene, road = CASES[name]
    check_agreement(generic, make_case(read_model(MODELS / f"{model}.yaml"), scene, road, penalty), tmp_path)


def test_agrees_on_shafts_without_mass(generic: Path, tmp_path: Path) -> None:
    check_agreement(generic, make_case(read_model_text(SHAFTS, "shafts.yaml"), "run"), tmp_path)


# Small models with one element of each kind.

PARAMETERS = {
    "reach": {"value": 0.3, "unit": "m", "binding": "param"},
    "heavy": {"value": 2.0, "unit": "kg", "binding": "param"},
    "light": {"value": 0.4, "unit": "kg"},
    "drive": {"value": 0.1, "binding": "input"},
}


def rigid(x: float, y: float, mass: float | str = "heavy") -> dict[str, Any]:
    return {"mass": mass, "centre_of_mass": [x, y, "reach"], "inertia": [0.5, 0.6, 0.7, 0.01, 0.02, -0.03]}


def small_model(**parts: Any) -> Model:
    """Three bodies: ``left`` on a skew hinge, ``right`` free, ``tip`` on the left one unless a joint ``arm`` says otherwise."""
    joints = {
        "hinge": {"kind": "revolute", "bodies": ["ground", "left"], "at": [0, 0, 0.1], "axis": [1, 2, 0.5]},
        "flight": {"kind": "free", "bodies": ["ground", "right"], "at": [1, 0, 0]},
        "arm": {"kind": "spherical", "bodies": ["left", "tip"], "at": [0.2, "reach", 0.1]},
        **parts.pop("joints", {}),
    }
    bodies = {"left": rigid(0.1, 0.2), "right": rigid(1.0, 0.1, "light"), "tip": rigid(0.3, 0.5)}
    document = {
        "cutjoint": 1, "name": "small", "gravity": [0.1, -0.2, -9.81], "parameters": PARAMETERS, "bodies": bodies,
        "joints": {name: joint for name, joint in joints.items() if joint},
        "scenes": {"run": {"end": 1, "inputs": {"drive": "0.2*sin(3*t)"}}}, **parts,
    }  # fmt: skip
    return read_model_text(json.dumps(document), "small.yaml")


def all_outputs(model: Model) -> tuple[Output, ...]:
    """Every quantity of every element that has any."""
    topology = build_topology(model)
    tree = [t.joint for t in topology.tree]
    elements = (*model.bodies, *tree, *model.gears, *model.forces, *model.reactions, *model.markers)
    of_elements = tuple(Output(element=e.name, quantity=q, span=e.span) for e in elements for q in quantities(e))
    return of_elements + outputs_of_cuts(topology)


def check_small(generic: Path, folder: Path, **parts: Any) -> None:
    model = with_forces_on_cuts(small_model(**parts))
    case = make_case(model, "run", outputs=all_outputs(model))
    check_agreement(generic, case, folder, spread=0.3)


def joint_of(kind: str, *bodies: str, **more: Any) -> dict[str, Any]:
    return {"kind": kind, "bodies": list(bodies), "at": [0.2, 0.3, 0.1], **EXAMPLES[kind], **more}


@pytest.mark.parametrize("turned", [False, True], ids=["forward", "reversed"])
@pytest.mark.parametrize("parent", ["ground", "left"])
@pytest.mark.parametrize("kind", EXAMPLES)
def test_tree_joint(kind: str, parent: str, turned: bool, generic: Path, tmp_path: Path) -> None:
    bodies = ("tip", parent) if turned else (parent, "tip")
    closure = {"kind": "spherical", "bodies": ["right", "tip"], "at": [0.5, 0.5, 0.5], "cut": True}
    reactions = {"hold": {"joint": "arm", "body": "left"}, "root": {"joint": "hinge", "body": "ground"}}
    check_small(generic, tmp_path, joints={"arm": joint_of(kind, *bodies, cut=False), "closure": closure}, reactions=reactions)


CUTS = [("right", "tip"), ("tip", "right"), ("left", "tip"), ("ground", "tip"), ("tip", "ground")]


@pytest.mark.parametrize("bodies", CUTS, ids="-".join)
@pytest.mark.parametrize("kind", tuple(map(str, CUT_KINDS)))
def test_cut_joint(kind: str, bodies: tuple[str, str], generic: Path, tmp_path: Path) -> None:
    reaction = {"joint": "closure", "body": "tip", "direction": [1, 1, 0]}
    check_small(generic, tmp_path, joints={"closure": joint_of(kind, *bodies, cut=True)}, reactions={"pull": reaction})


@pytest.mark.parametrize("joint", ["elbow", "rail"])
def test_planar_loop_with_a_force_at_each_joint(joint: str, generic: Path, tmp_path: Path) -> None:
    """The angle of a cut joint as the sum of the turns around its loop."""
    heavy = cut_at(joint).replace("0.001", "1").replace("0.0005", "1").replace("0.008", "1")
    model = read_model_text(heavy, "sprung.yaml")
    check_agreement(generic, make_case(model, "turn", outputs=all_outputs(model)), tmp_path, spread=0.3)


@pytest.mark.parametrize("bodies", [("ground", "tip"), ("left", "tip"), ("tip", "left")], ids="-".join)
@pytest.mark.parametrize("kind", tuple(map(str, GUIDABLE)))
def test_guided_joint(kind: str, bodies: tuple[str, str], generic: Path, tmp_path: Path) -> None:
    closure = {"kind": "revolute", "bodies": ["right", "tip"], "at": [0.5, 0.5, 0.5], "axis": [0, 1, 1], "cut": True}
    laws = ["drive + 0.3*t**2", "sin(t)", "drive*t", "t/2"][: len(COORDINATES.get(kind, "1"))]
    guided = joint_of(kind, *bodies, guide=laws if len(laws) > 1 else laws[0])
    check_small(generic, tmp_path, joints={"arm": guided, "closure": closure}, reactions={"hold": {"joint": "arm", "body": "left"}})


PAIRS = [("left", "tip"), ("right", "tip"), ("tip", "right"), ("ground", "tip"), ("right", "ground")]


@pytest.mark.parametrize("bodies", PAIRS, ids="-".join)
def test_forces_between_bodies(bodies: tuple[str, str], generic: Path, tmp_path: Path) -> None:
    spring = {
        "kind": "point_spring", "bodies": list(bodies), "from": [0.1, 0, 0.5], "to": [0.6, "reach", 0],
        "law": "heavy*(100*(length - 0.4)**3 + drive) + 5*rate*abs(rate) + where(length < 0.5, 3, max(length, rate, t))",
    }  # fmt: skip
    pieces = [
        {"below": 0, "expression": "atan(rate)"}, {"below": 0.5, "expression": "tanh(3*rate)"},
        {"expression": "sqrt(1 + rate**2)/heavy"},
    ]  # fmt: skip
    axial = {
        "kind": "axial_force", "bodies": list(bodies), "origin": [0, 0, 0], "point": [0.2, 0.3, 0.4], "axis": [1, 0, 2],
        "law": {"sum": [{"of": "travel", "polynomial": [1, 2, 3, 4]}, {"of": "rate", "piecewise": pieces}]},
    }  # fmt: skip
    check_small(generic, tmp_path, forces={"spring": spring, "axial": axial, "idle": {**axial, "active": False}})


@pytest.mark.parametrize("bodies", PAIRS, ids="-".join)
def test_bushings(bodies: tuple[str, str], generic: Path, tmp_path: Path) -> None:
    laws = ["-heavy*position", {"stiffness": 30, "damping": 2, "free_position": 0.1}, "-rate**3 + drive", "-position", "-3*rate*t", 0.5]
    place = {"kind": "bushing", "bodies": list(bodies), "at": [0.2, "reach", 0.1]}
    linear = {**place, "x": [1, 2, 2], "z": [2, 1, -2], "stiffness": [10, 20, 30, 1, 2, 3], "damping": [1, 2, 3, 0.1, 0.2, 0.3]}
    check_small(generic, tmp_path, forces={"mount": linear, "rubber": {**place, "laws": laws}})


@pytest.mark.parametrize("axes", ["global", "body"])
def test_loads(axes: str, generic: Path, tmp_path: Path) -> None:
    force = ["x*vy + drive", "-heavy*vx**2", "exp(-z)*sin(t)"]
    loads = {
        "push": {"body": "tip", "at": [0.1, 0.2, 0.3], "force": force},
        "twist": {"body": "tip", "torque": ["drive - 2*wx", "reach*t - wy*wz", "log(1 + t) + wz**2"]},
        "lift": {"body": "right", "at": ["reach", 0, 0], "force": [0, 0, "20 - 3*vz"], "moving_only": True},
    }
    check_small(generic, tmp_path, forces={name: {"kind": "load", "axes": axes, **load} for name, load in loads.items()})


@pytest.mark.parametrize("guide", [None, "drive"], ids=["free", "guided"])
@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_joint_forces(kind: str, guide: str | None, generic: Path, tmp_path: Path) -> None:
    arm = joint_of(kind, "left", "tip", **({"guide": guide} if guide else {}))
    forces = {
        "spring": {"kind": "joint_force", "joint": "arm", "law": "-heavy*position - 2*rate**3"},
        "second": {"kind": "joint_force", "joint": "arm", "law": "sin(2*t) + drive"},
        "brake": {"kind": "joint_force", "joint": "hinge", "law": "-sign(rate)*min(abs(rate), 0.5)"},
    }
    check_small(generic, tmp_path, joints={"arm": arm}, forces=forces)


#: Coordinates of the kinds with several, or with a ball behind them.
COORDINATES = {
    str(kind): list(joint.coordinates) for kind, joint in JOINTS.items()
    if joint.coordinates and (joint.has_ball or len(joint.coordinates) > 1)
}  # fmt: skip


@pytest.mark.parametrize("turned", [False, True], ids=["forward", "reversed"])
@pytest.mark.parametrize("kind", COORDINATES)
def test_joint_forces_on_several_coordinates(kind: str, turned: bool, generic: Path, tmp_path: Path) -> None:
    bodies = ("tip", "left") if turned else ("left", "tip")
    first, last = COORDINATES[kind][0], COORDINATES[kind][-1]
    arm = joint_of(
        kind, *bodies, cut=False, spring={"stiffness": 40, "damping": 2, "free_position": 0.1, "coordinate": first},
        limits={"lower": -0.01, "upper": 0.01, "stiffness": "500*heavy", "damping": 60, "coordinate": last},
    )  # fmt: skip
    push = {"kind": "joint_force", "joint": "flight", "coordinate": "y", "law": "sin(2*t) - heavy*position"}
    check_small(generic, tmp_path, joints={"arm": arm}, forces={"push": push})


@pytest.mark.parametrize("seed", range(6))
def test_geared_tree(seed: int, generic: Path, tmp_path: Path) -> None:
    """Gears between any coordinates, of guided, free and reversed joints too."""
    check_geared(random_models.with_gears(random_models.random_tree(seed), seed), generic, tmp_path)


@pytest.mark.parametrize("seed", range(3))
def test_geared_loops(seed: int, generic: Path, tmp_path: Path) -> None:
    check_geared(random_models.with_gears(random_models.random_loops(seed), seed), generic, tmp_path)


def check_geared(model: Model, generic: Path, folder: Path) -> None:
    assert model.gears
    check_agreement(generic, make_case(model, random_models.scene(), outputs=all_outputs(model)), folder, spread=0.3)


def test_is_still_in_equilibrium(generic: Path, tmp_path: Path) -> None:
    """Guides and loads of moving mechanisms do not act in a search for rest."""
    slider = joint_of("prismatic", "ground", "left", guide="0.1 + 2*t")
    pendulum = {"kind": "revolute", "bodies": ["left", "tip"], "at": [0.2, 0.3, 0.1], "axis": [0, 1, 0]}
    drive = {"kind": "load", "body": "tip", "at": [0, 0, 0], "force": [100, 0, 0], "moving_only": True}
    joints = {"hinge": slider, "arm": pendulum, "flight": {"kind": "fixed", "bodies": ["ground", "right"], "at": [0, 0, 0]}}
    model = small_model(joints=joints, forces={"drive": drive})
    case = make_case(model, "run", outputs=all_outputs(model))
    search = {"task": "equilibrium", "pose": "equilibrium", "positions": {}, "rates": {}}
    columns = run_task(generic, case, tmp_path, search)["columns"]
    assert columns["hinge.displacement"] == 0.1
    assert columns["hinge.displacement_rate"] == columns["drive.Fx"] == 0.0
    sideways = np.array([columns["tip.x"] - 0.2, columns["tip.z"] - 0.1]) - 0.1 * np.array([-1, 3]) / 14**0.5
    assert abs(sideways @ [9.81, 0.1]) < 1e-8  # the pendulum hangs along gravity, whose x is 0.1


def test_holds_what_is_held_in_equilibrium(generic: Path, tmp_path: Path) -> None:
    """Three bodies one below the other, the middle joint held: the outer ones hang as the same with a guide does, and so do reactions."""
    points = {"hinge": [0.1, 0, 0], "arm": [0.2, 0, -0.5], "flight": [0.3, 0, -1.1]}
    chain = (("hinge", "ground", "left"), ("arm", "left", "tip"), ("flight", "tip", "right"))
    joints = {name: {"kind": "revolute", "bodies": pair, "at": points[name], "axis": [0, 1, 0]} for name, *pair in chain}
    columns = {}
    for held, guide in (({"arm.angle": 0.4}, None), ({}, "0.4")):
        parts = joints if guide is None else {**joints, "arm": {**joints["arm"], "guide": guide}}
        reactions = {"moment": {"joint": "arm", "body": "tip", "direction": [0, 1, 0]}}
        model = small_model(joints=parts, reactions=reactions)
        case = make_case(model, "run", outputs=all_outputs(model))
        search = {"task": "equilibrium", "pose": "equilibrium", "positions": held, "rates": {}}
        columns[guide] = run_task(generic, case, tmp_path, search)["columns"]
    assert columns[None]["arm.angle"] == pytest.approx(0.4, abs=1e-12)
    assert columns[None] == pytest.approx(columns["0.4"], abs=1e-5)
    assert abs(columns[None]["moment.moment"]) > 1e-3


def test_reports_what_is_wrong_with_a_description(generic: Path, tmp_path: Path) -> None:
    (tmp_path / "model.json").write_text('{"format": "something else", "parameters": []}')
    (tmp_path / "run.json").write_text(json.dumps({"model": str(tmp_path / "model.json")}))
    done = subprocess.run([generic, tmp_path / "run.json"], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "not a description of a model for the generic mechanism" in done.stderr
