"""`cutjoint check`."""

from pathlib import Path

from cutjoint.analysis.closing import explore
from cutjoint.analysis.inertia import describe_momentary, find_momentary_motions, require_inertia
from cutjoint.analysis.mobility import find_mobility
from cutjoint.analysis.redundancy import find_indeterminate, find_redundancy, reaction_outputs
from cutjoint.analysis.shaky import describe_shakiness, find_shakiness, mend_misfit
from cutjoint.analysis.skew import describe_geometry, rate_choices
from cutjoint.commands import options, table
from cutjoint.formulate.events import describe_guide_jumps
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.importing.formats import is_foreign, name_of
from cutjoint.methods import Loops
from cutjoint.model.records import Model
from cutjoint.package.errors import RunError
from cutjoint.report import tables
from cutjoint.run.outputs import require_apart
from cutjoint.run.reading import read_model
from cutjoint.run.settings import accuracy_of
from cutjoint.topology.build import build_topology
from cutjoint.topology.search import rank_cuts


@table.command("check")
def command(model: Path, scene: str | None, tunable: tuple[str, ...], assemblies: bool, view: Path | None, proof: Path | None) -> None:
    """Validate MODEL; print topology, loops, degrees of freedom, redundant equations, and cut joints with their alternatives."""
    require_apart({"the model": model}, documents=[("--view", view), ("--proof", proof)])
    with options.progress_bar(f"reading {model.name}"):
        checked = read_model(model, tunable=tunable)
    checked, chosen = options.choose_case(checked, scene)
    with options.progress_bar(f"topology of {model.name}"):
        topology = build_topology(checked)
    with options.progress_bar(f"equations of {model.name}"):
        equations = formulate_recursive(topology, chosen, ())
    require_inertia(equations)
    with options.progress_bar(f"degrees of freedom of {model.name}"):
        poses = explore(equations)
        mobility = find_mobility(equations, poses)
        skew = describe_geometry(equations, mobility)
    facts = tables.topology_facts(topology, mobility, skew)
    options.out.print(tables.facts(f"model {checked.name}", facts))
    if topology.loops:
        options.out.print(tables.loop_table(topology))
    if chosen.numerics.loops == Loops.EMBEDDED or proof is not None:
        from cutjoint.analysis.embedding.embed import embed_loops

        with options.progress_bar(f"closing loops of {model.name}"):
            outcome = embed_loops(checked, chosen, measure=True)
        options.out.print_each((*outcome.done, *outcome.left))
        if proof is not None:
            _prove(outcome.model, proof)
    if topology.closing:
        redundancy = find_redundancy(equations, poses)
        if redundancy.structural or redundancy.momentary:
            options.out.print(tables.redundancy_table(redundancy, checked))
        if indeterminate := find_indeterminate(topology, chosen, reaction_outputs(checked)):
            options.out.print(f"indeterminate reactions: {', '.join(indeterminate)}; a run reports {tables.LEAST}")
    momentary = [describe_momentary(checked, motion) for motion in find_momentary_motions(equations, poses)]
    options.out.print_each((*describe_guide_jumps(topology.model, chosen, accuracy_of(chosen)), *momentary))
    misfit = mend_misfit(equations, accuracy_of(chosen))[0]
    if misfit and not (skew and misfit.endswith(skew)):
        options.out.print(misfit)
    if shaky := find_shakiness(equations):
        options.out.print(describe_shakiness(equations, shaky))
    if topology.loops:
        options.out.print(tables.cut_choices(rate_choices(topology, rank_cuts(topology)), mobility.redundant))
    if assemblies:
        from cutjoint.run.run_file import find_assemblies

        with options.progress_bar(f"assemblies of {model.name}"):
            lines = tables.assembly_lines(find_assemblies(checked, chosen))
        options.out.print_each(lines)
    options.out.print(tables.legend(with_loops=bool(topology.loops)))
    if is_foreign(model):
        options.out.print(f"lines of {name_of(model).name} are those of the model file that 'cutjoint import {model.name}' writes")
    options.out.print(f"scenes: {', '.join(checked.scenes) or 'none'}")
    if view is not None:
        from cutjoint.view.graph import draw_graph
        from cutjoint.view.states import find_notes, show_directions

        graph = draw_graph(topology, facts, find_notes(equations, poses))
        options.write_view(view, model.name, lambda: show_directions(checked, chosen, equations, poses[0], graph))


def _prove(model: Model, file: Path) -> None:
    from cutjoint.analysis.embedding.proof import certificate_of, prove_loops
    from cutjoint.toolchain.build import write_text

    if not model.embedded_loops:
        raise RunError("--proof: no loop of the model is embedded, for the reasons above")
    with options.progress_bar(f"proving loops of {model.name}"):
        proofs = prove_loops(model)
    options.out.print_each(proofs)
    write_text(file, certificate_of(model, proofs))
    options.out.print(f"certificate: {file}; check it with python -m cutjoint.analysis.embedding.certificate {file}")
