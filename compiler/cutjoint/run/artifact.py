"""A compiled model, and how it becomes a run."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from cutjoint.analysis.redundancy import find_indeterminate
from cutjoint.emit.source import Source
from cutjoint.formulate.events import jump_times
from cutjoint.formulate.inputs import TIME, input_parameters
from cutjoint.formulate.records import Equations, RecursiveEquations
from cutjoint.methods import DEFAULT_METHOD, DEFAULT_PRECISION, INTEGRATORS, METHODS, PRECISIONS, SOLVERS, Implementation
from cutjoint.model.errors import nearest
from cutjoint.model.expressions.units import fault_of_dimension, measure
from cutjoint.model.ranges import fault_of
from cutjoint.model.records import Joint, Model, Scene
from cutjoint.model.targets import OBJECTIVES, split_target
from cutjoint.package.errors import CutjointError, RunError
from cutjoint.program.records import Program
from cutjoint.run.failures import places_of
from cutjoint.run.inputs import InputLike
from cutjoint.run.record import Settings
from cutjoint.run.run_file import constant_inputs, make_run_file
from cutjoint.run.scenes import with_closure
from cutjoint.run.settings import Options, find_closure, find_goal, find_settings, with_options
from cutjoint.run.simulator_run import Compilation, Continuation, SimulatorRun, Start
from cutjoint.toolchain.build import Binary
from cutjoint.topology.records import Topology


@dataclass(frozen=True, kw_only=True)
class Artifact:
    """A compiled model: the record of every stage, and the seconds of generating and compiling.

    ``method`` and ``precision`` are as in `CompileOptions`, ``additions`` are solvers and integrators of other packages.
    ``description`` is what the simulator reads of the model, None of generated code.  ``exact`` compiles a fallback
    model with exact loops, None if it is not used.
    """

    scene: Scene
    equations: Equations
    program: Program
    source: Source
    binary: Binary
    method: str
    implementation: Implementation
    precision: str
    generate_seconds: float
    compile_seconds: float
    description: Mapping[str, Any] | None = None
    additions: tuple[str, ...] = ()
    exact: "Callable[[], Artifact] | None" = field(default=None, repr=False, compare=False)
    by_method: "Callable[[str], Artifact | None] | None" = field(default=None, repr=False, compare=False)

    def __repr__(self) -> str:
        how = f"{self.implementation}, {self.precision}, {self.program.operations(self.iteration)} operations an evaluation"
        sizes = f"{self.equations.unknowns} unknowns, {len(self.equations.equation_names)} equations of loops"
        what = f"'{self.topology.model.name}', scene '{self.scene.name}', method {self.method}"
        return f"<Artifact of {what}: {how}, {sizes}, {self.binary.path}>"

    @property
    def compilation(self) -> Compilation:
        """Facts about the compilation, for people."""
        return Compilation(
            scene=self.scene.name, method=self.method, implementation=self.implementation.value,
            operations=self.program.operations(self.iteration), instructions=self.program.instructions(self.iteration),
            compiler=self.binary.compiler, flags=tuple(self.binary.flags), generate_seconds=self.generate_seconds,
            compile_seconds=self.compile_seconds if self.binary.fresh else 0.0, start=start_of(self.mechanism),
        )  # fmt: skip

    @property
    def model(self) -> Model:
        """The model of the topology."""
        return self.topology.model

    @property
    def topology(self) -> Topology:
        """The spanning tree with its cut joints."""
        return self.equations.topology

    @cached_property
    def indeterminate(self) -> tuple[str, ...]:
        """The columns of reactions that redundant loop equations leave undetermined."""
        return find_indeterminate(self.topology, self.scene, self.equations.outputs)

    def with_rows(self, output_step: float) -> "Artifact":
        """Copy the artifact with another ``output_step``, s; `indeterminate` stays."""
        artifact = replace(self, scene=replace(self.scene, output_step=output_step))
        artifact.__dict__["indeterminate"] = self.indeterminate
        return artifact

    @property
    def file(self) -> Path:
        """The model file."""
        return Path(self.topology.model.span.file)

    @property
    def places(self) -> dict[str, str]:
        """The places of the model's elements and of the scene's entries, see `places_of`."""
        return places_of(self.topology, self.scene)

    @property
    def iteration(self) -> str:
        """The generated function that each iteration of a step calls."""
        return METHODS[self.method].iteration

    @property
    def scene_as_compiled(self) -> Scene:
        """The scene with the closure of the code: its own, else that of its integrator."""
        method = METHODS[self.method]
        if self.scene.numerics.closure is not None or not method.closures:
            return self.scene
        return with_closure(self.scene, find_closure(self.mechanism.scene.numerics, method, self.implementation).name)

    @property
    def mechanism(self) -> RecursiveEquations:
        """The recursive equations: the method's own, or those that start its runs."""
        return self.equations.mechanism

    def settings(self, options: Options) -> Settings:
        """The settings of a run for which a caller gives options. Raises RunError: options exclude each other, or no run has them."""
        scene = with_options(self.scene_as_compiled, self.method, options)
        return find_settings(scene, METHODS[self.method], self.implementation, options)


def start_of(equations: RecursiveEquations) -> Start:
    """How the initial velocities of a scene are determined."""
    model = equations.topology.model
    guided = any(_has_moving_guide(model, joint) for joint in model.joints)
    return Start(at_rest=not (equations.scene.rates or guided), closes_loops=bool(equations.equation_names))


def _has_moving_guide(model: Model, joint: Joint) -> bool:
    moving = {TIME, *(parameter.symbol for parameter in input_parameters(model))}
    return any(not moving.isdisjoint(law.free_symbols) for law in joint.guide or ())


def make_simulator_run(
    artifact: Artifact, options: Options, parameters: Mapping[str, float] | None = None, *,
    inputs: Mapping[str, InputLike] | None = None, coordinates: bool = False,
) -> SimulatorRun:  # fmt: skip
    """The run of a compiled model; ``coordinates`` adds the tree's coordinates at each sample.
    Raises RunError: a parameter or an input that cannot be set, or options that exclude each other or that no run has."""
    run_file = make_run_file(
        artifact.topology.model, artifact.scene_as_compiled, parameters or {}, task="simulate", method=artifact.method,
        implementation=artifact.implementation, options=options, inputs=inputs or {},
    )  # fmt: skip
    _require_additions(artifact, run_file.settings)
    goal = find_goal(artifact.scene, artifact.method, run_file.settings.integrator, options)
    targets = {} if goal is None or options.accuracy is not None else dict(_targets(artifact, options))
    in_loops = (artifact.topology.joint_of[body].joint for loop in artifact.topology.loops for body in loop.bodies)
    leading = dict.fromkeys(joint.name for joint in in_loops if _has_moving_guide(artifact.model, joint))
    return SimulatorRun(
        simulator=artifact.binary.path, run_file=run_file, units={c.name: c.unit for c in artifact.equations.columns},
        description=artifact.description, goal=goal, targets=targets, method=artifact.method,
        is_asked=bool(targets) or {options.accuracy, artifact.scene.accuracy} != {None}, leading=tuple(leading),
        closes_loops=bool(artifact.mechanism.equation_names),
        indeterminate=artifact.indeterminate, switches=bool(artifact.equations.indicators),
        others=tuple(_other_settings(artifact, options, run_file.settings.integrator)),
        is_free=goal is not None and _leaves_choice(artifact, options), with_coordinates=coordinates,
        jumps=jump_times(artifact.topology.model, artifact.scene), balances_energy=not artifact.implementation.is_generic,
        continuation=_continuation(artifact, options, parameters, inputs),
        by_method=None if artifact.by_method is None else partial(_by_method, artifact.by_method, options, parameters, inputs),
    )  # fmt: skip


def _targets(artifact: Artifact, options: Options) -> Iterator[tuple[str, float]]:
    """The largest errors of outputs, or of objectives of outputs, that a caller or else the scene names, in the outputs' units."""
    units = {c.name: c.unit for c in artifact.equations.columns}
    if not options.targets:
        yield from ((name, error) for name, error in artifact.scene.targets.items() if split_target(name)[1] in units)
    for name, error in options.targets.items():
        objective, column = split_target(name)
        fault = fault_of_dimension(error, units[column]) if column in units else f"is no output of the scene; {nearest(column, units)}"
        if objective and objective not in OBJECTIVES:
            fault = f"'{objective}' is no objective; {nearest(objective, OBJECTIVES, 'objectives')}"
        if fault := fault or fault_of(error, above=0.0):
            raise RunError(f"accuracy of {name}: {fault}")
        yield name, error / measure(1.0, units[column] or "1").value


def _by_method(
    find: Callable[[str], Artifact | None], options: Options, parameters: Mapping[str, float] | None,
    inputs: Mapping[str, InputLike] | None, method: str,
) -> SimulatorRun | None:  # fmt: skip
    """The run by another method, with the options that all methods have; None if that is not possible."""
    with suppress(CutjointError):
        if (artifact := find(method)) is not None:
            return make_simulator_run(artifact, replace(options, integrator=None, events=None, solver=None), parameters, inputs=inputs)
    return None


def _continuation(
    artifact: Artifact, options: Options, parameters: Mapping[str, float] | None, inputs: Mapping[str, InputLike] | None
) -> Continuation | None:  # fmt: skip
    """The continuation outside the range of loop embeddings, by code that is compiled when the first run needs it.

    Guides follow the scene's inputs; with other inputs there is no continuation.
    """
    model, exact = artifact.topology.model, artifact.exact
    if exact is None or constant_inputs(model, parameters or {}) or inputs:
        return None
    from cutjoint.analysis.embedding.embed import state_of_loops  # imported here, so that other runs do not wait for it

    return Continuation(
        guards=tuple(embedded_loop.independent for embedded_loop in model.embedded_loops),
        prepare=lambda: make_simulator_run(exact(), options, parameters),
        initial_state=lambda file, kept: state_of_loops(artifact.mechanism, exact().mechanism, kept, file.parameters),
    )  # fmt: skip


def _leaves_choice(artifact: Artifact, options: Options) -> bool:
    scene, settings = artifact.scene, artifact.scene.numerics.of_method(artifact.method)
    named = (scene.method or None, settings.integrator, settings.events, options.integrator, options.events)
    return artifact.method == DEFAULT_METHOD and all(name is None for name in named)


def _other_settings(artifact: Artifact, options: Options, integrator: str) -> Iterator[Settings]:
    for name in (name for name in INTEGRATORS if name != integrator):
        with suppress(RunError):  # it does not support the method, or not these options
            yield artifact.settings(replace(options, integrator=name))


def _require_additions(artifact: Artifact, settings: Settings) -> None:
    """Check that a simulator has the solver and the integrator of a run, which may be of other packages; generic solvers have all."""
    named = {settings.integrator, settings.solver} & {*INTEGRATORS.added.names(), *SOLVERS.added.names()}
    for name in named - set(artifact.additions):
        if not artifact.implementation.is_generic:
            raise RunError(f"this simulator is without {name}: compile the model with additions=[\"{name}\"]")


def require_choice(method: str, precision: str = DEFAULT_PRECISION, additions: Sequence[str] = ()) -> None:
    """Check the choices by which a model is compiled; ``additions`` are solvers and integrators of other packages.
    Raises RunError: there is no such method, precision or addition, or a solver does not have the precision."""
    if method not in METHODS:
        raise RunError(f"no method '{method}'; there is {', '.join(METHODS)}")
    if precision not in PRECISIONS.names():
        raise RunError(f"no precision '{precision}'; there is {', '.join(PRECISIONS.names())}")
    solvers, integrators = SOLVERS.added.names(), INTEGRATORS.added.names()
    for name in additions:
        if name not in (*solvers, *integrators):
            raise RunError(f"no addition '{name}'; there is {', '.join((*solvers, *integrators))}")
        if name in solvers and SOLVERS[name].double_only and precision != DEFAULT_PRECISION:
            raise RunError(f"the solver {name} is in {DEFAULT_PRECISION} alone, not in {precision}")
