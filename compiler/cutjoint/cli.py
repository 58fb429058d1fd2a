"""The command line."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import wraps
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import Progress

from cutjoint import pipeline
from cutjoint.analysis.conditioning import rate_choices
from cutjoint.analysis.guides import GuideError
from cutjoint.analysis.inertia import NoInertiaError, require_inertia
from cutjoint.analysis.mobility import find_mobility
from cutjoint.analysis.poses import explore
from cutjoint.analysis.redundancy import find_redundancy
from cutjoint.batch import compile_batch, simulate_batch
from cutjoint.bench.command import bench_options, run_bench
from cutjoint.export.columns import known_outputs
from cutjoint.export.peers import PEERS, write_export
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.methods import CLOSURES, COMPARISON_SOLVERS, EXPLICIT, IMPLEMENTATIONS, IMPLICIT, METHODS, SOLVERS
from cutjoint.model.document import json_schema
from cutjoint.model.errors import ModelError
from cutjoint.model.link_masses import with_link_masses
from cutjoint.model.read import read_model
from cutjoint.model.records import Model, Output, Scene
from cutjoint.pipeline import Artifact
from cutjoint.realtime import run_in_real_time
from cutjoint.reduce.choose import choose, chosen_rung
from cutjoint.reduce.ladder import Rung, climb
from cutjoint.reduce.measure import measure_rungs
from cutjoint.run.cases import read_cases, write_results
from cutjoint.run.results import FailureReport, Trajectory
from cutjoint.run.run_file import RunError
from cutjoint.run.scenes import find_scene, with_closure
from cutjoint.run.simulator import SimulatorError
from cutjoint.sparse.ordering import MissingLibraryError
from cutjoint.states import NoEquilibriumError, find_equilibrium, find_modes
from cutjoint.toolchain.build import PRECISIONS, ToolchainError
from cutjoint.topology.build import build_topology
from cutjoint.topology.choice import rank_cuts
from cutjoint.topology.spanning_tree import TopologyError

_ERRORS = (
    ModelError, TopologyError, NoInertiaError, GuideError, MissingLibraryError, RunError, SimulatorError, ToolchainError,
    NoEquilibriumError, OSError,
)  # fmt: skip

_out = Console(highlight=False, soft_wrap=True)
_err = Console(stderr=True, highlight=False, soft_wrap=True)

_model = click.argument("model", type=click.Path(exists=True, dir_okay=False, path_type=Path))
_scene = click.option("--scene", metavar="NAME", help="Scene of the model file; may be left out if there is only one.")
_method = click.option("--method", type=click.Choice(METHODS), default="recursive", show_default=True, help="Formulation.")
_set = click.option("--set", "changes", metavar="NAME=VALUE", multiple=True, help="Change a parameter without recompiling (SI units).")
_dt = click.option("--dt", type=click.FloatRange(min=0, min_open=True), help="Step in s; the scene's otherwise.")
_end = click.option("--end", type=click.FloatRange(min=0, min_open=True), help="End time in s; the scene's otherwise.")
_iterations = click.option("--iterations", type=click.IntRange(min=1),
                           help="Of each step of the method recursive, no less and no more, so that all steps cost the same.")  # fmt: skip
_links = click.option("--link-mass", "links", metavar="BODY=KG", multiple=True,
                      help="Make a massless body a slender rod; * in BODY stands for any text.")  # fmt: skip


def _reports_errors(command: Callable[..., Any]) -> Callable[..., Any]:
    """Errors of the user's making end in their message and exit status 1."""

    @wraps(command)
    def wrapped(*args: Any, **kwargs: Any) -> Any:
        try:
            return command(*args, **kwargs)
        except _ERRORS as error:
            _err.print(str(error), markup=False)
            raise SystemExit(1) from None

    return wrapped


@contextmanager
def _progress(label: str) -> Iterator[Callable[[float], None]]:
    """A progress bar on standard error; it yields the function that moves it."""
    with Progress(console=_err, transient=True) as bar:
        task = bar.add_task(label, total=None)
        yield lambda share: bar.update(task, total=1.0, completed=share)


@click.group()
@click.version_option(package_name="cutjoint")
def main() -> None:
    """A model compiler for multibody dynamics: from one YAML file to case-specific C++."""


@main.command()
@_model
@_reports_errors
def check(model: Path) -> None:
    """Validate MODEL; print topology, loops, degrees of freedom, redundant equations, and cut joints with their alternatives."""
    from cutjoint.report import tables

    checked = read_model(model)
    scene = next(iter(checked.scenes), None)
    topology = build_topology(checked)
    equations = formulate_recursive(topology, find_scene(checked, scene), ())
    require_inertia(equations)
    poses = explore(equations)
    mobility = find_mobility(equations, poses)
    _out.print(tables.topology_facts(topology, mobility))
    if topology.loops:
        _out.print(tables.loop_table(topology))
        redundancy = find_redundancy(equations, poses)
        if redundancy.structural or redundancy.momentary:
            _out.print(tables.redundancy_table(redundancy))
        _out.print(tables.cut_choices(rate_choices(topology, rank_cuts(topology)), mobility.redundant), markup=False)
    _out.print(f"scenes: {', '.join(checked.scenes) or 'none'}", markup=False)


@main.command("compile")
@_model
@_scene
@_method
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), required=True, help="Folder for the C++ and the simulator.")
@_reports_errors
def compile_(model: Path, scene: str | None, method: str, out: Path) -> None:
    """Generate and compile the C++ of MODEL for one scene."""
    with _progress(f"compiling {model.name}"):
        artifact = pipeline.compile_model(model, scene=scene, method=method, out=out)
    _out.print(f"{artifact.program.operations(artifact.iteration)} operations an evaluation; source and simulator in {out}", markup=False)


@main.command()
@_model
@_scene
@click.option("--method", type=click.Choice(["auto", *METHODS]), help="Formulation, or auto to pick one that keeps the tolerance; "
              "by default the scene's, else recursive.")
@click.option("--tolerance", type=click.FloatRange(min=0, min_open=True), help="Of method auto in m and rad, of a step of "
              "dormand-prince and sdirk4 relative and absolute, else of the iteration in a step; the scene's otherwise.")
@click.option("--implementation", type=click.Choice(IMPLEMENTATIONS), default="generated", show_default=True,
              help="Code made for the model, or a generic program that interprets it.")
@click.option("--solver", type=click.Choice(SOLVERS), default="emitted", show_default=True,
              help="Linear solver of the Lagrangian methods; cholmod, klu and umfpack are for comparison.")
@click.option("--integrator", type=click.Choice(["trapezoidal", *EXPLICIT, *IMPLICIT]),
              help="rk4 and dormand-prince take the method recursive, sdirk4 and generalised-alpha recursive-newton; by default "
              "the scene's, else trapezoidal.")
@click.option("--precision", type=click.Choice(PRECISIONS), default="double", show_default=True, help="Number type of the run.")
@click.option("--closure", type=click.Choice(CLOSURES),
              help="How the recursive method holds its cut joints; the scene's otherwise.")
@_dt
@_end
@_iterations
@_set
@click.option("--batch", type=click.Path(exists=True, dir_okay=False, path_type=Path),
              help="CSV file of parameters, a row for each run (SI units): many runs side by side; --out has a row for each, with end, "
              "smallest and largest value of each output over the scene's rows.")
@click.option("--threads", type=click.IntRange(min=1), help="Of a batch; as many as processors otherwise.")
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), required=True, help="CSV file; units go beside it.")
@click.option("--steps", type=click.Path(dir_okay=False, path_type=Path), help="CSV file for iterations and residuals of each step.")
@click.option("--plots", type=click.Path(file_okay=False, path_type=Path), help="Folder for plots of the run.")
@_reports_errors
def simulate(
    model: Path, scene: str | None, method: str | None, tolerance: float | None, implementation: str, solver: str,
    integrator: str | None, precision: str, closure: str | None, dt: float | None, end: float | None, iterations: int | None,
    changes: tuple[str, ...], batch: Path | None, threads: int | None, out: Path, steps: Path | None, plots: Path | None,
) -> None:  # fmt: skip
    """Compile MODEL when needed, run one scene, and write its outputs."""
    from cutjoint.report import tables

    parameters = _parameters(changes)
    checked = read_model(model)
    chosen = find_scene(checked, scene)
    asked = method or chosen.method or "recursive"
    if closure is not None and asked != "recursive":
        raise RunError(f"--closure {closure}: only the recursive method has one; use --method recursive")
    chosen = chosen if closure is None else with_closure(chosen, closure)
    if batch is None and threads is not None:
        raise RunError("--threads goes with --batch: a single run has one")
    if batch is not None:
        _require_own(
            "--batch", "runs the method recursive by the trapezoidal rule", implementation=implementation, solver=solver,
            precision=precision, integrator=None if integrator == "trapezoidal" else integrator,
            method=None if asked == "recursive" else asked, iterations=iterations, steps=steps, plots=plots,
        )  # fmt: skip
        if integrator is not None:
            chosen = replace(chosen, numerics=replace(chosen.numerics, integrator=integrator))
        _run_batch(checked, chosen, batch, out, parameters, dt=dt, end=end, tolerance=tolerance, threads=threads)
        return

    def run_with(of: Model, played: Scene, method: str) -> tuple[Artifact, Trajectory]:
        if method == "recursive" and solver != "emitted":
            raise RunError(f"--solver {solver}: the recursive method has no linear solver; use --method augmented or classical")
        with _progress(f"compiling {model.name}"):
            comparison = solver in COMPARISON_SOLVERS
            artifact = pipeline.compile_scene(
                of, played, method=method, implementation=implementation, comparison=comparison, precision=precision
            )
        with _progress(f"running {played.name}") as progress:
            return artifact, pipeline.simulate(
                artifact, out=out, dt=dt, end=end, parameters=parameters, solver=solver, integrator=integrator, iterations=iterations,
                tolerance=None if asked == "auto" else tolerance, steps=steps, progress=progress,
            )  # fmt: skip

    if asked == "auto":
        _require_own(
            "method auto", "runs what it has measured; use --method", implementation=implementation, solver=solver, integrator=integrator,
            precision=precision, dt=dt, end=end, iterations=iterations,
        )  # fmt: skip
        rung = _pick(checked, chosen, tolerance, parameters)
        artifact, run = run_with(rung.model, rung.scene, rung.method)
        if run.failure is not None and run.failure.guards and chosen.on_violation == "restart":
            _err.print(f"{run.failure}; again with the full model", markup=False)
            artifact, run = run_with(checked, replace(chosen, numerics=rung.scene.numerics), rung.method)
    else:
        artifact, run = run_with(checked, chosen, asked)
    _out.print(tables.topology_facts(artifact.topology, find_mobility(artifact.mechanism)))
    _out.print(tables.run_facts(artifact, run))
    _out.print(f"results: {out}, {len(run.columns)} columns, {run.t.size} rows", markup=False)
    if plots is not None:
        _plot(artifact, run, plots)
    if run.failure is not None:
        _err.print(f"{_failed(artifact, run.failure, model)}; the results up to then are kept", markup=False)
        raise SystemExit(1)


def _failed(artifact: Artifact, failure: FailureReport, model: Path) -> str:
    """What failed, with the line of its element."""
    where = _place(artifact, failure.element) or str(model)
    return f"{where}: scene '{artifact.scene.name}': {failure}"


@main.command()
@_model
@_scene
@_method
@_dt
@_end
@_iterations
@_set
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), help="CSV file for the time of each step.")
@_reports_errors
def realtime(
    model: Path, scene: str | None, method: str, dt: float | None, end: float | None, iterations: int | None, changes: tuple[str, ...],
    out: Path | None,
) -> None:  # fmt: skip
    """Run one scene of MODEL by the trapezoidal rule against the wall clock: how long steps take, and how many miss their deadline."""
    from cutjoint.report.realtime import time_tables

    with _progress(f"compiling {model.name}"):
        artifact = pipeline.compile_model(model, scene=scene, method=method)
    with _progress(f"running {artifact.scene.name}"):
        times = run_in_real_time(artifact, dt=dt, end=end, iterations=iterations, parameters=_parameters(changes), out=out)
    for table in time_tables(times):
        _out.print(table)
    if times.failure is not None:
        _err.print(f"{_failed(artifact, times.failure, model)}; the steps up to then are told", markup=False)
        raise SystemExit(1)


def _require_own(who: str, reason: str, **options: Any) -> None:
    """Some ways to run have their own choice of what these options say."""
    usual = {"implementation": "generated", "solver": "emitted", "precision": "double"}
    for name in (name for name, value in options.items() if value != usual.get(name)):
        raise RunError(f"--{name} cannot go with {who}, which {reason}")


def _run_batch(model: Model, scene: Scene, table: Path, out: Path, parameters: Mapping[str, float], **how: Any) -> None:
    """Many runs of a scene: their results into ``out``, and what became of them."""
    from cutjoint.report.tables import batch_facts

    cases = read_cases(table, model)
    if twice := sorted(cases[0].keys() & parameters.keys()):
        raise RunError(f"--set {twice[0]}: the table {table} has it too; set it in one of the two")
    if out.resolve() == table.resolve():
        raise RunError(f"--out {out}: that is the table of parameters; write the results elsewhere")
    out.parent.mkdir(parents=True, exist_ok=True)
    with _progress(f"compiling {model.name}"):
        artifact = compile_batch(model, scene)
    with _progress(f"running {scene.name}") as progress:
        done = simulate_batch(artifact, [{**parameters, **case} for case in cases], progress=progress, **how)
    write_results(done, out)
    _out.print(batch_facts(artifact, done))
    _out.print(f"results: {out}, {len(cases)} runs", markup=False)
    failed = [(i, failure) for i, failure in enumerate(done.failures) if failure is not None]
    for i, failure in failed[:5]:
        _err.print(f"{table}: run {i + 1}: {failure}", markup=False)
    if failed:
        _err.print(f"{len(failed)} of {len(cases)} runs failed; column 'run.failure' of {out} says how", markup=False)
        raise SystemExit(1)


def _pick(model: Model, scene: Scene, tolerance: float | None, parameters: dict[str, float]) -> Rung:
    """The model, scene and method that method auto picks; it says what and why."""
    from cutjoint.report.ladder import choice_table

    wanted = replace(scene, method="auto", tolerance=tolerance or scene.tolerance)
    if wanted.tolerance is None:
        raise RunError(f"{scene.span}: scene '{scene.name}': method auto needs a tolerance; write tolerance: 1 mm, or use --tolerance")
    with _progress(f"picking what keeps {wanted.tolerance:g} m and rad"):
        choice = choose(model, wanted, parameters=parameters)
    _out.print(choice_table(choice, wanted))
    return chosen_rung(model, wanted, choice)


@main.command()
@_model
@_scene
@_method
@click.option("--approximate", is_flag=True, help="Try passes too that change the motion a little.")
@_dt
@_set
@_reports_errors
def reduce(model: Path, scene: str | None, method: str, approximate: bool, dt: float | None, changes: tuple[str, ...]) -> None:
    """Cut MODEL down to what a scene needs: what each pass did and why, operations, and error and speed of every rung."""
    from cutjoint.report.ladder import ladder_table, note_lines

    checked = read_model(model)
    with _progress(f"reducing {model.name}"):
        rungs = climb(checked, find_scene(checked, scene), method, approximate=approximate)
        costs = measure_rungs(rungs, dt=dt, parameters=_parameters(changes))
    _out.print(ladder_table(rungs, costs))
    for line in note_lines(rungs[-1]):
        _out.print(line, markup=False)


def _place(artifact: Artifact, quantity: str) -> str:
    """Where the joint of a coordinate or an equation stands in the model file."""
    element = quantity.rpartition(".")[0]
    return next((str(j.span) for j in artifact.topology.model.joints if j.name == element), "")


def _plot(artifact: Artifact, run: Trajectory, folder: Path) -> None:
    from cutjoint.report.plots import plot_run

    title = f"{artifact.topology.model.name}, {artifact.scene.name}"
    _out.print(f"plots: {', '.join(str(p) for p in plot_run(run, title, folder))}", markup=False)


def _parameters(changes: tuple[str, ...], option: str = "--set") -> dict[str, float]:
    parameters = {}
    for change in changes:
        name, _, value = change.partition("=")
        try:
            parameters[name] = float(value)
        except ValueError:
            raise RunError(f"{option} {change}: write NAME=NUMBER") from None
    return parameters


@main.command()
@_model
@_scene
@_set
@_reports_errors
def equilibrium(model: Path, scene: str | None, changes: tuple[str, ...]) -> None:
    """Find the static equilibrium of MODEL and print every element's force."""
    from cutjoint.report import tables

    parameters = _parameters(changes)
    if scene is None:
        scene = next(iter(read_model(model).scenes), None)
    with _progress(f"compiling {model.name}"):
        found = find_equilibrium(model, scene=scene, parameters=parameters)
    _out.print(tables.equilibrium_table(found))


@main.command()
@_model
@_scene
@click.option("--at", type=click.FloatRange(min=0), metavar="T",
              help="Linearise about the scene's motion at T seconds; otherwise about the static equilibrium.")
@_set
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), help="JSON file for all figures.")
@_reports_errors
def modes(model: Path, scene: str | None, at: float | None, changes: tuple[str, ...], out: Path | None) -> None:
    """Linearise MODEL and print eigenvalues, frequencies, damping and mode shapes."""
    from cutjoint.report.modes import mode_tables, modes_json

    checked = read_model(model)
    chosen = find_scene(checked, next(iter(checked.scenes), None) if scene is None and at is None else scene)
    with _progress(f"linearising {model.name}") as progress:
        found = find_modes(checked, chosen, at=at, parameters=_parameters(changes), progress=progress)
    for table in mode_tables(found):
        _out.print(table)
    if out is not None:
        out.write_text(modes_json(found, checked.name, chosen.name), encoding="utf-8")


@main.command()
@_model
@_scene
@_method
@click.option("--reduced", is_flag=True, help="What the exact and guarded passes leave of MODEL.")
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), help="Markdown file; standard output otherwise.")
@_reports_errors
def explain(model: Path, scene: str | None, method: str, reduced: bool, out: Path | None) -> None:
    """Explain in Markdown what the compiler derives from MODEL: topology, equations, operations, what open parameters cost."""
    from cutjoint.report.explain.document import explain as write_explanation

    checked = read_model(model)
    chosen = find_scene(checked, next(iter(checked.scenes), None) if scene is None else scene)
    with _progress(f"explaining {model.name}"):
        rung = climb(checked, chosen, method)[-1] if reduced else None
        text = write_explanation(rung.model, rung.scene, method, done=rung.done) if rung else write_explanation(checked, chosen, method)
    if out is None:
        click.echo(text, nl=False)
    else:
        out.write_text(text, encoding="utf-8", newline="\n")


@main.command()
@bench_options
@_set
@_links
@_reports_errors
def bench(changes: tuple[str, ...], links: tuple[str, ...], **how: Any) -> None:
    """Measure speed and accuracy of all methods on MODELS against a reference, and write a report."""
    for path in run_bench(parameters=_parameters(changes), link_masses=_parameters(links, "--link-mass"), **how):
        _out.print(str(path), markup=False)


@main.command()
@_model
@_scene
@click.option("--to", "peer", type=click.Choice(list(PEERS)), required=True, help="The other simulator.")
@_set
@_links
@click.option("--output", "asked", metavar="ELEMENT.QUANTITY", multiple=True,
              help="A column of the table; by default those of the scene that are motions of bodies and markers.")
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), required=True, help="Folder for the program.")
@_reports_errors
def export(
    model: Path, scene: str | None, peer: str, changes: tuple[str, ...], links: tuple[str, ...], asked: tuple[str, ...], out: Path
) -> None:  # fmt: skip
    """Write MODEL as a program for another simulator, which runs one scene there."""
    checked = with_link_masses(read_model(model), _parameters(links, "--link-mass"))
    chosen = find_scene(checked, scene)
    outputs = [_output(checked, name) for name in asked] or known_outputs(checked, chosen.outputs)
    with _progress(f"exporting {model.name}"):
        exported = PEERS[peer].export(checked, chosen, _parameters(changes), outputs)
    write_export(exported, out)
    for sentence in exported.differences:
        _out.print(sentence, markup=False)
    if left_out := [o.column for o in chosen.outputs if not asked and o not in outputs]:
        _out.print(f"outputs left out: {', '.join(left_out)}", markup=False)
    _out.print(f"{', '.join(exported.files)} in {out}; the first of them tells how to run it", markup=False)


def _output(model: Model, name: str) -> Output:
    element, _, quantity = name.rpartition(".")
    return Output(element=element, quantity=quantity, span=model.span)


@main.command()
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), help="JSON file; standard output otherwise.")
def schema(out: Path | None) -> None:
    """Print the JSON Schema of model files, for editors."""
    if out is None:
        click.echo(json_schema(), nl=False)
    else:
        out.write_text(json_schema(), encoding="utf-8")
