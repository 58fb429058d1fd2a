"""Parts that peers in C++ share beside the forces: their columns, the bodies whose accelerations they report, headers."""

from __future__ import annotations

import json

from cutjoint.model.records import GROUND
from cutjoint_bench.export.columns import MOTION
from cutjoint_bench.export.forces_cpp import Forces, Term, arm
from cutjoint_bench.export.printing import TEMPLATES, vector
from cutjoint_bench.export.records import Column, Mechanism


def support_files(*further: str) -> dict[str, str]:
    """The headers that are the same for all models, those that all peers have and further ones."""
    return {name: (TEMPLATES / name).read_text(encoding="utf-8") for name in ("mechanics.hpp", "program.hpp", *further)}


def column_text(mechanism: Mechanism, forces: Forces, column: Column) -> str:
    """A Column of program.hpp."""
    body = "on_ground" if column.body == GROUND else forces.bodies[column.body]
    place = vector(arm(mechanism, column.body, column.point))
    return f"{{{json.dumps(column.name)}, {body}, {place}, {MOTION.index(column.quantity)}}}"


def part_texts(mechanism: Mechanism, forces: Forces) -> list[str]:
    """A Part of program.hpp for every body of the model that has mass and can move."""
    places = {name: place for name, place in mechanism.places.items() if place.of != GROUND and place.mass > 0}
    return [
        f"{{{json.dumps(name)}, {forces.bodies[place.of]}, {vector(arm(mechanism, place.of, place.centre))}}}"
        for name, place in places.items()
    ]


def offset(mechanism: Mechanism, term: Term) -> float:
    """The model's coordinate at the start, where a peer's is zero."""
    return next(joint.coordinates[term.index] for joint in mechanism.tree if joint.name == term.joint)
