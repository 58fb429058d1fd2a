"""Tables for the terminal."""

from __future__ import annotations

from collections.abc import Iterable

from rich.table import Table

from cutjoint.analysis.mobility import Mobility
from cutjoint.pipeline import Artifact
from cutjoint.run.results import Equilibrium, Trajectory
from cutjoint.topology.records import Topology


def _facts(title: str, rows: Iterable[tuple[str, str]]) -> Table:
    table = Table(title=title, title_justify="left", show_header=False, box=None)
    for name, value in rows:
        table.add_row(name, value)
    return table


def topology_facts(topology: Topology, mobility: Mobility) -> Table:
    """The counts of a model."""
    model = topology.model
    massless = sum(1 for b in model.bodies if b.mass == 0)
    guided = sum(1 for t in topology.tree if t.joint.guide is not None)
    classes = [f"{len(c.roots)} x {c.size} bodies ({', '.join(c.roots)})" for c in topology.classes]
    return _facts(f"model {model.name}", [
        ("bodies", f"{len(model.bodies)}, {massless} of them massless"),
        ("joints", f"{len(topology.tree)} in the tree ({guided} guided), {len(topology.cuts)} cut"),
        ("loops", f"{len(topology.loops)}, widest couples {max((x.width for x in topology.loops), default=0)} bodies"),
        ("isomorphic subtrees", "; ".join(classes) or "none"),
        ("coordinates", f"{mobility.speeds} relative"),
        ("cut-joint equations", f"{mobility.equations}, rank {mobility.rank}"),
        ("degrees of freedom", str(mobility.degrees_of_freedom)),
    ])  # fmt: skip


def loop_table(topology: Topology) -> Table:
    """One row a loop."""
    table = Table(title="loops", title_justify="left", box=None)
    for heading in ("cut joint", "kind", "line", "base body", "bodies of the loop", "width"):
        table.add_column(heading)
    kinds = {c.name: c for c in topology.cuts}
    for loop in topology.loops:
        cut = kinds[loop.cut]
        chosen = "" if cut.cut else " (chosen)"
        table.add_row(loop.cut, cut.kind.value + chosen, str(cut.span.line), loop.base, ", ".join(loop.bodies), str(loop.width))
    return table


def run_facts(artifact: Artifact, run: Trajectory) -> Table:
    """What compiling and running took."""
    compiled = f"{artifact.compile_seconds:.2f} s" if artifact.binary.fresh else "found in the cache"
    simulated = float(run.t[-1] - run.t[0]) if run.t.size else 0.0
    factor = f"{simulated / run.seconds:.0f} times real time" if run.seconds else "-"
    return _facts(f"scene {artifact.scene.name}, method recursive", [
        ("operations", f"{artifact.program.operations('evaluate')} an evaluation"),
        ("generate", f"{artifact.generate_seconds:.2f} s"),
        ("compile", f"{compiled} ({artifact.binary.compiler}, {' '.join(artifact.binary.flags)})"),
        ("run", f"{run.seconds:.4f} s for {simulated:g} s: {factor}"),
        ("steps", f"{run.steps}, {run.evaluations / max(run.steps, 1):.1f} evaluations each"),
    ])  # fmt: skip


def equilibrium_table(equilibrium: Equilibrium) -> Table:
    """One row a quantity."""
    table = Table(title="static equilibrium", title_justify="left", box=None)
    for heading in ("element", "quantity", "value", "unit"):
        table.add_column(heading, justify="right" if heading == "value" else "left")
    for column, value in equilibrium.values.items():
        element, _, quantity = column.rpartition(".")
        table.add_row(element, quantity, f"{value:.7g}", equilibrium.units[column])
    return table
