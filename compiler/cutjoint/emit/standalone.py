"""Program -> a C export that needs only a compiler: a C header and one C++ file, with an example and a simulator in C."""

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from itertools import accumulate, chain
from typing import Any

import sympy

from cutjoint.elements.joints import JOINTS
from cutjoint.emit import source
from cutjoint.emit.classes import LANES, Defaults, SimulationCode, derived_classes, sized_mechanism_class, sized_system_class, sizes_of
from cutjoint.emit.sizes import record_length, seed_rows, simulation_size
from cutjoint.emit.source import Page
from cutjoint.emit.statuses import FAULTS, LIMITED, STATUSES, Status
from cutjoint.formulate.forces import guards_in
from cutjoint.formulate.inputs import guided_by
from cutjoint.formulate.records import Equations, RecursiveEquations, SystemEquations
from cutjoint.formulate.recursive.quantities import digest_of_poses
from cutjoint.formulate.transposed import Linearised
from cutjoint.methods import CLOSURES, METHODS, STEPS, Formulation, Steps
from cutjoint.model.expressions.functions import SUPPLIED_FILE, functions_of_host
from cutjoint.model.ranges import count_steps
from cutjoint.model.records import Found, Scene, SolvedTrim
from cutjoint.package.locations import licence
from cutjoint.topology.geometry import extent

#: Headers of the runtime: all that a simulation needs except its integrator and lanes.
_CORE = "cutjoint/core/simulation/checked_simulation.hpp"
_TRIMMING = "cutjoint/core/simulation/trimming.hpp"
_LANES = "cutjoint/core/numbers/lanes.hpp"
_DERIVATIVES = "cutjoint/core/simulation/checked_minimal.hpp"
_STEP_DERIVATIVES = "cutjoint/core/derivatives/step_derivatives.hpp"
_ADJOINT = "cutjoint/core/derivatives/adjoint.hpp"
_DUAL_LANES = "cutjoint/core/numbers/dual_lanes.hpp"
_POSES = "cutjoint/core/mechanism/poses.hpp"
_DYNAMICS = "cutjoint/core/mechanism/dynamics.hpp"
_SUPPLIED = "cutjoint/core/mechanism/supplied.hpp"
_SURFACE_ROAD = "cutjoint/core/roads/laid_road.hpp"
_FITS = "cutjoint/core/mechanism/loop_fits.hpp"
_SIDE_BY_SIDE = "cutjoint/core/simulation/lane_simulations.hpp"

#: The headers of the standard library that the C interface needs besides those of the core.
OF_INTERFACE = ("algorithm", "cstdint", "cstring", "limits", "new", "type_traits")

#: Headers of C, which a model's must not hide.
_C_HEADERS = frozenset((
    "assert", "complex", "ctype", "errno", "fenv", "float", "inttypes", "iso646", "limits", "locale", "math", "setjmp", "signal",
    "stdalign", "stdarg", "stdatomic", "stdbool", "stddef", "stdint", "stdio", "stdlib", "stdnoreturn", "string", "tgmath", "threads",
    "time", "uchar", "wchar", "wctype",
))  # fmt: skip

#: The forms of factorisations: blocks, and loops over tables.
_FACTORISATIONS = ("cutjoint/core/newton/static_factor_blocks.hpp", "cutjoint/core/newton/static_factor.hpp")

#: Lines around the functions of a system: equal operations are gathered in registers, as for a simulator of the command line.
_BY_GCC = "#if defined(__GNUC__) && !defined(__clang__)"
_VECTORISED = (
    f'{_BY_GCC}\n#pragma GCC push_options\n#pragma GCC optimize("tree-slp-vectorize")\n#endif\n',
    f"{_BY_GCC}\n#pragma GCC pop_options\n#endif\n",
)

LARGEST_VIOLATION = 0.01  #: the largest violation of a loop in exported code, as a share of the mechanism's extent or of a radian


@dataclass(frozen=True, kw_only=True)
class Mathematics:
    """A mathematical library for exports: its ``files`` by name, and the flags of C++ that calls it and of its own C."""

    files: Mapping[str, str]
    cxx: Sequence[str]
    c: Sequence[str]


def emit_standalone(
    parts: SimulationCode, defaults: Defaults, digest: str, *, libm: Mathematics | None = None, lays_roads: bool = False
) -> dict[str, str]:  # fmt: skip
    """The files by name; ``defaults`` has the integrator and the initial settings, parameters and start, ``digest`` identifies snapshots.
    The project compiles the mathematical library ``libm`` if one is given. If the host ``lays_roads``, one more call sets the roads under
    wheels."""
    parts, view = prepare(parts, defaults, digest)
    view |= {"libm": libm, "lays_roads": lays_roads}
    page = parts.page
    p, header = page.stem, str(view["header"])
    return {
        f"{header}.h": render_header(page, view),
        f"{header}.cpp": _source(page, parts, STEPS[parts.method][defaults.integrator], view),
        "CMakeLists.txt": page.render("standalone/CMakeLists.txt.jinja", **view),
        "example.c": page.render("standalone/example.c.jinja", **_in_c(page), **view),
        f"{p}_simulator.c": page.render("standalone/simulator.c.jinja", **_in_c(page), **view),
        f"{p}.run": page.render("standalone/run.jinja", **view),
        "README.md": page.render("standalone/README.md.jinja", **view),
        "LICENSE": licence(),
        **source.code_file(parts.mechanism.topology.model),
        **({} if libm is None else libm.files),
    }


def prepare(parts: SimulationCode, defaults: Defaults, digest: str) -> tuple[SimulationCode, dict[str, object]]:
    """The code that is compiled, without events if its steps need not find them, and the templates' view of it."""
    if not defaults.events and (parts.dofs is None or parts.system is not None):
        parts = parts.over_events()
    return parts, _view(parts, defaults, digest if parts.dofs is None else f"{digest} {parts.dofs}")


def render_header(page: Page, view: Mapping[str, object]) -> str:
    """The C header."""
    return page.render("standalone/api.h.jinja", **_in_c(page), **view)


def render_interface(page: Page, view: Mapping[str, object], *, hides: bool = False, calls_of: Sequence[str] = ()) -> str:
    """The C++ of the functions that the C header declares: those of a simulation, and names by index and indices by name.
    ``hides``: what stands before is hidden, and ends before the interface. ``calls_of``: the calls that it has, by default all."""
    header, p = render_header(page, view), page.stem
    of_sim = re.findall(rf"^([\w* ]+\b{p}_(\w+)\((?:const )?{p}_sim\* .*\));$", header, re.MULTILINE)
    calls = [{"declaration": text, "name": name, "arguments": ", ".join(re.findall(r"(\w+)[,)]", text))} for text, name in of_sim
             if not calls_of or name in calls_of]  # fmt: skip
    texts = re.findall(rf"^const char\* {p}_(\w+)\(int (?:index|event)\);$", header, re.MULTILINE)
    found = re.findall(rf"^int {p}_find_(\w+)\(const char\* name\);$", header, re.MULTILINE)
    return page.render("standalone/api.cpp.jinja", calls=calls, texts=texts, found=found, hides=hides, **view)


def _in_c(page: Page) -> dict[str, object]:
    return {"banner": "\n".join(f"/* {line} */" for line in page.banner[:1])}


def _source(page: Page, parts: SimulationCode, steps: Steps, view: Mapping[str, object]) -> str:
    mechanism = sized_mechanism_class(parts, parts.program)
    code, sized = mechanism.code, [mechanism.sized(page)]
    if parts.system is not None:
        system = sized_system_class(parts, parts.system)
        assert system.factorisation is not None
        header, *functions = system.code
        before, behind = ("", "") if view.get("libm") else _VECTORISED  # GCC forgets -ffp-contract=off where a pragma changes optimisations
        code += [system.factorisation.text, header, before, *functions, behind]
        sized.append(system.sized(page))
    for _, derived in derived_classes(parts):
        code += derived.code
    has_lanes = any("Lanes<Real, " in text for text in code)
    if parts.side_by_side is not None:
        instances = sized_mechanism_class(parts, parts.side_by_side, "Mask")
        for texts, more in ((code, instances.code), (sized, [instances.sized(page, "side_by_side")])):
            texts += ["namespace side_by_side {\n", *more, "}  // namespace side_by_side\n"]
    laid = [_SURFACE_ROAD] if view["lays_roads"] and view["roads"] else []
    core = source.amalgamate([*headers_of(parts, steps, has_lanes=has_lanes), *laid, *(() if parts.system is None else _FACTORISATIONS)])
    standard = sorted({*core.standard, *OF_INTERFACE})
    return "\n".join([
        "\n".join(f"// {line}" for line in page.banner), page.render("standalone/demands.hpp.jinja", **view),
        *(f"#include <{name}>" for name in standard), "",
        *([core.top] if core.top.strip() else []), page.render("standalone/hidden.hpp.jinja", **view),
        f"namespace {page.stem}_code {{\n", core.body,
        f"namespace {source.SPACE} {{\n", *code, f"}}  // namespace {source.SPACE}\n",
        "namespace cutjoint::sized {\n", *sized, "}  // namespace cutjoint::sized\n",
        "namespace {\n", render_interface(page, view, hides=True),
    ])  # fmt: skip


def headers_of(parts: SimulationCode, steps: Steps, *, has_lanes: bool) -> list[str]:
    """The headers of the runtime that a simulation needs; ``has_lanes`` if isomorphic parts are computed side by side."""
    has_derivatives = parts.dofs is not None
    lanes = [_LANES, *([_DUAL_LANES] if has_derivatives else [])] if has_lanes else []
    poses = [] if not parts.poses else [_POSES, *([_DYNAMICS] if has_derivatives else [])]
    of_steps = [_STEP_DERIVATIVES, *([_ADJOINT] if parts.transposed is not None else [])] if parts.derives_steps else []
    derivatives = [_DERIVATIVES, *of_steps] if has_derivatives else []
    more = [*derivatives, *poses, *([_SIDE_BY_SIDE] if parts.lanes else [])]
    supplied = [_SUPPLIED] if parts.mechanism.topology.model.functions else []
    fits = [_FITS] if parts.mechanism.fits else []
    trims = [_TRIMMING] if parts.mechanism.scene.solved_trim else []
    return [*lanes, *supplied, *fits, _CORE, steps.header, *more, *trims]


def _view(parts: SimulationCode, defaults: Defaults, digest: str) -> dict[str, object]:
    equations, integrator = parts.stepped, defaults.integrator
    model, steps = equations.topology.model, STEPS[parts.method][integrator]
    start, tables = parts.mechanism, _tables(equations)
    if parts.dofs is not None:
        tables.append({"name": "state_names", "entries": [*_state_names(start, rates=False), *_state_names(start, rates=True)]})
    if parts.poses:
        tables.append({"name": "pose_names", "entries": list(parts.poses)})
    if hosted := functions_of_host(model):
        tables.append({"name": "function_names", "entries": list(hosted)})
    programs = [parts.program, *([] if parts.system is None else [parts.system.program])]
    class_name = Page.of(equations, parts.method).class_name
    guiding = [i for i, each in enumerate(equations.inputs) if guided_by(model, each) is not None]
    return {
        **sizes_of(equations), "start_sizes": sizes_of(start)["sizes"], "dofs": parts.dofs, "poses": parts.poses,
        "poses_digest": digest_of_poses(model.name, parts.poses),
        "joint_speeds": start.speeds, "step_derivatives": parts.dofs is not None and parts.derives_steps,
        "seed_rows": seed_rows(parts, steps),
        "transposed": parts.transposed and source.name_of_transposed(class_name),
        "force_residual": parts.force_residual and _residual_view(parts.force_residual, source.name_of_residual(class_name)),
        "loaded": parts.transposed and parts.transposed.loaded, "tape": record_length(parts, steps), "fitted": bool(parts.mechanism.fits),
        "natural": METHODS[parts.method].formulation is Formulation.NATURAL,
        "limits": LIMITED, "numbered": _numbered(equations, parts.poses),
        "header": f"{model.name}_model" if model.name in _C_HEADERS else model.name,
        "supplied": [SUPPLIED_FILE] if model.functions else [], "hosted": hosted,
        "p": model.name, "P": model.name.upper(), "scene": equations.scene.name, "inputs": equations.inputs,
        "class_name": Page.of(equations, parts.method).class_name, "lanes": parts.lanes and LANES, "bytes": simulation_size(parts, steps),
        "system_name": "" if parts.system is None else source.name_of_system(Page.of(equations, parts.method).class_name),
        "statuses": _statuses(parts, steps), "mark": digest_of(digest, integrator),
        "method": parts.method, "integrator": integrator, "steps": steps.name, "kind": steps,
        "settings": _settings(defaults), "by_step": _by_step(equations.scene), "tables": tables,
        "violation_limits": _violation_limits(equations, defaults.parameters),
        "end": repr(float(defaults.end)), "output_step": repr(float(defaults.output_step)),
        "frozen": model.frozen, "trim": _trim(start, equations.scene.solved_trim),
        "parameters": [repr(float(defaults.parameters[p.name])) for p in equations.parameters],
        "parameter_table": [(p.name, p.unit, repr(float(defaults.parameters[p.name]))) for p in equations.parameters],
        "columns": equations.columns, "steered": next((i for i in range(len(equations.inputs)) if i not in guiding), None),
        "guiding": guiding,
        "has_lanes": any(node.lanes for program in programs for node in program.graph.nodes),
        "positions": _indexed_values(defaults.positions, start.coordinate_names),
        "rates": _indexed_values(defaults.rates, start.speed_names),
        "near": [start.coordinate_names.index(name) for name in defaults.near],
        **_roads(equations, defaults), "lays_roads": False,
    }  # fmt: skip


def _trim(start: RecursiveEquations, solved: SolvedTrim | None) -> dict[str, object] | None:
    """What the start of a trimmed scene finds, and what it holds."""
    if solved is None:
        return None
    kept = _found(start, solved)
    moves, rates = ({each.name for each, _ in kept if each.kind == kind} for kind in ("move", "rate"))
    coordinates = [
        chart.v + (i if i < chart.scalars else chart.scalars) for chart in start.charts for i in range(chart.scalars + 4 * chart.ball)
    ]
    return {
        "found": [{**vars(each), "index": index} for each, index in kept], "aims": len(solved.aims),
        "coordinates": [_bool(start.speed_names[v] in moves) for v in coordinates],
        "speeds": [_bool(name in rates or name in solved.dependent) for name in start.speed_names],
        "follows": [_bool(name in solved.dependent) for name in start.speed_names],
        "steady": [_bool(name not in solved.unsteady) for name in start.speed_names],
    }  # fmt: skip


def _found(start: RecursiveEquations, solved: SolvedTrim) -> list[tuple[Found, int]]:
    """The numbers that a trim finds of the mechanism, which has no coordinates of embedded loops, and their indices."""
    names = {"move": start.speed_names, "rate": start.speed_names, **{
        kind: [p.name for p in every] for kind, every in (("input", start.inputs), ("parameter", start.parameters))
    }}  # fmt: skip
    return [(each, names[each.kind].index(each.name)) for each in solved.found if each.name in names[each.kind]]


def _residual_view(force_residual: Linearised, name: str) -> dict[str, object]:
    """The places of the derivatives of the residual of the equations of motion, and the ``name`` of the class that has them."""
    starts = list(accumulate(map(len, force_residual.columns), initial=0))
    middles = [first + sum(c < force_residual.unknowns for c in row) for first, row in zip(starts, force_residual.columns, strict=False)]
    return {
        "name": name, "loaded": force_residual.loaded, "starts": starts, "middles": middles, "derivatives": force_residual.places,
        "columns": [c for row in force_residual.columns for c in row],
        "parts": force_residual.sides.parts, "beside": force_residual.sides.numbers,
    }  # fmt: skip


def digest_of(digest: str, integrator: str) -> str:
    """The digest in a header and in snapshots: of the model, its scene's steps and the version."""
    return sha256(f"{digest} {integrator}".encode()).hexdigest()[:16]


def _statuses(parts: SimulationCode, steps: Steps) -> list[Status]:
    """The positive statuses that calls can return: those whose causes the headers of the runtime name."""
    texts = [text for header, text in source.texts_of(headers_of(parts, steps, has_lanes=False)).items() if header != FAULTS]
    return [status for status in STATUSES.values() if any(f"Cause::{status.cause}" in text for text in texts)]


def _violation_limits(equations: RecursiveEquations | SystemEquations, parameters: Mapping[str, float]) -> list[str]:
    """The largest violation of each equation of a loop: a share of a radian, or of the mechanism's extent in its design position."""
    model = equations.topology.model
    known = {p.symbol: float(parameters.get(p.name, p.value)) for p in model.parameters}
    points = [body.centre_of_mass for body in model.bodies]
    points += [point for joint in model.joints for point in (joint.at, joint.to) if point is not None]
    angles = {name for element in JOINTS.values() for c in element.conditions if not c.joins_points for name in c.names}
    length, arm = extent(points, known), equations.topology.arm
    return [repr(LARGEST_VIOLATION * (arm if name.rpartition(".")[2] in angles else length)) for name in equations.equation_names]


def _indexed_values(values: Mapping[str, float], names: Sequence[str]) -> list[dict[str, object]]:
    return [{"index": names.index(name), "name": name, "value": repr(float(value))} for name, value in values.items()]


def _settings(defaults: Defaults) -> dict[str, object]:
    is_projected = CLOSURES[defaults.closure].penalty_of_each_cut
    steps = count_steps(defaults.dt, defaults.end, defaults.output_step)
    return {
        "closure": defaults.closure, "penalty": _optional(defaults.closure_penalty),
        "damping_ratio": repr(float(defaults.damping_ratio)), "frequency": repr(float(defaults.frequency)),
        "tolerance": repr(float(defaults.tolerance)), "iterations": defaults.iterations,
        "multiplier_updates": defaults.multiplier_updates, "proximal": _bool(is_projected), "fixed_cost": _bool(defaults.fixed_cost),
        "dt": repr(float(defaults.dt)), "end": repr(steps.number * float(defaults.dt)),
        "absolute_tolerance": repr(float(defaults.absolute_tolerance or 0.0)), "penalty_of_steps": _optional(defaults.penalty),
        "equilibrium": _bool(defaults.pose == "equilibrium"),
        "spectral_radius": None if defaults.spectral_radius is None else repr(float(defaults.spectral_radius)),
    }  # fmt: skip


def _by_step(scene: Scene) -> dict[str, str]:
    """C++ of the settings that are expressions of the step."""
    laws = scene.numerics.by_step
    return {name: sympy.cxxcode(law.subs(dict.fromkeys(law.free_symbols, sympy.Symbol("dt")))) for name, law in laws.items()}


def _optional(value: float | None) -> str:
    return "std::nullopt" if value is None else repr(float(value))


def _bool(value: object) -> str:
    return "true" if value else "false"


def _tables(equations: RecursiveEquations | SystemEquations) -> list[dict[str, Any]]:
    guards = guards_in(equations)
    tables = {
        "parameter_names": [p.name for p in equations.parameters], "parameter_units": [p.unit for p in equations.parameters],
        "input_names": [p.name for p in equations.inputs], "input_units": [p.unit for p in equations.inputs],
        **_state_tables(equations, ""), **_state_tables(equations.mechanism, "start_"),
        "event_names": [s.element for s in equations.indicators],
        "event_locations": [str(s["place"]) for s in source.indicators_of(equations)],
        "guard_names": [guard.name for guard in guards], "guard_places": [source.quotable(guard.span.place) for guard in guards],
        "output_names": [c.name for c in equations.columns], "output_units": [c.unit for c in equations.columns],
    }  # fmt: skip
    if solved := equations.scene.solved_trim:
        found = _found(equations.mechanism, solved)
        named = [*((aim.name, aim.span) for aim in solved.aims), *((each.name, equations.scene.span) for each, _ in found)]
        tables |= {"aim_names": [name for name, _ in named], "aim_places": [source.quotable(span.place) for _, span in named]}
    if controllers := equations.topology.model.controllers:
        places = [source.quotable(c.span.place) for c in controllers]
        tables |= {"controller_names": [c.name for c in controllers], "controller_places": places}
    return [{"name": name, "entries": list(items)} for name, items in tables.items()]


def _state_tables(equations: Equations, prefix: str) -> dict[str, Sequence[str]]:
    """Names of coordinates, speeds and equations, and where their elements stand."""
    place = {name: source.quotable(span.place) for name, span in equations.topology.model.constraint_spans.items()}
    state = equations.state
    arrays = {"coordinate": state.q, "speed": state.v, "equation": state.equations}
    return {
        **{f"{prefix}{kind}_names": [entry.name for entry in entries] for kind, entries in arrays.items()},
        **{f"{prefix}{kind}_places": [place[entry.element] for entry in entries] for kind, entries in arrays.items()},
    }


def _state_names(start: RecursiveEquations, *, rates: bool) -> list[str]:
    """A name for each speed: its coordinate, for a ball the rotation, or the rate of that."""
    names: list[str] = []
    for c in start.charts:
        names += [f"{c.joint}.{name}" for name in (c.speed_names if rates else c.coordinate_names)[: c.scalars]]
        names += [f"{c.joint}.turn_{axis}{'_rate' if rates else ''}" for axis in "xyz" if c.ball]
    return [*names, *start.speed_names[start.speeds :]]


def _roads(equations: RecursiveEquations | SystemEquations, defaults: Defaults) -> dict[str, object]:
    """The tracks that the tyres' roads have, each once, and the road of each tyre."""
    tracks: dict[str, dict[str, object]] = {}
    known: dict[tuple[object, ...], str] = {}
    roads = []
    for tyre in equations.roads:
        road = defaults.roads[tyre]
        names = {}
        for side in ("left", "right"):
            key = tuple(chain.from_iterable(piece.values() for piece in road[side]))
            names[side] = name = known.setdefault(key, f"track_{len(known)}")
            breaks = [repr(float(x["start"])) for x in road[side][1:]]
            pieces = [{"kind": x["kind"], **{key: repr(float(x[key])) for key in ("start", "a", "b", "c")}} for x in road[side]]
            tracks[name] = {"name": name, "pieces": pieces, "breaks": breaks}
        named = {f"{side}_breaks": f"{name}_breaks" if tracks[name]["breaks"] else "{}" for side, name in names.items()}
        roads.append({"tyre": tyre, **names, **named, "disc": _bool(road["disc"])})
    return {"tracks": list(tracks.values()), "roads": roads, "surface": _surface(defaults) if roads else None}


def _surface(defaults: Defaults) -> dict[str, Any] | None:
    if defaults.surface is None:
        return None

    def texts(numbers: Iterable[float]) -> list[str]:
        return [repr(float(number)) for number in numbers]

    patches = [[*texts((*p["x"], *p["y"])), *texts((p["friction"], p["edge"]))] for p in defaults.surface["patches"]]
    field = defaults.surface["field"]
    if field is None:
        return {"field": None, "curved": None, "patches": patches}
    if "sections" in field:
        lists: dict[str, Any] = {name: texts(field[name]) for name in ("across", "heights", "boxes", "offsets", "smooth", "closed")}
        sections = [texts(field["sections"][i : i + 9]) for i in range(0, len(field["sections"]), 9)]
        lists |= {"sections": sections, "step": repr(float(field["step"])), "borders": field["borders"]}
        return {"field": None, "curved": lists, "patches": patches}
    parts = {name: texts(field[name]) for name in ("start", "step", "heights")}
    flags = {name: _bool(field[name]) for name in ("wraps", "bilinear")}
    return {"field": {**parts, **flags, "counts": field["counts"]}, "curved": None, "patches": patches}


def _numbered(equations: RecursiveEquations | SystemEquations, poses: Sequence[str]) -> list[tuple[str, list[str]]]:
    """The names by which a host knows numbers when it is compiled."""
    kinds = {
        "parameter": [p.name for p in equations.parameters], "input": [p.name for p in equations.inputs],
        "output": [c.name for c in equations.columns], "pose_of": list(poses),
    }  # fmt: skip
    return [(kind, in_c(names)) for kind, names in kinds.items()]


def in_c(names: Sequence[str]) -> list[str]:
    """Names as parts of C identifiers, unique: those that differ only in dots are numbered."""
    words = [re.sub(r"\W", "_", name) for name in names]
    often = Counter(words)
    found = [word if often[word] == 1 else f"{word}_{i}" for i, word in enumerate(words)]
    return found if len(set(found)) == len(found) else [f"{word}_{i}" for i, word in enumerate(words)]
