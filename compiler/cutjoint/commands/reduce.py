"""`cutjoint reduce`."""

from pathlib import Path

from cutjoint.commands import options, table
from cutjoint.reduce.measure import measure_reduced
from cutjoint.reduce.sequence import reduction_sequence, started
from cutjoint.report.tasks import reduction_errors, reduction_table
from cutjoint.run.inputs import with_constant_inputs
from cutjoint.run.outputs import require_apart
from cutjoint.run.reading import read_model
from cutjoint.run.scenes import find_case, method_of


@table.command("reduce")
def command(
    model: Path, scene: str | None, method: str | None, approximate: bool, dt: float | None, tunable: tuple[str, ...],
    changes: tuple[str, ...], view: Path | None,
) -> None:  # fmt: skip
    """Reduce MODEL to what a scene needs; print what each pass did, and operations, error and speed of each reduced model."""
    require_apart({"the model": model}, documents=[("--view", view)])
    checked = read_model(model, tunable=tunable)
    with options.progress_bar(f"reducing {model.name}"):
        checked, chosen = find_case(checked, scene)
        driven, parameters = with_constant_inputs(checked, chosen, options.read_parameters(changes))
        checked, driven = started(checked, driven, parameters)
        variants = reduction_sequence(checked, driven, method or method_of(driven), approximate=approximate)
        costs = measure_reduced(variants, dt=dt, parameters=parameters)
    for printed in (reduction_table(variants, costs), *reduction_errors(variants, costs)):
        options.out.print(printed)
    options.out.print_each((*variants[-1].done, *variants[-1].left))
    if view is not None:
        from cutjoint.view.states import show_reduction

        options.write_view(view, model.name, lambda: show_reduction(checked, driven, parameters, variants))
