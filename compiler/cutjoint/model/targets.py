"""Targets of errors by name: an output, or an objective of its samples, as in ``maximum(spring.force)``."""

import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

#: Objectives of the samples of an output.
OBJECTIVES: Mapping[str, Callable[[Any], float]] = {
    "end": lambda y: y[-1], "minimum": np.min, "maximum": np.max, "mean": np.mean, "rms": lambda y: np.sqrt(np.mean(y**2)),
}  # fmt: skip
_OF_OUTPUT = re.compile(r"(\w+)\((.*)\)")


def split_target(name: str) -> tuple[str, str]:
    """The objective of a target, "" for an output as a whole, and the output."""
    found = _OF_OUTPUT.fullmatch(name)
    return (found[1], found[2]) if found else ("", name)
