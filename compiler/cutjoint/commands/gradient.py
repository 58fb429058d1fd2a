"""`cutjoint gradient`."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.measure import Measurement
from rich.table import Table

from cutjoint.commands import options, table
from cutjoint.elements.joint import ATTITUDE
from cutjoint.methods import DEFAULT_METHOD, METHODS, Formulation
from cutjoint.model.errors import ModelError, nearest
from cutjoint.model.expressions.quantities import JOINT_QUANTITIES
from cutjoint.model.records import Binding, Model, Scene
from cutjoint.package.errors import RunError
from cutjoint.report import tables
from cutjoint.run.run_file import find_trim, parameter_values
from cutjoint.run.scenes import load_model, model_of
from cutjoint.stepping.load import load_scene
from cutjoint.stepping.simulation import Simulation
from cutjoint.stepping.values import DIFFERENCE_STEPS, OBJECTIVES, Array, difference, find_eigenvalues, weigh

#: The step of a difference, as a share of the number, or in its unit where that is smaller than 1e-3.
_SHARE = 1e-3

#: Smallest change of an objective over that step, as a share of it: less would be rounding error.
_LEAST = 1e-9


@table.command("gradient")
def command(
    model: Path, scene: str | None, method: str | None, integrator: str | None, dt: float | None, end: float | None,
    tunable: tuple[str, ...], changes: tuple[str, ...], requested: tuple[str, ...], by: tuple[str, ...], objective: str,
    from_equilibrium: bool, check: bool,
) -> None:  # fmt: skip
    """Run MODEL and print the exact derivatives of its outputs with respect to parameters and inputs, step sizes constant.

    The initial state stays constant, unless --from-equilibrium or the objective says otherwise.  With --objective start, a scene with a
    trim shows the derivatives of what the trim finds.
    """
    read, chosen = load_model(model, scene, tunable)
    values = options.read_parameters(changes)
    _require_numbers(model, read, by)
    numbers = parameter_values(read, values)
    if objective == "start" and chosen.trim is not None:
        _print_trim(read, chosen, values, requested, by, check)
        return
    method = method or chosen.method or DEFAULT_METHOD
    if METHODS[method].formulation is Formulation.NATURAL:
        raise RunError(f"scene '{chosen.name}' has the method {method}, which has no derivatives of steps; use --method recursive")
    columns = [output.column for output in chosen.outputs]
    for name in requested:
        if name not in columns:
            raise RunError(f"--output: '{name}' is not among the scene's outputs; {nearest(name, columns, 'there is')}")
    with options.progress_bar(f"compiling {model.name}"):
        many = (len(by) or sum(p.binding is not Binding.CONST for p in read.parameters)) > (len(requested) or len(chosen.outputs))
        sim = load_scene(read, chosen, method=method, integrator=integrator, linearise=True, adjoint=many and objective in OBJECTIVES)
    sim.parameters.update({name: value for name, value in numbers.items() if name in sim.parameters})
    for name in values:
        if name in sim.inputs:
            sim.inputs[name] = float(values[name])
    sim.reset(dt=dt)
    sim.choose_independent()
    every, length = max(1, round(chosen.output_step / sim.settings.step)), (chosen.end if end is None else end) - sim.time
    steps = every * max(1, round(length / sim.settings.step / every))
    run = _Run(sim, objective, list(requested) or list(sim.outputs), steps, every)
    names, start = list(by) or [*sim.parameters, *sim.inputs], sim.snapshot()
    if not names and objective == "event":
        raise RunError(f"{model.name} has no parameter or input that could change its event: add --tunable, or name states with --by")
    try:
        found = run.derive(names, from_equilibrium)
    except (KeyError, TypeError, ValueError) as error:
        raise RunError(str(error.args[0])) from None
    options.out.print_each(_fit_tables(found, names, options.out.width))
    if objective not in ("equilibrium", "start") and (idle := [
        name for name, row in zip(names, found.derivatives.T, strict=True) if name in sim.parameters and not row.any()
    ]):  # fmt: skip
        options.out.print(f"zero derivatives by {', '.join(idle)}; use --objective start for parameters of the initial state")
    if check:
        names, derivatives = _without_driven_inputs(sim, names, found.derivatives)
        sim.restore(start)
        begins_anew = from_equilibrium or objective in ("equilibrium", "start") or (objective == "modes" and chosen.pose == "equilibrium")
        _print_deviation(_gaps(sim, lambda name, value: _trajectory(run, None if begins_anew else start, name, value), names, derivatives))


def _require_numbers(path: Path, model: Model, by: Sequence[str]) -> None:
    """Refuse names after --by that would fail after compiling: lists, unknown parameters and constants that are not tunable."""
    known = [*parameter_values(model, {}), *(p.name for p in model.parameters if p.binding is Binding.INPUT)]
    for name in (each for each in by if each not in known):
        if "," in name:
            raise RunError(f"--by takes one name and repeats: {' '.join(f'--by {each.strip()}' for each in name.split(','))}")
        if "." not in name:
            raise RunError(f"--by: no parameter or input '{name}'; {nearest(name, known, 'there is')}")
        try:
            model_of(path, [name])
        except ModelError:
            states = [f"{joint.name}.{name}" for joint in model.joints for name in (*JOINT_QUANTITIES[joint.kind], *ATTITUDE)]
            if name in [*states, *(state.entry for state in model.states)]:
                continue  # whether it is independent is known after compiling
            raise RunError(f"--by: no parameter, input or initial state '{name}'; {nearest(name, [*known, *states], 'there is')}") from None
        raise RunError(f"--by: '{name}' is a constant of the file; --tunable {name} makes a parameter of that name")


def _print_trim(
    model: Model, scene: Scene, parameters: Mapping[str, float], requested: Sequence[str], by: Sequence[str], check: bool
) -> None:  # fmt: skip
    """Print what the trim of a scene finds, with its derivatives by parameters; nothing is compiled."""
    assert scene.trim is not None
    unknowns, values = {unknown.name: unknown.unit for unknown in scene.trim.find}, parameter_values(model, parameters)
    if unknown := [name for name in requested if name not in unknowns]:
        words = f"'{unknown[0]}' is not under 'find'; {nearest(unknown[0], unknowns, 'it finds')}"
        raise RunError(f"{scene.trim.span}: scene '{scene.name}': trim: {words}")
    names, columns = list(by) or [name for name in values if name not in unknowns], list(requested) or list(unknowns)
    found = find_trim(model, scene, parameters, names)[2]
    derivatives = np.array([[found.gradients[name][column] for name in names] for column in columns])
    numbers, units = np.array([found.unknowns[column] for column in columns]), [unknowns[column] for column in columns]
    options.out.print_each(_fit_tables(_Result("found by the trim", columns, units, numbers, derivatives), names, options.out.width))

    def of_value(name: str, value: float) -> Array:
        other = find_trim(model, scene, {**parameters, name: value})[2].unknowns
        return np.array([other[column] for column in columns])

    if check:
        _print_deviation(_deviation(of_value, name, values[name], row) for name, row in zip(names, derivatives.T, strict=True))


def _print_deviation(shares: Iterable[float]) -> None:
    options.out.print(f"largest deviation from finite differences: {max(shares, default=0.0):.1e} of the largest derivative")


@dataclass(frozen=True)
class _Result:
    """A table: title, names and units of its columns, and their values and derivatives (columns, by)."""

    title: str
    columns: Sequence[str]
    units: Sequence[str]
    values: Array
    derivatives: Array


@dataclass(frozen=True)
class _Run:
    """An objective of the outputs over a number of steps, with a sample after each ``every`` steps."""

    sim: Simulation
    objective: str
    outputs: list[str]
    steps: int
    every: int

    @property
    def end(self) -> float:
        """The end time (s) of a run that begins now."""
        return self.sim.time + self.steps * self.sim.settings.step

    def derive(self, names: Sequence[str], from_equilibrium: bool) -> _Result:
        """The objective with its derivatives by numbers."""
        sim, outputs = self.sim, self.outputs
        for name in outputs:
            sim.outputs.place(name)
        units = [(sim.outputs.units or {})[name] for name in outputs]
        at = f"{sim.time:g}"
        if self.objective == "modes":
            modes = sim.eigenvalue_sensitivities(names)
            columns = [f"mode {i}" for i in range(len(modes.values))]
            units = ["1/s"] * len(columns)
            return _Result(f"eigenvalues at {at} s", columns, units, modes.values, modes.derivatives)  # type: ignore[arg-type]
        if self.objective in ("equilibrium", "start"):
            found = (sim.equilibrium_sensitivities if self.objective == "equilibrium" else sim.initial_state_sensitivities)(outputs, names)
            return _Result(f"outputs at {self.objective}", outputs, units, found.values, found.derivatives)
        initial_sensitivities = sim.equilibrium_sensitivities(outputs, names).states if from_equilibrium else None
        if self.objective == "event":
            events = sim.forward_sensitivities(self.steps, outputs, names, every=self.every, initial_sensitivities=initial_sensitivities,
                events=1).events
            if events is None or not events.names:
                raise ValueError(f"no force, guide or drive changes its formula until {sim.time:g} s")
            values, derivatives = np.append(events.times, events.values[0]), np.vstack([events.derivatives_of_times, events.derivatives[0]])
            return _Result(f"the first event, of '{events.names[0]}'", ["time", *outputs], ["s", *units], values, derivatives)
        if sim.library.record:
            back = sim.adjoint_sensitivities(self.steps, outputs, names, self.objective, every=self.every,
                initial_sensitivities=initial_sensitivities)
            values, derivatives = back.objectives, back.derivatives
        else:
            run = sim.forward_sensitivities(self.steps, outputs, names, every=self.every, initial_sensitivities=initial_sensitivities)
            values, derivatives = getattr(run, self.objective)
        return _Result(f"{self.objective} of outputs, {at} to {sim.time:g} s", outputs, units, values, derivatives)

    def values(self) -> Array:
        """The objective alone, from the present state."""
        sim, places = self.sim, [self.sim.outputs.place(output) for output in self.outputs]
        if self.objective == "modes":
            return find_eigenvalues(sim.linearise().A, [], None)[0]  # type: ignore[return-value]
        if self.objective == "event":
            sim.advance_to_event(self.end)
            return np.append(sim.time, sim.outputs.array[places])
        if self.objective in ("equilibrium", "start"):
            return sim.outputs.array[places]
        times = np.linspace(sim.time, self.end, self.steps // self.every + 1)
        rows = np.vstack([sim.outputs.array, sim.run(self.steps)[self.every - 1 :: self.every]])[:, places]
        return weigh(self.objective, times, rows, self.outputs)[0]


def _without_driven_inputs(sim: Simulation, names: Sequence[str], derivatives: Array) -> tuple[list[str], Array]:
    """Names and their derivatives, without inputs that follow the scene: finite differences would freeze them."""
    driven = [name for name in names if name in sim.inputs and np.isnan(sim.inputs[name])]
    if driven:
        options.out.print(f"not compared with finite differences: {', '.join(driven)} (prescribed by the scene)")
    kept = [i for i, name in enumerate(names) if name not in driven]
    return [names[i] for i in kept], derivatives[:, kept]


def _fit_tables(found: _Result, names: Sequence[str], width: int) -> Iterator[Table]:
    """Tables of all columns, with as many columns side by side as fit into a width."""
    columns = list(range(len(found.columns)))
    while columns:
        for number in range(len(columns), 0, -1):
            now = columns[:number]
            headings = [found.columns[i] for i in now]
            values = (f"{found.values[i] + 0.0:.6g} {found.units[i]}" for i in now)
            rows = ((name, *(f"{x + 0.0:.6g}" for x in row)) for name, row in zip(names, found.derivatives[now].T, strict=True))
            cells, how = [("", *values), *rows], {"no_wrap": True, "overflow": "ignore"}
            made = tables.table(found.title, ("by", *headings), cells, numbers=headings, **how)
            if number == 1 or Measurement.get(options.out, options.out.options.update(width=10_000), made).maximum <= width:
                break
        yield made
        columns = columns[number:]


def _gaps(sim: Simulation, trajectory: Callable[[str, float], Array], names: Sequence[str], derivatives: Array) -> Iterator[float]:
    """Deviations from fourth-order central differences by each number, relative to the largest derivative by the same number."""
    start = sim.snapshot()
    for name, row in zip(names, derivatives.T, strict=True):
        sim.restore(start)
        numbers = next((numbers for numbers in (sim.states, sim.parameters) if name in numbers), None)
        value = sim.get_input(name) if numbers is None else numbers[name]
        yield _deviation(trajectory, name, value, row)


def _deviation(function: Callable[[str, float], Array], name: str, value: float, row: Array) -> float:
    """The deviation of derivatives of a function by a number from fourth-order central differences, relative to the largest of these."""
    h = _SHARE * max(abs(value), 1.0 if value == 0.0 else 1e-3)
    ends = [function(name, value + steps * h) for steps in DIFFERENCE_STEPS]
    found = difference(ends, h)
    size = max(np.abs(found).max(), _LEAST * np.abs(ends).max() / h)
    return float(np.abs(row - found).max() / size if size > 0.0 else np.abs(row).max())


def _trajectory(run: _Run, start: bytes | None, name: str, value: float) -> Array:
    """The objective with one number changed, from the same snapshot or from the scene's start."""
    sim = run.sim
    if start is not None:
        sim.restore(start)
    states, before = {**sim.states}, (dict(sim.parameters), sim.inputs.array.copy())
    next(numbers for numbers in (states, sim.parameters, sim.inputs) if name in numbers)[name] = value
    if start is None:
        sim.reset()
    else:
        sim.set_states(np.array([*states.values()]))
    found = run.values()
    sim.parameters.update(before[0])
    sim.inputs.array[:] = before[1]
    return found
