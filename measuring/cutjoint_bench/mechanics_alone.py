"""Models with mechanics alone, which the generic solver and peers have equations for."""

from cutjoint.elements.interactions.axis_force import AxisForce
from cutjoint.elements.interactions.compliance import Compliance
from cutjoint.elements.interactions.line_force import LineForce
from cutjoint.elements.interactions.on_coordinate import OnCoordinate
from cutjoint.elements.interactions.road_contact import RoadContact
from cutjoint.elements.interactions.wrench import Wrench
from cutjoint.model.elements.friction import bristle_name
from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.expressions.quantities import reading_elements
from cutjoint.model.records import BallSpring, Contact, FirstOrderState, Force, JointFriction, Model, RodForce, Scene, Signal, Wheel

#: The interactions whose equations others have too: those that stand in the generic solver and in programs of peers by hand.
KNOWN = (AxisForce, Compliance, LineForce, OnCoordinate, RoadContact, Wrench)


def is_reduced(model: Model, scene: Scene) -> bool:
    """Return whether a model has elements of passes: guards, sensors of rods, columns that stand for others."""
    return bool(model.guards or any(isinstance(r, RodForce) for r in model.reactions) or any(o.stands_for for o in scene.outputs))


def require_mechanics_alone(model: Model) -> None:
    """Raise ModelError for what programs with mechanics alone do not have.
    States, signals, laws that read other elements, friction that sticks, grounds of wheels, contacts, springs of balls,
    gears with laws and functions of the user."""
    bristles = {bristle_name(f.name) for f in model.forces if isinstance(f, JointFriction)}
    reading = (e for e in reading_elements(model) if not (isinstance(e, Signal) and e.reported))  # outputs may be left out
    found = (*(s for s in model.states if s.name not in bristles), *(e for e in reading if not isinstance(e, FirstOrderState)))
    message = "only cutjoint has states, controllers and laws that read quantities"
    problems = [Problem(span=e.span, element=f"'{e.name}'", message=message, hint="leave it out") for e in found]
    problems += [
        Problem(span=f.span, element=f"'{f.name}'", message=f"only cutjoint has {_words(f)}", hint="leave it out")
        for f in model.forces if type(f.interaction) not in KNOWN or (f.has_road and f.expressions and f not in found)
    ]  # fmt: skip
    problems += [
        Problem(span=g.span, element=f"gear '{g.name}'", message=f"only cutjoint has gears {what}", hint="give it a ratio")
        for g in model.gears if (what := "with a law" if g.law is not None else "of more than two joints" if g.others else "")
    ]  # fmt: skip
    problems += [
        Problem(span=j.span, element=f"joint '{j.name}'", message="only cutjoint has armatures here", hint="leave it out")
        for j in model.joints if j.armature != 0
    ]
    problems += [
        Problem(span=f.span, element=f"function '{f.name}'", message="only cutjoint calls functions of users", hint="write an expression")
        for f in model.functions
    ]
    if problems:
        raise ModelError(problems)


def _words(force: Force) -> str:
    if isinstance(force, JointFriction):
        return "friction that sticks"
    if isinstance(force, Contact):
        return "contacts"
    if isinstance(force, BallSpring):
        return "springs and dampers of balls"
    if isinstance(force, Wheel):
        return "wheels that turn"
    return "a ground of a wheel's own" if force.has_road else f"forces of kind '{force.element.kind}'"
