"""`cutjoint modes`."""

from pathlib import Path

from cutjoint.commands import options, table
from cutjoint.report.tasks import mode_tables, modes_json
from cutjoint.run.outputs import require_apart
from cutjoint.run.reading import read_model
from cutjoint.run.result_files import write_whole
from cutjoint.run.scenes import find_case
from cutjoint.tasks.states import find_scene_modes


@table.command("modes")
def command(
    model: Path, scene: str | None, at: float | None, tunable: tuple[str, ...], changes: tuple[str, ...], out: Path | None,
    view: Path | None,
) -> None:  # fmt: skip
    """Linearise MODEL and print eigenvalues, frequencies, damping and mode shapes."""
    require_apart({"the model": model}, documents=[("--out", out), ("--view", view)])
    checked = read_model(model, tunable=tunable)
    checked, chosen = options.choose_case(checked, scene) if at is None else find_case(checked, scene)
    parameters = options.read_parameters(changes)
    with options.progress_bar(f"linearising {model.name}") as progress:
        found = find_scene_modes(checked, chosen, at=at, parameters=parameters, progress=progress)
    options.message_console(out).print_each(mode_tables(found))
    if found.at_rest and any(force.has_road for force in checked.forces):
        advice = "for modes of a rolling vehicle use --at TIME, or a scene with a trim at speed"
        options.message_console(out).print(f"the wheels stand; {advice}")
    if out is not None:
        write_whole(out, modes_json(found, checked.name, chosen.name))
    if view is not None:
        from cutjoint.view.states import show_modes

        options.write_view(view, model.name, lambda: show_modes(checked, chosen, parameters, found), out)
