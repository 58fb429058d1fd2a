"""From a study to what runs it: a library for each scene, with the study's runs as C++ behind the interface of a model's folder.

The code has the runs' arguments, and the series that they leave.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from cutjoint.compile.c_export import Standalone, lanes_break_even, make_standalone
from cutjoint.compile.pipeline import generate
from cutjoint.elements.joint import ATTITUDE
from cutjoint.emit.classes import MOST_LANES
from cutjoint.emit.printer import Dialect, Printer
from cutjoint.formulate.inputs import input_parameters
from cutjoint.formulate.records import Column
from cutjoint.formulate.translate import Translator
from cutjoint.model.expressions.operations import ExpressionError, Term
from cutjoint.model.expressions.parse import Names, quantity_symbol, read_term, variable
from cutjoint.model.expressions.quantities import QuantityError, elements_of, find_quantity, quantities
from cutjoint.model.expressions.units import TIME, Dimension, measure
from cutjoint.model.records import VALUE, Binding, Model, Output, Scalar, Scene, Span
from cutjoint.model.scenes.starts import UNIT_BOUND
from cutjoint.ops import STANDARD
from cutjoint.package.errors import RunError
from cutjoint.program.blocks import BindingTime, Builder
from cutjoint.program.lower import Lowering
from cutjoint.program.records import Program
from cutjoint.run.run_file import changing_parts, sources_of_parts, start_follows_from
from cutjoint.run.scenes import with_default_closure
from cutjoint.sweeps.kernel import Kernel, find_target
from cutjoint.sweeps.records import Kind, Study, Variable

_CALLS = {
    Kind.PARAMETER: ("set_parameter", "parameter", ""), Kind.INPUT: ("set_input", "input", ", 0.0, 0.0"),
    Kind.POSITION: ("set_start_coordinate", "coordinate", ""), Kind.RATE: ("set_start_speed", "speed", ""),
}  # fmt: skip
#: C++ outside of generated classes.
_CPP = Dialect(constant="{}", negative="({})", functions={**{name: f"std::{name}" for name in STANDARD}, "where": "cutjoint::where"})
#: The largest number of rows of a run, and of a group of lanes; a chunk of runs stays in memory.
_MOST_ROWS = 10_000_000


def with_runs(
    standalone: Standalone, study: Study, scene: Scene, columns: Sequence[Column], names: Mapping[str, Sequence[str]],
    variables: Sequence[Variable],
) -> Standalone:  # fmt: skip
    """A C export whose library also runs a study, in lanes if possible; ``names``: its parameters, inputs, coordinates and speeds.
    Raises RunError: the library has no place for something that the study changes."""
    show = _printer(study.model, columns, names)
    calls = _calls(standalone.name, variables, names)
    return standalone.with_code(
        "sweep/runs.cpp.jinja", lanes=standalone.parts.lanes, variables=variables, unit_bound=UNIT_BOUND,
        series=[show(s.value) for s in study.series],
        parameters=[call for v, call in calls if v.kind in (Kind.PARAMETER, Kind.INPUT)],
        following=list(_following(standalone.name, study, scene, show, names)),
        starts=[call for v, call in calls if v.kind in (Kind.POSITION, Kind.RATE)],
    )  # fmt: skip


def _calls(p: str, variables: Sequence[Variable], names: Mapping[str, Sequence[str]]) -> list[tuple[Variable, str]]:
    calls = []
    for i, v in enumerate(variables):
        if v.kind is not Kind.SCENE:
            function, table, rest = _CALLS[v.kind]
            calls.append((v, f"{p}_{function}(sim, {_place(v, names[table])}, values[{i}]{rest})"))
    return calls


def _place(v: Variable, names: Sequence[str]) -> int:
    if v.name not in names:
        if v.kind in (Kind.POSITION, Kind.RATE):
            raise RunError(f"{v.span}: {v.kind} '{v.name}': its joint is cut to open a loop; set the coordinate of another joint")
        raise RunError(f"{v.span}: {v.kind} '{v.name}': nothing in the model depends on it; remove it")
    return list(names).index(v.name)


def _following(p: str, study: Study, scene: Scene, show: Callable[[Scalar], str], names: Mapping[str, Sequence[str]]) -> list[str]:
    """The calls that set all quantities of a start that depend on parameters of the study."""
    model, changed = study.model, {v.name for v in study.variables if v.kind is Kind.PARAMETER}
    moving = {q.symbol for q in model.parameters if q.name in changed}
    if "roads" in changing_parts(model, scene) and any(moving & f.radius.free_symbols for f in model.forces if f.has_road):
        reason = "a tyre's radius follows from a parameter of the study, and the road's shape from the radius"
        raise RunError(f"{scene.span}: scene '{scene.name}': {reason}; use cutjoint batch")
    if not scene.trim and (name := start_follows_from(model, scene, sorted(changed))):
        reason = f"scene '{scene.name}': its start is assembled once, and follows from the parameter '{name}'"
        raise RunError(f"{scene.span}: {reason}; use cutjoint batch, which assembles each run's")
    kinds = (Kind.POSITION, Kind.RATE) if scene.trim else (Kind.POSITION,)
    if (scene.trim or scene.assemble) and (held := next((v for v in study.variables if v.kind in kinds), None)):
        reason = f"scene '{scene.name}' {'trims' if scene.trim else 'assembles'} its start"
        raise RunError(f"{held.span}: {held.kind} '{held.name}': {reason}; vary parameters of that by cutjoint batch")
    calls: list[str] = []
    if scene.trim:
        return calls
    for part, function, table in (("positions", "set_start_coordinate", "coordinate"), ("rates", "set_start_speed", "speed")):
        expressions = sources_of_parts(model, scene)[part]
        for name, value in expressions.items():
            joint, _, component = name.rpartition(".")
            if component in ATTITUDE[1:]:
                continue  # its first component sets the attitude
            values = [expressions[f"{joint}.{e}"] for e in ATTITUDE] if component in ATTITUDE else [value]
            if any(each.free_symbols & moving for each in values):
                call, printed = f"{p}_{function}", ", ".join(map(show, values))
                if component in ATTITUDE:
                    call, printed = "set_attitude", f"{{{printed}}}"
                calls.append(f"{call}(sim, {list(names[table]).index(name)}, {printed})")
    return calls


def _printer(model: Model, columns: Sequence[Column], names: Mapping[str, Sequence[str]]) -> Callable[[Scalar], str]:
    """Prints expressions as C++: over arrays of parameters and columns, and time.  Parameters that no array has are their values."""
    b, loaded = Builder(), {name: i for i, name in enumerate(names["parameter"])}
    parameters, outputs = (b.symbol(name, n, BindingTime.STEP) for name, n in (("parameters", len(loaded)), ("columns", len(columns))))
    known = {variable("t"): b.symbol("t", 1, BindingTime.STEP)}
    for p in model.parameters:
        at = loaded.get(p.name)
        known[p.symbol] = b.number(p.value) if at is None else b.take(parameters, (at, at + 1))
    known |= {symbol_of(c.name): b.take(outputs, (i, i + 1)) for i, c in enumerate(columns)}
    translator, lowering = Translator(b, known), Lowering()

    def show(value: Scalar) -> str:
        block, graph = translator.scalar(value), lowering.graph
        lowering.lower([block])
        (result,) = lowering.elements[block][0]
        leaves: Any = ((n, graph.nodes[n].data) for n in graph.reachable([result]) if graph.nodes[n].op == "symbol")
        places = {n: "t" if name == "t" else f"{name}[{i}]" for n, (name, i) in leaves}
        return Printer(graph=graph, names={}, known=places, prefixes=(), used_names=frozenset(), roads={}, dialect=_CPP).text(result)

    return show


def build_kernels(study: Study, *, lanes: bool | None = None) -> tuple[Kernel, ...]:
    """Compile a study for each of its scenes, or find the libraries in the cache.

    There are none where other tasks give all objectives. Runs go in ``lanes`` where steps can and there are so many runs that these pay
    (`lanes_break_even`), or as is said, unless those side by side have too many rows.

    Raises:
        TopologyError, NoInertiaError, GuideError, RunError: the model is wrong, or the study asks for what its library does not have.
        ToolchainError: the C++ side failed.
    """
    has_runs = study.trajectories or any(o.asked is None for o in study.objectives)
    return tuple(_build(study, scene, lanes) for scene in study.scenes) if has_runs else ()


def _build(study: Study, scene: Scene, lanes: bool | None) -> Kernel:
    scene = with_default_closure(scene, study.method, study.integrator)
    generated = generate(study.model, scene, study.outputs, method=study.method)
    standalone = make_standalone(generated, integrator=study.integrator)
    rows, row_step = _count_rows(scene, standalone)
    may = standalone.fits_lanes and rows * MOST_LANES <= _MOST_ROWS
    if may and (_reaches_break_even(study, generated.program, standalone) if lanes is None else lanes):
        standalone = make_standalone(generated, integrator=study.integrator, side_by_side=True)
    equations = generated.equations
    start = equations.mechanism
    names = {
        "parameter": [p.name for p in equations.parameters], "input": [p.name for p in input_parameters(study.model)],
        "coordinate": start.coordinate_names, "speed": start.speed_names,
    }  # fmt: skip
    starts = _starts(study, scene, names)
    ready = with_runs(standalone, study, scene, equations.columns, names, (*study.variables, *starts))
    return Kernel(
        model=standalone.name, scene=scene.name, source=ready.library.digest,
        content=ready.build_library(study.flags).read_bytes(), target=find_target(study.flags), lanes=max(1, ready.parts.lanes),
        series=len(study.series), rows=rows, row_step=row_step, steps=standalone.settings,
        starts=tuple(v.name for v in starts),
    )  # fmt: skip


def _starts(study: Study, scene: Scene, names: Mapping[str, Sequence[str]]) -> list[Variable]:
    """What a trim finds for each run; nothing where all runs begin at the same start."""
    changed = {v.name: v.kind for v in study.variables}
    if scene.trim is None or not (Kind.INPUT in changed.values() or start_follows_from(study.model, scene, sorted(changed))):
        return []
    found = {kind: [u.name for u in scene.trim.find if u.kind == kind] for kind in ("parameter", "input")}
    every = {Kind.PARAMETER: found["parameter"], Kind.INPUT: found["input"], Kind.POSITION: names["coordinate"], Kind.RATE: names["speed"]}
    return [Variable(name=name, kind=kind, unit="", span=scene.trim.span) for kind, of in every.items() for name in of]


def _count_rows(scene: Scene, standalone: Standalone) -> tuple[int, float]:
    row_step, end, rows = float(standalone.run_file.output_step), float(standalone.run_file.end), 1
    while (rows - 1) * row_step < end * (1 - 1e-12):
        rows += 1
    if rows > _MOST_ROWS:
        raise RunError(f"{scene.span}: scene '{scene.name}': {rows} rows are more than {_MOST_ROWS}; give the study a longer output_step")
    return rows, row_step


def _reaches_break_even(study: Study, program: Program, standalone: Standalone) -> bool:
    """Return whether a study takes enough steps in a scene that lanes save time."""
    steps = float(standalone.run_file.end) / float(standalone.run_file.settings.dt)
    return lanes_break_even(program.operations("evaluate"), steps * study.runs / len(study.scenes))


def dimension_of(unit: str) -> Dimension | None:
    """The dimension of a unit; a number without a unit fits any."""
    return measure(1.0, unit).dimension if unit else None


def symbol_of(column: str) -> Scalar:
    """The symbol of an output in expressions."""
    element, _, quantity = column.rpartition(".")
    return quantity_symbol(element, quantity)


class Reader:
    """Reads expressions over a model's outputs, its parameters and time ``t``; ``outputs`` are those that were used, by column.

    ``further`` are names of expressions, with their outputs.
    """

    def __init__(self, model: Model, further: Mapping[str, tuple[Term, tuple[Output, ...]]] | None = None) -> None:
        self._elements, self._further = elements_of(model), further or {}
        self._own = frozenset(element.name for group in (model.states, model.signals) for element in group)
        fixed = {p.name: Term(p.symbol, dimension_of(p.unit)) for p in model.parameters if p.binding is not Binding.INPUT}
        moving = {p.symbol for p in model.parameters if p.binding is Binding.INPUT}
        derived = {d.name: Term(d.value) for d in model.derived if moving.isdisjoint(d.value.free_symbols)}
        self._names = {**fixed, **derived, "t": Term(variable("t"), TIME)}
        self.outputs: dict[str, Output] = {}

    def read(self, value: int | float | str, span: Span) -> tuple[Scalar, str, Dimension | None]:
        """An expression, its unit, "" where that is not known, and its dimension, None where that is not known.
        Raises ExpressionError: it is none, or names something that the model does not have."""
        if not isinstance(value, str):
            return read_term(value, {}).value, "", None
        outputs: dict[str, Output] = {}

        def quantity(name: str) -> Term:
            if name in self._further:
                term, read = self._further[name]
                outputs.update({o.column: o for o in read})
                return term
            output = outputs.setdefault(name, self._output(name, span))
            return Term(quantity_symbol(output.element, output.quantity), dimension_of(self._unit(output)))

        term = read_term(value, Names(self._names, self._own, quantity))
        self.outputs |= {output.column: output for _, output in sorted(outputs.items())}
        bare = value.strip().removeprefix("-").strip()
        if bare.startswith("abs(") and bare.endswith(")"):
            bare = bare[4:-1].strip()
        output = outputs.get(bare)
        return term.value, "" if output is None else self._unit(output), term.dimension

    def _unit(self, output: Output) -> str:
        return quantities(self._elements[output.element])[output.quantity]

    def _output(self, name: str, span: Span) -> Output:
        try:
            element, quantity = (name, VALUE) if name in self._own else find_quantity(self._elements, name, str, "")
        except QuantityError as error:
            raise ExpressionError(error.message, error.hint) from None
        return Output(element=element, quantity=quantity, span=span)
