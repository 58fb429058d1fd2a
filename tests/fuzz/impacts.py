"""Mechanisms whose guide begins to move, or turns, at once: by every method they move as behind guides that take ever less time for it.

They are interpreted, so that nothing is compiled for them, but for a host of half of them, whose rows are those of a run.
"""

from __future__ import annotations

import json
import random
from collections.abc import Iterator
from typing import Any

import numpy as np

from cutjoint.analysis.inertia import NoInertiaError
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.package.errors import RunError
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from cutjoint.stepping.handle import SimulationError
from cutjoint.stepping.load import load_scene
from cutjoint.stepping.simulation import Simulation

from . import mechanisms
from .drivers import build_interpreters

Node = dict[str, Any]

#: The duration of the smooth guides' movement (s); its difference from a jump falls with the square.
LONG = 2e-3
#: By how much a run with steps of 1 ms, or a tolerance of 1e-8, may differ from the smooth guides' limit, m.
ALLOWED = 1e-4
#: The equal steps of runs, s.
STEP = 1e-3
#: By how much rows of a host may differ from those of a run by the same rule, m: rounding, and tolerances where steps follow from these.
NEAR = 1e-5
#: The most that is believed of the limit, m.  The least work of an impact that is looked for: J, or a share of the kinetic energy, since
#: steps of 1 ms have such an error of it.
UNCERTAIN, LEAST = 2e-5, 1e-6

_EXACT = {"tolerance": 1e-8}
_CROSSED, _LOCATED = ({"integrator": "trapezoidal", "events": events} for events in ("crossed", "located"))
_DAMPED = {"integrator": "generalised-alpha", "events": "crossed"}
_INTEGRATORS: Node = {
    "recursive": ({"integrator": "dormand-prince", **_EXACT}, {"integrator": "rk4"}, _CROSSED, _LOCATED),
    "recursive-newton": ({"integrator": "radau5-fixed"}, {"integrator": "radau5", **_EXACT}, _CROSSED, _LOCATED, _DAMPED),
    "augmented": ({},),
    "classical": ({},),
}
#: Methods of hosts, with numbers of integrators above.
_HOSTS = (
    ("recursive", 0), ("recursive", 1), ("recursive", 2), ("recursive-newton", 0), ("recursive-newton", 1), ("recursive-newton", 2),
    ("augmented", 0),
)  # fmt: skip


def make(rng: random.Random) -> str:
    """A model, the joint that is guided, when (s) its rate jumps from one to another (1/s or m/s), and how a host goes on."""
    build_interpreters()
    model: Node = {
        "cutjoint": 1, "name": "fuzzed", "gravity": [0, 0, -9.81], "points": {}, "bodies": {}, "joints": {}, "forces": {}, "outputs": [],
        "scenes": {"run": {"end": 0.3, "output_step": 0.02, "numerics": {"dt": STEP}}},
    }  # fmt: skip
    rng.choice((mechanisms.ring, mechanisms.spatial_four_bar, mechanisms.six_bar, mechanisms.tree))(model, rng)
    guidable = [name for name, joint in model["joints"].items() if joint["kind"] in ("revolute", "prismatic", "screw")]
    guided = rng.choice(guidable) if guidable else ""
    model["forces"] = {name: force for name, force in model["forces"].items() if force.get("joint") != guided}
    model["scenes"]["run"].pop("rates", None)
    model = {name: part for name, part in model.items() if part or name == "outputs"}
    at, before = rng.choice((0.1, round(rng.uniform(0.05, 0.15), 5))), rng.choice((0, round(rng.uniform(-1, 1), 3)))
    case = {"model": model, "guided": guided, "at": at, "before": before, "after": round(rng.uniform(-2, 2), 3)}
    case["host"] = rng.choice(_HOSTS) if rng.random() < 0.5 else None
    return json.dumps(case, indent=1)


def check(text: str) -> tuple[str, ...]:
    """Reasons why a case could not be compared; fails where a run is far from the limit of the smooth guides."""
    case = json.loads(text)
    if not case["guided"]:
        return ("nothing can be guided",)
    try:
        smooth = [_run(case, length, integrator="dormand-prince", tolerance=1e-10, error=False) for length in (LONG, LONG / 2)]
    except (ModelError, NoInertiaError, RunError) as error:
        return (str(error).splitlines()[0],)
    if failed := [run.failure for run in smooth if run.failure is not None]:
        return (f"no limit: {failed[0].message}",)
    late = smooth[0].t > case["at"] + LONG
    early = smooth[0].t < case["at"] - LONG
    limit = {name: (4 * smooth[1][name] - smooth[0][name]) / 3 for name in smooth[0].columns}
    doubt = max(float(np.abs(limit[name] - smooth[1][name])[early | late].max()) for name in limit)
    if doubt > UNCERTAIN:
        return (f"no limit: smooth guides differ by {doubt:.1e} m",)
    return (*_compare(case, limit, early | late), *_compare_host(case))


def _compare(case: Node, limit: dict[str, Any], rows: Any) -> Iterator[str]:
    """Failures of runs; all other runs are near the limit, and agree on the work."""
    works, energy = {}, 0.0
    for method, ways in _INTEGRATORS.items():
        for how in ways:
            words = f"{method} {' '.join(str(x) for x in how.values())}"
            try:
                run = _run(case, 0.0, method=method, **how)
            except RunError as error:
                yield f"{words}: {str(error).splitlines()[0]}"
                continue
            if run.failure is not None:
                yield f"{words}: {run.failure.message}"
                continue
            apart = max(float(np.abs(run[name] - limit[name])[rows].max()) for name in limit)
            reported = max(run.error.max_error.values())
            assert apart <= max(ALLOWED, 3 * reported), f"{words} is {apart:.1e} m off and says {reported:.1e}"
            assert run.energy is not None
            energy = max(energy, run.energy.kinetic)
            is_fine = reported <= ALLOWED  # steps that say they are too long for the motion are too long for its balance
            if run.energy.share > 0.02 and is_fine:
                # a guide that leaves no freedom has a motion without error, and power whose peaks equal steps go over
                defect = f"{words}: work and energy differ by {run.energy.defect:.1e} J"
                assert "tolerance" not in how, defect
                finer = _run(case, 0.0, method=method, dt=STEP / 4, **how)
                assert finer.energy is not None, defect
                assert finer.energy.defect < run.energy.defect / 4, f"{defect}, and by {finer.energy.defect:.1e} J in shorter steps"
                run = finer
            works[words] = sum(impact.work for impact in run.statistics.impacts)
    if works and max(works.values()) - min(works.values()) > max(1e-2 * max(abs(x) for x in works.values()), LEAST * max(1.0, energy)):
        raise AssertionError(f"works differ: {works}")


def _compare_host(case: Node) -> Iterator[str]:
    """Failures; a compiled simulation has the rows of a run by its rule."""
    if not case.get("host"):
        return
    method, number = case["host"]
    how = _INTEGRATORS[method][number]
    integrator = how.get("integrator", "trapezoidal")
    read = _model(case, 0.0)
    try:
        run = _run(case, 0.0, method=method, error=False, **how)
        sim = load_scene(read, read.scenes["run"], method=method, integrator=integrator).reset(tolerance=how.get("tolerance"))
        rows = [_row(sim, float(t)) for t in run.t]
    except (RunError, SimulationError) as error:
        yield f"host of {method} {integrator}: {str(error).splitlines()[0]}"
        return
    if run.failure is not None:
        yield f"host of {method} {integrator}: {run.failure.message}"
        return
    apart = max(float(np.abs(run[name] - [row[i] for row in rows]).max()) for i, name in enumerate(run.columns))
    assert apart <= NEAR, f"a host of {method} {integrator} is {apart:.1e} m from a run"


def _row(sim: Simulation, t: float) -> Any:
    sim.advance(t)
    return sim.outputs.array.copy()


def _run(case: Node, length: float, *, method: str = "recursive", **how: Any) -> Trajectory:
    read = _model(case, length)
    return simulate(compile_interpreted(read, read.scenes["run"], method=method), check=False, **how)


def _model(case: Node, length: float) -> Model:
    """The model whose guide goes over from one rate to another within a length of time."""
    model = json.loads(json.dumps(case["model"]))
    model["joints"][case["guided"]]["guide"] = law_of(case["at"], case["before"], case["after"], length)
    return read_model_text(json.dumps(model), "fuzzed.yaml")


def law_of(at: float, before: float, after: float, length: float) -> str:
    """A guide whose rate goes over from one to another within a length of time around an instant, or at once."""
    sooner, later = f"{before!r}*(t - {at!r})", f"{after!r}*(t - {at!r})"
    if length == 0:
        return f"where(t < {at!r}, {sooner}, {later})"
    begin, end, half = at - length / 2, at + length / 2, length / 2
    middle = f"{before!r}*(t - {at!r}) + ({after!r} - {before!r})*(t - {at!r} + {half!r})**2/{2 * length!r}"
    return f"where(t < {begin!r}, {sooner}, where(t < {end!r}, {middle}, {later}))"
