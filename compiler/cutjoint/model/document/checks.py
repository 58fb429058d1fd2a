"""Checks a document's shape with pydantic, and describes errors for the user.

Elements of the wrong shape are left out, and references to them are not checked, so that all problems are reported together.
"""

import types
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal, TypeAlias, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from cutjoint.model.document.model_file import Document
from cutjoint.model.document.source import Path, Source, field_name
from cutjoint.model.document.values import LOST, TAG, SpringDamper
from cutjoint.model.elements.forces import JOINT_FORCES
from cutjoint.model.elements.instances import find_uses
from cutjoint.model.errors import Problems, nearest, worded

_P = TypeVar("_P", bound=BaseModel)

#: From the path to a place to the element that it leads into, in words, and how many keys lead to that.
Names: TypeAlias = Callable[[Path], tuple[str, int]]

#: Stand-ins, one after the other, for a field of an element that is missing or of the wrong shape; the last leaves it out.
_OMITTED = object()
_STANDS = (LOST, {"from": LOST, "to": LOST}, *((LOST,) * n for n in (1, 2, 3, 6)), _OMITTED)
#: Fields for which no stand-in fits, but one for what they stand in; sections of which an element with a wrong field is left out.
_INNER = ("table", "of", "coordinate")
_WHOLE = ("parameters", "functions", "points", "submodels", "instances", "scenes")

#: Placeholders for required fields of a model.
_STAND_INS: Mapping[str, Any] = {"cutjoint": 1, "gravity": (0, 0, 0), "name": "model"}

#: The kind of element that each section holds.
KINDS = {
    "parameters": "parameter", "functions": "function", "points": "point", "bodies": "body", "joints": "joint", "gears": "gear",
    "forces": "force", "reactions": "reaction", "markers": "marker", "states": "state", "signals": "signal",
    "controllers": "controller", "submodels": "submodel", "instances": "instance", "scenes": "scene",
}  # fmt: skip
#: Remedies for missing fields, by section and field.
_MISSING: Mapping[tuple[Path, str | int], str] = {
    (("reactions",), "axes_of"): "write the body along whose axes the components are, such as axes_of: ground",
    (("states",), "start"): "write its value where a run begins, such as start: 0 rad",
    (("states",), "rate"): "write an expression for its rate of change, such as rate: speed - 2*level",
    (("controllers",), "every"): "write the time between two samples, such as every: 1 ms",
    (("forces",), "calspan"): "write ten Calspan constants; for a vertical spring alone, kind: wheel with force: [0, 0, 2e5*deflection]",
    (("law",), "at"): "write the place where the stop is met, such as at: 0.25",
    (("law",), "side"): "write on which side of it the stop acts: side: above, as of a rope, or side: below, as of a bumper",
    (("memory",), "start"): "write its value before the first sample, such as start: 0",
    (("memory",), "next"): "write an expression for its value from a sample on, such as next: sum + error",
}
_BOUNDS = {"ge": "at least", "le": "at most", "gt": "above", "lt": "below"}
_EXPECTATIONS = {
    "dict_type": "needs a mapping", "model_type": "needs a mapping", "model_attributes_type": "needs a mapping",
    "tuple_type": "needs a list", "string_type": "needs text", "bool_type": "needs true or false", "int_type": "needs a whole number",
}  # fmt: skip


@dataclass(frozen=True)
class Shaped:
    """A document of the right shape, the full names of the elements that were left out to make it so, and which may be parameters."""

    document: Document
    removed: frozenset[str] = frozenset()
    lost_parameters: frozenset[str] = frozenset()


def check_shape(source: Source, problems: Problems, lost: set[Path]) -> Shaped | None:
    """The document of a source without ``lost`` elements, noting every field that is unknown, missing or of the wrong shape.
    None if the errors prevent further checks."""
    if () in lost:
        return None
    left = replace(source, data=_pruned(source.data, (), lost))
    document, found = _validate(left, problems, Document, element_of)
    return _without_broken(source, found, lost) if document is None or lost else Shaped(document)


def check_part(source: Source, problems: Problems, part: type[_P], element_of: Names) -> _P | None:
    """A document of another kind, with errors in the same form; None for errors other than unknown fields. ``element_of`` is as below."""
    document, found = _validate(source, problems, part, element_of)
    if document is None and all(flaw.kind == "extra_forbidden" for flaw in found):
        with suppress(ValidationError):  # required fields may be present under an earlier name
            return part.model_validate(_pruned(source.data, (), {flaw.path for flaw in found}))
    return document


def _validate(source: Source, problems: Problems, part: type[_P], element_of: Names) -> "tuple[_P | None, list[_Flaw]]":
    """The document, or None and its errors, which are noted."""
    try:
        return part.model_validate(source.data), []
    except ValidationError as error:
        details = error.errors(include_url=False)
    found = [_Flaw(detail, _data_path(source.data, detail), part, element_of) for detail in details]
    for flaw in found:
        if not (flaw.kind == "too_short" and any(other.is_inside(flaw) for other in found)):
            _report(source, problems, flaw)
    return None, found


@dataclass(frozen=True)
class _Flaw:
    """One of pydantic's errors, with the keys to its place in the data of a document, and how that names its elements."""

    detail: ErrorDetails
    path: Path
    document: type[BaseModel]
    element_of: Names

    @property
    def kind(self) -> str:
        return self.detail["type"]

    def is_inside(self, other: "_Flaw") -> bool:
        """Return whether this flaw explains the other: items that fail make their list look too short."""
        return len(self.path) > len(other.path) and self.path[: len(other.path)] == other.path


def _data_path(data: Any, detail: ErrorDetails) -> Path:
    """The keys to a place in the data: pydantic's location without the tags of unions. A missing key stays as the last item."""
    path: list[str | int] = []
    for step in detail["loc"]:
        inner = dict(enumerate(data)) if isinstance(data, tuple) else data
        if isinstance(inner, dict) and step in inner:
            path.append(step)
            data = inner[step]
    if detail["type"] == "missing":
        path.append(detail["loc"][-1])
    return tuple(path)


def _report(source: Source, problems: Problems, flaw: _Flaw) -> None:
    label, start = flaw.element_of(flaw.path)
    message, hint = _words(flaw)
    if flaw.kind in ("missing", "extra_forbidden"):
        inner, place = flaw.path[start:-1], flaw.path if flaw.kind == "extra_forbidden" else flaw.path[:-1]
        problems.add(source.key_span(place), label, worded(field_name(inner), message), hint)
    elif flaw.kind == "union_tag_invalid":
        problems.add(source.value_span((*flaw.path, "kind")), label, message, hint)
    else:
        at_name = len(flaw.path) <= start or flaw.detail["loc"][-1] == "[key]"
        place_of = source.key_span if at_name else source.value_span
        problems.add(place_of(flaw.path), label, worded(field_name(flaw.path[start:]), message), hint)


def element_of(path: Path) -> tuple[str, int]:
    """The element that a path leads into, in words, and how many keys lead to it."""
    if path[:1] == ("submodels",) and len(path) >= 4 and path[2] in KINDS and isinstance(path[3], str):
        if path[2] == "submodels" and len(path) >= 6 and path[4] in KINDS and isinstance(path[5], str):
            label, count = element_of(path[2:])
            return label, count + 2
        return f"{KINDS[str(path[2])]} '{path[3]}' of submodel '{path[1]}'", 4
    if len(path) >= 2 and path[0] in KINDS:
        return f"{KINDS[str(path[0])]} '{path[1]}'", 2
    return "model", 0


def _words(flaw: _Flaw) -> tuple[str, str]:
    detail, path = flaw.detail, flaw.path
    context = detail.get("ctx", {})
    match flaw.kind:
        case "shape":
            return detail["msg"], str(context.get("hint", ""))
        case "missing":
            return f"the field '{path[-1]}' is missing", _MISSING.get((path[-3:-2], path[-1]), "")
        case "extra_forbidden":
            return _unknown_field(flaw)
        case "union_tag_not_found":
            return "the field 'kind' is missing", ""
        case "union_tag_invalid":
            return _unknown_kind(flaw.element_of(path)[0].split()[0], str(context["tag"]), context["expected_tags"])
        case "literal_error":
            return f"must be {context['expected']}, not {str(detail['input'])[:40]!r}", ""
        case "greater_than_equal" | "less_than_equal" | "greater_than" | "less_than":
            ((name, bound),) = context.items()
            return f"must be {_BOUNDS[name]} {bound}, not {detail['input']}", ""
        case "too_short":
            least = context["min_length"]
            return f"needs at least {least} item{'s' * (least > 1)}, got {context['actual_length']}", ""
        case "too_long":
            return f"needs at most {context['max_length']} items, got {context['actual_length']}", ""
    hint = "write table: {t: [0, 1], value: [0, 2]}, with the law's variable in place of t" if "table" in path[-2:] else ""
    if path[-2:] == ("table", "interpolation"):
        return "belongs beside the table", "write table: {t: [0, 1], value: [0, 2]}, interpolation: linear"
    return _EXPECTATIONS.get(flaw.kind, detail["msg"]), hint


def _unknown_kind(what: str, kind: str, expected: str) -> tuple[str, str]:
    kinds = sorted(expected.replace("'", "").split(", "))
    guess = nearest(kind, kinds, "kinds")
    every = f"kinds: {', '.join(kinds)}"
    return f"unknown {what} kind '{kind}'", guess if guess == every else f"{guess} {every}"


def _unknown_field(flaw: _Flaw) -> tuple[str, str]:
    name, fields = str(flaw.path[-1]), _fields_at(flaw.document, flaw.detail["loc"][:-1])
    belongs = f"it belongs to the law: write law: {{{name}: ...}}" if "law" in fields and name in SpringDamper.model_fields else ""
    return f"unknown field '{name}'", belongs or nearest(name, fields, "fields")


def _fields_at(document: type[BaseModel], location: tuple[str | int, ...]) -> list[str]:
    part: Any = document
    for step in location:
        part = _descend(part, step)
    part = get_args(part)[0] if get_origin(part) is Annotated else part
    if get_origin(part) in (Union, types.UnionType):  # an optional part
        part = next((member for member in get_args(part) if _is_model(member)), None)
    return [field.alias or name for name, field in part.model_fields.items()] if _is_model(part) else []


def _is_model(part: Any) -> bool:
    return isinstance(part, type) and issubclass(part, BaseModel)


def _descend(part: Any, step: str | int) -> Any:
    """The type one step further in, None when there is none."""
    if get_origin(part) is Annotated:
        part = get_args(part)[0]
    if get_origin(part) in (Union, types.UnionType):
        members = get_args(part)
        tagged = {TAG.format(i): member for i, member in enumerate(members)}
        if step in tagged and types.NoneType not in members:
            return tagged[str(step)]
        chosen = [member for member in members if _chosen_by(member, step)]
        inner = (_descend(member, step) for member in members)
        return chosen[0] if chosen else next((found for found in inner if found is not None), None)
    if _is_model(part):
        fields = {field.alias or name: field.annotation for name, field in part.model_fields.items()}
        return fields.get(str(step))
    return {dict: get_args(part)[-1:], tuple: get_args(part)[:1]}.get(get_origin(part) or part, (None,))[0]


def _chosen_by(member: Any, step: str | int) -> bool:
    """Return whether ``step`` is the kind of a union's member."""
    kind = member.model_fields.get("kind") if _is_model(member) else None
    return kind is not None and get_origin(kind.annotation) is Literal and step in get_args(kind.annotation)


def _without_broken(source: Source, found: list[_Flaw], drop: set[Path]) -> Shaped | None:
    """The document without parts of the wrong shape and parts to ``drop``, but with the rest of elements that stand-ins make readable.
    None when more than elements is wrong."""
    stands: dict[Path, int] = {}
    while True:
        places = [_place_of_stand(flaw, stands) for flaw in found]
        new = {path for flaw, place in zip(found, places, strict=True) if not place for path in _left_out(flaw)} - drop
        if () in new or (found and not new and not any(places)):
            return None
        for place in filter(None, dict.fromkeys(places)):
            outside = {path: index for path, index in stands.items() if path[: len(place)] != place}
            stands = {**outside, place: stands.get(place, -1) + 1}
        drop = drop | new
        data = _pruned(source.data, (), drop)
        for place, index in stands.items():
            data = _replaced(data, place, _STANDS[index])
        data |= {name: value for name, value in _STAND_INS.items() if name not in data}
        try:
            document = Document.model_validate(data)
        except ValidationError as error:  # required fields may be missing without the parts that were left out
            found = [_Flaw(detail, _data_path(data, detail), Document, element_of) for detail in error.errors(include_url=False)]
            continue
        broken = drop | {path[: element_of(path)[1]] for path in stands}
        names = frozenset(_full_names(source, document, broken))
        parameters = {str(path[1]) for path in broken if len(path) == 2 and path[0] == "parameters"}
        return Shaped(document, names, frozenset({*parameters, *_in_unknown_sections(source, drop)}))


def _place_of_stand(flaw: _Flaw, stands: Mapping[Path, int]) -> Path:
    """The field of an element that the next stand-in takes; none where its element has to be left out, or only an unknown field."""
    path, start = flaw.path, element_of(flaw.path)[1]
    is_name = flaw.detail["loc"][-1:] == ("[key]",) or flaw.kind.startswith("union_tag")
    if not start or is_name or flaw.kind == "extra_forbidden" or path[start - 2] in _WHOLE:
        return ()
    path = path[: next((n for n in range(start, len(path)) if path[n] in _INNER), len(path))]
    place = next((path[:n] for n in range(start + 1, len(path)) if path[:n] in stands), path)
    while len(place) > start and stands.get(place, 0) == len(_STANDS) - 1:
        place = place[:-1]
    return place if len(place) > start else ()


def _replaced(data: Any, path: Path, value: Any) -> Any:
    """The data with another value at a path; as they are where it leads nowhere."""
    if isinstance(data, dict) and len(path) == 1:
        return {key: inner for key, inner in {**data, path[0]: value}.items() if inner is not _OMITTED}
    if isinstance(data, dict) and path[0] in data:
        return {**data, path[0]: _replaced(data[path[0]], path[1:], value)}
    if isinstance(data, tuple) and isinstance(path[0], int) and path[0] < len(data):
        inner = value if len(path) == 1 else _replaced(data[path[0]], path[1:], value)
        return (*data[: path[0]], *(() if inner is _OMITTED else (inner,)), *data[path[0] + 1 :])
    return data


def _left_out(flaw: _Flaw) -> Iterator[Path]:
    """The paths to leave out of the document for an error; none if more than elements would be left out."""
    path, start = flaw.path, element_of(flaw.path)[1]
    if flaw.kind == "extra_forbidden":
        yield path
    elif path[:1] == ("scenes",) and len(path) > 2 and path[2] != "end":
        yield path[:3]
        if path[2] == "numerics":  # steps and rows have to go together
            yield (*path[:2], "output_step")
    elif (depth := _depth(path)) and path[depth : depth + 1] == ("outputs",):
        yield path[: depth + 1]
    elif start:
        yield path[:start]
    else:
        other_version = path[:1] == ("cutjoint",) and flaw.kind != "missing"
        yield path[:1] if path[:1] and path[0] in ("display", "outputs", "scenes", *_STAND_INS) and not other_version else ()


def _depth(path: Path) -> int:
    """The number of keys that lead to the submodel around a place, 0 in the model."""
    depth = 0
    while path[depth : depth + 1] == ("submodels",) and len(path) > depth + 1:
        depth += 2
    return depth


def _pruned(data: Any, path: Path, drop: set[Path]) -> Any:
    if isinstance(data, dict):
        return {key: _pruned(value, (*path, key), drop) for key, value in data.items() if (*path, key) not in drop}
    if isinstance(data, tuple):
        return tuple(_pruned(value, (*path, index), drop) for index, value in enumerate(data))
    return data


def _full_names(source: Source, document: Document, drop: set[Path]) -> Iterator[str]:
    """The names by which others refer to elements that were left out."""
    yield from _in_unknown_sections(source, drop)
    uses = [use for use in find_uses(document) if use.submodel is not None]
    for path in (path for path in drop if path[0] != "scenes"):
        if len(path) - _depth(path[:-2]) != 2:
            continue
        users = [""] if len(path) == 2 else [f"{use.name}." for use in uses if use.at == path[:-2]]
        endings = ["", *(f"_{suffix}" for suffix in JOINT_FORCES.values())] if path[-2] == "joints" else [""]
        yield from (f"{user}{path[-1]}{ending}" for user in users for ending in endings)


def _in_unknown_sections(source: Source, drop: set[Path]) -> Iterator[str]:
    """The names in sections whose own names are wrong."""
    for (section,) in (path for path in drop if len(path) == 1):
        part = source.data.get(section)
        yield from map(str, part if section not in Document.model_fields and isinstance(part, dict) else ())
