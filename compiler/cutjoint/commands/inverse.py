"""`cutjoint inverse`."""

from dataclasses import replace
from pathlib import Path

from cutjoint.commands import options, table
from cutjoint.report.tasks import drive_table, write_drives
from cutjoint.run.display import in_units, read_units
from cutjoint.run.outputs import require_apart
from cutjoint.run.reading import read_model
from cutjoint.tasks.inverse import inverse_dynamics


@table.command("inverse")
def command(
    model: Path, scene: str | None, drives: str | None, end: float | None, tunable: tuple[str, ...], changes: tuple[str, ...],
    display: tuple[str, ...], out: Path | None,
) -> None:  # fmt: skip
    """Find the forces with which drives move MODEL as a scene prescribes, and print the largest."""
    require_apart({"the model": model}, tables={"--out": out})
    checked, _ = read_model(model, tunable=tunable), read_units(display)
    with options.progress_bar(f"compiling {model.name}"):
        found = inverse_dynamics(
            checked, scene=scene, drives=(drives or "").split(",") if drives else (), parameters=options.read_parameters(changes), end=end
        )
    console = options.message_console(out)
    forces, units = in_units(found.forces, found.units, display or checked.display)
    console.print(drive_table(replace(found, forces=forces, units=units)))
    if found.redundant:
        console.print("more drives than degrees of freedom: the forces of minimum norm are given")
    if out is not None:
        console.print(f"results: {write_drives(found, out)}")
