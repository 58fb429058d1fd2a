"""Makes the run file of a task from a model, a scene and the caller's values."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from fractions import Fraction
from math import gcd, isfinite, lcm
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

from cutjoint.elements.joint import ATTITUDE
from cutjoint.formulate.inputs import input_parameters, tunable_parameters
from cutjoint.methods import DEFAULT_METHOD, INTEGRATORS, METHODS, Implementation, join_or
from cutjoint.model.elements.mass import mass_problems
from cutjoint.model.errors import nearest
from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.expressions.parse import quantity_symbol
from cutjoint.model.expressions.quantities import JOINT_QUANTITIES
from cutjoint.model.ranges import StepsError, count_steps, fault_of, fault_of_state
from cutjoint.model.records import VALUE, Aim, Binding, Body, Model, Scalar, Scene
from cutjoint.model.scenes.starts import fault_of_quaternion, normalised
from cutjoint.package.errors import RunError
from cutjoint.run.inputs import InputLike, input_entries, require_unit, with_constant_inputs
from cutjoint.run.inputs import constant_inputs as constant_inputs
from cutjoint.run.record import RunFile, Settings
from cutjoint.run.road_field import surface_of
from cutjoint.run.roads import WheelRoad, road_pieces
from cutjoint.run.settings import Options, find_settings, with_options

if TYPE_CHECKING:
    from cutjoint.analysis.assemblies import Assemblies
    from cutjoint.analysis.trim_equations import TrimInputs
    from cutjoint.analysis.trims import Trimmed

_NOTHING_ASKED = Options()

#: The part that depends on parameters without being in a run file: the check of masses and inertias.
MASSES = "masses"
#: The last formulated start; the runs of a batch use it again with other parameters.
_LAST: list[tuple[Model, Scene, Any]] = []
#: The most samples of a controller in a run.
MOST_SAMPLES = 1e8
#: The largest distance of a number of steps from a whole one.
_WHOLE = 1e-6


def parameter_values(model: Model, changes: Mapping[str, float]) -> dict[str, float]:
    """The tunable parameters with their values after ``changes`` (SI units); changes of inputs are ignored.
    Raises RunError: a change names neither a tunable parameter nor an input, has no finite value, or a unit that is not the parameter's."""
    known, inputs = {p.name: p for p in tunable_parameters(model)}, {p.name for p in input_parameters(model)}
    values = {name: p.value for name, p in known.items()}
    for name, value in changes.items():
        if name in inputs:
            continue
        if name not in values:
            raise RunError(_unknown(model, name, sorted({*values, *inputs})))
        if fault := fault_of(value):
            raise RunError(f"parameter '{name}': {fault}")
        require_unit(known[name], value)
        values[name] = value
    return values


def _unknown(model: Model, name: str, known: list[str]) -> str:
    for p in model.parameters:
        if p.name == name:
            return f"{p.span}: parameter '{name}' has binding {p.binding}; write 'binding: param' to change it without recompiling"
    for derived in (d for d in model.derived if d.name == name):
        open_ones = [p.name for p in model.parameters if p.symbol in derived.value.free_symbols and p.name in known]
        advice = f"set {' or '.join(open_ones)}" if open_ones else "give one of them binding: param and set that"
        return f"{derived.span}: parameter '{name}' follows from other parameters; {advice}"
    places = [f"{scene}.{entry}" for scene, s in model.scenes.items() for entry in s.entries if entry.partition(".")[2] == name] or [name]
    number = f"; --tunable {places[0]} makes a parameter of that name" if "." in name and places[0] not in known else ""
    hint = nearest(name, known, "it has") or "it has none"
    return f"model '{model.name}' has no parameter '{name}'; {hint.replace('it has:', 'it has')}{number}"


def make_run_file(
    model: Model, scene: Scene, changes: Mapping[str, float], *, task: str, out: str = "", method: str = DEFAULT_METHOD,
    implementation: Implementation = Implementation.GENERATED, options: Options = _NOTHING_ASKED,
    inputs: Mapping[str, InputLike] = MappingProxyType({}), fits_samples: bool = True,
) -> RunFile:  # fmt: skip
    """Make the run file of a task.

    Tasks are "simulate", "realtime" and "equilibrium".  ``changes`` are values (SI units) of tunable parameters and constant
    inputs.  ``inputs`` are constants or tables over time; other inputs follow the scene.

    The caller adds optional entries: "steps_out" (iterations and residuals of each step) and "coordinates_out".  With ``fits_samples``, a
    given fixed step must divide the intervals of controllers.

    Raises:
        RunError: a change names neither a tunable parameter nor an input, has no finite value, or leaves the start or a road
            without a finite value; an input is given wrongly; settings do not go together, or one is out of its range; the run has no
            steps, or too many.
    """
    model, scene, inputs = trimmed(model, scene, changes, inputs)
    scene = with_options(scene, method, options, has_rows=task != "realtime")
    settings = find_settings(scene, METHODS[method], implementation, options)
    parameters = parameter_values(model, changes)
    constant = constant_inputs(model, changes)
    if twice := [name for name in inputs if name in constant]:
        raise RunError(f"input '{twice[0]}' is given twice; give it in one of the two ways")
    every = {**constant, **inputs}
    entries = input_entries(model, scene, every)
    if task in ("simulate", "realtime"):
        _require_steps(scene, settings, task)
        require_sampling(model, scene, settings.integrator)
        if fits_samples and scene.numerics.of_method(method).dt is not None and not INTEGRATORS[settings.integrator].adaptive:
            require_fitting_steps(model, scene, settings.dt)
    near = tuple(name for name in scene.near if name in scene.positions)
    surface = surface_of(scene.road) if any(force.has_road for force in model.forces) else None
    return RunFile(
        task=task, parameters=parameters, inputs=entries if input_parameters(model) else None, settings=settings, end=scene.end,
        output_step=scene.output_step, pose=scene.pose, near=near, out=out, surface=None if surface is None else surface.described(),
        **find_dependent_parts(model, _with_start_inputs(scene, every), parameters, (*sources_of_parts(model, scene), MASSES)),
    )  # fmt: skip


def trimmed(
    model: Model, scene: Scene, changes: Mapping[str, float], inputs: Mapping[str, InputLike] = MappingProxyType({})
) -> tuple[Model, Scene, Mapping[str, InputLike]]:  # fmt: skip
    """Solve the scene's trim, if it has one, and insert the results in model, scene and inputs; arguments as of `find_trim`."""
    if scene.trim is None:
        return model, scene, inputs
    model, found, _ = find_trim(model, scene, {**changes, **{name: _at_start(x) for name, x in inputs.items()}})
    return model, found, {**inputs, **{u.name: float(found.inputs[u.name]) for u in scene.trim.find if u.kind == "input"}}


def find_trim(model: Model, scene: Scene, changes: Mapping[str, float], by: Sequence[str] = ()) -> tuple[Model, Scene, "Trimmed"]:
    """Solve the scene's trim and insert the results in model and scene; also return the solution.
    ``changes`` are values (SI units) of parameters and inputs.  The solution has gradients ``by`` tunable parameters.

    Raises:
        RunError: there is no such start, it is not determined, or a change is one of what is to be found.
    """
    assert scene.trim is not None
    if requested := [unknown.name for unknown in scene.trim.find if unknown.name in changes]:
        words = f"trim: '{requested[0]}' is to be found; leave out its value, or take it out of 'find'"
        raise RunError(f"{scene.trim.span}: scene '{scene.name}': {words}")
    problem = make_trim_problem(model, scene, changes)
    begun, _ = with_constant_inputs(model, scene, changes)
    changed = {name: _changed(model, scene, changes, name) for name in by}
    found: Trimmed = formulated_start(model, begun).trim(problem, changed)
    inputs = {u.name: found.unknowns[u.name] for u in scene.trim.find if u.kind == "input"}
    parameters = tuple(replace(p, value=found.unknowns.get(p.name, problem.parameters.get(p.name, p.value))) for p in model.parameters)
    start = replace(
        begun, trim=None, solved_trim=found.solved, assemble=(), near=(), positions=_numbers(found.coordinates),
        rates=_numbers(found.rates), starts=_numbers(found.states), inputs={**begun.inputs, **_numbers(inputs)},
    )  # fmt: skip
    return replace(model, parameters=parameters), start, found


def _changed(model: Model, scene: Scene, changes: Mapping[str, float], name: str) -> "tuple[float, TrimInputs, TrimInputs]":
    """The step of a central difference by a tunable parameter, and the numbers of the trim problem at both of its points."""
    values = parameter_values(model, {**changes, name: changes.get(name, 0.0)})
    value = parameter_values(model, changes).get(name)
    if name not in values or value is None or any(unknown.name == name for unknown in scene.trim.find):  # type: ignore[union-attr]
        raise RunError(f"scene '{scene.name}': no gradient by '{name}'; name a tunable parameter that is given")
    step = 1e-5 * max(abs(value), 1e-3)
    less, more = (make_trim_problem(model, scene, {**changes, name: value + sign * step}) for sign in (-1, 1))
    return step, less, more


def make_trim_problem(model: Model, scene: Scene, changes: Mapping[str, float]) -> "TrimInputs":
    """The numbers of a scene's trim problem."""
    assert scene.trim is not None
    from cutjoint.analysis.trim_equations import TrimInputs  # imported here because other starts do not need it

    values = parameter_values(model, changes)
    value, plain = Evaluator(model, values), replace(scene, trim=None, assemble=())
    parts = find_dependent_parts(model, plain, values, ("positions", "rates", "roads"))
    return TrimInputs(
        parameters=values, positions=parts["positions"], rates=parts["rates"],
        roads={tyre: WheelRoad.of(**road, on_it=surface_of(scene.road)) for tyre, road in parts["roads"].items()},
        targets=[value(aim.value, f"{aim.span}: trim: '{aim.name}'") for aim in (*scene.assemble, *scene.trim.hold)],
        bounds={u.name: (value(u.bounds[0], u.name), value(u.bounds[1], u.name)) for u in scene.trim.find if u.bounds},
    )  # fmt: skip


def _numbers(values: Mapping[str, float]) -> dict[str, sympy.Float]:
    return {name: sympy.Float(value, 17) for name, value in values.items()}


def _at_start(value: InputLike) -> float:
    return float(np.interp(0.0, value["t"], value["value"]) if isinstance(value, Mapping) else value)


def _with_start_inputs(scene: Scene, inputs: Mapping[str, InputLike]) -> Scene:
    """The scene with the initial values of given inputs, if it prescribes positions to be solved for."""
    if not scene.assemble:
        return scene
    return replace(scene, inputs={**scene.inputs, **{name: sympy.Float(_at_start(x)) for name, x in inputs.items()}})


def changing_parts(model: Model, scene: Scene) -> tuple[str, ...]:
    """The parts of a run file that depend on tunable parameters, besides "parameters" itself; a trim may change all."""
    if scene.trim is not None:
        return *sources_of_parts(model, scene), "inputs", "parameters", MASSES
    symbols = {p.symbol for p in tunable_parameters(model)}
    found = symbols if scene.assemble else set()  # all coordinates may follow from any
    of_part = {name: sympy.Tuple(*expressions.values()).free_symbols for name, expressions in sources_of_parts(model, scene).items()}
    masses = (MASSES,) if any(True for _ in _changing_bodies(model)) else ()
    return (*(name for name, used in of_part.items() if (used | found if name == "positions" else used) & symbols), *masses)


def find_dependent_parts(model: Model, scene: Scene, parameters: Mapping[str, float], parts: Sequence[str]) -> dict[str, Any]:
    """Evaluate "positions", "rates" and "roads" of a run file, which may depend on parameters; `MASSES` is only checked.
    Raises RunError: with these parameters one of them has no finite value, no body can have a mass or an inertia, or no pose has the places
    that the scene wants."""
    if "positions" in parts:
        scene = with_solved_coordinates(model, scene, parameters)
    value, sources = Evaluator(model, parameters), sources_of_parts(model, scene)
    made: dict[str, Any] = {
        part: {of: value(e, _place(model, scene, part, of)) for of, e in sources[part].items()} for part in parts if part in sources
    }
    for part in made.keys() & {"positions", "rates"}:
        made[part] = _checked_states(model, scene, part, made[part])
    if "roads" in made:
        pieces = {radius: road_pieces(scene.road, radius) for radius in made["roads"].values()}
        tracks = {radius: {side: [asdict(p) for p in ps] for side, ps in of.items()} for radius, of in pieces.items()}
        roads = {radius: {**sides, "disc": scene.road.contact == "disc"} for radius, sides in tracks.items()}
        made["roads"] = {tyre: roads[radius] for tyre, radius in made["roads"].items()}
    if MASSES in parts:
        _require_masses(model, value)
    return made


def with_solved_coordinates(model: Model, scene: Scene, parameters: Mapping[str, float]) -> Scene:
    """Solve for the initial coordinates at which the scene's positions are met, and insert them in the scene.
    Raises RunError: no pose has them."""
    if not scene.assemble or scene.pose == "equilibrium":
        return scene
    value = Evaluator(model, parameters)
    positions = {name: value(e, _place(model, scene, "positions", name)) for name, e in scene.positions.items()}
    wanted = [value(aim.value, f"{aim.span}: assemble: '{aim.name}'") for aim in scene.assemble]
    found: dict[str, float] = formulated_start(model, scene).find(parameters, _checked_states(model, scene, "positions", positions), wanted)
    return replace(scene, positions={name: sympy.Float(place) for name, place in found.items()}, assemble=())


def find_assemblies(model: Model, scene: Scene) -> "Assemblies":
    """The ways in which the loops assemble where the scene's positions and its `assemble` are met, with the parameters of the file."""
    from cutjoint.analysis.assemblies import AssembledStarts  # imported here because starts do not need it

    parameters, plain = parameter_values(model, {}), replace(scene, assemble=())
    value, positions = Evaluator(model, parameters), find_dependent_parts(model, plain, parameters, ("positions",))["positions"]
    wanted = [value(aim.value, f"{aim.span}: assemble: '{aim.name}'") for aim in scene.assemble]
    return AssembledStarts(model, scene).find_all(parameters, positions, scene.near, wanted)


def describe_nearest(model: Model, scene: Scene, parameters: Mapping[str, float], section: str) -> str:
    """What a start with closed loops has in place of the scene's "positions" or "rates", in words; "" if nothing is known."""
    value, exact = Evaluator(model, parameters), replace(scene, assemble=(), trim=None)
    if section == "rates":
        if not scene.rates:
            return ""
        given = find_dependent_parts(model, exact, parameters, ("positions", "rates"))
        nearest: str = formulated_start(model, exact).describe_nearest_rates(parameters, given["positions"], given["rates"])
        return nearest
    positions = {name: e for name, e in scene.positions.items() if name not in scene.near}
    attitudes = {name: e for name, e in positions.items() if name.rpartition(".")[2] in ATTITUDE}
    units = {joint.name: JOINT_QUANTITIES[joint.kind] for joint in model.joints}
    aims = tuple(
        Aim(name=name, expression=quantity_symbol(of, quantity), value=e, unit=units[of][quantity], size=1.0, span=scene.span)
        for name, e in positions.items() if name not in attitudes for of, _, quantity in [name.rpartition(".")]
    )  # fmt: skip
    if not aims:
        return ""
    start, wanted = replace(exact, positions=attitudes, assemble=aims, near=()), [value(aim.value, aim.name) for aim in aims]
    nearest = formulated_start(model, start).describe_nearest(parameters, {n: value(e, n) for n, e in attitudes.items()}, wanted)
    return nearest


def start_follows_from(model: Model, scene: Scene, changed: Sequence[str]) -> str:
    """The first of the ``changed`` tunable parameters on which a start depends that is solved once; "" for none."""
    values, parts = parameter_values(model, {}), sources_of_parts(model, scene)
    read = [*parts["positions"].values(), *(aim.value for aim in scene.assemble)]
    if scene.trim is not None:
        read += [*parts["rates"].values(), *(aim.value for aim in scene.trim.hold), *(x for u in scene.trim.find for x in u.bounds)]
    requested = sympy.Tuple(*read).free_symbols
    used = {p.name for p in model.parameters if p.symbol in requested}
    for name in changed if scene.trim or (scene.assemble and scene.pose != "equilibrium") else ():
        numbers = make_trim_problem(model, scene, {}) if scene.trim else values
        if name in used or (name in values and formulated_start(model, scene).follows(name, numbers)):
            return name
    return ""


def formulated_start(model: Model, scene: Scene) -> Any:
    """The `TrimmedStart` of a scene with a trim, the `AimedStart` of others."""
    from cutjoint.analysis.aims import AimedStart  # imported here because other starts do not need it
    from cutjoint.analysis.trims import TrimmedStart

    start = next((start for known, of, start in [*_LAST] if model is known and scene == of), None)
    if start is None:
        _LAST[:] = [(model, scene, start := (AimedStart if scene.trim is None else TrimmedStart)(model, scene))]
    return start  # threads may have set another meanwhile


def _require_masses(model: Model, value: "Evaluator") -> None:
    for body in _changing_bodies(model):
        mass, *inertia = (value(entry, f"{body.span}: body '{body.name}': its mass or inertia") for entry in (body.mass, *body.inertia))
        if problem := next(mass_problems(mass, inertia), None):
            raise RunError(f"{body.span}: body '{body.name}': with these parameters {problem}; set other values")


def _changing_bodies(model: Model) -> Iterator[Body]:
    """The bodies whose masses or inertias depend on tunable parameters."""
    symbols = {p.symbol for p in tunable_parameters(model)}
    yield from (body for body in model.bodies if any(entry.free_symbols & symbols for entry in (body.mass, *body.inertia)))


def sources_of_parts(model: Model, scene: Scene) -> dict[str, Mapping[str, Scalar]]:
    """The expressions of the parts "positions", "rates" and "roads"; a road depends on the wheel's radius."""
    radii = {f.name: f.radius for f in model.forces if f.has_road}
    states = scene.starts if scene.pose == "equilibrium" else {s.entry: scene.starts.get(s.entry, s.initial) for s in model.states}
    return {"positions": scene.positions, "rates": {**states, **scene.rates}, "roads": radii}


def _checked_states(model: Model, scene: Scene, part: str, values: Mapping[str, float]) -> dict[str, float]:
    """The coordinates, speeds or states of a start, or the fault of one: too large, out of bounds; quaternions of length 1, normalised."""
    kinds, turned = {joint.name: joint.kind for joint in model.joints}, []
    bounds = {state.entry: state.bounds for state in model.states}
    for name, value in values.items():
        joint, _, component = name.rpartition(".")
        if component == ATTITUDE[0]:
            turned.append(joint)
            fault = fault_of_quaternion([values[f"{joint}.{e}"] for e in ATTITUDE])
            name = f"{joint}.attitude"
        else:
            is_angle = joint in kinds and JOINT_QUANTITIES[kinds[joint]].get(component) == "rad"
            fault = "" if component in ATTITUDE else fault_of_state(value, is_angle=is_angle, bounds=bounds.get(name, ()))
        if fault:
            raise RunError(f"{_place(model, scene, part, name)}: {fault}")
    return normalised(values, turned)


def _place(model: Model, scene: Scene, part: str, of: str) -> str:
    if part != "roads":
        name = of.removesuffix(f".{VALUE}")
        return f"{scene.span}: scene '{scene.name}': {part if name == of else 'states'}: '{name}'"
    return f"{next(f.span for f in model.forces if f.name == of)}: tyre '{of}': radius"


def _require_steps(scene: Scene, settings: Settings, task: str) -> None:
    try:
        count_steps(settings.dt, scene.end, scene.output_step, row_each=task == "realtime")
    except StepsError as error:
        raise RunError(f"{scene.span}: scene '{scene.name}': {error}") from None


class Evaluator:
    """Evaluates expressions over parameters; inputs have their default values."""

    def __init__(self, model: Model, changed: Mapping[str, float]) -> None:
        taken = [p for p in model.parameters if p.binding is not Binding.INPUT]
        self._names = {p.symbol: p.name for p in taken}
        self._values = {p.symbol: changed.get(p.name, p.value) for p in taken}

    def __call__(self, expression: Scalar, what: str = "an expression") -> float:
        """Return the value of an expression, which messages call ``what``. Raises RunError: it has none, or none that is finite."""
        if not hasattr(expression, "free_symbols"):
            return float(expression)
        value = evaluate(expression, self._values)
        if not isfinite(value):
            used = sorted((self._names[s], self._values[s]) for s in expression.free_symbols if s in self._names)
            raise RunError(f"{what} has no finite value with {', '.join(f'{n} = {v:g}' for n, v in used)}; set other values")
        return value


# Equal steps and the samples of controllers: steps end where a controller is due


def require_sampling(model: Model, scene: Scene, integrator: str) -> None:
    """Check that an integrator can stop at the controllers' samples, and that there are not too many.
    Raises RunError: it does not, or there are."""
    for controller in model.controllers:
        if scene.end > MOST_SAMPLES * controller.every:
            words = f"controller '{controller.name}': a run of {scene.end:.9g} s has more than {MOST_SAMPLES:.0e} samples, one each"
            raise RunError(f"{controller.span}: {words} {controller.every:.9g} s; write a longer every, or an earlier end")
    if model.controllers and integrator not in (known.name for known in INTEGRATORS.values()):
        first = model.controllers[0]
        words = f"the integrator {integrator} does not support sampling, which the controller '{first.name}' needs"
        raise RunError(f"{first.span}: {words}; use {join_or(tuple(known.name for known in INTEGRATORS.values()))}")


def require_fitting_steps(model: Model, scene: Scene, dt: float) -> None:
    """Check that fixed steps of ``dt`` (s) divide all sample intervals and offsets; RunError if not."""
    for controller in model.controllers:
        for name, time in (("every", controller.every), ("offset", controller.offset)):
            if abs(time / dt - round(time / dt)) > _WHOLE:
                words = f"steps of {dt:.9g} s do not divide {name}, {time:.9g} s, of the controller '{controller.name}'"
                raise RunError(f"{scene.span}: scene '{scene.name}': {words} (line {controller.span.line}); {_advice(model, dt)}")


def fitting_interval(model: Model, scene: Scene | None = None) -> float:
    """The longest step (s) that divides the scene's sample interval, if given, and those of controllers; else the scene's, or 0."""
    row = 0.0 if scene is None else min(scene.output_step, scene.end or scene.output_step)
    times = [time for time in (row, *(time for c in model.controllers for time in (c.every, c.offset))) if time > 0]
    parts = [Fraction(time).limit_denominator(10**9) for time in times]
    unit = lcm(*(part.denominator for part in parts))
    whole = gcd(*(int(part * unit) for part in parts)) / unit
    return whole if model.controllers and whole >= (1e-4 if row else 1e-6) * min(times) else row


def _advice(model: Model, dt: float) -> str:
    """Advice that names the nearest step that divides all times, if there is one."""
    if not (whole := fitting_interval(model)):
        return "no steps divide all intervals: write others, or leave dt out for steps that end at samples by themselves"
    nearest = min((whole / n for n in {max(1, int(whole / dt)), int(whole / dt) + 1}), key=lambda step: abs(step - dt))
    return f"the nearest steps that do are dt: {nearest:.9g}"
