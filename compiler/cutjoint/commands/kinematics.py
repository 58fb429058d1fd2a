"""`cutjoint kinematics`."""

from pathlib import Path

from cutjoint.commands import options, table
from cutjoint.package.errors import RunError
from cutjoint.report.kinematics import compliance_tables, kinematics_tables, plot_kinematics, write_compliance, write_kinematics
from cutjoint.run.outputs import require_apart, require_folder
from cutjoint.run.reading import read_model
from cutjoint.tasks.kinematics.sweep import find_compliance, find_kinematics


@table.command("kinematics")
def command(
    model: Path, axle: str | None, travel: float, steer_travel: float | None, points: int, steer: str | None, radius: float | None,
    share: float, compliance: str | None, tunable: tuple[str, ...], changes: tuple[str, ...], out: Path | None, plots: Path | None,
) -> None:  # fmt: skip
    """Move the wheels of an axle of MODEL up and down and steer them; print camber, toe, steering axis, roll centre and ratios."""
    require_apart({"the model": model}, tables={"--out": out}, plots=plots)
    read = read_model(model, tunable=tunable)
    if compliance is not None:
        if plots is not None:
            raise RunError("--plots: compliance has no plots; leave it out")
        with options.progress_bar(f"loading the axle of {model.name}"):
            loaded = find_compliance(
                read, scene=compliance, axle=axle, steer=steer, radius=radius, parameters=options.read_parameters(changes)
            )
        console = options.message_console(out)
        console.print_each(compliance_tables(loaded))
        if out is not None:
            console.print(f"results: {write_compliance(loaded, out)}")
        return
    if plots is not None:
        require_folder(plots)
    with options.progress_bar(f"moving the axle of {model.name}"):
        found = find_kinematics(
            read, axle=axle, travel=travel, steer_travel=steer_travel, points=points, steer=steer, radius=radius, share=share,
            parameters=options.read_parameters(changes),
        )  # fmt: skip
    console = options.message_console(out)
    console.print_each(kinematics_tables(found))
    if out is not None:
        console.print(f"results: {write_kinematics(found, out)}")
    if plots is not None:
        pictures = plot_kinematics(found, f"{model.stem}, axle {found.axle.name}", plots)
        console.print(f"plots: {', '.join(map(str, pictures))}")
