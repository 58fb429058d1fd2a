"""The pole on a cart as a vectorised environment of Gymnasium, and a law that balances all of its poles.

    pip install gymnasium
    python examples/cart_pole_env.py
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

import cutjoint


class CartPoles(VectorEnv):
    """Independent carts with poles, compiled once.

    An observation is the cart's place and speed (m, m/s) and the pole's angle and rate (rad, rad/s); an action is the push (N), held for
    ``dt`` (s).  An episode ends where the pole leans by 0.5 rad or the cart is 2.4 m off, and is cut after ``most`` steps.  The reward is 1
    for each step.  The step after an end starts anew.
    """

    metadata: ClassVar = {"autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(self, num_envs: int, dt: float = 0.02, most: int = 500) -> None:
        self.num_envs, self.dt, self.most = num_envs, dt, most
        self.single_observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (4,), np.float64)
        self.single_action_space = gymnasium.spaces.Box(-10.0, 10.0, (1,), np.float64)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        first = cutjoint.load(Path(__file__).with_name("cart_pole.yaml")).reset(dt=dt / 10)
        self.simulations = [first, *(first.copy() for _ in range(num_envs - 1))]
        self.pushes = [sim.inputs.array for sim in self.simulations]  # views of the simulations' memory
        self.motions = [view for sim in self.simulations for view in (sim.coordinates.array, sim.speeds.array)]
        self.steps = np.zeros(num_envs, int)
        self.ended = np.zeros(num_envs, bool)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, dict[str, Any]]:
        super().reset(seed=seed)
        for i in range(self.num_envs):
            self._start(i)
        return self._observe(), {}

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        fresh = self.ended
        for i, (sim, push) in enumerate(zip(self.simulations, actions[:, 0], strict=True)):
            if fresh[i]:
                self._start(i)
                continue
            self.pushes[i][0] = push
            self.steps[i] += 1
            sim.advance(self.steps[i] * self.dt)
        seen = self._observe()
        fallen = (abs(seen[:, 0]) > 2.4) | (abs(seen[:, 2]) > 0.5)
        cut = self.steps >= self.most
        self.ended = fallen | cut
        return seen, np.where(fresh, 0.0, 1.0), fallen, cut, {}

    def _start(self, i: int) -> None:
        """Near the upright pose at rest."""
        sim = self.simulations[i]
        sim.set_state(0.0, self.np_random.uniform(-0.1, 0.1, len(sim.coordinates)), np.zeros(len(sim.speeds)))
        self.steps[i] = 0

    def _observe(self) -> np.ndarray:
        """Of each simulation the coordinates ``rail.displacement`` and ``pin.angle``, then their rates, in the order of an observation."""
        return np.concatenate(self.motions).reshape(-1, 4)[:, [0, 2, 1, 3]]


if __name__ == "__main__":
    envs = CartPoles(16)
    seen, _ = envs.reset(seed=1)
    gain = np.array([3.0, 5.0, 45.0, 12.0])
    for _ in range(300):
        seen, rewards, fallen, cut, _ = envs.step(np.clip(seen @ gain, -10.0, 10.0)[:, None])
    print(f"{np.sum(envs.steps == 300)} of {envs.num_envs} poles stand after 6 s, the worst at {abs(seen[:, 2]).max():.1e} rad")
