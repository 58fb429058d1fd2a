"""`cutjoint batch`."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from cutjoint.commands import options, table
from cutjoint.commands.preparing import read_request
from cutjoint.compile.prepared import Request, find_cached, put_into_cache
from cutjoint.methods import METHODS, join_or, names_of
from cutjoint.model.records import Model, Scene
from cutjoint.package.errors import RunError, plural
from cutjoint.report.tables import batch_facts
from cutjoint.run.cases import read_cases
from cutjoint.run.failures import count_failures, describe_failures
from cutjoint.run.outputs import require_apart
from cutjoint.run.reading import file_digests
from cutjoint.run.results import Batch
from cutjoint.run.settings import Options, with_options
from cutjoint.tasks.batch import BatchArtifact, compile_scene_batch, facts_of, simulate_batch
from cutjoint.toolchain.compiler import must_interpret


@table.command("batch")
def command(
    model: Path, cases: Path, scene: str | None, method: str | None, tolerance: float | None, integrator: str | None, events: str | None,
    closure: str | None, dt: float | None, end: float | None, tunable: tuple[str, ...], changes: tuple[str, ...], threads: int | None,
    out: Path, functions: Path | None,
) -> None:  # fmt: skip
    """Run one scene of MODEL once for each row of CASES, a CSV file of parameters and constant inputs in SI units.

    The table has a row for each run, with final, smallest and largest value of each output over the scene's samples.
    """
    require_apart({"the model": model, "the table of parameters": cases}, tables={"--out": out})
    parameters = options.read_parameters(changes)
    requested = Options(dt=dt, end=end, tolerance=tolerance, integrator=integrator, events=events)
    request = Request(model=model, scene=scene, method=method, closure=closure, tunable=tunable, functions=functions)
    read, chosen, by = read_request(request)
    if by not in (able := names_of(METHODS, lambda m: m.batch)):
        raise RunError(f"{chosen.span}: scene '{chosen.name}': batches have no method {by}; use --method {join_or(able)}")
    code = replace(requested, dt=dt and 1.0, end=None, tolerance=None)  # of which code follows
    runs, numerics = read_cases(cases, read), chosen.numerics
    if twice := sorted(runs[0].keys() & parameters.keys()):
        raise RunError(f"--set {twice[0]}: the table {cases} has it too; set it in one of the two")
    numerics = replace(numerics, integrator=integrator or numerics.integrator, events=events or numerics.events)
    chosen = with_options(replace(chosen, numerics=numerics), by, Options(dt=dt))
    done = _run(replace(request, options=code), requested, read, chosen, parameters, runs, threads, out)
    options.err.print_each(f"{cases}: {failure}" for failure in describe_failures(done))
    if failed := count_failures(done):
        options.err.print(f"{failed}; column 'run.failure' of {out} says how")
        raise SystemExit(1)


def _compile(request: Request, model: Model, scene: Scene) -> BatchArtifact:
    """The batch of a request, from the cache if it is there."""
    found = find_cached(request, "batches", lambda known: compile_scene_batch(model, scene, known=known))
    artifact = compile_scene_batch(model, scene) if found is None else found
    if found is None and artifact.model is model and not must_interpret():  # nothing was taken out, trimmed or embedded
        put_into_cache(request, model.text, "batches", {**facts_of(artifact), "files": file_digests(model)})
    return artifact


def _run(
    request: Request, requested: Options, model: Model, scene: Scene, parameters: Mapping[str, float], cases: list[dict[str, float]],
    threads: int | None, out: Path,
) -> Batch:  # fmt: skip
    with options.progress_bar(f"compiling {model.name}"):
        artifact = _compile(request, model, scene)
    with options.progress_bar(f"running {scene.name}") as progress:
        done = simulate_batch(
            artifact, [{**parameters, **case} for case in cases], dt=requested.dt, end=requested.end, tolerance=requested.tolerance,
            threads=threads, out=out, progress=progress, check=False,
        )  # fmt: skip
    console = options.message_console(out)
    console.print(batch_facts(artifact, done))
    console.print(f"results: {out}, {plural(len(cases), 'run')}")
    return done
