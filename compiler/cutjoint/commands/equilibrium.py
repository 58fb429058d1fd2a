"""`cutjoint equilibrium`."""

from dataclasses import replace
from pathlib import Path

from cutjoint.commands import options, table
from cutjoint.model.files.referenced import SHIPPED
from cutjoint.model.records import VALUE
from cutjoint.report.tables import locking_force_facts, trim_facts
from cutjoint.report.tasks import describe_stability, force_table, pose_table, standing_tyre_lines
from cutjoint.run.display import in_units, read_units
from cutjoint.run.outputs import require_apart
from cutjoint.run.reading import read_model
from cutjoint.tasks.states import find_scene_equilibrium, find_scene_modes


@table.command("equilibrium")
def command(
    model: Path, scene: str | None, tunable: tuple[str, ...], changes: tuple[str, ...], stability: bool, verbose: bool,
    display: tuple[str, ...], view: Path | None,
) -> None:  # fmt: skip
    """Find the static equilibrium of MODEL, or solve the scene's trim, and print every body's pose and every element's force."""
    require_apart({"the model": model}, documents=[("--view", view)])
    parameters, _ = options.read_parameters(changes), read_units(display)
    checked, chosen = options.choose_case(read_model(model, tunable=tunable), scene)
    with options.progress_bar(f"compiling {model.name}"):
        found = find_scene_equilibrium(checked, chosen, parameters=parameters, neutral=True)
    values, units = in_units(found.values, found.units, display or checked.display)
    shown, trim = replace(found, values=values, units=units), found.trim
    if trim is not None:
        unknowns, units = in_units(trim.unknowns, trim.units, display or checked.display)
        trim = replace(trim, unknowns=unknowns, units=units)
    options.out.print(pose_table(shown))
    places = {e.name: e.span for e in checked.states} | {e.name: e.span for e in checked.signals}
    inner = {f"{name}.{VALUE}" for name, span in places.items() if span.file.startswith(SHIPPED) and not verbose}
    inner -= {f"{output.element}.{output.quantity}" for output in chosen.outputs}
    options.out.print(force_table(shown, inner))
    if inner:
        options.out.print(f"not printed: {len(inner)} states and signals of library elements; --verbose prints them")
    facts = [*locking_force_facts(found.locking_forces), *(trim_facts(trim) if trim is not None else ())]
    options.out.print_each(f"{name}: {value}" for name, value in facts)
    options.out.print_each(() if found.trim else standing_tyre_lines(checked, found))
    if free := [name for name in found.neutral if name not in inner]:
        options.out.print(f"neutral, in equilibrium at other values too: {', '.join(free)}")
    if stability:
        with options.progress_bar(f"linearising {model.name}"):
            options.out.print(describe_stability(find_scene_modes(checked, chosen, parameters=parameters)))
    if view is not None:
        from cutjoint.view.states import show_equilibrium

        options.write_view(view, model.name, lambda: show_equilibrium(checked, chosen, parameters, found))
