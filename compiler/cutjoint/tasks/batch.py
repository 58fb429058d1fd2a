"""Runs from Python: one of a compiled model, or batches of many that differ by parameters, several of them side by side in a register."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import ExitStack, closing
from dataclasses import asdict, dataclass, field, replace
from functools import cache, cached_property
from pathlib import Path
from time import perf_counter
from typing import Any, TypeVar
from warnings import warn

import numpy as np

from cutjoint.compile.c_export import fits_lanes, make_standalone
from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene, generate
from cutjoint.compile.prepared import place_in_cache
from cutjoint.emit.classes import MOST_LANES
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.methods import DEFAULT_INTEGRATOR, INTEGRATORS, METHODS, PLAIN_CLOSURE, Events, Implementation, join_or, names_of
from cutjoint.model.expressions.functions import require_code
from cutjoint.model.ranges import count_steps
from cutjoint.model.records import Model, Scene
from cutjoint.package.errors import RunError
from cutjoint.package.locations import AnyPath
from cutjoint.package.system import processors
from cutjoint.run import simulation
from cutjoint.run.artifact import Artifact, make_simulator_run, start_of
from cutjoint.run.cases import CaseTable
from cutjoint.run.failures import FailedBatchError, count_failures, describe_failures
from cutjoint.run.inputs import InputLike, input_entries
from cutjoint.run.results import Array, Batch, Columns, Trajectory
from cutjoint.run.run_file import changing_parts, constant_inputs, find_dependent_parts, make_run_file, parameter_values, trimmed
from cutjoint.run.scenes import ModelLike, load_model, method_of, with_closure, with_default_closure
from cutjoint.run.settings import Options, StepSettings, find_closure, find_integrator, find_tolerance, require_settings
from cutjoint.run.simulator import Progress, failure_of
from cutjoint.run.simulator_run import SimulatorRun, Start, start
from cutjoint.run.stopping import stop_requests
from cutjoint.tasks.batch_library import KINDS, BatchLibrary, names_of_runs, with_batch
from cutjoint.toolchain.build import FLAGS, Binary, build
from cutjoint.toolchain.cache import is_sound
from cutjoint.toolchain.compiler import must_interpret

#: The method whose runs are evaluated side by side.
(METHOD,) = names_of(METHODS, lambda m: m.batch)
_Item = TypeVar("_Item")
_Result = TypeVar("_Result")
#: Results of runs: the number of the first one, the records, and seconds of their steps.
_Results = Generator[tuple[int, list[dict[str, Any]], float], None, None]


@dataclass(frozen=True, kw_only=True)
class BatchArtifact:
    """A model compiled for batches of one scene, with ``facts`` of its equations, plain data.
    ``single`` compiles the simulator of one run, ``binary`` is that where runs go one by one, else their library."""

    model: Model
    scene: Scene
    binary: Binary
    facts: Mapping[str, Any]
    single: Callable[[], Artifact] = field(repr=False, compare=False)
    generate_seconds: float = 0.0
    compile_seconds: float = 0.0
    is_cached: bool = False

    @cached_property
    def library(self) -> BatchLibrary | None:
        """What makes the runs side by side."""
        names, outputs = self.facts["names"], len(self.facts["units"])
        return names and BatchLibrary(path=self.binary.path, model=self.model.name, names=names, outputs=outputs)

    @property
    def start(self) -> Start:
        """The origin of the speeds at the start of its runs."""
        return Start(**self.facts["start"])

    def __repr__(self) -> str:
        return f"<BatchArtifact of '{self.model.name}', scene '{self.scene.name}': {self.facts['unknowns']} unknowns, {self.binary.path}>"


def compile_batch(
    model: ModelLike, *, scene: str | None = None, tunable: Sequence[str] = (), flags: Sequence[str] = FLAGS
) -> BatchArtifact:  # fmt: skip
    """Compile a model for batches of one scene, by default the only one; errors as of `compile_model`."""
    return compile_scene_batch(*load_model(model, scene, tunable), flags=flags)


def compile_scene_batch(
    model: Model, scene: Scene, *, flags: Sequence[str] = FLAGS, known: Mapping[str, Any] | None = None
) -> BatchArtifact:  # fmt: skip
    """Compile a model for batches of a scene, with the recursive method.
    Runs are made side by side by the trapezoidal rule, with penalties if the scene names no closure. They are made one by one if the
    scene's default integrator is another, if rates of guides may jump, if there are controllers or functions in C++, or without a compiler.
    ``known`` is what `facts_of` has said of the same batch.

    Raises:
        ModelError, EquationsError: the model is wrong.
        RunError: batches do not support the scene's integrator or events.
        ToolchainError: the compiler failed.
        ValueError: the cache has no more what is ``known``.
    """
    _require_batch(scene)
    integrator = find_integrator(scene.numerics, METHODS[METHOD], Implementation.GENERATED, Options())
    # a library runs in this process, which a function that crashes or does not return would take along
    if in_lanes := not model.functions and fits_lanes(model, scene, METHOD, integrator.name):
        scene = with_closure(scene, scene.numerics.closure or PLAIN_CLOSURE)
        if must_interpret():
            in_lanes = False
            scene = replace(scene, numerics=replace(scene.numerics, integrator=integrator.name, events=Events.CROSSED))
    options = CompileOptions(method=METHOD, flags=flags)
    if known is not None:
        binary = Binary(path=place_in_cache(*known["place"]), fresh=False, compiler=known["compiler"], flags=tuple(flags))
        if not is_sound(binary.path):
            raise ValueError(f"the cache has no {binary.path}")
        single = cache(lambda: compile_scene(model, scene, options))
        return BatchArtifact(model=model, scene=scene, binary=binary, facts=known, single=single, is_cached=True)
    if not in_lanes:
        done = compile_scene(model, scene, options)
        return BatchArtifact(
            model=done.model, scene=scene, binary=done.binary, facts=_facts(done.mechanism), single=lambda: done,
            generate_seconds=done.generate_seconds, compile_seconds=done.compile_seconds,
        )  # fmt: skip
    begin = perf_counter()
    require_code(model)
    generated = generate(model, scene, scene.outputs, method=METHOD)
    standalone = with_batch(make_standalone(generated, integrator=integrator.name, side_by_side=True))
    source, written, equations = standalone.library, perf_counter(), standalone.parts.mechanism
    return BatchArtifact(
        model=equations.topology.model, scene=scene, binary=build(source, flags=flags), facts=_facts(equations, names_of_runs(standalone)),
        single=cache(lambda: compile_scene(model, scene, options, generated=generated)), generate_seconds=written - begin,
        compile_seconds=perf_counter() - written,
    )  # fmt: skip


def _facts(equations: RecursiveEquations, names: Mapping[str, Sequence[str]] | None = None) -> dict[str, Any]:
    units = {c.name: c.unit for c in equations.columns}
    return {"units": units, "unknowns": equations.unknowns, "start": asdict(start_of(equations)), "names": names}


def facts_of(artifact: BatchArtifact) -> dict[str, Any]:
    """A compiled batch as plain data, but for its model and scene."""
    return {**artifact.facts, "place": [artifact.binary.path.parent.name, artifact.binary.path.name], "compiler": artifact.binary.compiler}


def _require_batch(scene: Scene) -> None:
    numerics = scene.numerics
    integrator = INTEGRATORS[numerics.integrator or DEFAULT_INTEGRATOR]
    faults = (
        ("integrator", METHOD in integrator.methods and not integrator.batch, names_of(INTEGRATORS, lambda i: i.batch)),
        ("events", numerics.events == Events.LOCATED, (Events.CROSSED,)),
    )
    for name, is_wrong, able in faults:
        if is_wrong:
            only = join_or(able)
            raise RunError(f"{scene.span}: scene '{scene.name}': batches have {name}: {only} only; use --{name} {only}")


def simulate_batch(
    model: BatchArtifact | ModelLike, cases: Sequence[Mapping[str, float]], *, scene: str | None = None, tunable: Sequence[str] = (),
    dt: float | None = None, end: float | None = None, solver_tolerance: float | None = None, threads: int | None = None,
    out: AnyPath | None = None, progress: Progress | None = None, check: bool = True, tolerance: float | None = None,
) -> Batch:  # fmt: skip
    """Run a scene once for each of ``cases``: values (SI units) of parameters or constant inputs, by name.

    Results do not depend on the number of threads; a run that fails does not stop the others.

    Args:
        dt: step of all runs, eight of which share a SIMD register; default: adaptive steps, one run after the other.
        tunable: patterns; constants whose names match become parameters, such as initial values ``SCENE.rates.NAME``.
        out: table of the results, written as runs end.
        threads: default: all processors.
        check: raise an error if a run fails, once all have ended.

    Raises:
        RunError: a parameter that cannot be set, settings that no run has, or cases that do not set the same parameters.
        SimulatorError: the simulator could not begin.
        OutputError: the table cannot be written.
        Interrupted, Terminated: a signal has ended the batch.
        FailedBatchError: some runs failed; it has the batch.
    """
    require_settings(threads=threads)
    if tolerance is not None:
        warn("simulate_batch(tolerance=...) is now simulate_batch(solver_tolerance=...)", FutureWarning, stacklevel=2)
    if isinstance(model, BatchArtifact) and scene is None and not tunable:
        artifact = model
    else:
        artifact = compile_batch(model, scene=scene, tunable=tunable)
    if any(case.keys() != cases[0].keys() for case in cases):
        raise RunError("the runs of a batch set the same parameters, each its own values; repeat the value where it does not differ")
    begin, requested = perf_counter(), Options(dt=dt, end=end, tolerance=tolerance if solver_tolerance is None else solver_tolerance)
    threads = processors() if threads is None else threads
    settings, runs, side_by_side = _plan(artifact, cases, requested, threads)
    units, seconds = Columns(artifact.facts["units"]), 0.0
    results: list[Mapping[str, Any]] = []
    with ExitStack() as stack:
        table = None if out is None else stack.enter_context(CaseTable(Path(out), cases, units))
        for first, records, taken in stack.enter_context(closing(runs)):
            results += records
            seconds += taken
            if table is not None:
                table.take(first, records)
            if progress is not None:
                progress(len(results) / len(cases))
        if table is not None:
            table.finish()
    elapsed = perf_counter() - begin
    tables = {kind: _columns(results, kind, list(units)) for kind in KINDS}
    batch = Batch(
        cases=tuple(dict(case) for case in cases), **tables, units=units, evaluations=tuple(r.get("evaluations", 0) for r in results),
        failures=tuple(failure_of(r) for r in results), undetermined=tuple(results[0].get("undetermined", ())) if results else (),
        seconds=seconds, elapsed=elapsed, settings=settings, side_by_side=side_by_side,
    )  # fmt: skip
    if check and (failed := count_failures(batch)):
        raise FailedBatchError("\n".join([*describe_failures(batch), f"{failed}; the error's batch has all of them"]), batch)
    return batch


def _plan(
    artifact: BatchArtifact, cases: Sequence[Mapping[str, float]], requested: Options, threads: int
) -> tuple[StepSettings, _Results, bool]:  # fmt: skip
    """Step settings of a batch, its results in order, and whether runs go side by side: a library has the roads of the scene alone."""
    model, scene, library = artifact.model, artifact.scene, artifact.library
    if library is None:
        return *_plan_one_by_one(artifact, cases, _as_simulated(scene, requested), threads), False
    options = replace(requested, integrator=DEFAULT_INTEGRATOR, events=Events.CROSSED)
    file = make_run_file(model, scene, {}, task="simulate", method=METHOD, options=options)
    entries, own = file.entries(), _own_parts(model, scene, cases)
    if any(parts.get("roads", file.roads) != file.roads for parts in own):
        return *_plan_one_by_one(artifact, cases, options, threads), False
    steps, stop = count_steps(file.settings.dt, file.end, file.output_step), ctypes.c_int()

    def run(first: int) -> tuple[list[dict[str, Any]], float]:
        parts = [{**entries, **each} for each in own[first : first + MOST_LANES]]  # few, since an interruption loses them
        return library.run(parts, (steps.number, steps.stride), file.settings, stop, is_first=first == 0)

    def results() -> _Results:
        firsts = range(0, len(cases), MOST_LANES)
        for first, (records, seconds) in zip(firsts, _in_order(run, firsts, threads, stop), strict=True):
            failed = [i for i, record in enumerate(records) if "status" not in record]  # made again alone, which names laws without a value
            plans = [replace(_make_run(artifact, options, cases[first + i]), continuation=None) for i in failed]
            for i, alone in zip(failed, _in_order(start, plans, threads) if plans else (), strict=True):
                records[i] |= _record(alone)
            yield first, records, seconds

    return StepSettings.of(file.settings), results(), True


def _plan_one_by_one(
    artifact: BatchArtifact, cases: Sequence[Mapping[str, float]], options: Options, threads: int
) -> tuple[StepSettings, _Results]:  # fmt: skip
    """Step settings of a batch with one simulator process for each run, and its results in order."""
    plans = [_make_run(artifact, options, case) for case in cases]
    results = ((number, [_record(run)], run.seconds) for number, run in enumerate(_in_order(start, plans, threads)))
    return StepSettings.of(_make_run(artifact, options, {}).run_file.settings), results


def _make_run(artifact: BatchArtifact, options: Options, case: Mapping[str, float]) -> SimulatorRun:
    """The run of a case alone; none that is found in the cache can go on by other code."""
    if artifact.library is not None or not artifact.is_cached:
        return make_simulator_run(artifact.single(), options, case)
    scene = with_closure(artifact.scene, find_closure(artifact.scene.numerics, METHODS[METHOD]).name)
    file = make_run_file(artifact.model, scene, case, task="simulate", method=METHOD, options=options)
    return SimulatorRun(simulator=artifact.binary.path, run_file=file, description=None, units=artifact.facts["units"])


def _in_order(
    call: Callable[[_Item], _Result], items: Sequence[_Item], threads: int, stop: ctypes.c_int | None = None
) -> Iterator[_Result]:  # fmt: skip
    """The results of calls, some at a time. Raises Interrupted, Terminated: a signal has come; those that were begun have ended, early if
    they heed ``stop``, which is then set."""
    with stop_requests() as request, ThreadPoolExecutor(threads) as pool:
        runs = [pool.submit(call, item) for item in items]
        try:
            for run in runs:
                while request.number is None and not wait([run], timeout=0.5).done:
                    pass
                if request.number is not None:
                    raise request.error("interrupted")
                yield run.result()
        finally:
            if stop is not None:
                stop.value = 1
            pool.shutdown(cancel_futures=True)


def _as_simulated(scene: Scene, requested: Options) -> Options:
    """Options with the tolerance for steps without refinement."""
    if requested.dt is not None or requested.tolerance is not None:
        return requested
    integrator = find_integrator(scene.numerics, METHODS[METHOD], Implementation.GENERATED, requested)
    return replace(requested, tolerance=find_tolerance(scene, METHOD, integrator.name))


def _record(run: Trajectory) -> dict[str, Any]:
    """The results of a run as a simulator of batches writes them."""
    failure = {"status": "done"} if run.failure is None else {"status": "failed", **asdict(run.failure)}
    columns = [run[name] for name in run.columns] if run.t.size else []
    values = {"end": [c[-1] for c in columns], "minimum": [c.min() for c in columns], "maximum": [c.max() for c in columns]}
    return {**failure, **(values if columns else {}), "evaluations": run.evaluations, "undetermined": run.undetermined}


def _own_parts(model: Model, scene: Scene, cases: Sequence[Mapping[str, float]]) -> list[dict[str, Any]]:
    """The entries of a run file that parameters change, for each case."""
    parts = changing_parts(model, scene)
    own = []
    for case in cases:
        begun, start, inputs = trimmed(model, scene, case, constant_inputs(model, case))
        values, held = parameter_values(begun, case), input_entries(begun, start, inputs)
        own.append({"parameters": values, **({"inputs": held} if held else {}), **find_dependent_parts(begun, start, values, parts)})
    return own


def _columns(results: Sequence[Mapping[str, Any]], kind: str, names: Sequence[str]) -> Columns[Array]:
    missing = [None] * len(names)
    rows = np.array([r.get(kind, missing) for r in results], dtype=float).reshape(len(results), len(names))
    return Columns({name: rows[:, i] for i, name in enumerate(names)})


def compile_unless_compiled(
    model: ModelLike, scene: str | None = None, tunable: Sequence[str] = (), method: str | None = None, integrator: str | None = None,
    dt: float | None = None,
) -> Artifact:  # fmt: skip
    """A compiled model as it is; any other compiled by `compile_model`.
    The method is the scene's by default; the closure is that of the requested integrator, or of equal steps ``dt`` (s)."""
    if isinstance(model, Artifact) and scene is None and not tunable and method in (None, model.method):
        return model
    read, chosen = load_model(model, scene, tunable)
    wanted = method or method_of(chosen)
    return compile_scene(read, with_default_closure(chosen, wanted, integrator, dt), CompileOptions(method=wanted))


def simulate(
    model: ModelLike, *, scene: str | None = None, tunable: Sequence[str] = (), method: str | None = None, out: AnyPath | None = None,
    steps: AnyPath | None = None, parameters: Mapping[str, float] | None = None,
    progress: Progress | None = None, dt: float | None = None, end: float | None = None, penalty: float | None = None,
    accuracy: float | Mapping[str, float] | None = None, solver_tolerance: float | None = None, iterations: int | None = None,
    solver: str | None = None, integrator: str | None = None, events: str | None = None, error: bool = True, check: bool = True,
    inputs: Mapping[str, InputLike] | None = None, coordinates: bool = False, tolerance: float | None = None,
) -> Trajectory:  # fmt: skip
    """Run a scene of a model, and compile it if needed.

    Args:
        parameters: values (SI units) by name.
        inputs: drive the run in place of the scene's laws: numbers, or tables over time.
        tunable: patterns; constants whose names match become parameters.
        method, integrator, dt, end, penalty, accuracy, solver_tolerance, iterations, solver, events: as on the command line;
            default: the scene's; ``accuracy`` can map outputs to their target errors.
        out: table (CSV); ``steps``: iterations and residuals of each step.
        error: estimate the error by further runs.
        progress: is called as the run proceeds; ``tolerance``: earlier name of ``solver_tolerance``.
        coordinates: keep the coordinates of each sample, for `write_view`.
        check: raise an error if the run fails.

    Raises:
        ModelError, EquationsError, ToolchainError: as of `compile_model`.
        RunError: a parameter or an input that cannot be set, or settings that no run has or that do not go together.
        SimulatorError, OutputError: the simulator could not begin, or a file cannot be written.
        FailedRunError, Interrupted, Terminated: the run failed (the error has its trajectory), or a signal has ended it.
    """
    if tolerance is not None:
        warn("simulate(tolerance=...) is now simulate(solver_tolerance=...)", FutureWarning, stacklevel=2)
    requested = tolerance if solver_tolerance is None else solver_tolerance
    return simulation.simulate(
        compile_unless_compiled(model, scene, tunable, method, integrator, dt), out=out, steps=steps,
        parameters=parameters, progress=progress, dt=dt, end=end, penalty=penalty, accuracy=accuracy, tolerance=requested,
        iterations=iterations, solver=solver, integrator=integrator, events=events, error=error, check=check, inputs=inputs,
        coordinates=coordinates,
    )  # fmt: skip
