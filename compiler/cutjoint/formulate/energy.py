"""The function ``energy`` of all formulations: kinetic energy T (J), and the power P (W) of all that changes it.

Without errors T grows as fast as P says.  Weight, applied forces, guides and drives have power; constraints that hold still have none, and
what penalties and stabilisation of loops bring in is an error, so that P leaves it out.
"""

from __future__ import annotations

from collections.abc import Mapping

from cutjoint.formulate.records import Slot
from cutjoint.program.blocks import Block, Builder

#: Functions that only check a run.
CHECKS = ("energy",)
#: The results of the function.
NAMES = ("kinetic", "power")


def energy_results(b: Builder, kinetic: Block, power: Block) -> dict[str, Block]:
    """The results of the function, (1, 1) each."""
    return {"energy:kinetic": b.label(kinetic, "kinetic_energy"), "energy:power": b.label(power, "power")}


def energy_slots() -> Mapping[str, Slot]:
    """The places of the results."""
    return {f"energy:{name}": Slot(array="energy", offset=i, names=(name,)) for i, name in enumerate(NAMES)}
