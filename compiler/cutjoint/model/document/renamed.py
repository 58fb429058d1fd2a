"""Fields and words of earlier versions in files: they still work, and the new ones are reported."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, TypeAlias

from cutjoint.methods import FORMER_INTEGRATORS
from cutjoint.model.document.source import Path, Source
from cutjoint.model.errors import Problems

#: The new names of fields by the path to each, or the new words of a value by the earlier ones.  "*" stands for any key, "**" for none or
#: more submodels.
Renamed: TypeAlias = Mapping[tuple[str, ...], str | Mapping[str, str]]

#: The fields of model files that were called otherwise.
MODEL: Renamed = {
    ("scenes", "*", "tolerance"): "accuracy",
    ("scenes", "*", "numerics", "tolerance"): "solver_tolerance",
    ("scenes", "*", "numerics", "methods", "*", "tolerance"): "solver_tolerance",
    ("**", "reactions", "*", "body"): "axes_of",
    ("scenes", "*", "numerics", "integrator"): FORMER_INTEGRATORS,
    ("scenes", "*", "numerics", "loops"): {"compiled": "embedded"},
    **{("**", "forces", "*", f"ground_{of}"): f"terrain_{of}" for of in ("height", "slope", "bank")},
}

#: Fields of study files.
STUDY: Renamed = {("open",): "tunable", ("tolerance",): "solver_tolerance", ("integrator",): FORMER_INTEGRATORS}


def rename_fields(source: Source, problems: Problems, renamed: Renamed) -> tuple[Source, tuple[str, ...]]:
    """The source in the words of this version, and a sentence for each place with another; two words for one thing are a problem."""
    notes: list[str] = []
    for pattern, new in renamed.items():
        for path in list(_matches(source.data, pattern)):
            if not isinstance(new, str):
                word = source.part(path)
                if isinstance(word, str) and word in new:
                    source = replace(source, data=_with_value(source.data, path, new[word]))
                    notes.append(f"{source.value_span(path)}: '{word}' is now '{new[word]}'")
                continue
            span, place = source.key_span(path), (*path[:-1], new)
            if place in source.keys:
                problems.add(span, "file", f"'{path[-1]}' is the earlier word for '{new}', which is given too", "keep the latter")
            else:
                source = _with_name(source, path, new)
                notes.append(f"{span}: '{path[-1]}' is now '{new}'")
    return source, tuple(notes)


def _matches(data: Any, pattern: tuple[str, ...], path: Path = ()) -> Iterator[Path]:
    """The paths in some data that a pattern stands for."""
    if not pattern:
        yield path
    elif pattern[0] == "**":
        yield from _matches(data, pattern[1:], path)
        yield from _matches(data, ("submodels", "*", *pattern), path)
    elif isinstance(data, dict):
        for key in data if pattern[0] == "*" else [k for k in data if k == pattern[0]]:
            yield from _matches(data[key], pattern[1:], (*path, key))


def _with_value(data: Any, path: Path, value: Any) -> Any:
    first, *rest = path
    return {**data, first: _with_value(data[first], tuple(rest), value) if rest else value}


def _with_name(source: Source, path: Path, name: str) -> Source:
    """The source with another name for the field at a path, in the same place."""

    def moved(place: Path) -> Path:
        return (*path[:-1], name, *place[len(path):]) if place[: len(path)] == path else place

    return Source(
        source.file, _renamed(source.data, path, name), {moved(p): span for p, span in source.values.items()},
        {moved(p): span for p, span in source.keys.items()},
    )  # fmt: skip


def _renamed(data: Any, path: Path, name: str) -> Any:
    first, *rest = path
    return {
        (name if key == first and not rest else key): (_renamed(value, tuple(rest), name) if key == first and rest else value)
        for key, value in data.items()
    }  # fmt: skip
