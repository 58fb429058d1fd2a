"""`cutjoint realtime`."""

from pathlib import Path

from cutjoint.commands import options, table
from cutjoint.compile.pipeline import compile_model
from cutjoint.report.tasks import time_tables
from cutjoint.run.failures import describe_failure, describe_rest
from cutjoint.run.outputs import require_apart
from cutjoint.run.reading import read_model
from cutjoint.run.run_file import parameter_values
from cutjoint.tasks.realtime import run_in_real_time


@table.command("realtime")
def command(
    model: Path, scene: str | None, method: str | None, dt: float | None, end: float | None, iterations: int | None,
    tunable: tuple[str, ...], changes: tuple[str, ...], priority: int | None, processor: int | None, out: Path | None,
    functions: Path | None,
) -> None:  # fmt: skip
    """Run one scene of MODEL by the trapezoidal rule against the wall clock: how long steps take, and how many miss their deadline."""
    require_apart({"the model": model}, tables={"--out": out})
    parameters = options.read_parameters(changes)
    read = read_model(model, functions=functions, tunable=tunable)
    parameter_values(read, parameters)
    with options.progress_bar(f"compiling {model.name}"):
        artifact = compile_model(read, scene=scene, **({"method": method} if method else {}))
    with options.progress_bar(f"running {artifact.scene.name}"):
        times = run_in_real_time(
            artifact, dt=dt, end=end, iterations=iterations, parameters=parameters, out=out, check=False, priority=priority,
            processor=processor,
        )  # fmt: skip
    options.message_console(out).print_each(time_tables(times))
    if times.failure is not None:
        where = describe_failure(times.failure, artifact.scene.name, artifact.places, artifact, parameters)
        options.err.print(f"{where}; the times are of the steps up to then; {describe_rest(times.table)}")
        raise SystemExit(1)
