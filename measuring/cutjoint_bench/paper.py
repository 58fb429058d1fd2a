"""Figures of Cuadrado, Cardenal, Morer, Bayo, Multibody System Dynamics 4 (2000) 55-73, to stand beside ours."""

from __future__ import annotations

from collections.abc import Mapping

#: Seconds of CPU time for 10 s, on an SGI Indigo2 with one R4400 at 200 MHz, and the step in s, by case and method.
PAPER: Mapping[str, Mapping[str, tuple[float, float]]] = {
    "iltis/simul1": {"augmented": (34, 0.0175), "classical": (139, 0.01), "recursive": (20, 0.0075)},
    "iltis/simul2": {"augmented": (18, 0.03), "classical": (58, 0.025), "recursive": (14, 0.0075)},
    "iltis/simul3": {"augmented": (27, 0.025), "classical": (99, 0.01), "recursive": (9, 0.0075)},
    "iltis/simul1s": {"augmented": (78, 0.005), "classical": (435, 0.0025), "recursive": (34, 0.0025)},
}

#: The paper's steps alone.
PAPER_STEPS: Mapping[str, Mapping[str, float]] = {
    case: {method: dt for method, (_, dt) in methods.items()} for case, methods in PAPER.items()
}

#: Table III: the two scenes whose times and steps it sets side by side, with bumpers and without.
PAPER_STIFF = ("iltis/simul1s", "iltis/simul1")

#: Per cent of CPU time saved by 2, 3 and 4 processors.
PAPER_PARALLEL: Mapping[str, tuple[float, float, float]] = {
    "augmented": (22.7, 29.6, 29.6), "classical": (6.5, 9.0, 9.0), "recursive": (0.0, 0.0, 0.0),
}  # fmt: skip
