"""Model -> what the explanation of a Lagrangian formulation is about."""

from __future__ import annotations

from dataclasses import dataclass

from cutjoint.analysis.natural import closed_states, dependent_equations
from cutjoint.compile.systems import plan_system
from cutjoint.formulate.natural.equations import LagrangianEquations, formulate_lagrangian, without
from cutjoint.formulate.natural.layout import Group
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.methods import METHODS
from cutjoint.model.records import Body, Model, Scene
from cutjoint.program.records import Program
from cutjoint.sparse.plan import Plan
from cutjoint.topology.build import build_topology


@dataclass(frozen=True, kw_only=True)
class Derivation:
    """A system in natural coordinates as the compiler derives it.

    ``full`` has every equation, ``equations`` those that the method holds: ``classical`` leaves out the ``dependent`` ones, which follow
    from the others in every pose.
    """

    full: LagrangianEquations
    equations: LagrangianEquations
    dependent: tuple[str, ...]
    program: Program
    plan: Plan

    @property
    def model(self) -> Model:
        """The model."""
        return self.full.topology.model

    @property
    def rank(self) -> int:
        """The number of independent equations."""
        return len(self.full.equation_names) - len(self.dependent)

    def bodies(self, group: Group) -> tuple[Body, ...]:
        """The bodies of a group, in the model's order."""
        return tuple(body for body in self.model.bodies if body.name in group.bodies)

    def is_held(self, equation: str) -> bool:
        """Return whether the method holds an equation, by its full name."""
        return equation in self.equations.equation_names


def derive_natural(model: Model, scene: Scene, method: str) -> Derivation:
    """The system of a model in a scene, by "augmented" or "classical".

    Raises:
        TopologyError: the model's own cuts cannot be honoured.
        ModelError: an output or a force that natural coordinates do not determine.
        RunError, MissingLibraryError: as for plan_system.
    """
    # Model -> Equations
    full = formulate_lagrangian(formulate_recursive(build_topology(model), scene, ()), method, scene.outputs)
    states = closed_states(full)
    dependent = dependent_equations(full, states)
    # Equations -> Program -> Plan
    equations, program = plan_system(without(full, dependent if METHODS[method].saddle_point else ()), states, lanes=False)
    assert equations.plan is not None
    return Derivation(full=full, equations=equations, dependent=dependent, program=program, plan=equations.plan)
