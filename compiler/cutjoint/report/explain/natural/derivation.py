"""Model -> what the explanation of a Lagrangian formulation is about."""

from __future__ import annotations

from dataclasses import dataclass

from cutjoint.analysis.natural import closed_states, dependent_equations
from cutjoint.formulate.natural.equations import formulate_lagrangian
from cutjoint.formulate.natural.layout import Group
from cutjoint.formulate.natural.records import LagrangianEquations
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.model.records import Body, Model, Scene
from cutjoint.program.records import Program
from cutjoint.program.schedule import schedule
from cutjoint.sparse.pattern import Pattern
from cutjoint.sparse.tangent import settle_entries
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
    pattern: Pattern

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
        """Whether the method holds an equation, by its full name."""
        return equation in self.equations.equation_names


def derive_natural(model: Model, scene: Scene, method: str) -> Derivation:
    """The system of a model in a scene, by "augmented" or "classical".

    Raises:
        TopologyError: the model's own cuts cannot be honoured.
        ModelError: an output or a force that natural coordinates do not tell.
    """
    # Model -> Equations
    start = formulate_recursive(build_topology(model), scene, ())
    full = formulate_lagrangian(start, method, scene.outputs)
    dependent = dependent_equations(full, closed_states(full))
    left_out = dependent if method == "classical" else ()
    equations = formulate_lagrangian(start, method, scene.outputs, left_out=left_out) if left_out else full
    # Equations -> Program
    program = schedule(equations.builder, [(f.name, f.results) for f in equations.functions])
    unknowns = len(equations.coordinate_names) + (len(equations.equation_names) if method == "classical" else 0)
    program, pattern = settle_entries(program, unknowns, symmetric=method == "augmented")
    return Derivation(full=full, equations=equations, dependent=dependent, program=program, pattern=pattern)
