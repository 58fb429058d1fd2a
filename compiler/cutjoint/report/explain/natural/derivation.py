"""Model -> what the explanation of a Lagrangian formulation is about, and the forms of nodes as text."""

from dataclasses import dataclass

import sympy

from cutjoint.analysis.natural import closed_states, dependent_equations
from cutjoint.compile.systems import plan_system
from cutjoint.formulate.natural.equations import LagrangianEquations, formulate_lagrangian, without
from cutjoint.formulate.natural.layout import Group
from cutjoint.formulate.natural.nodes import Form, Node, NodeKind
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.methods import METHODS
from cutjoint.model.records import Body, Model, Scalar, Scene, Vector
from cutjoint.program.records import Program
from cutjoint.report.explain.latex import place, text
from cutjoint.report.explain.views import code
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


#: The rounding of a zero among coordinates in the design position, in m, and among coefficients.
_ROUNDING = 1e-13

#: A coefficient with more letters is not printed.
_LONG = 100


def form_text(form: Form, model: Model) -> str:
    """A combination as one piece of code: `hinge + 0.97*axis - 0.5*tip`."""
    coefficients = {node: _as_fraction(clean(c)) for node, c in form.items()}
    terms = " ".join(_term(c, node.name, model) for node, c in coefficients.items() if c != 0)
    return code(terms[2:] if terms.startswith("+") else f"-{terms[2:]}") if terms else "0"


def _term(e: Scalar, name: str, model: Model) -> str:
    sign = "-" if e.could_extract_minus_sign() else "+"
    factor = text(-e if sign == "-" else e, model).strip("`")
    if factor == "1":
        return f"{sign} {name}"
    if len(factor) > _LONG:
        return f"+ ({sympy.count_ops(e)} operations)*{name}"
    return f"{sign} ({factor})*{name}" if e.is_Add else f"{sign} {factor}*{name}"


def _as_fraction(e: Scalar) -> Scalar:
    """An expression as one fraction, its numerator multiplied out."""
    numerator, denominator = sympy.fraction(sympy.together(e))
    return clean(sympy.expand(numerator)) / denominator


def design_value(node: Node, model: Model) -> str:
    """A node in the design position."""
    return "0" if node.kind is NodeKind.ANGLE else clean_place(node.place, model)


def clean_place(vector: Vector, model: Model) -> str:
    """A vector without what rounding has left of zeros."""
    x, y, z = (clean(component) for component in vector)
    return place((x, y, z), model)


def clean(x: Scalar, size: float = 1.0) -> Scalar:
    """An expression without what rounding has left of a zero, whole numbers in it as such; ``size`` is that of its parts."""
    e = sympy.sympify(x)
    if e.is_number:
        return sympy.Integer(0) if abs(float(e)) < _ROUNDING * size else e
    whole = (f for f in e.atoms(sympy.Float) if abs(f) < _ROUNDING or float(f).is_integer())
    return e.xreplace({f: sympy.Integer(round(f)) for f in whole})
