"""From the study file of a fit to a `Study`: all names resolved, all numbers in SI units, all problems at once."""

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from hashlib import file_digest, sha256
from math import inf, isfinite, isnan, nan
from pathlib import Path
from typing import Any, NoReturn, TypeAlias

import numpy as np
import sympy

from cutjoint.fits import document as parts
from cutjoint.fits.data import Columns, read_data
from cutjoint.fits.inertias import tie_inertia
from cutjoint.fits.motion import Followed, follow, smooth
from cutjoint.fits.records import Array, Design, Experiment, Parameter, Signal, Study
from cutjoint.formulate.inputs import input_parameters, tunable_parameters
from cutjoint.methods import INTEGRATORS
from cutjoint.model.document.checks import check_part
from cutjoint.model.document.source import Path as Keys
from cutjoint.model.document.source import Source, parse_yaml, read_text
from cutjoint.model.elements.outputs import read_unit
from cutjoint.model.errors import ModelError, Problems, nearest
from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.expressions.operations import ExpressionError, Term
from cutjoint.model.expressions.parse import Names, symbols_of, variable
from cutjoint.model.expressions.scope import Directory, Element, Scope
from cutjoint.model.expressions.units import TIME, Dimension, fault_of_hertz, kind_of_unit, unit_written
from cutjoint.model.records import Binding, Model, Scalar, Scene
from cutjoint.package.errors import RunError
from cutjoint.package.locations import AnyPath, require_input
from cutjoint.run.reading import read_model
from cutjoint.run.scenes import find_case
from cutjoint.sweeps.code import Reader, dimension_of
from cutjoint.topology.reading import read_model_text

#: The bandwidth of measured motions, Hz.
_BAND = 10.0

Window: TypeAlias = tuple[float, float]  # of time, s

_LABELS = {"parameters": "parameter", "ties": "tie", "experiments": "experiment", "inertias": "inertia"}


def element_of(path: Keys) -> tuple[str, int]:
    """The part of a study that a path leads into, in words, and how many keys lead to it."""
    return (f"{_LABELS[str(path[0])]} '{path[1]}'", 2) if len(path) >= 2 and path[0] in _LABELS else ("fit", 0)


def read_fit(study: AnyPath | Mapping[str, Any]) -> Study:
    """Read a study, a file or a mapping, with the models and the data that it names.

    Raises:
        ModelError: the study or a model is wrong; it has all problems.
        RunError: data cannot be read.
    """
    named = isinstance(study, Mapping)
    text, file = (json.dumps(dict(study)), "fit") if isinstance(study, Mapping) else (read_text(Path(study)), str(study))
    problems = Problems()
    source = parse_yaml(text, file, "a fit starts with 'cutjoint_fit: 1'")
    document = check_part(source, problems, parts.Document, element_of)
    if document is None or problems:
        raise problems.error()
    return _Reading(source, problems, document, Path() if named else Path(file).parent, text).study()


class _Reading:
    def __init__(self, source: Source, problems: Problems, document: parts.Document, folder: Path, text: str) -> None:
        self.source, self.problems, self.document, self.folder, self.text = source, problems, document, folder, text
        scope = Scope(source=source, problems=problems, directory=Directory(frozenset(), {}, frozenset()), names={}, values={})
        self.where = Element(scope, "fit", "", ())
        self.models: dict[str, Model] = {}
        self.data: dict[tuple[str, str], Columns] = {}
        self.terms: dict[str, Term] = {}
        self.design: Design | None = None

    def study(self) -> Study:
        """The study; raises ModelError with all problems."""
        document = self.document
        self._read_models()
        known = {p.name: p for model in self.models.values() for p in (*tunable_parameters(model), *input_parameters(model))}
        fitted = [self._parameter(name, part, known.get(name)) for name, part in document.parameters.items()]
        self.starts = {p.name: p.start for p in fitted}
        ties: dict[str, Scalar] = {}
        for i, name in enumerate(dict.fromkeys(document.inertias)):
            try:
                shaped, tied = tie_inertia(name, {n: p.value for n, p in known.items()}, self.source.value_span(("inertias", i)))
            except RunError as error:
                self._fail(("inertias", i), str(error))
            else:
                fitted += shaped
                ties |= tied
        for name, text in document.ties.items():
            if name not in known or name in document.parameters or name in ties:
                why = "is a parameter of the fit" if name in {*document.parameters, *ties} else "is no number of the models"
                self._fail(("ties", name), f"'{name}' {why}", nearest(name, known, "they have"), at_key=True)
            ties[name] = self._expression(text, ("ties", name), None, known[name].unit if name in known else "")
        experiments = [self._experiment(name, part) for name, part in document.experiments.items()]
        used = {symbol for value in ties.values() for symbol in value.free_symbols}
        used |= {s for e in experiments for v in (*e.starts.values(), *(x for g in e.signals for x in (g.gain, g.bias, g.delay)))
                 for s in sympy.sympify(v).free_symbols}  # fmt: skip
        for p in fitted:
            if p.name not in known and p.symbol not in used:
                self._fail(("parameters", p.name), "no model has a number of this name, and no expression of the study names it",
                    nearest(p.name, known, "they have"), at_key=True)  # fmt: skip
        if all(e.validation for e in experiments):
            self._fail(("experiments",), "all experiments are for validation", "remove validation: true from one")
        if document.design is not None and self.design is None and not self.problems:
            words = f"'{document.design.experiment}' is no experiment of the fit with a motion"
            self._fail(("design", "experiment"), words, nearest(document.design.experiment, document.experiments, "there are"))
        if document.profiles and document.loss != "linear":
            self._fail(("profiles",), "intervals by profiles are of linear losses", "use 'bootstrap', or remove 'loss'")
        if self.problems:
            raise self.problems.error()
        starts, resamples = document.starts, document.bootstrap
        if starts is not None and not all(isfinite(p.low + p.high) for p in fitted):
            self._fail(("starts",), "several starts lie between bounds", "give each parameter 'from' and 'to'")
            raise self.problems.error()
        digest = sha256("".join([self.text, *(m.content for m in self.models.values())]).encode())
        for file, _ in self.data if starts or resamples or document.profiles else ():
            with (self.folder / file).open("rb") as stream:
                digest.update(file_digest(stream, "sha256").digest())
        return Study(
            file=self.source.file, digest=digest.hexdigest(), method=document.method, integrator=document.integrator, ties=ties,
            parameters=tuple(fitted), experiments=tuple(experiments), loss=document.loss, starts=1 if starts is None else starts.count,
            seed=(starts or resamples or parts.Starts(count=1)).seed, resamples=0 if resamples is None else resamples.count,
            profiles=document.profiles, windows=1 if all(e.is_pose for e in experiments) else document.windows, design=self.design,
        )  # fmt: skip

    def _fail(self, keys: Keys, message: str, hint: str = "", *, at_key: bool = False) -> None:
        replace(self.where, label=element_of(keys)[0]).fail(message, hint, keys, at_key=at_key)

    def _stop(self, keys: Keys, message: str, hint: str = "") -> NoReturn:
        self._fail(keys, message, hint)
        raise self.problems.error()

    # Models

    def _read_models(self) -> None:
        document = self.document
        wanted = {*document.parameters, *document.ties, *(f"{body}.*" for body in document.inertias)}
        for name, part in document.experiments.items():
            keys: Keys = ("experiments", name, "model") if part.model is not None else ("model",)
            file = part.model or document.model
            if file is None:
                self._stop(("experiments", name), "no model is named", "write model: for all experiments, or in each")
            if file not in self.models:
                if not (self.folder / file).is_file():
                    self._stop(keys, f"model: there is no file {self.folder / file}", "write its path from the folder of the study")
                self.models[file] = _read_tunable(self.folder / file, sorted(wanted), document.inertias)

    # Parameters and expressions

    def _parameter(self, name: str, part: parts.Fitted, own: Any) -> Parameter:
        keys: Keys = ("parameters", name)
        dimension = dimension_of(own.unit) if own is not None and own.unit else None
        if own is None and part.start is not None:
            dimension = self._term(part.start, (*keys, "start"), {}).dimension

        def number(value: Any, key: tuple[str, ...], default: float) -> float:
            return default if value is None else self._number(value, (*keys, *key), dimension, "" if own is None else own.unit)

        start = number(part.start, ("start",), nan if own is None else own.value)
        low, high = number(part.from_, ("from",), -inf), number(part.to, ("to",), inf)
        if isnan(start) and part.start is None:
            self._fail(keys, "no model has a number of this name, and it has no start", "write start: and a number", at_key=True)
        elif low > high:
            self._fail(keys, f"its bounds {low:g} and {high:g} enclose nothing", "write the smaller one under 'from'", at_key=True)
        elif start < low or start > high or low == high:  # none holds of what is no number
            self._fail(keys, f"its start {start:g} is not between its bounds {low:g} and {high:g}", "change one of them", at_key=True)
        mean = deviation = inf
        if part.prior is not None:
            mean, deviation = (number(getattr(part.prior, k), ("prior", k), inf) for k in ("mean", "deviation"))
            if deviation <= 0:
                self._fail((*keys, "prior", "deviation"), "a standard deviation is above zero")
        usual = abs(start) or (high - low if isfinite(high - low) else deviation if isfinite(deviation) else 1.0)
        size = number(part.size, ("size",), usual)
        if part.size is not None and size <= 0:
            self._fail((*keys, "size"), "a size is above zero")
        symbol = sympy.Symbol(name, real=True)
        self.terms[name] = Term(symbol, dimension)
        unit = own.unit if own is not None else "" if dimension is None else str(dimension)
        if own is None and unit.startswith("1") and kind_of_unit(unit_written(str(part.start)))[0]:
            unit = f"rad{unit[1:]}"
        return Parameter(name=name, symbol=symbol, unit=unit, start=start, low=low, high=high, mean=mean, deviation=deviation,
            size=size if size > 0 else 1.0, span=self.source.key_span(keys))  # fmt: skip

    def _number(self, value: Any, keys: Keys, dimension: Dimension | None, unit: str) -> float:
        """A number of a dimension, by default that of a unit; NaN when it is wrong."""
        if fault := fault_of_hertz(str(value), unit):
            self._fail(keys, fault)
        return replace(self.where, label=element_of(keys)[0]).number(value, dimension or dimension_of(unit), keys)

    def _term(self, value: int | float | str, keys: Keys, further: Mapping[str, Term]) -> Term:
        def dotted(name: str) -> Term:
            if name in self.terms:
                return self.terms[name]
            raise ExpressionError(f"'{name}' is no parameter of the fit", nearest(name, self.terms, "it has"))

        names = Names({**further, **self.terms}, frozenset(), dotted)
        return replace(self.where, label=element_of(keys)[0]).term(value, keys, names)

    def _expression(self, value: Any, keys: Keys, dimension: Dimension | None, unit: str, more: Mapping[str, Term] | None = None) -> Scalar:
        term, dimension = self._term(value, keys, more or {}), dimension or dimension_of(unit)
        if dimension is not None and term.dimension not in (None, dimension):
            self._fail(keys, f"'{value}' is in another dimension than what it is for", f"write it in {dimension}")
        elif fault := fault_of_hertz(unit_written(str(value)), unit):
            self._fail(keys, fault)
        return sympy.sympify(term.value)

    # Experiments

    def _experiment(self, name: str, part: parts.Experiment) -> Experiment:
        keys: Keys = ("experiments", name)
        model = self.models[part.model or self.document.model or ""]
        try:
            model, scene = find_case(model, part.scene)
        except RunError as error:
            self._stop(keys, str(error))
        try:
            followed = follow(model, scene, tuple(part.motion)) if part.motion else None
        except RunError as error:
            self._stop((*keys, "motion"), str(error))
        if followed is not None:
            model, scene = followed.model, followed.scene
        reader = Reader(model, None if followed is None else followed.drives)
        seconds = self._factor(part.time_unit, (*keys, "time_unit"), TIME)
        data = self._data((*keys, "data"), part.data, "" if part.poses else str(part.time))
        begin, until = (
            (default if value is None else self.where.number(value, TIME, (*keys, key)))
            for key, value, default in (("from", part.from_, nan), ("to", part.to, inf))
        )  # fmt: skip
        taken = {n: self._column((*keys, "signals", n), data, str(m.column or n), seconds, (begin, until)) for n, m in part.signals.items()}
        if isnan(begin):
            begin = min(float(t[0]) if len(t) else 0.0 for t, _ in taken.values())
        signals = []
        for text, measured in part.signals.items():
            t, values = taken[text]
            inside = (t >= begin - 1e-9) & (t <= until + 1e-9)
            whole = inside & np.isfinite(values)
            if not whole.any():
                self._fail((*keys, "signals", text), "there are no samples in the window of time", "see from and to")
                continue
            missing = int(inside.sum() - whole.sum())
            signals.append(self._signal((*keys, "signals", text), text, measured, reader, (t[whole] - begin, values[whole], missing)))
            if part.poses and missing:
                self._fail((*keys, "signals", text), "a pose lacks a sample", "remove its row")
        named = {n: Term(sympy.Symbol(f"[{n}]", real=True)) for text in part.start.values() for n in symbols_of(text) - self.terms.keys()}
        columns = {}
        for n, term in named.items():
            t, values = self._column((*keys, "start"), data, n, seconds, (begin, until))
            columns[term.value] = values if part.poses else values[np.isfinite(values) & (t >= begin - 1e-9)][:1]
        starts = {c: self._expression(v, (*keys, "start", c), None, _unit(model, c), named) for c, v in part.start.items()}
        window = begin, begin + max((float(g.times[-1]) for g in signals), default=inf)
        inputs = {n: self._input((*keys, "inputs", n), n, d, part, model, window) for n, d in part.inputs.items()}
        notes = self._motions(keys, part, followed, inputs, window) if followed is not None else ()
        asked = self.document.design
        asked = None if asked is None or asked.experiment != name or part.poses or part.validation else asked
        limits = [] if asked is None else [
            self._signal(("design", "limits", text), text, parts.Measured(), reader, (np.zeros(1), np.zeros(1), 0)) for text in asked.limits
        ]
        experiment = Experiment(
            name=name, model=model, inputs=inputs, outputs=(read := tuple(reader.outputs.values())), scene=replace(scene, outputs=read),
            signals=tuple(signals), starts=starts, columns=columns, is_pose=part.poses, at_rest=part.rest, validation=part.validation,
            dt=self._step(scene, signals), clock=(str(part.time), begin, seconds), notes=notes, span=self.source.key_span(keys),
        )  # fmt: skip
        if asked is not None:
            self.design = self._design(asked, experiment, limits, {} if followed is None else followed.inputs)
        return experiment

    def _design(self, asked: parts.Design, of: Experiment, limits: list[Signal], motion: Mapping[str, Any]) -> Design:
        known, found, part = {p.name: p for p in input_parameters(of.model)} | dict(motion), {}, self.document.experiments[of.name]
        if not part.time:
            self._fail(("design", "experiment"), f"experiment '{of.name}' has no column of times", "write its time")
        values = {variable("t"): 0.0} | {p.symbol: self.starts.get(p.name, p.value) for p in of.model.parameters}
        for name, bounds in asked.inputs.items():
            keys: Keys = ("design", "inputs", name)
            if name not in known:
                self._fail(keys, f"'{name}' is no input of the model, and no joint under motion", nearest(name, known, "it has"))
                continue
            own, section = known[name], "motion" if name in motion else "inputs"
            unit = getattr(getattr(part, section).get(name), "unit", None)
            law = evaluate(of.scene.inputs.get(own.name, own.symbol), values)
            table: Any = of.inputs.get(own.name) or {"t": [0.0], "value": [law]}
            start, (low, high) = float(np.interp(0.0, table["t"], table["value"])), self._within(bounds, keys, own.unit)
            if low < high and abs(start - (low + high) / 2) > (0.5 + 1e-9) * (high - low):
                said = f"its present value {start:g} is not between its bounds {low:g} and {high:g} {own.unit}".rstrip()
                self._fail(keys, said, "change one of them")
            found[name] = own.name, start, low, high, self._factor(unit, ("experiments", of.name, section, name, "unit"), None)
        frequency = 0.0 if asked.frequency is None else self._number(asked.frequency, ("design", "frequency"), None, "Hz")
        bounded = [(s, *self._within(asked.limits[s.text], ("design", "limits", s.text), s.unit)) for s in limits]
        return Design(experiment=of, inputs=found, limits=bounded, frequency=frequency, harmonics=asked.harmonics, runs=asked.runs)

    def _within(self, bounds: Sequence[Any], keys: Keys, unit: str) -> tuple[float, float]:
        low, high = (self._number(value, (*keys, i), None, unit) for i, value in enumerate(bounds))
        if low >= high:
            self._fail(keys, f"its bounds {low:g} and {high:g}{unit and f' {unit}'} enclose nothing", "write the smaller one first")
        return low, high

    def _step(self, scene: Scene, signals: Sequence[Signal]) -> float:
        """The step of the runs: of adaptive integrators the interval between samples, of others the scene's, if they are not given."""
        if self.document.dt is not None:
            return self.where.positive(self.where.number(self.document.dt, TIME, ("dt",)), ("dt",))
        chosen, own = self.document.integrator, scene.numerics.of_method(self.document.method).dt
        if own is not None and (chosen is None or not INTEGRATORS[chosen].adaptive):
            return own
        steps = [float(np.median(np.diff(s.times))) for s in signals if len(s.times) > 1]
        return min(steps, default=scene.output_step)

    def _signal(self, keys: Keys, text: str, part: parts.Measured, reader: Reader, data: tuple[Array, Array, int]) -> Signal:
        try:
            value, unit, dimension = reader.read(text, self.source.key_span(keys))
        except ExpressionError as error:
            self._fail(keys, f"'{text}': {error.message}", error.hint, at_key=True)
            return Signal(text=text, unit="", value=sympy.S.Zero, times=data[0], values=data[1], deviation=nan, gain=1, bias=0, delay=0)
        as_it = (dimension, unit) if part.gain is None else (None, "")  # a gain has the quotient of the units
        factor = self._factor(part.unit, (*keys, "unit"), *as_it)
        deviation = nan if part.deviation is None else self._number(part.deviation, (*keys, "deviation"), *as_it)
        if deviation <= 0:
            self._fail((*keys, "deviation"), "a standard deviation is above zero")
        gain, bias, delay = (
            sympy.sympify(default) if declared is None else self._expression(declared, (*keys, key), *expected)
            for key, declared, default, expected in
            (("gain", part.gain, 1, (None, "")), ("bias", part.bias, 0, as_it), ("delay", part.delay, 0, (TIME, "")))
        )  # fmt: skip
        times, values, missing = data
        return Signal(text=text, unit=unit or ("" if dimension is None else str(dimension)), value=sympy.sympify(value), times=times,
            values=values * factor, deviation=deviation, gain=gain, bias=bias, delay=delay, missing=missing)  # fmt: skip

    def _input(self, keys: Keys, name: str, part: parts.Driven, of: parts.Experiment, model: Model, window: Window) -> dict[str, object]:
        own = {p.name: p for p in input_parameters(model)}
        if name not in own:
            self._fail(keys, f"the model has no input '{name}'", nearest(name, own, "it has"), at_key=True)
            return {}
        seconds = self._factor(of.time_unit, (*keys[:2], "time_unit"), TIME)
        file = part.data or of.data
        t, values = self._column(keys, self._data(keys, file, str(part.time or of.time)), str(part.column or name), seconds)
        t, values = t[np.isfinite(values)], values[np.isfinite(values)]
        if name in self.document.parameters:
            self._fail(keys, "it is a parameter of the fit, too", "remove one of them", at_key=True)
        if not len(t) or t[0] > window[1]:
            self._fail(keys, f"{file} has no samples of it between {window[0]:g} s and {window[1]:g} s, where the signals are", "see time")
            return {}
        factor = self._factor(part.unit, (*keys, "unit"), dimension_of(own[name].unit) if own[name].unit else None, own[name].unit)
        return {"t": t - window[0], "value": values * factor, "interpolation": part.interpolation}

    def _motions(self, keys: Keys, part: parts.Experiment, followed: Followed, inputs: dict[str, Any], window: Window) -> tuple[str, ...]:
        """Add the tables of joints that follow columns to inputs; returns what was smoothed, in words."""
        seconds, notes = self._factor(part.time_unit, (*keys, "time_unit"), TIME), list[str]()
        data = self._data((*keys, "data"), part.data, str(part.time))
        band = _BAND if part.bandwidth is None else self._number(part.bandwidth, (*keys, "bandwidth"), None, "Hz")
        if not band > 0:
            self._stop((*keys, "bandwidth"), "a bandwidth is above zero", "write for example 10 Hz")
        coordinates = {joint.name: joint.element.coordinates for joint in followed.model.joints}
        for name, moved in part.motion.items():
            own = followed.inputs[name]
            factor = self._factor(moved.unit, (*keys, "motion", name, "unit"), dimension_of(own.unit))
            at: Keys = (*keys, "motion", name)
            t, values = self._column(at, data, str(moved.column or f"{name}.{coordinates[name][0]}"), seconds, window)
            rates = None if moved.rate is None else self._column(at, data, str(moved.rate), seconds, window)[1] * factor
            spline, noise = smooth(t - window[0], values * factor, rates, 0.5 / band)
            times = np.concatenate([[0.0], spline.t[(spline.t > 0) & (spline.t <= spline.t[-4])]])
            inputs[own.name] = {"t": times, "value": spline(times), "rate": spline(times, 1), "interpolation": "cubic"}
            left = ", ".join(f"{x:.3g} {unit}" for x, unit in zip(noise, (own.unit, f"{own.unit}/s"), strict=False))
            notes.append(f"motion of {name}: splines of {band:g} Hz leave {left} RMS")
        return tuple(notes)

    def _data(self, keys: Keys, file: str, time: str) -> Columns:
        if (file, time) not in self.data:
            require_input(self.folder / file)
            with self._placed(keys):
                self.data[file, time] = read_data(self.folder / file, time)
        return self.data[file, time]

    @contextmanager
    def _placed(self, keys: Keys) -> Iterator[None]:
        """Give errors of data their place in the study."""
        try:
            yield
        except RunError as error:
            raise RunError(f"{self.source.value_span(keys)}: {element_of(keys)[0]}: {error}") from None

    def _column(self, keys: Keys, data: Columns, name: str, seconds: float, window: Window = (nan, nan)) -> tuple[Array, Array]:
        """Times and values of a column where there is a time; those of samples rise in a window, without ends where these are NaN."""
        with self._placed(keys):
            t, values = data(name)
        t, values = t[np.isfinite(t)] * seconds, values[np.isfinite(t)]
        inside = t[np.isfinite(values) & ~(t < window[0] - 1e-9) & ~(t > window[1] + 1e-9)]
        if len(last := inside[:-1][np.diff(inside) <= 0]):
            self._fail(keys, f"the times of column '{name}' do not rise after {last[0]:g} s", "sort the rows and remove duplicates")
        return t, values

    def _factor(self, unit: str | None, keys: Keys, dimension: Dimension | None, own: str = "") -> float:
        if unit is None:
            return 1.0
        if (one := read_unit(replace(self.where, label=element_of(keys)[0]), unit, keys)) is None:
            return 1.0
        if dimension not in (None, one.dimension):
            self._fail(keys, f"unit {unit} does not fit what is measured, in {dimension}", "write a unit of that")
        elif fault := fault_of_hertz(unit, own):
            self._fail(keys, fault)
        return one.value


def _unit(model: Model, coordinate: str) -> str:
    try:
        return Reader(model).read(coordinate, model.span)[1]
    except ExpressionError:
        return ""  # `Simulation.choose_independent` says what there is


def _read_tunable(path: Path, names: Sequence[str], whole: Sequence[str]) -> Model:
    """The model of a file, whose numbers of these names are tunable; bodies whose ``whole`` inertia is have six moments in its text."""
    model = read_model(path)
    file, lines = model.span.file, model.text.splitlines(keepends=True)
    source = parse_yaml(model.text, file)
    for body in whole:
        moments = source.data.get("bodies", {}).get(body, {}).get("inertia")
        if isinstance(moments, tuple) and len(moments) == 3:
            span = source.value_span(("bodies", body, "inertia", 2))
            line = lines[span.line - 1]
            lines[span.line - 1] = line[: span.column - 1] + line[span.column - 1 :].replace("]", ", 0, 0, 0]", 1)

    def read(tunable: Sequence[str]) -> Model:
        return read_model_text("".join(lines), file, folder=path.parent, tunable=tunable)

    fixed = {p.name for p in model.parameters if p.binding is Binding.CONST}
    tunable = [name for name in names if name in fixed or "." in name]  # others are of expressions alone
    try:
        return read(tunable)
    except ModelError:
        kept = list[str]()
        for name in tunable:  # others may be of another model; what none has is noted
            with suppress(ModelError):
                read([name])
                kept.append(name)
        return read(kept)
