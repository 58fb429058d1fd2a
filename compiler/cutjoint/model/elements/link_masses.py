"""Massless links replaced by slender rods, for comparison with simulators in which every body needs mass."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from itertools import combinations

import sympy

from cutjoint.model.errors import ModelError, Problem, nearest
from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.records import Body, Model, Vector

#: A rod's moment of inertia about its own axis, as a share of that across it: that of a round bar 77 times as long as thick.
AXIAL = 1e-3


def with_link_masses(model: Model, masses: Mapping[str, float]) -> Model:
    """The model with slender rods in place of massless bodies; ``masses`` are in kg by names, in which ``*`` stands for any text.

    A rod of length L lies between the two joints' points of the body that are farthest apart; its moments of inertia are m L^2/12 across
    and :data:`AXIAL` times that about its axis.  Of several names that match, the last counts. Raises ModelError: a name matches no
    massless body, a mass is not positive, or a body has joints at one point only.
    """
    links = [body for body in model.bodies if body.is_massless]
    problems = [p for pattern, mass in masses.items() for p in _problems(model, links, pattern, mass)]
    chosen = {body.name: mass for pattern, mass in masses.items() for body in links if fnmatchcase(body.name, pattern)}
    spans = {name: _span(model, name) for name in chosen}
    message, hint = "its joints are at one point, so it cannot become a rod", "give it mass and inertia in the model file"
    pointed = [body for body in links if body.name in chosen and spans[body.name] is None]
    problems += [Problem(span=body.span, element=f"body '{body.name}'", message=message, hint=hint) for body in pointed]
    if problems:
        raise ModelError(problems)
    bodies = (_rod(body, chosen[body.name], spans[body.name]) if body.name in chosen else body for body in model.bodies)
    return replace(model, bodies=tuple(bodies))


def _problems(model: Model, links: Sequence[Body], pattern: str, mass: float) -> list[Problem]:
    element = f"link mass '{pattern}'"
    problems = []
    if not any(fnmatchcase(body.name, pattern) for body in links):
        hint = nearest(pattern, [body.name for body in links]) or "it has none"
        problems.append(Problem(span=model.span, element=element, message="no massless body of the model has this name", hint=hint))
    if not (mass > 0 and math.isfinite(mass)):
        problems.append(Problem(model.span, element, f"mass needs a positive number of kg, got {mass:g}"))
    return problems


def _span(model: Model, body: str) -> tuple[Vector, Vector] | None:
    """The two joints' points of a body that are farthest apart in the design position, None if they are one."""
    values = {p.symbol: p.value for p in model.parameters}

    def length(ends: tuple[Vector, Vector]) -> float:
        return math.dist(*([evaluate(sympy.sympify(e), values) for e in end] for end in ends))

    points = [p for j in model.joints for end, p in ((j.base, j.at), (j.follower, j.to or j.at)) if end == body]
    pairs = list(combinations(points, 2))
    farthest = max(pairs, key=length, default=None)
    return farthest if farthest is not None and length(farthest) > 0 else None


def _rod(body: Body, mass: float, ends: tuple[Vector, Vector] | None) -> Body:
    """J = m/12 (L^2 1 - (1 - AXIAL) d d^T), d the vector of length L between the ends."""
    assert ends is not None
    start, end = (sympy.Matrix(point) for point in ends)
    d = end - start
    J = sympy.Float(mass) / 12 * (d.dot(d) * sympy.eye(3) - (1 - AXIAL) * d * d.T)
    inertia = (J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2])
    return replace(body, mass=sympy.Float(mass), centre_of_mass=tuple((start + end) / 2), inertia=inertia)
