"""Scenes: runs of the model with their starts, inputs and settings, and the guides of joints that they lock, drive or release."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from math import inf, isfinite, isnan
from typing import Any

import sympy

from cutjoint.methods import AUTO, METHODS, PLAIN_CLOSURE, START, Loops, join_or, names_of
from cutjoint.model.document import model_file
from cutjoint.model.document.source import Path
from cutjoint.model.document.values import Table
from cutjoint.model.elements.build import GUIDES
from cutjoint.model.elements.expand import Expansion
from cutjoint.model.elements.outputs import OutputReader
from cutjoint.model.errors import nearest
from cutjoint.model.expressions.choices import Extent, measure
from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.expressions.laws import LawKind, read_law
from cutjoint.model.expressions.operations import ExpressionError, Term, check_extent
from cutjoint.model.expressions.parse import variable
from cutjoint.model.expressions.quantities import Element as Quantified
from cutjoint.model.expressions.scope import FAILED, Element, element
from cutjoint.model.expressions.units import NONE, TIME, Dimension
from cutjoint.model.ranges import RANGES, SOLVER_TOLERANCE, StepsError, count_steps
from cutjoint.model.records import STEP, Binding, Joint, Numerics, Output, Plot, Scalar, Scene, Signal
from cutjoint.model.scenes.roads import read_road
from cutjoint.model.scenes.starts import read_aim, read_aims, read_near, read_starts, read_states, read_trim
from cutjoint.model.targets import OBJECTIVES, split_target
from cutjoint.model.validate import check_guides, joints_are_known

SETTINGS = {SOLVER_TOLERANCE: "tolerance"}  #: the settings of files whose records have another name
_STEP = variable("dt")  #: the variables that penalty and frequency may have
#: Settings with two bounds, and what they do near them.
_BETWEEN = {
    "spectral_radius": "1 adds no damping, 0 damps all motion that is fast compared with a step",
    "loop_tolerance": "loop embeddings err by as many m and rad at most",
    "loop_terms": "more terms make the range of loop embeddings longer, and each evaluation dearer",
}
#: The guides that a scene gives to joints by their names, None to those that it leaves free.
Guides = Mapping[str, tuple[Scalar, ...] | None]


@dataclass(frozen=True)
class _Stage:
    """The elements and quantities that scenes refer to."""

    expansion: Expansion
    known: Mapping[str, Quantified]
    joints: Mapping[str, Joint]
    reader: OutputReader
    outputs: tuple[Output, ...]


def read_scenes(model: model_file.Document, expansion: Expansion) -> tuple[dict[str, Scene], tuple[Signal, ...]]:
    """Read all scenes, with the outputs of the model and its instances as default; and the expressions of outputs."""
    elements = expansion.elements
    known = elements.by_name()
    joints = {joint.name: joint for joint in elements.joints}
    reader = OutputReader(expansion, known)
    stage = _Stage(expansion, known, joints, reader, reader.default(model))
    scenes = {name: _read_scene(element(expansion.scope, "scene", "scenes", name), s, stage) for name, s in model.scenes.items()}
    return scenes, tuple(reader.signals.values())


def _read_scene(where: Element, scene: model_file.Scene, stage: _Stage) -> Scene:
    numerics = _numerics(where, scene.numerics)
    if numerics.loops == Loops.EMBEDDED and (method := METHODS.get(scene.method or "")) and not method.functions:
        able = join_or(names_of(METHODS, lambda m: m.functions))
        span = where.scope.source.value_span((*where.path, "numerics", "loops"))
        where.scope.problems.note(span, f"{where.label}: the method {method.name} has exact loops only; write method: {able}")
    guides = dict(read_drives(where, scene, stage.joints))
    locked = list(read_locks(where, scene, stage.joints))
    stage = replace(stage, joints=with_guides(stage.joints, {**guides, **{joint.name: None for joint in locked}}))
    positions = read_states(where, scene.positions, "positions", stage.joints)
    rates = read_states(where, scene.rates, "rates", stage.joints)
    guides |= {
        joint.name: tuple(sympy.sympify(positions.get(f"{joint.name}.{name}", 0)) for name in joint.element.coordinates) for joint in locked
    }
    stage = replace(stage, joints=with_guides(stage.joints, guides))
    if guides and joints_are_known(stage.expansion):
        check_guides(stage.joints.values(), lambda joint, message, hint: where.fail(f"joint '{joint.name}': {message}", hint))
    end = _positive(where, where.number(scene.end, TIME, ("end",)), ("end",))
    step, outputs = numerics.step if numerics.dt else min(numerics.step, end), stage.outputs
    if scene.output_step is not None:
        step = _positive(where, where.number(scene.output_step, TIME, ("output_step",)), ("output_step",))
    _require_steps(where, scene, end, step, numerics)
    inputs, reporting = _inputs(where, scene.inputs, stage), replace(where, scope=stage.expansion.reporting[""])
    for section, laws in (("inputs", scene.inputs), ("drive", scene.drive)):
        for name, law in laws.items():
            _note_short_table(where, section, name, law, end)
    if scene.outputs is not None:
        outputs = stage.reader.outputs(where, scene.outputs, (*where.path, "outputs"), "")
    return Scene(
        name=where.name,
        end=end,
        output_step=step,
        pose=scene.pose,
        positions={key: value for key, value in positions.items() if guides.get(key.rpartition(".")[0]) is None},
        rates=rates,
        starts=read_starts(where, scene, stage.expansion.elements.states),
        inputs=inputs,
        switches=_switches(where, scene.switches, stage),
        road=read_road(where, scene.road),
        numerics=numerics,
        outputs=outputs,
        span=where.span,
        method=scene.method or "",
        accuracy=None if isinstance(scene.accuracy, dict) else _above_zero(where, scene.accuracy, "accuracy"),
        targets=dict(_targets(reporting, scene, outputs, stage)),
        budget=_above_zero(where, scene.budget, "budget"),
        on_violation=scene.on_violation,
        entries={
            f"{section}.{key}": where.scope.source.key_span((*where.path, section, key))
            for section in ("positions", "rates") for key in getattr(scene, section)
        },
        guides=guides,
        plots=tuple(_plot(where, name, plot, outputs) for name, plot in scene.plots.items()),
        near=read_near(where, scene, positions),
        assemble=read_aims(reporting, scene, stage.known, stage.reader.signals),
        trim=read_trim(reporting, scene, {**stage.known, **stage.joints}, stage.reader.signals, stage.expansion.parameters, inputs),
    )  # fmt: skip


def _plot(where: Element, name: str, plot: model_file.Plot, outputs: tuple[Output, ...]) -> Plot:
    """A picture, whose columns are outputs of the scene."""
    columns = ("t", *(output.column for output in outputs))
    places: list[tuple[str, Path]] = [(plot.x, ("x",)), *((column, ("y", index)) for index, column in enumerate(plot.y))]
    for column, keys in places:
        _require_output(where, column, columns, f"plots.{name}", ("plots", name, *keys))
    return Plot(name=name, x=plot.x, y=plot.y)


def _require_output(where: Element, column: str, columns: Collection[str], label: str, keys: Path) -> bool:
    if column not in columns and not where.scope.directory.misses(column.rpartition(".")[0]):
        hint = nearest(column, columns, "columns") or "add it to the outputs"
        where.fail(f"{label}: the scene has no output '{column}'", f"add it to outputs; {hint}", keys)
    return column in columns


def _targets(where: Element, scene: model_file.Scene, outputs: tuple[Output, ...], stage: _Stage) -> Iterator[tuple[str, float]]:
    """The largest errors of outputs or of objectives of outputs, by their names and in the units of the columns."""
    factors = {output.column: output.factor for output in outputs}
    for name, number in scene.accuracy.items() if isinstance(scene.accuracy, dict) else ():
        keys, (objective, column) = ("accuracy", name), split_target(name)
        if objective and objective not in OBJECTIVES:
            where.fail(f"accuracy: '{objective}' is no objective", nearest(objective, OBJECTIVES, "objectives"), keys)
        elif _require_output(where, column, factors, "accuracy", keys):
            aim = read_aim(where, keys, number, stage.known, stage.reader.signals, of=column)
            yield name, factors[column] * where.positive(where.value(aim.value), keys)


def _above_zero(where: Element, value: int | float | str | None, key: str) -> float | None:
    """A number of whatever unit, when it is given."""
    return None if value is None else _positive(where, where.number(value, None, (key,)), (key,))


def _positive(where: Element, value: float, keys: Path) -> float:
    """A number that is reported unless it is above zero and, of a setting, in its range; NaN has been noted before."""
    most = RANGES.get(keys[-1], {}).get("most", inf) if isinstance(keys[-1], str) else inf
    _at_most(where, where.positive(value, keys), most, keys)
    return value


def _at_most(where: Element, value: float, most: float, keys: Path) -> None:
    if not (isnan(value) or value <= most):
        where.fail(f"{keys[-1]} must be at most {most if isinstance(most, int) else format(most, 'g')}", "", keys)


def _require_steps(where: Element, scene: model_file.Scene, end: float, output_step: float, numerics: Numerics) -> None:
    """Report step sizes that no run of the scene can have, although each number is valid by itself."""
    of_methods = {name: settings["dt"] for name, settings in numerics.methods.items() if "dt" in settings}
    steps = {"scene": numerics.dt or min(output_step, end), **of_methods}
    if not all(value > 0 for value in (end, output_step, *steps.values())):
        return
    if scene.output_step is not None and not output_step <= end * (1 + 1e-9):
        message = f"output_step: {output_step:g} s is longer than the run, which ends at {end:g} s"
        where.fail(message, "write a smaller output_step or a later end", ("output_step",))
    for name, dt in steps.items():
        try:
            count_steps(dt, end, output_step)
        except StepsError as error:
            message, _, hint = str(error).partition("; ")
            place: Path = ("numerics", "dt") if name == "scene" else ("numerics", "methods", name, "dt")
            where.fail(message, hint, ("end",) if message.startswith("end") or "dt" not in scene.numerics.model_fields_set else place)
            return


def _numerics(where: Element, part: model_file.Numerics) -> Numerics:
    """The settings; those of the cut joints may follow ``dt``."""
    laws = {
        key: where.scalar(getattr(part, key), of, ("numerics", key), {_STEP.name: Term(_STEP)})
        for key, of in (("penalty", NONE), ("frequency", NONE / TIME)) if getattr(part, key) not in (None, AUTO)
    }  # fmt: skip
    shares = ("damping_ratio", SOLVER_TOLERANCE, "absolute_tolerance", "spectral_radius", "loop_tolerance")
    units = {"dt": TIME, **dict.fromkeys(shares, NONE)}
    numbers = _settings(where, part, units, ("numerics",))
    methods: dict[str, dict[str, Any]] = {
        name: _settings(where, settings, {"dt": TIME, "penalty": NONE, SOLVER_TOLERANCE: NONE}, ("numerics", "methods", name))
        for name, settings in part.methods.items()
    }
    step = numbers.get("dt", STEP)
    steps = {step, *(settings["dt"] for settings in methods.values() if "dt" in settings)}
    for key, law in laws.items():
        for dt in sorted(steps):
            _require_value(where, key, law, dt)
        numbers[key] = evaluate(law, {_STEP: step})
    by_step = {key: law for key, law in laws.items() if _STEP in getattr(law, "free_symbols", ())}
    holds_by_penalty = (
        part.penalty not in (None, AUTO) or part.model_fields_set & {"damping_ratio", "frequency"} or "penalty" in methods.get(START, {})
    )
    return Numerics(
        **numbers, methods=methods, integrator=part.integrator, events=part.events, by_step=by_step,
        closure=part.closure or (PLAIN_CLOSURE if holds_by_penalty else None), loops=part.loops,
    )  # fmt: skip


def _settings(
    where: Element, part: model_file.Numerics | model_file.MethodNumerics, dimensions: Mapping[str, Dimension], keys: Path
) -> dict[str, Any]:
    """The settings that are given, each in its range."""
    settings: dict[str, Any] = {
        key: where.number(getattr(part, key), of, (*keys, key)) for key, of in dimensions.items() if getattr(part, key, None) is not None
    }
    counts = ("iterations", "multiplier_updates", "loop_terms")
    settings |= {key: getattr(part, key) for key in counts if getattr(part, key, None) is not None}
    for key, value in settings.items():
        _in_range(where, key, value, (*keys, key))
    return {SETTINGS.get(key, key): value for key, value in settings.items()}


def _require_value(where: Element, key: str, law: Scalar, dt: float) -> None:
    """Note an expression of ``dt`` whose value is none, or out of its range."""
    value = evaluate(law, {_STEP: dt})
    if isfinite(value):
        _in_range(where, key, value, ("numerics", key))
    elif isfinite(dt) and not law.has(FAILED):
        where.fail(f"{key} has no finite value at dt = {dt:g} s", "write another expression", ("numerics", key))


def _in_range(where: Element, key: str, value: float, keys: Path) -> None:
    if key in ("dt", "penalty", SOLVER_TOLERANCE, "absolute_tolerance", "iterations"):
        _positive(where, value, keys)
    elif key in _BETWEEN:
        least, most = RANGES[key]["least"], RANGES[key]["most"]
        if not (isnan(value) or least <= value <= most):
            where.fail(f"{key} must be between {least:g} and {most:g}", _BETWEEN[key], keys)
    elif not (isnan(value) or value >= 0):
        where.fail(f"{key} must not be negative", "", keys)
    else:
        _at_most(where, value, RANGES[key].get("most", inf), keys)


def _inputs(where: Element, laws: Mapping[str, Any], stage: _Stage) -> dict[str, Scalar]:
    scope = where.scope
    inputs = {p.name: p for p in stage.expansion.parameters if p.binding is Binding.INPUT}
    for name in (name for name in laws if name not in inputs and not scope.directory.misses(name)):
        hint = nearest(name, inputs, "inputs") or "give a parameter binding: input"
        where.fail(f"unknown input '{name}'", hint, ("inputs", name), at_key=True)
    names = {**scope.constants(), "t": Term(variable("t"))}
    kinds = {name: LawKind({"t": TIME}, scope.names[name].dimension) for name in inputs if name in laws}
    functions = {name: read_law(where, laws[name], kind, ("inputs", name), names) for name, kind in kinds.items()}
    _check_guides(where, {inputs[name].symbol: measure(function) for name, function in functions.items()}, stage)
    return functions


def _note_short_table(where: Element, section: str, name: str, law: Any, end: float) -> None:
    """Warn of a table over time that covers part of the scene alone and does not end level.  It is extrapolated linearly."""
    table = law.table if isinstance(law, Table) else {}
    times, values = table.get("t", ()), table.get("value", ())
    if len(times) < 2 or not all(isinstance(x, int | float) for x in (*times, *values)):
        return
    sides = ((times[0] > 0, values[0] - values[1], "begins", times[0]), (times[-1] < end, values[-1] - values[-2], "ends", times[-1]))
    for is_short, change, verb, time in sides:
        if is_short and change:
            words = f"its table {verb} at {time:g} s and is extrapolated linearly; the scene takes 0 to {end:g} s; extend the table"
            span = where.scope.source.key_span((*where.path, section, name))
            where.scope.problems.note(span, f"{where.label}: {section}.{name}: {words}")


def _check_guides(where: Element, extents: Mapping[Scalar, Extent], stage: _Stage) -> None:
    """Guides are differentiated twice with the scene's functions of time put in for their inputs."""
    guides = ((joint, guide) for joint in stage.joints.values() for guide in joint.guide or ())
    for joint, guide in guides:
        if guide.free_symbols & extents.keys():
            try:
                check_extent(guide, extents)
            except ExpressionError as error:
                where.fail(f"the guide of the joint '{joint.name}' with these inputs: {error.message}", error.hint, ("inputs",))


def _switches(where: Element, switches: Mapping[str, bool], stage: _Stage) -> dict[str, bool]:
    """Forces turned on or off, by full name; of two keys that match a force the later one counts."""
    names = [force.name for force in stage.expansion.elements.forces]
    found: dict[str, bool] = {}
    for key, active in switches.items():
        pattern = key.replace("[", "[[]").replace("?", "[?]")
        matches = [name for name in names if fnmatchcase(name, pattern)]
        if not matches and not any(fnmatchcase(name, pattern) for name in where.scope.directory.broken):
            hint = nearest(key, [*names, *where.scope.broken("forces")], "forces") or "the model has no forces"
            where.fail(f"switches: no force is called '{key}'", hint, ("switches", key), at_key=True)
        found.update(dict.fromkeys(matches, active))
    return found


def read_drives(where: Element, scene: model_file.Scene, joints: Mapping[str, Joint]) -> Guides:
    """The guides of joints that a scene drives or releases; errors are reported."""
    found: dict[str, tuple[Scalar, ...] | None] = {}
    for index, name in enumerate(scene.release):
        joint = _joint(where, name, joints, ("release", index))
        if joint is not None and joint.guide is None:
            where.fail(f"release: the joint '{name}' has no guide", "remove it here", ("release", index))
        elif joint is not None:
            found[name] = None
    laws: dict[str, dict[str, Scalar]] = {}
    for key, law in scene.drive.items():
        name, coordinate = _coordinate(where, key, joints)
        if name:
            kind = GUIDES[joints[name].element.units[coordinate]]
            laws.setdefault(name, {})[coordinate] = read_law(where, law, kind, ("drive", key), where.scope.timed())
    for name, parts in laws.items():
        names = joints[name].element.coordinates
        if missing := [other for other in names if other not in parts]:
            key = next(key for key in scene.drive if key in (name, *(f"{name}.{other}" for other in parts)))
            hint = f"add {', '.join(f'{name}.{other}' for other in missing)}"
            where.fail(f"drive: '{name}' needs a law for each coordinate", hint, ("drive", key))
        found[name] = tuple(parts.get(other, sympy.nan) for other in names)
    return found


def read_locks(where: Element, scene: model_file.Scene, joints: Mapping[str, Joint]) -> Iterator[Joint]:
    """The joints that a scene locks; errors are reported."""
    for index, name in enumerate(scene.lock):
        joint = _joint(where, name, joints, ("lock", index))
        if joint is None or not _can_be_guided(where, joint, ("lock", index)):
            continue
        if name in scene.release or any(key == name or key.rpartition(".")[0] == name for key in scene.drive):
            where.fail(f"lock: the joint '{name}' is driven or released too", "say one of them", ("lock", index))
        elif rate := next((key for key in scene.rates if key.rpartition(".")[0] == name), None):
            where.fail(f"rates: the joint '{name}' is locked", "remove its rate", ("rates", rate), at_key=True)
        else:
            yield joint


def with_guides(joints: Mapping[str, Joint], guides: Guides) -> dict[str, Joint]:
    """The joints by name with other guides."""
    return {name: replace(joint, guide=guides[name]) if name in guides else joint for name, joint in joints.items()}


def _coordinate(where: Element, key: str, joints: Mapping[str, Joint]) -> tuple[str, str]:
    """The joint and the coordinate that a key of ``drive`` names; empty where it names none."""
    name, coordinate = (key, "") if key in joints else key.rpartition(".")[::2]
    joint = _joint(where, name or key, joints, ("drive", key))
    if joint is None or not _can_be_guided(where, joint, ("drive", key)):
        return "", ""
    names = joint.element.coordinates
    if not coordinate and len(names) == 1:
        return name, names[0]
    if coordinate not in names:
        where.fail(f"drive: '{key}' names no coordinate", nearest(coordinate, names, "coordinates"), ("drive", key), at_key=True)
        return "", ""
    return name, coordinate


def _joint(where: Element, name: str, joints: Mapping[str, Joint], keys: Path) -> Joint | None:
    if name not in joints and not where.scope.directory.misses(name):
        hint = nearest(name, [*joints, *where.scope.broken("joints")], "joints")
        where.fail(f"{keys[0]}: unknown joint '{name}'", hint, keys, at_key=isinstance(keys[1], str))
    return joints.get(name)


def _can_be_guided(where: Element, joint: Joint, keys: Path) -> bool:
    able = joint.element.can_be_guided and not joint.cut
    if not able:
        what: Any = "cut" if joint.cut else joint.kind
        where.fail(f"{keys[0]}: a {what} joint has no coordinate to guide", "take another joint of the loop", keys)
    return able
