"""The vectorised environment of `examples/` beside Gymnasium's of MuJoCo: processor time of a step of ten, and of these in the core.

    pip install gymnasium mujoco imageio
    python -m cutjoint_bench.studies.environments

Both are a pole on a cart under a held push, MuJoCo's `InvertedPendulum-v5` by the rule of its file, Runge-Kutta of order 4, and by Euler's,
its default.  They go in turns, and the least time of each counts.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from time import process_time
from typing import Any, cast

import numpy as np

NUMBER, TURNS = 64, 12


def _microseconds(work: Callable[[], object], times: int) -> float:
    begin = process_time()
    for _ in range(times):
        work()
    return (process_time() - begin) / times * 1e6


def main() -> None:
    """Print a line for each rule."""
    sys.path.insert(0, str(Path(__file__).parents[3] / "examples"))
    import gymnasium
    import mujoco
    from cart_pole_env import CartPoles

    ours, push = CartPoles(NUMBER), np.zeros((NUMBER, 1), np.float32)
    sim = ours.simulations[0].copy()
    for rule in (mujoco.mjtIntegrator.mjINT_RK4, mujoco.mjtIntegrator.mjINT_EULER):
        theirs = gymnasium.vector.SyncVectorEnv([partial(gymnasium.make, "InvertedPendulum-v5", frame_skip=10)] * NUMBER)
        models = [cast("Any", each.unwrapped).model for each in theirs.envs]
        for each in models:
            each.opt.integrator = rule
        model = models[0]
        data, rows = mujoco.MjData(model), []
        environments: list[Callable[[], object]] = [partial(envs.step, push) for envs in (ours, theirs)]
        cores: list[Callable[[], object]] = [lambda: sim.advance(sim.time + ours.dt), partial(mujoco.mj_step, model, data, nstep=10)]
        for turn in range(TURNS):
            ours.reset(seed=turn)
            theirs.reset(seed=turn)
            mujoco.mj_resetData(model, data)
            rows.append([*(_microseconds(step, 30) / NUMBER for step in environments), *(_microseconds(steps, 1000) for steps in cores)])
        own, other, core, steps = np.min(rows, axis=0)
        print(f"{rule.name}: environment {own:.1f} us beside {other:.1f}, 1 to {other / own:.1f}", end="; ")
        print(f"core {core:.1f} us beside {steps:.1f}, 1 to {steps / core:.1f}")


if __name__ == "__main__":
    main()
