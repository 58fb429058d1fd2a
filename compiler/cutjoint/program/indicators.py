"""Event indicators, which change sign where a program switches formulas; domains of roots, logarithms and quotients."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from cutjoint.ops import OPERATIONS, fact
from cutjoint.program.blocks import SURFACE, BindingTime, Block, Builder
from cutjoint.program.lower import reachable_blocks

# Domains


@dataclass(frozen=True, kw_only=True)
class Domain:
    """A ``margin`` that is not negative where a ``function`` of a law has a value, or positive if it is ``strict``.
    ``section`` is that of the program in which the function stands. ``remedy``, a positive number, is a domain that is never left."""

    function: str
    margin: Block
    strict: bool
    section: int
    remedy: Block | None = None


def find_domains(builder: Builder, results: Iterable[Block]) -> list[Domain]:
    """The domains, each once, of functions that laws call and results depend on, if parameters, time or motion may leave them."""
    found: dict[Block, Domain] = {}
    for block in reachable_blocks(results):
        if block in builder.restricted:
            domain = _domain(builder, block)
            if domain is not None and domain.margin.binding >= BindingTime.PARAM:
                found.setdefault(domain.margin, domain)
    for domain in tuple(found.values()):
        if domain.remedy is not None:
            found.setdefault(domain.remedy, replace(domain, margin=domain.remedy, strict=False, remedy=None))
    return list(found.values())


def _domain(b: Builder, block: Block) -> Domain | None:
    """The domain of a call; None of a power with a whole exponent."""
    function = _function(block)[0]
    margin = fact(function, "margin")(b, *block.args)
    if margin is None:
        return None
    remedy = b.restricted[block]
    strict = OPERATIONS[function].strict or remedy is not None
    return Domain(function=function, margin=margin, strict=strict, section=block.section, remedy=remedy)


# Indicators


@dataclass(frozen=True, kw_only=True)
class EventIndicator:
    """A scalar that changes sign where a formula changes, and the section of the program that chooses by it.
    Of a lookup on a ``road`` the value is the position along it, for events where the road's pieces meet; ``across`` is the indicator of
    the lateral position. Without a road they are "" and None. If it ``is_continuous``, only derivatives of forces jump."""

    value: Block
    section: int
    road: str = ""
    across: Block | None = None
    is_continuous: bool = False


def find_indicators(builder: Builder, results: Iterable[Block]) -> list[EventIndicator]:
    """The indicators of all choices, absolute values and lookups that the results depend on and that change in a run, each once."""
    found: dict[tuple[Block, str], EventIndicator] = {}
    for block in reachable_blocks(results):
        for indicator in _indicators(builder, block):
            if indicator.value.binding > BindingTime.PARAM:
                found.setdefault((indicator.value, indicator.road), indicator)
    return list(found.values())


def _indicators(builder: Builder, block: Block) -> list[EventIndicator]:
    if block.op != "call":
        return []
    function, road = _function(block)
    if function == "where":
        return [EventIndicator(value=_signless(_margin(builder, block.args[0])), section=block.section)]
    if function == "abs":
        return [EventIndicator(value=_signless(block.args[0]), section=block.section)]
    if not road or function.startswith(SURFACE):
        return []
    x, y = block.args
    return [EventIndicator(value=x, section=block.section, road=road, across=y), EventIndicator(value=y, section=block.section)]


def _signless(value: Block) -> Block:
    return value.args[0] if value.op == "neg" else value


def _margin(b: Builder, condition: Block) -> Block:
    """A value that is positive where a condition holds and negative where it does not."""
    match _function(condition)[0] if condition.op == "call" else "":
        case "lt" | "le":
            return b.sub(condition.args[1], condition.args[0])
        case "not":
            return b.neg(_margin(b, condition.args[0]))
        case "and":
            one, other = (_margin(b, a) for a in condition.args)
            return b.call("where", b.call("lt", one, other), one, other)
        case "or":
            one, other = (_margin(b, a) for a in condition.args)
            return b.call("where", b.call("lt", one, other), other, one)
    return condition


def _function(block: Block) -> tuple[str, str]:
    data: Any = block.data
    function, road = data
    return function, road or ""
