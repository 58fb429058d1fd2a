"""The variables of a study: the parts of the model that they change, their ranges, and their values for each run."""

import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from math import inf, isnan, nan
from pathlib import Path
from typing import TypeAlias

import numpy as np

from cutjoint.formulate.inputs import input_parameters, tunable_parameters
from cutjoint.model.document.source import Path as Keys
from cutjoint.model.errors import nearest
from cutjoint.model.expressions.quantities import JOINT_QUANTITIES
from cutjoint.model.expressions.scope import Element
from cutjoint.model.expressions.units import fault_of_hertz
from cutjoint.model.ranges import fault_of
from cutjoint.model.records import COORDINATES, Binding, Model, Parameter, Scene, Span
from cutjoint.model.scenes.starts import read_states
from cutjoint.run.cases import read_numbers, read_rows
from cutjoint.sweeps import designs
from cutjoint.sweeps.code import dimension_of
from cutjoint.sweeps.designs import Extent
from cutjoint.sweeps.document import MOST_RUNS, Between, Csv, Document, Listed, SobolIndices, Spread, Tolerances, Values
from cutjoint.sweeps.records import Array, Kind, Variable

#: Reads a number as it is written at a place, in SI units; NaN, with a problem noted, where the model cannot have it.
Read: TypeAlias = Callable[[int | float | str, Keys], float]

#: The column with the scene of each run.
SCENE = "scene"

#: The other columns of a table, whose names variables and objectives cannot have.
TAKEN = ("run", "failure", "failure_time")

_SECTIONS = ("parameters", "positions", "rates")


class Variables:
    """Reads the variables of a study of a model, which ``where`` names in messages; ``folder`` is that of the study."""

    def __init__(self, where: Element, document: Document, model: Model, folder: Path) -> None:
        self._where, self._document, self._folder = where, document, folder
        self._source, self._problems = where.scope.source, where.scope.problems
        self._joints = {joint.name: joint for joint in model.joints}
        self._constants = {p.name: p for p in model.parameters if p.binding is Binding.CONST}
        self._parameters: Mapping[str, Parameter] = {p.name: p for p in (*tunable_parameters(model), *input_parameters(model))}
        self._inputs = {p.name for p in input_parameters(model)}
        self._states = {
            f"{joint.name}.{component}": unit for joint in model.joints if not joint.cut
            for component, unit in JOINT_QUANTITIES[joint.kind].items()
        }  # fmt: skip

    def design(self, scenes: tuple[Scene, ...]) -> tuple[tuple[Variable, ...], Array]:
        """The variables and their values (runs, variables).

        Raises:
            ModelError: something of them is wrong.
            RunError: a library that the design needs is not installed.
        """
        design = self._document.design
        if isinstance(design, (Csv, Listed)):
            return self._of_table(design, scenes)
        found = [(self._scene(), Extent(levels=tuple(map(float, range(len(scenes))))))] if len(scenes) > 1 else []
        for section in _SECTIONS:
            for name, values in getattr(self._document, section).items():
                parts = [f"{name}.{axis}" for axis in "xyz"] if section == "parameters" and name not in self._parameters else []
                vector = bool(parts) and all(part in self._parameters for part in parts)
                found += [self._variable(section, part, values, name) for part in (parts if vector else [name])]
        self._require_names([v for v, _ in found])
        if not found:
            self._fail(("design",), "there is no variable", "write for example parameters: {stiffness: {from: 1, to: 2}}")
        if isinstance(design, SobolIndices) and len(found) < 2:
            self._fail(("design",), "sobol_indices compares variables, and there is one", "write two variables or more, or {sobol: runs}")
        self._end()
        if isinstance(design, Tolerances):
            self._require_spreads(design, {v.name: extent for v, extent in found})
        runs = designs.count_runs(design, [extent for _, extent in found])
        if runs > MOST_RUNS:
            self._fail(("design",), f"{runs} runs are more than {MOST_RUNS:g}", "write smaller counts, or a sequence such as {sobol: 1000}")
        self._end()
        bytes_needed, free = 24 * runs * len(found), os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
        if bytes_needed > free:
            needed = f"{runs} runs need {bytes_needed / 1e9:.3g} GB of memory for their values, of which {free / 1e9:.3g} GB are free"
            self._fail(("design",), needed, "write several studies")
        self._end()
        values = designs.draw(design, [extent for _, extent in found], [v.name for v, _ in found])
        return tuple(v for v, _ in found), values

    def _at(self, keys: Keys) -> Element:
        label = {"parameters": "parameter", "positions": "position", "rates": "rate"}.get(str(keys[0]))
        return replace(self._where, label=f"{label} '{keys[1]}'" if label and len(keys) > 1 else str(keys[0]))

    def _fail(self, keys: Keys, message: str, hint: str = "", *, at_key: bool = False) -> None:
        self._at(keys).fail(message, hint, keys, at_key=at_key)

    def _end(self) -> None:
        if self._problems:
            raise self._problems.error()

    def _scene(self) -> Variable:
        return Variable(name=SCENE, kind=Kind.SCENE, unit="", span=self._source.key_span(("scenes",)))

    def _require_spreads(self, design: Tolerances, extents: Mapping[str, Extent]) -> None:
        """What tolerances need: no lists, and correlations between normal distributions that can be."""
        if SCENE in extents or any(len(extent.levels) > 1 for extent in extents.values()):
            self._fail(("design",), "tolerances need one scene and distributions, no lists", "write for example {normal: 0.1 mm}")
        pairs = [{one, other} for one, other, _ in design.correlations]
        for i, pair in enumerate(pairs):
            keys: Keys = ("design", "correlations", i)
            if len(pair) < 2 or pair in pairs[:i]:
                self._fail(keys, "each pair of two variables stands once", "write [one, other, correlation]")
            for name in sorted(pair):
                if name not in extents or extents[name].spread is None or extents[name].spread.dist.name != "norm":
                    self._fail(keys, f"'{name}' has no normal distribution", "correlate variables {normal: ...} without from and to")
        if not self._problems and not np.linalg.eigvalsh(designs.correlation(list(extents), design.correlations))[0] > 0.0:
            self._fail(("design", "correlations"), "no variables have these correlations", "write smaller ones")
        self._end()

    def _variable(self, section: str, name: str, values: Values, key: str = "") -> tuple[Variable, Extent]:
        """A variable of a section, and what it may be; ``key`` is the name of a vector of which it is a component."""
        keys: Keys = (section, key or name)
        known = self._parameters if section == "parameters" else self._states
        if name not in known:
            self._fail(keys, *self._unknown(name, known), at_key=True)
        variable, read = self._named(name, section, self._source.key_span(keys))
        if isinstance(values, Spread):
            return variable, self._spread(values, keys, read, name)
        return variable, self._extent(values, keys, read)

    def _spread(self, values: Spread, keys: Keys, read: Read, name: str) -> Extent:
        if values.mean is None and name not in self._parameters:
            self._fail(keys, "a distribution of a start needs its mean", "write mean: beside it")
        usual = self._parameters[name].value if name in self._parameters else nan
        mean = usual if values.mean is None else read(values.mean, (*keys, "mean"))
        size = read(getattr(values, values.kind), (*keys, values.kind))
        low = -inf if values.from_ is None else read(values.from_, (*keys, "from"))
        high = inf if values.to is None else read(values.to, (*keys, "to"))
        if not size > 0.0 and not isnan(size):
            self._fail((*keys, values.kind), "a distribution has a width above zero", "write a plain number for a constant")
        if not low < mean < high and not isnan(low + mean + high):
            self._fail(keys, f"the mean {mean:g} is not between from and to", "write limits about it")
        if self._problems:
            return Extent(levels=(0.0,))
        return Extent(spread=designs.distribution(values.kind, mean, size, low, high))

    def _unknown(self, name: str, known: Mapping[str, object]) -> tuple[str, str]:
        if name in self._constants:
            return "the parameter has binding const", f"write binding: param at {self._constants[name].span}"
        return "the model has no such name", nearest(name, known, "it has") or "give a parameter binding: param, or tunable: ['*.mass']"

    def _named(self, name: str, section: str, span: Span) -> tuple[Variable, Read]:
        if section != "parameters":
            kind = Kind.POSITION if section == "positions" else Kind.RATE
            return Variable(name=name, kind=kind, unit=self._states.get(name, ""), span=span), self._state_reader(section, name)
        unit = self._parameters[name].unit if name in self._parameters else ""
        kind = Kind.INPUT if name in self._inputs else Kind.PARAMETER
        return Variable(name=name, kind=kind, unit=unit, span=span), self._number_reader(unit)

    def _number_reader(self, unit: str) -> Read:
        dimension = dimension_of(unit)

        def read(value: int | float | str, keys: Keys) -> float:
            number = self._at(keys).number(value, dimension, keys)
            if not isnan(number) and (fault := fault_of(number) or fault_of_hertz(str(value), unit)):
                self._fail(keys, fault)
            return number

        return read

    def _state_reader(self, section: str, name: str) -> Read:
        def read(value: int | float | str, keys: Keys) -> float:
            at = replace(self._where, label=self._at(keys).label)
            states = read_states(at, {name: value}, section, self._joints) if name in self._states else {}
            return float(states[name]) if states and not self._problems else nan

        return read

    def _extent(self, values: Values, keys: Keys, read: Read) -> Extent:
        if isinstance(values, tuple):
            return Extent(levels=tuple(read(value, (*keys, i)) for i, value in enumerate(values)))
        if isinstance(values, (int, float, str)):
            return Extent(levels=(read(values, keys),))
        assert isinstance(values, Between)
        low, high = read(values.from_, (*keys, "from")), read(values.to, (*keys, "to"))
        by_ratio, is_grid = values.scale == "log", self._document.design == "grid"
        if not low < high and not isnan(low + high):
            self._fail((*keys, "to"), f"the range from {low:g} to {high:g} is empty", "write the smaller number first")
        if by_ratio and not low > 0 and not isnan(low):
            self._fail((*keys, "from"), "a logarithmic range begins above zero", "write scale: linear, or a positive 'from'")
        if is_grid and values.count is None:
            self._fail(keys, "a grid needs the number of values", "write count: 10 beside from and to", at_key=True)
        if not is_grid and values.count is not None:
            self._fail((*keys, "count"), "'count' belongs to a grid", "leave it out: the design has the number of runs", at_key=True)
        if self._problems:
            return Extent(levels=(0.0,))
        if values.count is None:
            return Extent(spread=designs.even(low, high, by_ratio=by_ratio))
        levels = np.geomspace(low, high, values.count) if by_ratio else np.linspace(low, high, values.count)
        return Extent(levels=tuple(map(float, levels)))

    def _require_names(self, variables: list[Variable]) -> None:
        seen = set(TAKEN)
        for v in variables:
            if v.name in seen:
                why = "stands for a column of the table" if v.name in TAKEN else "stands twice"
                self._problems.add(v.span, f"{v.kind} '{v.name}'", f"the name {why}", "rename it in the model, or remove one")
            seen.add(v.name)

    # Tables and lists, which name what they set.

    def _of_table(self, design: Csv | Listed, scenes: tuple[Scene, ...]) -> tuple[tuple[Variable, ...], Array]:
        for section in _SECTIONS:
            if getattr(self._document, section):
                self._fail((section,), f"{section}: the design specifies all values", "remove this section", at_key=True)
        self._end()
        variables, rows = self._csv(design) if isinstance(design, Csv) else self._list(design)
        self._require_names(variables)
        self._end()
        if len(scenes) == 1:
            return tuple(variables), rows
        number = np.repeat(np.arange(len(scenes), dtype=float), len(rows))[:, np.newaxis]
        return (self._scene(), *variables), np.hstack([number, np.tile(rows, (len(scenes), 1))])

    def _found(self, name: str, keys: Keys) -> tuple[Variable, Read]:
        """The variable of a column; a name that the model does not have is noted."""
        joint, _, component = name.rpartition(".")
        if name in self._parameters or name not in self._states:
            section = "parameters"
            if name not in self._parameters:
                self._fail(keys, f"'{name}': {(said := self._unknown(name, {**self._parameters, **self._states}))[0]}", said[1])
        else:
            section = "positions" if component in COORDINATES[self._joints[joint].kind] else "rates"
        return self._named(name, section, self._source.value_span(keys))

    def _list(self, design: Listed) -> tuple[list[Variable], Array]:
        first, keys = design.list[0], ("design", "list")
        found = {name: self._found(name, (*keys, 0, name)) for name in first}
        rows = []
        for i, row in enumerate(design.list):
            if row.keys() != first.keys():
                names = f"run {i} sets {', '.join(row) or 'nothing'}, but run 0 {', '.join(first) or 'nothing'}"
                self._fail((*keys, i), names, "set the same names in each")
            else:
                rows.append([found[name][1](row[name], (*keys, i, name)) for name in first])
        return [v for v, _ in found.values()], np.array(rows, dtype=float).reshape(len(rows), len(first))

    def _csv(self, design: Csv) -> tuple[list[Variable], Array]:
        keys = ("design", "csv")
        path = self._folder / design.csv

        def fail(message: str, hint: str) -> None:
            self._fail(keys, message, hint)

        (_, names), *rows = read_rows(path, fail) or [(0, list[str]())]
        numbers = np.array([read_numbers(f"{path}:{line}", names, row, fail) for line, row in rows], dtype=float)
        self._end()
        return [self._found(name, keys)[0] for name in names], numbers
