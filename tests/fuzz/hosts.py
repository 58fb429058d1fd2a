"""Random calls of a host on a mechanism with a guided input: none leaves a trace beyond what it should.

Another simulation, which gets the same calls from a snapshot or a fresh start, has the same bits.  Guides go along the parabolas that the
documentation promises, which are drawn here anew, and loops stay closed all the while.
"""

from __future__ import annotations

import json
import random
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import cutjoint
from cutjoint.stepping.simulation import Simulation
from tests.mechanisms.steered import steered_text

#: Ways of taking steps, with settings of the scene, and whether a controller takes samples, at which steps are split.
WAYS = (
    ("recursive", "", False), ("recursive", ", closure: proximal", False), ("recursive-newton", "", False),
    ("recursive", ", closure: proximal", True), ("recursive-newton", "", True),
)  # fmt: skip
CONTROLLER = """
controllers:
  damp:
    every: 3 ms
    offset: 1 ms
    delay: 6 ms
    signals: {u: -20*cart.vy - 0.1*cart.ay - 2*m}
    memory: {m: {start: 0, next: 0.9*m + 1*cart.y}}
outputs: [damp.u, damp.m, """
DT = 1e-3
#: The largest distance of a guide from its course, m, and the largest gap of loops.
_TRAJECTORY, _GAP = 1e-9, 1e-4
#: The largest movement of the rack, m: beyond, jumps are made at once, off the course.
_FURTHEST = 0.05


@cache
def _simulation(way: int, number: int) -> Simulation:
    """One of two simulations of the steered rack, to which all calls go."""
    method, more, is_sampled = WAYS[way]
    with TemporaryDirectory() as folder:
        path = Path(folder) / "steered.yaml"
        text = steered_text(more)
        if is_sampled:
            text = text.replace("- 3*rate", "- 3*rate + damp.u").replace("\noutputs: [", CONTROLLER)
        path.write_text(text)
        return cutjoint.load(path, scene="free", method=method) if number == 0 else _simulation(way, 0).copy()


def make(rng: random.Random) -> str:
    """A way, and calls as JSON."""
    way = rng.randrange(len(WAYS))
    _simulation(way, 0)
    place, slope, calls = 0.0, 0.0, list[list[Any]]()
    for _ in range(rng.randrange(5, 40)):
        kind = rng.choice(("hold", "hold", "hold", "hold", "jump", "rate", "push", "look", "save", "restore", "reset", "again"))
        if kind == "hold":
            slope = rng.choice((slope, slope, 0.0, rng.uniform(-0.1, 0.1)))
            place = min(max(place + slope * DT, -_FURTHEST), _FURTHEST)
            calls.append(["hold", place, rng.choice((1, 1, 1, 2, 3, 7, 2.5, 0.5))])
        elif kind == "jump":
            place = rng.uniform(-_FURTHEST, _FURTHEST)
            calls.append(["hold", place, rng.choice((1, 4))])
        elif kind == "rate":
            place = rng.uniform(-_FURTHEST / 2, _FURTHEST / 2)
            calls.append(["rate", place, rng.uniform(-0.2, 0.2), rng.choice((0.0, rng.uniform(-5, 5))), rng.choice((1, 1, 5, 20))])
        else:
            calls.append([kind, rng.uniform(-20, 20)] if kind == "push" else [kind])
    return json.dumps([way, calls])


class Trajectory:
    """The course of a guide by docs/how-to/embed-in-c.md for a host that holds values: pieces of parabolas over whole calls of one step."""

    def __init__(self, place: float) -> None:
        self.place, self.rate, self.held, self.last = place, 0.0, place, 0.0

    def step(self, held: float) -> None:
        """A call of one step with a held value."""
        last = (held - self.held) / DT
        slope = 0.0 if last * self.last <= 0 else min(last, self.last, key=abs)
        middle = (held + slope * DT / 2 - self.place - self.rate * DT / 2) / DT
        self.place += DT * (self.rate + middle) / 2
        self.rate, self.held, self.last = middle, held, last


def check(text: str) -> tuple[str, ...]:
    """Nothing is refused; fails where bits differ from those of another simulation, a guide leaves its course, or a loop opens."""
    way, calls = json.loads(text)
    sim, other = _simulation(way, 0), _simulation(way, 1)
    _start(sim, 0.0, 0.0, by=1)
    saved, given = sim.snapshot(), (0.0, 0.0)
    trajectory: Trajectory | None = Trajectory(0.0)
    saved_with = (_copy(trajectory), given)
    for call in calls:
        kind, *numbers = call
        if kind == "push":
            sim.inputs["push"] = numbers[0]
            given = (given[0], numbers[0])
        elif kind in ("hold", "rate"):
            given = (numbers[0], given[1])
            trajectory = _go(sim, other, kind, numbers, trajectory)
        elif kind == "look":
            _ = (sim.constraint_violation, sim.get_input("rack"), sim.constraint_jacobian, sim.outputs.array.copy())
        elif kind == "save":
            saved, saved_with = sim.snapshot(), (_copy(trajectory), given)
        elif kind == "restore":
            sim.restore(saved)
            trajectory, given = _copy(saved_with[0]), saved_with[1]
        else:
            sim.reset()
            given = (float(sim.inputs["rack"]), float(sim.inputs["push"]))
            _start(other, *given, by=2)
            _require_same(sim, other, "a reset beside one that has the same values")
            trajectory = Trajectory(given[0])
    return ()


def _start(sim: Simulation, rack: float, push: float, *, by: int) -> None:
    """Start with values that are held; ``by`` is how often, since a first start forgets what was given before it."""
    for _ in range(by):
        sim.set_input("rack", rack)
        sim.set_input("push", push)
        sim.reset(dt=DT)


def _go(sim: Simulation, other: Simulation, kind: str, numbers: list[float], trajectory: Trajectory | None) -> Trajectory | None:
    """Go on by one call, beside another simulation from a snapshot; returns the course, if it is known further on."""
    other.restore(sim.snapshot())
    *given, steps = numbers
    for each in (sim, other):
        each.set_input("rack", *given)
        each.set_input("rack", *given)  # again changes nothing
        if steps == 1:
            each.step()
        else:
            each.advance(each.time + steps * DT)
    _require_same(sim, other, f"{kind} {numbers} beside the same from a snapshot")
    gap, equation = sim.constraint_violation
    assert gap < _GAP, f"{kind} {numbers}: '{equation}' stands open by {gap:.3g}"
    if kind != "hold" or steps != 1 or trajectory is None:
        return None
    trajectory.step(given[0])
    place = sim.outputs["rail.displacement"]
    assert abs(place - trajectory.place) < _TRAJECTORY, f"the guide is at {place}, not at {trajectory.place}"
    return trajectory


def _require_same(sim: Simulation, other: Simulation, what: str) -> None:
    assert np.array_equal(sim.outputs.array, other.outputs.array), f"{what}: {sim.outputs.array - other.outputs.array}"
    assert np.array_equal(sim.coordinates.array, other.coordinates.array), what


def _copy(trajectory: Trajectory | None) -> Trajectory | None:
    if trajectory is None:
        return None
    other = Trajectory(trajectory.place)
    other.rate, other.held, other.last = trajectory.rate, trajectory.held, trajectory.last
    return other
