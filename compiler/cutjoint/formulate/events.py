"""Event indicators and domains of laws, shared by all formulations.

The function ``events`` returns values that change sign where forces, guides and drives switch formulas. The function ``domains`` returns a
margin for each root, logarithm or quotient of a law; it is called only after a step has failed. A description names the element of each.
"""

from collections.abc import Iterator, Sequence

import sympy
from sympy.core.relational import Relational

from cutjoint.formulate.inputs import TIME, input_functions
from cutjoint.formulate.layout import Slot
from cutjoint.formulate.records import DomainPlace, Function, IndicatorPlace
from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.records import Model, Scalar, Scene
from cutjoint.program.blocks import Builder
from cutjoint.program.indicators import Domain, EventIndicator

FRICTION = "load of friction"  #: the stage of sections in which friction loads may be undefined
_STATE = ("const Real* q", "const Real* v")

# Indicators


def check_functions(indicators: Sequence[EventIndicator], domains: Sequence[Domain]) -> Iterator[Function]:
    """The functions ``events``, q, v -> the values of the indicators, and ``domains``, q, v, lambda -> margins; neither without results.
    The multipliers lambda affect friction loads only."""
    of_multipliers = (*_STATE, "const Real* lambda")
    found = (("events", _STATE, "value", [x.value for x in indicators]), ("domains", of_multipliers, "inside", [x.margin for x in domains]))
    for name, state, array, values in found:
        if values:
            results = {f"{array}:{i}": value for i, value in enumerate(values)}
            yield Function(name=name, arguments=(*state, f"Real* {array}"), results=results)


def check_slots(indicators: Sequence[EventIndicator], domains: Sequence[Domain]) -> dict[str, Slot]:
    """The slots of the event indicators and of the margins."""
    numbers = (("value", len(indicators)), ("inside", len(domains)))
    return {f"{array}:{i}": Slot(array=array, offset=i, names=(array,)) for array, number in numbers for i in range(number)}


def describe_indicators(b: Builder, indicators: Sequence[EventIndicator]) -> tuple[IndicatorPlace, ...]:
    """The element of each indicator and its line in the model file."""
    numbers = {indicator.value: i for i, indicator in enumerate(indicators) if not indicator.road}
    sections = [b.sections[indicator.section] for indicator in indicators]
    return tuple(
        IndicatorPlace(
            element=section.element or section.stage, place=section.source, road=indicator.road,
            across=-1 if indicator.across is None else numbers.get(indicator.across, -1), is_continuous=indicator.is_continuous,
        )
        for indicator, section in zip(indicators, sections, strict=True)
    )  # fmt: skip


# Jumps over time


def jump_times(model: Model, scene: Scene) -> tuple[float, ...]:
    """The times (s) at which an input of the scene or a guide switches its formula, for conditions that are linear in time.
    A discontinuous input has a left and a right value at such a time."""
    laws = [*scene.inputs.values(), *(law for joint in model.joints for law in joint.guide or ())]
    known = {p.symbol: p.value for p in model.parameters}
    conditions = {c for law in laws for c in sympy.sympify(law).atoms(Relational)}
    return tuple(sorted({time for c in conditions for time in _zeros(c.lhs - c.rhs, known)}))


def describe_guide_jumps(model: Model, scene: Scene, accuracy: float) -> Iterator[str]:
    """The warnings on guides that jump by more than an ``accuracy`` (m, rad) in a scene, at the lines of their joints."""
    known, inputs, step = {p.symbol: p.value for p in model.parameters}, input_functions(model, scene), 1e-6 * scene.end
    for joint in model.joints:
        units = (joint.element.units[name] for name in joint.element.coordinates)
        for unit, guide in zip(units, joint.guide or (), strict=False):
            law = sympy.sympify(guide).xreplace({symbol: sympy.sympify(of_time) for symbol, of_time in inputs.items()})
            switches = [c.lhs - c.rhs for c in law.atoms(Relational)] + [x.args[0] for x in law.atoms(sympy.sign)]
            for time in sorted({time for x in switches for time in _zeros(x, known) if 0 < time < scene.end}):
                near, far, before, beyond = (evaluate(law, {**known, TIME: time + n * step}) for n in (1, 2, -1, -2))
                if abs(size := 2 * near - far - (2 * before - beyond)) > accuracy:
                    words = "no force moves what it carries, and methods differ in where that is then; write a ramp"
                    yield f"{joint.span}: the guide of '{joint.name}' jumps by {size:.3g} {unit} at {time:.6g} s: {words}"


def guides_jump(model: Model, scene: Scene) -> bool:
    """Return whether a guide, or an input that moves one, changes its formula in the scene, so that its rate may jump."""
    laws = [sympy.sympify(law) for joint in model.joints for law in joint.guide or ()]
    laws += [law for symbol, law in input_functions(model, scene).items() if any(guide.has(symbol) for guide in laws)]
    return any(law.has(sympy.Piecewise, sympy.Abs, sympy.sign) for law in laws)


def _zeros(expression: Scalar, known: dict[Scalar, float]) -> Iterator[float]:
    """The time at which an expression is zero, if it is linear in time and has no other variable."""
    if not {TIME} <= expression.free_symbols <= {TIME, *known} or not expression.is_polynomial(TIME):
        return
    at_zero, at_one, at_two = (evaluate(expression, {**known, TIME: float(t)}) for t in (0, 1, 2))
    slope = at_one - at_zero
    if slope and abs(at_two - at_one - slope) <= 1e-12 * abs(slope):
        yield -at_zero / slope


# Domains


def _function(name: str, stage: str) -> str:
    """The text for the quantity of a domain."""
    if stage == FRICTION:
        return "the load of the joint, as an iteration finds it,"
    return "the divisor" if name == "div" else f"the argument of {name.replace('pow', '**')}"


def describe_domains(b: Builder, domains: Sequence[Domain]) -> tuple[DomainPlace, ...]:
    """The function and the element of each margin, and the element's line in the model file."""
    sections = [b.sections[domain.section] for domain in domains]
    places = {domain.margin: i for i, domain in enumerate(domains)}
    return tuple(
        DomainPlace(
            function=_function(domain.function, section.stage),
            element=section.element or section.stage, place=section.source, strict=domain.strict,
            remedy=None if domain.remedy is None else places[domain.remedy],
        )
        for domain, section in zip(domains, sections, strict=True)
    )  # fmt: skip
