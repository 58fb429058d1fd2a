"""Program -> C99 for controllers: a header and one C file, by the C dialect of the printer."""

import re
from bisect import bisect
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cutjoint.emit.classes import Defaults, SimulationCode, describe_function, records_of, sizes_of
from cutjoint.emit.printer import C99
from cutjoint.emit.standalone import Mathematics, prepare
from cutjoint.emit.statuses import STATUSES
from cutjoint.emit.view import FunctionView, Viewer
from cutjoint.methods import CLOSURES, STEPS
from cutjoint.model.ranges import RANGES
from cutjoint.ops import STANDARD
from cutjoint.package.errors import RunError
from cutjoint.package.locations import licence

#: The functions of a mechanism that steps of fixed cost call, with loops and where these are projected.
_CALLED, _WITH_LOOPS, _PROJECTED = ("scene_inputs", "evaluate", "report"), ("constraint_residual",), ("project",)
_OF_NEWTON = ("dynamic_residual", "linearise")

#: The statuses of steps that iterate, and of others; the first one's step failed. The others are of steps whose iterations are counted.
_CAUSES, _COUNTED = ("diverged", "accelerations_not_finite", "newton_infinite"), ("loops_violated", "limit_exceeded")

#: In code of C: comments, functions of the mathematical library that have a version for floats, and numbers that are not whole.
_IN_CODE = re.compile(
    rf"/\*.*?\*/|\b(?:{'|'.join((*STANDARD, 'fabs'))})(?=\()|(?<![\w.])\d+(?:\.\d*(?:e[+-]?\d+)?|e[+-]?\d+)(?!\w)", re.DOTALL
)  # fmt: skip

#: The iterations of a step unless others are given, and the multiplier updates in each evaluation of an explicit one.
ITERATIONS, UPDATES = 6, 2


@dataclass(frozen=True, kw_only=True)
class Start:
    """The state from which runs begin: numbers of ``q``, ``v``, ``vdot``, multipliers, and penalties of the cut joints."""

    q: Sequence[float]
    v: Sequence[float]
    vdot: Sequence[float]
    multipliers: Sequence[float]
    penalties: Sequence[float]

    @property
    def texts(self) -> dict[str, list[str]]:
        """The numbers by the fewest digits that determine them, at least one."""
        return {name: [repr(float(x)) for x in numbers] or ["0.0"] for name, numbers in vars(self).items()}


def emit_c99(
    parts: SimulationCode, defaults: Defaults, digest: str, start: Start, libm: Mathematics, *, iterations: int,
    precision: str = "double", errors: Sequence[Mapping[str, object]] = (),
) -> dict[str, str]:  # fmt: skip
    """The files by name; arguments as of `emit_standalone`, for a program without lanes. ``errors`` are those of floats, for the README:
    rows of an output's name, its largest error and its range. Raises RunError: a number of the model is too large for a float."""
    parts, view = prepare(parts, defaults, digest)
    page, equations, newton, program = parts.page, parts.stepped, parts.system is not None, (parts.system or parts).program
    viewer = Viewer(program, equations, dialect=C99)
    explicit = STEPS[parts.method][defaults.integrator].stages > 0
    iterated = not explicit and not newton
    has_loops, projected = bool(equations.equation_names), explicit or CLOSURES[defaults.closure].penalty_of_each_cut
    wanted = (*_CALLED, *_OF_NEWTON, *(_WITH_LOOPS * has_loops), *(_PROJECTED * (has_loops and projected)))
    counted = has_loops or not explicit
    called = [f.name for f in equations.functions if f.name in wanted]
    views = {viewer.load_name: viewer.load(), viewer.step_name: viewer.step(), **{name: viewer.function(name) for name in called}}
    functions = [_function(describe_function(name, program), page.stem, found) for name, found in views.items()]
    bodies = [line for f in views.values() for line in _lines(f)]
    sizes = sizes_of(equations)["sizes"]
    assert isinstance(sizes, Mapping)
    settable = equations.inputs if view["steered"] is not None else ()
    view |= {
        "banner": f"/* {page.banner[0]} */", "functions": functions, "records": records_of(viewer), "start": start.texts,
        "input_values": equations.input_values, "iterations": iterations, "most_iterations": RANGES["c99_iterations"]["most"],
        "projected": projected, "charts": equations.charts, "libm": libm, "balls": any(chart.ball for chart in equations.charts),
        "statuses": [STATUSES[cause] for cause in (_CAUSES[explicit + 2 * newton], *_COUNTED * counted, "infinite_acceleration")],
        "iterated": iterated, "explicit": explicit, "newton": newton, "counted": counted,
        "pattern": parts.system and parts.system.plan.pattern, "real": "float" if precision == "single" else "double",
        "errors": errors, "single": precision == "single", "chooses": any("choose(" in line for line in bodies),
        "stabilised": any("stabilisation." in line for line in bodies) or (iterated and has_loops and bool(settable)),
        "cut_of": [max(0, bisect([c.first for c in parts.mechanism.closures], i) - 1) for i in range(len(equations.equation_names))],
        "lookups": set(re.findall(r"\broad_(\w+)\(", "\n".join(bodies))), "inputs": settable,
        "many": {name: max(1, size) for name, size in sizes.items() if isinstance(size, int)},  # arrays of C have an element
    }  # fmt: skip
    header, code = str(view["header"]), page.render("c99/model.c.jinja", **view)
    return {
        f"{header}.h": page.render("c99/api.h.jinja", **view), f"{header}.c": _IN_CODE.sub(_in_floats, code) if view["single"] else code,
        "README.md": page.render("c99/README.md.jinja", **view), "LICENSE": licence(), **({} if view["single"] else libm.files),
    }  # fmt: skip


def _in_floats(found: re.Match[str]) -> str:
    """A number as the nearest float, or a function's name as that of its version for floats."""
    text = found.group()
    if not text[0].isdigit():
        return text if text.startswith("/*") else f"{text}f"
    number = np.float32(min(float(text), 1e300))
    if not np.isfinite(number):
        raise RunError(f"language c99: {text} is too large for --precision single")
    return f"{number!s}f"


def _function(about: str, stem: str, view: FunctionView) -> dict[str, object]:
    """A function of C with the simulation as its first argument; those of the stabilisation are constants of the file."""
    name, arguments, const = re.fullmatch(r"(\w+)\((.*)\)( const)?", view.declaration).groups()  # type: ignore[union-attr]
    arguments = arguments.replace("const Weights<Real>& ", "weighting ")
    own = [f"{'const ' if const else ''}{stem}_sim* self", *(a for a in arguments.split(", ") if "<Real>" not in a)]
    text = "\n".join(_lines(view))
    names = [a.rpartition(" ")[2] for a in own]
    return {
        "about": about, "head": f"{name}({', '.join(own)})", "unused": [x for x in names if not re.search(rf"\b{x}\b", text)],
        "view": replace(view, sections=tuple(replace(section, part=0) for section in view.sections)),
    }  # fmt: skip


def _lines(view: FunctionView) -> list[str]:
    """The code of a function without its comments."""
    statements = [f"{s.name} = {s.expression}" for section in view.sections for s in section.statements]
    return [*view.arrays, *(x for s in view.sections for x in s.opening), *statements, *(x.partition("  // ")[0] for x in view.results)]
