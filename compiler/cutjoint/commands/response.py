"""`cutjoint response`."""

from pathlib import Path

from cutjoint.commands import options, table
from cutjoint.model.expressions.tunable import with_inputs
from cutjoint.package.errors import RunError
from cutjoint.report import response as report
from cutjoint.run.display import read_units
from cutjoint.run.outputs import require_apart, require_folder
from cutjoint.run.reading import read_model
from cutjoint.run.scenes import find_case
from cutjoint.stepping.response import find_scene_linear_model
from cutjoint.stepping.state_space import SampledStateSpace
from cutjoint.stepping.vibration import random_vibration


@table.command("response")
def command(
    model: Path, scene: str | None, at: float | None, inputs: tuple[str, ...], requested: tuple[str, ...], first: float | None,
    last: float | None, points: int, road: str | None, speed: float | None, weight: str, external_wrenches: tuple[str, ...],
    terrain: tuple[str, ...], tunable: tuple[str, ...], changes: tuple[str, ...], display: tuple[str, ...],
    out: Path | None, plots: Path | None,
) -> None:  # fmt: skip
    """Find the frequency response of MODEL with poles, zeros and margins, or its random vibration on a rough road."""
    require_apart({"the model": model}, tables={"--out": out}, plots=plots)
    if (road is None) != (speed is None):
        raise RunError("--road and --speed go together: the road class and the driving speed")
    if first is not None and last is not None and first >= last:
        raise RunError(f"--from and --to: the range from {first:g} to {last:g} Hz is empty")
    if road is not None and (first, last) != (None, None):
        raise RunError("--from and --to belong to a frequency response; random vibration takes the road's frequencies")
    if display and road is None:
        raise RunError("--display belongs to random vibration, --road; a frequency response is in SI units")
    read_units(display)
    if plots is not None:
        require_folder(plots)
    read = with_inputs(read_model(model, tunable=tunable), external_wrenches=external_wrenches, terrain=terrain)
    checked, chosen = options.choose_case(read, scene) if at is None else find_case(read, scene)
    with options.progress_bar(f"linearising {model.name}"):
        near = find_scene_linear_model(
            checked, chosen, at=at, inputs=inputs, outputs=requested, parameters=options.read_parameters(changes)
        )
    console, title = options.message_console(out), f"{checked.name}, scene {chosen.name}"
    try:
        if road is not None and speed is not None:
            if isinstance(near, SampledStateSpace):
                raise RunError("--road: random vibration does not support sampled controllers; simulate the model on the road")
            found = random_vibration(near, road=road, speed=speed, weight=weight, points=points)
            if not near.is_stable:
                options.err.print("the model is not stable: densities are valid only for outputs without growing modes")
            shown = report.in_display_units(found, display or checked.display)
            console.print(report.vibration_table(shown, f"road {road} at {speed:g} m/s", weight))
            written = None if out is None else report.write_densities(found, out)
            pictures = [] if plots is None else report.plot_densities(shown, f"{title}: road {road} at {speed:g} m/s", plots)
        else:
            response = near.frequency_response(near.frequencies(points, first, last))
            rest = "the static equilibrium" if chosen.trim is None else "the trimmed start"
            about = rest if at is None else f"the motion at {at:g} s"
            console.print_each(report.response_tables(near, response.frequencies if first or last else None, about))
            written = None if out is None else report.write_response(response, out)
            pictures = [] if plots is None else report.plot_response(response, title, plots)
    except ValueError as error:
        raise RunError(str(error)) from None
    if written is not None:
        console.print(f"results: {written}")
    if pictures:
        console.print(f"plots: {', '.join(map(str, pictures))}")
