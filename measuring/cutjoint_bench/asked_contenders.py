"""Runs to which an accuracy is given as contenders: `cutjoint simulate --accuracy` by each method and integrator, and `--method auto`.

They have the outputs and the rows of the scene, as the command line has, by which accuracies are judged.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from time import perf_counter
from typing import Any

from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene, generate
from cutjoint.methods import AUTO, DEFAULT_INTEGRATOR, INTEGRATORS, METHODS, Loops
from cutjoint.model.expressions.units import PLACES
from cutjoint.model.records import Scene
from cutjoint.package.errors import RunError
from cutjoint.package.locations import code_folders
from cutjoint.reduce.choose import Choice, choose, chosen_model
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import ErrorEstimate, Trajectory
from cutjoint.run.scenes import find_scene, with_default_closure, with_loops
from cutjoint.run.simulation import simulate
from cutjoint.toolchain.origins import code_digest
from cutjoint_bench.cutjoint_contenders import ADAPTIVE_IN_LOOPS, identity
from cutjoint_bench.records import Case, Contender

#: The integrators that are given an accuracy, by methods: the adaptive ones, and equal steps of methods that have no other.
_INTEGRATORS = tuple(
    (method, integrator) for method in METHODS
    for integrator in (
        [i.name for i in INTEGRATORS.values() if i.adaptive and method in i.methods]
        or [DEFAULT_INTEGRATOR]
    )
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class AccuracyRunner:
    """A compiled scene whose steps follow from an accuracy; ``about`` has facts of the first run to each."""

    artifact: Artifact
    integrator: str
    parameters: Mapping[str, float]
    about: dict[float, Mapping[str, Any]] = field(default_factory=dict)

    @property
    def configuration(self) -> Mapping[str, str]:
        """Compiler, flags and digest of the generated code."""
        a = self.artifact
        return {"compiler": a.binary.compiler, "flags": " ".join(a.binary.flags), "precision": a.precision, **identity(a.source)}

    def __call__(self, dt: float, *, measured: bool = False) -> Trajectory:
        """The run to an accuracy of ``dt`` m or rad."""
        began = perf_counter()
        run = simulate(self.artifact, integrator=self.integrator, accuracy=dt, parameters=self.parameters, check=False)
        estimate = run.error
        if measured:
            self.about[dt] = {**_estimated(run, estimate), "waited": perf_counter() - began}
        return run


def _estimated(run: Trajectory, estimate: ErrorEstimate) -> dict[str, Any]:
    """The largest estimate of a place or an angle (m, rad), and the words of a run that does not promise its accuracy."""
    errors = {name: PLACES[run.units[name]] * error for name, error in estimate.max_error.items() if run.units[name] in PLACES}
    facts = {"estimated": max(errors.values(), default=None), "kept": estimate.converged, "fallback": run.fallback}
    return {**facts, "warnings": list(estimate.warnings)}


@dataclass(frozen=True, kw_only=True)
class AutoRunner:
    """A scene that `--method auto` runs; ``about`` has facts of its choice for each accuracy."""

    case: Case
    configuration: Mapping[str, str]
    about: dict[float, Mapping[str, Any]] = field(default_factory=dict)
    chosen: dict[float, Artifact] = field(default_factory=dict)

    def __call__(self, dt: float, *, measured: bool = False) -> Trajectory:
        """The run of what is chosen for an accuracy of ``dt`` m or rad.

        Raises:
            RunError: nothing keeps the accuracy.
        """
        if dt not in self.chosen:
            wanted, began = replace(own_scene(self.case), method=AUTO, accuracy=dt), perf_counter()
            choice = choose(self.case.model, wanted, parameters=self.case.parameters)
            model, scene = chosen_model(choice)
            self.about[dt] = {"chosen": _words(choice), "choosing": perf_counter() - began}
            self.chosen[dt] = compile_scene(model, scene, CompileOptions(method=choice.chosen.method))
        return simulate(self.chosen[dt], parameters=self.case.parameters, error=False, check=False)


def _words(choice: Choice) -> str:
    chosen = choice.chosen
    model = "the full model" if chosen.variant == "full" else f"the reduced model '{chosen.variant}'"
    return f"{chosen.method}, {chosen.steps.integrator} at {chosen.steps}, {chosen.loops} loops, {model}"


def own_scene(case: Case) -> Scene:
    """The scene with rows as far apart as in the model file."""
    return replace(case.scene, output_step=find_scene(case.model, case.scene.name if case.model.scenes else None).output_step)


def asked_contenders() -> Iterator[Contender]:
    """Each method with its adaptive integrators, or equal steps, and with embedded loops where it takes them; then the method auto."""
    for method, integrator in _INTEGRATORS:
        yield _contender(f"{method}/{integrator}/accuracy", f"{method}, {integrator}, by accuracy", method=method, integrator=integrator)
    for method, integrator in ADAPTIVE_IN_LOOPS:
        yield _contender(
            f"{method}/{integrator}/functions/accuracy", f"{method}, {integrator}, embedded loops, by accuracy",
            method=method, integrator=integrator, loops=Loops.EMBEDDED,
        )  # fmt: skip
    yield Contender(
        name=AUTO, label="method auto", group="auto", prepare=_prepare_auto, identify=_identify_auto,
        options=_options_of_auto,
    )  # fmt: skip


def _contender(name: str, label: str, **how: Any) -> Contender:
    return Contender(
        name=name, label=label, group="accuracy", prepare=partial(_prepare, **how), identify=partial(_identify, **how),
        options=partial(_options, **how),
    )  # fmt: skip


def _scene(case: Case, method: str, integrator: str, loops: str | None) -> Scene:
    return with_default_closure(with_loops(own_scene(case), loops), method, integrator)


def _prepare(case: Case, *, method: str, integrator: str, loops: str | None = None) -> AccuracyRunner:
    """The runner of a case.

    Raises:
        RunError: functions are asked for, and no loop can be closed by them.
    """
    artifact = compile_scene(case.model, _scene(case, method, integrator, loops), CompileOptions(method=method))
    if loops == Loops.EMBEDDED and not artifact.topology.model.embedded_loops:
        raise RunError("no loops can be closed by functions")
    return AccuracyRunner(artifact=artifact, integrator=integrator, parameters=case.parameters)


def _identify(case: Case, *, method: str, integrator: str, loops: str | None = None) -> Mapping[str, str]:
    scene = _scene(case, method, integrator, loops)
    return identity(generate(case.model, scene, scene.outputs, method=method)[-1])


def _options(_: Case, dt: float, *, method: str, integrator: str, loops: str | None = None) -> list[str]:
    return ["--method", method, "--integrator", integrator, *(["--loops", str(loops)] if loops else []), "--accuracy", f"{dt:g}"]


def _options_of_auto(case: Case, dt: float) -> list[str]:
    """None for a case with another end than its scene's, which the command line does not take with the method auto."""
    return [] if "--end" in shlex.split(case.command) else ["--method", AUTO, "--accuracy", f"{dt:g}", "--no-error"]


def _prepare_auto(case: Case) -> AutoRunner:
    return AutoRunner(case=case, configuration=_identify_auto(case))


def _identify_auto(case: Case) -> Mapping[str, str]:
    """The full model's code, and the program that chooses: the choice itself is measured."""
    scene = own_scene(case)
    return {**identity(generate(case.model, scene, scene.outputs)[-1]), "program": code_digest(code_folders())}
