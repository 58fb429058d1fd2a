"""A drawing as a page: one HTML file that holds all it needs."""

import base64
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from hashlib import sha256
from html import escape
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

from cutjoint.emit.source import environment
from cutjoint.model.expressions.quantities import bodies_of
from cutjoint.model.records import Model, Plot, Vector
from cutjoint.package.locations import licence_of_musl, templates_folder
from cutjoint.run.results import Trajectory
from cutjoint.view import meshes
from cutjoint.view.ghost import GhostRun
from cutjoint.view.graph import Graph
from cutjoint.view.motions import PERIOD, Motion
from cutjoint.view.records import ALARM, Array, Node, Part
from cutjoint.view.sizes import Placed, force_points
from cutjoint.view.sliders import Sliders

#: The page's own script is these files in this order, in one function.
SCRIPTS = (
    "elements", "trouble", "data", "over", "picture", "time", "names", "bodies", "values", "looks", "saving", "failure", "motions", "graph",
    "sliders", "live", "controls",
)  # fmt: skip
#: More files of pages with a simulation that runs, before the last.
DRIVING = ("ground", "keeping", "drive")
#: The number of last rows of a failed run that are played slowly.
LAST_ROWS = 40


@dataclass(frozen=True, kw_only=True)
class PlotColumn:
    """A column of a table over the drawing's times, and the ``bodies`` that it belongs to."""

    name: str
    unit: str
    bodies: Sequence[str]
    values: Array


@dataclass(frozen=True, kw_only=True)
class Drive:
    """A simulation for a page: its ``module`` of WebAssembly, and ``facts`` about its steps and what moves its inputs."""

    module: bytes
    facts: Mapping[str, object]


def make_page(
    *, title: str, scene: str, note: str, bodies: Sequence[str], glb: bytes, t: Array, columns: Sequence[PlotColumn],
    camera: Mapping[str, Any], failure: Mapping[str, Any] | None = None, motions: Sequence[Motion] = (), ghost: GhostRun | None = None,
    graph: Graph | None = None, sliders: Sliders | None = None, is_live: bool = False, plots: Sequence[Plot] = (),
    drive: Drive | None = None,
) -> str:  # fmt: skip
    """The page of a .glb file and the columns of its run; names are data there, whatever they are.  One that is live asks where it comes
    from for poses, one to ``drive`` has its simulation inside.  Named ``plots`` are chosen as columns are."""
    folder = templates_folder() / "view"
    about = {
        "title": title, "scene": scene, "note": note, "bodies": list(bodies), "outlook": camera, "rows": int(t.size),
        "failure": None if failure is None else {**failure, "since": float(t[-min(t.size, LAST_ROWS)])},
        "motions": [{"name": m.name, "facts": list(m.facts)} for m in motions], "period": PERIOD,
        **({"live": True} if is_live else {}), **({"drive": drive.facts} if drive else {}),
        "sliders": None if sliders is None else sliders.facts, "graph": None if graph is None else asdict(graph),
        "over": None if ghost is None else {"name": ghost.name, "rows": int(ghost.t.size), "columns": list(ghost.columns)},
        "plots": [asdict(plot) for plot in plots if {plot.x, *plot.y} <= {"t", *(c.name for c in columns)}],
        "columns": [{"name": c.name, "unit": c.unit, "bodies": list(c.bodies)} for c in columns],
    }  # fmt: skip
    moving = [] if sliders is None or drive else [sliders.script]
    scripts = [(folder / "vendor/libraries.min.js").read_text(encoding="utf-8"), *moving, own_script(driving=drive is not None)]
    data = {"about": as_data(about), "glb": _encoded(glb), "table": as_table(t, [c.values for c in columns])}
    if drive is not None:
        data["module"] = _encoded(drive.module)
    if ghost is not None:
        data |= {"over-glb": _encoded(ghost.glb), "over-table": as_table(ghost.t, [*ghost.columns.values()])}
    return environment().get_template("view/page.html.jinja").render(
        title=escape(f"{title}, {scene}"), is_live=is_live, driving=drive is not None, notice="" if drive is None else licence_of_musl(),
        data=[(name, crc32(text.encode()), text) for name, text in data.items()],
        scripts=scripts, hashes=[script_hash(script) for script in scripts],
        styles=[(folder / name).read_text(encoding="utf-8") for name in ("vendor/uplot.min.css", "page.css")],
    )  # fmt: skip


def own_script(*, driving: bool = False) -> str:
    """The page's own script; one that is ``driving`` has a simulation and its host too."""
    names = (*SCRIPTS[:-1], *DRIVING, SCRIPTS[-1]) if driving else SCRIPTS
    return as_script(*(["wasm/module"] if driving else []), *(f"view/page/{name}" for name in names))


def as_script(*names: str) -> str:
    """Files of templates as one script, in a function of its own."""
    parts = [(templates_folder() / f"{name}.js").read_text(encoding="utf-8") for name in names]
    return "\n".join(["'use strict';", "(() => {", *parts, "})();", ""])


def _encoded(content: bytes) -> str:
    return base64.b64encode(content).decode()


def as_table(t: Array, columns: Sequence[Array]) -> str:
    """Numbers of 32 bits; larger ones are none."""
    numbers = np.concatenate([t, *columns])
    return _encoded(np.where(np.abs(numbers) <= np.finfo("<f4").max, numbers, np.nan).astype("<f4").tobytes())


def as_data(content: Mapping[str, object]) -> str:
    """JSON in which no text can end an HTML element."""
    return re.sub("[<>&\u2028\u2029]", lambda found: f"\\u{ord(found[0]):04x}", json.dumps(content, allow_nan=False))


def script_hash(script: str) -> str:
    """The name of a script in the page's policy: no other one runs (W3C, Content Security Policy Level 3, section 2.3.1)."""
    return f"'sha256-{base64.b64encode(sha256(script.encode()).digest()).decode()}'"


def find_failure(model: Model, run: Trajectory) -> dict[str, Any] | None:
    """The reason and the place of a run's stop; None if it reached its end.

    "row" is the equation or coordinate with the worst residual, of an "element" at "place", a line of the model file; both are "" if the
    row is of no element.  "bodies" are the element's.
    """
    if run.failure is None:
        return None
    bodies, spans = bodies_of(model), {**{f.name: f.span for f in model.force_elements}, **model.constraint_spans}
    row = run.failure.element
    element = max((name for name in spans if row == name or row.startswith(f"{name}.")), key=len, default="")
    place = f"{Path(spans[element].file).name}:{spans[element].line}" if element else ""
    return {
        "text": run.failure.summary, "advice": run.failure.advice, "row": row, "element": element, "place": place,
        "bodies": list(bodies.get(element, ())),
    }  # fmt: skip


def mark(placed: Placed, element: str) -> Iterator[Node]:
    """Balls around the points of an element, none of a name that no element has."""
    radius = 2.2 * placed.sizes.joint
    for body, point in _points(placed.model, element):
        ball = Part(mesh=meshes.sphere(radius), colour=ALARM)
        yield Node(name=f"mark of {element}", parts=(ball,), translation=placed.place(body, point), about={"mark": element})


def _points(model: Model, element: str) -> Iterator[tuple[str, Vector]]:
    joints = {joint.name: (joint.base, joint.at) for joint in model.joints}
    for body in (body for body in model.bodies if body.name == element):
        yield body.name, body.centre_of_mass
    for gear in (gear for gear in model.gears if gear.name == element):
        yield from (joints[name] for name in dict.fromkeys(gear.joints))
    if element in joints:
        yield joints[element]
    for force in (force for force in model.forces if force.name == element):
        yield from force_points(force)
