"""CPU time of fits beside others with the same data, parameters, starts and runs: ratios, iterations and costs.

    .venv/bin/python -m cutjoint_bench.studies.fits [--repetitions 3] [--only loop]

loop: seven numbers of the press, beside SciPy's `least_squares(jac="2-point")` on runs of the same simulation, which compute no
derivatives.  Data are a run with other numbers and 1 % noise.

tree: ten numbers of an arm of five joints that swings freely, beside MuJoCo's toolbox `mujoco.sysid` with its own optimiser and SciPy's
(`pip install 'mujoco[sysid]'`).  Data are a run of MuJoCo with other numbers and 1 % noise; both integrate by RK4 with equal steps.

What fits recover, and how often their intervals cover the truth: `cutjoint_bench.studies.recovery`.

Times are of the process, without compiling and, on our side, without what judges a result.  Costs are means of squared residuals in units
of the noise.
"""

import argparse
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

import cutjoint
from cutjoint.fits.fit import Solver
from cutjoint.fits.reading import read_fit
from cutjoint.importing.document import import_file

Array = NDArray[np.float64]

_MODEL = Path(__file__).resolve().parents[3] / "models" / "press.yaml"
_TRUE = {
    "stiffness": 1700.0, "A.z": 0.11, "B.x": 0.31, "slider.mass": 3.5, "rod.mass": 1.3, "spring.law.damping": 14.0,
    "spring.law.free_length": 0.5,
}  # fmt: skip
_SIGNALS, _STEPS, _EVERY, _DT = ["slider.x", "pin.angle", "spring.force"], 1000, 5, 1e-3

_ARM = """
<mujoco model="arm">
  <compiler angle="radian"/>
  <option integrator="RK4" timestep="0.002"><flag contact="disable"/></option>
  <worldbody>
    <body name="link1" pos="0 0 1">
      <joint name="joint1" axis="0 0 1" damping="0.05" armature="0.01"/>
      <inertial pos="0 0 0.1" mass="1.5" diaginertia="0.01 0.01 0.005"/>
      <body name="link2" pos="0 0 0.2">
        <joint name="joint2" axis="0 1 0" damping="0.05" armature="0.01"/>
        <inertial pos="0.15 0 0" mass="1.2" diaginertia="0.002 0.009 0.009"/>
        <body name="link3" pos="0.3 0 0">
          <joint name="joint3" axis="0 1 0" damping="0.05" armature="0.005"/>
          <inertial pos="0.12 0 0" mass="0.8" diaginertia="0.001 0.005 0.005"/>
          <body name="link4" pos="0.25 0 0">
            <joint name="joint4" axis="1 0 0" damping="0.02" armature="0.002"/>
            <inertial pos="0.02 0.03 0.01" mass="0.4" diaginertia="0.0005 0.0008 0.0008"/>
            <body name="link5" pos="0.05 0 0">
              <joint name="joint5" axis="0 0 1" damping="0.02" armature="0.002"/>
              <inertial pos="0.08 0 0" mass="0.3" diaginertia="0.0003 0.0009 0.0009"/>
            </body>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <sensor>
    <jointpos joint="joint1"/><jointpos joint="joint2"/><jointpos joint="joint3"/><jointpos joint="joint4"/><jointpos joint="joint5"/>
  </sensor>
</mujoco>
"""  # the toolbox wants as many sensors as measurements, which it then compares with joint positions of the state
_JOINTS = [f"joint{i}" for i in range(1, 6)]
#: What is fitted, as MuJoCo has it: kind, attribute, name, and the data's number over that of the file.
_CHANGED = [
    ("joint", "damping", "joint1", 1.3), ("joint", "damping", "joint2", 0.7), ("joint", "damping", "joint3", 1.25),
    ("joint", "damping", "joint4", 0.8), ("joint", "damping", "joint5", 1.2), ("body", "mass", "link3", 1.15),
    ("body", "mass", "link4", 0.85), ("body", "mass", "link5", 1.2), ("joint", "armature", "joint2", 1.4),
    ("joint", "armature", "joint3", 0.6),
]  # fmt: skip
_SWING, _SAMPLED, _STEP = 1000, 5, 2e-3
_NAMES = [f"{name}.spring.damping" if attribute == "damping" else f"{name}.{attribute}" for _, attribute, name, _ in _CHANGED]


def main() -> None:
    """Print the figures of each study."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repetitions", type=int, default=3)
    parser.add_argument("--only", choices=("loop", "tree"), default=None)
    given = parser.parse_args()
    for name, study in (("loop", _loop), ("tree", _tree)):
        if given.only in (None, name):
            study(given.repetitions)


def _timed(repetitions: int, prepare: Callable[[], Any], function: Callable[[], Any]) -> tuple[float, Any]:
    """The least CPU time, and the last result."""
    times = []
    for _ in range(repetitions):
        prepare()
        begin = process_time()
        found = function()
        times.append(process_time() - begin)
    return min(times), found


class _Ours:
    """Our fit, which knows the costs of others' parameters."""

    def __init__(self, name: str, repetitions: int, study: dict[str, Any]) -> None:
        exact = self.exact = Solver(read_fit(study), lambda text: None)
        self.seconds, found = _timed(repetitions, lambda: exact.residuals(0.9 * exact.start), lambda: exact.least_squares(exact.start))
        self.values: Array = found.x
        print(f"{name}: exact sensitivities: {self.seconds:.4g} s, {found.njev} iterations, {found.nfev} runs")

    def cost(self, values: Array) -> float:
        """The mean of squared residuals."""
        return float(np.mean(self.exact.residuals(values)[0] ** 2))

    def print(self, name: str, seconds: float, values: Array) -> None:
        """A row of another way."""
        apart = np.abs(values / self.values - 1).max()
        print(f"{name}: {seconds:.4g} s, {seconds / self.seconds:.3g} times ours; cost {self.cost(values):.9g}, "
              f"ours {self.cost(self.values):.9g}; parameters differ by {apart:.2g} of their values")  # fmt: skip


def _loop(repetitions: int) -> None:
    sim = cutjoint.load(_MODEL, integrator="rk4", linearise=True, tunable=[name for name in _TRUE if "." in name])
    names, start = list(_TRUE), np.array([sim.parameters[name] for name in _TRUE])
    places = [sim.outputs.place(name) for name in _SIGNALS] if sim.reset(dt=_DT) else []

    def run(theta: Array) -> Array:
        sim.parameters.update(zip(names, theta, strict=True))
        sim.reset(dt=_DT)
        return np.vstack([sim.outputs.array, sim.run(_STEPS)])[::_EVERY, places]

    clean = run(np.array([*_TRUE.values()]))
    noise = 0.01 * clean.std(axis=0)
    data = clean + noise * np.random.default_rng(0).normal(size=clean.shape)
    with TemporaryDirectory() as folder:
        path, t = Path(folder) / "data.csv", np.arange(len(data)) * _EVERY * _DT
        np.savetxt(path, np.column_stack([t, data]), delimiter=",", header=",".join(["t", *_SIGNALS]), comments="", fmt="%.17g")
        ours = _Ours("loop", repetitions, {
            "cutjoint_fit": 1, "model": str(_MODEL), "integrator": "rk4", "dt": _DT, "parameters": {name: {} for name in names},
            "experiments": {"run": {"data": str(path), "signals": {
                name: {"deviation": float(s)} for name, s in zip(_SIGNALS, noise, strict=True)}}},
        })  # fmt: skip
    sizes = np.abs(start)

    def difference(z: Array) -> Array:
        return np.ravel(((run(z * sizes) - data) / noise).T)

    other, beside = _timed(repetitions, lambda: None, lambda: least_squares(
        difference, np.ones(len(names)), jac="2-point", xtol=1e-10, ftol=1e-8, gtol=1e-14))  # fmt: skip
    print(f"differences: {beside.nfev} and {beside.njev} times {len(names)} runs")
    ours.print("differences", other, beside.x * sizes)


def _tree(repetitions: int) -> None:
    import mujoco
    from mujoco import rollout, sysid

    spec = mujoco.MjSpec.from_string(_ARM)
    model = spec.compile()
    begin = np.array([0.3, -0.4, 0.5, 0.6, -0.3])
    initial = sysid.create_initial_state(model, begin, np.zeros(5), np.zeros(0))
    start = np.array([float(getattr(getattr(spec, kind)(name), attribute)) if attribute != "damping" else
                      float(np.ravel(getattr(spec, kind)(name).damping)[0]) for kind, attribute, name, _ in _CHANGED])  # fmt: skip

    def modifier(kind: str, attribute: str, name: str) -> Callable[[Any, Any], None]:
        def change(spec: Any, p: Any) -> None:
            element = getattr(spec, kind)(name)
            old = getattr(element, attribute)
            setattr(element, attribute, [p.value[0], *np.ravel(old)[1:]] if np.ndim(old) else p.value[0])

        return change

    params = sysid.ParameterDict()
    for key, (kind, attribute, name, _), value in zip(_NAMES, _CHANGED, start, strict=True):
        change = modifier(kind, attribute, name)
        params.add(sysid.Parameter(key, nominal=value, min_value=0.1 * value, max_value=5 * value, modifier=change))
    params.update_from_vector(start * np.array([factor for *_, factor in _CHANGED]))
    true = sysid.apply_param_modifiers(params, spec)
    state = np.squeeze(rollout.rollout(true, mujoco.MjData(true), initial, np.zeros((_SWING, 0)))[0], axis=0)
    t, clean = np.concatenate([[0.0], state[:, 0]])[::_SAMPLED], np.vstack([begin, state[:, 1:6]])[::_SAMPLED]
    noise = 0.01 * np.sqrt(np.mean(clean**2, axis=0))
    data = clean + noise * np.random.default_rng(0).normal(size=clean.shape)
    with TemporaryDirectory() as folder:
        (Path(folder) / "arm.xml").write_text(_ARM)
        (Path(folder) / "arm.yaml").write_text(import_file(Path(folder) / "arm.xml").text)
        header = ",".join(["t", *_JOINTS])
        np.savetxt(Path(folder) / "d.csv", np.column_stack([t, data]), delimiter=",", header=header, comments="", fmt="%.17g")
        ours = _Ours("tree", repetitions, {
            "cutjoint_fit": 1, "model": str(Path(folder) / "arm.yaml"), "integrator": "rk4", "dt": _STEP,
            "parameters": {name: {"from": float(0.1 * x), "to": float(5 * x)} for name, x in zip(_NAMES, start, strict=True)},
            "experiments": {"run": {
                "data": str(Path(folder) / "d.csv"),
                "start": {f"{j}.angle": float(x) for j, x in zip(_JOINTS, begin, strict=True)} | {f"{j}.angle_rate": 0.0 for j in _JOINTS},
                "signals": {f"{j}.angle": {"column": j, "deviation": float(s)} for j, s in zip(_JOINTS, noise, strict=True)},
            }},
        })  # fmt: skip
    measured = sysid.TimeSeries(t, data, {f"{j}_qpos": (sysid.SignalType.MjStateQPos, np.array([i])) for i, j in enumerate(_JOINTS)})
    control = sysid.TimeSeries(np.arange(_SWING + 1) * _STEP, np.zeros((_SWING + 1, 0)))
    sequences = [sysid.ModelSequences("arm", spec, "swing", initial, control, measured)]
    observed = [(name, kind) for name, (kind, _) in measured.signal_mapping.items()]
    residual = sysid.build_residual_fn(models_sequences=sequences, n_threads=1, enabled_observations=observed)
    for optimiser in ("mujoco", "scipy"):
        def fit(optimiser: str = optimiser) -> Any:
            return sysid.optimize(initial_params=params, residual_fn=residual, optimizer=optimiser, verbose=False)

        other, (best, _) = _timed(repetitions, lambda: params.update_from_vector(start), fit)
        ours.print(f"mujoco.sysid, {optimiser}", other, best.as_vector())


if __name__ == "__main__":
    main()
