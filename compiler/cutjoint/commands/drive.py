"""`cutjoint drive`."""

from pathlib import Path

from cutjoint.commands import options, table
from cutjoint.methods import METHODS, Formulation
from cutjoint.package.errors import RunError, plural
from cutjoint.run.outputs import OutputError, require_apart
from cutjoint.run.reading import read_model
from cutjoint.run.result_files import write_table, write_whole
from cutjoint.run.scenes import method_of, with_loops
from cutjoint.view.drive import Ends, make_drive, replay_drive
from cutjoint.view.views import PAGE, drive_page


@table.command("drive")
def command(
    model: Path, scene: str | None, method: str | None, dt: float | None, loops: str | None, tunable: tuple[str, ...],
    changes: tuple[str, ...], functions: Path | None, steer: str | None, throttle: str | None, brake: str | None,
    ranges: tuple[str, ...], replay: Path | None, out: Path | None,
) -> None:  # fmt: skip
    """Write a page in which MODEL runs against the clock, and keys, sliders, touches or a gamepad move its inputs."""
    ending = PAGE if replay is None else ".csv"
    out = Path(f"{model.stem}{ending}") if out is None else out
    if out.suffix != ending:
        raise OutputError(f"--out {out}: no such kind of file; write a name that ends in {ending}")
    require_apart({"the model": model, "--replay": replay}, documents=[("--out", out)])
    checked, taken = options.choose_case(read_model(model, tunable=tunable, functions=functions), scene)
    chosen = with_loops(taken, loops)
    steps = method or method_of(chosen, [name for name, m in METHODS.items() if m.formulation is not Formulation.NATURAL])
    parameters = options.read_parameters(changes)
    roles = {
        role: _read_ends(f"--{role}", text, 2 if role == "steer" else 1)
        for role, text in (("steer", steer), ("throttle", throttle), ("brake", brake)) if text is not None
    }  # fmt: skip
    if replay is not None:
        with options.progress_bar(f"compiling {model.name}"):
            table = replay_drive(checked, chosen, replay, method=steps)
        write_table(out, table.units, table.rows)
        options.message_console(out).print(f"replay: {out}, {plural(len(table.rows), 'row')}")
        return
    with options.progress_bar(f"compiling {model.name}"):
        own = {"--method": method, "--loops": loops, "--functions": functions}
        more = [word for option, value in own.items() if value is not None for word in (option, str(value))]
        more += [word for pattern in tunable for word in ("--tunable", pattern)]
        ends = [_read_ends("--range", text, 2) for text in ranges]
        drive = make_drive(checked, chosen, parameters, method=steps, dt=dt, roles=roles, ranges=ends, more=more)
        page = drive_page(checked, chosen, parameters, drive)
    write_whole(out, page)
    options.message_console(out).print(f"drive: {out}, {len(page) / 1e6:.1f} MB")


def _read_ends(option: str, text: str, count: int) -> Ends:
    """The ends of NAME, NAME=HIGH or NAME=LOW,HIGH, of as many numbers as ``count`` or none."""
    name, _, said = text.partition("=")
    values = [options.read_parameters((f"{name}={each.strip()}",), option)[name] for each in said.split(",")] if said else []
    if len(values) not in (0, count):
        raise RunError(f"{option} {text}: write {name}={'LOW,HIGH' if count == 2 else 'FULL'}, or {name} alone")
    return Ends(name=name, low=values[0] if count == 2 and values else None, high=values[-1] if values else None)
