"""Every force's formulas, as its interaction computes them, with its law and the law's partial derivatives; every gear's equation."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar

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
    r"body's rotation; words are the model file's own. $Q$ of a body takes a force and its moment about the pole, $\tau$ of a joint a "
    "force on its coordinate, which works along its direction or about its axis on both bodies where the joint is cut.",
)

#: Those of natural coordinates.
POINT_NOTES = (
    NOTES[0].partition(" $Q$")[0],
    "A force on a point of a body works on the displacement of that point: $Q_p$ takes it, and a point that is no coordinate hands it on "
    "to the nodes that it combines, times their coefficients; so do directions. A torque on a body works on the three directions $e_i$ of "
    "the body that are the global axes in the design position, by which "
    r"$R = [e_x, e_y, e_z]$ and $\omega = \sum e_i \times \dot e_i / 2$. A force on the position of a joint is one on an angle, which is a "
    "node, or works on the joint's points and direction as an axial force does.",
)

_FRAME_NOTE = "$E$ holds the axes as the base carries them, $G$ as the follower does."


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
        self.laws.append((letter, known, values, tuple(v for v in values if variable(v) in known.free_symbols)))
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
                if variable(v) not in law.free_symbols and v not in by:
                    continue
                word = rf"\dot {{{next(iter(letters.values()))}}}" if v == "rate" and letters else quantity_letter(v)
                if variables.get(word, block) is not block:
                    word = quantity_letter(f"{v}_{i}")
                self.b.letter(block, word)
                letters[v] = str(block.data) if block.op == "symbol" else self.b.letters.get(block, word)
                if block.op == "const" and letters[v] not in variables:
                    shown += print_blocks(self.b, [], [(f"{word} =", block)])
                variables[letters[v]] = block
            shown += explain_law(name, law, letters, by, self.model)
        return {letter: block for letter, block in variables.items() if block.op != "const"}, tuple(shown)

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

    def along(self, start: Point, end: Point, direction: Axis | Frame) -> Measured:
        """The displacement along directions, and its rate."""
        b, way = self.b, self.displacement(start, end).x
        if isinstance(direction, Frame):
            along = b.mul(b.transpose(self._axes(direction)[0]), way)
        else:
            along = b.dot(self.k.direction("", direction.of(self.force)), way)
        return Measured(x=along, v=b.rate(along))

    def coordinate(self) -> dict[str, Block]:
        """The coordinate, and its rate."""
        return {name: self.b.free(quantity_letter(name)) for name in ("position", "rate")}

    def _gets(self, place: str, force: Block) -> None:
        self.on_joint.append((rf"{place} \leftarrow {place} +", force))

    def apply_joint_force(self, force: Block) -> None:
        """A force on the coordinate, which does nothing against a guide."""
        if next(j for j in self.model.joints if j.name == self.force.joint_of).guide is None:
            self._gets(self._coordinate, force)

    _coordinate: ClassVar[str] = r"\tau"

    def apply_joint_friction(self, law: Block) -> None:
        """The law times the load of the joint."""
        self._gets(self._coordinate, self.b.mul(self.b.free("N"), law))


@dataclass(frozen=True, kw_only=True)
class PointMechanics(PageMechanics):
    """Forces on points and directions, as natural coordinates have them."""

    _coordinate: ClassVar[str] = r"Q_{\text{ position }}"

    def _at(self, at: Point) -> str:
        return f"Q_{{{self._point(at).data}}}"

    def apply_force_pair(self, start: Point, end: Point, force: Block) -> None:
        """Opposite forces on both points."""
        self._gets(self._at(end), force)
        self._gets(self._at(start), self.b.neg(force))

    def apply_force_along(self, start: Point, end: Point, direction: Axis | Frame, force: Block) -> None:
        """Opposite forces on both points, and one on the directions."""
        b, way = self.b, self.displacement(start, end).x
        if isinstance(direction, Frame):
            self.apply_force_pair(start, end, b.mul(self._axes(direction)[0], force))
            self._gets("Q_{E}", b.mul(way, b.transpose(force)))
        else:
            e = self.k.direction("", direction.of(self.force))
            self.apply_force_pair(start, end, b.scale(force, e))
            self._gets(f"Q_{{{e.data}}}", b.scale(force, way))

    def apply_force(self, at: Point, force: Block) -> None:
        """A force on a point."""
        self._gets(self._at(at), force)

    def apply_force_at_offset(self, at: Point, arm: Block, force: Block, moment: Block) -> None:
        """A force on the point, and the torque of what is beside it."""
        self.apply_force(at, force)
        self.apply_torque(at.carrier, self.b.add(self.b.cross(arm, force), moment))

    def apply_torque(self, carrier: Carrier, torque: Block) -> None:
        """Half of T x e_i on each direction."""
        e = f"e_{{{carrier} i}}"
        self._gets(f"Q_{{{e}}}", self.b.cross(self.b.scale(self.b.number(0.5), torque), self.b.free(e, 3)))

    def apply_frame_torque(self, frame: Frame, torque: Block) -> None:
        """The force on half the differences of E^T G, by the directions of both bodies."""
        b, (E, G) = self.b, self._axes(frame)
        for name, factor, axes in (("Q_{E}", -0.5, G), ("Q_{G}", 0.5, E)):
            self._gets(name, b.scale(b.number(factor), b.mul(axes, b.skew(torque))))


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


def describe(force: Force, model: Model, road: frozenset[str], mechanics: type[PageMechanics] = PageMechanics) -> ForceDescription:
    """The description of a force by what its interaction does."""
    b = Letters()
    of_letters, expressions = _with_letters(force)
    fields_of = Counter(p.field for p in force.places)
    k: Any = LetterBodies(b, frozenset(name for name, count in fields_of.items() if count > 1))
    m = mechanics(
        b=b, translator=k.translator, road=road, system=k, k=k, force=of_letters, expressions=expressions, model=model,
    )  # fmt: skip
    reported = force.interaction.act(of_letters, m)
    for name, block in reported.items():
        b.letter(block, quantity_letter(name))
    variables, laws = m.lettered()
    joins = [(rf"Q_{{{body}}} \leftarrow Q_{{{body}}} +", wrench) for body, wrench in k.added if not is_zero(wrench)]
    notes = [force.element.text, *([_FRAME_NOTE] if any(isinstance(p, Frame) for p in force.places) else [])]
    notes += ["Its joint is guided: it is reported and does nothing."] if force.joint_of and not m.on_joint else []
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
    equations: Equations, counterparts: Sequence[Counterparts], notes: tuple[str, ...] = NOTES,
    mechanics: type[PageMechanics] = PageMechanics,
) -> Chapter:
    """The forces that act in the scene; those that are switched off are named."""
    model, scene = equations.topology.model, equations.scene
    forces = {f.name: f for f in model.forces if is_active(f, scene)}
    descriptions = {name: describe(f, model, scene.road.parts, mechanics) for name, f in forces.items()}
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
