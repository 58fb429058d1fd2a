"""The switches of a program from one formula to another: the values at whose change of sign its choices change."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from cutjoint.program.blocks import BindingTime, Block, Builder
from cutjoint.program.lower import reachable_blocks


@dataclass(frozen=True, kw_only=True)
class Switch:
    """A scalar that changes sign where a formula changes, and the section of the program that chooses by it.

    Of a lookup on a ``road`` the value is the place along it, which matters where the road's pieces meet; ``across`` is the other place, a
    switch of its own.  Without a road they are "" and None.
    """

    value: Block
    section: int
    road: str = ""
    across: Block | None = None


def find_switches(builder: Builder, results: Iterable[Block]) -> list[Switch]:
    """The switches of all choices, absolute values and lookups that the results depend on and that change in a run, each once."""
    found: dict[tuple[Block, str], Switch] = {}
    for block in reachable_blocks(results):
        for switch in _switches(builder, block):
            if switch.value.binding > BindingTime.PARAM:
                found.setdefault((switch.value, switch.road), switch)
    return list(found.values())


def _switches(builder: Builder, block: Block) -> list[Switch]:
    """The switches of a block's formula."""
    if block.op != "call":
        return []
    function, road = _function(block)
    if function == "where":
        return [Switch(value=_signless(_margin(builder, block.args[0])), section=block.section)]
    if function == "abs":
        return [Switch(value=_signless(block.args[0]), section=block.section)]
    if not road:
        return []
    x, y = block.args
    return [Switch(value=x, section=block.section, road=road, across=y), Switch(value=y, section=block.section)]


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
    """A call's function and the road of its lookup."""
    data: Any = block.data
    function, road = data
    return function, road or ""
