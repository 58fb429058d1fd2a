"""Programs -> C++ classes of mechanisms and systems, for simulators, libraries and C exports; and initial settings."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from textwrap import wrap
from typing import Any

from cutjoint.emit import source
from cutjoint.emit.factorisation import STRAIGHT_LINE, emit_factorisation
from cutjoint.emit.names import road_names
from cutjoint.emit.source import Page, Piece
from cutjoint.emit.view import LINE, FunctionView, Viewer
from cutjoint.formulate.events import guides_jump
from cutjoint.formulate.forces import guards_in
from cutjoint.formulate.records import CLOSE, POSES, Equations, RecursiveEquations, SystemEquations
from cutjoint.formulate.recursive.quantities import posed_elements
from cutjoint.formulate.states import describe_controllers
from cutjoint.formulate.transposed import Derived, Linearised
from cutjoint.methods import START
from cutjoint.model.expressions.functions import signatures_of
from cutjoint.program.blocks import BindingTime
from cutjoint.program.records import Program
from cutjoint.sparse.pattern import Pattern
from cutjoint.sparse.plan import Plan

LANES = "cutjoint::Lanes<double, cutjoint::doubles_of_register>"  #: simulations side by side: as many as a register has doubles
MOST_LANES = 8  #: at most, and a multiple of their number on any machine

#: Comments of the functions that store values of a stage.
_STAGES = {
    "load": "Values that depend on parameters alone; the roads must outlive the class.",
    "load_values": "Values that depend on parameters alone, with coefficients of the loop embeddings.",
    "begin_step": "Values that depend on time.",
    "start_step": "Values that depend on time and on inputs.",
}

#: Comments of the other functions.
_ABOUT = {
    "evaluate": "Accelerations for given multipliers, and the correction that the augmented update adds to these.",
    "project": "The step of the speeds' integrals that removes violations of the cut joints with the least mass-weighted norm.",
    "initial_coordinates": "The system's coordinates and their rates from relative coordinates and speeds.",
    "dynamic_residual": "M vdot + Phi_q^T (penalty Phi + lambda) - Q, and Phi.",
    "linearise": "The same, and the entries of the tangent.",
    "constraint_residual": "Residual of the closing equations and its derivatives.",
    "apply_jacobian_transposed": "Phi_q^T w.",
    "apply_jacobian": "Phi_q x.",
    "report": "The reported columns.",
    "aims": "What is left to the conditions of a trimmed start, besides rates of zero.",
    "energy": "Kinetic energy, and, unless vdot is v itself, the power of all forces, guides and drives.",
    "sample": "The next discrete states of controllers.",
    POSES: "Position, rotation by columns, velocity, angular velocity and design point of each body, marker and contact.",
    "guard": "The smallest margin of each force that was left out: negative where it would act.",
    "events": "The event indicators, at whose changes of sign formulas change.",
    "scene_inputs": "The scene's inputs: value, rate and acceleration of each, then what its laws are watched by.",
    "domains": "The margins of the arguments of laws: negative where a law has no value.",
    "residual_jacobian": "The derivatives of the residual of forces and loops, row by row; those that are always zero are not written.",
    "residual_by_time": "Derivatives of the same residual with respect to the time that it depends on explicitly.",
    "loaded_values": "Values that depend on parameters alone, by which the residual has derivatives.",
}

#: Comments of transposed functions, by their endings.
_TRANSPOSED = {
    "transposed": "Derivatives by the arguments of {}, from those by its results.",
    "summed": "Derivatives by what {} follows from besides, from those by its results.",
}

#: Functions that a simulation never calls; ``events`` only if its steps end at events, ``guard`` only on the stepped class.
_UNUSED = frozenset({"domains", "energy"})


@dataclass(frozen=True, kw_only=True)
class System:
    """The system that Newton's iteration steps: its equations and program, and the plan of its factorisation."""

    equations: SystemEquations
    program: Program
    plan: Plan


@dataclass(frozen=True, kw_only=True)
class SimulationCode:
    """The code of a simulation: the mechanism, which finds its start, its program, and the system to step, None for the mechanism.

    With the mechanism's degrees of freedom, ``dofs``, the interface has minimal coordinates and derivatives too, and event indicators if
    the mechanism itself is stepped. With ``derives_steps`` it has forward sensitivities of steps where these are differentiable, with
    ``transposed`` functions adjoint ones too; accelerations have those of the ``force_residual``. With a program without lanes of
    its own, ``side_by_side``, a class of several instances side by side stands beside that of the mechanism, in a namespace of that name.
    """

    mechanism: RecursiveEquations
    program: Program
    system: System | None
    dofs: int | None = None
    derives_steps: bool = True
    side_by_side: Program | None = None
    transposed: Derived | None = None
    force_residual: Linearised | None = None

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
        """The largest number of simulations side by side, 0 if there is no such class."""
        return 0 if self.side_by_side is None else MOST_LANES

    @property
    def poses(self) -> tuple[str, ...]:
        """The names of elements whose poses the interface has."""
        has_them = any(f.name == POSES for f in self.mechanism.functions)
        return posed_elements(self.mechanism.topology.model) if has_them else ()

    @property
    def stepped(self) -> RecursiveEquations | SystemEquations:
        """The equations to step, which have parameters, inputs and outputs."""
        return self.mechanism if self.system is None else self.system.equations

    @property
    def guides_jump(self) -> bool:
        """Return whether the rates of guides may jump."""
        return guides_jump(self.mechanism.topology.model, self.mechanism.scene)

    def over_events(self) -> "SimulationCode":
        """Copy the code for steps that cross events; at jumps of guides, events are located by indicators."""
        if self.guides_jump:
            return self
        system = self.system and replace(self.system, equations=replace(self.system.equations, indicators=()))
        return replace(self, mechanism=replace(self.mechanism, indicators=()), system=system)


@dataclass(frozen=True, kw_only=True)
class Defaults:
    """The initial settings, parameters and start of a simulation without a run file, in SI units.

    ``closure`` to ``frequency`` belong to cut joints of the recursive equations, ``dt`` to ``spectral_radius`` to steps; a penalty of None
    follows from masses or is determined by the run. ``pose`` is that of the scene. ``positions`` and ``rates`` are by "joint.component",
    ``roads`` by tyres: the pieces "left" and "right", and whether the contact is a "disc"; ``surface`` is on all. ``near`` names positions
    that are only initial guesses.
    """

    integrator: str
    closure: str
    closure_penalty: float | None
    damping_ratio: float
    frequency: float
    dt: float
    penalty: float | None
    tolerance: float
    iterations: int
    multiplier_updates: int
    fixed_cost: bool
    events: bool | None
    absolute_tolerance: float | None
    spectral_radius: float | None
    end: float
    output_step: float
    pose: str
    parameters: Mapping[str, float]
    positions: Mapping[str, float]
    rates: Mapping[str, float]
    roads: Mapping[str, Mapping[str, Any]]
    surface: Mapping[str, Any] | None
    near: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class CppClass:
    """A generated class; ``functions`` are by file.
    ``layout``: sizes, charts, cut joints, indicators, pattern. ``factorisation``: the header of the one that it needs."""

    name: str
    header: Piece
    functions: Mapping[str, Piece]
    layout: Mapping[str, object] = field(default_factory=dict)
    factorisation: Piece | None = None

    @property
    def code(self) -> list[str]:
        """The class and its functions in the order of one file."""
        return [self.header.text, *(piece.text for piece in self.functions.values())]

    def sized(self, page: Page, space: str = "") -> str:
        """A class that knows its layout too, as a simulation needs it; ``space`` is the namespace of this one within `generated`."""
        base = "::".join(filter(None, ("generated", space, self.name)))
        return page.render("sized.hpp.jinja", **self.layout, class_name=self.name, base=base, summary="The same, with its layout.")


def computes_energy(parts: SimulationCode) -> bool:
    """Return whether a mechanism computes its kinetic energy, which starts at equilibrium, massless bodies and mass matrices need."""
    equations = parts.mechanism
    return equations.scene.pose == "equilibrium" or equations.topology.ends_on_massless or bool(parts.dofs and parts.poses)


def sized_mechanism_class(parts: SimulationCode, program: Program, conditions: str = "bool", *, header: str = "") -> CppClass:
    """The class of the mechanism with its layout, by a program of it; ``header`` names its file, without the ending, where it has one."""
    equations = parts.mechanism
    unused = _unused(parts, equations) if parts.system is None else _UNUSED | {"events", "guard", "sample"}
    if conditions == "bool" and computes_energy(parts):
        unused -= {"energy"}  # of one instance at a time
    if conditions != "bool":
        unused |= {POSES, "aims"}
    layout = {
        "guides_jump": parts.guides_jump and conditions == "bool" and parts.system is None,
        "charts": equations.charts, "cuts": [c.first for c in equations.closures], "indicators": source.indicators_of(equations),
        **sizes_of(equations)
    }  # fmt: skip
    return replace(mechanism_class(parts.page, program, equations, conditions, unused=unused, header=header), layout=layout)


def mechanism_class(
    page: Page, program: Program, equations: RecursiveEquations, conditions: str, *, unused: frozenset[str] = frozenset(), header: str
) -> CppClass:
    """The class of a mechanism without its layout, and without functions that are ``unused``."""
    return _class(page, program, equations, conditions, formulation="recursive", unused=unused, headers=[f"{header}.hpp"])


def derived_classes(parts: SimulationCode, *, header: str = "{}") -> Iterator[tuple[str, CppClass]]:
    """The classes of the mechanism's derivatives, by names; ``header`` makes the names of their files of these, without the ending."""
    page = parts.page
    for name, named in (("transposed", source.name_of_transposed), ("force_residual", source.name_of_residual)):
        if (derived := getattr(parts, name)) is not None:
            yield name, _class(
                replace(page, class_name=named(page.class_name)), derived.program, derived.equations, "bool", formulation="recursive",
                unused=frozenset(), headers=[f"{header.format(name)}.hpp"],
            )  # fmt: skip


def sized_system_class(parts: SimulationCode, system: System, *, header: str = "") -> CppClass:
    """The class of the system, and its factorisation; as above."""
    equations, plan = system.equations, system.plan
    layout = {
        "guides_jump": parts.guides_jump, "charts": equations.charts, "cuts": [], "indicators": source.indicators_of(equations),
        **sizes_of(equations),
        "pattern": pattern_view(plan.pattern, equations.row_names), "pivot_columns": plan.tiling.elimination.columns,
    }  # fmt: skip
    made = system_class(parts.page, system, unused=_unused(parts, equations), header=header)
    return replace(made, layout=layout)


def system_class(
    page: Page, system: System, *, unused: frozenset[str] = frozenset(), header: str, straight_line: int = STRAIGHT_LINE
) -> CppClass:
    """The class of a system without its layout, and its factorisation; with more multiply-adds than ``straight_line`` it is a loop."""
    equations = system.equations
    page = replace(page, class_name=source.name_of_system(page.class_name), formulation=equations.method)
    factorisation = emit_factorisation(system.plan, equations.row_names, page, straight_line=straight_line)
    needed = factorisation.pop(f"{source.FACTORISATION}.hpp")
    made = _class(
        page, system.program, equations, "bool", formulation=equations.method, unused=unused, headers=[f"{header}.hpp"],
        needs=[f"{source.FACTORISATION}.hpp"],
    )  # fmt: skip
    return replace(made, functions={**made.functions, **factorisation}, factorisation=needed)


def _class(
    page: Page, program: Program, equations: Equations, conditions: str, *, formulation: str, unused: frozenset[str],
    headers: Sequence[str], needs: Sequence[str] = (),
) -> CppClass:  # fmt: skip
    viewer = Viewer(program, equations, conditions)
    names = [f.name for f in equations.functions if f.name not in unused]
    views = {viewer.load_name: viewer.load(), viewer.step_name: viewer.step(), **{name: viewer.function(name) for name in names}}
    records, lane_types = records_of(viewer), viewer.lane_types()
    roads = [{"name": name, "index": i} for i, name in enumerate(road_names(equations.roads).values())]
    supplied = [text for f in equations.topology.model.functions for text in signatures_of(f).values()]
    text = page.render(
        "class.hpp.jinja", summary=f"Model {page.stem}, formulation {formulation}.", conditions=conditions, is_factorised=bool(needs),
        functions=[{"about": describe_function(name, program), "declaration": view.declaration} for name, view in views.items()],
        arrays=_arrays(equations), records=records, lane_types=lane_types, roads=roads, input_values=equations.input_values,
        supplied=supplied, fits=_fits(program, equations),
        has_members=bool(records or lane_types or roads or equations.input_values),
    )  # fmt: skip
    runtime = {
        "mechanism/contract": True, "inputs/inputs": equations.input_values, "mechanism/loop_fits": equations.fits,
        "numbers/lanes": lane_types, "roads/road": roads, "mechanism/supplied": supplied,
    }  # fmt: skip
    return CppClass(
        name=page.class_name,
        header=Piece(text=text, headers=(*(f"cutjoint/core/{name}.hpp" for name, needed in runtime.items() if needed), *needs)),
        functions={f"{name}.cpp": _function(page, view, headers) for name, view in sorted(views.items())},
    )


def _arrays(equations: Equations) -> list[str]:
    """The arrays of the arguments with their lengths and units, a line each; only those that have numbers."""
    state, is_relative = equations.state, isinstance(equations, RecursiveEquations) or bool(equations.charts)
    turned = ", quaternions" if any(chart.ball for chart in equations.charts) else ""
    states = f", the last {len(state.states)} of them first-order states" if state.states else ""
    discrete = "discrete states, then " if equations.discrete_states else ""
    lines = {
        f"q[{len(state.q)}]": f"coordinates of joints: m, rad{turned}" if is_relative else "points (m), unit vectors and angles (rad)",
        f"v[{len(state.v)}]": f"speeds: m/s, rad/s{states}; vdot has their rates of change, dz, force and force_residual one for each",
        f"lambda[{len(state.equations)}]": "multipliers of closing equations: N, N*m; residual, rate and violation have one for each",
        f"column[{len(equations.columns)}]": "outputs, in the units of the description",
        f"parameters[{len(equations.parameters)}]": "tunable parameters, in SI units",
        f"input[{equations.input_values}]": f"of each input value, rate and acceleration, then {discrete}values by which laws are watched",
        f"next_discrete[{equations.discrete_states}]": "next discrete states, in SI units",
    }  # fmt: skip
    used = {name: words for name, words in lines.items() if not name.endswith("[0]")}
    width = max(map(len, used), default=0)
    return [f"{name:<{width}}  {words}" for name, words in used.items()]


def fitted_parameters(program: Program) -> list[int]:
    """The indices of the parameters on which fitted loop embeddings depend."""
    closing = [program.graph.nodes[n].data for f in program.functions if f.name.startswith(CLOSE) for n in f.statements]
    return sorted({symbol[1] for symbol in closing if isinstance(symbol, tuple) and str(symbol[0]).startswith("fitted:")})


def _fits(program: Program, equations: Equations) -> dict[str, object] | None:
    if not equations.fits:
        return None
    described, names = [fit.description() for fit in equations.fits], [a.rpartition(" ")[2] for a in equations.load_arguments]
    lines = [", ".join(map(repr, function)) + "," for d in described for function in d["start"]]
    return {
        "independents": ", ".join(fit.embedded_loop.independent for fit in equations.fits),
        "loops": [
            f".rows = {d['rows']}, .functions = {len(d['start'])}, .nodes = {d['nodes']}, .is_periodic = {str(d['is_periodic']).lower()}, "
            f".middle = {d['middle']!r}, .half = {d['half']!r}, .allowed = {d['allowed']!r}" for d in described
        ],
        "functions": [
            f"{{.terms = {len(c)}, .growth = {growth!r}}}" for d in described for c, growth in zip(d["start"], d["growth"], strict=True)
        ],
        "start": [line for text in lines for line in wrap(text, LINE)], "parameters": ", ".join(map(str, fitted_parameters(program))),
        "length": sum(fit.length for fit in equations.fits), "arguments": ", ".join(equations.load_arguments), "passed": ", ".join(names),
    }  # fmt: skip


def records_of(viewer: Viewer) -> list[dict[str, object]]:
    """The records of stored values."""
    stages = ((BindingTime.PARAM, "Loaded", "loaded_", "parameters alone"), (BindingTime.STEP, "Step", "step_", "time and inputs"))
    return [
        {"type": kind, "name": name, "by": by, "members": members}
        for binding, kind, name, by in stages
        if (members := viewer.members(binding))
    ]  # fmt: skip


def describe_function(name: str, program: Program) -> str:
    """The comment of a function."""
    if name.startswith(CLOSE):
        return f"Residual of a block of loops, and its derivatives by q and by each function.  {program.operations(name)} operations."
    if name in _STAGES:
        return _STAGES[name]
    function, _, ending = name.rpartition("_")
    about = _ABOUT[name] if name in _ABOUT else _TRANSPOSED[ending].format(function)
    return f"{about}  {program.operations(name)} operations."


def _function(page: Page, view: FunctionView, headers: Sequence[str]) -> Piece:
    text = page.render(
        "function.cpp.jinja", signature=view.signature, arrays=view.arrays, sections=view.sections, results=view.results,
        using=[f"std::{name}" for name in view.calls],
    )  # fmt: skip
    return Piece(
        text=text, standard=("cmath",) if view.calls else (), headers=(*headers, "cutjoint/precision.hpp"),
        instances=(f"template void {page.class_name}<Precision>::{view.instance};",),
    )  # fmt: skip


def _unused(parts: SimulationCode, equations: RecursiveEquations | SystemEquations) -> frozenset[str]:
    """Functions of the stepped class that nothing calls; impacts take the masses of relative coordinates from its energy."""
    needed = {"energy"} if parts.guides_jump and equations.charts else set()
    return (_UNUSED | (frozenset() if equations.indicators else {"events"})) - needed


def sizes_of(equations: RecursiveEquations | SystemEquations) -> dict[str, object]:
    """The sizes that a class declares, and its controllers where it has some."""
    states, controllers = len(equations.state.states), equations.topology.model.controllers
    nominals = source.nominals_of(equations)
    return {"sizes": {
        "coordinates": len(equations.coordinate_names), "speeds": len(equations.speed_names), "equations": len(equations.equation_names),
        "cuts": len(equations.mechanism.closures), "parameters": len(equations.parameters), "inputs": len(equations.inputs),
        "roads": len(equations.roads), "columns": len(equations.columns),
        "guards": len(guards_in(equations)), "indicators": len(equations.indicators),
        **({"states": states} if states else {}),
        **({"controllers": len(controllers), "discrete": equations.discrete_states} if controllers else {}),
    }, **({"samples": describe_controllers(equations)} if controllers else {}), **({"nominals": nominals} if nominals else {}),
        **({"arm": arm} if (arm := equations.topology.arm) != 1 else {})}  # fmt: skip


def pattern_view(pattern: Pattern, names: Sequence[str]) -> dict[str, object]:
    """The view of a pattern for the templates; ``names`` has one for each column."""
    columns = [{"name": name, "entries": pattern.row[pattern.first[j] : pattern.first[j + 1]]} for j, name in enumerate(names)]
    return {"size": pattern.size, "symmetric": pattern.symmetric, "first": pattern.first, "columns": columns}
