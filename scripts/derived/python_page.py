"""The Python reference, from signatures and docstrings."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator, Mapping
from dataclasses import fields
from importlib import import_module
from textwrap import fill

import cutjoint

HEAD = """# Python reference

`import cutjoint` gives these functions, classes and exceptions. Values are in SI units, paths are `str` or `Path`.
[Use cutjoint from Python](../how-to/python.md) shows them at work.

## Common arguments

Signatures give the default of these arguments, not their type.

| argument | type | meaning |
|---|---|---|
{arguments}

These errors are not repeated below.

* A wrong model, scene or study raises `ModelError` or `EquationsError`. `RunError`: there is no such scene, method or
  integrator, or a parameter cannot be set.
* A failing compiler raises `ToolchainError`, a missing one its subclass `MissingToolsError`, a failed simulator
  `SimulatorError`, a file that cannot be written `OutputError`, and SIGINT or SIGTERM
  `Interrupted` or `Terminated`.
* Members of `Simulation` that need a state raise `SimulationError` before its first `reset`; so does a failed step.
  Derivatives raise `TypeError` unless the model was loaded with `linearise`, adjoint sensitivities with `adjoint`, poses
  with `poses`. In a singular pose, derivatives raise `SimulationError`.
* An unknown name, or a coordinate that is not independent, raises `KeyError`, an array of another shape `ValueError`,
  and a missing package `MissingPackageError`.
"""

#: Arguments that mean the same in all functions: type and meaning.
ARGUMENTS = {
    "model": ("str, Path, `Model` or `Artifact`", "a model file, or a model that was read or compiled"),
    "scene": ("str", "default: the only one"),
    "tunable": ("list of str", 'patterns such as `"*.stiffness"`; constants whose names match become parameters'),
    "parameters": ("dict", "values (SI units) of parameters and constant inputs by name"),
    "method, integrator, solver, events": ("str", "as on the command line; default: the scene's"),
    "dt, end": ("float", "step and end (s); default: the scene's"),
    "accuracy, solver_tolerance, tolerance, penalty, iterations": ("float, int", "as on the command line"),
    "external_wrenches": ("list of str", "bodies and markers with inputs `NAME.wrench.fx` to `NAME.wrench.tz` (N, N m, global axes)"),
    "terrain": ("list of str", "patterns of wheels whose ground becomes inputs"),
    "inputs, outputs, by": ("list of str", "names; `inputs` of runs: values or tables by name"),
    "functions": ("file or dict", "functions that the model declares: C++, or callables `(arguments, memory, results, partials)`"),
    "flags": ("list of str", "of the compiler"),
    "out": ("str or Path", "file of the results, written as runs end"),
    "threads": ("int", "default: all processors"),
    "progress, note": ("callable", "is called with progress (share, text) or messages"),
    "check": ("bool", "raise an error if the run, or one of the runs, fails"),
}  # fmt: skip

#: Errors that the head of the page has.
_COMMON = re.compile(
    r"\* (ModelError|EquationsError|ToolchainError|SimulatorError|OutputError|Interrupted)\b.*"
    r"|\* TypeError: the model was loaded without (derivatives( or without poses)?|`adjoint`)\."
    r"|\* SimulationError:( the pose is singular| a step failed)?\."
    r"|\* ValueError: (an array has another length|there is another number of \w+|the point has not three numbers)\."
    r"|\* MissingPackageError: \S+ is not installed\."
    r"|\* (scene|tunable|threads|parameters(?=: values)|note|external_wrenches|terrain|functions|check)\b.*"
    r"|\* RunError: there is no such scene, or a parameter cannot be set\."
    r"|\* KeyError: there is no such [a-z, ]+\."
)
#: The class whose members two classes of the page share.
SHARED = "LinearModel"

#: Records that functions return or take, by the modules that have them.
RECORDS = {
    "cutjoint.compile.options": ("CompileOptions",),
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
    arguments = "\n".join(f"| `{name.replace(', ', '`, `')}` | {kind} | {text} |" for name, (kind, text) in ARGUMENTS.items())
    lines = [HEAD.format(arguments=arguments), "## Functions\n"]
    for name, function in functions.items():
        lines += _entry("###", name, function)
    lines.append("## Classes\n")
    for name, found in classes.items():
        lines += [f"### {name}\n", _prose(found)]
        members = _members(found, public)
        lines += [*(f"* `{member}`: {_line(value)}" for member, value in members.items() if _is_property(value)), ""]
        for member, value in members.items():
            if callable(value):
                lines += _entry("####", f"{name}.{member}", value)
    lines.append("## Records\n\nWhat the functions above return or take.\n")
    for module, names in RECORDS.items():
        for name in names:
            lines += _record(getattr(import_module(module), name), public)
    lines.append("## Exceptions\n\n| class | base | raised when |\n|---|---|---|")
    for name, error in errors.items():
        text = _line(error).replace("|", "\\|")
        lines.append(f"| `{name}` | `{error.__mro__[1].__name__}` | {text} |")
    return "\n".join(lines) + "\n"


def _members(found: type, public: Mapping[str, object]) -> dict[str, object]:
    """The public members of a class and of those bases that have no section of their own."""
    kinds = [kind for kind in found.__mro__ if kind is found or (kind.__module__.startswith("cutjoint.") and kind not in public.values())]
    kept = [kind for kind in kinds if kind.__name__ != SHARED or found.__name__ == "StateSpace"]
    members = {name: value for kind in reversed(kept) for name, value in vars(kind).items() if not name.startswith("_")}
    return {name: value for name, value in members.items() if inspect.isfunction(value) or _is_property(value)}


def _record(found: type, public: Mapping[str, object]) -> Iterator[str]:
    """The section of a record: fields that its docstring does not name, then that and the first lines of its methods."""
    yield f"### {found.__name__}\n"
    prose = _prose(found)
    if names := [f"`{field.name}`" for field in fields(found) if not re.search(rf"\b{field.name}\b", prose)]:
        yield f"Further fields: {', '.join(names)}.\n"
    yield prose
    for member, value in _members(found, public).items():
        yield f"* `{member}`: {_line(value)}"
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
    line = f"{name}({', '.join(words)}) -> {_type(inspect.signature(function).return_annotation)}"  # type: ignore[arg-type]
    if len(line) <= 110:
        return line
    whole = [word.replace(" ", "\xa0") for word in words]
    arguments = fill(", ".join(whole), 106, initial_indent="    ", subsequent_indent="    ").replace("\xa0", " ")
    return f"{name}(\n{arguments}\n{line[line.rindex(') ->') :]}"


def _parameter(parameter: inspect.Parameter) -> str:
    """A parameter with its default, and its type unless the head of the page has it."""
    stars = str(parameter).partition(parameter.name)[0]
    common = {name for names in ARGUMENTS for name in names.split(", ")}
    kind = "" if parameter.name in common or stars else f": {_type(parameter.annotation)}"
    default = "" if parameter.default is parameter.empty else f"={parameter.default!r}" if not kind else f" = {parameter.default!r}"
    return f"{stars}{parameter.name}{kind}{default if parameter.name != 'flags' else '=FLAGS'}"


def _type(annotation: object) -> str:
    """A type without the modules of its names."""
    text = annotation.__name__ if inspect.isclass(annotation) and not hasattr(annotation, "__args__") else str(annotation).strip("'")
    for pattern, name in ((r"numpy\.ndarray\[tuple\[typing\.Any, \.\.\.\], numpy\.dtype\[numpy\.(float|complex)\w+\]\]", "Array"),
                          (r"str \| os\.PathLike\[str\] \| cutjoint\.\S+ \| cutjoint\.\S+", "ModelLike"),
                          (r"str \| os\.PathLike\[str\]", "AnyPath"), (r"\b(\w+\.)+(?=\w)", "")):
        text = re.sub(pattern, name, text)
    return text


def _prose(found: object) -> str:
    """A docstring as Markdown: sections such as "Raises:" become lists, double backquotes single ones."""
    text = (inspect.getdoc(found) or "").replace("``", "`")
    body, *sections = re.split(r"^(Args|Returns|Raises|Attributes|Source):\n", text, flags=re.MULTILINE)
    parts = [body.strip()]
    for title, lines in zip(sections[::2], sections[1::2], strict=True):
        if items := [item for item in map(_without_reset, _items(inspect.cleandoc("\n" + lines))) if not _COMMON.fullmatch(item)]:
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


def _line(found: object) -> str:
    return " ".join(_first_paragraph(found).split())


def _first_paragraph(found: object) -> str:
    return (inspect.getdoc(found) or "").replace("``", "`").split("\n\n")[0]
