"""Mechanisms with Coulomb friction in one or several joints: each run comes to its end or stops with a message, by work that has a bound.

They are interpreted, so that nothing is compiled for them.
"""

from __future__ import annotations

import json
import math
import random
from typing import Any

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.elements.joints import JOINTS
from cutjoint.methods import INTEGRATORS, METHODS, Implementation, names_of
from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model_text
from cutjoint.package.errors import EquationsError, RunError
from cutjoint.run.artifact import Artifact, make_simulator_run
from cutjoint.run.settings import Options
from cutjoint.run.simulator import SimulatorError
from cutjoint.run.simulator_run import start
from tests.fuzz import mechanisms

#: Evaluations of a run that is taken for one that stands still; seconds after which a share of the run tells how many all of it takes.
MOST, SECONDS, SHARE = 10**8, 60.0, 0.005
#: By how much looser a tolerance is that shows whether work follows from it.
LOOSER = 100.0


def make(rng: random.Random) -> str:
    """A model file with the settings of a run."""
    model = json.loads(mechanisms.make(rng))
    places = [(name, coordinate) for name, joint in model["joints"].items() for coordinate in JOINTS[joint["kind"]].coordinates]
    for k, (joint, coordinate) in enumerate(rng.sample(places, min(len(places), rng.choice((1, 1, 2, 3))))):
        size = round(10 ** rng.uniform(-2, 1.5), 3)
        law = rng.choice((f"-{size}*sign(rate)", f"where(rate > 0, -{size}, {size})", f"-{size}*sign(rate) - 100*position"))
        force = {"kind": "joint_force", "joint": joint, "coordinate": coordinate, "law": law}
        if rng.random() < 0.4:
            force = {"kind": "joint_friction", "joint": joint, "coordinate": coordinate, "coefficient": round(rng.uniform(0.01, 1), 2)}
            is_turn = JOINTS[model["joints"][joint]["kind"]].units[coordinate] == "rad"
            force |= {"radius": 0.02, "preload": size} if is_turn else {"arm": 0.5, "preload": size}
        model.setdefault("forces", {})[f"coulomb{k}"] = force
    method = rng.choice(tuple(METHODS))
    supports = names_of(INTEGRATORS, lambda i: i.supports(METHODS[method], Implementation.INTERPRETED))
    events = rng.choice((None, "located", "crossed")) if METHODS[method].events else None
    settings = {"integrator": rng.choice(supports), "events": events, "end": rng.choice((0.1, 0.3, 1.0))}
    return json.dumps({"model": model, "method": method, "settings": settings}, indent=1)


def check(text: str) -> tuple[str, ...]:
    """The reason why a run stopped, if it did; fails where it neither does nor comes to its end."""
    case: dict[str, Any] = json.loads(text)
    model = read_model_text(json.dumps(case["model"]), "fuzzed.yaml")
    try:
        artifact = compile_interpreted(model, model.scenes["run"], method=case["method"])
        plan = make_simulator_run(artifact, Options(**case["settings"]))
    except (EquationsError, ModelError, RunError) as error:
        return tuple(str(error).splitlines())
    try:
        run = start(plan, seconds=SECONDS)
    except SimulatorError:
        return _try_share(artifact, case)
    assert run.evaluations <= MOST, f"{run.evaluations} evaluations"
    if run.failure is None:
        return ()
    assert run.failure.message
    assert run.failure.advice
    return (f"{case['method']}: {run.failure.message}",)


def _try_share(artifact: Artifact, case: dict[str, Any]) -> tuple[str, ...]:
    """A run that goes on slowly; fails where the beginning of the run takes more than its share of the work.

    A step that crosses a jump of a force errs by its length times the jump, so a sliding law on a light body takes steps in proportion to
    the tolerance.  Such a run is no stand: a looser tolerance takes as much less work.
    """
    settings = {**case["settings"], "end": SHARE * case["settings"]["end"]}
    plan = make_simulator_run(artifact, Options(**settings))
    try:
        run = start(plan, seconds=SECONDS)
        if run.evaluations > SHARE * MOST and INTEGRATORS[plan.run_file.settings.integrator].adaptive:
            looser = Options(**settings, tolerance=LOOSER * plan.run_file.settings.tolerance)
            fewer = start(make_simulator_run(artifact, looser), seconds=SECONDS).evaluations
            assert fewer <= run.evaluations / math.sqrt(LOOSER), f"{run.evaluations} evaluations of {SHARE:g} of the run, {fewer} looser"
            return (f"{case['method']}: as slow as its tolerance asks",)
    except SimulatorError as error:
        raise AssertionError(f"{case['method']}, {case['settings']}: stands still silently") from error
    assert run.evaluations <= SHARE * MOST, f"{run.evaluations} evaluations of {SHARE:g} of the run"
    return (f"{case['method']}: goes on, but slowly",)
