"""Runs that optimisers without gradients take to what `examples/hardpoints.py` finds with them.

`python -m cutjoint_bench.studies.optimisers`: L-BFGS-B by differences of runs, SciPy's default, and CMA-ES (`pip install cma`), from the
same points within the same bounds, until a cost is within a thousandth of that found, or for `MOST` runs.
"""

from __future__ import annotations

import runpy
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
from scipy.optimize import minimize

from cutjoint_bench.studies.checkout import MODELS

MOST, NEAR, SEEDS = 20_000, 1.001, (1, 2, 3)


class FoundError(Exception):
    """The cost is as low as wanted, or there are no runs left."""


def count(cost: Callable[[Any], float], wanted: float, optimise: Callable[[Callable[[Any], float]], object]) -> tuple[int, float]:
    """The runs that an optimiser takes to a cost, and the least that it comes to."""
    runs, least = 0, np.inf

    def counted(x: Any) -> float:
        nonlocal runs, least
        if least <= wanted or runs == MOST:
            raise FoundError
        runs, found = runs + 1, cost(x)
        least = min(least, found)
        return found

    with suppress(FoundError):
        optimise(counted)
    return runs, least


def main() -> None:
    """Print a row for each optimiser."""
    import cma

    known = runpy.run_path(str(MODELS.parent / "examples" / "hardpoints.py"))
    sim, given, mirror, weights = (known[name] for name in ("sim", "given", "mirror", "WEIGHTS"))
    places = [sim.outputs.place(name) for name in known["OUTPUTS"]]

    def cost(x: Any) -> float:
        sim.parameters.update(zip(known["BY"], given + known["REACH"] * np.vstack([x, x * mirror]).ravel(), strict=True))
        start = sim.reset(dt=1e-3).outputs.array[places]
        rows = np.vstack([start, sim.run(known["STEPS"])[known["EVERY"] - 1 :: known["EVERY"], places]])
        return float((weights * rows**2).sum() / len(rows))

    begin, bounds = known["begin"], [(-1.0, 1.0)] * len(known["begin"])
    wanted = NEAR * cost(known["found"].x)
    print(f"L-BFGS-B with gradients: {known['runs']} runs, {known['last'][0]:.5g}; wanted {wanted:.5g}", flush=True)
    options = {"maxiter": 1000, "maxfun": MOST}
    runs, least = count(cost, wanted, lambda f: minimize(f, begin, method="L-BFGS-B", bounds=bounds, options=options))
    print(f"L-BFGS-B by differences: {runs} runs, {least:.5g}", flush=True)
    for seed in SEEDS:
        settings = {"bounds": [-1.0, 1.0], "seed": seed, "verbose": -9, "maxfevals": MOST}
        runs, least = count(cost, wanted, lambda f, settings=settings: cma.fmin(f, begin, 0.3, settings))  # type: ignore[misc]
        print(f"CMA-ES {cma.__version__}, seed {seed}: {runs} runs, {least:.5g}", flush=True)


if __name__ == "__main__":
    main()
