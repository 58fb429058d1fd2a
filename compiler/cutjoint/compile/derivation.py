"""From a model to generated source: Model -> Topology -> Equations -> Program -> Source."""

from collections.abc import Callable, Sequence
from functools import cache
from warnings import warn

from cutjoint.analysis.inertia import require_inertia
from cutjoint.analysis.mobility import require_guides
from cutjoint.analysis.redundancy import require_loads
from cutjoint.analysis.shaky import ShakyError, mend_misfit, require_firmness
from cutjoint.emit.simulator import emit
from cutjoint.emit.source import Source
from cutjoint.formulate.events import describe_guide_jumps
from cutjoint.formulate.lanes import schedule_recursive
from cutjoint.formulate.records import Equations, RecursiveEquations, SystemEquations
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.methods import DEFAULT_METHOD, DEFAULT_PRECISION, METHODS, PLAIN_CLOSURE, PRECISIONS, Loops
from cutjoint.model.records import Model, Output, Scene
from cutjoint.program.records import Program
from cutjoint.run.artifact import Artifact
from cutjoint.run.scenes import with_loops
from cutjoint.run.settings import accuracy_of, find_closure
from cutjoint.topology.build import build_topology


def schedule_method(
    model: Model, scene: Scene, outputs: Sequence[Output], *, method: str = DEFAULT_METHOD, lanes: bool = True,
    poses: bool = False, load_events: bool = False, aims: Sequence[Output] = (),
) -> tuple[Equations, Program]:  # fmt: skip
    """Derive the equations and the program of a scene, without its source."""
    # Model -> Topology -> Equations -> Program
    if METHODS[method].has_system:
        from cutjoint.compile.systems import schedule_system  # imported here because the recursive method does not need it

        tunable = scene if METHODS[method].functions else with_loops(scene, Loops.EXACT)
        start = require_firmness(derive(model, tunable, (), poses=poses, aims=aims), method)
        return schedule_system(start.starting, method, tuple(outputs), lanes=lanes)
    closure = find_closure(scene.numerics, METHODS[method]).name
    recursive = require_firmness(derive(model, scene, outputs, closure=closure, poses=poses, load_events=load_events, aims=aims), method)
    return recursive, schedule_recursive(recursive, lanes=lanes)


def emit_scheduled(equations: Equations, program: Program, *, lanes: bool = True, precision: str = DEFAULT_PRECISION) -> Source:
    """Return the source for the results of `schedule_method`."""
    # Program -> Source
    if isinstance(equations, RecursiveEquations):
        return emit(program, equations)
    from cutjoint.compile import systems

    assert isinstance(equations, SystemEquations)
    return systems.emit_scheduled(equations, program, lanes=lanes, packed=PRECISIONS[precision].packed)


def derive(
    model: Model, scene: Scene, outputs: Sequence[Output], *, closure: str = PLAIN_CLOSURE, poses: bool = False,
    load_events: bool = False, aims: Sequence[Output] = (),
) -> RecursiveEquations:  # fmt: skip
    """Derive the recursive equations of a model, from which the runs of every method start; errors as in `compile_scene`.
    If a misfit within the scene's accuracy would lock loops, it is removed with a warning; one that leaves no motion is reported."""
    topology = require_loads(build_topology(with_requested_loops(model, scene, DEFAULT_METHOD)), scene)
    for words in describe_guide_jumps(topology.model, scene, accuracy_of(scene)):
        warn(words, stacklevel=2)
    equations = formulate_recursive(
        topology, scene, tuple(outputs), closure=closure, poses=poses, load_events=load_events, aims=tuple(aims)
    )  # fmt: skip
    require_inertia(equations)
    require_guides(equations)
    words, exact = mend_misfit(equations, accuracy_of(scene))
    if not words:
        return equations
    if exact is None:
        raise ShakyError(words)
    warn(words, stacklevel=2)
    if exact is topology.model:
        return equations
    return derive(exact, scene, outputs, closure=closure, poses=poses, load_events=load_events, aims=aims)


def with_requested_loops(model: Model, scene: Scene, method: str) -> Model:
    """Return the model with embedded loops where the scene and the method allow it, else unchanged, with cut joints."""
    if scene.numerics.loops == Loops.EXACT or not METHODS[method].functions or model.embedded_loops:
        return model
    from cutjoint.analysis.embedding.embed import embed_loops  # imported here because other runs do not need it

    return embed_loops(model, scene).model


def fallback(equations: Equations, compiled: Callable[[Model, Scene], Artifact]) -> Callable[[], Artifact] | None:
    """A function that compiles the model without loop embedding, once, for runs that leave its range; None if the scene stops there."""
    topology, scene = equations.mechanism.topology, equations.mechanism.scene
    if not topology.model.embedded_loops or scene.on_violation == "stop":
        return None
    from cutjoint.analysis.embedding.embed import without_functions  # imported here because other runs do not need it

    return cache(lambda: compiled(without_functions(topology), with_loops(scene, Loops.EXACT)))
