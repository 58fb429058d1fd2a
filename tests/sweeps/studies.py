"""Studies that the tests run."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from tests.conftest import MODELS

#: A press: springs and speeds at the start, a fifth of a second; by the rule that has lanes where these pay.
PRESS: Mapping[str, Any] = {
    "cutjoint_study": 1, "model": str(MODELS / "press.yaml"), "end": 0.2,
    "parameters": {"stiffness": {"from": "1 kN/m", "to": "4 kN/m"}},
    "rates": {"pin.angle_rate": {"from": 5, "to": 10}},
    "design": {"sobol": 40, "seed": 3},
    "objectives": {
        "top": {"maximum": "slider.x", "from": 0.1}, "speed": {"rms": "slider.vx"}, "load": {"mean": "abs(spring.force)*stiffness"},
    },
    "trajectories": {"outputs": ["slider.x"], "every": 7}, "integrator": "trapezoidal",
}  # fmt: skip


def study(folder: Path, **changes: Any) -> Path:
    """The file of that study with other sections; None leaves one away."""
    path = folder / "study.yaml"
    path.write_text(yaml.safe_dump({k: v for k, v in {**PRESS, **changes}.items() if v is not None}, sort_keys=False), encoding="utf-8")
    return path
