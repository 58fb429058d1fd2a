"""The domains of the laws of a program: the arguments of their roots, logarithms and quotients."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from cutjoint.program.blocks import BindingTime, Block, Builder
from cutjoint.program.lower import reachable_blocks


@dataclass(frozen=True, kw_only=True)
class Domain:
    """A ``margin`` that is not negative where a ``function`` of a law has a value, or positive if it is ``strict``.

    ``section`` is that of the program in which the function stands.
    """

    function: str
    margin: Block
    strict: bool
    section: int


def find_domains(builder: Builder, results: Iterable[Block]) -> list[Domain]:
    """The domains of all functions that laws call, the results depend on and a parameter, the time or the motion may leave, each once."""
    found: dict[Block, Domain] = {}
    for block in reachable_blocks(results):
        if block in builder.restricted:
            domain = _domain(builder, block)
            if domain is not None and domain.margin.binding >= BindingTime.PARAM:
                found.setdefault(domain.margin, domain)
    return list(found.values())


def _domain(b: Builder, block: Block) -> Domain | None:
    """The domain of a call; None of a power with a whole exponent."""
    data: Any = block.data
    function, argument = data[0], block.args[-1 if data[0] == "div" else 0]
    match function:
        case "sqrt" | "log":
            margin = argument
        case "asin" | "acos":
            margin = b.sub(b.number(1.0), b.mul(argument, argument))
        case "div":
            margin = b.mul(argument, argument)
        case _:
            exponent: Any = block.args[1].data
            if block.args[1].op == "const" and float(exponent[0][0]).is_integer():
                return None
            margin = argument
    return Domain(function=function, margin=margin, strict=function in ("log", "div"), section=block.section)
