"""Gradients of a run of a closed four-bar beside differences of its runs.  `python -m cutjoint_bench.studies.gradients`.

The crank's angle at 1 s by the stiffness of a spring on it, steps of 1 ms.  Programs that are not installed are left out: MJX
(`mujoco-mjx`), mujoco_warp (`mujoco-warp`) and Nimble (`nimblephysics`, which needs NumPy 1).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib.metadata import version
from typing import Any

import numpy as np

from cutjoint.model.read import read_model_text
from cutjoint.run.scenes import find_scene
from cutjoint.stepping.load import load_scene

STEPS, DT, STIFFNESS = 1000, 1e-3, 20.0

OURS = f"""
cutjoint: 1
name: bar
gravity: [0, 0, -9.81]
parameters: {{k: {{value: {STIFFNESS}, binding: param}}}}
bodies:
  arm: {{mass: 1, centre_of_mass: [0.15, 0, 0], inertia: [0.001, 0.01, 0.01]}}
  rod: {{mass: 0.5, centre_of_mass: [0.4, 0, 0.15], inertia: [0.001, 0.01, 0.01]}}
  rocker: {{mass: 0.5, centre_of_mass: [0.5, 0, 0.15], inertia: [0.001, 0.005, 0.005]}}
joints:
  crank: {{kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: y}}
  knee: {{kind: revolute, bodies: [arm, rod], at: [0.3, 0, 0], axis: y}}
  top: {{kind: revolute, bodies: [rod, rocker], at: [0.5, 0, 0.3], axis: y}}
  foot: {{kind: revolute, bodies: [ground, rocker], at: [0.5, 0, 0], axis: y}}
forces: {{spring: {{kind: joint_force, joint: crank, law: -k*position}}}}
outputs: [crank.angle]
scenes: {{fall: {{end: 1}}}}
"""

#: The mechanism in MJCF, with its loop closed by an equation `connect`.
MJCF = f"""
<mujoco>
  <option timestep="{DT}" gravity="0 0 -9.81" solver="Newton" iterations="ITERATIONS" ls_iterations="ITERATIONS"
          tolerance="1e-12" jacobian="dense">
    <flag contact="disable"/>
  </option>
  <worldbody>
    <body name="arm">
      <joint name="crank" axis="0 1 0" stiffness="{STIFFNESS}"/>
      <inertial pos="0.15 0 0" mass="1" diaginertia="0.001 0.01 0.01"/>
      <body name="rod" pos="0.3 0 0">
        <joint name="knee" axis="0 1 0"/>
        <inertial pos="0.1 0 0.15" mass="0.5" diaginertia="0.001 0.01 0.01"/>
      </body>
    </body>
    <body name="rocker" pos="0.5 0 0">
      <joint name="foot" axis="0 1 0"/>
      <inertial pos="0 0 0.15" mass="0.5" diaginertia="0.001 0.005 0.005"/>
    </body>
  </worldbody>
  <equality><connect body1="rod" body2="rocker" anchor="0.2 0 0.3" solref="0.002 1"/></equality>
</mujoco>
"""


def difference(run: Callable[[float], float]) -> float:
    """The central difference of fourth order of a run."""
    h = 1e-3 * STIFFNESS
    ends = [run(STIFFNESS + way * h) for way in (-2, -1, 1, 2)]
    return (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / (12 * h)


def by_cutjoint() -> Iterator[tuple[str, float, float]]:
    """Along a direction, and by the adjoint method."""
    model = read_model_text(OURS, "bar.yaml")
    sim = load_scene(model, find_scene(model, None), integrator="rk4", adjoint=True)

    def started(k: float = STIFFNESS) -> Any:
        sim.parameters["k"] = k
        sim.reset(dt=DT).choose_independent(["crank.angle_rate"])
        return sim

    own = difference(lambda k: float(started(k).run(STEPS)[-1, 0]))
    yield "along a direction", started().forward_sensitivities(STEPS, ["crank.angle"], ["k"], every=STEPS).end[1][0, 0], own
    yield "by the adjoint method", started().adjoint_sensitivities(STEPS, ["crank.angle"], ["k"], "end", every=STEPS).derivatives[0, 0], own


def _is_single(x: object) -> bool:
    return getattr(x, "dtype", None) == np.float32


def by_mjx() -> Iterator[tuple[str, float | str, float]]:
    """`jax.jvp` and `jax.grad` of a run, in double, with as many iterations of the solver as it takes, and with one."""
    import jax
    import mujoco
    from mujoco import mjx

    jax.config.update("jax_enable_x64", True)
    for iterations in (100, 1):
        model = mujoco.MjModel.from_xml_string(MJCF.replace("ITERATIONS", str(iterations)))
        put, data = mjx.put_model(model), mjx.put_data(model, mujoco.MjData(model))
        put, data = (jax.tree.map(lambda x: x.astype(float) if _is_single(x) else x, each) for each in (put, data))

        def run(k: Any, put: Any = put, data: Any = data) -> Any:
            with_spring = put.replace(jnt_stiffness=put.jnt_stiffness.at[0].set(k))
            return jax.lax.scan(lambda d, _: (mjx.step(with_spring, d), None), data, None, length=STEPS)[0].qpos[0]

        plain = jax.jit(run)
        own = difference(lambda k, plain=plain: float(plain(k)))  # type: ignore[misc]
        how = f"{iterations} iteration{'s' if iterations > 1 else ''} of its solver"
        yield f"jvp, {how}", float(jax.jit(lambda k, run=run: jax.jvp(run, (k,), (1.0,))[1])(STIFFNESS)), own
        try:
            yield f"grad, {how}", float(jax.jit(jax.grad(run))(STIFFNESS)), own
        except ValueError as error:
            yield f"grad, {how}", f"{type(error).__name__}: {str(error).splitlines()[0][:90]}", own


def by_mujoco_warp() -> Iterator[tuple[str, float | str, float]]:
    """A tape of a run, in its single precision."""
    import mujoco
    import mujoco_warp
    import warp

    warp.config.quiet = True
    model = mujoco.MjModel.from_xml_string(MJCF.replace("ITERATIONS", "100"))

    def run(k: float, tape: Any = None) -> tuple[float, float]:
        put, data = mujoco_warp.put_model(model), mujoco_warp.put_data(model, mujoco.MjData(model))
        put.jnt_stiffness = warp.array(np.array([[k, 0.0, 0.0]], dtype=np.float32), dtype=float, requires_grad=True)
        data.qpos.requires_grad = data.qvel.requires_grad = True
        with tape or warp.ScopedTimer("", active=False):
            for _ in range(STEPS):
                mujoco_warp.step(put, data)
        slope = 0.0
        if tape:
            tape.backward(grads={data.qpos: warp.array(np.array([[1.0, 0.0, 0.0]], dtype=np.float32), dtype=float)})
            slope = float(put.jnt_stiffness.grad.numpy()[0, 0])
        return float(data.qpos.numpy()[0, 0]), slope

    own = difference(lambda k: run(k)[0])
    yield "tape", run(STIFFNESS, warp.Tape())[1], own


def by_nimble() -> Iterator[tuple[str, float | str, float]]:
    """Products of the Jacobians of steps, the spring a force from outside, the loop closed by a `BallJointConstraint` or open."""
    import nimblephysics_libs._nimblephysics as nimble

    def make(*, closed: bool) -> Any:
        world, skeleton = nimble.simulation.World(), nimble.dynamics.Skeleton()
        world.setGravity([0, 0, -9.81])
        world.setTimeStep(DT)

        def link(parent: Any, at: list[float], centre: list[float], mass: float, inertia: list[float]) -> Any:
            joint, body = skeleton.createRevoluteJointAndBodyNodePair(*([] if parent is None else [parent]))
            place = nimble.math.Isometry3()
            place.set_translation(at)
            joint.setAxis([0, 1, 0])
            joint.setTransformFromParentBodyNode(place)
            body.setInertia(nimble.dynamics.Inertia(mass, centre, np.diag(inertia)))
            return body

        arm = link(None, [0, 0, 0], [0.15, 0, 0], 1, [0.001, 0.01, 0.01])
        rod = link(arm, [0.3, 0, 0], [0.1, 0, 0.15], 0.5, [0.001, 0.01, 0.01])
        rocker = link(None, [0.5, 0, 0], [0, 0, 0.15], 0.5, [0.001, 0.005, 0.005])
        world.addSkeleton(skeleton)
        if closed:
            world.getConstraintSolver().addConstraint(nimble.constraint.BallJointConstraint(rod, rocker, [0.5, 0, 0.3]))
        return world, skeleton

    def run(k: float, *, closed: bool, steps: int, derive: bool = False) -> tuple[float, float]:
        world, _skeleton = make(closed=closed)
        change = np.zeros(6)
        for _ in range(steps):
            angle = world.getPositions()[0]
            world.setControlForces([-k * angle, 0, 0])
            if derive:
                change = world.getStateJacobian() @ change + world.getActionJacobian() @ [-angle - k * change[0], 0, 0]
            world.step()
        return float(world.getPositions()[0]), float(change[0])

    for closed, steps, how in ((False, 300, "loop open, 0.3 s"), (True, STEPS, "loop closed")):
        own = difference(lambda k, closed=closed, steps=steps: run(k, closed=closed, steps=steps)[0])  # type: ignore[misc]
        yield f"products of steps' Jacobians, {how}", run(STIFFNESS, closed=closed, steps=steps, derive=True)[1], own


PROGRAMS: dict[str, tuple[Callable[[], Iterator[tuple[str, float | str, float]]], str]] = {
    "cutjoint": (by_cutjoint, "cutjoint"), "MJX": (by_mjx, "mujoco-mjx"), "mujoco_warp": (by_mujoco_warp, "mujoco-warp"),
    "Nimble": (by_nimble, "nimblephysics"),
}  # fmt: skip


def main() -> None:
    """Print a row for each way."""
    for name, (find, package) in PROGRAMS.items():
        try:
            for how, slope, own in find():
                said = slope if isinstance(slope, str) else f"{slope:.8g}, off by {abs(slope - own) / abs(own):.1e}"
                print(f"{name} {version(package)}, {how}: differences of its runs {own:.8g} rad per N m/rad, {said}", flush=True)
        except ImportError as error:
            print(f"{name} is not installed: {error}", flush=True)


if __name__ == "__main__":
    main()
