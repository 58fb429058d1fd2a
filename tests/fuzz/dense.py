"""Small mechanisms with joints, cuts, gears and forces of all kinds: their interpreted blocks agree with the dense oracle."""

from __future__ import annotations

import json
import random
from collections.abc import Callable, Mapping
from typing import Any

from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.topology.build import build_topology
from tests.formulate.test_against_dense import PARAMETERS, ROTOR, SCENE, compare_at
from tests.mechanisms import random_models
from tests.mechanisms.random_models import CLOSINGS, CUT_KINDS, TREE_KINDS, with_ball_springs, with_contacts, with_gears
from tests.oracles.evaluation import both
from tests.oracles.tyre import Flat

#: States that are tried of a mechanism.
STATES = 4


def _rotor(seed: int) -> Model:
    """A wheel that turns on an arm, about its axis of symmetry, beside it, or about another axis, and slips on a road with camber."""
    rng = random.Random(seed)
    axes = [", ".join(str(round(rng.uniform(-1, 1), 2)) for _ in "xyz") if rng.random() < 0.1 else "0, 1, 0" for _ in "ab"]
    slipping = ROTOR.replace("force: [0, 0, 0]", 'force: ["-2*vx - spin", "-vy - 5*camber", "9*deflection - loaded_radius"]')
    return read_model_text(slipping % (round(rng.choice((0, 0, 0, 0.2)), 2), *axes), "rotor.yaml")


_FAMILIES: Mapping[str, Callable[[int], Model]] = {
    "tree_with": lambda seed: random_models.tree_with(TREE_KINDS[seed % len(TREE_KINDS)], seed % 2 == 1, seed),
    "loop_with": lambda seed: random_models.loop_with(CUT_KINDS[seed % len(CUT_KINDS)], CLOSINGS[seed // 20 % len(CLOSINGS)], seed),
    "tree": random_models.random_tree, "loops": random_models.random_loops, "hub": random_models.around_hub,
    "chosen": random_models.chosen_loops, "floating": random_models.floating_loops, "rotor": _rotor,
    "geared": lambda seed: with_gears(random_models.random_tree(seed), seed, bent=seed % 2 == 1),
    "contacts": lambda seed: with_contacts(random_models.random_tree(seed), seed),
    "springs": lambda seed: with_ball_springs(random_models.random_loops(seed), seed),
}  # fmt: skip


def make(rng: random.Random) -> str:
    """A family and a seed, as JSON."""
    return json.dumps({"family": rng.choice(sorted(_FAMILIES)), "seed": rng.randrange(1_000_000)})


def check(text: str) -> tuple[str, ...]:
    """Nothing; fails where accelerations, residuals or steps that close loops are others."""
    case: dict[str, Any] = json.loads(text)
    model = _FAMILIES[case["family"]](case["seed"])
    roads = {force.name: Flat() for force in model.forces if force.has_road}
    blocks, dense = both(build_topology(model), SCENE, parameters=PARAMETERS, roads=roads)
    for i in range(STATES):
        compare_at(blocks, dense, case["seed"] + i, motion=float(i % 4 > 0))
    return ()
