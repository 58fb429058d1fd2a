"""The tangent of forces and first-order states by each other."""

from __future__ import annotations

from collections.abc import Iterator

from cutjoint.formulate.implicit.balance import SharedForces, ways
from cutjoint.formulate.implicit.motions import Motions
from cutjoint.formulate.layout import StateLayout
from cutjoint.formulate.states import Entry, by_state, state_rates
from cutjoint.model.records import Model
from cutjoint.program.blocks import Block
from cutjoint.program.vary import Variation


def coupled_tangent(motions: Motions, layout: StateLayout, model: Model, system: SharedForces) -> Iterator[Entry]:
    """The derivatives of the states' equations by the joints' motions, and of the joints' by the states."""
    b, rates = motions.k.builder, state_rates(motions.k.translator, model)
    variations = motions.variations() if model.states else {}
    for place, state in enumerate(model.states, start=layout.speeds):
        change = by_state(b, state.name, motions.weights.damping)
        with b.section("tangent", state.name, "what f changes by motions, and forces by x", state.span.place):
            yield from ((place, m.row, b.neg(variations[m.key].of(rates[state.name]))) for m in motions.all())
            yield from ((row, place, b.neg(entry)) for row, entry in _force_changes(motions, change, system))


def _force_changes(motions: Motions, change: Variation, system: SharedForces) -> Iterator[tuple[int, Block]]:
    """The change of the generalised forces: row, value."""
    b = motions.k.builder
    for wrenches in system.wrenches.values():
        for _, wrench, way in ways(motions, wrenches):
            yield from ((m.row, b.dot(m.s, change.of(wrench))) for m in way)
    for body, force in system.joint_forces.items():
        yield from ((m.row, b.element(change.of(force), m.index)) for m in motions.of_body[body])
