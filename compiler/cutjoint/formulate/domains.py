"""The margins of the domains of laws: shared by all formulations.

The function ``domains`` has a margin for each root, logarithm or quotient of a law; it is called only where a step has failed.
"""

from __future__ import annotations

from collections.abc import Sequence

from cutjoint.formulate.records import DomainPlace, Function, Slot
from cutjoint.program.blocks import Builder
from cutjoint.program.domains import Domain


def domains_function(domains: Sequence[Domain]) -> tuple[Function, ...]:
    """The function ``domains``: q, v -> the margins; none if there are none."""
    arguments = ("const Real* q", "const Real* v", "Real* inside")
    results = {f"inside:{i}": domain.margin for i, domain in enumerate(domains)}
    return (Function(name="domains", arguments=arguments, results=results),) if domains else ()


def domain_slots(domains: Sequence[Domain]) -> dict[str, Slot]:
    """The places of the margins."""
    return {f"inside:{i}": Slot(array="inside", offset=i, names=("inside",)) for i in range(len(domains))}


def describe_domains(b: Builder, domains: Sequence[Domain]) -> tuple[DomainPlace, ...]:
    """The function and the element of each margin, and the element's line in the model file."""
    sections = [b.sections[domain.section] for domain in domains]
    return tuple(
        DomainPlace(
            function="the divisor" if domain.function == "div" else f"the argument of {domain.function.replace('pow', '**')}",
            element=section.element or section.stage, place=section.source, strict=domain.strict,
        )
        for domain, section in zip(domains, sections, strict=True)
    )  # fmt: skip
