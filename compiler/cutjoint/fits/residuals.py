"""Residuals of experiments, with exact derivatives by the parameters of the fit."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
import sympy
from scipy.interpolate import CubicSpline

from cutjoint.fits.records import Array, Experiment, Signal, Study
from cutjoint.model.expressions.parse import variable
from cutjoint.model.records import Binding
from cutjoint.package.errors import RunError
from cutjoint.stepping.load import load_scene
from cutjoint.stepping.simulation import Simulation
from cutjoint.sweeps.code import symbol_of

Sims: TypeAlias = Mapping[tuple[object, ...], Simulation]  # by all that distinguishes them

#: The share of a step by which a sample may be off its end and count as there.
_ROUNDING = 1e-6


@dataclass(frozen=True, kw_only=True)
class Prediction:
    """What the model says of a signal at its samples, and the derivatives (samples, parameters)."""

    experiment: Experiment
    signal: Signal
    values: Array
    derivatives: Array


class Runs:
    """The runs of a study, whose models are compiled once each."""

    def __init__(self, study: Study, note: Callable[[str], None], sims: Sims | None = None) -> None:
        self.study, self.count, self.share, self.sims, self._cases = study, 0, 1.0, {k: sim.copy() for k, sim in (sims or {}).items()}, []
        for e in study.experiments:
            key = (e.model.span.file, e.scene.name, tuple(o.column for o in e.outputs), tuple(e.inputs), e.at_rest)  # both settings stay
            if key not in self.sims:
                note(f"compiling {e.model.name}, scene '{e.scene.name}'")
                self.sims[key] = load_scene(e.model, e.scene, method=study.method, integrator=study.integrator, linearise=True)
            self._cases.append(_Case(study, e, self.sims[key]))

    def predict(self, theta: Array, *, validation: bool = False) -> list[Prediction]:
        """What the model says of all signals with these parameters: of the experiments for the fit, or of those for validation.
        Each lasts a ``share`` of its time. Raises SimulationError, RunError: a run failed."""
        self.count += 1
        return [p for case in self._cases if case.experiment.validation == validation for p in case.predict(theta, self.share)]


class _Case:
    """An experiment with its simulation."""

    def __init__(self, study: Study, experiment: Experiment, sim: Simulation) -> None:
        self.experiment, self.sim = experiment, sim
        numbers = {p.name: p.symbol for p in study.parameters} | dict(study.ties)
        self.names = [name for name in numbers if name in sim.parameters or name in sim.inputs]
        self.symbols = [p.symbol for p in study.parameters]
        self.coordinates = list(experiment.starts)
        signals = [x for s in experiment.signals for x in (s.gain, s.bias, s.delay)]
        self.numbers = self._mapped([*(numbers[name] for name in self.names), *signals])
        self.starts = self._mapped(list(experiment.starts.values()))
        self.signals = [self._signal(s) for s in experiment.signals]
        self.outputs = [o.column for o in experiment.outputs]

    def _mapped(self, values: Sequence[Any]) -> Callable[..., tuple[Array, Array]]:
        """Expressions as a function of the parameters and of columns: values, and derivatives (values, parameters)."""
        vector = sympy.Matrix(len(values), 1, values)
        arguments = [*self.symbols, *self.experiment.columns]
        found = sympy.lambdify(arguments, [vector, vector.jacobian(self.symbols) if values else sympy.zeros(0, 1)], "numpy", cse=True)

        def call(theta: Array, row: int = 0) -> tuple[Array, Array]:
            numbers, derivatives = found(*theta, *(column[row] for column in self.experiment.columns.values()))
            return np.asarray(numbers, dtype=float).reshape(-1), np.asarray(derivatives, dtype=float).reshape(len(values), len(theta))

        return call

    def _signal(self, signal: Signal) -> Callable[[Array, Array, Array, Array], tuple[Array, Array]]:
        """An expression and its derivatives (samples, parameters).
        It is a function of times, outputs (samples, outputs), their derivatives and those of the model's numbers."""
        of = self.experiment
        outputs = [symbol_of(o.column) for o in of.outputs]
        if signal.value in outputs:
            place = outputs.index(signal.value)
            return lambda t, y, dy, _: (y[:, place], dy[:, place])
        own = {p.symbol: p for p in of.model.parameters if p.binding is not Binding.INPUT and p.symbol in signal.value.free_symbols}
        moving = [p.symbol for p in own.values() if p.name in self.sim.parameters]
        value = signal.value.xreplace({s: sympy.Float(p.value, 17) for s, p in own.items() if s not in moving})
        arguments = [variable("t"), *outputs, *moving]
        found = sympy.lambdify(arguments, [value, *(value.diff(s) for s in arguments[1:])], "numpy", cse=True)
        places = [self.names.index(own[s].name) if own[s].name in self.names else None for s in moving]

        def call(t: Array, y: Array, dy: Array, by_theta: Array) -> tuple[Array, Array]:
            numbers, *partials = found(t, *y.T, *(self.sim.parameters[own[s].name] for s in moving))
            changes = [*dy.swapaxes(0, 1), *(0 * dy[0, 0] if place is None else by_theta[place] for place in places)]
            total = sum(np.broadcast_to(x, t.shape)[:, np.newaxis] * change for x, change in zip(partials, changes, strict=True))
            return np.broadcast_to(numbers, t.shape).astype(float), np.zeros((len(t), dy.shape[2])) + total

        return call

    def predict(self, theta: Array, share: float) -> Iterator[Prediction]:
        """What the model says of each signal in this share of its time."""
        e, sim = self.experiment, self.sim
        kept = [max(1, int(np.searchsorted(s.times, (1.0 if e.is_pose else share) * s.times[-1], "right"))) for s in e.signals]
        signals = [replace(s, times=s.times[:n], values=s.values[:n]) for s, n in zip(e.signals, kept, strict=True)]
        numbers, by_theta = self.numbers(theta)
        own = len(self.names)
        for name, number in zip(self.names, numbers, strict=False):
            (sim.parameters if name in sim.parameters else sim.inputs)[name] = number
        for name, table in e.inputs.items():
            sim.inputs[name] = np.interp(0.0, table["t"], table["value"])  # type: ignore[call-overload]
        sim.reset(dt=e.dt, equilibrium=True if e.at_rest else None)
        lags = numbers[own:].reshape(-1, 3)[:, 2]
        times = [s.times - lag for s, lag in zip(signals, lags, strict=True)]
        every = 1 if e.is_pose or by_theta[own + 2 :: 3].any() else _interval(times, e.dt)
        t, y, dy = self._poses(theta, by_theta[:own]) if e.is_pose else self._run(theta, by_theta[:own], times, every)
        for i, (signal, evaluate) in enumerate(zip(signals, self.signals, strict=True)):
            (gain, bias, lag), (by_gain, by_bias, by_lag) = numbers[own + 3 * i : own + 3 * i + 3], by_theta[own + 3 * i : own + 3 * i + 3]
            values, derivatives = evaluate(t, y, dy, by_theta[:own])
            if not e.is_pose:
                values, derivatives, rate = _at(t, values, derivatives, signal.times - lag, every * e.dt, moves=bool(by_lag.any()))
                derivatives = derivatives - rate[:, np.newaxis] * by_lag
            total = gain * derivatives + values[:, np.newaxis] * by_gain + by_bias
            yield Prediction(experiment=e, signal=signal, values=gain * values + bias, derivatives=total)

    def _run(self, theta: Array, by_theta: Array, samples: Sequence[Array], every: int) -> tuple[Array, Array, Array]:
        """Times, outputs and derivatives (rows, outputs, parameters) after each ``every`` steps of a run as long as the samples ask for."""
        e, sim = self.experiment, self.sim
        end = max(float(times[-1]) for times in samples)
        steps = every * max(3 if every == 1 else 1, int(np.ceil(end / (every * e.dt) - _ROUNDING)))
        initial, by_start = self._begin(theta)
        inputs = {name: _covering(table, (steps + 1) * e.dt) for name, table in e.inputs.items()}
        by = [*self.names, *self.coordinates]
        run = sim.forward_sensitivities(steps, self.outputs, by, every=every, initial_sensitivities=initial, inputs=inputs)
        return run.times - run.times[0], run.values, run.derivatives @ np.vstack([by_theta, by_start])

    def _begin(self, theta: Array) -> tuple[Array, Array]:
        """Set the start; the derivatives of states at the beginning by the model's numbers, and those of given coordinates."""
        sim, values, by_start = self.sim, *self.starts(theta)
        if not self.coordinates and not self.names:
            return np.zeros((len(sim.states), 0)), by_start
        found = sim.equilibrium_sensitivities if self.experiment.at_rest else sim.initial_state_sensitivities
        self._choose()
        states = np.zeros((len(sim.states), len(self.names) + len(self.coordinates)))
        if len(self.coordinates) < len(sim.states):  # else all of the start is given
            try:
                states[:, : len(self.names)] = found([], self.names).states
            except ValueError as error:
                words = f"{self.experiment.span}: experiment '{self.experiment.name}': rest: {str(error).partition(';')[0]}"
                raise RunError(f"{words}; let its inputs and motions begin at rest, or give its start") from None
        if self.coordinates:
            x = sim.states.array.copy()
            places = [sim.states.place(name) for name in self.coordinates]
            x[places], states[places] = values, 0.0
            sim.set_states(x, sim.time)
        return states, by_start

    def _choose(self) -> None:
        """Choose independent coordinates with those that the study gives a start."""
        sim = self.sim
        sim.choose_independent()
        if any(name not in sim.states for name in self.coordinates):
            rates = [name for name in self.coordinates if name in sim.speeds]
            try:
                [sim.states.place(name) for name in self.coordinates if name not in sim.coordinates and name not in sim.speeds]
                sim.choose_independent(rates)
                [sim.states.place(name) for name in self.coordinates]
            except (ValueError, KeyError) as error:
                words = f"{self.experiment.span}: experiment '{self.experiment.name}': start: {error.args[0]}"
                raise RunError(f"{words}; give the starts of as many coordinates and their rates, or of {', '.join(sim.states)}") from None

    def _poses(self, theta: Array, by_theta: Array) -> tuple[Array, Array, Array]:
        sim, rows = self.sim, len(self.experiment.signals[0].values)
        self._choose()
        by, values, derivatives = [*self.names, *self.coordinates], [], []
        places = [sim.states.place(name) for name in self.coordinates]
        for row in range(rows):
            x, by_start = sim.states.array.copy(), self.starts(theta, row)
            x[places] = by_start[0]
            sim.set_states(x)
            found = sim.forward_sensitivities(0, self.outputs, by)
            values.append(found.values[0])
            derivatives.append(found.derivatives[0] @ np.vstack([by_theta, by_start[1]]))
        return np.arange(float(rows)), np.array(values), np.array(derivatives)


def _interval(times: Sequence[Array], dt: float) -> int:
    """The number of steps after each of which rows serve all samples: 1 where a sample is not at the end of a step."""
    places = np.concatenate(times) / dt
    near = np.rint(places).astype(int)
    return max(1, int(np.gcd.reduce(near))) if (np.abs(places - near) < _ROUNDING).all() else 1


def _covering(table: Any, end: float) -> dict[str, object]:
    """A table over time that lasts from 0 to an end (s): what is missing there is held."""
    t = table["t"]
    before, after = [min(0.0, t[0] - 1e-9)] * bool(t[0] > 0.0), [max(end, t[-1] + 1e-9)] * bool(t[-1] < end)
    more = len(before), len(after)
    rates = {"rate": np.pad(table["rate"], more)} if "rate" in table else {}
    return {**table, "t": np.concatenate([before, t, after]), "value": np.pad(table["value"], more, "edge"), **rates}


def _at(t: Array, values: Array, derivatives: Array, times: Array, dt: float, *, moves: bool) -> tuple[Array, Array, Array]:
    """Values, derivatives and, where times move, rates at other times.
    At ends of steps those there, between by cubic splines, before the first its own."""
    place = np.clip(times / dt, 0.0, len(t) - 1.0)
    near = np.rint(place).astype(int)
    on_step = (np.abs(place - near) < _ROUNDING)[:, np.newaxis]
    if on_step.all() and not moves:
        return values[near], derivatives[near], np.zeros(len(near))
    stacked = np.column_stack([values, derivatives])
    found = np.where(on_step, stacked[near], CubicSpline(t, stacked, axis=0)(place * dt))
    rate = np.where((times >= 0.0) & (times <= t[-1] * (1 + _ROUNDING)), CubicSpline(t, values)(place * dt, 1), 0.0)
    return found[:, 0], found[:, 1:], rate
