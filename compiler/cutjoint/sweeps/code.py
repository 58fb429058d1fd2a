"""The runs of a study as C++, behind the interface of a model's folder: their arguments, and the series that they leave."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy

from cutjoint.compile.folders import Standalone
from cutjoint.elements.joint import ATTITUDE
from cutjoint.emit.source import environment
from cutjoint.export.laws import expression
from cutjoint.formulate.records import Column
from cutjoint.model.expressions import variable
from cutjoint.model.records import Model, Scalar, Scene
from cutjoint.model.starts import UNIT_BOUND
from cutjoint.run.errors import RunError
from cutjoint.run.run_file import changing
from cutjoint.sweeps.expressions import symbol_of
from cutjoint.sweeps.records import Kind, Study, Variable


def with_runs(
    alone: Standalone, study: Study, scene: Scene, columns: Sequence[Column], names: Mapping[str, Sequence[str]]
) -> Standalone:  # fmt: skip
    """A folder whose library also runs a study, in lanes if it has some; ``names`` are those of its parameters, inputs, coordinates and
    speeds.

    Raises:
        RunError: the library has no place for something that the study changes.
    """
    symbols = _symbols(study.model, columns, names)
    p, calls = alone.name, _calls(alone.name, study.variables, names)
    text = environment().get_template("sweep/runs.cpp.jinja").render(
        p=p, P=p.upper(), lanes=alone.lanes, variables=study.variables, unit_bound=UNIT_BOUND,
        series=[_print(s.value, symbols) for s in study.series],
        parameters=[call for v, call in calls if v.kind in (Kind.PARAMETER, Kind.INPUT)],
        following=list(_following(p, study, scene, symbols, names)),
        starts=[call for v, call in calls if v.kind in (Kind.POSITION, Kind.RATE)],
    )  # fmt: skip
    return alone.with_code(text)


_CALLS = {
    Kind.PARAMETER: ("set_parameter", "parameter", ""), Kind.INPUT: ("set_input", "input", ", 0.0, 0.0"),
    Kind.POSITION: ("give_coordinate", "coordinate", ""), Kind.RATE: ("give_speed", "speed", ""),
}  # fmt: skip


def _calls(p: str, variables: Sequence[Variable], names: Mapping[str, Sequence[str]]) -> list[tuple[Variable, str]]:
    """The call that gives a simulation each variable but the scene."""
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
        raise RunError(f"{v.span}: {v.kind} '{v.name}': nothing in the model depends on it; leave it away")
    return list(names).index(v.name)


def _following(
    p: str, study: Study, scene: Scene, symbols: Mapping[Scalar, Scalar], names: Mapping[str, Sequence[str]]
) -> list[str]:  # fmt: skip
    """The calls that give a start everything that follows from parameters of the study."""
    model, changed = study.model, {v.name for v in study.variables if v.kind is Kind.PARAMETER}
    moving = {q.symbol for q in model.parameters if q.name in changed}
    if "roads" in changing(model, scene) and moving & _radii(model):
        reason = "a tyre's radius follows from a parameter of the study, and the road's shape from the radius"
        raise RunError(f"{scene.span}: scene '{scene.name}': {reason}; use cutjoint batch")
    calls = []
    for part, function, table in (("positions", "give_coordinate", "coordinate"), ("rates", "give_speed", "speed")):
        given = getattr(scene, part)
        for name, value in given.items():
            joint, _, component = name.rpartition(".")
            if component in ATTITUDE[1:]:
                continue  # its first component gives an attitude
            values = [given[f"{joint}.{e}"] for e in ATTITUDE] if component in ATTITUDE else [value]
            if any(each.free_symbols & moving for each in values):
                call, printed = f"{p}_{function}", ", ".join(_print(each, symbols) for each in values)
                if component in ATTITUDE:
                    call, printed = "give_attitude", f"{{{printed}}}"
                calls.append(f"{call}(sim, {list(names[table]).index(name)}, {printed})")
    return calls


def _radii(model: Model) -> set[Scalar]:
    """The parameters that tyres' radii follow from."""
    return set().union(*(f.radius.free_symbols for f in model.forces if f.has_road))


def _symbols(model: Model, columns: Sequence[Column], names: Mapping[str, Sequence[str]]) -> dict[Scalar, Scalar]:
    """The C++ text of each symbol: a place of an array, or the value of a parameter that the library does not load."""
    loaded = {name: i for i, name in enumerate(names["parameter"])}
    taken = {p.symbol: sympy.Symbol(f"parameters[{loaded[p.name]}]", real=True) for p in model.parameters if p.name in loaded}
    fixed = {p.symbol: sympy.Float(p.value, 17) for p in model.parameters if p.name not in loaded}
    outputs = {symbol_of(c.name): sympy.Symbol(f"columns[{i}]", real=True) for i, c in enumerate(columns)}
    return {**fixed, **taken, **outputs, variable("t"): sympy.Symbol("t", real=True)}


def _print(value: Scalar, symbols: Mapping[Scalar, Scalar]) -> str:
    return expression(sympy.sympify(value).xreplace(dict(symbols)))
