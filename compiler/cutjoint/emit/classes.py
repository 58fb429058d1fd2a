"""The code of a simulation that stands alone: its programs and their C++ classes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from cutjoint.emit.factorisation import emit_factorisation
from cutjoint.emit.source import FACTORISATION, SPACE, Page, members, switches_of, system_class
from cutjoint.emit.system import pattern_view, render_class
from cutjoint.emit.view import Viewer
from cutjoint.formulate.forces import guards_of
from cutjoint.formulate.records import RecursiveEquations, SystemEquations
from cutjoint.formulate.switches import guides_jump
from cutjoint.methods import START
from cutjoint.program.records import Program
from cutjoint.sparse.plan import Plan

#: Simulations side by side: the doubles of an AVX-512 register; narrower machines take several registers.
LANES = 8

#: Functions that a simulation does not call; ``events`` only where its steps end at events, ``guard`` only of what it steps.
_UNUSED = frozenset({"domains", "energy"})


@dataclass(frozen=True, kw_only=True)
class System:
    """The system that Newton's iteration steps: its equations and program, and the plan of its factorisation."""

    equations: SystemEquations
    program: Program
    plan: Plan


@dataclass(frozen=True, kw_only=True)
class SimulationCode:
    """The code of a simulation: the mechanism, which finds its start, its program, and the system to step, None to step the mechanism
    itself.

    With the mechanism's degrees of freedom, ``freedoms``, the interface has minimal coordinates and derivatives too, and of a mechanism
    that is stepped itself values that change their sign where its formulas change.  With a program without lanes of its own,
    ``side_by_side``, a class of several instances side by side stands beside that of the mechanism, in a namespace of that name.
    """

    mechanism: RecursiveEquations
    program: Program
    system: System | None
    freedoms: int | None = None
    side_by_side: Program | None = None

    @property
    def method(self) -> str:
        """The name of the method."""
        return START if self.system is None else self.system.equations.method

    @property
    def page(self) -> Page:
        """The names and banners for all templates."""
        return Page.of(self.mechanism, self.method)

    @property
    def lanes(self) -> int:
        """The number of simulations side by side, 0 if there is no such class."""
        return 0 if self.side_by_side is None else LANES

    @property
    def stepped(self) -> RecursiveEquations | SystemEquations:
        """The equations to step, which have parameters, inputs and outputs."""
        return self.mechanism if self.system is None else self.system.equations

    @property
    def guides_jump(self) -> bool:
        """Return whether the rates of guides may jump."""
        return guides_jump(self.mechanism.topology.model, self.mechanism.scene)

    def over_events(self) -> SimulationCode:
        """Copy the code for steps that go over events; those over jumps of guides seek these by switches."""
        if self.guides_jump:
            return self
        system = self.system and replace(self.system, equations=replace(self.system.equations, switches=()))
        return replace(self, mechanism=replace(self.mechanism, switches=()), system=system)


@dataclass(frozen=True, kw_only=True)
class CppClass:
    """A generated class: its ``name``, its ``header``, its ``functions`` by file, its ``layout`` (sizes, charts, cut joints, switches,
    pattern), and the header of a ``factorisation`` that it needs."""

    name: str
    header: str
    functions: Mapping[str, str]
    layout: Mapping[str, object]
    factorisation: str = ""

    @property
    def code(self) -> list[str]:
        """The class and its functions in the order of one file."""
        return [self.header, *self.functions.values()]


def class_of_mechanism(
    parts: SimulationCode, program: Program, conditions: str = "bool", *, apart: bool, header: str = "", space: str = SPACE
) -> CppClass:
    """The class of the mechanism by a program of it, in a namespace; ``apart`` in files of their own, with the name of the ``header``
    without its ending."""
    page, equations = parts.page, parts.mechanism
    viewer = Viewer(program, equations, conditions)
    unused = _unused(parts, equations) if parts.system is None else _UNUSED | {"events", "guard"}
    if conditions == "bool" and (equations.scene.pose == "equilibrium" or equations.topology.ends_on_massless):
        unused -= {"energy"}  # of one that holds coordinates at rest or finds penalties, one instance at a time
    names = [f.name for f in equations.functions if f.name not in unused]
    layout = {
        "guides_jump": parts.guides_jump and conditions == "bool" and parts.system is None,
        "charts": equations.charts, "cuts": [c.first for c in equations.closures], "switches": switches_of(equations), **sizes_of(equations)
    }  # fmt: skip
    how = {"core": True, "apart": apart, "space": space}
    described = page.render(
        "mechanism.hpp.jinja", summary=f"Model {page.stem}, formulation recursive.", conditions=conditions,
        operations={name: program.operations(name) for name in names}, **members(viewer, equations), **layout, **how,
    )  # fmt: skip
    functions = dict(sorted(page.functions(viewer, names, header=header, **how).items()))
    return CppClass(name=page.class_name, header=described, functions=functions, layout=layout)


def class_of_system(parts: SimulationCode, system: System, *, apart: bool, header: str = "") -> CppClass:
    """The class of the system, and its factorisation; as above."""
    equations, program, plan = system.equations, system.program, system.plan
    page = replace(parts.page, class_name=system_class(parts.page.class_name))
    viewer = Viewer(program, equations)
    names = [f.name for f in equations.functions if f.name not in _unused(parts, equations)]
    factorisation = emit_factorisation(plan, equations.row_names, page, apart=apart)
    needed = factorisation.pop(f"{FACTORISATION}.hpp")
    layout = {
        "guides_jump": parts.guides_jump, "charts": equations.charts, "cuts": [], "switches": switches_of(equations), **sizes_of(equations),
        "pattern": pattern_view(plan.pattern, equations.row_names),
    }  # fmt: skip
    how = {"core": True, "apart": apart}
    described = render_class(page, viewer, program, equations, names, **layout, **how)
    functions = dict(sorted(page.functions(viewer, names, header=header, **how).items()))
    return CppClass(name=page.class_name, header=described, functions=functions | factorisation, layout=layout, factorisation=needed)


def _unused(parts: SimulationCode, equations: RecursiveEquations | SystemEquations) -> frozenset[str]:
    """Functions of the stepped class that nobody calls; impacts have the masses of relative coordinates from its energy."""
    needed = {"energy"} if parts.guides_jump and equations.charts else set()
    return (_UNUSED | (frozenset() if equations.switches else {"events"})) - needed


def sizes_of(equations: RecursiveEquations | SystemEquations) -> dict[str, dict[str, int]]:
    """The sizes that a class declares."""
    return {"sizes": {
        "coordinates": len(equations.coordinate_names), "speeds": len(equations.speed_names), "equations": len(equations.equation_names),
        "cuts": len(equations.mechanism.closures), "parameters": len(equations.parameters), "inputs": len(equations.inputs),
        "roads": len(equations.roads), "columns": len(equations.columns),
        "guards": len(guards_of(equations.topology.model, equations.scene)), "switches": len(equations.switches),
    }}  # fmt: skip
