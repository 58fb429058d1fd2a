"""From a study file to a `Study`: all names resolved, all numbers in SI units, all problems at once."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from hashlib import sha256
from math import inf, isclose, isnan
from pathlib import Path

import numpy as np
import sympy

from cutjoint.model.document.checks import check_part
from cutjoint.model.document.renamed import STUDY, rename_fields
from cutjoint.model.document.source import Path as Keys
from cutjoint.model.document.source import Source, parse_yaml, read_text
from cutjoint.model.document.values import Part
from cutjoint.model.elements.outputs import read_unit
from cutjoint.model.errors import ModelError, Problems, nearest
from cutjoint.model.expressions.functions import supply
from cutjoint.model.expressions.operations import ExpressionError
from cutjoint.model.expressions.scope import Directory, Element, Scope
from cutjoint.model.expressions.units import LENGTH, NONE, TIME, Dimension, Measure, described, fault_of_hertz, measure
from cutjoint.model.ranges import SOLVER_TOLERANCE, fault_of_setting
from cutjoint.model.records import Model, Scene
from cutjoint.model.scenes.build import SETTINGS
from cutjoint.package.errors import CutjointError
from cutjoint.package.locations import AnyPath
from cutjoint.run.reading import read_model
from cutjoint.run.scenes import find_scene, in_scene
from cutjoint.run.settings import Options, with_options
from cutjoint.sweeps.code import Reader
from cutjoint.sweeps.document import Document, Listed
from cutjoint.sweeps.document import Objective as ObjectivePart
from cutjoint.sweeps.records import Objective, Series, Study, TaskRequest
from cutjoint.sweeps.tasks import REDUCTIONS_OF, Result, make_task
from cutjoint.sweeps.variables import TAKEN, Variables
from cutjoint.toolchain.build import FLAGS
from cutjoint.topology.reading import read_model_text

#: The names of variables and of other sections' entries in messages.
_LABELS = {"parameters": "parameter", "positions": "position", "rates": "rate", "objectives": "objective"}

#: The dimensions of options of tasks that are numbers; None of those without one of their own.
_OPTIONS = {"travel": LENGTH, "radius": LENGTH, "steer_travel": None, "share": NONE, "at": TIME, "from_": NONE / TIME, "to": NONE / TIME}


def element_of(path: Keys) -> tuple[str, int]:
    """Describe the part of a study that a path leads to; also the number of keys of the path that belong to it."""
    if len(path) >= 2 and path[0] in _LABELS:
        return f"{_LABELS[str(path[0])]} '{path[1]}'", 2
    return ("design", 1) if path[:1] == ("design",) else ("study", 0)


def read_study(path: AnyPath, *, functions: AnyPath | None = None) -> Study:
    """Read a study file and the model that it names; ``functions`` is a C++ file with the code of functions that this declares.

    Raises:
        ModelError: the study or its model is wrong; it has all problems.
        RunError: a library that the design needs is not installed.
    """
    study = read_study_text(read_text(Path(path)), str(path))
    return study if functions is None else replace(study, model=supply(study.model, functions))


def read_study_text(text: str, file: str) -> Study:
    """Read a study from its text; ``file`` is the name in messages, and paths in the study start from its folder."""
    problems = Problems()
    source, notes = rename_fields(parse_yaml(text, file, "a study starts with 'cutjoint_study: 1'"), problems, STUDY)
    document = check_part(source, problems, Document, element_of)
    if document is None:
        raise problems.error()
    study = _Reading(source, problems, document).study()
    return replace(study, model=replace(study.model, notes=(*study.model.notes, *notes)))


class _Reading:
    def __init__(self, source: Source, problems: Problems, document: Document) -> None:
        self.source, self.problems, self.document = source, problems, document
        self.folder = Path(source.file).parent
        scope = Scope(source=source, problems=problems, directory=Directory(frozenset(), {}, frozenset()), names={}, values={})
        self.where = Element(scope, "study", "", ())
        self.series: list[Series] = []
        self.model: Model
        self.results: dict[TaskRequest, Result] = {}

    def study(self) -> Study:
        """The study; raises ModelError with all problems."""
        document, model = self.document, self._model()
        scenes = self._scenes(model)
        if any(scene.guides != scenes[0].guides for scene in scenes):
            self.where.fail("the scenes lock, drive or release different joints", "write a study for each", ("scenes",))
            raise self.problems.error()
        self.model = model = in_scene(model, scenes[0])
        reader, shown = Reader(model), document.trajectories
        objectives = [self._objective(name, part, reader, scenes) for name, part in document.objectives.items()]
        kept = [] if shown is None else [self._series(text, ("trajectories", "outputs", i), reader) for i, text in enumerate(shown.outputs)]
        variables, values = Variables(self.where, document, model, self.folder).design(scenes)
        for name in document.objectives.keys() & {*TAKEN, *(v.name for v in variables)}:
            keys = ("objectives", name)
            self.at(keys).fail("the name stands for another column of the table", "rename the objective", keys, at_key=True)
        if self.problems:
            raise self.problems.error()
        asked = json.dumps({key: value for key, value in self.source.data.items() if key != "model"})
        return Study(
            file=self.source.file, model=model, scenes=scenes, method=document.method, integrator=document.integrator,
            tunable=document.tunable, flags=FLAGS if document.flags is None else tuple(document.flags.split()),
            variables=variables, values=values, outputs=tuple(reader.outputs.values()), series=tuple(self.series),
            objectives=tuple(objectives), trajectories=tuple(kept), every=1 if shown is None else shown.every,
            design=_described(document), span=self.source.key_span(("design",)),
            digest=sha256(asked.encode() + np.ascontiguousarray(values, "<f8").tobytes()).hexdigest(),
        )  # fmt: skip

    def at(self, keys: Keys) -> Element:
        """The reader of the values of a part."""
        return replace(self.where, label=element_of(keys)[0])

    def _model(self) -> Model:
        path = self.folder / self.document.model
        if not path.is_file():
            self.where.fail(f"model: there is no file {path}", "write its path from the folder of the study", ("model",))
            raise self.problems.error()
        try:  # generated text names the model as the study does, whatever the present folder
            return read_model_text(read_text(path), self.document.model, folder=path.parent, tunable=self.document.tunable)
        except ModelError as error:
            for problem in error.problems:
                for i in (i for i, pattern in enumerate(self.document.tunable) if problem.message.endswith(f"is called '{pattern}'")):
                    self.where.fail(f"tunable: {problem.message}", problem.hint, ("tunable", i))
            if self.problems:
                raise self.problems.error() from None
            return read_model(path, tunable=self.document.tunable)

    def _scenes(self, model: Model) -> tuple[Scene, ...]:
        names = self.document.scenes
        if names is None:
            if len(model.scenes) > 1:
                self.where.fail(f"the model has several scenes: {', '.join(model.scenes)}", "name some of them: scenes: [...]", ("model",))
                raise self.problems.error()
            return (self._with_settings(find_scene(model, None)),)
        for i, name in enumerate(names):
            if name not in model.scenes:
                self.where.fail(f"scenes: the model has no scene '{name}'", nearest(name, model.scenes, "scenes"), ("scenes", i))
            elif name in names[:i]:
                self.where.fail(f"scenes: '{name}' stands twice", "remove one", ("scenes", i))
        found = [model.scenes[name] for name in dict.fromkeys(names) if name in model.scenes]
        if not found:
            raise self.problems.error()
        return tuple(map(self._with_settings, found))

    def _with_settings(self, scene: Scene) -> Scene:
        document, times = self.document, {}
        for name in ("dt", "end", "output_step", SOLVER_TOLERANCE):
            value = getattr(document, name)
            if value is not None:
                times[name] = number = self.where.number(value, None if name == SOLVER_TOLERANCE else TIME, (name,))
                if not isnan(number) and (fault := fault_of_setting(SETTINGS.get(name, name), number)):
                    self.where.fail(f"{name}: {fault}", "", (name,))
        if self.problems:
            return scene
        scene = replace(scene, output_step=times.get("output_step", scene.output_step))
        asked = Options(dt=times.get("dt"), end=times.get("end"), tolerance=times.get(SOLVER_TOLERANCE))
        return with_options(scene, document.method, asked)

    # Objectives and series

    def _objective(self, name: str, part: ObjectivePart, reader: Reader, scenes: Sequence[Scene]) -> Objective:
        keys, where = ("objectives", name), self.at(("objectives", name))
        if part.task is not None:
            return self._of_task(name, part, *part.task, scenes)
        place = self._series(getattr(part, part.reduction), (*keys, part.reduction), reader)
        begin = -inf if part.from_ is None else where.number(part.from_, TIME, (*keys, "from"))
        end = inf if part.to is None else where.number(part.to, TIME, (*keys, "to"))
        last = min(scene.end for scene in scenes)
        if not (begin < end and begin <= last and end >= 0) and not isnan(begin + end):
            where.fail("the window of time is empty", f"write from and to between 0 and {last:g} s", keys, at_key=True)
        series = self.series[place] if self.series else None
        level = series.dimension if series is not None and part.reduction == "crossing" else NONE
        at = 0.0 if part.at is None else where.number(part.at, level, (*keys, "at"))
        if part.reduction == "percentile" and not 0 <= at <= 100:
            where.fail("a percentile lies between 0 and 100", "write for example at: 95", (*keys, "at"))
        return Objective(
            name=name, reduction=part.reduction, series=place, at=at, direction=part.direction or "any", begin=begin, end=end,
            limits=self._limits(part, keys), goal=part.goal or "smaller",
            unit=part.unit or _unit(part.reduction, series.unit if series is not None else ""),
            factor=1.0 if part.unit is None or series is None else self._factor(where, part, part.unit, series, keys),
        )  # fmt: skip

    def _of_task(self, name: str, part: ObjectivePart, task: str, options: Part, scenes: Sequence[Scene]) -> Objective:
        """An objective of the result of another task, which is found once with the numbers of the file."""
        keys, where = ("objectives", name), self.at(("objectives", name))
        if part.reduction not in REDUCTIONS_OF.get(task, ()):
            hint = f"of {task} take one of {', '.join(REDUCTIONS_OF[task])}"
            where.fail(f"'{part.reduction}' is no reduction of a result of {task}", hint, (*keys, part.reduction))
            return Objective(name=name, reduction="value", series=-1)
        for key, value in (("from", part.from_), ("to", part.to)):
            if value is not None and task != "inverse":
                where.fail(f"'{key}' has no effect on a result of {task}", "remove it", (*keys, key), at_key=True)
        for section in ("positions", "rates"):
            if getattr(self.document, section):
                hint = f"remove {section}, or put the objective in another study"
                where.fail(f"a result of {task} does not depend on the {section} that the study varies", hint, keys, at_key=True)
        values = [(key, getattr(options, key)) for key in sorted(options.model_fields_set)]
        dimensions = ((key, _OPTIONS.get(key), value) for key, value in values if value is not None)
        at = (*keys, "of", task)
        asked = TaskRequest(task=task, options=tuple(
            (key, where.number(value, dimension, (*at, key)) if key in _OPTIONS else value) for key, dimension, value in dimensions
        ))  # fmt: skip
        window = [-inf if part.from_ is None else where.number(part.from_, TIME, (*keys, "from")),
                  inf if part.to is None else where.number(part.to, TIME, (*keys, "to"))]  # fmt: skip
        unit, of = "", str(getattr(part, part.reduction))
        try:
            if asked not in self.results:
                self.results[asked] = make_task(asked, self.model, scenes[0])({})
            unit = self.results[asked].unit_of(of, part.reduction)
        except CutjointError as error:
            where.fail(str(error), "", (*keys, part.reduction))
        factor = 1.0
        if part.unit is not None and (one := self._fitting(where, part.unit, measure(1.0, unit).dimension if unit else NONE, keys)):
            factor = 1.0 / one.value
        return Objective(
            name=name, reduction=part.reduction, series=-1, begin=window[0], end=window[1], limits=self._limits(part, keys),
            goal=part.goal or "smaller", unit=part.unit or unit, factor=factor, asked=asked, of=of,
        )  # fmt: skip

    def _limits(self, part: ObjectivePart, keys: Keys) -> tuple[float, float] | None:
        if part.limits is None:
            return None
        low, high = (self.at(keys).number(value, None, (*keys, "limits", i)) for i, value in enumerate(part.limits))
        if not low < high:
            self.at(keys).fail("the limits enclose nothing", "write the smaller one first", (*keys, "limits"))
        return low, high

    def _fitting(self, where: Element, unit: str, dimension: Dimension | None, keys: Keys, own: str = "") -> Measure | None:
        one = read_unit(where, unit, (*keys, "unit"))
        if one is not None and dimension not in (None, one.dimension):
            where.fail(f"unit {unit} does not fit: it is in {described(dimension)}", "write a unit of that", (*keys, "unit"))
        elif fault := fault_of_hertz(unit, own):
            where.fail(fault, "", (*keys, "unit"))
        return one

    def _factor(self, where: Element, part: ObjectivePart, unit: str, series: Series, keys: Keys) -> float:
        dimension = {"crossing": TIME, "frequency": NONE / TIME}.get(part.reduction, series.dimension)
        if part.reduction == "integral" and dimension is not None:
            dimension *= TIME
        own = "" if part.reduction in ("crossing", "frequency", "integral") else series.unit
        if (one := self._fitting(where, unit, dimension, keys, own)) is None:
            return 1.0
        value = sympy.factor_terms(series.value)
        written = value.as_independent(*value.free_symbols, as_Add=False)[0]
        if one.value != 1.0 and part.reduction not in ("crossing", "frequency") and isclose(abs(float(written)), 1 / one.value):
            words = f"the unit converts, and the expression is multiplied by {float(written):g} for it already"
            where.fail(words, f"write it in SI units: 'unit: {unit}' divides it by {one.value:g}", (*keys, part.reduction))
        return 1.0 / one.value

    def _series(self, value: int | float | str, keys: Keys, reader: Reader) -> int:
        """The place of an expression among the series; what is wrong with it is noted."""
        try:
            expression, unit, dimension = reader.read(value, self.source.value_span(keys))
        except ExpressionError as error:
            self.at(keys).fail(f"'{value}': {error.message}", error.hint, keys)
            return 0
        series = Series(text=str(value), value=expression, unit=unit, dimension=dimension)
        if series not in self.series:
            self.series.append(series)
        return self.series.index(series)


def _unit(reduction: str, unit: str) -> str:
    if reduction in ("crossing", "frequency"):
        return "s" if reduction == "crossing" else "Hz"
    return f"{unit}*s" if reduction == "integral" and unit else unit


def _described(document: Document) -> Mapping[str, object]:
    match document.design:
        case str():
            return {"grid": True}
        case Listed():
            return {"list": True}
    return document.design.model_dump(warnings=False)


