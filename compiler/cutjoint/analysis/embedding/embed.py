"""Loop embedding of blocks with one degree of freedom, and the conversion of their states to the equations of the loops."""

import pickle
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from hashlib import sha256
from typing import Any

import numpy as np
import sympy

from cutjoint.analysis.body_poses import find_dependent_joints
from cutjoint.analysis.embedding.block_loops import BlockLoops, NoEmbeddingError
from cutjoint.analysis.embedding.fits import Ranges, Wanted, accuracy, fit
from cutjoint.analysis.embedding.independent import NO_INDEPENDENT, Traced, fastest_joints, find_independent, spanning_cuts, trace
from cutjoint.formulate.inputs import TIME, input_functions
from cutjoint.formulate.lanes import schedule_recursive
from cutjoint.formulate.layout import Chart
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.formulate.recursive.embedding.open_geometry import driven_by_time
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.formulate.recursive.kinematics import derive_poses
from cutjoint.formulate.translate import Translator
from cutjoint.methods import DEFAULT_METHOD, METHODS, join_and
from cutjoint.model.outcome import Note, Outcome
from cutjoint.model.records import EmbeddedLoop, Interval, Joint, Model, Scalar, Scene
from cutjoint.program.blocks import BindingTime, Builder
from cutjoint.program.interpret import interpret_blocks
from cutjoint.topology.blocks import Block, find_blocks
from cutjoint.topology.build import build_topology
from cutjoint.topology.records import Topology, degrees
from cutjoint.topology.spanning_tree import split

#: The last results of `embed_loops` by their inputs: a run, its report and its view use the same ones.
_KEPT: dict[bytes, Outcome] = {}
_MOST_KEPT = 8
#: The most terms of all functions of a block whose guide moves.  Measured: with 1900 terms in each front suspension the Iltis took 59 ms in
#: simul3, by its loops 42 ms.
DEAREST = 500
_CLOSED = 1e-8  #: the largest violation in the design position, m or rad, for which loops may be embedded


def embed_loops(model: Model, scene: Scene, *, measure: bool = False) -> Outcome:
    """Embed the loops of each block that has one degree of freedom, within the scene's tolerance; ``measure`` adds notes on accuracy."""
    how = scene.numerics
    parts = scene.positions, scene.rates, scene.inputs, scene.switches, scene.pose, scene.trim, scene.end
    asked = how.closure, how.loop_tolerance, how.loop_terms, measure
    key = sha256(pickle.dumps((replace(model, scenes={}, text=""), parts, asked))).digest()
    if key not in _KEPT:
        while len(_KEPT) >= _MOST_KEPT:
            del _KEPT[next(iter(_KEPT))]
        _KEPT[key] = _embed_loops(model, scene, measure)
    found = _KEPT[key]
    closed = replace(model, joints=found.model.joints, embedded_loops=found.model.embedded_loops)
    return replace(found, model=closed, scene=scene)


def _embed_loops(model: Model, scene: Scene, measure: bool) -> Outcome:
    topology, done, left, seen = build_topology(model), list[_Embedded](), list[Note](), _Seen(measure=measure)
    rubbed = {force.joint_of for force in model.forces if force.by_load}
    for block in find_blocks(topology):
        if any(joint.name in rubbed for joint in block.joints):
            left.append(_stays(block, "its joint friction needs their loads"))
            continue
        try:
            done.append(_embed_block(model, topology, block, scene, seen))
        except NoEmbeddingError as error:
            left.append(_stays(block, str(error)))
    while True:
        whole = _put_in(model, done)
        branched = {body for branch in build_topology(whole).branches for body in branch.bodies}
        inside = [found for found in done if branched & set(found.embedded_loop.bodies)]
        if not inside:
            break
        left += [_stays(found.block, "it hangs on other loops that are eliminated at once") for found in inside]
        done = [found for found in done if found not in inside]
    if done and build_topology(whole).closing:
        before, after = (_operations(one, scene) for one in (model, whole))
        if after >= before:
            words = f"with the loops that stay, an evaluation with functions would take {after} operations instead of {before}"
            left, done, whole = [*left, *(_stays(found.block, words) for found in done)], [], model
    return Outcome(model=whole, scene=scene, done=tuple(_embedded(found) for found in done), left=tuple(left))


def _operations(model: Model, scene: Scene) -> int:
    """The operations of an evaluation, counting all lanes of a scalar once; if loops remain, evaluations are not fewer."""
    closure = METHODS[DEFAULT_METHOD].closure(scene.numerics.closure).name
    equations = formulate_recursive(build_topology(model), scene, (), closure=closure)
    return schedule_recursive(equations.starting, lanes=True).instructions("evaluate")


@dataclass(frozen=True)
class _Seen:
    """Motions and ranges of functions of blocks, which equal blocks reuse. ``measure``: whether to measure accuracy."""

    measure: bool
    curves: Traced = field(default_factory=list)
    ranges: Ranges = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class _Embedded:
    block: Block
    embedded_loop: EmbeddedLoop
    accuracy: tuple[float, float] | None


def _put_in(model: Model, found: Sequence[_Embedded]) -> Model:
    """The model with embedded loops, whose joints are cut as these require."""
    cut = {joint.name: joint.name in each.embedded_loop.cuts for each in found for joint in each.block.joints}
    joints = tuple(replace(joint, cut=cut.get(joint.name, joint.cut)) for joint in model.joints)
    return replace(model, joints=joints, embedded_loops=tuple(each.embedded_loop for each in found))


def _stays(block: Block, reason: str) -> Note:
    return Note(element=block.joints[0].name, text=f"stays exact: {reason}", span=block.joints[0].span)


def _embedded(found: _Embedded) -> Note:
    functions = found.embedded_loop.functions
    words = f"embeds {len(found.block.joints) - 1} other joints as functions of its coordinate, violation {functions.violation:.1g}"
    if found.accuracy is not None:
        derivatives, curvatures = found.accuracy
        words += f"; at 1000 random coordinates speeds are {derivatives:.1g} off at q' = 1, accelerations {curvatures:.1g}"
    return Note(element=found.embedded_loop.independent, text=words, span=found.embedded_loop.span)


def _embed_block(model: Model, topology: Topology, block: Block, scene: Scene, seen: _Seen) -> _Embedded:
    _require_simple(model, block)
    names = {joint.name for joint in block.joints}
    started = sorted({key.rpartition(".")[0] for key in (*scene.positions, *scene.rates)} & names)
    if len(started) > 1:
        raise NoEmbeddingError(f"the scene gives {join_and(started)}, of which only one can be independent")
    drive = block.drives[0] if block.drives else None
    motion = _drive_motion(model, drive, scene.end, input_functions(model, scene)) if drive is not None else None
    u = motion.range if motion is not None else Interval(lower=0.0, upper=0.0)
    moved = drive.name if drive is not None else None
    first = BlockLoops(driven_by_time(topology, moved), block)
    if first.open and u.half > 0:
        raise NoEmbeddingError("its geometry has tunable parameters, and its guide moves")
    if not started and scene.pose != "equilibrium" and scene.trim is None:
        violation = np.abs(first.evaluate(first.design(), np.full(1, motion.start if motion else 0.0))[0]).max(initial=0.0)
        if violation > _CLOSED:  # the loops' equations would distribute such a correction over all bodies
            raise NoEmbeddingError(f"its loops are violated by {violation:.1g} at the start, in the design position")
    if motion is not None and motion.rate != 0 and not {key.rpartition(".")[0] for key in scene.rates} & names:
        raise NoEmbeddingError("its guide moves at the start, where the scene gives no speed of it")
    fastest, tried = fastest_joints(first, u.middle), list[str]()
    joint = next((joint for joint in fastest if not started or joint.name in started), fastest[0])
    used = [force.joint_of for force in model.forces if force.joint_of]
    while True:
        cuts = spanning_cuts(block, joint, used)
        tree, closing = split(model, {cut.name for cut in topology.cuts} - names | cuts)
        loops = BlockLoops(driven_by_time(replace(topology, tree=tree, cuts=closing), moved), block)
        candidates = find_independent(loops, trace(loops, u.middle, seen.curves))
        best = next((independent for independent in candidates if not started or independent.joint.name in started), None)
        own = next((independent for independent in candidates if independent.joint is joint), None)
        tried.append(joint.name)
        if best is not None and own is not None and own.travel >= best.travel / 2:
            break
        if best is None or best.joint.name in tried:
            raise NoEmbeddingError(f"the scene gives {started[0]}, which cannot be independent" if started else NO_INDEPENDENT)
        joint = best.joint
    functions = fit(loops, own, u, Wanted(tolerance=scene.numerics.loop_tolerance, terms=scene.numerics.loop_terms), seen.ranges)
    terms = sum(coefficient != 0 for found in functions.series.values() for one in found for row in one.coefficients for coefficient in row)
    if u.half > 0 and terms > DEAREST:
        raise NoEmbeddingError(f"its guide moves, and functions of two numbers with {terms} terms take longer than its loops")
    embedded_loop = EmbeddedLoop(
        independent=joint.name, drive=moved, carrier=block.carrier,
        bodies=tuple(t.child for t in tree if t.child in block.bodies), cuts=tuple(j.name for j in block.joints if j.name in cuts),
        functions=functions if drive is not None else replace(functions, drive_range=None), span=joint.span,
    )  # fmt: skip
    return _Embedded(block=block, embedded_loop=embedded_loop, accuracy=accuracy(loops, own, functions, u) if seen.measure else None)


def _require_simple(model: Model, block: Block) -> None:
    names, bodies = {joint.name for joint in block.joints}, set(block.bodies)
    if len(block.drives) > 1:
        raise NoEmbeddingError(f"{len(block.drives)} guides move it")
    if any(len(drive.guide or ()) > 1 for drive in block.drives):
        raise NoEmbeddingError(f"'{block.drives[0].name}' moves it by several guided coordinates")
    for joint in (j for j in model.joints if not degrees(j) and {j.base, j.follower} & bodies):
        does = "guides one of its bodies" if joint.guide is not None else "fixes a body to one of its bodies: make the two one body"
        raise NoEmbeddingError(f"'{joint.name}' {does}")
    if any(joint.armature != 0 for joint in block.joints):
        raise NoEmbeddingError("a joint in it has an armature")
    if any(names & set(gear.joints) for gear in model.gears):
        raise NoEmbeddingError("a gear couples its joints")
    if all(body.is_massless for body in model.bodies if body.name in bodies):
        raise NoEmbeddingError("its bodies have no mass")


@dataclass(frozen=True, kw_only=True)
class _DriveMotion:
    """Motion of a guide in a scene: ``range``, a tenth wider on both sides (one value at rest), value and rate at the start."""

    range: Interval
    start: float
    rate: float


def _drive_motion(model: Model, drive: Joint, end: float, laws: Mapping[Scalar, Scalar]) -> _DriveMotion:
    """The motion of a guide until ``end`` (s) with the ``laws`` of inputs."""
    assert drive.guide is not None
    b = Builder()
    law = sympy.sympify(drive.guide[0]).subs(laws)
    values = {p.symbol: b.number(p.value) for p in model.parameters}
    translator = Translator(b, {**values, TIME: b.symbol("t", 1, BindingTime.STEP)})
    blocks = [translator.scalar(law), translator.scalar(sympy.diff(law, TIME))]
    found = interpret_blocks(blocks, {"t": np.linspace(0.0, end, 2001)[:, np.newaxis]}, {})
    places, rates = (np.broadcast_to(found[block], (2001, 1, 1))[:, 0, 0] for block in blocks)
    lower, upper = float(places.min()), float(places.max())
    wider = 0.1 * (upper - lower)
    return _DriveMotion(range=Interval(lower=lower - wider, upper=upper + wider), start=float(places[0]), rate=float(rates[0]))


def without_functions(topology: Topology) -> Model:
    """The model with the equations of all loops, and with the cuts, and so the tree, of the embedded loops."""
    cut = {joint.name for joint in (*topology.cuts, *topology.embedded)}
    joints = tuple(replace(joint, cut=joint.name in cut) for joint in topology.model.joints)
    return replace(topology.model, joints=joints, embedded_loops=())


def state_of_loops(
    functions: RecursiveEquations, loops: RecursiveEquations, kept: Mapping[str, Any], parameters: Mapping[str, float]
) -> dict[str, Any]:  # fmt: skip
    """The ``initial_state`` of a run file from which the equations of ``loops`` continue a run.
    ``kept`` is the state of the run with ``functions`` and tunable ``parameters`` (SI units)."""
    t, q, v = (np.array([kept[name]], dtype=float) for name in ("t", "q", "v"))
    places = dict(zip(functions.coordinate_names, q[0], strict=True))
    speeds = dict(zip(functions.speed_names, v[0], strict=True))
    followers = find_dependent_joints(derive_poses(functions.topology, functions.scene), t, q, v, parameters)
    charts: Mapping[str, Chart] = {chart.joint: chart for chart in loops.charts}
    for joint, (place, rate) in followers.items():
        chart = charts[joint]
        places |= {f"{joint}.{name}": value for name, value in zip(chart.coordinate_names, place[0], strict=True)}
        speeds |= {f"{joint}.{name}": value for name, value in zip(chart.speed_names, rate[0], strict=True)}
    return {
        "t": kept["t"], "q": {name: float(places[name]) for name in loops.coordinate_names},
        "v": {name: float(speeds[name]) for name in loops.speed_names}, "discrete_states": kept["discrete_states"],
    }  # fmt: skip
