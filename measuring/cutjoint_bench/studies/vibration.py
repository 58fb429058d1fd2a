"""Random vibration of a half car on a road of class C beside 100 simulations over time, with the wheelbase's delay.

    .venv/bin/python -m cutjoint_bench.studies.vibration [--runs 100] [--seconds 60] [--dt 0.25e-3]

Each run has a road of its own: 4000 harmonics of the class's spectrum within its band, with normally distributed coefficients.  A root mean
square lies within the runs' 95 % interval if it differs from their mean by less than 1.98 standard errors.
"""

import argparse
from collections.abc import Iterator
from math import pi, sqrt
from time import process_time

import numpy as np

import cutjoint

#: ISO 8608: roughness of class C at 0.1 cycles/m (m^3), its band (cycles/m); the car's speed (m/s) and axles (m).
ROUGHNESS, REFERENCE, BAND = 256e-6, 0.1, (0.011, 2.83)
SPEED, FRONT, REAR = 20.0, 1.2, -1.4
HARMONICS = 4000
AXLE = """
  {name}_pad: {{massless: true}}
  {name}_hub: {{mass: 40, centre_of_mass: [{x}, 0, 0.3]}}"""
JOINTS = """
  {name}_lift: {{kind: prismatic, bodies: [ground, {name}_pad], at: [{x}, 0, 0], axis: z, guide: {name}_post}}
  {name}_travel: {{kind: prismatic, bodies: [ground, {name}_hub], at: [{x}, 0, 0.3], axis: z}}"""
FORCES = """
  {name}_tyre: {{kind: axial_force, bodies: [{name}_pad, {name}_hub], origin: [{x}, 0, 0], point: [{x}, 0, 0.3], axis: z,
    law: "2.0e+5*(0.3 - travel)"}}
  {name}_strut: {{kind: axial_force, bodies: [{name}_hub, body], origin: [{x}, 0, 0.3], point: [{x}, 0, 0.8], axis: z,
    law: "2.0e+4*(0.5 - travel) - 1500*rate"}}"""
OUTPUTS = ("body.az", "front_tyre.force", "rear_tyre.force", "front_strut.travel")


def _both(text: str) -> str:
    return "".join(text.format(name=name, x=x) for name, x in (("front", FRONT), ("rear", REAR)))


def half_car() -> str:
    """A body that heaves and pitches on two axles, each on a post."""
    posts = "".join(f"\n  {name}_post: {{value: 0, unit: m, binding: input}}" for name in ("front", "rear"))
    body = "\n  sledge: {massless: true}\n  body: {mass: 600, centre_of_mass: [0, 0, 0.8], inertia: [500, 500, 500]}"
    heave = "\n  heave: {kind: prismatic, bodies: [ground, sledge], at: [0, 0, 0.8], axis: z}"
    pitch = "\n  pitch: {kind: revolute, bodies: [sledge, body], at: [0, 0, 0.8], axis: [0, 1, 0]}"
    return (
        f"cutjoint: 1\nname: half_car\ngravity: [0, 0, 0]\nparameters:{posts}\n"
        f"bodies:{_both(AXLE)}{body}\njoints:{_both(JOINTS)}{heave}{pitch}\n"
        f"forces:{_both(FORCES)}\noutputs: [{', '.join(OUTPUTS)}]\nscenes: {{stand: {{end: 1}}}}\n"
    )


def roads(runs: int, t: np.ndarray) -> Iterator[np.ndarray]:
    """Heights (2, times) under the front and the rear axle, of each run."""
    random = np.random.default_rng(1)
    edges = np.linspace(*BAND, HARMONICS + 1)
    n, width = (edges[1:] + edges[:-1]) / 2, np.diff(edges)
    deviation = np.sqrt(ROUGHNESS * (n / REFERENCE) ** -2.0 * width)
    # times are equally spaced: each harmonic turns by a constant angle, and blocks of times follow from the first
    block = 1000
    turn = np.exp(2j * pi * SPEED * np.outer(n, t[:block]))
    for _ in range(runs):
        heights = np.empty((2, t.size))
        coefficients = deviation * (random.standard_normal(n.size) + 1j * random.standard_normal(n.size))
        for axle, x in enumerate((FRONT, REAR)):
            starts = coefficients * np.exp(2j * pi * np.outer(SPEED * t[::block] + x, n))
            heights[axle] = (starts @ turn).real.ravel()[: t.size]
        yield heights


def main() -> None:
    """Print root mean squares, those of the runs with their standard errors, and the CPU time of both."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--dt", type=float, default=0.25e-3)
    asked = parser.parse_args()
    model = cutjoint.read_model_text(half_car(), "half_car.yaml")
    begin = process_time()
    near = cutjoint.find_linear_model(model)
    assert isinstance(near, cutjoint.StateSpace)
    found = cutjoint.random_vibration(near, road="C", speed=SPEED)
    spent = process_time() - begin
    simulation = cutjoint.load(model, integrator="trapezoidal")
    steps, settling = round(asked.seconds / asked.dt), round(5.0 / asked.dt)
    t = asked.dt * np.arange(steps + settling)
    squares = np.empty((asked.runs, len(OUTPUTS)))
    begin = process_time()
    simulation.reset(dt=asked.dt)
    start = simulation.snapshot()
    for run, (front, rear) in enumerate(roads(asked.runs, t)):
        inputs = {"front_post": front[None], "rear_post": rear[None]}
        rows = cutjoint.rollout(simulation, t.size, inputs=inputs, snapshots=[start], threads=1)
        squares[run] = np.var(rows[0, settling:], axis=0)
    by_runs = process_time() - begin
    for i, name in enumerate(OUTPUTS):
        mean, error = squares[:, i].mean(), squares[:, i].std(ddof=1) / sqrt(asked.runs)
        rms = found.rms[list(found.outputs).index(name)]
        away = (rms**2 - mean) / error
        print(f"{name}: {rms:.5g}, {asked.runs} runs {sqrt(mean):.5g} +- {error / (2 * sqrt(mean)):.2g}, {away:+.2f} standard errors")
    print(f"linear model and densities {spent:.2f} s, {asked.runs} runs of {asked.seconds:g} s {by_runs:.1f} s of CPU")


if __name__ == "__main__":
    main()
