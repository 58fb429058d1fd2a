"""Sweeps of an axle: parallel and opposite wheel travel, steering, and the compliance under forces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cutjoint.analysis.closing import Array, evaluate_rates, free_directions, make_inputs
from cutjoint.analysis.linearise import Linearisation
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.formulate.implicit.equations import formulate_implicit
from cutjoint.formulate.inputs import make_translator
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.formulate.recursive.kinematics import derive_kinematics, halves
from cutjoint.methods import Loops
from cutjoint.model.ranges import fault_of_setting
from cutjoint.model.records import GROUND
from cutjoint.package.errors import RunError
from cutjoint.program.blocks import Builder
from cutjoint.program.interpret import interpret_blocks
from cutjoint.run.inputs import constant_inputs
from cutjoint.run.modes import NotReachedError, linearise_at
from cutjoint.run.results import Columns
from cutjoint.run.run_file import parameter_values
from cutjoint.run.scenes import ModelLike, load_model, model_of, with_loops
from cutjoint.tasks.kinematics.axles import Axle, Values, Wheel, find_axle
from cutjoint.tasks.kinematics.figures import contact, find_figures, units_of
from cutjoint.tasks.kinematics.linkage import Linkage, Pose, WheelState, side_of, wheel_blocks
from cutjoint.topology.geometry import TOLERANCE

TRAVEL, ROLL, STEERING = "travel", "roll", "steer"
#: The column of the independent variable of each sweep.
LEADING = {TRAVEL: "left.travel", ROLL: "roll", STEERING: "steer"}
#: The default travel of the steering joint, m and rad.
_TURNS = {"m": 0.02, "rad": 0.5}


@dataclass(frozen=True, kw_only=True)
class AxleKinematics:
    """The figures of an axle: ``sweeps`` "travel", "roll" and, of a steered axle, "steer", each columns (rows,) by name with ``units``.

    ``limits`` say where a sweep ended before its end.
    """

    axle: Axle
    sweeps: Mapping[str, Mapping[str, Array]]
    units: Mapping[str, str]
    limits: tuple[str, ...]


def find_kinematics(
    model: ModelLike, *, axle: str | None = None, travel: float = 0.05, steer_travel: float | None = None, points: int = 21,
    steer: str | None = None, radius: float | None = None, share: float = 1.0, parameters: Mapping[str, float] | None = None,
    only: Sequence[str] = (),
) -> AxleKinematics:  # fmt: skip
    """Kinematics of an axle over travel, roll and steer.

    Args:
        axle: the name of the axle; default: the only one.
        steer: the joint that steers it, of one coordinate.
        radius: loaded radius of the wheels, m; default: the height of their centres above z = 0.
        share: the axle's share of the braking and driving force, for anti-dive and anti-squat.
        travel: m up and down.
        steer_travel: m or rad of the steering joint to either side.
        points: poses of each sweep.
        only: names of sweeps; default: all.

    Raises:
        ModelError: the file is wrong.
        RunError: there is no such axle or joint, the axle has a freedom of its own, or a parameter cannot be set.
    """
    for name, value in (("travel", travel), ("steer_travel", steer_travel), ("points", points), ("radius", radius), ("share", share)):
        if value is not None and (fault := fault_of_setting(name, value)):
            raise RunError(f"{name}: {fault}")
    model, changes = model_of(model), parameters or {}
    values = Values(model, parameter_values(model, changes) | constant_inputs(model, changes))
    found = find_axle(model, values, axle, radius=radius, steer=steer)
    linkage = Linkage(found)
    ends = {TRAVEL: np.array([travel, travel, 0.0]), ROLL: np.array([-travel, travel, 0.0])}
    if found.steering is not None:
        ends[STEERING] = np.array([0.0, 0.0, _TURNS[found.steering_unit] if steer_travel is None else steer_travel])
    units, start = units_of(found), linkage.design()
    sweeps: dict[str, Mapping[str, Array]] = {}
    limits: list[str] = []
    for name, end in ((name, end) for name, end in ends.items() if not only or name in only):
        poses = _sweep(linkage, start, end[: linkage.prescribed], points // 2, name, limits)
        rows = [find_figures(found, pose, share) for pose in poses]
        sweeps[name] = Columns({column: np.array([row[column] for row in rows]) for column in units})
    return AxleKinematics(axle=found, sweeps=sweeps, units=Columns(units), limits=tuple(limits))


def _sweep(linkage: Linkage, start: Pose, end: Array, rows: int, name: str, limits: list[str]) -> list[Pose]:
    """The poses from one end through the start to the other end."""
    ways = []
    for sign in (-1, 1):
        way = linkage.follow(start, sign * end, rows)
        if len(way) < rows:
            wanted, unit = np.abs(end).max(), linkage.axle.steering_unit if name == STEERING else "m"
            at = sign * wanted * len(way) / rows
            limits.append(f"{name}: the loops do not close beyond {at:.4g} {unit} of {sign * wanted:.4g} {unit}")
        ways.append(way)
    return [*reversed(ways[0]), start, *ways[1]]



# Compliance

#: The loads on each wheel, and their units.
LOADS = {"lateral": "N", "braking": "N", "driving": "N", "aligning": "N*m"}
_BY = {"N": "N", "N*m": "(N*m)"}
#: The changes by each load.
CHANGES = {"toe": "rad", "camber": "rad", "x": "m", "y": "m"}
#: The largest share of a load that may remain unbalanced.
_LOOSE = 1e-6


@dataclass(frozen=True, kw_only=True)
class AxleCompliance:
    """Change of each wheel of an axle per unit of its own load at the static equilibrium, by "wheel.load.change".

    ``units`` are of the change per unit of load.
    """

    axle: Axle
    figures: Mapping[str, float]
    units: Mapping[str, str]


def find_compliance(
    model: ModelLike, *, scene: str | None = None, axle: str | None = None, steer: str | None = None, radius: float | None = None,
    parameters: Mapping[str, float] | None = None,
) -> AxleCompliance:  # fmt: skip
    """Compliance of an axle: changes of its wheels by loads, linearised at the static equilibrium of a scene.

    Chassis, wheel heights and steering joint are fixed.

    Args:
        axle, steer, radius: as of `find_kinematics`.

    Raises:
        ModelError: the file is wrong.
        RunError: there is no such axle, joint or scene, no equilibrium, a parameter cannot be set, or nothing holds a wheel.
    """
    model, chosen = load_model(model, scene)
    changes = parameters or {}
    numbers = parameter_values(model, changes)
    found = find_axle(model, Values(model, numbers | constant_inputs(model, changes)), axle, radius=radius, steer=steer)
    artifact = compile_interpreted(model, with_loops(chosen, Loops.EXACT))
    equations = formulate_implicit(artifact.mechanism, ())
    try:
        at = linearise_at(artifact, equations, None, changes, None)[1]
    except NotReachedError as error:
        remedy = "a free chassis cannot stand on one axle: let it move along z alone"
        raise RunError(f"{chosen.span}: scene '{chosen.name}': no equilibrium: {error.report}; {remedy}") from error
    start = replace(equations.start, parameters=tuple(replace(p, value=numbers[p.name]) for p in equations.start.parameters))
    wheels, free = _constrained_wheels(found, start, at)
    figures: dict[str, float] = {}
    for wheel, state in zip(found.wheels, wheels, strict=True):
        side = side_of(found, wheel)
        for load in LOADS:
            moved = _static_response(free, at.K, _load(wheel, state, load))
            if moved is None:
                raise RunError(f"{model.span}: axle '{found.name}': no stiffness supports the {side} wheel against {load}")
            figures |= {f"{side}.{load}.{name}": change for name, change in _changes(wheel, state, moved).items()}
    units = {f"{load}.{name}": f"{unit}/{_BY[of]}" for load, of in LOADS.items() for name, unit in CHANGES.items()}
    return AxleCompliance(axle=found, figures=Columns(figures), units=Columns({name: units[name.partition(".")[2]] for name in figures}))


def _constrained_wheels(axle: Axle, equations: RecursiveEquations, at: Linearisation) -> tuple[list[WheelState], Array]:
    """The wheels with their motions by each speed, and the directions (speeds, n) that chassis, wheel heights and steering leave free."""
    b, n = Builder(), equations.speeds
    charts = {c.joint: c for c in equations.charts}
    k = derive_kinematics(b, make_translator(b, equations.topology.model), equations.topology, charts)
    blocks = [wheel_blocks(k, wheel) for wheel in axle.wheels]
    places = interpret_blocks([x for block in blocks for x in block[:2]], make_inputs(equations, at.q, np.zeros(n)), {})
    wheels = []
    for centre, outward, *motions in blocks:
        velocity, rotation = evaluate_rates(equations, at.q, motions)
        wheels.append(WheelState(centre=places[centre].ravel(), outward=places[outward].ravel(), velocity=velocity, rotation_rate=rotation))
    prescribed = [at.J[:, :n], *(wheel.velocity[2:] for wheel in wheels)]
    if axle.chassis != GROUND:
        prescribed += evaluate_rates(equations, at.q, halves(b, k.frames[axle.chassis].Z))
    if axle.steering is not None and axle.steering.name in charts:
        prescribed.append(np.eye(n)[charts[axle.steering.name].v :][:1])
    return wheels, free_directions(np.concatenate(prescribed))


def _static_response(free: Array, stiffness: Array, load: Array) -> Array | None:
    """The small motion (speeds,) along free directions by which springs balance a load; None if they cannot."""
    n = len(load)
    along, loads = free.T @ stiffness[:n, :n] @ free, free.T @ load
    if not loads.size:
        return np.zeros(n)
    moved = np.linalg.lstsq(along, loads, rcond=TOLERANCE)[0]
    return np.asarray(free @ moved) if np.abs(along @ moved - loads).max() <= _LOOSE * np.abs(load).max() else None


def _load(wheel: Wheel, state: WheelState, load: str) -> Array:
    """A unit load as a force on each speed: inwards and rearwards at the contact centre, forwards at the centre, towards toe-in about z."""
    if load == "aligning":
        return np.asarray(state.rotation_rate.T @ np.array([0.0, 0.0, -wheel.side]))
    force = {"lateral": np.array([0.0, -wheel.side, 0.0]), "braking": np.array([-1.0, 0, 0]), "driving": np.array([1.0, 0, 0])}[load]
    arm = np.zeros(3) if load == "driving" else contact(wheel, state) - state.centre
    return np.asarray(state.velocity.T @ force + state.rotation_rate.T @ np.cross(arm, force))


def _changes(wheel: Wheel, state: WheelState, speeds: Array) -> dict[str, float]:
    """Toe-in and camber, and forwards and outwards the place of the carrier at the contact centre, by small motions (speeds,)."""
    rotation_rate, e = state.rotation_rate @ speeds, state.outward
    change, level = np.cross(rotation_rate, e), e[0] ** 2 + e[1] ** 2
    place = state.velocity @ speeds + np.cross(rotation_rate, contact(wheel, state) - state.centre)
    return {
        "toe": float(-wheel.side * (e[0] * change[1] - e[1] * change[0]) / level), "camber": float(-change[2] / np.sqrt(level)),
        "x": float(place[0]), "y": float(wheel.side * place[1]),
    }  # fmt: skip
