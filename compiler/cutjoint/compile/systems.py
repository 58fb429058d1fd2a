"""The pipeline's branch for methods with Newton's iteration: the equations of a system, and the plan of its factorisation.

Equations of the start -> Equations -> Program, Plan -> Source
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cutjoint.analysis import natural
from cutjoint.analysis.closing import explore
from cutjoint.analysis.inertia import describe_momentary, find_momentary_motions
from cutjoint.analysis.natural import NaturalState
from cutjoint.emit.classes import System
from cutjoint.emit.factorisation import STRAIGHT_LINE
from cutjoint.emit.simulator import emit_system
from cutjoint.emit.source import Source
from cutjoint.formulate.implicit.equations import formulate_implicit
from cutjoint.formulate.lanes import find_corresponding, schedule_recursive
from cutjoint.formulate.natural.equations import LagrangianEquations, formulate_lagrangian, without
from cutjoint.formulate.records import CHECKS, RecursiveEquations, SystemEquations
from cutjoint.methods import METHODS, Formulation, join_or, names_of
from cutjoint.model.records import Output
from cutjoint.package.errors import EquationsError, RunError
from cutjoint.program.fold import fold
from cutjoint.program.records import Program
from cutjoint.program.schedule import schedule
from cutjoint.sparse.pattern import Pattern, places, settle_entries
from cutjoint.sparse.pivoting import NoPivotError, SingularError
from cutjoint.sparse.plan import Plan, plan_definite, plan_unsymmetric

#: Functions that are called once a run, or only where a run is checked, so that lanes are not worth while for them.
_ONCE = frozenset({"initial_coordinates", *CHECKS})


def schedule_system(start: RecursiveEquations, method: str, outputs: tuple[Output, ...], *, lanes: bool) -> tuple[SystemEquations, Program]:
    """Derive the equations and the program of a method with Newton's iteration; ``start`` finds the beginning of a run.
    The equations know where the entries of their tangent stand, and the plan of its factorisation. Raises RunError: the equations depend
    on each other in a state where pivots are tried; MissingLibraryError: a library that orders matrices is not installed."""
    # Topology -> Equations
    if start.topology.model.embedded_loops and not METHODS[method].functions:
        words = join_or(names_of(METHODS, lambda m: m.functions))
        raise EquationsError(f"the method {method} does not support embedded loops; use {words}, or the loops' equations")
    equations, states = formulate_system(start, method, outputs)
    # Equations -> Program, Plan
    families = find_corresponding(equations.builder.quantities, equations.topology) if lanes else []
    functions = [(f.name, f.results if f.name in _ONCE else fold(equations.builder, families, f.results)) for f in equations.functions]
    program, pattern = settle_entries(
        schedule(equations.builder, functions, lanes=lanes, last=CHECKS), len(equations.row_names), symmetric=METHODS[method].symmetric
    )  # fmt: skip
    equations = equations.with_tangent(places(pattern))
    if isinstance(equations, LagrangianEquations) and METHODS[method].saddle_point and equations.row_names:
        return replace(equations, plan=_plan_with_pivots(equations, pattern, states)), program
    return replace(equations, plan=plan_definite(pattern)), program


def emit_scheduled(equations: SystemEquations, program: Program, *, lanes: bool, packed: bool) -> Source:
    """The C++ of what was scheduled.  Lanes and straight-line factorisations are for number types of which several fit a register."""
    mechanism, straight_line = schedule_recursive(equations.start, lanes=lanes), STRAIGHT_LINE if packed else 0
    assert equations.plan is not None
    system = System(equations=equations, program=program, plan=equations.plan)
    return emit_system(mechanism, system, straight_line=straight_line)


def formulate_system(start: RecursiveEquations, method: str, outputs: tuple[Output, ...]) -> tuple[SystemEquations, list[NaturalState]]:
    """The equations, and the states at which pivots of a saddle point are tried."""
    if METHODS[method].formulation is Formulation.IMPLICIT:
        return formulate_implicit(start, outputs), []
    equations = formulate_lagrangian(start, method, outputs)
    if not METHODS[method].saddle_point:
        return equations, []
    states = natural.closed_states(equations)
    dependent = natural.dependent_equations(equations, [*states, *natural.states_off_a_single_pose(equations, states)])
    return without(equations, dependent, watched=len(states) == 1), states


def _plan_with_pivots(equations: LagrangianEquations, pattern: Pattern, states: Sequence[NaturalState]) -> Plan:
    """The factorisation of a saddle point, with pivots that hold in all states in which the laws have values. Raises RunError: the
    equations depend on each other in one of the states, or some law has no value in any of them, or is code of the user."""
    for function in equations.topology.model.functions:
        words = "classical chooses its pivots by values of all laws, which user functions do not have at compile time"
        raise RunError(f"{function.span}: function '{function.name}': {words}; use --method recursive, recursive-newton or augmented")
    dt = equations.scene.numerics.of_method(equations.method).step
    samples = [sample for sample in natural.tangent_samples(equations, states, dt) if np.isfinite(sample).all()]
    if not samples:
        raise RunError("\n".join(_laws_without_value(equations, states[0])))
    try:
        return plan_unsymmetric(pattern, samples)
    except NoPivotError as error:
        words = "no order of elimination is safe in all poses near the design position"
        raise RunError(f"{equations.scene.span}: scene '{equations.scene.name}': classical: {words}; {_advice(equations)}") from error
    except SingularError as error:
        advice = _advice(equations)
        raise RunError("\n".join(dict.fromkeys(_dependent(equations, row, advice) for row in error.rows))) from error


def _laws_without_value(equations: LagrangianEquations, state: NaturalState) -> list[str]:
    """Messages about laws without a value or derivative in and near the design position."""
    words = "no finite value or derivative in the design position and near it, where classical chooses its pivots"
    advice = "give it one there, or use --method recursive"
    if not equations.domains:  # numbers grow without bound
        return [f"{equations.topology.model.span.file}: a law has {words}; {advice}"]
    results = natural.evaluate_results(equations, equations.function("domains").results, {"q": state.q, "v": state.v})
    left = [place for place, margin in zip(equations.domains, results.values(), strict=True) if not (margin > 0).all()]
    return [
        f"{place.place}: '{place.element}': its law has {words}: {place.function} leaves its domain there; {advice}"
        for place in left or equations.domains
    ]  # fmt: skip


def _advice(equations: LagrangianEquations) -> str:
    """Advice if classical finds no pivots: other methods, except if a motion is massless."""
    motions = find_momentary_motions(equations.start, explore(equations.start))
    if not motions:
        return "use --method augmented or recursive"
    named = (describe_momentary(equations.topology.model, motion) for motion in motions)
    return "\n".join(["other methods may not start there either", *named])


def _dependent(equations: LagrangianEquations, row: int, advice: str) -> str:
    model, name = equations.topology.model, equations.row_names[row]
    element = (*equations.state.v, *equations.state.equations)[row].element
    rest = name.removeprefix(f"{element}.").split("*")
    joints = [f"'{joint.name}'" for joint in model.joints if joint.name in rest and joint.name != element]
    what = f"body '{element}'" if any(body.name == element for body in model.bodies) else f"'{element}'"
    at = f" at {' and '.join(joints)}" if joints else ""
    if row < equations.unknowns:
        words = f"neither mass nor an equation determines its motion{at} in the design position or near it"
    else:
        words = f"what holds it{at} follows from what holds other elements in the design position or near it, as where links are in line"
    return f"{model.constraint_spans.get(element, model.span)}: {what}: {words}, which classical cannot solve; {advice}"
