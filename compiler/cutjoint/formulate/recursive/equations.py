"""Topology -> Equations: the fully recursive formulation with closed loops (Cuadrado et al. 2000, section 2.3)."""

from dataclasses import replace

from cutjoint.formulate import inputs
from cutjoint.formulate.events import check_functions, check_slots, describe_domains, describe_indicators
from cutjoint.formulate.forces import guard_function, margin_slots
from cutjoint.formulate.layout import Closure, relative_layout
from cutjoint.formulate.records import Column, Function, RecursiveEquations, energy_slots
from cutjoint.formulate.recursive.embedding.elimination import embedded_reactions, range_margins
from cutjoint.formulate.recursive.embedding.open_geometry import fit_slots, loop_fits
from cutjoint.formulate.recursive.forces import add_bodies, add_forces, add_guards, find_contacts, find_rotors
from cutjoint.formulate.recursive.friction import FrictionMotion, add_friction, load_frictions
from cutjoint.formulate.recursive.gears import derive_gears
from cutjoint.formulate.recursive.kinematics import derive_kinematics
from cutjoint.formulate.recursive.loops import Closing, corrections, derive_loops
from cutjoint.formulate.recursive.outputs import Reactions, Reporter, derive_energy, prescribed_accelerations
from cutjoint.formulate.recursive.quantities import pose_slots, poses_function
from cutjoint.formulate.recursive.recursion import BodySystem
from cutjoint.formulate.recursive.solution import ClosingElements, refine, respond, solve
from cutjoint.formulate.states import sample_function, sample_slots, state_rates, still_states
from cutjoint.methods import CLOSURES, PLAIN_CLOSURE
from cutjoint.model.expressions.quantities import unit_of
from cutjoint.model.records import GROUND, Output, Scene
from cutjoint.program.blocks import BindingTime, Builder
from cutjoint.program.indicators import EventIndicator, find_domains, find_indicators
from cutjoint.topology.records import Topology

_STATE = ("const Real* q", "const Real* v")


def resolving_body(topology: Topology) -> str:
    """The body in whose axes vectors are resolved: the rotating body that carries all others, else the ground.
    In a planar mechanism, whose bodies all rotate about the normal of that plane, it is the ground too."""
    roots = [t for t in topology.tree if t.parent == GROUND]
    if len(roots) != 1:
        return GROUND
    root = roots[0]
    inside = {body for branch in topology.branches for body in branch.bodies}
    inside |= {body for embedded_loop in topology.model.embedded_loops for body in embedded_loop.bodies}
    element = root.joint.element
    turns = element.angles or element.has_ball
    if not turns or root.joint.guide is not None or root.child in inside:
        return GROUND
    in_space = any(t.joint.element.has_ball or len(t.joint.element.angles) > 1 for t in topology.tree)
    slides = len(element.coordinates) - len(element.angles)
    return root.child if in_space or slides < 2 else GROUND


def formulate_recursive(
    topology: Topology, scene: Scene, outputs: tuple[Output, ...], *, closure: str = PLAIN_CLOSURE, poses: bool = False,
    load_events: bool = False, aims: tuple[Output, ...] = (),
) -> RecursiveEquations:  # fmt: skip
    """The equations of a scene: accelerations, residuals of cut joints, and outputs.

    * ``evaluate``: q, v, lambda -> vdot and the correction of the multipliers
    * ``constraint_residual``: q, v -> residual and rate; ``project``: q, violation -> the displacement of least mass-weighted norm
    * ``report``, ``aims``, ``energy``, ``sample``: q, v, vdot, lambda -> outputs, ``aims``; kinetic energy and power; next discrete states
    * ``guard``, ``events``: q, v -> margins; indicators; ``domains``: q, v, lambda -> margins of arguments of laws
    * ``scene_inputs``: t -> inputs; with ``poses`` the function of that name

    With ``load_events`` lengths in loads of friction have indicators.
    """
    model, b = topology.model, Builder()
    charts = inputs.make_charts(topology)
    numbers = inputs.make_numbers(b, topology.closing, closure)
    k = derive_kinematics(b, inputs.make_translator(b, model), topology, {c.joint: c for c in charts}, axes=resolving_body(topology))
    system = BodySystem(builder=b)
    k.rotors = find_rotors(k, model)
    add_bodies(system, k, model)
    forces = add_forces(system, k, model, scene, (*outputs, *aims))
    margins = add_guards(system, forces, k, model, scene) | range_margins(k)
    closing = ClosingElements(loops=derive_loops(k, topology.cuts, numbers), gears=derive_gears(k, model.gears, numbers))
    loops = closing.all()
    masses, Q, frictions, refinements = dict(system.M), dict(system.Q), load_frictions(model, system), CLOSURES[closure].refinements
    begun = replace(system, M=dict(masses), Q=dict(Q), C=dict(system.C), joint_forces=dict(system.joint_forces))
    acting, (own_masses, own_forces) = replace(system, Q=Q), system.uneliminated()
    solution = solve(topology, system, k, closing, numbers)
    solution = refine(topology, masses, k, closing, numbers, solution, refinements)
    sign_changes: list[EventIndicator] = []
    if frictions:
        motion = FrictionMotion(topology=topology, masses=masses, k=k, closing=closing, numbers=numbers, times=refinements)
        solution = motion.solve(frictions, solution, acting)
    if frictions and load_events:  # loads as functions of the state: multipliers follow from penalties alone
        alone = closing.without_multipliers(b)
        with b.marked("n", "without multipliers"):
            free = refine(topology, masses, k, alone, numbers, solve(topology, begun, k, alone, numbers), refinements)
            sign_changes = replace(motion, closing=alone).load_indicators(frictions, free, acting)
    correction = corrections(b, loops, numbers, solution.errors)
    violations = {x.element.name: b.symbol(f"violation:{x.element.name}", len(x.names), BindingTime.ITERATION) for x in loops}
    step = respond(topology, masses, k, closing, numbers, violations, mark="p", origin="of gaps alone").vdot
    Zdd = prescribed_accelerations(k)
    reactions = Reactions(kinematics=k, loops=closing.loops, M=own_masses, Q=own_forces, Zdd=Zdd, acting=system.cut_joint_wrenches)
    reactions = add_friction(frictions, acting, k, forces, reactions) if frictions else reactions
    if topology.embedded:
        held = embedded_reactions(k, derive_loops(k, topology.embedded, numbers), reactions.carried, system.joint_forces)
        reactions = replace(reactions, loops=(*closing.loops, *held))
    reporter = Reporter(model=model, kinematics=k, forces=forces, loops=reactions.loops, gears=closing.gears, Zdd=Zdd, reactions=reactions)
    layout = relative_layout(charts, _closures(loops), model.states)
    accelerations = {f"vdot:{c.joint}": solution.vdot[c.joint] for c in charts}
    accelerations |= {f"vdot:{name}": rate for name, rate in state_rates(b, k.translator, model).items()}
    switching = [*accelerations.values(), *k.guided_rates]  # a jump of a guide does work even if no acceleration depends on it
    laws = inputs.derive_scene_inputs(b, model, scene, switching)
    fits = loop_fits(b, topology)
    indicators = [*find_indicators(b, switching), *laws.indicators, *sign_changes]
    domains = [*find_domains(b, accelerations.values()), *laws.domains]
    functions = (
        Function(name="evaluate", arguments=(*_STATE, "const Real* lambda", "Real* vdot", "Real* correction"), results={
            **accelerations, **{f"correction:{loop.element.name}": correction[loop.element.name] for loop in loops},
        }),
        Function(name="constraint_residual", arguments=(*_STATE, "Real* residual", "Real* rate"), results={
            **{f"residual:{loop.element.name}": loop.residual for loop in loops},
            **{f"rate:{loop.element.name}": loop.rate for loop in loops},
        }),
        Function(
            name="report", arguments=(*_STATE, "const Real* vdot", "const Real* lambda", "Real* column"),
            results=inputs.report_columns(b, reporter.quantity, outputs),
        ),
        Function(
            name="energy", arguments=(*_STATE, "const Real* vdot", "const Real* lambda", "Real* energy"),
            results=derive_energy(k, reactions, system.joint_forces, closing.gears),
        ),
        Function(name="project", arguments=("const Real* q", "const Real* violation", "Real* dz"), results={
            **{f"dz:{c.joint}": step[c.joint] for c in charts}, **still_states(b, model, "dz"),
        }),
        *([Function(  # the residuals of a trimmed start
            name="aims", arguments=(*_STATE, "const Real* vdot", "const Real* lambda", "Real* aim"),
            results=inputs.report_columns(b, reporter.quantity, aims, "aim"),
        )] if aims else []),
        *guard_function(margins),
        *check_functions(indicators, domains),
        *laws.functions,
        *sample_function(b, k.translator, model, reporter.quantity),
        *(poses_function(k, model, find_contacts(system, k, model, scene)) if poses else ()),
        *(fit.function for fit in fits),
    )  # fmt: skip
    return RecursiveEquations(
        topology=topology, scene=scene, builder=b, state=layout, parameters=inputs.tunable_parameters(model),
        roads=tuple(f.name for f in model.forces if f.has_road),
        outputs=outputs, columns=tuple(Column(name=o.column, unit=unit_of(model, o)) for o in outputs), functions=functions,
        slots={
            **layout.chart_slots({"q": "q"}, {"v": "v", "vdot": "vdot", "dz": "dz"}),
            **layout.closure_slots(("lambda", "correction", "residual", "rate", "violation")), **inputs.column_slots(outputs),
            **inputs.column_slots(aims, "aim"),
            **margin_slots(model, scene), **check_slots(indicators, domains), **laws.slots, **energy_slots(),
            **sample_slots(model), **fit_slots(fits),
            **(pose_slots(model) if poses else {}),
        },
        axes=k.axes, indicators=describe_indicators(b, indicators), domains=describe_domains(b, domains), inputs=laws.inputs,
        input_values=laws.length, fits=fits,
        load_arguments=("const Real* parameters", "const Stabilisation<Real>& stabilisation", "const Road<Real>* roads"),
    )  # fmt: skip


def _closures(loops: tuple[Closing, ...]) -> tuple[Closure, ...]:
    first, result = 0, []
    for loop in loops:
        result.append(Closure(joint=loop.element.name, first=first, names=loop.names))
        first += len(loop.names)
    return tuple(result)
