"""The reduction sequence: the full model and what is left of it after more and more passes.

A reduced model holds for its scene's inputs: their laws stand in it, and it has no inputs.  A measure judges approximations: light links
without mass, and tyres that roll straight on, whose lateral forces are left out while guards watch that they would have stayed small.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import sympy

from cutjoint.compile.derivation import schedule_method
from cutjoint.formulate.forces import is_active
from cutjoint.formulate.inputs import input_functions
from cutjoint.formulate.records import Equations
from cutjoint.methods import DEFAULT_METHOD, METHODS
from cutjoint.model.errors import ModelError
from cutjoint.model.expressions.evaluate import evaluate, substitute
from cutjoint.model.expressions.parse import variable
from cutjoint.model.expressions.quantities import reading_elements
from cutjoint.model.outcome import Note, Outcome, Pass
from cutjoint.model.records import Binding, Guard, Model, Output, Scene, Tyre
from cutjoint.package.errors import EquationsError, RunError
from cutjoint.program.records import Program
from cutjoint.reduce.freeze import freeze_idle
from cutjoint.reduce.guards import guard_idle
from cutjoint.reduce.links import shorten_links
from cutjoint.reduce.planar import drop_idle_equations, flatten
from cutjoint.reduce.reach import drop_unreached
from cutjoint.reduce.sampling import run_scene
from cutjoint.reduce.weld import weld_bodies
from cutjoint.run.run_file import parameter_values, trimmed, with_solved_coordinates
from cutjoint.run.simulator import SimulatorError

# Light links

LIGHT = 0.02  #: the share of the model's mass below which a body counts as light
#: A tyre rolls straight on as long as its lateral force is below this share of the largest load that it has in the scene.
SMALL = 0.15
#: The motion of a reduced model: that of the full one, the same while guards hold, or near it.
MOTIONS = ("exact", "guarded", "approximate")
#: Errors by which a method may refuse a reduced model: redundant equations, cuts of the file that are impossible.
_REFUSALS = (ModelError, EquationsError, RunError)


def lighten_links(model: Model, scene: Scene) -> Outcome:
    """The pass: light bodies that without mass would be distances lose it; what they bear on their neighbours is lost with it."""
    values = {p.symbol: p.value for p in model.parameters}
    masses = {body.name: evaluate(sympy.sympify(body.mass), values) for body in model.bodies}
    whole = sum(masses.values())
    outcome = Outcome(model=model, scene=scene)
    zero = sympy.Integer(0)
    for body in (body for body in model.bodies if 0 < masses[body.name] <= LIGHT * whole):
        massless = replace(body, mass=zero, inertia=(zero,) * 6)
        bodies = tuple(massless if b.name == body.name else b for b in outcome.model.bodies)
        reduced = shorten_links(replace(outcome.model, bodies=bodies), outcome.scene)
        if any(note.element == body.name for note in reduced.done):
            text = f"loses its mass, {100 * masses[body.name] / whole:.2g} % of the whole, and becomes a distance"
            note = Note(element=body.name, text=text, span=body.span)
            outcome = replace(outcome, model=reduced.model, scene=reduced.scene, done=(*outcome.done, note))
    return outcome


# Rolling tyres


def roll_straight(model: Model, scene: Scene) -> Outcome:
    """The pass: all tyres lose lateral force and aligning moment if those of none get large in a run of the model."""
    outcome = Outcome(model=model, scene=scene)
    tyres = [f for f in model.forces if isinstance(f, Tyre) and is_active(f, scene) and f.lateral]
    if not tyres:
        return outcome
    asked = [Output(element=tyre.name, quantity=name, span=tyre.span) for tyre in tyres for name in ("Fy", "Fz")]
    try:
        run = run_scene(model, scene, asked)
    except (ModelError, RunError, SimulatorError):
        return outcome
    if run.failure is not None:
        return outcome
    peaks = {t.name: (float(np.abs(run[f"{t.name}.Fy"]).max()), float(run[f"{t.name}.Fz"].max())) for t in tyres}
    left = tuple(
        Note(element=t.name, text=f"keeps its lateral force, which reaches {peaks[t.name][0]:.3g} N", span=t.span)
        for t in tyres if peaks[t.name][0] > SMALL * peaks[t.name][1]
    )  # fmt: skip
    if left:
        return replace(outcome, left=left)
    limits = {t.name: float(f"{SMALL * peaks[t.name][1]:.2g}") for t in tyres}
    side = variable("side")
    guards = tuple(Guard(force=t, margins=tuple(sympy.Float(limits[t.name]) - s * side for s in (1, -1)), index=None) for t in tyres)
    rolling = tuple(replace(f, lateral=False) if isinstance(f, Tyre) and f.name in limits else f for f in model.forces)
    text = "loses its lateral force of up to {:.3g} N, guarded by |Fy| <= {:g} N"
    notes = tuple(Note(element=t.name, text=text.format(peaks[t.name][0], limits[t.name]), span=t.span) for t in tyres)
    return replace(outcome, model=replace(model, forces=rolling, guards=(*model.guards, *guards)), done=notes)


@dataclass(frozen=True, kw_only=True)
class Step:
    """A pass by name, its effect on the motion (see MOTIONS), and whether it supports gears and laws that read quantities."""

    name: str
    reduce: Pass
    motion: str = "exact"
    gears: bool = True
    readings: bool = False

    def takes(self, model: Model) -> bool:
        """Return whether the pass is tried on a model."""
        return (self.gears or not model.gears) and (self.readings or not reading_elements(model))


#: The passes in the order in which they are tried.
STEPS: tuple[Step, ...] = (
    Step(name="reached", reduce=drop_unreached),
    Step(name="welded", reduce=weld_bodies),
    Step(name="links", reduce=shorten_links),
    Step(name="idle equations", reduce=drop_idle_equations, readings=True),
    Step(name="planar", reduce=flatten, gears=False),
    Step(name="guards", reduce=guard_idle, motion="guarded"),
)

#: Approximations in the order in which they are tried: each changes the full model, to which the passes above are then applied.
APPROXIMATIONS: tuple[Step, ...] = (
    Step(name="frozen", reduce=freeze_idle, motion="approximate", gears=False),
    Step(name="light", reduce=lighten_links, motion="approximate"),
)


#: Applied after all other approximations, since its guards watch the remaining tyres.
ROLLING = Step(name="rolling", reduce=roll_straight, motion="approximate")


@dataclass(frozen=True, kw_only=True)
class ReducedModel:
    """A model of the reduction sequence.

    ``name`` is that of the last pass that changed it; ``done`` has the changes of the passes up to that one, ``left`` the elements that
    they left.

    ``motion`` is one of MOTIONS; ``operations`` are those of an evaluation, ``unknowns`` and ``equations`` the numbers of coordinates and
    of the cut joints' equations; ``scheduled`` are the equations and the program that these were counted in.
    """

    name: str
    model: Model
    scene: Scene
    method: str
    motion: str
    operations: int
    unknowns: int
    equations: int
    done: tuple[Note, ...] = ()
    left: tuple[Note, ...] = ()
    scheduled: tuple[Equations, Program] = field(compare=False, repr=False)


def reduction_sequence(model: Model, scene: Scene, method: str = DEFAULT_METHOD, *, approximate: bool = False) -> list[ReducedModel]:
    """The full model first, then a reduced model for every pass that lowers the operations of a method. Raises ModelError, EquationsError:
    the full model is wrong; RunError: the method does not take the full model; MissingLibraryError: a library that orders the method's
    matrices is not installed; ToolchainError, SimulatorError: the C++ side failed where a pass runs the model."""
    model, scene = started(model, scene, {})
    whole = Outcome(model=model, scene=scene, left=tuple(_ruled_out(model, STEPS + APPROXIMATIONS if approximate else STEPS)))
    variants = _reduce("full", "exact", whole, method)
    if approximate:
        _approximate(whole, variants, method)
        _try_pass(variants, ROLLING)
    return variants


def started(model: Model, scene: Scene, parameters: Mapping[str, float]) -> tuple[Model, Scene]:
    """The model with the values of parameters, and its scene with the start that is solved with them."""
    model, scene, _ = trimmed(model, scene, parameters)
    values = parameter_values(model, parameters)
    model = replace(model, parameters=tuple(replace(p, value=float(values.get(p.name, p.value))) for p in model.parameters))
    return model, with_solved_coordinates(model, scene, values)


def _ruled_out(model: Model, steps: Sequence[Step]) -> Iterator[Note]:
    """The passes that are not tried on a model with gears, or with laws that read quantities."""
    text = f"rules out the passes {', '.join(step.name for step in steps if not step.readings)}, which change what it may read"
    yield from (Note(element=e.name, text=text, span=e.span) for e in reading_elements(model))
    text = f"rules out the passes {', '.join(step.name for step in steps if not step.gears)}, which know no gears"
    yield from (Note(element=gear.name, text=text, span=gear.span) for gear in model.gears)


def _reduce(name: str, motion: str, outcome: Outcome, method: str) -> list[ReducedModel]:
    """The model itself, then a reduced model for each exact or guarded pass that lowers its operations."""
    variants = [_variant(name, outcome, method, motion=motion)]
    for step in STEPS:
        _try_pass(variants, step)
    return variants


def _try_pass(variants: list[ReducedModel], step: Step) -> None:
    """Try a pass on the last model: add the reduced model where it costs less, else a note of why not to the last one."""
    below = variants[-1]
    if not step.takes(below.model):
        return
    reduced = step.reduce(below.model, below.scene)
    left, above = reduced.left, None
    if reduced.done:
        try:
            above = _variant(step.name, reduced, below.method, motion=max(below.motion, step.motion, key=MOTIONS.index))
        except _REFUSALS:
            left = tuple(_refused(reduced.done, step.name, below.method))
    if above is not None and above.operations >= below.operations:
        text = f"stays: the pass '{step.name}' would take {above.operations} operations in place of {below.operations}"
        left, above = tuple(replace(note, text=text) for note in reduced.done), None
    if above is None:
        variants[-1] = replace(below, left=below.left + left)
    else:
        variants.append(replace(above, done=below.done + above.done, left=below.left + above.left))


def _approximate(whole: Outcome, variants: list[ReducedModel], method: str) -> None:
    """Try each approximation on the whole model as approximated so far: add the model that all passes make of it, where it costs less."""
    for step in (s for s in APPROXIMATIONS if s.takes(whole.model)):
        changed, below = step.reduce(whole.model, whole.scene), variants[-1]
        if not changed.done:
            variants[-1] = replace(below, left=tuple(dict.fromkeys((*below.left, *changed.left))))
            continue
        changed = replace(changed, done=whole.done + changed.done, left=whole.left + changed.left)
        try:
            above = _reduce(step.name, step.motion, changed, method)[-1]
        except _REFUSALS:
            variants[-1] = replace(below, left=(*below.left, *_refused(changed.done, step.name, method)))
            continue
        if above.operations < below.operations:
            whole = changed
            variants.append(replace(above, name=step.name))


def _variant(name: str, outcome: Outcome, method: str, *, motion: str) -> ReducedModel:
    return _count(name, fix_inputs(outcome) if outcome.done else outcome, method, motion=motion)


def _count(name: str, outcome: Outcome, method: str, *, motion: str) -> ReducedModel:
    """A reduced model with the operations of a method's evaluation."""
    equations, program = scheduled = schedule_method(outcome.model, outcome.scene, outcome.scene.outputs, method=method)
    return ReducedModel(
        name=name, model=outcome.model, scene=outcome.scene, method=method, motion=motion, unknowns=equations.unknowns,
        operations=program.operations(METHODS[method].iteration), equations=len(equations.equation_names), done=outcome.done,
        left=outcome.left, scheduled=scheduled,
    )  # fmt: skip


def _refused(notes: Sequence[Note], name: str, method: str) -> list[Note]:
    """The notes of a pass whose result the method does not support."""
    return [replace(note, text=f"stays: the method {method} cannot solve the model after the pass '{name}'") for note in notes]


def fix_inputs(outcome: Outcome) -> Outcome:
    """The outcome with the scene's functions of time in place of inputs."""
    model, scene = outcome.model, outcome.scene
    laws = input_functions(model, scene)
    if not laws:
        return outcome
    parameters = tuple(p for p in model.parameters if p.binding is not Binding.INPUT)
    settled: dict[str, Any] = {
        name: substitute(getattr(model, name), laws) for name in ("joints", "forces", "guards", "states", "signals", "controllers")
    }
    return replace(outcome, model=replace(model, parameters=parameters, **settled), scene=replace(scene, inputs={}))
