"""Loops with one degree of freedom are replaced by functions of one coordinate that close them: assemblies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cutjoint.analysis.assemblies import TOLERANCE, DriveMotion, drive_motion, fit
from cutjoint.analysis.block_loops import BlockLoops, NoAssemblyError, driven_by_time
from cutjoint.analysis.leads import Lead, fastest_joints, find_leads, follow, spanning_cuts
from cutjoint.formulate.inputs import input_functions
from cutjoint.methods import join_and
from cutjoint.model.records import Assembly, Interval, Joint, Model, Scene
from cutjoint.reduce.records import Note, Outcome
from cutjoint.topology.blocks import Block, find_blocks
from cutjoint.topology.build import build_topology
from cutjoint.topology.records import Topology, degrees
from cutjoint.topology.spanning_tree import split


def assemble_loops(model: Model, scene: Scene, tolerance: float = TOLERANCE) -> Outcome:
    """Replace the loops of each block that has one degree of freedom, to a tolerance of its functions, m or rad."""
    whole, topology = model, build_topology(model)
    done, left = [], []
    for block in find_blocks(topology):
        first = block.joints[0]
        try:
            changed = _assemble(whole, topology, block, scene, tolerance)
        except NoAssemblyError as error:
            left.append(Note(element=first.name, words=f"stays in a loop: {error}", span=first.span))
            continue
        assembly = changed.assemblies[-1]
        words = f"leads {len(block.joints) - 1} other joints by functions of its coordinate, gap {assembly.gap:.1g}"
        done.append(Note(element=assembly.leader, words=words, span=first.span))
        whole = changed
    return Outcome(model=whole, scene=scene, done=tuple(done), left=tuple(left))


def _assemble(model: Model, topology: Topology, block: Block, scene: Scene, tolerance: float) -> Model:
    """The model with a block as an assembly."""
    _require_simple(model, block)
    given = sorted(_given(block, scene))
    if len(given) > 1:
        raise NoAssemblyError(f"the scene gives {join_and(given)}, and one of them may lead")
    laws = input_functions(model, scene)
    drive = block.drives[0] if block.drives else None
    motion = drive_motion(model, drive, scene.end, laws) if drive is not None else None
    u = motion.range if motion is not None else Interval(lower=0.0, upper=0.0)
    used = [force.joint_of for force in model.forces if force.joint_of]
    names = {joint.name for joint in block.joints}
    first = BlockLoops(driven_by_time(topology, drive), block)
    if not given and scene.pose != "equilibrium":
        _require_closed(first, motion)
    fastest, tried = _first_lead(first, u.middle, block, scene), list[str]()
    while True:
        cuts = spanning_cuts(block, fastest, used)
        tree, closing = split(model, {joint.name for joint in topology.cuts} - names | cuts)
        loops = BlockLoops(driven_by_time(replace(topology, tree=tree, cuts=closing), drive), block)
        leads = find_leads(loops, follow(loops, u.middle))
        lead = _lead(leads, block, scene)
        tried.append(fastest.name)
        own = next((one for one in leads if one.joint is fastest), None)
        if own is not None and own.travel >= lead.travel / 2:
            lead = own
            break
        if lead.joint.name in tried:
            raise NoAssemblyError("no joint with one coordinate leads it")
        fastest = lead.joint
    found = fit(loops, lead, u, tolerance)
    changed = replace(model, joints=tuple(replace(j, cut=j.name in cuts) if j.name in names else j for j in model.joints))
    assembly = Assembly(
        leader=lead.joint.name, drive=drive.name if drive is not None else None, carrier=block.carrier,
        bodies=tuple(t.child for t in tree if t.child in block.bodies), cuts=tuple(j.name for j in block.joints if j.name in cuts),
        functions=found.functions, range=found.range, drive_range=u if drive is not None else None, turns=found.turns, gap=found.gap,
        error=found.error, span=lead.joint.span,
    )  # fmt: skip
    return replace(changed, assemblies=(*changed.assemblies, assembly))


#: The largest gap in the design position, m or rad, that a start may leave to the functions.
_CLOSED = 1e-8


def _require_closed(loops: BlockLoops, motion: DriveMotion | None) -> None:
    """Refuse a block that its start would move: the loops' equations share such a motion out among all bodies."""
    gap = np.abs(loops.evaluate(loops.design(), np.full(1, motion.start if motion is not None else 0.0))[0]).max(initial=0.0)
    if gap > _CLOSED:
        raise NoAssemblyError(f"its loops stand open by {gap:.1g} at the start, in the design position")
    if motion is not None and motion.rate != 0:
        raise NoAssemblyError("its guide moves at the start, where the scene gives no speed of it")


def _first_lead(loops: BlockLoops, u: float, block: Block, scene: Scene) -> Joint:
    """The joint that the scene gives, or else the one that turns or slides fastest where the scene has the block."""
    fastest = fastest_joints(loops, u)
    given = _given(block, scene)
    return next((joint for joint in fastest if not given or joint.name in given), fastest[0])


def _given(block: Block, scene: Scene) -> set[str]:
    """The joints of a block whose coordinates or speeds a scene gives."""
    return {key.rpartition(".")[0] for key in (*scene.positions, *scene.rates)} & {joint.name for joint in block.joints}


def _lead(leads: Sequence[Lead], block: Block, scene: Scene) -> Lead:
    """The coordinate that gets farthest, or the one that the scene gives."""
    given = _given(block, scene)
    if not given:
        return leads[0]
    found = [lead for lead in leads if lead.joint.name in given]
    if not found:
        raise NoAssemblyError(f"the scene gives {', '.join(given)}, which cannot lead")
    return found[0]


def _require_simple(model: Model, block: Block) -> None:
    names, bodies = {joint.name for joint in block.joints}, set(block.bodies)
    if len(block.drives) > 1:
        raise NoAssemblyError(f"{len(block.drives)} guides move it")
    if any(not degrees(j) and {j.base, j.follower} & bodies for j in model.joints):
        raise NoAssemblyError("bodies in it are welded or guided")
    if any(names & set(gear.joints) for gear in model.gears):
        raise NoAssemblyError("a gear couples its joints")
    if all(body.is_massless for body in model.bodies if body.name in bodies):
        raise NoAssemblyError("its bodies have no mass")
