"""The page of a bench: one HTML file that stands alone, with a chart of all points first and provenance last."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.resources import files
from math import isnan
from typing import Any

import jinja2

from cutjoint.methods import INTEGRATORS, names_of
from cutjoint.view.page import as_data, script_hash
from cutjoint_bench.findings import describe_setting, fastest_ours, fastest_peer, order, timed
from cutjoint_bench.report.atlas_charts import draw_atlas
from cutjoint_bench.report.atlas_tables import tabulate_conditions, tabulate_reasons
from cutjoint_bench.report.charts import draw_accuracies, draw_drift
from cutjoint_bench.report.choices import asked_lines, describe_choices, tabulate_accuracies
from cutjoint_bench.report.explorer import explore
from cutjoint_bench.report.precisions import describe_precisions
from cutjoint_bench.report.tables import (
    milliseconds,
    tabulate_configurations,
    tabulate_limits,
    tabulate_lines,
    tabulate_paper,
    tabulate_parallel,
    tabulate_situations,
    tabulate_stiff,
    tabulate_studies,
    tabulate_targets,
)

Data = Mapping[str, Any]

#: Distances (m) of the routes of a reference that show a jump of speed, and of kinks in a road.
_JUMP, _KINK = 1e-3, 1e-8


Draw = Callable[[Data], str]


@dataclass(frozen=True, kw_only=True)
class Charts:
    """Charts of drifts and atlases on a page: functions to HTML, empty for a chart that it leaves out; ``note`` is the text about these."""

    drift: Draw
    atlas: Draw
    note: str = ""


def _left_out(_: Data) -> str:
    return ""


ALL_CHARTS = Charts(drift=draw_drift, atlas=draw_atlas)

#: For a page that git holds.
NO_MAPS = Charts(
    drift=_left_out, atlas=_left_out,
    note="Charts of what is kept and maps of failures are on the page that make report writes to results/report/bench.html.",
)  # fmt: skip


def render_page(studies: Mapping[str, Data], charts: Charts = ALL_CHARTS) -> str:
    """The page of what `study.perform` returned for each study, by its name."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("cutjoint_bench"), undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        keep_trailing_newline=True, autoescape=True,
    )  # fmt: skip
    cases, drifts, atlases, situations = (
        [part for data in studies.values() for part in data[name]] for name in ("cases", "drifts", "atlases", "situations")
    )
    script = files("cutjoint_bench").joinpath("templates/explore.js").read_text(encoding="utf-8")
    explored = explore(cases)
    return environment.get_template("bench.html.jinja").render(
        explorer={"points": as_data(explored), "script": script, "hash": script_hash(script)} if explored["cases"] else None,
        studies=tabulate_studies(studies), configurations=tabulate_configurations(cases),
        cases=[_case(case) for case in cases if case["lines"]],
        paper=tabulate_paper(cases), stiff=tabulate_stiff(cases), limits=tabulate_limits(cases), parallel=tabulate_parallel(cases),
        drifts=[_drift(drift, charts) for drift in drifts],
        atlases=[_atlas(atlas, charts) for atlas in atlases],
        situations=tabulate_situations(situations), note=charts.note,
    )  # fmt: skip


def _case(case: Data) -> dict[str, Any]:
    return {
        "name": case["name"], "title": case["title"], "end": case["end"], "reference": _reference(case), "words": describe(case),
        "lines": tabulate_lines(case), "targets": tabulate_targets(case), "choices": describe_choices(case),
        "accuracies": tabulate_accuracies(case), "asked": _draw_asked(case),
    }  # fmt: skip


def _atlas(atlas: Data, charts: Charts) -> dict[str, Any]:
    refused = [f"{name}: {reason}" for name, reason in atlas["refused"].items()]
    tables = {"conditions": tabulate_conditions(atlas), "reasons": tabulate_reasons(atlas)}
    return {"title": atlas["title"], "words": atlas["words"], "chart": charts.atlas(atlas), "refused": refused, **tables}


def _draw_asked(case: Data) -> str:
    """The chart of runs to an accuracy, of those of which some true error is known; empty if there are none."""
    lines = [line for line in asked_lines(case) if any(p["errors"]["outputs"] for p in timed(line))]
    return draw_accuracies(lines) if lines else ""


def _drift(drift: Data, charts: Charts) -> dict[str, Any]:
    kept = {"energy": "the largest kinetic energy", "momentum": "the momentum at the start"}
    words = []
    for name, size in kept.items():
        if drift[name]:
            changes = ", ".join(f"{line['method']} {max(map(abs, line[name])):.1e}" for line in drift["lines"] if line[name])
            words.append(f"Largest change of {name}, relative to {size}: {changes}.")
    words += [f"{line['method']} fails: {line['failure']}." for line in drift["lines"] if line["failure"]]
    return {"name": drift["name"], "dt": f"{1e3 * drift['dt']:g}", "words": words, "chart": charts.drift(drift)}


def _reference(case: Data) -> str:
    reference = case["reference"]
    if reference is None:
        return "There is no reference: errors are unknown."
    made = reference["provenance"]
    if made["precision"] == "exact":
        return "The exact motion is known in closed form."
    words = f"The reference is integrated in {made['precision']} precision by {' and by '.join(made['routes'])}"
    if reference["position_apart"] is not None:
        return (
            f"{words}; the two routes, which share neither formulation nor integrator, are {reference['position_apart']:.1e} m and "
            f"{reference['velocity_apart']:.1e} m/s apart at most{_impact(reference['position_apart'])}."
        )
    reasons = "; ".join(f"{route}: {why}" for route, why in made["left out"].items())
    return f"{words} alone ({reasons or 'the other formulation does not take this model'})."


def _impact(apart: float) -> str:
    """The reason why routes are far apart."""
    if apart > _JUMP:
        return " (where a guide's speed jumps, only the first takes the impact at once)"
    return " (each meets the kinks of a road between steps of its own)" if apart > _KINK else ""


def describe(case: Data) -> list[str]:
    """Findings in the chart of a case, in sentences."""
    lines = [line for line in case["lines"] if "refused" not in line]
    orders = [(line["label"], order(line)) for line in lines if _has_steps(line)]
    known = [f"{label} {value:.2f}" for label, value in orders if not isnan(value)]
    sentences = [f"Orders of convergence in position: {', '.join(known)}."] if known else []
    for target in (1e-3, 1e-5):
        ours, peer = fastest_ours(lines, target), fastest_peer(lines, target)
        if ours:
            sentences.append(f"At an error of {target:.0e} m the fastest generated code is {ours[0]} with {milliseconds(ours[1])} ms.")
        if ours and peer:
            sentences.append(f"The fastest peer there is {peer[0]} with {milliseconds(peer[1])} ms, {peer[1] / ours[1]:.1f} times that.")
    sentences += describe_precisions(lines)
    failed = [
        f"{line['label']}, {describe_setting(line, p)} ({p['failure']})" for line in lines for p in line["points"][:1] if p["failure"]
    ]
    if failed:
        sentences.append(f"With the largest step tried these fail: {'; '.join(failed)}.")
    return sentences


def _has_steps(line: Data) -> bool:
    """True if a line is of generated code with steps of equal length."""
    integrator = line["contender"].partition("/")[2]
    return line["group"] in ("generated", "integrators") and integrator not in names_of(INTEGRATORS, lambda i: i.adaptive)
