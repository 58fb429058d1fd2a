"""Friction of joints: its law by N of load, and the state of its bristle.

With v the speed of the surfaces, s the bristle's share of the deflection at which it slides, and u = s/g::

    force by load = -radius mu_s g (u + (1 - u^2)/2 tanh(v/damping_speed))
    g = (mu_k + (mu_s - mu_k) exp(-(v/stribeck_speed)^2))/mu_s
    s' = v/presliding (1 - a)/(1 + 2/(1 - BREAKAWAY) a u v settling/presliding)
         - u beyond/(1 + u^2 beyond)/(SLOWER settling)
    a = 2 w^2/(1 + w^2) (1 + tanh(u v/(REVERSAL damping_speed)))/2,     w = (u^2 - BREAKAWAY)/(1 - BREAKAWAY) above BREAKAWAY, else 0
    beyond = u^2 - 1 above 1, else 0, rounded by ROUNDING

It slides at a = 1, u = 1. Where u^2 is below BREAKAWAY, and on reversal, a is 0: the bristle is a spring there, without creep (as in
Dupont, Hayward, Armstrong, Altpeter, IEEE Transactions on Automatic Control 47 (2002) 787-792). The force is at most mu_s g times the load;
under a constant load it is passive: it dissipates all energy that the bristle does not store. The rate of a sliding bristle is at most
1/settling. Beyond its limit the bristle yields, so that it has no rest there.
"""

from collections.abc import Collection
from typing import Any

import sympy

from cutjoint.elements.force import Bristle
from cutjoint.elements.forces.joint_friction import JointFriction
from cutjoint.elements.joint import rate_name
from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.expressions.operations import choice
from cutjoint.model.expressions.parse import quantity_symbol, variable
from cutjoint.model.expressions.scope import FAILED, Element
from cutjoint.model.expressions.units import FORCE, LENGTH, NONE, SPEED, TIME, Dimension
from cutjoint.model.names import name_problem
from cutjoint.model.records import VALUE, FirstOrderState, Model, Scalar

BREAKAWAY = 0.5  #: the square of the share of the limit below which the bristle is a spring
REVERSAL = 1e-3  #: the speed within which the bristle's direction of sliding reverses, as a share of the damping's

#: The share of the limit within which the bristle begins to give way beyond it, and how much slower than it settles: steps that settle
#: shall not feel it.
ROUNDING, SLOWER = 1e-9, 100

#: Lengths, speeds and times that must be greater than zero where they are given.
_POSITIVE = {
    "static": NONE, "stribeck_speed": SPEED, "radius": LENGTH, "arm": LENGTH, "thrust_radius": LENGTH, "presliding": LENGTH,
    "damping_speed": SPEED, "settling": TIME,
}  # fmt: skip


def read_friction(element: Element, part: Any, unit: str) -> tuple[Scalar, Bristle]:
    """The friction by N of load over ``rate``, and its bristle. Problems with all numbers of the force are noted."""
    for name, dimension in {"coefficient": NONE, "preload": FORCE}.items():
        if _value(element, part, name, dimension) < 0:
            element.fail(f"{name} must not be negative", "", (name,))
    sizes = {name: dimension for name, dimension in _POSITIVE.items() if getattr(part, name) is not None}
    for name, dimension in sizes.items():
        if _value(element, part, name, dimension) <= 0:
            element.fail(f"{name} must be greater than zero", "", (name,))
    _check_fields(element, part, unit)
    if problem := name_problem(bristle_name(str(element.path[-1]))):
        element.fail(f"its bristle: {problem[0]}", "rename the force", at_key=True)
    numbers = {name: element.scalar(getattr(part, name), dimension, (name,)) for name, dimension in sizes.items()}
    sliding = element.scalar(part.coefficient, NONE, ("coefficient",))
    symbol = quantity_symbol(bristle_name(element.name), VALUE)
    bristle = Bristle(symbol=symbol, rate=_rate(symbol, sliding, numbers), limit=_limit(sliding, numbers))
    return _law(symbol, sliding, numbers), bristle


def _value(element: Element, part: Any, name: str, dimension: Dimension) -> float:
    found = element.scalar(getattr(part, name), dimension, (name,))
    return 1.0 if found is FAILED else element.value(found)


def _check_fields(element: Element, part: Any, unit: str) -> None:
    """Note fields that are missing or that the coordinate does not take."""
    if unit == "rad" and part.radius is None:
        element.fail("friction on an angle needs the radius of its bearing", "write radius: 10 mm")
    for name in ("radius", "thrust_radius") if unit == "m" else ():
        if getattr(part, name) is not None:
            element.fail(f"{name} belongs to friction on an angle", "remove it", (name,))
    for name in ("arm", "thrust_radius") if not part.carried else ():
        if getattr(part, name) is not None:
            element.fail(f"{name} belongs to load-dependent friction", "remove it, or carried: false", (name,))
    if part.static is not None and part.stribeck_speed is None:
        element.fail("static needs the speed at which friction has come down from it", "write stribeck_speed: 0.01 m/s", ("static",))
    if part.static is None and part.stribeck_speed is not None:
        element.fail("stribeck_speed leads from a static coefficient to that of sliding", "give static too", ("stribeck_speed",))


def _surface(numbers: dict[str, Scalar]) -> tuple[Scalar, Scalar]:
    """The radius, 1 of a slide, and the speed of the surfaces."""
    radius = numbers.get("radius", sympy.Integer(1))
    return radius, radius * variable("rate")


def _stribeck(v: Scalar, sliding: Scalar, numbers: dict[str, Scalar]) -> Scalar:
    if "static" not in numbers or "stribeck_speed" not in numbers:
        return sympy.Integer(1)
    static = numbers["static"]
    return (sliding + (static - sliding) * sympy.exp(-((v / numbers["stribeck_speed"]) ** 2))) / static


def _law(s: Scalar, sliding: Scalar, numbers: dict[str, Scalar]) -> Scalar:
    radius, v = _surface(numbers)
    g = _stribeck(v, sliding, numbers)
    u = s / g
    return -radius * numbers.get("static", sliding) * g * (u + (1 - u**2) * sympy.tanh(v / numbers["damping_speed"]) / 2)


def _limit(sliding: Scalar, numbers: dict[str, Scalar]) -> Scalar:
    """The largest force by N of load."""
    static, radius = numbers.get("static", sliding), numbers.get("radius", sympy.Integer(1))
    return radius * (sliding if static == sliding else choice((static, static > sliding), (sliding, sympy.true)))


def _rate(s: Scalar, sliding: Scalar, numbers: dict[str, Scalar]) -> Scalar:
    """s' over ``rate``."""
    _, v = _surface(numbers)
    u = s / _stribeck(v, sliding, numbers)
    free, above = v / numbers["presliding"], (u**2 - BREAKAWAY) / (1 - BREAKAWAY)
    w2 = choice((sympy.Integer(0), above < 0), (above**2, sympy.true))
    a = w2 / (1 + w2) * (1 + sympy.tanh(u * v / (REVERSAL * numbers["damping_speed"])))
    over = u**2 - 1
    beyond = (over + sympy.sqrt(over**2 + ROUNDING**2)) / 2
    giving = u * beyond / (1 + u**2 * beyond) / (SLOWER * numbers["settling"])
    return free * (1 - a) / (1 + 2 / (1 - BREAKAWAY) * a * u * free * numbers["settling"]) - giving


def bristle_name(force: str) -> str:
    """The name of the state of a force's bristle."""
    return f"{force}_bristle"


def bristle_of(force: JointFriction) -> FirstOrderState:
    """The state of a force's bristle, which begins undeflected."""
    speed = quantity_symbol(force.joint, rate_name(force.coordinate))
    return FirstOrderState(
        name=bristle_name(force.name), symbol=force.bristle.symbol, rate=force.bristle.rate.xreplace({variable("rate"): speed}),
        initial=sympy.Integer(0), unit="", span=force.span,
    )  # fmt: skip


def refuse_friction(model: Model, names: Collection[str], message: str, hint: str) -> ModelError:
    """The error that some of a model's load-dependent forces cannot be computed."""
    return ModelError([Problem(f.span, f"force '{f.name}'", message, hint) for f in model.forces if f.name in names])
