"""From a model and its scene to a linear model about equilibrium, a trimmed start or a moment of a run, with sampled controllers.

Discrete states of controllers become inputs of the mechanism, and their next values outputs, so that both are linearised exactly.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import sympy

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.formulate.inputs import discrete_state_name
from cutjoint.methods import DEFAULT_METHOD
from cutjoint.model.errors import nearest
from cutjoint.model.expressions.evaluate import substitute
from cutjoint.model.expressions.parse import parameter_symbol, quantity_symbol
from cutjoint.model.expressions.quantities import QuantityError, elements_of, find_quantity
from cutjoint.model.expressions.tunable import with_inputs
from cutjoint.model.records import VALUE, Binding, DiscreteState, Model, Output, Parameter, Scalar, Scene, Signal
from cutjoint.package.errors import RunError
from cutjoint.run.inputs import with_constant_inputs
from cutjoint.run.modes import require_free
from cutjoint.run.results import read_locking_forces
from cutjoint.run.run_file import find_trim, make_run_file, parameter_values
from cutjoint.run.scenes import ModelLike, load_model
from cutjoint.run.settings import PLAIN_STEPS, require_settings
from cutjoint.run.simulator import call_simulator
from cutjoint.stepping.load import load_scene
from cutjoint.stepping.simulation import Simulation
from cutjoint.stepping.state_space import SampledStateSpace, Sampler, StateSpace
from cutjoint.topology.geometry import evaluate


def find_linear_model(
    model: ModelLike, *, scene: str | None = None, at: float | None = None, inputs: Sequence[str] = (), outputs: Sequence[str] = (),
    tunable: Sequence[str] = (), parameters: Mapping[str, float] | None = None, external_wrenches: Sequence[str] = (),
    terrain: Sequence[str] = (),
) -> StateSpace | SampledStateSpace:  # fmt: skip
    """Linear model about the static equilibrium, about the start of a scene with a trim, or about the motion ``at`` a time (s).

    Controllers sample as they do in a run; `SampledStateSpace` says how.

    Args:
        inputs: names of inputs; default: all.
        outputs: names of outputs of the scene or of quantities, "element.quantity"; default: the scene's outputs.
        tunable, external_wrenches, terrain: as of `load`.

    Raises:
        ModelError, EquationsError, RunError: the model, the scene or a name is wrong.
        SimulationError: there is no such state, or it is singular.
        ToolchainError: a tool is not installed, or the compiler failed.
    """
    read, chosen = load_model(model, scene, tunable)
    read = with_inputs(read, external_wrenches=external_wrenches, terrain=terrain)
    return find_scene_linear_model(read, chosen, at=at, inputs=inputs, outputs=outputs, parameters=parameters or {})


def find_scene_linear_model(
    model: Model, scene: Scene, *, at: float | None = None, inputs: Sequence[str] = (), outputs: Sequence[str] = (),
    parameters: Mapping[str, float],
) -> StateSpace | SampledStateSpace:  # fmt: skip
    """The linear model of a scene of a model that has been read, as of `find_linear_model`, with its errors."""
    require_settings(at=at)
    parameter_values(model, parameters)
    chosen = _inputs(model, inputs)
    scene = replace(scene, outputs=tuple(_output(model, scene, name) for name in outputs) or scene.outputs)
    if not scene.outputs:
        raise RunError(f"{scene.span}: scene '{scene.name}' has no outputs: name some")
    places = dict(_places(model))
    if at is None and scene.trim is not None:
        model, scene, _ = find_trim(model, scene, parameters)
        of_inputs = {p.name for p in model.parameters if p.binding is Binding.INPUT}
        parameters = {name: value for name, value in parameters.items() if name not in of_inputs}
    else:
        scene, parameters = with_constant_inputs(model, scene, parameters)
        scene = scene if at is not None else _at_rest(model, scene, parameters)
    if not model.controllers:
        return replace(_begin(model, scene, parameters, at).linearise(), places=places).choose(chosen)
    if any(function.memory for function in model.functions):
        words = "a function has a memory, by which controllers have no derivative; replace it by signals and memory"
        raise RunError(f"{model.span.file}: {words}")
    exposed, begun, requested = _with_sampled_inputs(model, scene)
    sim = _begin(exposed, begun, parameters, None if at is None else 0.0)
    held = [_sampled_input(value) for value in model.discrete_states]
    if at is not None:
        watched = [_signal(model, f"{name}.held", value.symbol) for name, value in zip(held, model.discrete_states, strict=True)]
        watching = replace(model, signals=(*model.signals, *watched))
        run = _begin(watching, replace(scene, outputs=tuple(map(_reported, watched))), parameters, at)
        sim.inputs.update(zip(held, run.outputs.array, strict=True))
        sim.set_state(run.time, run.coordinates.array, run.speeds.array)
    plant = replace(sim.linearise(), places=places).choose((*chosen, *held), outputs=requested)
    samplers = tuple(Sampler(every=c.every, offset=c.offset, number=len(c.discrete_states)) for c in model.controllers)
    return SampledStateSpace(plant=plant, samplers=samplers, held=np.array([sim.get_input(name) for name in held]))


def _at_rest(model: Model, scene: Scene, parameters: Mapping[str, float]) -> Scene:
    """The scene at the static equilibrium, which no force on its positions holds."""
    found = replace(scene, pose="equilibrium", rates={})
    if found.positions:
        artifact = compile_interpreted(model, found)
        plan = make_run_file(model, found, parameters, task="equilibrium", options=PLAIN_STEPS)
        require_free(scene, read_locking_forces(call_simulator(artifact.binary.path, plan.entries(), description=artifact.description)))
    return found


def _begin(model: Model, scene: Scene, parameters: Mapping[str, float], at: float | None) -> Simulation:
    sim = load_scene(model, scene, method=DEFAULT_METHOD, linearise=True)
    sim.parameters.update({name: value for name, value in parameter_values(model, parameters).items() if name in sim.parameters})
    sim.reset()
    if at:
        sim.advance(at)
    sim.choose_independent()
    return sim


def _inputs(model: Model, requested: Sequence[str]) -> tuple[str, ...]:
    known = [p.name for p in model.parameters if p.binding is Binding.INPUT]
    if not known:
        words = "the model has no input; give a parameter 'binding: input', or add inputs by external wrenches or terrain"
        raise RunError(f"{model.span.file}: {words}")
    for name in requested:
        if name not in known:
            raise RunError(f"{model.span.file}: the model has no input '{name}'; {nearest(name, known, 'inputs')}")
    return tuple(dict.fromkeys(requested)) or tuple(known)


def _output(model: Model, scene: Scene, name: str) -> Output:
    known = {output.column: output for output in scene.outputs}
    if name in known:
        return known[name]
    try:
        element, quantity = find_quantity(elements_of(model), name, str, "")
    except QuantityError as error:
        hint = nearest(name, known, "") if any(o.name for o in scene.outputs) and "did you mean" in nearest(name, known) else error.hint
        raise RunError(f"{model.span.file}: output '{name}': {error.message}; {hint}") from None
    return Output(element=element, quantity=quantity, span=model.span)


def _places(model: Model) -> Iterable[tuple[str, tuple[float, float]]]:
    """Positions x and y (m) of inputs that are heights under wheels or displacements of joints."""
    for parameter in (p for p in model.parameters if p.binding is Binding.INPUT):
        points = [j.at for j in model.joints if j.guide and any(parameter.symbol in sympy.sympify(g).free_symbols for g in j.guide)]
        points += [f.centre for f in model.forces if parameter.name == f"{f.name}.terrain_height"]  # type: ignore[attr-defined]
        if len(points) == 1:
            x, y, _ = evaluate(model, points[0])
            yield parameter.name, (float(x), float(y))


# Controllers as inputs and outputs


def _with_sampled_inputs(model: Model, scene: Scene) -> tuple[Model, Scene, tuple[str, ...]]:
    """The model with sampled values of controllers as inputs, the scene with their next values as outputs, and the outputs' names."""
    inputs = {
        value.symbol: Parameter(name=name, symbol=parameter_symbol(name), value=0.0, unit=value.unit, binding=Binding.INPUT, span=c.span)
        for c in model.controllers for value in c.discrete_states for name in [_sampled_input(value)]
    }  # fmt: skip
    symbols: dict[Scalar, Scalar] = {symbol: parameter.symbol for symbol, parameter in inputs.items()}
    for signal in (signal for c in model.controllers for signal in c.signals):  # each after those that it reads
        symbols[signal.symbol] = sympy.sympify(signal.value).xreplace(symbols)
    names = {c.name for c in model.controllers}
    follow = [_signal(model, f"{_sampled_input(v)}.next", sympy.sympify(v.next).xreplace(symbols)) for v in model.discrete_states]
    requested = {o.column: inputs[quantity_symbol(o.element, o.quantity)] for o in scene.outputs if o.element in names}
    shown = {column: _signal(model, column, held.symbol, held.unit) for column, held in requested.items()}
    plain = substitute(replace(model, controllers=()), symbols)
    exposed = replace(plain, parameters=(*model.parameters, *inputs.values()), signals=(*plain.signals, *shown.values(), *follow))
    outputs = (*(_reported(shown[o.column]) if o.column in shown else o for o in scene.outputs), *map(_reported, follow))
    starts = {_sampled_input(v): v.start for v in model.discrete_states}
    return exposed, replace(scene, outputs=outputs, inputs={**scene.inputs, **starts}), tuple(o.column for o in outputs)


def _sampled_input(value: DiscreteState) -> str:
    """The input for a sampled value; delays have none in the file."""
    return discrete_state_name(value).replace("-", ".delay")


def _signal(model: Model, name: str, value: Scalar, unit: str = "") -> Signal:
    """An unused signal, whose element has a name of its own."""
    own = f"{name}.reported"
    return Signal(name=own, symbol=quantity_symbol(own, VALUE), value=value, unit=unit, span=model.span, reported=True)


def _reported(signal: Signal) -> Output:
    return Output(element=signal.name, quantity=VALUE, span=signal.span, name=signal.name.removesuffix(".reported"))
