"""Topology -> Equations: index-3 formulations in natural coordinates (Cuadrado et al. 2000, sections 2.1 and 2.2).

With constant M, Phi(q, t) = 0 and the forces Q(q, qd, t), both methods solve M qdd + Phi_q^T lambda = Q.  Their tangents are

    augmented   A + constraint Phi_q^T Phi_q                              A = M + damping C + stiffness K, its symmetric part
    classical   [A, constraint Phi_q^T; constraint Phi_q, 0]              C = -dQ/dqd, K = -dQ/dq

As in the paper, the derivative of Phi_q^T lambda by q is neglected: it is small against the masses at the step sizes of the method. The
symmetric tangent also neglects the coupling among first-order states, and that of states with forces.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate

from cutjoint.elements.joint import rate_name
from cutjoint.formulate import events, records
from cutjoint.formulate.forces import guard_function, margin_slots
from cutjoint.formulate.inputs import column_slots, derive_scene_inputs, make_translator, report_columns, tunable_parameters
from cutjoint.formulate.layout import Entry, Slot, StateLayout, state_entries
from cutjoint.formulate.natural.assembly import NodalForce, NodalMatrix, mass_matrix
from cutjoint.formulate.natural.constraints import Constraint, ConstraintMaker, multipliers
from cutjoint.formulate.natural.forces import Element, ForceMaker
from cutjoint.formulate.natural.layout import Layout, lay_out
from cutjoint.formulate.natural.motion import NodeMotions
from cutjoint.formulate.natural.needs import require_coordinates
from cutjoint.formulate.natural.nodes import Form, Node, NodeKind, record
from cutjoint.formulate.natural.outputs import NaturalReporter
from cutjoint.formulate.natural.poses import place_nodes
from cutjoint.formulate.records import LeftOut, RecursiveEquations
from cutjoint.formulate.recursive.kinematics import derive_kinematics
from cutjoint.formulate.states import (
    placed_states,
    sample_function,
    sample_slots,
    state_rates,
    state_residuals,
    state_tangent,
    still_states,
)
from cutjoint.methods import METHODS
from cutjoint.model.expressions.quantities import readings_of, unit_of
from cutjoint.model.records import Model, Output, Scalar
from cutjoint.program.blocks import BindingTime, Block, Builder
from cutjoint.program.differentiate import Differentiator
from cutjoint.program.indicators import find_domains, find_indicators
from cutjoint.topology.records import Topology

_OPEN = 1e-5  #: the residual, of lengths of vectors near 1 and of m, beyond which an equation that is left out is violated


def formulate_lagrangian(
    start: RecursiveEquations, method: str, outputs: tuple[Output, ...], left_out: Collection[str] = (), *, watched: bool = False
) -> "LagrangianEquations":
    """The functions of a system in natural coordinates, see runtime/include/cutjoint/lagrangian/any_system.hpp. ``start`` are the recursive
    equations of the same model and scene; ``method`` is "augmented" or "classical"; equations named in ``left_out`` are not enforced; if
    they are ``watched``, guards stop a run that violates them. Raises ModelError: outputs that natural coordinates do not determine."""
    topology, scene = start.topology, start.scene
    model, b = topology.model, Builder()
    require_coordinates(model, scene, outputs)
    translator = make_translator(b, model)
    k = derive_kinematics(b, translator, topology, {c.joint: c for c in start.charts})
    layout = lay_out(topology, scene, (*outputs, *readings_of(model)))
    states = frozenset(b.symbol(f"v:{state.name}", 1, BindingTime.ITERATION) for state in model.states)
    motions = NodeMotions(builder=b, translator=translator, layout=layout, states=states)
    maker = ForceMaker(motions, model, scene, outputs)
    constraints = tuple(ConstraintMaker(motions, model, topology.arm).all())
    system = _System(
        b=b, motions=motions, layout=layout, constraints=tuple(_without(b, constraints, left_out)),
        elements={e.name: e for e in maker.all()}, masses=tuple(_masses(layout, model)), maker=maker, start=start,
    )  # fmt: skip
    guarded, margins = maker.guarded()
    unheld = dict(_unheld(b, topology, constraints, left_out if watched else ()))
    margins |= {equation.name: margin for equation, margin in unheld.items()}
    reported = system.elements | {e.name: e for e in guarded}
    reporter = NaturalReporter(
        model=model, motions=motions, forces=maker.quantities | {e.name: e.quantities for e in guarded}, elements=reported,
        constraints=system.constraints,
    )  # fmt: skip
    tangent = system.classical() if METHODS[method].saddle_point else system.augmented()
    placed = {
        f"{kind}:{node.name}": block for node, *blocks in place_nodes(k, topology, layout)
        for kind, block in zip(("placed", "placed_rate"), blocks, strict=True)
    } | placed_states(b, model)  # fmt: skip
    dynamic_residual = system.dynamic_residual()
    constraint_residual, may_jump = system.constraint_residual(), events.guides_jump(model, scene)
    laws = derive_scene_inputs(b, model, scene, dynamic_residual.values(), events=may_jump)
    indicators = [*find_indicators(b, constraint_residual.values()), *laws.indicators] if may_jump else []
    domains = [*find_domains(b, dynamic_residual.values()), *laws.domains]
    functions = records.system_functions(
        initial_coordinates=placed, dynamic_residual=dynamic_residual, tangent=tangent, constraint_residual=constraint_residual,
        apply_jacobian_transposed=system.apply_jacobian_transposed(), apply_jacobian=system.apply_jacobian(),
        report=report_columns(b, reporter.quantity, outputs), energy=system.energy(),
    )  # fmt: skip
    return LagrangianEquations(
        topology=topology, scene=scene, builder=b, parameters=tunable_parameters(model),
        roads=tuple(f.name for f in model.forces if f.has_road), outputs=outputs,
        columns=tuple(records.Column(name=o.column, unit=unit_of(model, o)) for o in outputs),
        functions=(
            *functions, *guard_function(margins), *events.check_functions(indicators, domains), *laws.functions,
            *sample_function(b, motions.translator, model, reporter.quantity),
        ), method=method,
        slots={
            **start.state.chart_slots({"q": "relative_q"}, dict.fromkeys(("v", "relative_v"), "relative_v")), **system.slots(),
            **column_slots(outputs), **margin_slots(model, scene, unheld), **events.check_slots(indicators, domains),
            **laws.slots, **records.energy_slots(), **sample_slots(model),
        },
        indicators=events.describe_indicators(b, indicators), domains=events.describe_domains(b, domains),
        inputs=laws.inputs, input_values=laws.length, start=start, state=system.state, layout=layout, constraints=system.constraints,
        load_arguments=records.LOAD_ARGUMENTS, left_out=tuple(unheld),
    )  # fmt: skip


def without(equations: "LagrangianEquations", left_out: Collection[str], *, watched: bool = False) -> "LagrangianEquations":
    """The system without the equations named in ``left_out``, which guards watch if they are ``watched``."""
    if not left_out:
        return equations
    return formulate_lagrangian(equations.start, equations.method, equations.outputs, left_out, watched=watched)


def _unheld(
    b: Builder, topology: Topology, constraints: Iterable[Constraint], left_out: Collection[str]
) -> Iterator[tuple[LeftOut, Block]]:  # fmt: skip
    """The equations that are not enforced, with their margins: negative where one is violated."""
    for c in constraints if left_out else ():
        for i, name in enumerate(c.names):
            if (full := f"{c.element}.{name}") in left_out:
                equation = LeftOut(name=full, span=topology.model.constraint_spans.get(c.element, topology.model.span))
                yield equation, b.sub(b.number(_OPEN * topology.arm), b.call("abs", b.take(c.residual, (i, i + 1))))


def _without(b: Builder, constraints: Iterable[Constraint], left_out: Collection[str]) -> Iterator[Constraint]:
    for c in constraints:
        remaining = c.without([name for name in c.names if f"{c.element}.{name}" in left_out], b)
        if remaining is not None:
            yield remaining


def _masses(layout: Layout, model: Model) -> Iterator[tuple[Node, Node, Scalar]]:
    """The elements of all groups' mass matrices."""
    bodies = {body.name: body for body in model.bodies}
    for group in layout.groups.values():
        for (i, j), mass in mass_matrix(group, [bodies[name] for name in group.bodies]).items():
            yield i, j, mass


@dataclass(frozen=True, kw_only=True)
class _System:
    b: Builder
    motions: NodeMotions
    layout: Layout
    constraints: tuple[Constraint, ...]
    elements: dict[str, Element]
    masses: tuple[tuple[Node, Node, Scalar], ...]
    maker: ForceMaker
    start: RecursiveEquations

    @cached_property
    def state(self) -> StateLayout:
        """The layout of the state."""
        model = self.start.topology.model
        coordinates = tuple(_coordinates(self.layout, model))
        speeds = tuple(Entry(_rate_of(entry.name), entry.element) for entry in coordinates)
        equations = tuple(Entry(f"{c.element}.{name}", c.element) for c in self.constraints for name in c.names)
        return StateLayout(q=coordinates, v=(*speeds, *state_entries(model.states)), equations=equations, states=model.states)

    def dynamic_residual(self) -> dict[str, Block]:
        """M qdd + Phi_q^T (penalty Phi + lambda) - Q, and Phi."""
        b, force = self.b, NodalForce(motions=self.motions)
        with b.section("inertia", "", "M qdd", ""):
            for i, j, mass in self.masses:
                force.add("inertia", _one(i), self.motions.times(mass, self.motions.node(j).a))
        penalty = b.symbol("penalty", 1, BindingTime.ITERATION)
        for c in self.constraints:
            with b.section("constraint", c.element, "Phi_q^T (penalty Phi + lambda)", ""):
                augmented = b.add(b.scale(penalty, c.residual), multipliers(b, c))
                for node, gradient in c.gradient.items():
                    force.add(c.element, _one(node), b.mul(b.transpose(gradient), augmented))
        for element, form, applied in self._applied_forces():
            force.add(element, form, b.neg(applied))
        residuals = {f"residual:{c.symbol}": c.residual for c in self.constraints}
        residuals |= state_residuals(b, self.motions.translator, self.start.topology.model)
        return {f"force_residual:{node.name}": block for node, block in force.by_coordinate().items()} | residuals

    def _applied_forces(self) -> Iterable[tuple[str, Form, Block]]:
        for body in self.start.topology.model.bodies:
            if body.mass != 0:
                yield body.name, *self.maker.weight(body)
        for element in self.elements.values():
            for action in element.actions:
                yield element.name, action.form, action.force

    def _weights(self) -> tuple[Block, ...]:
        b, column = self.b, self.b.symbol("weights", 3, BindingTime.ITERATION)
        return tuple(b.label(b.element(column, i), name) for i, name in enumerate(("damping", "stiffness", "constraint")))

    def _dynamic(self, *, symmetric: bool) -> NodalMatrix:
        """A = M + damping C + stiffness K, or its symmetric part."""
        b, matrix = self.b, NodalMatrix(motions=self.motions)
        damping, stiffness, _ = self._weights()
        for i, j, mass in self.masses:
            matrix.add("inertia", _one(i), _one(j), self.motions.times(mass, b.identity(3)))
        for element in self.elements.values():
            with b.section("tangent", element.name, "damping C + stiffness K", ""):
                for t in element.tangents(self.motions):
                    block = b.add(b.scale(damping, t.damping), b.scale(stiffness, t.stiffness))
                    if symmetric:
                        half = b.scale(b.number(0.5), block)
                        matrix.add(element.name, t.rows, t.columns, half)
                        matrix.add(element.name, t.columns, t.rows, b.transpose(half))
                    else:
                        matrix.add(element.name, t.rows, t.columns, block)
        return matrix

    def augmented(self) -> dict[str, Block]:
        """The lower triangle of A + constraint Phi_q^T Phi_q."""
        b, squares = self.b, NodalMatrix(motions=self.motions)
        for c in self.constraints:
            with b.section("tangent", c.element, "constraint Phi_q^T Phi_q", ""):
                for i, g in c.gradient.items():
                    for j, h in c.gradient.items():
                        squares.add(c.element, _one(i), _one(j), b.mul(b.transpose(g), h))
        _, _, weight = self._weights()
        matrix = self._dynamic(symmetric=True)
        with b.section("tangent", "", "M + damping C + stiffness K + constraint Phi_q^T Phi_q", ""):
            blocks = matrix.by_coordinate()
            for (u, w), block in squares.by_coordinate().items():
                scaled = b.scale(weight, block)
                blocks[u, w] = b.add(blocks[u, w], scaled) if (u, w) in blocks else scaled
                record(b, blocks[u, w], "total tangent", u.title, w.title)
            return self._elements(blocks, lower=True) | self._of_states(symmetric=True)

    def classical(self) -> dict[str, Block]:
        """[A, constraint Phi_q^T; constraint Phi_q, 0]."""
        b, matrix = self.b, self._dynamic(symmetric=False)
        with b.section("tangent", "", "M + damping C + stiffness K", ""):
            results = self._elements(matrix.by_coordinate(), lower=False) | self._of_states(symmetric=False)
            results |= self._coupling()
        _, _, weight = self._weights()
        offset, row = self._offsets(), len(self.state.v)
        for c in self.constraints:
            with b.section("tangent", c.element, "constraint Phi_q", ""):
                for node, block in self._gradient(c).items():
                    for i in range(node.size):
                        for j in range(len(c.names)):
                            element = b.mul(weight, b.element(block, i, j))
                            results[f"tangent:{offset[node] + i},{row + j}"] = element
                            results[f"tangent:{row + j},{offset[node] + i}"] = element
            row += len(c.names)
        return results

    def _of_states(self, *, symmetric: bool) -> dict[str, Block]:
        translator, model, (damping, _, _) = self.motions.translator, self.start.topology.model, self._weights()
        entries = state_tangent(self.b, translator, self.state, model, damping, symmetric=symmetric)
        return {f"tangent:{row},{column}": block for row, column, block in entries}

    def _coupling(self) -> dict[str, Block]:
        """The entries of forces by first-order states, and of these by coordinates and speeds."""
        b, motions, model, (damping, stiffness, _) = self.b, self.motions, self.start.topology.model, self._weights()
        offset, rates, results = self._offsets(), state_rates(self.b, motions.translator, model), dict[str, Block]()
        nodes = [(node, motions.node(node)) for node in self.layout.coordinates]
        differentiator = Differentiator(b, {block for _, m in nodes for block in (m.x, m.v)} | motions.states)
        for place, state in enumerate(model.states, start=self.state.speeds):
            applied, x = NodalForce(motions=motions), b.symbol(f"v:{state.name}", 1, BindingTime.ITERATION)
            for element in self.elements.values():
                for action in element.actions:
                    if x in (jacobian := differentiator.jacobian(action.force)):
                        applied.add(element.name, action.form, b.neg(b.scale(damping, jacobian[x])))
            for node, block in applied.by_coordinate().items():
                results |= {f"tangent:{offset[node] + i},{place}": b.element(block, i) for i in range(node.size)}
            jacobian = differentiator.jacobian(rates[state.name])
            for node, m in nodes:
                parts = [b.scale(weight, jacobian[by]) for weight, by in ((stiffness, m.x), (damping, m.v)) if by in jacobian]
                block = b.neg(b.total([b.zero(1, node.size), *parts]))
                results |= {f"tangent:{place},{offset[node] + i}": b.element(block, 0, i) for i in range(node.size) if parts}
        return results

    def _gradient(self, c: Constraint) -> dict[Node, Block]:
        """A constraint's Phi_q^T by the coordinates that it depends on."""
        gradients = NodalForce(motions=self.motions)
        for node, gradient in c.gradient.items():
            gradients.add(c.element, _one(node), self.b.transpose(gradient))
        by_coordinate = gradients.by_coordinate()
        return {node: by_coordinate[node] for node in gradients.parts}

    def _offsets(self) -> dict[Node, int]:
        nodes = self.layout.coordinates
        return dict(zip(nodes, accumulate((node.size for node in nodes), initial=0), strict=False))

    def _elements(self, blocks: Mapping[tuple[Node, Node], Block], *, lower: bool) -> dict[str, Block]:
        offset = self._offsets()
        results: dict[str, Block] = {}
        for (u, w), block in blocks.items():
            for i in range(u.size):
                for j in range(w.size):
                    row, column = offset[u] + i, offset[w] + j
                    if row >= column or not lower:
                        results[f"tangent:{row},{column}"] = self.b.element(block, i, j)
        return results

    def constraint_residual(self) -> dict[str, Block]:
        """Phi, Phid and Phidd."""
        b = self.b
        results: dict[str, Block] = {}
        for c in self.constraints:
            for block in (c.residual, c.rate, c.drift):
                b.record(block, "constraint", c.element)
            bend = b.add(c.drift, self._times_gradient(c, "a"))
            results |= {f"residual:{c.symbol}": c.residual, f"rate:{c.symbol}": c.rate, f"curvature:{c.symbol}": bend}
        return results

    def _times_gradient(self, c: Constraint, rate: str) -> Block:
        """Phi_q qd or Phi_q qdd."""
        b = self.b
        products = (b.mul(gradient, getattr(self.motions.node(node), rate)) for node, gradient in c.gradient.items())
        return b.total([b.zero(len(c.names)), *products])

    def apply_jacobian(self) -> dict[str, Block]:
        """Phi_q x, x in the place of the accelerations."""
        return {f"change:{c.symbol}": self._times_gradient(c, "a") for c in self.constraints}

    def apply_jacobian_transposed(self) -> dict[str, Block]:
        """Phi_q^T w."""
        b, force = self.b, NodalForce(motions=self.motions)
        for c in self.constraints:
            w = b.symbol(f"w:{c.symbol}", len(c.names), BindingTime.ITERATION)
            for node, gradient in c.gradient.items():
                force.add(c.element, _one(node), b.mul(b.transpose(gradient), w))
        forces = {f"force:{node.name}": block for node, block in force.by_coordinate().items()}
        return forces | still_states(b, self.start.topology.model, "force")

    def energy(self) -> dict[str, Block]:
        """T = 1/2 qd^T M qd, and P = Q . qd + lambda . Phi_t with guides; Phi_q qd = -Phi_t there."""
        b, speed = self.b, self.motions
        with b.section("energy", "", "T = 1/2 qd^T M qd,  P = Q . qd + lambda . Phi_t", ""):
            masses = [speed.times(mass, b.dot(speed.node(i).v, speed.node(j).v)) for i, j, mass in self.masses]
            powers = [b.dot(speed.of(form).v, force) for _, form, force in self._applied_forces()]
            guided = [c for c in self.constraints if c.element in self._guided()]
            guides = [b.dot(multipliers(b, c), b.sub(c.rate, self._times_gradient(c, "v"))) for c in guided]
            return records.energy_results(b, b.mul(b.number(0.5), b.total([b.zero(1), *masses])), b.total([b.zero(1), *powers, *guides]))

    def _guided(self) -> set[str]:
        """The elements whose equations guides move: guided joints, and gears with their coordinates."""
        model = self.start.topology.model
        joints = {joint.name for joint in model.joints if joint.guide is not None}
        return joints | {gear.name for gear in model.gears if any(c.joint in joints for c, _ in gear.terms)}

    def slots(self) -> dict[str, Slot]:
        """The places of coordinates and equations; those of the tangent follow from its pattern."""
        slots = {}
        for node, offset in self._offsets().items():
            arrays = {"node": "q", "node_rate": "v", "node_acceleration": "vdot", "placed": "q", "placed_rate": "v",
                      "force_residual": "force_residual", "force": "force"}  # fmt: skip
            for kind, array in arrays.items():
                slots[f"{kind}:{node.name}"] = Slot(array=array, offset=offset, names=components(node))
        first = 0
        for c in self.constraints:
            for array in records.EQUATION_ARRAYS:
                slots[f"{array}:{c.symbol}"] = Slot(array=array, offset=first, names=c.names)
            first += len(c.names)
        kinds = {"v": "v", "vdot": "vdot", "placed_rate": "v", "force_residual": "force_residual", "force": "force"}
        return slots | self.state.state_slots(kinds)


def _coordinates(layout: Layout, model: Model) -> Iterator[Entry]:
    """The elements of q, each with the joint or body of its name, else the body that carries it."""
    for node in layout.coordinates:
        element = node.title.element if node.title.element in model.constraint_spans else node.body
        for axis in "xyz"[: node.size]:
            yield Entry(node.name if node.kind is NodeKind.ANGLE else f"{node.name}.{axis}", element)


def _rate_of(coordinate: str) -> str:
    of, _, name = coordinate.rpartition(".")
    return f"{of}.{rate_name(name)}"


def components(node: Node) -> tuple[str, ...]:
    """Names of a node's scalars."""
    return ("rad",) if node.kind is NodeKind.ANGLE else ("x", "y", "z")


def _one(node: Node) -> Form:
    return {node: 1}


@dataclass(frozen=True, kw_only=True, repr=False)
class LagrangianEquations(records.SystemEquations):
    """An index-3 formulation in natural coordinates; ``method`` is "augmented" or "classical".

    Inputs by symbol: ``node:name``, ``node_rate:name``, ``node_acceleration:name``, ``lambda:constraint``, ``w:constraint``, ``penalty``,
    ``weights`` (damping, stiffness, constraint).  The results ``tangent:row,column`` are the tangent's candidates, of a symmetric
    tangent the lower triangle; their slots follow from its pattern.  ``start`` are the recursive equations that find where a run begins.
    """

    layout: Layout
    constraints: tuple[Constraint, ...]

    @property
    def angular(self) -> tuple[bool, ...]:
        """Whether each speed is one of a direction or an angle."""
        return tuple(node.kind is not NodeKind.POINT for node in self.layout.coordinates for _ in range(node.size))

    @property
    def unknown_names(self) -> tuple[str, ...]:
        """A name for each element of v: its coordinate, or the state."""
        return self.coordinate_names + self.speed_names[self.state.speeds :]

    @property
    def row_names(self) -> tuple[str, ...]:
        return self.unknown_names + (self.equation_names if METHODS[self.method].saddle_point else ())
