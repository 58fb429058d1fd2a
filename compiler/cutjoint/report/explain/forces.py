"""Every force's formulas, as its interaction computes them, with its law and the law's partial derivatives; every gear's equation."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import sympy

from cutjoint.elements.gear import NAMES, TEXT, equation
from cutjoint.elements.interaction import Axis, Carrier, Frame, Place, Point
from cutjoint.formulate.forces import Lazy, Measured, is_active, variable
from cutjoint.formulate.records import Equations
from cutjoint.formulate.recursive.forces import WrenchMechanics
from cutjoint.model.records import Force, Gear, JointCoordinate, Model, Scalar
from cutjoint.program.blocks import Block, is_zero
from cutjoint.report.explain.blocks import LetterBodies, Letters, print_blocks
from cutjoint.report.explain.latex import place, quantity_letter, text, variants
from cutjoint.report.explain.laws import explain_law
from cutjoint.report.explain.views import Chapter, Counterparts, Entry, code, group, line_of, make_table, with_others

Cells = tuple[tuple[str, str], ...]

#: The forces of all methods.
NOTES = (
    r"$p$, $e$ and $\omega$ are points, directions and angular velocities of the bodies by which they are called, a dot their rate, $R$ a "
    r"body's rotation; words are the model file's own. $Q$ of a body takes a force and its moment about the pole.",
)

#: And what natural coordinates make of them.
POINT_NOTES = (
    *NOTES,
    "A force on a point of a body works on the displacement of that point: $Q_p$ takes it, and a point that is no coordinate hands it on "
    "to the nodes that it combines, times their coefficients. A torque $T$ on a body works on the three directions $e_x$, $e_y$, $e_z$ of "
    r"the body that are the global axes in the design position: $Q_{e_i}$ takes $T \times e_i / 2$.",
)

_FRAME_NOTE = (
    r"$E$ holds the axes as the base carries them, $G$ as the follower does; $\theta$ are the small rotations between them, in $E$."
)


@dataclass(frozen=True, kw_only=True)
class ForceDescription:
    """A force as the explanation shows it.

    ``actions`` are formulas of its action, ``laws`` those with its numbers; ``places`` and ``constants`` are pairs of a heading and a
    cell, the constants those that forces of a kind may share.
    """

    title: str
    notes: tuple[str, ...]
    actions: tuple[str, ...]
    laws: tuple[str, ...]
    places: Cells
    constants: Cells

    @property
    def kind(self) -> tuple[str, ...]:
        """The key of forces that are explained together."""
        return self.title, *self.notes, *self.actions


@dataclass(frozen=True, kw_only=True)
class PageMechanics(WrenchMechanics):
    """The mechanics of the recursion over letters: what an interaction computes with it is what `explain` prints."""

    b: Letters
    expressions: Mapping[Scalar, Scalar]
    model: Model
    laws: list[tuple[str, Scalar, Mapping[str, Block], tuple[str, ...]]] = field(default_factory=list)
    constants: dict[str, str] = field(default_factory=dict)
    on_joint: list[tuple[str, Block]] = field(default_factory=list)

    def scalar(self, expression: Scalar, values: Mapping[str, Block]) -> Block:
        """A letter: of a law over ``values``, which is printed with its numbers, or of a constant, which joins the table."""
        e = sympy.sympify(expression)
        known = self.expressions.get(e)
        if known is None:
            return super().scalar(e, values)
        name = str(e)
        if not values:
            self.constants[name] = text(known, self.model)
            return self.b.free(quantity_letter(name))
        field_of, _, mark = name.partition("_")
        again = sum(law is known for _, law, *_ in self.laws)
        letter = ("m" if field_of == "moment" else "f") + (f"_{mark or again}" if mark or again else "")
        self.laws.append((letter, known, values, ()))
        return self.b.free(letter)

    def law(self, law: Scalar, values: Mapping[str, Block], position: str) -> dict[str, Block]:
        """A law with its partial derivatives."""
        self.laws.append(("F", self.expressions.get(law, law), values, (position, "rate")))
        return {"force": self.b.free("F")}

    def lettered(self) -> tuple[dict[str, Block], tuple[str, ...]]:
        """The variables of the laws by their letters, and the laws over these; a rate without a name is that of the first variable."""
        variables: dict[str, Block] = {}
        shown: list[str] = []
        for i, (name, law, values, by) in enumerate(self.laws, 1):
            letters: dict[str, str] = {}
            for v, block in values.items():
                word = rf"\dot {{{next(iter(letters.values()))}}}" if v == "rate" and letters else quantity_letter(v)
                if variables.get(word, block) is not block:
                    word = quantity_letter(f"{v}_{i}")
                self.b.letter(block, word)
                letters[v] = str(block.data) if block.op == "symbol" else self.b.letters.get(block, "0")
                variables[letters[v]] = block
            used = {v: letter for v, letter in letters.items() if variable(v) in law.free_symbols or v in by}
            shown += explain_law(name, law, used, by, self.model)
        return {letter: block for letter, block in variables.items() if any(letter in line for line in shown)}, tuple(shown)

    def in_motion(self, value: Block) -> Block:
        """The value itself, as a note says."""
        return value

    def _spin(self, body: str) -> Block:
        return self.b.free(rf"\omega_{{{body}}}", 3)

    def direction(self, axis: Axis) -> Lazy:
        """A direction."""
        e = self.k.direction("", axis.of(self.force))
        return Lazy(place=lambda: e, rate=lambda: self.b.rate(e))

    def _axes(self, frame: Frame) -> tuple[Block, Block]:
        return self.b.free("E", 3, 3), self.b.free("G", 3, 3)

    def along(self, start: Point, end: Point, direction: Axis | Frame) -> Measured | Lazy:
        """The way along directions."""
        if isinstance(direction, Frame):
            return super().along(start, end, direction)
        travel = self.b.dot(self.k.direction("", direction.of(self.force)), self.displacement(start, end).x)
        return Measured(x=travel, v=self.b.rate(travel))

    def coordinate(self) -> dict[str, Block]:
        """The coordinate, and its rate."""
        return {name: self.b.free(quantity_letter(name)) for name in ("position", "rate")}

    def apply_joint_force(self, force: Block) -> None:
        """A force on the coordinate."""
        self.on_joint.append((r"\tau \leftarrow \tau +", force))

    def apply_joint_friction(self, law: Block) -> None:
        """The law times the load of the joint."""
        self.on_joint.append((r"\tau \leftarrow \tau +", self.b.mul(self.b.free("N"), law)))


def _with_letters(force: Force) -> tuple[Force, dict[Scalar, Scalar]]:
    """The force with its places and expressions replaced by their names, and the expressions by these."""
    places = {p.field: p.field for p in force.places if not isinstance(p, Frame)}
    bodies = {str(c): str(c) for c in Carrier if hasattr(force, c)}
    found: dict[Scalar, Scalar] = {}

    def named(name: str, x: Any) -> Any:
        if isinstance(x, Mapping):
            found.update({sympy.Symbol(key): value for key, value in x.items()})
            return {key: sympy.Symbol(key) for key in x}
        if isinstance(x, tuple):
            return tuple(named(f"{name}_{'xyz'[i] if len(x) == 3 else i + 1}", value) for i, value in enumerate(x))
        if not isinstance(x, sympy.Basic) or x == 0:
            return x
        found[sympy.Symbol(name)] = x
        return sympy.Symbol(name)

    others = {
        f.name: named(f.name, getattr(force, f.name))
        for f in fields(force) if f.name not in places and f.name not in bodies and not any(p.field == f.name for p in force.places)
    }
    changed: dict[str, Any] = {**others, **places, **bodies}
    return replace(force, **changed), found


def describe(force: Force, model: Model, road: frozenset[str]) -> ForceDescription:
    """The description of a force by what its interaction does."""
    b = Letters()
    of_letters, expressions = _with_letters(force)
    fields_of = Counter(p.field for p in force.places)
    k: Any = LetterBodies(b, frozenset(name for name, count in fields_of.items() if count > 1))
    m = PageMechanics(
        b=b, translator=k.translator, road=road, system=k, k=k, force=of_letters, expressions=expressions, model=model,
    )  # fmt: skip
    reported = force.interaction.act(of_letters, m)
    for name, block in reported.items():
        b.letter(block, quantity_letter(name))
    variables, laws = m.lettered()
    joins = [(rf"Q_{{{body}}} \leftarrow Q_{{{body}}} +", wrench) for body, wrench in k.added if not is_zero(wrench)]
    notes = [force.element.text, *([_FRAME_NOTE] if any(isinstance(p, Frame) for p in force.places) else [])]
    notes += ["Absent while the equilibrium is sought."] if getattr(force, "moving_only", False) else []
    return ForceDescription(
        title=str(force.element.kind.replace("_", " ").capitalize()), notes=tuple(notes),
        actions=print_blocks(b, [*reported.values(), *variables.values()], [*joins, *m.on_joint]), laws=laws,
        places=_where(force, model), constants=tuple(m.constants.items()),
    )  # fmt: skip


def _where(force: Force, model: Model) -> Cells:
    """The bodies of a force, its points, and its directions; or its joint and coordinate."""
    if force.joint_of:
        return ("joint", code(force.joint_of)), ("coordinate", code(force.coordinate_of))
    bodies = [(carrier.value, code(getattr(force, carrier))) for carrier in Carrier if hasattr(force, carrier)]
    places = sorted({p.field: p for p in force.places}.values(), key=lambda place: not isinstance(place, Point))
    return *bodies, *((place.field, _cell(place, force, model)) for place in places)


def _cell(where: Place, force: Force, model: Model) -> str:
    return "; ".join(place(axis, model) for axis in where.of(force)) if isinstance(where, Frame) else place(where.of(force), model)


# Forces


def explain_forces(
    equations: Equations, counterparts: Sequence[Counterparts], notes: tuple[str, ...] = NOTES
) -> Chapter:
    """The forces that act in the scene; those that are switched off are named."""
    model, scene = equations.topology.model, equations.scene
    forces = {f.name: f for f in model.forces if is_active(f, scene)}
    descriptions = {name: describe(f, model, scene.road.parts) for name, f in forces.items()}
    groups = group(list(forces), counterparts, lambda name: descriptions[name].kind, lambda name: descriptions[name].laws)
    entries = [_entry([forces[n] for n in names], [descriptions[n] for n in names]) for names in groups]
    off = [f for f in model.forces if f.name not in forces]
    if off:
        rows = make_table(("force", "line"), ((code(f.name), line_of(f)) for f in off))
        entries.append(Entry(title="Switched off", notes=("Not in this scene's equations.",), formulas=(), table=rows))
    return Chapter(title="Forces", notes=notes if model.forces else ("None but gravity.",), formulas=(), entries=tuple(entries))


def _entry(forces: Sequence[Force], descriptions: Sequence[ForceDescription]) -> Entry:
    first = descriptions[0]
    shared = [item for item in first.constants if all(item in m.constants for m in descriptions)]
    constants = [[item for item in m.constants if item not in shared] for m in descriptions]
    notes = [f"Constants: {', '.join(f'{name} = {value}' for name, value in shared)}."] if shared else []
    headings = ("force", "line", *(name for name, _ in (*first.places, *constants[0])))
    rows = [
        (code(f.name), line_of(f), *(cell for _, cell in (*m.places, *numbers)))
        for f, m, numbers in zip(forces, descriptions, constants, strict=True)
    ]  # fmt: skip
    names = [f.name for f in forces]
    return Entry(
        title=f"{first.title}: {with_others(names)}", notes=(*first.notes, *notes),
        formulas=(*first.actions, *variants(names, [m.laws for m in descriptions])), table=make_table(headings, rows),
    )  # fmt: skip


# Gears


def explain_gears(model: Model) -> tuple[Entry, ...]:
    """One entry for all gears, none where there is no gear."""
    return (_gear_entry(model.gears, model),) if model.gears else ()


def _gear_entry(gears: Sequence[Gear], model: Model) -> Entry:
    rows = [
        (code(g.name), line_of(g), _coordinate(g.first), ", ".join(map(_coordinate, g.coordinates[1:])), _relation(g, model))
        for g in gears
    ]  # fmt: skip
    forms = {"ratio": equation(False)} if any(g.law is None for g in gears) else {}
    forms |= {"law f": equation(True)} if any(g.law is not None for g in gears) else {}
    return Entry(
        title=f"Gears: {with_others([g.name for g in gears])}",
        notes=(f"{TEXT.capitalize()}, with all turns: {code(forms.values())}. Equations: {code(NAMES)}.",), formulas=(),
        table=make_table(("gear", "line", "q_a", "q_b", " or ".join(forms)), rows),
    )


def _relation(gear: Gear, model: Model) -> str:
    """The law of a gear, or its ratios."""
    if gear.law is not None:
        return text(gear.law, model)
    return ", ".join(text(ratio, model) for ratio in (gear.ratio, *(ratio for _, ratio in gear.others)))


def _coordinate(end: JointCoordinate) -> str:
    return code(f"{end.joint}.{end.name}")
