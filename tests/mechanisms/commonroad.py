"""The multi-body vehicle of CommonRoad: its model file, and rates of its states that the package of PyPI has computed.

`python -m tests.mechanisms.commonroad` writes the numbers anew, where commonroad-vehicle-models 3.0.2 is installed.
"""

from __future__ import annotations

import csv
import math
import random
from pathlib import Path

from tests.conftest import ROOT

MODEL = ROOT / "tests" / "data" / "commonroad_multibody.yaml"
NUMBERS = MODEL.with_suffix(".csv")

_AXLE = ("roll", "roll_rate", "drift", "sink", "sink_rate")
_WHEELS = [f"{axle}.{side}.spin" for axle in ("front", "rear") for side in ("left", "right")]
#: The states in the order of the package.
STATES = (
    "east", "north", "delta", "u", "psi", "r", "phi", "p", "theta", "q", "v", "sink", "w",
    *(f"{axle}.{name}" for axle in ("front", "rear") for name in _AXLE), *_WHEELS, "front.pinned", "rear.pinned",
)  # fmt: skip
INPUTS = ("steer_rate", "acceleration")

#: The state of the package's own test of derivatives, and its input.
OWN = (
    10.8808433066274794, 0.5371850187869442, 0.0980442671005920, 18.0711398687457745, 0.1649995631003776, 0.6158755000936103,
    -0.1198403612262477, -0.2762672756169581, 0.0131909920269115, -0.0718483683742141, -0.3428324595054725, 0.0103233373083297,
    -0.0399590564140291, -0.0246468320579360, -0.0551575051990853, 0.5798277643297529, 0.0172059354801703, 0.0067890113155477,
    -0.0184269459410162, -0.0408207136116175, -1.0064484829203018, 0.0166808347900582, -0.0049188492004049, 53.6551710641082451,
    50.7045242506744316, 56.7917911784219598, 200.7079633169796296, -0.0939969123691911, -0.0881514621614376,
)  # fmt: skip
OWN_INPUT = (0.15, 0.63 * 9.81)
#: Half of the range of a state around its middle, the others being about zero.
_RANGES = (50, 50, 0.4, 0, 3, 0.8, 0.1, 0.4, 0.03, 0.2, 1, 0.02, 0.2, *(2 * (0.05, 0.2, 1, 0.006, 0.1)), *(4 * (6,)), 0.1, 0.1)
_MIDDLES = {"front.sink": 0.02, "rear.sink": 0.02}


def draw(number: int) -> tuple[list[float], list[float]]:
    """A state and an input by chance; of each five one is slow, and one has a wheel that turns backwards."""
    chance = random.Random(number)
    state = [chance.uniform(-1, 1) * half + _MIDDLES.get(name, 0.0) for name, half in zip(STATES, _RANGES, strict=True)]
    state[3] = chance.uniform(-0.09, 0.09) if number % 5 == 0 else chance.uniform(5, 40)
    for place in map(STATES.index, _WHEELS):
        state[place] += state[3] / 0.344
    if number % 5 == 1:
        state[STATES.index(_WHEELS[number % 4])] = -chance.uniform(0, 2)
    if number % 7 == 0:
        state[2] = math.copysign(1.1, state[2])
    return state, [chance.uniform(-0.6, 0.6), chance.uniform(-14, 14)]


def write_numbers(path: Path = NUMBERS) -> None:
    """Write states, inputs and rates as the package computes them."""
    from vehiclemodels.parameters_vehicle2 import parameters_vehicle2
    from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb

    cases = [(list(OWN), list(OWN_INPUT)), *map(draw, range(20))]
    with path.open("w", newline="") as stream:
        stream.write("# commonroad-vehicle-models 3.0.2, vehicle 2: python -m tests.mechanisms.commonroad\n")
        table = csv.writer(stream, lineterminator="\n")
        table.writerow((*STATES, *INPUTS, *(f"{name}'" for name in STATES)))
        for state, given in cases:
            rates = vehicle_dynamics_mb(list(state), list(given), parameters_vehicle2())
            table.writerow(map(repr, (*state, *given, *map(float, rates))))


if __name__ == "__main__":
    write_numbers()
