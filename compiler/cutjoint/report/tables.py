"""Tables for the terminal."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from math import inf
from typing import TYPE_CHECKING, Any

from rich.console import RenderableType
from rich.table import Table

from cutjoint.methods import Implementation
from cutjoint.model.ranges import count_steps
from cutjoint.toolchain.compiler import ADVICE, SHIPPED

if TYPE_CHECKING:
    from cutjoint.analysis.assemblies import Assemblies
    from cutjoint.analysis.mobility import Mobility
    from cutjoint.analysis.redundancy import Redundancy, RedundantEquation
    from cutjoint.analysis.skew import RatedChoice, RatedOption
    from cutjoint.analysis.trims import Trimmed
    from cutjoint.model.records import Model
    from cutjoint.run.results import Batch, ErrorEstimate, RunStatistics, Trajectory
    from cutjoint.run.simulator_run import Compilation, SimulatorRun, Start
    from cutjoint.tasks.batch import BatchArtifact
    from cutjoint.topology.records import Topology

#: The descriptions of models with prescribed motion only, and without any.
KINEMATIC = "kinematic: guides prescribe all degrees of freedom; runs report guide forces and all reactions"
_STIFF = "none: loops and joints leave no degree of freedom, and no joint is guided"
#: Descriptions of an ordinary design position, and of one with rounded numbers.
_ORDINARY, _NEARLY = (" as in ", "rigid, "), "some equations are nearly redundant"
#: Above this condition number, lengths were probably meant to be equal.
_NEARLY_SINGULAR = 1e5
#: The number of named equations that could be left out instead.
_SHOWN = 6
_FIGURES = ("operations", "counted once", "redundant", "condition")
#: The words of `check` in a line each: (word, meaning, whether it stands in the tables of loops alone).
_LEGEND = (
    ("rank", "number of independent equations; degrees of freedom are the coordinates less the rank", True),
    ("condition", "ratio of the largest to the smallest singular value, 1 at best; above 1e5 numbers of the file may be rounded", True),
    ("base body", "the last common body on the paths from the ground to both bodies of the cut joint", True),
    ("width", "the largest number of bodies to which a body of the loop is coupled; operations grow with it", True),
    ("(chosen)", "chosen by the compiler, since neither the model nor a force prescribes the cut", True),
    ("redundant", "equations that depend on others; harmless, but reactions that they share are indeterminate", True),
    ("operations", "predicted for an evaluation with this cut; counted once: parts evaluated in lanes count as one", True),
    ("massless", "massless links, whose motion the others determine", False),
    ("isomorphic", "parts that differ in numbers only, evaluated in lanes", False),
)  # fmt: skip
#: How the values of indeterminate reactions are chosen.
LEAST = "the solution with the smallest multipliers of cut joints"
#: The facts that every run reports.
_REPORTED = (
    "motion", "warning", "note", SHIPPED, "switched to", "impacts", "stiff", "locked at the start by", "initial velocities not specified",
    "indeterminate",
)  # fmt: skip
#: The note on runs that are interpreted because there is no compiler.
_GAIN = f"interpreted; generated code is 5 to 20 times as fast: {ADVICE}"
#: The largest number of outputs that a line names.
_NAMED = 4
#: The share of steps limited by stability from which a run is called stiff.
STIFF = 0.1
#: A run with so few steps limited by stability is not called stiff.
FEW_STEPS = 10


def closing_equations(model: Model) -> str:
    """The equations whose number and rank a report lists."""
    return "equations of cut joints and gears" if model.gears else "cut-joint equations"


def table(
    title: str, headings: Sequence[str], rows: Iterable[Sequence[RenderableType]] = (), *, numbers: Collection[str] = (), **how: Any
) -> Table:  # fmt: skip
    """A table with headings; columns of ``numbers`` are aligned to the right, and ``how`` has further options of Rich's columns.

    Texts fold where the terminal is narrow, so that no character is lost; ``no_wrap`` is for numbers.
    """
    made = Table(title=title, title_justify="left", box=None)
    for heading in headings:
        right, whole = heading in numbers, heading in numbers and how.get("no_wrap", False)
        options = {"overflow": "ellipsis" if whole else "fold", **how, "no_wrap": whole}
        made.add_column(heading, justify="right" if right else "left", **options)
    for row in rows:
        made.add_row(*row)
    return made


def facts(title: str, rows: Iterable[tuple[str, str]]) -> Table:
    """A table of two columns: names and their values."""
    made = table(title, ("", ""), rows)
    made.show_header = False
    return made


def topology_facts(topology: Topology, mobility: Mobility, warning: str = "") -> tuple[tuple[str, str], ...]:
    """The counts of a model by name, and a warning if there is one."""
    model = topology.model
    massless = sum(1 for b in model.bodies if b.is_massless)
    guided = sum(1 for t in topology.tree if t.joint.guide is not None)
    widest = max((loop.width for loop in topology.loops), default=0)
    signals = [signal for signal in model.signals if not signal.reported]
    further: Mapping[str, Sequence[object]] = {
        "gears": model.gears, "states": model.states, "signals": signals, "controllers": model.controllers,
    }  # fmt: skip
    classes = [f"{len(c.roots)} x {c.size} bodies ({', '.join(c.roots)})" for c in topology.classes]
    return (
        ("bodies", f"{len(model.bodies)}, {massless} of them without mass and inertia"),
        ("joints", f"{len(topology.tree)} in the tree ({guided} guided), {len(topology.cuts)} cut"),
        *((name, str(len(part))) for name, part in further.items() if part),
        ("loops", f"{len(topology.loops)}, widest couples a body to {widest} other{'s' * (widest != 1)}"),
        *([("assemblies", _assemblies(model))] if model.embedded_loops else []),
        ("isomorphic subtrees", "; ".join(classes) or "none"),
        ("coordinates", f"{mobility.speeds} relative"),
        (closing_equations(model), f"{mobility.equations}, rank {mobility.rank}"),
        ("design position", _design_position(mobility)),
        ("degrees of freedom", str(mobility.degrees_of_freedom)),
        *([("motion", KINEMATIC if guided else _STIFF)] if not mobility.degrees_of_freedom else []),
        *([("warning", warning)] if warning else []),
        *((f"choices of {names}", text) for names, text in model.choices.items()),
        *(("note", note) for note in model.notes),
    )  # fmt: skip


def _assemblies(model: Model) -> str:
    """Facts about embedded loops: largest constraint violation, ranges of the independent coordinates."""
    gap = max(embedded_loop.functions.violation for embedded_loop in model.embedded_loops)
    found = [(a.independent, a.functions) for a in model.embedded_loops]
    ranges = "; ".join(f"{x} {'turns' if f.is_periodic else f'from {f.range.lower:.4g} to {f.range.upper:.4g}'}" for x, f in found)
    return f"{len(model.embedded_loops)}, whose loops are closed by functions to within {gap:.1g} m or rad: {ranges}"


def _design_position(mobility: Mobility) -> str:
    """Describe the design position compared to nearby poses: ordinary, singular or not closed."""
    if not mobility.closed:
        return "not closed: no pose near it closes the loops with the guides at their initial positions"
    others = f"{mobility.poses - 1} other pose{'s' if mobility.poses != 2 else ''} of the motion"
    if mobility.design_rank < mobility.rank:
        return f"instantaneously singular: rank {mobility.design_rank}, but {mobility.rank} in {others}"
    if mobility.poses == 1 and mobility.degrees_of_freedom:
        return f"rank {mobility.rank}; no other pose was found, so it may be singular"
    condition = f"condition {mobility.condition:.3g}"
    if mobility.condition > _NEARLY_SINGULAR:
        condition += f": {_NEARLY}; are the file's numbers rounded?"
    return f"rank {mobility.rank} as in {others}, {condition}" if mobility.poses > 1 else f"rigid, {condition}"


def loop_table(topology: Topology) -> Table:
    """A table with one row for each loop."""
    cuts = {c.name: c for c in topology.cuts}
    rows = (
        (cut.name, cut.kind + ("" if cut.cut else " (chosen)"), cut.span.place, loop.base, ", ".join(loop.bodies), str(loop.width))
        for loop in topology.loops for cut in [cuts[loop.cut]]
    )  # fmt: skip
    return table("loops", ("cut joint", "kind", "line", "base body", "bodies of the loop", "width"), rows)


def redundancy_table(redundancy: Redundancy, model: Model) -> Table:
    """A table of redundant equations, one row for each cut joint or gear and kind."""
    rows = []
    for when, found in (("in every pose", redundancy.structural), ("in the design position only", redundancy.momentary)):
        for joint in dict.fromkeys(r.joint for r in found):
            alike = [r for r in found if r.joint == joint]
            rows.append((joint, alike[0].place, ", ".join(map(_redundant_equation, alike)), when))
    headings = ("cut joint or gear" if model.gears else "cut joint", "line", "equations", "redundant")
    return table(f"redundant {closing_equations(model)}", headings, rows)


def _redundant_equation(redundant: RedundantEquation) -> str:
    """The name of the equation, and which others could be left out instead."""
    others = [name.removeprefix(f"{redundant.joint}.") for name in redundant.instead]
    if len(others) > _SHOWN:
        others = [*others[:_SHOWN], f"{len(others) - _SHOWN} more"]
    return f"{redundant.equation} (or one of {', '.join(others)})" if others else redundant.equation


def cut_choices(choices: Sequence[RatedChoice], redundant: int) -> str:
    """The cut joint of each loop, why it is cut, and up to three alternatives, the best first.

    ``redundant`` is the number of redundant equations with the cut joints in use.
    """
    names = [o.option.joint.name for choice in choices for o in (choice.used, *choice.alternatives)]
    width = max(len("choice of the cut joints"), *(len(name) + 6 for name in names))
    lines = ["choice of the cut joints".ljust(width) + "".join(f"  {heading}" for heading in _FIGURES)]
    for choice in choices:
        base = redundant - choice.used.option.cost.redundant
        lines += [f" {choice.used.option.joint.name}".ljust(width) + _figures(choice.used, base), f"   {choice.reason}"]
        lines += [f"   or {o.option.joint.name}".ljust(width) + _figures(o, base) for o in choice.alternatives]
    return "\n".join(lines)


def _figures(rated: RatedOption, base: int) -> str:
    cost = rated.option.cost
    figures = (str(cost.operations), str(cost.counted_once), str(base + cost.redundant), f"{rated.condition:.3g}")
    return "".join(f"  {figure:>{len(heading)}}" for figure, heading in zip(figures, _FIGURES, strict=True))


def describe_output_times(run: SimulatorRun) -> str:
    """The words about a run whose rows are not at the multiples of its output_step; "" of others."""
    dt, end, wanted = run.run_file.settings.dt, run.run_file.end, run.run_file.output_step
    steps = count_steps(dt, end, wanted)
    apart = steps.stride * dt
    if steps.rows < 3 or abs(apart - wanted) <= 1e-6 * wanted:
        return ""
    return (
        f"samples are {apart:g} s apart, not {wanted:g} s: equal steps of {dt:g} s have samples at their ends only; choose a dt that "
        "divides output_step, or omit dt"
    )


def legend(*, with_loops: bool) -> Table:
    """The words of `check` and their meaning."""
    return facts("words", [(word, meaning) for word, meaning, of_loops in _LEGEND if with_loops or not of_loops])


def locking_force_facts(held: Mapping[str, tuple[float, str]]) -> list[tuple[str, str]]:
    """The forces that lock coordinates at the start and vanish in motion; none if no coordinate is locked."""
    forces = [f"{name} {f'{force / 1e3:.4g} k' if abs(force) >= 1e4 else f'{force:.4g} '}{unit}" for name, (force, unit) in held.items()]
    return [("locked at the start by", f"{force}, released at t = 0") for force in forces]


def assembly_lines(found: Assemblies) -> Iterator[str]:
    """The assemblies of closed loops, each with the lines by which a scene starts in it."""
    many = " or more: coordinates change with closed loops; give positions of more joints" if found.is_continuum else ""
    at = f", with {', '.join(found.kept)} kept" if found.kept else ""
    yield f"assemblies: {len(found.assemblies)}{many}, from {found.starts} random starts{at}"
    for i, assembly in enumerate(() if found.is_continuum else found.assemblies, 1):
        positions = ", ".join(f"{name}: {text}" for name, text in assembly.positions.items())
        yield f"  {i}, found {assembly.found} times: positions: {{{positions}}}, near: [{', '.join(found.follow)}]"


def trim_facts(found: Trimmed) -> list[tuple[str, str]]:
    """The results of a trim, the residuals of its conditions, and notes."""
    numbers = [f"{name} = {value + 0.0:.7g} {found.units[name]}".rstrip() for name, value in found.unknowns.items()]
    changing = [f"{name} by {rate:.4g} {unit}" for name, (rate, unit) in found.unsteady.items()]
    several = {"found": numbers, "follow from other conditions": found.redundant, "change at the start": changing}
    facts = [(name, ", ".join(values)) for name, values in several.items() if values]
    if found.from_random_start:
        facts.append(("warning", "no solution near the given start; this one was found from random coordinates: check its pose"))
    return [*facts, ("largest residual", f"{found.residual:.1e} of the change by a full-size step of the unknowns")]


def reported_facts(counts: Iterable[tuple[str, str]], compilation: Compilation, run: Trajectory) -> list[tuple[str, str]]:
    """The facts about a model and its run that a reader should know, whatever else is shown."""

    def is_odd(name: str, value: str) -> bool:
        return name == "design position" and (_NEARLY in value or not any(words in value for words in _ORDINARY))

    found = [(name, value) for name, value in (*counts, *_run_rows(compilation, run)) if name in _REPORTED or is_odd(name, value)]
    return list(dict.fromkeys(found))


def summary_line(compilation: Compilation, run: Trajectory) -> str:
    """The scene, its method and the time of its run in one line."""
    return f"scene {compilation.scene}, method {compilation.method}: {_run_time(run)}; --verbose prints more"


def run_facts(compilation: Compilation, run: Trajectory) -> Table:
    """The costs of compiling and running."""
    return facts(f"scene {compilation.scene}, method {compilation.method}", _run_rows(compilation, run))


def _run_time(run: Trajectory) -> str:
    simulated = float(run.t[-1] - run.t[0]) if run.t.size else 0.0
    return f"{run.seconds:.4f} s for {simulated:g} s: {real_time(simulated, run.seconds)}"


def real_time(simulated: float, seconds: float) -> str:
    """The speed of a run as a multiple of real time; "-" where it took no time."""
    factor = simulated / seconds if seconds else 0.0
    return f"{factor:.0f} times real time" if factor >= 10 else f"{factor:.2g} times real time" if factor else "-"


def _run_rows(compilation: Compilation, run: Trajectory) -> list[tuple[str, str]]:
    c = compilation
    return [
        ("operations", f"{c.operations} an evaluation, {c.instructions} with lanes counted once"),
        ("generate", _build_time(c.generate_seconds)),
        ("compile", _compiled(c)),
        *([(SHIPPED, _GAIN)] if c.compiler == SHIPPED else []),
        ("run", _run_time(run)),
        ("steps", f"{run.steps}, {run.evaluations / max(run.steps, 1):.1f} evaluations each"),
        *([("switched to", run.fallback)] if run.fallback else []),
        *_statistics_facts(run.statistics),
        *([("work and energy", f"differ by {e.defect:.1e} J at most, of {e.kinetic + e.exchanged:.2g} J")] if (e := run.energy) else []),
        *locking_force_facts(run.locking_forces),
        *_unspecified_speeds(c.start, run.undetermined),
        *([("indeterminate", f"{', '.join(run.indeterminate)}: {LEAST}")] if run.indeterminate else []),
    ]  # fmt: skip


def _compiled(c: Compilation) -> str:
    how = f"{c.compiler}, {' '.join(c.flags)}"
    if c.implementation == Implementation.INTERPRETED:
        return f"none: the program is interpreted ({how.rstrip(', ')})"
    return f"{_build_time(c.compile_seconds)} ({how})"


def _unspecified_speeds(start: Start, undetermined: tuple[str, ...]) -> list[tuple[str, str]]:
    """The independent speeds chosen by the run; none if it starts at rest, since no speed is given."""
    if start.at_rest or not undetermined:
        return []
    chosen = "minimum norm" if start.closes_loops else "zero"
    return [("initial velocities not specified", f"{len(undetermined)}, {chosen}: {', '.join(undetermined)}")]


def error_facts(error: ErrorEstimate) -> Table:
    """The estimated errors of the outputs, the largest of each unit."""
    by_unit = largest_by_unit(error.max_error, error.units)
    promised = "yes; 99.5 % of such runs are within 3 times these values"
    doubt = "no: outputs do not converge with finer steps, errors may be larger"
    if error.goal is not None or error.targets:
        doubt = "no, accuracy not reached: errors of the finest steps are larger, or no longer decrease"
    if inf in error.max_error.values():
        by_unit, doubt = {}, "unknown: no run with finer or coarser steps reached its end"
    rows = [("converged", promised if error.converged else doubt)]
    if error.converged and error.rough:
        names = ", ".join(error.rough[:_NAMED]) + (f" and {len(error.rough) - _NAMED} more" if len(error.rough) > _NAMED else "")
        why = "errors above a tenth of their largest values, or not converging with finer steps; " + (
            "name them in the accuracy too" if error.targets else "use a smaller accuracy"
        )
        rows = [("converged", f"{promised}; but not {names}: {why}")]
    rows += [(error.units[name] or "1", f"{error[name]:.1e} ({name}, asked {most:g})") for name, most in error.targets.items()]
    rows += [(unit or "1", f"{value:.1e} ({name})") for unit, (value, name) in by_unit.items() if name not in error.targets]
    rows += [("warning", warning) for warning in error.warnings]
    return facts("error estimate", rows)


def largest_by_unit(errors: Mapping[str, float], units: Mapping[str, str]) -> dict[str, tuple[float, str]]:
    """The largest error of the outputs of each unit, and the output's name."""
    by_unit: dict[str, tuple[float, str]] = {}
    for name, value in errors.items():
        by_unit[units[name]] = max(by_unit.get(units[name], (-1.0, "")), (value, name))
    return by_unit


def _build_time(seconds: float) -> str:
    return f"{seconds:.2f} s" if seconds else "found in the cache"


def batch_facts(artifact: BatchArtifact, batch: Batch) -> Table:
    """The costs of compiling and running a batch."""
    compiled = _build_time(artifact.compile_seconds if artifact.binary.fresh else 0.0)
    runs = len(batch.cases)
    return facts(f"scene {artifact.scene.name}, a batch", [
        ("generate", _build_time(artifact.generate_seconds)),
        ("compile", f"{compiled} ({', '.join([artifact.binary.compiler, *filter(None, [' '.join(artifact.binary.flags)])])})"),
        ("integrator", f"{batch.settings}, runs {'in lanes' if batch.side_by_side else 'one by one'}"),
        ("runs", f"{runs} in {batch.elapsed:.3g} s, {batch.elapsed / runs * 1e3:.3g} ms each"),
        ("steps", f"{batch.seconds / runs * 1e3:.3g} ms of thread time for each run"),
        ("parameters", ", ".join(batch.names)),
        *_unspecified_speeds(artifact.start, batch.undetermined),
    ])  # fmt: skip


def _statistics_facts(statistics: RunStatistics) -> list[tuple[str, str]]:
    """The effort of a Lagrangian method or of an integrator with steps of its own."""
    facts = []
    if statistics.solver:
        fallbacks = f", {statistics.pivoting_fallbacks} with pivoting" if statistics.pivoting_fallbacks else ""
        facts = [("solver", f"{statistics.solver}, {statistics.factorisations} factorisations{fallbacks}")]
        facts += [("penalty", f"{statistics.penalty:.3g}")] if statistics.penalty == statistics.penalty else []
        facts += [("substeps", f"{statistics.substeps}")] if statistics.substeps else []
    if (residuals := statistics.residuals).position > 0:
        found = (("Phi", residuals.position), ("Phid", residuals.velocity), ("Phidd", residuals.acceleration))
        facts.append(("largest residuals", ", ".join(f"{n} {x:.1e}" for n, x in found if x == x)))
    if statistics.rejected:
        facts.append(("taken again", f"{statistics.rejected} steps"))
    if statistics.events:
        by_element = ", ".join(f"{name} {count}" for name, count in statistics.events_by_element.items())
        facts.append(("events", f"{statistics.events}: {by_element}"))
    if statistics.impacts:
        facts.append(("impacts", "; ".join(f"'{x.element}' at {x.time:.6g} s, {x.work:.3g} J" for x in statistics.impacts)))
    if statistics.stiff_steps > max(STIFF * statistics.iterations, FEW_STEPS):
        advice = "use an implicit integrator, as the method recursive-newton has by default"
        facts.append(("stiff", f"{statistics.stiff_steps} steps limited by stability, not accuracy: {advice}"))
    return facts
