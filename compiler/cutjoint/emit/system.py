"""Programs of a method with a tangent -> C++ files: the system, and the mechanism that starts its runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from cutjoint.emit.factorisation import STRAIGHT_LINE, emit_factorisation
from cutjoint.emit.source import Page, Source, description, mechanism_files, members, project_files, switches_of, system_class
from cutjoint.emit.view import Viewer
from cutjoint.formulate.records import SystemEquations
from cutjoint.program.records import Program
from cutjoint.sparse.pattern import Pattern
from cutjoint.sparse.plan import Plan

_ABOUT = {
    "initial_coordinates": "The system's coordinates and their rates from relative coordinates and speeds.",
    "dynamic_residual": "M vdot + Phi_q^T (penalty Phi + lambda) - Q, and Phi.",
    "linearise": "The same, and the entries of the tangent.",
    "constraint_residual": "Phi, Phid = Phi_q v + Phi_t, and Phidd.",
    "apply_jacobian_transposed": "Phi_q^T w.",
    "apply_jacobian": "Phi_q x.",
    "report": "The reported columns.",
    "energy": "Kinetic energy, and the power of all forces, guides and drives.",
    "guard": "The smallest margin of each force that was left out: negative where it would act.",
    "events": "The values of the switches, at whose changes of sign formulas change.",
    "scene_inputs": "The scene's inputs: value, rate and acceleration of each, then what its laws are watched by.",
    "domains": "The margins of the arguments of laws: negative where a law has no value.",
}


def emit_system(
    start: Program, program: Program, equations: SystemEquations, plan: Plan, *, straight_line: int = STRAIGHT_LINE
) -> Source:
    """The C++ of a system: class, factorisation, starting mechanism, main program and CMake project.

    A factorisation of more multiply-adds than ``straight_line`` is index data and a loop.
    """
    page = Page.of(equations.start, "recursive, for the start")
    mechanism = mechanism_files(page, start, equations.start)
    inner = replace(page, class_name=system_class(page.class_name), formulation=equations.method)
    files = _system_files(inner, program, equations, plan)
    files |= emit_factorisation(plan, equations.row_names, inner, straight_line=straight_line)
    headers = {"start_header": f"{page.header}.hpp", "header": f"{_header(inner)}.hpp"}
    main = inner.render("lagrangian_main.cpp.jinja", start_class_name=page.class_name, **headers)
    return inner.source({**mechanism, **files, "main.cpp": main, **project_files(inner, mechanism, files)})


def _header(page: Page) -> str:
    return f"{page.stem}_system"


def _system_files(page: Page, program: Program, equations: SystemEquations, plan: Plan) -> dict[str, str]:
    viewer, header = Viewer(program, equations), _header(page)
    names = [f.name for f in equations.functions]
    functions = page.functions(viewer, names, header=header)
    files = {f"system_{name}": text for name, text in functions.items()}
    files[f"{header}.hpp"] = render_class(page, viewer, program, equations, names)
    lists = [("coordinates", equations.coordinate_names), ("equations", equations.equation_names)]
    files["system_description.cpp"] = page.render(
        "system_description.cpp.jinja", header=header, method=equations.method.replace("-", "_"), **_relative(equations),
        pattern=pattern_view(plan.pattern, equations.row_names), **description(equations, lists),
    )  # fmt: skip
    return files


def render_class(
    page: Page, viewer: Viewer, program: Program, equations: SystemEquations, names: Sequence[str], **view: object
) -> str:
    """The class of a system with the functions of these names."""
    return page.render(
        "system.hpp.jinja", summary=f"Model {page.stem}, formulation {equations.method}.",
        functions=[
            {"name": name, "about": _ABOUT[name], "operations": program.operations(name), "arguments": equations.function(name).arguments}
            for name in names
        ],
        **members(viewer, equations), **view,
    )  # fmt: skip


def _relative(equations: SystemEquations) -> dict[str, object]:
    """The part of the description that systems in relative coordinates alone have."""
    speeds = {"field": "speeds", "names": equations.speed_names}
    return {"charts": equations.charts, "speed_lists": [speeds] if equations.charts else [], "switches": switches_of(equations)}


def pattern_view(pattern: Pattern, names: Sequence[str]) -> dict[str, object]:
    """The view of a pattern for the templates; ``names`` has one for each column."""
    columns = [
        {"name": name, "entries": pattern.row[pattern.first[j] : pattern.first[j + 1]]} for j, name in enumerate(names)
    ]  # fmt: skip
    return {"size": pattern.size, "symmetric": pattern.symmetric, "first": pattern.first, "columns": columns}
