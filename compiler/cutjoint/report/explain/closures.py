"""Every cut joint's residual, Jacobian and velocity-dependent acceleration."""

from collections.abc import Mapping, Sequence

import sympy

from cutjoint.kernels import closures
from cutjoint.kernels.closures import ClosureKernel, Matrix, derive_closure
from cutjoint.methods import METHODS, START
from cutjoint.model.records import Joint, Model, Numerics, Scalar
from cutjoint.report.explain.forces import explain_gears
from cutjoint.report.explain.latex import equations as print_equations
from cutjoint.report.explain.latex import number, parameter_symbols, place, without_noise
from cutjoint.report.explain.views import Chapter, Counterparts, Entry, code, group, line_of, make_table, with_others
from cutjoint.run.settings import find_closure
from cutjoint.topology.records import Topology

_NOTES = (
    "$b$ and $f$ stand for base and follower. A residual is written over the follower's point $p$ and the base's point $p_0$, both from "
    "the follower's pole, and directions $f_k$ fixed in the follower and $b_k$ fixed in the base. Seen from the base only the former "
    r"move, with the relative motion $Z = (V, W)$, so that one Jacobian $A$ serves both bodies; $\dot A Z$ is its rate times $Z$ "
    "(eqs. 39-42); dots are the rates by that motion.",
)


def explain_closures(topology: Topology, numerics: Numerics, counterparts: Sequence[Counterparts]) -> Chapter:
    """The cut joints, those with equal kernels together, then the gears."""
    gears = explain_gears(topology.model)
    if not topology.cuts:
        return Chapter(title="Cut joints", notes=("None.", *([_numbers(numerics)] if gears else [])), formulas=(), entries=gears)
    cuts, kernels = {c.name: c for c in topology.cuts}, {c.name: derive_closure(c) for c in topology.cuts}
    formulas = {name: _formulas(kernel, topology.model) for name, kernel in kernels.items()}
    groups = group(list(cuts), counterparts, lambda name: cuts[name].kind, lambda name: formulas[name])
    entries = tuple(_entry([cuts[n] for n in names], kernels, formulas, topology.model) for names in groups)
    return Chapter(title="Cut joints", notes=(*_NOTES, _numbers(numerics)), formulas=(), entries=entries + gears)


#: The further solutions of an evaluation, by the number of corrections.
_TIMES = {1: "a second time", 2: "a second and a third time"}


def _numbers(numerics: Numerics) -> str:
    closure = find_closure(numerics, METHODS[START])
    if closure.penalty_of_each_cut:
        return (
            f"In this scene the closure is {closure.name}: a run finds the penalty of each cut joint from the mass that it feels, "
            f"an evaluation solves {_TIMES[closure.refinements]} for what the corrected multipliers change, and each step ends with a "
            "projection."
        )
    ratio, frequency = (number(x, times="e{}") for x in (numerics.damping_ratio, numerics.frequency))
    penalty = "follows from the masses" if numerics.penalty is None else f"is {number(numerics.penalty, times='e{}')}"
    return rf"In this scene the penalty $\alpha$ {penalty}, the damping ratio $\xi$ is {ratio} and the frequency $w$ is {frequency} 1/s."


def _entry(
    joints: Sequence[Joint], kernels: Mapping[str, ClosureKernel], formulas: Mapping[str, tuple[str, ...]], model: Model
) -> Entry:
    first, kernel = joints[0], kernels[joints[0].name]
    title = f"{first.kind.capitalize().replace('_', ' ')}: {with_others([j.name for j in joints])}"
    others = [j.name for j in joints if formulas[j.name] != formulas[first.name]]
    notes = [f"Equations: {code(kernel.names)}."]
    if others:
        notes.append(f"With the numbers of {code(first.name)}; the same with their own: {code(others)}.")
    headings = ["cut joint", "line", "base", "follower", "point", *(_direction_headings(kernel))]
    return Entry(
        title=title, notes=tuple(notes), formulas=formulas[first.name],
        table=make_table(headings, (_row(j, kernels[j.name], model) for j in joints)),
    )  # fmt: skip


def _direction_headings(kernel: ClosureKernel) -> list[str]:
    parts = (("b", kernel.base_directions), ("f", kernel.follower_directions))
    return [f"${letter}_{i}$" for letter, directions in parts for i in range(len(directions))]


def _row(joint: Joint, kernel: ClosureKernel, model: Model) -> list[str]:
    ends = place(joint.at, model) + (f" to {place(joint.to, model)}" if joint.to is not None else "")
    directions = (place(d, model) for d in (*kernel.base_directions, *kernel.follower_directions))
    return [code(joint.name), line_of(joint), code(joint.base), code(joint.follower), ends, *directions]


#: Names that sort last, so that what is subtracted is printed last.
_LAST = {x: sympy.Symbol(f"z_{x}", real=True) for vector in (closures.P0, *closures.B) for x in vector}


def _formulas(kernel: ClosureKernel, model: Model) -> tuple[str, ...]:
    """The kernel, its drift over the rates of p and f."""
    of_point = _rates(closures.P, closures.V + closures.W.cross(closures.P))
    of_directions = {rate: value for f in closures.F for rate, value in _rates(f, closures.W.cross(f)).items()}
    drift = kernel.drift.subs({value: rate for rate, value in {**of_point, **of_directions}.items()})
    matrices = ((r"\Phi", kernel.residual), ("A", kernel.jacobian), (r"\dot A Z", drift))
    named = [(name, without_noise(m).xreplace(_LAST)) for name, m in matrices]
    return print_equations(named, {**parameter_symbols(model), **_symbols()})


def _rates(vector: Matrix, rate: Matrix) -> dict[Scalar, Scalar]:
    """Symbols of a vector's rate, and what they stand for."""
    return {sympy.Symbol(f"{x}_rate", real=True): dx for x, dx in zip(vector, rate, strict=True)}


def _symbols() -> dict[Scalar, str]:
    """The LaTeX of a kernel's symbols and of the rates."""
    letters = {"p": closures.P, "p0": closures.P0, "V": closures.V, "W": closures.W}
    letters |= {f"f{i}": f for i, f in enumerate(closures.F)} | {f"b{i}": b for i, b in enumerate(closures.B)}
    symbols: dict[Scalar, str] = {}
    for letter, vector in letters.items():
        for axis, x in zip("xyz", vector, strict=True):
            symbols[_LAST.get(x, x)] = f"{letter[0]}_{{{letter[1:]}{axis}}}"
            symbols[sympy.Symbol(f"{x}_rate", real=True)] = rf"\dot {letter[0]}_{{{letter[1:]}{axis}}}"
    return symbols
