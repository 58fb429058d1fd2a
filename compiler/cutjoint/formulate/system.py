"""Functions of systems that Newton's iteration solves, in whatever coordinates: runtime/include/cutjoint/lagrangian/system.hpp.

The function ``energy`` of all formulations has the kinetic energy T (J), and the power P (W) of all that changes it.  Without errors T
grows as fast as P says.  Weight, applied forces, guides and drives have power; constraints that hold still have none, and the power of
penalties and stabilisation of loops is an error, so that P leaves it out.
"""

from __future__ import annotations

from collections.abc import Mapping

from cutjoint.formulate.records import Function, Slot
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


_STATE = ("const Real* q", "const Real* v", "const Real* vdot")
_MOTION = (*_STATE, "const Real* lambda", "Real penalty")
_RESIDUALS = ("Real* force_residual", "Real* residual")

#: The arguments of each function, results last.
_ARGUMENTS: Mapping[str, tuple[str, ...]] = {
    "initial_coordinates": ("const Real* relative_q", "const Real* relative_v", "Real* q", "Real* v"),
    "dynamic_residual": (*_MOTION, *_RESIDUALS),
    "linearise": (*_MOTION, "const Weights<Real>& weights", *_RESIDUALS, "Real* tangent"),
    "constraint_residual": (*_STATE, "Real* residual", "Real* rate", "Real* curvature"),
    "apply_jacobian_transposed": ("const Real* q", "const Real* w", "Real* force"),
    "apply_jacobian": ("const Real* q", "const Real* vdot", "Real* change"),
    "report": (*_STATE, "const Real* lambda", "Real* column"),
    "energy": (*_STATE, "const Real* lambda", "Real* energy"),
}

#: The arguments of the generated ``load``.
LOAD_ARGUMENTS = ("const Real* parameters", "const Road<Real>* roads")

#: The arrays that have an element for each equation.
EQUATION_ARRAYS = ("lambda", "w", "residual", "rate", "curvature", "change")


def system_functions(
    *, initial_coordinates: Mapping[str, Block], dynamic_residual: Mapping[str, Block], tangent: Mapping[str, Block],
    constraint_residual: Mapping[str, Block], apply_jacobian_transposed: Mapping[str, Block], apply_jacobian: Mapping[str, Block],
    report: Mapping[str, Block], energy: Mapping[str, Block],
) -> tuple[Function, ...]:  # fmt: skip
    """The functions with their results; ``linearise`` has those of the dynamic residual and of the tangent."""
    results = {
        "initial_coordinates": initial_coordinates, "dynamic_residual": dynamic_residual, "linearise": {**dynamic_residual, **tangent},
        "constraint_residual": constraint_residual, "apply_jacobian_transposed": apply_jacobian_transposed,
        "apply_jacobian": apply_jacobian, "report": report, "energy": energy,
    }  # fmt: skip
    return tuple(Function(name=name, arguments=arguments, results=results[name]) for name, arguments in _ARGUMENTS.items())
