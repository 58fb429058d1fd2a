"""The press in JAX: the trajectory of the slider by a spring's rate and a hardpoint, with exact derivatives, under jit."""

from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp

import cutjoint

MODEL = Path(__file__).resolve().parents[1] / "models" / "press.yaml"
BY, STEPS, ROWS = ["stiffness", "A.z"], 400, 41

jax.config.update("jax_enable_x64", True)
sim = cutjoint.load(MODEL, integrator="rk4", linearise=True, tunable=["A.z"])
numbers = partial(jax.ShapeDtypeStruct, dtype=jnp.float64)


def run(x):
    """The slider's places (41) and their derivatives by BY (41, 2)."""
    sim.parameters.update(zip(BY, x.tolist(), strict=True))
    sim.reset(dt=1e-3).choose_independent(["pin.angle_rate"])
    trajectory = sim.forward_sensitivities(STEPS, ["slider.x"], BY, every=10)
    return trajectory.values[:, 0], trajectory.derivatives[:, 0]


@jax.custom_vjp
def trajectory(x):
    return forward(x)[0]


def forward(x):
    return jax.pure_callback(run, (numbers((ROWS,)), numbers((ROWS, 2))), x, vmap_method="sequential")


trajectory.defvjp(forward, lambda derivatives, weights: (weights @ derivatives,))

if __name__ == "__main__":
    slope = jax.jit(jax.grad(lambda x: jnp.mean(trajectory(x) ** 2)))(jnp.array([2000.0, 0.1]))
    print(f"the mean square of the slider's place changes by {slope[0]:.4g} m^2 per N/m and {slope[1]:.4g} m per m")
