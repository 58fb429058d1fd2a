"""Batches: many runs of one scene that differ by parameters, several of them side by side in a register."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from cutjoint.emit.source import emit
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.formulate.recursive.lanes import schedule_recursive
from cutjoint.locations import AnyPath
from cutjoint.methods import DEFAULT_INTEGRATOR, INTEGRATORS, METHODS, PLAIN_CLOSURE, Events, either, names_of
from cutjoint.model.records import Model, Scene
from cutjoint.pipeline import derive
from cutjoint.run.artifact import start_of
from cutjoint.run.cases import CaseTable
from cutjoint.run.errors import RunError
from cutjoint.run.failures import FailedBatchError, count_failures, describe_failures
from cutjoint.run.inputs import input_entries
from cutjoint.run.options import Options
from cutjoint.run.results import Array, Batch, Columns
from cutjoint.run.run_file import changing, following, given_inputs, make_run_file, parameter_values
from cutjoint.run.scenes import find_scene, with_closure
from cutjoint.run.settings import require_settings
from cutjoint.run.simulator import Progress, call_simulator, failure_of
from cutjoint.run.simulator_run import Start
from cutjoint.toolchain.build import FLAGS, Binary, build
from cutjoint.topology.reading import read_model

#: The method whose runs are evaluated side by side.
METHOD, = names_of(METHODS, lambda m: m.batch)


@dataclass(frozen=True, kw_only=True)
class BatchArtifact:
    """A model compiled for batches of one scene."""

    model: Model
    scene: Scene
    equations: RecursiveEquations
    binary: Binary
    generate_seconds: float
    compile_seconds: float

    @property
    def start(self) -> Start:
        """What the speeds at the start of its runs follow from."""
        return start_of(self.equations)

    def __repr__(self) -> str:
        return f"<BatchArtifact of '{self.model.name}', scene '{self.scene.name}': {self.equations.unknowns} unknowns, {self.binary.path}>"


def compile_batch(path: AnyPath, *, scene: str | None = None, opened: Sequence[str] = (), flags: Sequence[str] = FLAGS) -> BatchArtifact:
    """Compile a model file for batches of one scene, the only one if none is named; errors as in `compile_scene_batch`."""
    model = read_model(path, opened=opened)
    return compile_scene_batch(model, find_scene(model, scene), flags=flags)


def compile_scene_batch(model: Model, scene: Scene, *, flags: Sequence[str] = FLAGS) -> BatchArtifact:
    """Compile a model for batches of a scene, with the recursive method; cut joints are held by penalties where the scene names no closure.

    Raises:
        ModelError, TopologyError, NoInertiaError, GuideError: the model is wrong.
        RunError: the scene has an integrator or events that batches do not have.
        ToolchainError: the C++ side failed.
    """
    _require_batch(scene)
    closure = scene.numerics.closure or PLAIN_CLOSURE
    scene = with_closure(scene, closure)
    begin = perf_counter()
    derived = derive(model, scene, scene.outputs, closure=closure)
    equations = derived.starting if closure == PLAIN_CLOSURE else derived.crossing
    source = emit(schedule_recursive(equations, lanes=False), equations, batch=True)
    generated = perf_counter()
    binary = build(source, flags=flags)
    return BatchArtifact(
        model=model, scene=scene, equations=equations, binary=binary, generate_seconds=generated - begin,
        compile_seconds=perf_counter() - generated,
    )  # fmt: skip


def _require_batch(scene: Scene) -> None:
    """Check that a scene says nothing that batches do not have."""
    numerics = scene.numerics
    integrator = INTEGRATORS[numerics.integrator or DEFAULT_INTEGRATOR]
    faults = (
        ("integrator", METHOD in integrator.methods and not integrator.batch, names_of(INTEGRATORS, lambda i: i.batch)),
        ("events", numerics.events == Events.LOCATED, (Events.CROSSED,)),
    )
    for name, is_wrong, able in faults:
        if is_wrong:
            only = either(able)
            raise RunError(f"{scene.span}: scene '{scene.name}': batches have {name}: {only} only; use --{name} {only}")


def simulate_batch(
    artifact: BatchArtifact, cases: Sequence[Mapping[str, float]], *, dt: float | None = None, end: float | None = None,
    tolerance: float | None = None, threads: int | None = None, out: AnyPath | None = None, progress: Progress | None = None,
    check: bool = True,
) -> Batch:  # fmt: skip
    """Run a scene once for each of ``cases``, values (SI units) of parameters, or of inputs held constant, by name;
    ``threads`` are as many as processors by default.

    ``out`` receives a table of the results (`CaseTable`), each row when its run is done.  Results do not depend on the number of threads.
    A run that fails does not stop the others; with ``check`` it is an error once all have ended.

    Raises:
        RunError: a parameter that cannot be set, settings that no run has, or cases that do not set the same parameters.
        SimulatorError: the simulator could not begin.
        OutputError: the table cannot be written.
        Interrupted, Terminated: a signal has ended the batch.
        FailedBatchError: some runs failed; it has the batch.
    """
    require_settings(threads=threads)
    if any(case.keys() != cases[0].keys() for case in cases):
        raise RunError("the runs of a batch set the same parameters, each its own values; repeat the value where it does not differ")
    options = Options(dt=dt, end=end, tolerance=tolerance, integrator=DEFAULT_INTEGRATOR, events=Events.CROSSED)
    begin = perf_counter()
    file = make_run_file(artifact.model, artifact.scene, {}, task="batch", method=METHOD, options=options)
    file["cases"] = _own_parts(artifact.model, artifact.scene, cases)
    file["threads"] = len(os.sched_getaffinity(0)) if threads is None else threads
    units = Columns({c.name: c.unit for c in artifact.equations.columns})
    results: list[dict[str, Any]] = [{}] * len(cases)
    with ExitStack() as stack:
        table = None if out is None else stack.enter_context(CaseTable(Path(out), cases, units))

        def receive(record: Mapping[str, Any]) -> None:
            first, new = record["first"], record["results"]
            results[first : first + len(new)] = new
            if table is not None:
                table.take(first, new)

        summary = call_simulator(artifact.binary.path, file, progress, receive)
        if table is not None:
            table.finish()
    elapsed = perf_counter() - begin
    tables = {kind: _columns(results, kind, list(units)) for kind in ("end", "smallest", "largest")}
    batch = Batch(
        cases=tuple(dict(case) for case in cases), **tables, units=units,
        evaluations=tuple(r.get("evaluations", 0) for r in results),
        failures=tuple(failure_of(r) for r in results), undetermined=tuple(results[0].get("undetermined", ())) if results else (),
        seconds=summary["seconds"], elapsed=elapsed,
    )  # fmt: skip
    if check and (failed := count_failures(batch)):
        raise FailedBatchError("\n".join([*describe_failures(batch), f"{failed}; the error's batch has all of them"]), batch)
    return batch


def _own_parts(model: Model, scene: Scene, cases: Sequence[Mapping[str, float]]) -> list[dict[str, Any]]:
    """The entries of a run file that parameters change, for each case."""
    parts = changing(model, scene)
    values = [parameter_values(model, case) for case in cases]
    inputs = [input_entries(model, scene, given_inputs(model, case)) for case in cases]
    return [
        {"parameters": given, **({"inputs": held} if held else {}), **following(model, scene, given, parts)}
        for given, held in zip(values, inputs, strict=True)
    ]  # fmt: skip


def _columns(results: Sequence[Mapping[str, Any]], kind: str, names: Sequence[str]) -> Columns[Array]:
    missing = [None] * len(names)
    rows = np.array([r.get(kind, missing) for r in results], dtype=float).reshape(len(results), len(names))
    return Columns({name: rows[:, i] for i, name in enumerate(names)})
