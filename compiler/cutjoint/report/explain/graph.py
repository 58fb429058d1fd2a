"""The body graph in words: counts, spanning tree, cut joints, loops, classes, order of elimination."""

from collections.abc import Sequence

from cutjoint.analysis.mobility import find_mobility
from cutjoint.formulate.forces import is_active
from cutjoint.formulate.natural.equations import formulate_lagrangian
from cutjoint.formulate.records import Equations, RecursiveEquations, SystemEquations
from cutjoint.methods import METHODS
from cutjoint.model.records import GROUND, Binding
from cutjoint.package.errors import plural
from cutjoint.program.blocks import BindingTime
from cutjoint.program.records import Program
from cutjoint.program.scalars import FREE
from cutjoint.report.explain.views import Counterparts, Entry, Table, code, line_of, make_table
from cutjoint.report.tables import closing_equations
from cutjoint.topology.records import Branch, SubtreeClass, Topology, TreeJoint, degrees, eliminate

_NOTES = (
    "Body $i$ gives up its unknowns, leaves first, and passes its mass matrix and force on to its parent and to the bodies that cut "
    "joints couple it to; accelerations then run from the ground outwards (eqs. 28-42). The operations are those of this step alone.",
)

_AT_ONCE = ("Loops whose bodies lie in subtrees of one body are eliminated together, in joint space: its motion is not in them.",)

_AROUND = (
    "Branches that one body connects, their hub, share cut joints with it and none with each other: they go first, each by itself, "
    "and pass on to the hub too.",
)


def summarise(start: RecursiveEquations, equations: Equations, program: Program) -> Table:
    """The counts; of a system that Newton's iteration solves those of its step too."""
    topology, mobility = start.topology, find_mobility(start)
    model = topology.model
    widest = max((loop.width for loop in topology.loops), default=0)
    massless = sum(1 for b in model.bodies if b.is_massless)
    active = sum(1 for f in model.forces if is_active(f, start.scene))
    return make_table(("what", "count"), [
        ("bodies", f"{len(model.bodies)}, {massless} of them without mass and inertia"),
        ("joints", f"{len(topology.tree)} in the tree ({sum(1 for t in topology.tree if t.joint.guide is not None)} guided), "
                   f"{len(topology.cuts)} cut"),
        ("loops", f"{len(topology.loops)}, widest couples a body to {plural(widest, 'other')}"),
        ("forces", f"{active} act, {len(model.forces) - active} switched off"),
        ("parameters", ", ".join(f"{sum(1 for p in model.parameters if p.binding is b)} {b.value}" for b in Binding)),
        ("coordinates", f"{start.coordinates}{', quaternions with four each' if start.coordinates != start.speeds else ''}"),
        ("speeds", str(start.speeds)),
        (closing_equations(model), f"{mobility.equations}, rank {mobility.rank}"),
        ("degrees of freedom", str(mobility.degrees_of_freedom)),
        *(_system_rows(equations) if isinstance(equations, SystemEquations) else ()),
        *_operation_rows(program),
    ])  # fmt: skip


def _system_rows(equations: SystemEquations) -> list[tuple[str, str]]:
    """The counts of a step's unknowns and equations, and of the tangent's entries."""
    plan = equations.plan
    assert plan is not None
    pattern, size = plan.pattern, plan.pattern.size
    entries = f"{size * (size + 1) // 2} of the lower triangle" if pattern.symmetric else str(size**2)
    rows = [
        ("unknowns of a step", str(len(equations.unknown_names))), ("constraint equations", str(len(equations.equation_names))),
        ("entries of the tangent", f"{len(pattern.row)} of {entries}"),
        ("multiply-adds of a factorisation and a solution", str(plan.multiply_adds)),
    ]  # fmt: skip
    if METHODS[equations.method].saddle_point:
        held = set(equations.equation_names)
        names = formulate_lagrangian(equations.start, equations.method, ()).equation_names
        rows.insert(2, ("left out, since others imply them", code(name for name in names if name not in held) or "none"))
    return rows


def _operation_rows(program: Program) -> list[tuple[str, str]]:
    return [
        *((f"operations of `{f.name}`", str(program.operations(f.name))) for f in program.functions),
        ("operations when parameters are loaded", _early(program, program.loaded, BindingTime.PARAM)),
        ("operations when a step begins", _early(program, program.stepped, BindingTime.STEP)),
    ]  # fmt: skip


def _early(program: Program, nodes: Sequence[int], binding: BindingTime) -> str:
    operations = sum(1 for n in nodes if program.graph.nodes[n].op not in FREE)
    stored = sum(1 for n in program.stored if program.graph.nodes[n].binding is binding)
    return f"{operations}, {plural(stored, 'scalar')} stored"


def tree_lines(topology: Topology) -> tuple[str, ...]:
    """The spanning tree as a nested list."""
    depth = {GROUND: 0}
    massless = {b.name for b in topology.model.bodies if b.is_massless}
    lines = [f"- {code(GROUND)}"]
    for t in topology.tree:
        depth[t.child] = depth[t.parent] + 1
        unknowns = "guided" if t.joint.guide is not None else plural(len(t.joint.element.speeds), "unknown")
        facts = [t.joint.kind, unknowns, *(["reversed"] if t.reversed else [])]
        tail = ", massless" if t.child in massless else ""
        lines.append(f"{'  ' * depth[t.child]}- {code(t.child)} by {code(t.joint.name)} ({', '.join(facts)}){tail}")
    return tuple(lines)


def cut_table(equations: RecursiveEquations) -> Table:
    """One row a cut joint."""
    sizes = {closure.joint: len(closure.names) for closure in equations.closures}
    rows = [
        (code(c.name), line_of(c), c.kind, "the model" if c.cut else "the compiler", code(c.base), code(c.follower), str(sizes[c.name]))
        for c in equations.topology.cuts
    ]  # fmt: skip
    return make_table(("cut joint", "line", "kind", "cut by", "base", "follower", "equations"), rows)


def loop_table(topology: Topology) -> Table:
    """One row a loop."""
    rows = [(code(x.cut), code(x.base), code(x.bodies), str(x.width)) for x in topology.loops]
    return make_table(("loop of", "closes at", "bodies below it, base side first", "width"), rows)


def class_entries(classes: Sequence[SubtreeClass], counterparts: Sequence[Sequence[Counterparts]]) -> tuple[Entry, ...]:
    """One entry a class of isomorphic subtrees, its members side by side."""
    entries = []
    for members, rows in zip(classes, counterparts, strict=True):
        n = len(members.roots)
        cells = ([code(name) for name in row] + [""] * (n - len(row)) for row in rows)
        title = f"{n} isomorphic subtrees of {plural(members.size, 'body', 'bodies')}"
        entries.append(Entry(title=title, table=make_table([f"of {code(r)}" for r in members.roots], cells)))
    return tuple(entries)


def elimination(topology: Topology, operations: dict[tuple[str, str], int]) -> Entry:
    """The order of elimination; ``operations`` by stage and element."""
    coupled = eliminate(topology.tree, topology.cuts)
    branch_of = {body: branch for branch in topology.branches for body in branch.bodies}
    rows: list[tuple[str, ...]] = []
    done: set[str] = set()
    for t in reversed(topology.tree):
        if t.child not in branch_of:
            others = code(x for x in topology.order if x in coupled[t.child])
            spent = operations.get(("condensation", t.joint.name), 0)
            rows.append((code(t.child), code(t.joint.name), _speeds(t), others, code(t.parent), str(spent)))
        elif (first := branch_of[t.child].hub or branch_of[t.child].bodies[0]) not in done:
            done.add(first)
            together = [branch for branch in topology.branches if first in (branch.hub, branch.bodies[0])]
            rows += [_branch_row(topology, branch, operations) for branch in sorted(together, key=lambda each: not each.hub)]
    total = sum(n for (stage, _), n in operations.items() if stage == "condensation")
    headings = ("step", "body", "joint", "unknowns", "coupled to", "passed on to", "operations")
    steps = [(str(i), *row) for i, row in enumerate(rows, 1)]
    table = make_table(headings, [*steps, ("", "**sum**", "", "", "", "", f"**{total}**")])
    at_once, around = bool(topology.branches), any(branch.hub for branch in topology.branches)
    return Entry(title="Order of elimination", notes=_NOTES + _AT_ONCE * at_once + _AROUND * around, table=table)


def _branch_row(topology: Topology, branch: Branch, operations: dict[tuple[str, str], int]) -> tuple[str, ...]:
    joints = [topology.joint_of[body].joint for body in branch.bodies]
    count = sum(degrees(joint) for joint in joints)
    spent = sum(operations.get(("condensation", joint.name), 0) for joint in joints)
    hub = code(branch.hub) if branch.hub else ""
    return code(branch.bodies), code(j.name for j in joints), f"{count} at once", hub, code(branch.carrier), str(spent)


def _speeds(t: TreeJoint) -> str:
    if t.joint.guide is not None:
        return "none: guided"
    about = " about its centre" if t.joint.element.is_ball else ""
    return (code(t.joint.element.speeds) or "none: fixed") + about
