"""Fits beside SciPy's least squares on differences of the same runs: CPU time, iterations and cost.

    .venv/bin/python -m cutjoint_bench.studies.fits [--repetitions 3]

Data are a run of the press with other numbers and 1 % noise.  Both fits start at the numbers of the file and weigh signals alike.  The
differences are those of `least_squares(jac="2-point")`; their runs are `Simulation.run`, which compute no derivatives.  Times are of the
process, without compiling and without what judges a result.
"""

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np
from scipy.optimize import least_squares

import cutjoint
from cutjoint.fits.fit import Solver
from cutjoint.fits.reading import read_fit

_MODEL = Path(__file__).resolve().parents[3] / "models" / "press.yaml"
_TRUE = {
    "stiffness": 1700.0, "A.z": 0.11, "B.x": 0.31, "slider.mass": 3.5, "rod.mass": 1.3, "spring.law.damping": 14.0,
    "spring.law.free_length": 0.5,
}  # fmt: skip
_SIGNALS, _STEPS, _EVERY, _DT = ["slider.x", "pin.angle", "spring.force"], 1000, 5, 1e-3


def main() -> None:
    """Print a row for each way."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repetitions", type=int, default=3)
    repetitions = parser.parse_args().repetitions
    sim = cutjoint.load(_MODEL, integrator="rk4", linearise=True, tunable=[name for name in _TRUE if "." in name])
    names, start = list(_TRUE), np.array([sim.parameters[name] for name in _TRUE])
    places = [sim.outputs.place(name) for name in _SIGNALS] if sim.reset(dt=_DT) else []

    def run(theta: np.ndarray) -> np.ndarray:
        sim.parameters.update(zip(names, theta, strict=True))
        sim.reset(dt=_DT)
        return np.vstack([sim.outputs.array, sim.run(_STEPS)])[::_EVERY, places]

    clean = run(np.array([*_TRUE.values()]))
    spread = clean.std(axis=0)
    data = clean + 0.01 * spread * np.random.default_rng(0).normal(size=clean.shape)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "data.csv"
        t = np.arange(len(data)) * _EVERY * _DT
        np.savetxt(path, np.column_stack([t, data]), delimiter=",", header=",".join(["t", *_SIGNALS]), comments="", fmt="%.17g")
        study = {
            "cutjoint_fit": 1, "model": str(_MODEL), "integrator": "rk4", "dt": _DT, "parameters": {name: {} for name in names},
            "experiments": {"run": {"data": str(path), "signals": {
                name: {"deviation": 0.01 * float(s)} for name, s in zip(_SIGNALS, spread, strict=True)}}},
        }  # fmt: skip
        exact = Solver(read_fit(study), lambda text: None)
        times = []
        for _ in range(repetitions):
            exact.residuals(0.9 * exact.start)  # the last residuals are kept
            begin = process_time()
            found = exact.least_squares(exact.start)
            times.append(process_time() - begin)
    print(f"exact sensitivities: {min(times):.4f} s, {found.njev} iterations, cost {found.cost:.9g}")
    sizes, times = np.abs(start), []
    for _ in range(repetitions):
        begin = process_time()
        beside = least_squares(lambda z: ((run(z * sizes) - data) / (0.01 * spread)).T.reshape(-1), np.ones(len(names)), jac="2-point",
            xtol=1e-10, ftol=1e-8, gtol=1e-14)  # fmt: skip
        times.append(process_time() - begin)
    print(f"differences: {min(times):.4f} s, {beside.njev} iterations, cost {beside.cost:.9g}")
    print(f"largest difference of parameters: {np.abs(beside.x * sizes / found.x - 1).max():.2g} of their values")


if __name__ == "__main__":
    main()
