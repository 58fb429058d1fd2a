"""The results of a fit as files: JSON, and model files with the new numbers."""

import json
import re
from collections.abc import Mapping
from dataclasses import asdict
from math import isclose, isfinite
from pathlib import Path
from typing import Any

from cutjoint.fits.fit import Fit
from cutjoint.model.document.source import parse_yaml
from cutjoint.model.expressions.units import measure, read_measure
from cutjoint.model.records import Binding, Model, Span
from cutjoint.package.errors import RunError
from cutjoint.topology.reading import read_model_text

#: A plain or quoted scalar that is a number, perhaps with a unit.
_SCALAR = re.compile(
    r"""(?P<quote>["']?)(?P<number>[-+.\deE]+)(?P<unit>(?:\s*[^\s,}\]"'#][^,}\]"'#\n]*?)?)(?P=quote)(?=\s*(?:[,}\]#\n]|$))"""
)


def as_json(fit: Fit) -> str:
    """A fit as JSON, SI units; infinite numbers are null."""
    parameters = {
        name: {"value": fit.values[i], "unit": fit.units[i], "start": fit.start[i], "deviation": fit.deviations[i],
               "interval": fit.intervals[i].tolist()}
        for i, name in enumerate(fit.names)
    }  # fmt: skip
    signals = [{key: value for key, value in vars(s).items() if key not in ("times", "measured", "predicted")} for s in fit.signals]
    content = {
        "cutjoint_fit_result": 1, "verdict": fit.verdict, "faults": dict(fit.faults), "parameters": parameters,
        "numbers": dict(fit.numbers), "cost": fit.cost, "iterations": fit.iterations, "runs": fit.runs, "starts": fit.starts,
        "correlations": fit.correlations, "before": asdict(fit.before), "after": asdict(fit.after), "signals": signals,
    }  # fmt: skip
    return json.dumps(_plain(content), indent=1) + "\n"


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _plain(each) for key, each in value.items()}
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return None if isinstance(value, float) and not isfinite(value) else value


def rewrite_model(model: Model, numbers: Mapping[str, float]) -> str:
    """The text of a model's file with other numbers; all else stays as it is, comments too.
    Raises RunError: a number does not stand in the file by itself."""
    path, text = Path(model.span.file), model.text
    source, lines = parse_yaml(text, str(path)), text.splitlines(keepends=True)
    edits: list[tuple[Span, str, float]] = []
    tunable = []
    for p in model.parameters:
        if p.name in numbers and p.binding is not Binding.INPUT:
            keys: tuple[str, ...] = ("parameters", p.name)
            entry = source.data.get("parameters", {}).get(p.name)
            unit, span = "", p.span
            if entry is not None:
                keys, unit = ((*keys, "value"), entry.get("unit", "")) if isinstance(entry, dict) else (keys, "")
                span = source.value_span(keys)
            else:
                tunable.append(p.name)
            edits.append((span, str(unit), numbers[p.name]))
    for span, unit, value in sorted(edits, key=lambda edit: (edit[0].line, edit[0].column), reverse=True):
        line = lines[span.line - 1]
        found = _SCALAR.match(line, span.column - 1) if span.file == model.span.file else None
        if found is None:
            raise RunError(f"{span}: the number does not stand there by itself; write it in the model file, or as a parameter of its own")
        written = read_measure(found["number"] + found["unit"]) if found["unit"] else None
        factor = (written.value / float(found["number"]) if written is not None and float(found["number"]) else
                  measure(1.0, found["unit"].strip() or unit).value if found["unit"] or unit else 1.0)  # fmt: skip
        new = f"{found['quote']}{value / factor:.15g}{found['unit']}{found['quote']}"
        lines[span.line - 1] = line[: found.start()] + new + line[found.end() :]
    new_text = "".join(lines)
    read = {p.name: p.value for p in read_model_text(new_text, str(path), folder=path.parent, tunable=tunable).parameters}
    for name in (p.name for p in model.parameters if p.name in numbers and p.binding is not Binding.INPUT):
        if not isclose(read[name], numbers[name], rel_tol=1e-12, abs_tol=1e-300):
            raise RunError(f"{path}: '{name}' would be {read[name]:g} in the file, not {numbers[name]:g}; write it as a plain number there")
    return new_text
