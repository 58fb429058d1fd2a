"""Topology -> Equations: the recursion's mechanics as an index-3 augmented Lagrangian in relative coordinates, with its exact tangent.

With the joints' unknowns and the cut joints' Phi = 0, a step solves

    S^T sum F + J^T (penalty Phi + lambda) = tau

The dynamic residual is that of the Newton-Euler recursion, and its tangent

    (residual)_vdot + damping (residual)_v + stiffness (residual)_q + constraint J^T J

is exact: it includes the rotation of joint axes and of constraint directions.  (The semi-recursive method of Cuadrado, Dopico,
Gonzalez, Naya, Multibody System Dynamics 12 (2004) 117-132, neglects these terms.)
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

from cutjoint.formulate import inputs, records
from cutjoint.formulate.events import check_functions, check_slots, describe_domains, describe_indicators
from cutjoint.formulate.forces import guard_function, margin_slots
from cutjoint.formulate.implicit import contributions
from cutjoint.formulate.implicit.motions import (
    Motion,
    Motions,
    StepWeights,
    augmented_multipliers,
    change,
    derive_motions,
    gear_tangent,
    joint_forces_of,
    speed_inputs,
    times,
)
from cutjoint.formulate.layout import Slot
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.formulate.recursive.embedding.elimination import embedded_reactions, range_margins
from cutjoint.formulate.recursive.embedding.open_geometry import fit_slots, loop_fits
from cutjoint.formulate.recursive.forces import add_bodies, add_forces, add_guards
from cutjoint.formulate.recursive.friction import add_friction, load_frictions
from cutjoint.formulate.recursive.gears import GearClosure, derive_gears
from cutjoint.formulate.recursive.kinematics import Kinematics, derive_kinematics
from cutjoint.formulate.recursive.loops import Closing, LoopClosure, constraint_wrenches, derive_loops, loop_errors, transport
from cutjoint.formulate.recursive.outputs import Reactions, Reporter, derive_energy, prescribed_accelerations
from cutjoint.formulate.recursive.quantities import Forces
from cutjoint.formulate.states import placed_states, sample_function, sample_slots, state_residuals, state_tangent, still_states
from cutjoint.methods import DEFAULT_CLOSURE
from cutjoint.model.expressions.dependencies import seeing_forces
from cutjoint.model.expressions.quantities import unit_of
from cutjoint.model.records import GROUND, EmbeddedLoop, Output
from cutjoint.program.blocks import BindingTime, Block, Builder, is_zero
from cutjoint.program.indicators import find_domains, find_indicators


def formulate_implicit(start: RecursiveEquations, outputs: tuple[Output, ...]) -> "ImplicitEquations":
    """The functions of a system in relative coordinates, see runtime/include/cutjoint/lagrangian/any_system.hpp.
    ``start`` are the recursive equations of the same model and scene."""
    topology, scene = start.topology, start.scene
    model, b = topology.model, Builder()
    k = derive_kinematics(b, inputs.make_translator(b, model), topology, {c.joint: c for c in start.charts})
    system = contributions.SharedForces(builder=b)
    add_bodies(system, k, model)
    masses, weights_of_masses = dict(system.M), dict(system.Q)
    forces = add_forces(system, k, model, scene, outputs)
    margins = add_guards(system, forces, k, model, scene) | range_margins(k)
    still = b.zero(1)
    numbers = inputs.Numbers(penalties={}, damping_ratio=still, frequency=still)
    loops, gears = derive_loops(k, topology.cuts, numbers), derive_gears(k, model.gears, numbers)
    penalty = b.symbol("penalty", 1, BindingTime.ITERATION)
    closed, Zdd, acting = tuple(contributions.close(k, loop, penalty) for loop in loops), prescribed_accelerations(k), system
    reactions = Reactions(kinematics=k, loops=loops, M=masses, Q=system.Q, Zdd=Zdd, acting=system.cut_joint_wrenches)
    if frictions := load_frictions(model, system):
        acting = system.copy()
        loops = tuple(each.augmented_loop for each in closed)
        within = replace(reactions, loops=loops, Q=dict(system.Q), acting=dict(system.cut_joint_wrenches))
        add_friction(frictions, system, k, Forces(), within)
        reactions = add_friction(frictions, acting, k, forces, replace(reactions, Q=dict(acting.Q), acting=dict(acting.cut_joint_wrenches)))
    system_of = _System(
        b=b, k=k, start=start, system=system, loops=loops, closed=closed, gears=gears,
        gear_multipliers=tuple(augmented_multipliers(k, gear, penalty) for gear in gears), Zdd=Zdd, M=masses, Q=weights_of_masses,
    )  # fmt: skip
    if topology.embedded:
        held = embedded_reactions(k, derive_loops(k, topology.embedded, numbers), reactions.carried, acting.joint_forces)
        reactions = replace(reactions, loops=(*loops, *held))
    reporter = Reporter(
        model=model, kinematics=k, forces=forces, loops=reactions.loops, gears=gears, Zdd=system_of.Zdd, reactions=reactions
    )  # fmt: skip
    dynamic_residual = system_of.dynamic_residual()
    switching = [*dynamic_residual.values(), *k.guided_rates]  # a jump of a guide does work even if no force depends on it
    laws = inputs.derive_scene_inputs(b, model, scene, switching)
    fits = loop_fits(b, topology)
    indicators = [*find_indicators(b, switching), *laws.indicators]
    domains = [*find_domains(b, dynamic_residual.values()), *laws.domains]
    functions = records.system_functions(
        initial_coordinates=_initial_coordinates(b, start), dynamic_residual=dynamic_residual, tangent=system_of.tangent(),
        constraint_residual=system_of.constraint_residual(), apply_jacobian_transposed=system_of.apply_jacobian_transposed(),
        apply_jacobian=system_of.apply_jacobian(), report=inputs.report_columns(b, reporter.quantity, outputs),
        energy=derive_energy(k, reactions, acting.joint_forces, gears),
    )  # fmt: skip
    return ImplicitEquations(
        topology=topology, scene=scene, builder=b, parameters=inputs.tunable_parameters(model),
        roads=tuple(f.name for f in model.forces if f.has_road), outputs=outputs,
        columns=tuple(records.Column(name=o.column, unit=unit_of(model, o)) for o in outputs),
        functions=(
            *functions, *guard_function(margins), *check_functions(indicators, domains), *laws.functions,
            *sample_function(b, k.translator, model, reporter.quantity), *(fit.function for fit in fits),
        ), method="recursive-newton",
        slots={
            **_slots(start), **inputs.column_slots(outputs), **margin_slots(model, scene), **check_slots(indicators, domains),
            **laws.slots, **records.energy_slots(), **sample_slots(model), **fit_slots(fits),
        },
        start=start, state=start.state, load_arguments=records.LOAD_ARGUMENTS,
        indicators=describe_indicators(b, indicators), domains=describe_domains(b, domains), inputs=laws.inputs, input_values=laws.length,
        fits=fits,
    )  # fmt: skip


def formulate_residual(start: RecursiveEquations, closure: str = DEFAULT_CLOSURE) -> RecursiveEquations:
    """The inverse-dynamics residual: q, v, vdot, lambda -> residuals of forces and of loop accelerations, in the axes of ``start``."""
    topology, scene = start.topology, start.scene
    model, b = topology.model, Builder()
    k = derive_kinematics(b, inputs.make_translator(b, model), topology, {c.joint: c for c in start.charts}, axes=start.axes)
    system = contributions.SharedForces(builder=b)
    add_bodies(system, k, model)
    masses, weights_of_masses = dict(system.M), dict(system.Q)
    add_forces(system, k, model, scene, ())
    Zdd, numbers = prescribed_accelerations(k), inputs.make_numbers(b, topology.closing, closure)
    loops, gears = derive_loops(k, topology.cuts, numbers), derive_gears(k, model.gears, numbers)
    if frictions := load_frictions(model, system):
        add_friction(frictions, system, k, Forces(), Reactions(
            kinematics=k, loops=loops, M=masses, Q=dict(system.Q), Zdd=Zdd, acting=dict(system.cut_joint_wrenches)
        ))  # fmt: skip
    system_of = _System(
        b=b, k=k, start=start, system=system, loops=loops, gears=gears,
        closed=tuple(contributions.close(k, loop, b.number(0.0)) for loop in loops),
        gear_multipliers=tuple(gear.multipliers for gear in gears), Zdd=Zdd, M=masses, Q=weights_of_masses,
    )  # fmt: skip
    curvature = loop_errors(k, loops, Zdd) | {g.gear.name: b.add(change(k, g, speed_inputs(k)), g.s) for g in gears}
    residual = {name: left for name, left in system_of.dynamic_residual().items() if name.startswith("force_residual:")}
    residual |= {f"curvature:{name}": b.record(left, "curvature", name) for name, left in curvature.items()}
    laws, fits = inputs.derive_scene_inputs(b, model, scene, list(residual.values())), loop_fits(b, topology)
    slots = start.state.chart_slots({"q": "q"}, {name: name for name in ("v", "vdot", "force_residual")})
    slots |= start.state.closure_slots(("lambda", "curvature"))
    arguments = (*(f"const Real* {name}" for name in ("q", "v", "vdot", "lambda")), "Real* force_residual", "Real* curvature")
    function = records.Function(name=records.FORCE_RESIDUAL, arguments=arguments, results=residual)
    return replace(
        start, builder=b, outputs=(), columns=(), functions=(function, *laws.functions, *(fit.function for fit in fits)),
        slots={**slots, **laws.slots, **fit_slots(fits)}, domains=(), indicators=(), left_out=(), inputs=laws.inputs,
        input_values=laws.length, fits=fits,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class _System:
    b: Builder
    k: Kinematics
    start: RecursiveEquations
    system: contributions.SharedForces
    loops: tuple[LoopClosure, ...]
    closed: tuple[contributions.Closed, ...]
    gears: tuple[GearClosure, ...]
    gear_multipliers: tuple[Block, ...]
    Zdd: Mapping[str, Block]
    M: Mapping[str, Block]
    Q: Mapping[str, Block]

    def dynamic_residual(self) -> dict[str, Block]:
        """S^T sum F + J^T (penalty Phi + lambda) - tau, and Phi; dependent joints add theirs to the row of the independent coordinate."""
        b, k = self.b, self.k
        results: dict[str, Block] = {}
        for body, value in self.unbalanced.items():
            joint = k.motions[body].tree_joint.joint
            if joint.name in k.topology.model.dependent_joints:
                continue
            for embedded_loop in k.topology.model.embedded_loops:
                if embedded_loop.independent == joint.name:
                    with b.section("force_residual", joint.name, "sum of derivatives times (S^T F^c - tau)", joint.span.place):
                        value = b.total([value, *self._followers_share(embedded_loop)])
            results[f"force_residual:{joint.name}"] = b.record(value, "force_residual", joint.name)
        closing: tuple[Closing, ...] = (*self.loops, *self.gears)
        results |= state_residuals(b, k.translator, self.start.topology.model)
        return results | {f"residual:{c.element.name}": b.record(c.residual, "residual", c.element.name) for c in closing}

    def _followers_share(self, embedded_loop: EmbeddedLoop) -> Iterator[Block]:
        for body in embedded_loop.bodies:
            derivative = self.k.motions[body].derivative
            if derivative is not None and body in self.unbalanced:
                yield self.b.dot(derivative, self.unbalanced[body])

    @cached_property
    def unbalanced(self) -> dict[str, Block]:
        """S^T F^c - tau of the movable joints, by their outer bodies, outermost first."""
        b, k = self.b, self.k
        carried: dict[str, Block] = {}
        results: dict[str, Block] = {}
        constraint = self._by_body(c.wrenches for c in self.closed)
        geared = joint_forces_of(k, self.gears, self.gear_multipliers)
        for body, motion in reversed(k.motions.items()):
            joint = motion.tree_joint.joint
            with b.section(
                "force_residual", joint.name, "F^c = M Zdd - Q + A^T (penalty Phi + lambda) + sum F^c,  S^T F^c - tau", joint.span.place
            ):
                inertial = b.sub(b.mul(self.M[body], self.Zdd[body]), self.system.Q[body])
                above = [carried[c] for c in carried if k.motions[c].tree_joint.parent == body]
                carried[body] = b.name(b.sub(b.total([inertial, *above]), constraint[body]), "F", body)
                S = motion.b if motion.b is not None else motion.own if motion.derivative is not None else None
                if S is not None:
                    value = b.mul(b.transpose(S), carried[body])
                    if body in self.system.joint_forces:
                        value = b.sub(value, self.system.joint_forces[body])
                    if body in geared:
                        value = b.add(value, geared[body])
                    if (armature := k.armature(body)) is not None and motion.chart is not None:
                        value = b.add(value, b.mul(armature, b.symbol(f"vdot:{joint.name}", 1, BindingTime.ITERATION)))
                    results[body] = value
        return results

    def _by_body(self, shares: Iterable[Mapping[str, Block]]) -> dict[str, Block]:
        b, sums = self.b, {body: self.b.zero(6) for body in self.k.motions}
        for share in shares:
            for body, wrench in share.items():
                if body != GROUND:
                    sums[body] = b.add(sums[body], wrench)
        return sums

    def tangent(self) -> dict[str, Block]:
        """The derivative of the dynamic residual by the unknowns."""
        motions = self._motions()
        entries: dict[tuple[Motion, Motion], Block] = {}
        by_row: dict[tuple[int, int], tuple[Motion, Motion]] = {}
        for j, k, value in self._shares(motions):
            known = by_row.setdefault((j.row, k.row), (j, k))
            entries[known] = self.b.add(entries[known], value) if known in entries else value
        results = {}
        for (j, k), value in entries.items():
            self.b.record(value, "tangent", j.body, k.body, which=(j.index, k.index))
            results[f"tangent:{j.row},{k.row}"] = value
        model, layout = self.start.topology.model, self.start.state
        own = state_tangent(self.b, self.k.translator, layout, model, motions.weights.damping, symmetric=False)
        for row, column, value in (*own, *contributions.coupled_tangent(motions, layout, model, self.system)):
            if not is_zero(value):
                name = f"tangent:{row},{column}"
                results[name] = self.b.add(results[name], value) if name in results else value
        places = {m.row: (m.body, m.index) for m in motions.all()}
        places |= {layout.speeds + i: (state.name, 0) for i, state in enumerate(model.states)}
        for (row, one), (column, other) in product(places.items(), repeat=2) if model.states else ():
            if max(row, column) >= layout.speeds and (found := results.get(f"tangent:{row},{column}")) is not None:
                self.b.record(found, "tangent", one[0], other[0], which=(one[1], other[1]))
        return results

    def _motions(self) -> Motions:
        b = self.b
        column = b.symbol("weights", 3, BindingTime.ITERATION)
        damping, stiffness, constraint = (
            b.label(b.element(column, i), name) for i, name in enumerate(("damping", "stiffness", "constraint"))
        )
        gravity = b.stack([[self.k.vector(self.start.topology.model.gravity)], [b.zero(3)]])
        return derive_motions(self.k, self.Zdd, gravity, StepWeights(damping=damping, stiffness=stiffness, constraint=constraint))

    def _shares(self, motions: Motions) -> Iterable[tuple[Motion, Motion, Block]]:
        b, variations = self.b, motions.variations()
        bodies = {body.name: body for body in self.start.topology.model.bodies}
        whole: dict[str, contributions.Composite] = contributions.composites(self.k, bodies, self.M, self.Q, self.Zdd)
        with b.section("tangent", "", "s^T (M^c c + B^c DV + xi x* F^c)", ""):
            yield from contributions.inertial_tangent(motions, whole)
        places = {f.name: f.span.place for f in self.start.topology.model.forces}
        seeing = seeing_forces(self.start.topology.model)
        for element, wrenches in self.system.wrenches.items():
            with b.section("tangent", element, "s_j^T D_k W + (xi_k x s_j)^T W", places.get(element, "")):
                for j, k, value in contributions.wrench_tangent(motions, variations, wrenches, sees=element in seeing):
                    yield j, k, b.neg(value)
        for c in self.closed:
            with b.section("tangent", c.name, "J^T J, and the turning of J^T (penalty Phi + lambda)", c.loop.joint.span.place):
                yield from contributions.penalty_tangent(motions, c.loop)
                wrenches = constraint_wrenches(self.k, c.loop, c.loop.multipliers)
                for j, k, value in contributions.wrench_tangent(motions, variations, wrenches):
                    yield j, k, b.neg(value)
        for gear, multipliers in zip(self.gears, self.gear_multipliers, strict=True):
            with b.section("tangent", gear.element.name, "J^T J", gear.element.span.place):
                yield from gear_tangent(motions, gear, multipliers)
        is_embedded = motions.columns()
        for body, force in self.system.joint_forces.items():
            with b.section("tangent", body, "tau by the joint's own motions", ""):
                own = motions.of_body[body]
                keys = dict.fromkeys(m.key for m in own)
                for j in {m.index: m for m in own}.values():
                    for key in is_embedded if seeing else keys:
                        change = b.element(variations[key].of(force), j.index)
                        if key in keys or not is_zero(change):
                            yield j, is_embedded[key][0], b.neg(times(b, j.derivative, change))
        for body, own in motions.of_body.items():
            if (armature := self.k.armature(body)) is not None:
                with b.section("tangent", body, "the armature", ""):
                    yield own[0], own[0], armature
        for j in motions.all():
            if j.derivative_change is not None:
                with b.section("tangent", j.body, "second derivatives of its functions times (S^T F^c - tau)", ""):
                    yield j, j, b.mul(j.derivative_change, b.element(self.unbalanced[j.body], j.index))

    def constraint_residual(self) -> dict[str, Block]:
        """Phi, Phid and Phidd."""
        b, results = self.b, {}
        for loop in self.loops:
            joint = loop.joint
            with b.section("closure", joint.name, "Phidd = A (Zdd_f - Zdd_b) + gamma", joint.span.place):
                base = b.mul(transport(b, self.k.pole_step(joint.base, joint.follower)), self.Zdd[joint.base])
                bend = b.add(b.mul(loop.A, b.sub(self.Zdd[joint.follower], base)), loop.s)
            for name, block in (("residual", loop.residual), ("rate", loop.rate), ("curvature", bend)):
                results[f"{name}:{joint.name}"] = b.record(block, name, joint.name)
        accelerations = speed_inputs(self.k)
        for gear in self.gears:
            name = gear.element.name
            with b.section("closure", name, "Phidd = qdd_a - ratio qdd_b", gear.element.span.place):
                bend = b.add(change(self.k, gear, accelerations), gear.drift)
            for quantity, block in (("residual", gear.residual), ("rate", gear.rate), ("curvature", bend)):
                results[f"{quantity}:{name}"] = b.record(block, quantity, name)
        return results

    def apply_jacobian(self) -> dict[str, Block]:
        """J x, x in the place of the accelerations."""
        b, moved, results = self.b, {GROUND: self.b.zero(6)}, {}
        for body, motion in self.k.motions.items():
            moved[body] = moved[motion.tree_joint.parent]
            if motion.b is not None and motion.chart is not None:
                x = b.symbol(f"vdot:{motion.chart.joint}", len(motion.chart.speed_names), BindingTime.ITERATION)
                moved[body] = b.add(moved[body], b.mul(motion.b, x))
            elif motion.follows is not None:
                independent = self.k.topology.model.dependent_joints[motion.tree_joint.joint.name].independent
                x = b.symbol(f"vdot:{independent}", 1, BindingTime.ITERATION)
                moved[body] = b.add(moved[body], b.mul(motion.follows, x))
        for loop in self.loops:
            joint = loop.joint
            with b.section("closure", joint.name, "A (x_f - x_b)", joint.span.place):
                base = b.mul(transport(b, self.k.pole_step(joint.base, joint.follower)), moved[joint.base])
                changed = b.mul(loop.A, b.sub(moved[joint.follower], base))
            results[f"change:{joint.name}"] = b.record(changed, "change", joint.name)
        given = speed_inputs(self.k)
        for gear in self.gears:
            with b.section("closure", gear.element.name, "x_a - ratio x_b", gear.element.span.place):
                changed = change(self.k, gear, given)
            results[f"change:{gear.element.name}"] = b.record(changed, "change", gear.element.name)
        return results

    def apply_jacobian_transposed(self) -> dict[str, Block]:
        """J^T w."""
        b, motions = self.b, self._motions()
        forces = {c.joint: b.zero(len(c.speed_names)) for c in self.start.charts}
        for loop in self.loops:
            for _, wrench, path in contributions.paths(motions, constraint_wrenches(self.k, loop, contributions.weights(self.k, loop))):
                for body in dict.fromkeys(m.body for m in path):
                    motion = self.k.motions[body]
                    joint = motion.tree_joint.joint.name
                    following, S = self.k.topology.model.dependent_joints.get(joint), motion.b if motion.b is not None else motion.follows
                    assert S is not None
                    joint = following.independent if following else joint
                    forces[joint] = b.sub(forces[joint], b.mul(b.transpose(S), wrench))
        weights = [b.symbol(f"w:{gear.element.name}", len(gear.names), BindingTime.ITERATION) for gear in self.gears]
        for body, force in joint_forces_of(self.k, self.gears, weights).items():
            joint = self.k.motions[body].tree_joint.joint.name
            forces[joint] = b.add(forces[joint], force)
        still = still_states(b, self.start.topology.model, "force")
        return {f"force:{joint}": b.record(block, "force", joint) for joint, block in forces.items()} | still


def _initial_coordinates(b: Builder, start: RecursiveEquations) -> dict[str, Block]:
    """The coordinates and speeds of the start are the system's own."""
    results = {}
    for c in start.charts:
        results[f"placed:{c.joint}"] = b.symbol(f"relative_q:{c.joint}", c.scalars + 4 * c.ball, BindingTime.ITERATION)
        results[f"placed_rate:{c.joint}"] = b.symbol(f"relative_v:{c.joint}", len(c.speed_names), BindingTime.ITERATION)
    return results | placed_states(b, start.topology.model)


def _slots(start: RecursiveEquations) -> dict[str, Slot]:
    """The places of inputs and results; those of the tangent follow from its pattern."""
    speeds = {name: name for name in ("v", "vdot", "relative_v", "force_residual", "force")} | {"placed_rate": "v"}
    slots = start.state.chart_slots({"q": "q", "relative_q": "relative_q", "placed": "q"}, speeds)
    balls = (c for c in start.charts if c.ball)
    names = tuple(f"{i}{j}" for i in "xyz" for j in "xyz")
    tangents = {f"ball_tangent:{c.joint}": Slot(array="weights.ball_tangents", offset=9 * i, names=names) for i, c in enumerate(balls)}
    return slots | tangents | start.state.closure_slots(records.EQUATION_ARRAYS)


@dataclass(frozen=True, kw_only=True, repr=False)
class ImplicitEquations(records.SystemEquations):
    """The index-3 formulation in relative coordinates: those of ``start``, with its charts and cut joints. Inputs by symbol: ``q:joint``,
    ``v:joint``, ``vdot:joint``, ``ball_tangent:joint`` (of a ball), ``lambda:joint``, ``w:joint``, ``penalty``, ``weights``."""
