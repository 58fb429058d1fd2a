"""Program -> the C++ files of a simulator of the command line: classes, descriptions, main program and CMake project."""

from collections.abc import Mapping, Sequence

from cutjoint.emit.classes import System, mechanism_class, pattern_view, system_class
from cutjoint.emit.factorisation import STRAIGHT_LINE
from cutjoint.emit.source import FACTORISATION, Page, Piece, Source, code_file, compiled, indicators_of, nominals_of, quotable
from cutjoint.formulate.events import guides_jump
from cutjoint.formulate.forces import guards_in
from cutjoint.formulate.records import LeftOut, RecursiveEquations, SystemEquations
from cutjoint.formulate.states import describe_controllers
from cutjoint.model.records import EmbeddedLoop, Guard, Parameter
from cutjoint.program.records import Program

_DESCRIPTION = "description"


def emit(program: Program, equations: RecursiveEquations) -> Source:
    """The simulator of a mechanism.
    Scenes that differ in road, parameters or initial state only have the same source, and so share a binary."""
    page = Page.of(equations, "recursive")
    files = _mechanism_files(page, program, equations)
    main = _main(page, [f"{page.header}.hpp"], "recursive", running=f"GeneratedMechanism<generated::{page.class_name}<Precision>>")
    return page.source({**files, **main, **_project(page, "recursive", files)}, driver="recursive")


def emit_system(start: Program, system: System, *, straight_line: int = STRAIGHT_LINE) -> Source:
    """The simulator of a system and of the mechanism that starts its runs.
    A factorisation of more multiply-adds than ``straight_line`` is index data and a loop."""
    equations = system.equations
    page, header = Page.of(equations.start, equations.method), f"{equations.topology.model.name}_system"
    mechanism = _mechanism_files(Page.of(equations.start, "recursive, for the start"), start, equations.start)
    made = system_class(page, system, header=header, straight_line=straight_line)
    more = {
        "method": equations.method.replace("-", "_"), "factors": system.plan.storage.length,
        "pattern": pattern_view(system.plan.pattern, equations.row_names),
    }  # fmt: skip
    described = emit_description(page, describe(equations), f"system_{_DESCRIPTION}", system=more)
    assert made.factorisation is not None
    functions = {f"system_{name}": piece for name, piece in made.functions.items()}
    headers = {f"{header}.hpp": made.header, f"{FACTORISATION}.hpp": made.factorisation}
    files = page.files({**headers, **functions, f"system_{_DESCRIPTION}.cpp": described})
    running = f"GeneratedSystem<generated::{made.name}<Precision>>"
    main = _main(page, [f"{page.header}.hpp", f"{header}.hpp"], "lagrangian", running=running)
    return page.source({**mechanism, **files, **main, **_project(page, "lagrangian", mechanism, files)}, driver="lagrangian")


def _mechanism_files(page: Page, program: Program, equations: RecursiveEquations) -> dict[str, str]:
    made = mechanism_class(page, program, equations, "bool", header=page.header)
    described = emit_description(page, describe(equations), _DESCRIPTION)
    files = page.files({f"{page.header}.hpp": made.header, **made.functions, f"{_DESCRIPTION}.cpp": described})
    return {**files, **code_file(equations.topology.model)}


def _main(page: Page, headers: list[str], driver: str, *, running: str) -> dict[str, str]:
    return {"main.cpp": page.render("main.cpp.jinja", headers=headers, driver=driver, running=running)}


def _project(page: Page, driver: str, mechanism: Mapping[str, str], running: Mapping[str, str] | None = None) -> dict[str, str]:
    """The CMake project of a mechanism, and of the stepped class if that differs."""
    start, start_unity = compiled(page, "start", mechanism)
    sources, unity = compiled(page, "mechanism", running or {})
    project = page.render("CMakeLists.txt.jinja", driver=driver, start_sources=start, sources=sources)
    return {"CMakeLists.txt": project, **start_unity, **unity}


# The description of a mechanism or system: names with units, places in the model's file, layout


def describe(equations: RecursiveEquations | SystemEquations) -> dict[str, object]:
    """The view of a description, for templates and for the interpreter.  Natural coordinates have no names of speeds."""
    model, scene = equations.topology.model, equations.scene
    if equations.charts or isinstance(equations, RecursiveEquations):
        speeds = equations.speed_names
    else:
        speeds = equations.unknown_names if equations.state.states else ()
    return {
        "model": model.name, "charts": equations.charts, "roads": equations.roads,
        "name_lists": {
            "coordinates": equations.coordinate_names, "speeds": speeds, "equations": equations.equation_names,
        },
        "parameters": _named(equations.parameters), "inputs": _named(equations.inputs), "columns": equations.columns,
        "cuts": [c.first for c in equations.closures] if isinstance(equations, RecursiveEquations) else [],
        "driven": any(joint.guide is not None for joint in model.joints) or any(force.by_load for force in model.forces),
        "guides_jump": guides_jump(model, scene),
        "guards": [{"name": guard.name, "place": quotable(guard.span.place), **_kind(guard)} for guard in guards_in(equations)],
        "domains": [
            {
                "function": d.function, "element": d.element, "place": quotable(d.place), "strict": d.strict,
                **({} if d.remedy is None else {"remedy": d.remedy}),
            }
            for d in equations.domains
        ],
        "indicators": indicators_of(equations), "states": len(equations.state.states), "nominals": nominals_of(equations),
        "arm": equations.topology.arm,
        "controllers": [{**c, "place": quotable(str(c["place"]))} for c in describe_controllers(equations)],
    }  # fmt: skip


def _kind(guard: Guard | EmbeddedLoop | LeftOut) -> dict[str, int]:
    """The flags of a guard that is not a force's."""
    if isinstance(guard, LeftOut):
        return {"ends": 0, "left_out": 1}
    return {"ends": 1} if isinstance(guard, EmbeddedLoop) else {}


def emit_description(page: Page, view: Mapping[str, object], function: str, *, system: Mapping[str, object] | None = None) -> Piece:
    """A function that returns the description; of a ``system``, its method, pattern and length of factors too."""
    text = page.render("description.cpp.jinja", **view, system=system, function=function)
    return Piece(text=text, headers=("cutjoint/constants.hpp",))


def _named(parameters: Sequence[Parameter]) -> list[dict[str, str]]:
    return [{"name": p.name, "unit": p.unit, "value": repr(p.value)} for p in parameters]
