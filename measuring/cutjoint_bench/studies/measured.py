"""Fits of measured machines, beside what others do with the same data, which stand in a folder of the caller's.

    .venv/bin/python -m cutjoint_bench.studies.measured ur10e FOLDER [--fit '*harm.csv'] [--gains free]
    .venv/bin/python -m cutjoint_bench.studies.measured art FOLDER [--fit 02s-rampt-10s_test0]

ur10e: the folder has `ur10e.urdf` and tables without names of time, six angles (rad), rates, and motor currents (A).  `cutjoint fit`
fits inertias and friction to the currents of the runs of ``--fit``; all others are for validation.  Beside it are the base parameters by
ordinary least squares with Pinocchio's regressor, viscous and Coulomb friction and an offset, of motions filtered by a Butterworth filter
forwards and backwards.  Gains are those of the controller's own torques and currents at rest, or ``free``.

art: the folder has NAME.csv, places and yaw of a car, and NAME.txt, its commands.  A planar car with the parameters of its source is
fitted to one run; printed is how far the ends of all runs are off, before and after.
"""

import argparse
import re
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

import cutjoint
from cutjoint.importing.document import import_file

Array = NDArray[np.float64]

#: Torque by current at rest where gravity acts (N m/A); those of the first and the last joint are of their neighbours' size.
_GAINS = (12.0, 11.976, 9.839, 10.758, 10.758, 10.758)

#: The speed (rad/s) over which friction changes its sign, and bandwidths (Hz) of splines and of the filter.
_SIGN, _BAND, _CUTOFF = 0.02, 12.0, 10.0

#: The standard deviation of all currents (A), so that both fits weigh them alike.
_NOISE = 0.25


def main() -> None:
    """Print the figures of a machine."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("machine", choices=("ur10e", "art"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--fit", default=None)
    parser.add_argument("--gains", choices=("known", "free"), default="known")
    given = parser.parse_args()
    if given.machine == "ur10e":
        _robot(given.folder.resolve(), given.fit or "*harm.csv", is_free=given.gains == "free")
    else:
        _car(given.folder.resolve(), given.fit or "02s-rampt-10s_test0")


def _fit(study: Mapping[str, Any]) -> cutjoint.Fit:
    begin = perf_counter()
    found = cutjoint.fit(study, note=print)
    print(f"{found.verdict}, {found.iterations} iterations, {found.runs} runs, {perf_counter() - begin:.0f} s")
    for fault, words in found.faults.items():
        print(f"  {fault}: {words}")
    for name, unit, value, deviation in zip(found.names, found.units, found.values, found.deviations, strict=True):
        print(f"  {name} = {value:.6g} ± {deviation:.2g} {unit}")
    return found


# The robot


def _robot(folder: Path, fitted: str, *, is_free: bool) -> None:
    text = import_file(folder / "ur10e.urdf").text
    joints, laws = re.findall(r"^  (\w+): \{kind: revolute", text, re.M), []
    bodies = re.findall(r"bodies: \[\w+, (\w+)\].*axis", text)
    parameters: dict[str, Any] = {}
    for i, joint in enumerate(joints):
        parameters |= {f"viscous{i}": {"start": 10.0}, f"dry{i}": {"start": 5.0}, f"offset{i}": {"start": 0.0, "size": 1.0}}
        law = f"-viscous{i}*rate - dry{i}*tanh(rate/{_SIGN}) - offset{i}"
        laws.append(f"  friction{i}: {{kind: joint_force, joint: {joint}, law: {law}}}")
        if is_free:
            parameters[f"gain{i}"] = {"start": _GAINS[i]}
    own = "".join(f"  {name}: {part['start']}\n" for name, part in parameters.items() if not name.startswith("gain"))
    text = text.replace("parameters:\n", "parameters:\n" + own).replace("forces:\n", "forces:\n" + "\n".join(laws) + "\n")
    runs = sorted(folder.glob("*.csv"))
    experiments = {
        path.stem: {
            "data": str(path), "time": 1, "bandwidth": _BAND,
            "motion": {j: {"column": 2 + i, "rate": 8 + i} for i, j in enumerate(joints)},
            "signals": {f"{j}.drive": {"column": 14 + i, "gain": f"1/gain{i}" if is_free else 1 / _GAINS[i], "deviation": _NOISE}
                        for i, j in enumerate(joints)},
            "validation": not path.match(fitted),
        }
        for path in runs
    }  # fmt: skip
    with TemporaryDirectory() as place:
        (Path(place) / "robot.yaml").write_text(text)
        study = {"cutjoint_fit": 1, "model": f"{place}/robot.yaml", "parameters": parameters, "inertias": bodies}
        found = _fit({**study, "experiments": experiments})
    errors = {run.stem: np.sqrt(np.mean([s.rms**2 for s in found.signals if s.experiment == run.stem])) for run in runs}
    print("RMS of the currents (A)".ljust(36), *(f"{name:>14}" for name in ("cutjoint fit", "OLS, sign", "OLS, tanh")))
    chosen = [run for run in runs if run.match(fitted)]
    beside = [_least_squares(folder, chosen, runs, sign) for sign in (np.sign, lambda v: np.tanh(v / _SIGN))]
    for run in runs:
        print(f"{run.stem}{'' if run in chosen else ', validation'}".ljust(36), *(f"{each[run.stem]:14.4f}" for each in (errors, *beside)))


def _least_squares(folder: Path, fitted: list[Path], runs: list[Path], sign: Any) -> dict[str, float]:
    """The RMS of all runs' currents by base parameters, viscous and Coulomb friction and offsets that fit some runs best."""
    import pinocchio  # type: ignore[import-untyped]
    from scipy.signal import butter, filtfilt

    model = pinocchio.buildModelFromUrdf(str(folder / "ur10e.urdf"))
    data, gains = model.createData(), np.array(_GAINS)

    def rows(path: Path) -> tuple[Array, Array]:
        table = np.loadtxt(path, delimiter=",")
        t = table[:, 0] - table[0, 0]
        step = float(np.median(np.diff(t)))
        even, low_pass = np.arange(0.0, t[-1], step), butter(5, 2 * _CUTOFF * step)
        rates = np.array([filtfilt(*low_pass, np.interp(even, t, column)) for column in table[:, 7:13].T])
        second = filtfilt(*low_pass, np.gradient(rates, step, axis=1))
        v, a = (np.array([np.interp(t, even, row) for row in each]).T for each in (rates, second))
        base = np.array([pinocchio.computeJointTorqueRegressor(model, data, *each) for each in zip(table[:, 1:7], v, a, strict=True)])
        friction = np.concatenate([each[:, :, np.newaxis] * np.eye(6) for each in (v, sign(v), np.ones_like(v))], axis=2)
        return np.concatenate([base, friction], axis=2) / gains[:, np.newaxis], table[:, 13:19]

    parts = [rows(path) for path in fitted]
    matrix, currents = (np.concatenate(each) for each in zip(*parts, strict=True))
    found = np.linalg.lstsq(matrix.reshape(-1, matrix.shape[2]), currents.reshape(-1), rcond=1e-9)[0]
    return {path.stem: float(np.sqrt(np.mean((x @ found - i) ** 2))) for path, (x, i) in zip(runs, map(rows, runs), strict=True)}


# The car

#: A single-track car on its floor.  Numbers are the source's: of its vehicle, of its motor map, stretched by the throttle, and of its tyre
#: (TMeasy) at 14 N a wheel.  Steering has a zero, the throttle a deadband, and the camera's axes a heading, which are zero there.
_CAR = """cutjoint: 1
name: art
gravity: [0, 0, 0]
parameters:
  throttle: {value: 0, binding: input}
  steering: {value: 0, binding: input}
  a: {value: 0.268377, unit: m}
  b: {value: 0.196863, unit: m}
  steer_gain: {value: 0.436332, unit: rad}
  steer_zero: {value: 0, unit: rad}
  heading: {value: 0, unit: rad}
  cornering: {value: 220, unit: N}
  torque: {value: 0.36, unit: N*m}
  losses: {value: 0.065, unit: N*m}
  top_speed: {value: 161.006, unit: rad/s}
  deadband: 0
  rolling: {value: 3.393, unit: N}
  mass: {value: 5.76436, unit: kg}
  yaw_inertia: {value: 0.350251, unit: kg*m^2}
points: {F: [a, 0, 0], R: [-b, 0, 0]}
bodies:
  car: {mass: mass, centre_of_mass: [0, 0, 0], inertia: [0.075, 0.35, yaw_inertia]}
joints:
  floor: {kind: planar, bodies: [ground, car], at: [0, 0, 0], axis: z}
signals:
  u: car.vx*cos(car.yaw) + car.vy*sin(car.yaw)
  v: -car.vx*sin(car.yaw) + car.vy*cos(car.yaw)
  delta: steer_gain*steering + steer_zero
  across_front: (v + a*car.wz)*cos(delta) - u*sin(delta)
  across_rear: v - b*car.wz
  motor: u*6/0.085
  open: max(throttle - deadband, 0)/(1 - deadband)
  drive: where(open > 0.001, torque*max(1 - motor/(top_speed*max(open, 0.001)), 0), 0)
  along: 6/0.085*(drive - losses*max(1 - motor/161.006, 0)*tanh(u/0.01)) - rolling*tanh(u/0.01)
  front: -cornering/0.02*(front_deflection + 0.002*across_front)
  rear: -cornering/0.02*(rear_deflection + 0.002*across_rear)
  east: -(car.x*cos(heading) - car.y*sin(heading))
  north: -(car.x*sin(heading) + car.y*cos(heading))
states:
  front_deflection: {start: 0 m, rate: across_front - abs(u)/0.02*front_deflection, nominal: 1 mm}
  rear_deflection: {start: 0 m, rate: across_rear - abs(u)/0.02*rear_deflection, nominal: 1 mm}
forces:
  front_tyre: {kind: load, body: car, at: F, axes: body, force: [along/2 - front*sin(delta), front*cos(delta), 0]}
  rear_tyre: {kind: load, body: car, at: R, axes: body, force: [along/2, rear, 0]}
scenes:
  ramp: {end: 15, output_step: 10 ms}
"""

#: What the fit may change.  Steering's gain and zero are tied in a run with one steering angle, so that the gain stays the source's.
_OF_CAR: Mapping[str, Any] = {
    "delay": {"start": "0.05 s", "size": "0.1 s"}, "heading": {"size": 0.1}, "steer_zero": {"size": 0.1},
    "deadband": {"start": 0.2, "size": 0.1, "from": 0, "to": 0.9}, "top_speed": {}, "rolling": {},
}  # fmt: skip


def _car(folder: Path, fitted: str) -> None:
    runs = sorted(path.stem for path in folder.glob("*.csv"))
    of_source = {"delay": {"start": 0.0, "from": -1e-9, "to": 1e-9, "size": "1 s"}}
    tied: dict[str, Any] = {"steer_gain": {}, "torque": {}, "losses": {}, "mass": {}, "yaw_inertia": {}, "cornering": {}}
    with TemporaryDirectory() as place:
        (Path(place) / "car.yaml").write_text(_CAR)
        ends = {}
        for words, parameters in (("source", of_source), ("fitted", _OF_CAR), ("with what is tied", {**_OF_CAR, **tied})):
            print(f"\n{words}")
            found = _fit({
                "cutjoint_fit": 1, "model": f"{place}/car.yaml", "integrator": "rk4", "dt": "4 ms", "parameters": parameters,
                "experiments": {run: _experiment(folder, run, is_held_out=run != fitted) for run in runs},
            })  # fmt: skip
            ends[words] = {run: float(np.hypot(*(s.predicted[-1] - s.measured[-1] for s in found.signals if s.experiment == run and
                s.signal != "car.yaw"))) for run in runs}  # fmt: skip
    print("\ndistance from the end of the run (m)".ljust(36), *(f"{name:>18}" for name in ends))
    for run in runs:
        print(f"{run}{', fitted' if run == fitted else ''}".ljust(36), *(f"{each[run]:18.3f}" for each in ends.values()))


def _experiment(folder: Path, run: str, *, is_held_out: bool) -> dict[str, Any]:
    signals = {"east": ("x", "m", 0.01), "north": ("y", "m", 0.01), "car.yaw": ("yaw", "rad", 0.01)}
    return {
        "data": str(folder / f"{run}.csv"), "time": "time", "validation": is_held_out,
        "inputs": {n: {"data": str(folder / f"{run}.txt"), "time": 1, "column": i} for n, i in (("steering", 2), ("throttle", 3))},
        "signals": {n: {"column": c, "unit": unit, "deviation": s, "delay": "delay"} for n, (c, unit, s) in signals.items()},
    }  # fmt: skip


if __name__ == "__main__":
    main()
