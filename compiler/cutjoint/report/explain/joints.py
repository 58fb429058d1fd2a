"""Every tree joint's kernel: rotation, displacement, motion subspace and drift."""

from collections.abc import Mapping, Sequence

import sympy

from cutjoint.elements.joint import DESIGN_FRAME, JointElement
from cutjoint.formulate.inputs import TIME, guide_rates, input_functions
from cutjoint.formulate.records import Equations, RecursiveEquations
from cutjoint.kernels.joints import QUATERNION, JointKernel, Matrix, derive_joint, rotation_of
from cutjoint.model.records import Joint, Model, Scalar
from cutjoint.report.explain.graph import unknowns_of
from cutjoint.report.explain.latex import equations as print_equations
from cutjoint.report.explain.latex import latex, parameter_symbols, place, text, variants, without_noise
from cutjoint.report.explain.views import Chapter, Counterparts, Entry, code, group, line_of, make_table, with_others
from cutjoint.topology.records import TreeJoint

_NOTES = (
    "For each joint: the rotation $R(q)$ and the displacement $p(q)$ of the outer joint point from the inner one, the motion subspace "
    r"$S$ with its drift $c = \dot S \dot z$, all in the inner body's axes at the inner joint point, to which the arm leads from the "
    "inner body's origin (eqs. 26, 27).",
    "A ball's rotation is that of the unit quaternion $e$; what stands behind a ball is given behind its rotation, "
    r"$\omega$ then in those axes. The cross product of two motions is the rate of the second when the first "
    r"carries it: $(v, \omega) \times (v', \omega') = (\omega \times v' + v \times \omega', \omega \times \omega')$.",
)

_BALL = rotation_of(QUATERNION)

#: A unit quaternion without symmetry.
_UNIT = (sympy.Float(0.1), sympy.Float(0.7), sympy.Float(-0.5), sympy.Float(0.5))

_SYMBOLS = {"rad": r"\varphi", "m": "s"}


def coordinate_symbol(element: JointElement, name: str) -> str:
    """The LaTeX of a coordinate of a kind, by its unit, or by its letter, and by the number that its name ends in."""
    word, _, digit = name.partition("_")
    return (word if word in DESIGN_FRAME else _SYMBOLS[element.units[name]]) + (f"_{{{digit}}}" if digit.isdigit() else "")


def joint_symbols(element: JointElement) -> dict[Scalar, str]:
    """The LaTeX of a kernel's symbols."""
    coordinates = {sympy.Symbol(f"q_{n}", real=True): coordinate_symbol(element, n) for n in element.coordinates}
    rates = [rf"\dot {coordinate_symbol(element, n)}" for n in element.coordinates] + [rf"\omega_{{{axis}}}" for axis in "xyz"]
    speeds = {sympy.Symbol(f"u_{n}", real=True): rate for n, rate in zip(element.speeds, rates, strict=False)}
    return {**coordinates, **speeds, **{e: f"e_{{{i}}}" for i, e in enumerate(QUATERNION)}}


def explain_joints(equations: RecursiveEquations, counterparts: Sequence[Counterparts]) -> Chapter:
    """The tree joints, those with equal kernels together."""
    topology = equations.topology
    joints = {t.joint.name: t for t in topology.tree}
    kernels = {name: _formulas(t, topology.model) for name, t in joints.items()}
    kinds = {name: (t.joint.kind, t.joint.guide is not None) for name, t in joints.items()}
    groups = group(list(joints), counterparts, lambda name: kinds[name], lambda name: kernels[name])
    entries = tuple(_entry([joints[n] for n in names], kernels, equations) for names in groups)
    has_ball = any(t.joint.element.has_ball for t in topology.tree)
    ball = print_equations([("R(e)", _BALL)], {e: f"e_{{{i}}}" for i, e in enumerate(QUATERNION)}) if has_ball else ()
    return Chapter(title="Tree joints", notes=_NOTES, formulas=ball, entries=entries)


def _entry(joints: Sequence[TreeJoint], kernels: Mapping[str, tuple[str, ...]], equations: RecursiveEquations) -> Entry:
    first, model = joints[0], equations.topology.model
    kind = first.joint.kind
    title = f"{kind.capitalize().replace('_', ' ')}: {with_others([t.joint.name for t in joints])}"
    others = [t.joint.name for t in joints if kernels[t.joint.name] != kernels[first.joint.name]]
    notes = [_coordinates(first.joint.element)]
    if others:
        notes.append(f"Kernel of {code(first.joint.name)}; the same with their own axes: {code(others)}.")
    notes += [first.joint.element.note] if first.joint.element.note else []
    guides = variants([t.joint.name for t in joints], [explain_guide(t.joint, equations) for t in joints])
    if guides:
        notes.append("Guided, so that the motion is known and $d$ takes in $b$ times the guide's acceleration:")
    return Entry(
        title=title, notes=tuple(notes), formulas=(*guides, *kernels[first.joint.name]),
        table=make_table(("joint", "line", "inner body", "outer body", "point", "axes", "unknowns"), (_row(t, model) for t in joints)),
    )  # fmt: skip


def _coordinates(element: JointElement) -> str:
    """The names of the kernel's symbols in the model file."""
    names = [f"${coordinate_symbol(element, n)}$ = `{n}`" for n in element.coordinates]
    if element.has_ball:
        names.append(r"quaternion $e$ with angular velocity $\omega$ = `wx`, `wy`, `wz`")
    return f"Coordinates: {', '.join(names) or 'none'}."


def _row(t: TreeJoint, model: Model) -> tuple[str, ...]:
    joint = t.joint
    ends = place(joint.at, model) + (f" to {place(joint.to, model)}" if joint.to is not None else "")
    axes = "; ".join(place(axis, model) for axis in joint.axes) or "-"
    pitch = f", pitch {text(joint.pitch, model)}" if joint.pitch is not None else ""
    reverse = ", reversed" if t.reversed else ""
    return code(joint.name), line_of(joint), code(t.parent), code(t.child) + reverse, ends, axes + pitch, unknowns_of(t)


def explain_guide(joint: Joint, equations: Equations) -> tuple[str, ...]:
    """A guided coordinate, its rate and acceleration as functions of time and of inputs, and the scene's laws of these; nothing of a free
    one."""
    if joint.guide is None:
        return ()
    model = equations.topology.model
    symbols = {**parameter_symbols(model), TIME: "t"}
    marks = ("", r"\dot ", r"\ddot ")
    used = set().union(*(guide.free_symbols for guide in joint.guide))
    return (
        *(
            f"{mark}{coordinate_symbol(joint.element, name)} = {latex(rate, symbols)}"
            for name, guide in zip(joint.element.coordinates, joint.guide, strict=True)
            for mark, rate in zip(marks, guide_rates(guide, model), strict=True)
        ),
        *(f"{symbols[u]} = {latex(law, symbols)}" for u, law in input_functions(model, equations.scene).items() if u in used),
    )


def _formulas(t: TreeJoint, model: Model) -> tuple[str, ...]:
    kernel = derive_joint(t.joint, t.reversed)
    if not kernel.u:
        return (r"R(q) = 1, \quad p(q) = 0",)
    symbols = {**parameter_symbols(model), **joint_symbols(t.joint.element)}
    rotation, *others = _matrices(kernel)
    if kernel.rotation == _BALL:
        return ("R(q) = R(e)", *print_equations(others, symbols))
    return print_equations([rotation, *others], symbols)


def _matrices(kernel: JointKernel) -> list[tuple[str, Matrix]]:
    """The kernel by name; what a ball turns is given in the axes behind the ball."""
    n, turns = len(kernel.q), sympy.diag(_BALL, _BALL)
    named = [("R(q)", kernel.rotation, _BALL), ("p(q)", kernel.displacement, _BALL)]
    if kernel.subspace.free_symbols & set(QUATERNION):
        named += [("S_z", kernel.subspace[:, :n], turns), (r"S = [S_z, S_e], \quad S_e", kernel.subspace[:, n:], turns)]
    else:
        named.append(("S", kernel.subspace, turns))
    return [_behind(*item, kernel.u) for item in (*named, ("c", kernel.drift, turns))]


def _behind(name: str, value: Matrix, turn: Matrix, u: Sequence[Scalar]) -> tuple[str, Matrix]:
    """A matrix, without the ball's rotation if that is its first factor; the ball's angular velocity is turned alike."""
    if not value.free_symbols & set(QUATERNION):
        return name, without_noise(value)
    rest = value.subs(dict(zip(QUATERNION, (1, 0, 0, 0), strict=True)))
    before = "R(e)^T" if turn is _BALL else r"\text{diag}(R(e), R(e))^T"
    return (f"{before} {name}", without_noise(rest)) if _is_turned(value, turn, rest, u) else (name, without_noise(value))


def _is_turned(value: Matrix, turn: Matrix, rest: Matrix, u: Sequence[Scalar]) -> bool:
    """Return whether value = turn rest, tried at a point without symmetry."""
    spin = sympy.Matrix(u[-3:])
    inside = rest.subs(dict(zip(u[-3:], _BALL.T * spin, strict=True)), simultaneous=True)
    symbols = sorted((value.free_symbols | inside.free_symbols) - set(QUATERNION), key=str)
    point = {s: sympy.Float(0.3 + 0.17 * i) for i, s in enumerate(symbols)} | dict(zip(QUATERNION, _UNIT, strict=True))
    return bool((turn * inside - value).subs(point).norm() < 1e-9)
