"""Models whose laws read quantities of other elements, drawn at random: by themselves, by signals, and by states."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import sympy

from cutjoint.model.expressions.parse import quantity_symbol
from cutjoint.model.expressions.quantities import quantities
from cutjoint.model.records import VALUE, Body, FirstOrderState, Force, Joint, LawForce, Model, Scalar, Signal

#: A body and its angles near the design position, a joint's speed: what natural coordinates have too.
_OF_BODIES = ("x", "y", "z", "vx", "vy", "vz", "roll", "pitch", "yaw", "wx", "wy", "wz")


def reading(model: Model, seed: int, *, states: int = 0) -> Model:
    """The model with three signals, ``states`` states, and laws that read these, bodies, tree joints and forces that stand before."""
    rng = np.random.default_rng(seed)
    known: list[Scalar] = [
        quantity_symbol(body.name, name) for body in model.bodies if isinstance(body, Body) for name in rng.choice(_OF_BODIES, 2)
    ]
    known += [quantity_symbol(joint.name, name) for joint in model.joints if _is_open(joint) for name in list(quantities(joint))[-1:]]
    names = [f"state_{i}" for i in range(states)]
    known += [quantity_symbol(name, VALUE) for name in names]

    def mixed() -> Scalar:
        one, two, three = rng.choice(len(known), 3)
        factors = [sympy.Float(x) for x in rng.uniform(-2, 2, 3)]
        return factors[0] * known[one] + factors[1] * sympy.sin(known[two] * known[three] / 8) + factors[2] * known[two] ** 2

    signals = []
    for i in range(3):
        symbol = quantity_symbol(f"signal_{i}", VALUE)
        signals.append(Signal(name=f"signal_{i}", symbol=symbol, value=mixed(), unit="", span=model.span))
        known.append(symbol)
    forces: list[Force] = []
    for force in model.forces:
        if isinstance(force, LawForce):
            force = replace(force, law=force.law + 3 * mixed())
            known.append(quantity_symbol(force.name, "force"))
        elif force.element.laws in (("components",), ("laws",)):
            (field,) = force.element.laws
            force = replace(force, **{field: tuple(law + mixed() for law in getattr(force, field))})
        forces.append(force)
    made = tuple(
        FirstOrderState(name=name, symbol=quantity_symbol(name, VALUE), rate=mixed(), initial=sympy.Float(0.3), unit="", span=model.span)
        for name in names
    )  # fmt: skip
    return replace(model, forces=tuple(forces), signals=tuple(signals), states=made)


def _is_open(joint: Joint) -> bool:
    return joint.cut is False and joint.guide is None and joint.element.is_measured and bool(joint.element.coordinates)
