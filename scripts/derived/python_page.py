"""The Python reference, from signatures and docstrings."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator, Mapping
from dataclasses import fields
from importlib import import_module

import cutjoint

HEAD = """# Python reference

`import cutjoint` gives these functions, classes and exceptions. Values are in SI units, paths are `str` or `Path`.
[Use cutjoint from Python](../how-to/python.md) shows them at work. Members of a `Simulation` that need a
state raise `SimulationError` before its first `reset`.
"""

#: Records that functions return or take, by the modules that have them.
RECORDS = {
    "cutjoint.run.artifact": ("Artifact",), "cutjoint.compile.options": ("CompileOptions",),
    "cutjoint.run.results": ("Trajectory", "Batch"),
    "cutjoint.tasks.states": ("MechanismState",), "cutjoint.analysis.modes": ("Modes", "Mode"), "cutjoint.tasks.inverse": ("Drives",),
    "cutjoint.tasks.kinematics.sweep": ("AxleKinematics", "AxleCompliance"), "cutjoint.tasks.realtime": ("StepTimes",),
    "cutjoint.sweeps.run": ("Indices", "Tolerance"), "cutjoint.stepping.values": ("StepStatistics",),
}  # fmt: skip

#: What the head says once, with what takes its place in each entry.
_NO_RESET = {"; or there was no `reset`": "", ", ([^,;:]+), or there was no `reset`": r" or \1", ",?(?: or)? there was no `reset`": ""}


def page() -> str:
    """The page: functions, classes, then exceptions, by name."""
    public = {name: getattr(cutjoint, name) for name in cutjoint.__all__}
    errors = {name: value for name, value in public.items() if inspect.isclass(value) and issubclass(value, Exception)}
    classes = {name: value for name, value in public.items() if inspect.isclass(value) and name not in errors}
    functions = {name: value for name, value in public.items() if name not in errors and name not in classes}
    lines = [HEAD, "## Functions\n"]
    for name, function in functions.items():
        lines += _entry("###", name, function)
    lines.append("## Classes\n")
    for name, found in classes.items():
        lines += [f"### {name}\n", _prose(found)]
        for member, value in _members(found, public):
            if not member.startswith("_") and (callable(value) or _is_property(value)):
                lines += _entry("####", f"{name}.{member}", value)
    lines.append("## Records\n\nWhat the functions above return or take.\n")
    for module, names in RECORDS.items():
        for name in names:
            lines += _record(getattr(import_module(module), name), public)
    lines.append("## Exceptions\n\n| class | base | raised when |\n|---|---|---|")
    for name, error in errors.items():
        text = " ".join(_first_paragraph(error).split()).replace("|", "\\|")
        lines.append(f"| `{name}` | `{error.__mro__[1].__name__}` | {text} |")
    return "\n".join(lines) + "\n"


def _members(found: type, public: Mapping[str, object]) -> Iterator[tuple[str, object]]:
    """The members of a class and of those bases that have no section of their own."""
    for kind in reversed(found.__mro__):
        if kind is found or (kind.__module__.startswith("cutjoint.") and kind not in public.values()):
            yield from vars(kind).items()


def _record(found: type, public: Mapping[str, object]) -> Iterator[str]:
    """The section of a record: its fields, then its docstring and the first lines of its methods."""
    yield f"### {found.__name__}\n"
    if names := [f"`{field.name}`" for field in fields(found)]:  # type: ignore[arg-type]
        yield f"Fields: {', '.join(names)}.\n"
    yield _prose(found)
    for member, value in _members(found, public):
        if not member.startswith("_") and (inspect.isfunction(value) or _is_property(value)):
            yield f"* `{member}`: {' '.join(_first_paragraph(value).split())}"
    yield ""


def _entry(level: str, name: str, found: object) -> Iterator[str]:
    """The section of a function, method or property: signature, then docstring."""
    yield f"{level} {name}\n"
    if callable(found):
        yield f"```python\n{_signature(name, found)}\n```\n"
    yield _prose(found)


def _signature(name: str, function: object) -> str:
    """A signature without quotes around annotations, a parameter a line where it is long."""
    parameters = list(inspect.signature(function).parameters.values())  # type: ignore[arg-type]
    words = [_parameter(p) for p in parameters if p.name != "self"]
    first = next((i for i, p in enumerate(parameters) if p.kind is p.KEYWORD_ONLY), None)
    if first is not None and not any(p.kind is p.VAR_POSITIONAL for p in parameters):
        words.insert(first - sum(p.name == "self" for p in parameters), "*")
    result = str(inspect.signature(function).return_annotation).strip("'")  # type: ignore[arg-type]
    line = f"{name}({', '.join(words)}) -> {result}"
    return line if len(line) <= 100 else f"{name}(\n    " + ",\n    ".join(words) + f",\n) -> {result}"


def _parameter(parameter: inspect.Parameter) -> str:
    """A parameter with its annotation and default; that of compiler flags depends on the environment."""
    if parameter.name == "flags":
        return f"flags: {parameter.annotation} = FLAGS".replace("'", "")
    default = "" if parameter.default is parameter.empty else f" = {parameter.default!r}"
    stars = {parameter.VAR_POSITIONAL: "*", parameter.VAR_KEYWORD: "**"}.get(parameter.kind, "")
    return f"{stars}{parameter.name}: {str(parameter.annotation).strip(chr(39))}{default}"


def _prose(found: object) -> str:
    """A docstring as Markdown: sections such as "Raises:" become lists, double backquotes single ones."""
    text = (inspect.getdoc(found) or "").replace("``", "`")
    body, *sections = re.split(r"^(Args|Returns|Raises|Attributes|Source):\n", text, flags=re.MULTILINE)
    parts = [body.strip()]
    for title, lines in zip(sections[::2], sections[1::2], strict=True):
        if items := [item for item in map(_without_reset, _items(inspect.cleandoc("\n" + lines))) if item != "* SimulationError:."]:
            parts.append(f"**{title}**\n\n" + "\n".join(items))
    return "\n\n".join(parts) + "\n"


def _without_reset(entry: str) -> str:
    """An entry without what the head of the page says of all."""
    for pattern, text in _NO_RESET.items():
        entry = re.sub(pattern, text, entry)
    return entry


def _items(text: str) -> Iterator[str]:
    """The entries of a section, one a list item; further lines of an entry are indented."""
    entry = ""
    for line in text.splitlines():
        if entry and line and not line.startswith(" "):
            yield f"* {entry}"
            entry = line
        else:
            entry = f"{entry} {line.strip()}".strip()
    if entry:
        yield f"* {entry}"


def _is_property(value: object) -> bool:
    return isinstance(value, property) or type(value).__name__ == "cached_property"


def _first_paragraph(found: object) -> str:
    return (inspect.getdoc(found) or "").replace("``", "`").split("\n\n")[0]
