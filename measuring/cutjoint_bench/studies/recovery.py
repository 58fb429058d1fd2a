"""What fits of ten parameters recover from starts 50 % off, and how often their 95 % intervals cover the truth.

    .venv/bin/python -m cutjoint_bench.studies.recovery press delta corner leg [--sets 100]
    .venv/bin/python -m cutjoint_bench.studies.recovery press delta corner leg --other [--sets 10]

Of each model two are hardpoints, three inertial, three of laws and two of friction.  Data are runs of the same discretisation; noise is
that share of each signal's standard deviation.  All settings of the fit are its defaults, with bounds at 0.2 and 3 times the true values.

--other: data are runs of other simulators (`recovery_peers`; `pip install mujoco pin`), fits start 20 % off, and our runs are those of
`dop853` with a tolerance of 1e-11.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cutjoint.fits.fit import Fit, Solver
from cutjoint.fits.reading import read_fit
from cutjoint.importing.document import import_file
from cutjoint.package.errors import CutjointError
from cutjoint_bench.studies.checkout import MODELS
from cutjoint_bench.studies.provenance import provenance

Array = NDArray[np.float64]

#: The relative error of parameters that are found, the half-width of starts, and bounds, as shares of the true values.
_FOUND, _REACH, _LOW, _HIGH = 1e-9, 0.5, 0.2, 3.0
#: That of our runs beside other simulators'.
_TOLERANCE = 1e-11


@dataclass(frozen=True, kw_only=True)
class Case:
    """A model's text, what is fitted with its true values, what is measured every so many steps, and the run."""

    text: str
    true: Mapping[str, float]
    signals: tuple[str, ...]
    dt: float
    end: float
    every: int = 10
    experiment: Mapping[str, Any] = field(default_factory=dict)


def _press() -> Case:
    text = (MODELS / "press.yaml").read_text().replace(
        "outputs: [",
        "  rail_friction: {kind: joint_friction, joint: rail, coefficient: 0.1, preload: 20, presliding: 1 mm}\n"
        "  bearing: {kind: joint_friction, joint: pin, coefficient: 0.1, radius: 0.05, preload: 60, presliding: 1 mm}\noutputs: [", 1,
    )  # fmt: skip
    true = {
        "A.z": 0.11, "B.x": 0.31, "slider.mass": 3.5, "rod.mass": 1.3, "crank.inertia.1": 0.01, "stiffness": 1700.0,
        "spring.law.damping": 14.0, "spring.law.free_length": 0.5, "rail_friction.coefficient": 0.12, "bearing.coefficient": 0.15,
    }  # fmt: skip
    return Case(text=text, true=true, signals=("slider.x", "pin.angle", "spring.force"), dt=2e-3, end=1.0, every=4)


def _delta() -> Case:
    text = (MODELS / "delta.yaml").read_text()
    for old, new in (
        ("  kp: {", "  upper: {value: 0.2, unit: kg}\n  rotor: {value: 2.0e-3, unit: kg*m^2}\n  lift: {value: 1, unit: N*m}\n"
                    "  dry: {value: 0.1, unit: N*m}\n  viscous: {value: 0.05, unit: N*m*s}\n  kp: {"),
        ("mass: 0.2, at", "mass: upper, at"),
        ("axis: [-sin(a), cos(a), 0],", "axis: [-sin(a), cos(a), 0], armature: rotor,"),
        *((f"kp*(q{i} - position) - kd*rate", f"kp*(q{i} - position) - kd*rate - lift") for i in (1, 2, 3)),
        ("outputs: [plate.x", "".join(f"  f{i}: {{kind: joint_force, joint: l{i}.motor, law: -viscous*rate - dry*tanh(rate/0.1)}}\n"
                                     for i in (1, 2, 3)) + "outputs: [plate.x"),
        ("at: E1, to: P1}", "at: E1, to: P1, cut: true}"), ("at: E2, to: P2}", "at: E2, to: P2, cut: true}"),
        ("submodels:\n", "joints: {free: {kind: free, bodies: [ground, plate], at: [0, 0, -drop]}}\nsubmodels:\n"),
        ("kp: {value: 800", "kp: {value: 80"), ("kd: {value: 10,", "kd: {value: 2,"),
    ):  # fmt: skip
        text = text.replace(old, new)
    true = {
        "arm": 0.25, "R": 0.2, "plate.mass": 0.3, "upper": 0.2, "rotor": 2e-3, "kp": 80.0, "kd": 2.0, "lift": 1.0, "dry": 0.1,
        "viscous": 0.05,
    }  # fmt: skip
    return Case(text=text, true=true, signals=("plate.x", "plate.y", "plate.z", "l1.motor.angle", "m1.force"), dt=2e-3, end=1.2, every=5,
                experiment={"rest": True})  # fmt: skip


def _corner() -> Case:
    iltis = (MODELS / "iltis.yaml").read_text()
    suspension = iltis[iltis.index("submodels:"): iltis.index("instances:")]
    tyre = suspension.index("      tyre:\n")
    suspension = suspension[:tyre] + suspension[suspension.index("    reactions:"):]
    law = suspension.index("        law:  "), suspension.index("      leaf:\n")
    suspension = suspension[:law[0]] + "        law: shock_rate*(length - 0.43) + shock_damping*rate\n" + suspension[law[1]:]
    suspension = suspension.replace("35906*(0.145 - travel)", "leaf_rate*(0.145 - travel)")
    suspension = suspension[:suspension.index("    outputs: [")] + "    outputs: [shock.length, shock.force]\n"
    suspension = suspension.replace(", tyre_radius]", "]")
    text = """cutjoint: 1
name: corner
gravity: [0, 0, -9.81]
parameters:
  chassis_mass: {value: 315, unit: kg}
  leaf_rate: {value: 35906, unit: N/m}
  shock_rate: {value: 20000, unit: N/m}
  shock_damping: {value: 6000, unit: N*s/m}
  tyre_rate: {value: 460000, unit: N/m}
  bumper_stiffness: {value: 1.0e+7, unit: N/m}
  road: {value: 0, unit: m, binding: input}
bodies:
  chassis: {mass: chassis_mass, centre_of_mass: [0, 0, 0.57]}
  pad: {mass: 5, centre_of_mass: [0.97, 0.615, 0]}
joints:
  heave: {kind: prismatic, bodies: [ground, chassis], at: [0, 0, 0.57], axis: [0, 0, 1]}
  post: {kind: prismatic, bodies: [ground, pad], at: [0.97, 0.615, 0], axis: [0, 0, 1], guide: road}
""" + suspension + """
instances:
  left: {use: suspension, connect: {chassis: chassis, steering: chassis}, with: {x_hinge: 0.97, x_tie_rod: 0.83, x_shock: 1.045}}
forces:
  tyre: {kind: axial_force, bodies: [pad, left.carrier], origin: [0.97, 0.615, 0], point: [0.97, 0.615, 0.356], axis: [0, 0, 1],
         law: "tyre_rate*(0.364325 - travel) - 100*rate"}
  hinge: {kind: joint_friction, joint: left.arm_hinge, coefficient: 0.2, radius: 0.02, preload: 3000, presliding: 2 mm}
  slide: {kind: joint_force, joint: heave, law: "-60*tanh(rate/0.05)"}
outputs: [chassis.z, left.carrier.z, tyre.force, chassis.az]
scenes:
  road: {end: 1, output_step: 5 ms, pose: equilibrium, inputs: {road: "0.02*sin(2*pi*(1 + 2*t)*t)**3"}}
"""
    true = {
        "left.D2.z": 0.531, "left.K2.y": 0.5, "chassis_mass": 315.0, "left.carrier.mass": 57.35, "left.arm.mass": 6.0, "leaf_rate": 35906.0,
        "shock_damping": 6000.0, "tyre_rate": 460000.0, "hinge.coefficient": 0.2, "dry": 60.0,
    }  # fmt: skip
    text = text.replace('"-60*tanh', '"-dry*tanh').replace("  road: {value", "  dry: {value: 60, unit: N}\n  road: {value", 1)
    return Case(text=text, true=true, signals=("chassis.z", "left.carrier.z", "left.shock.length", "left.shock.force", "tyre.force"),
                dt=1e-3, end=1.0, every=10, experiment={"rest": True})  # fmt: skip


def _leg() -> Case:
    urdf = """<robot name="leg">
  <link name="trunk"/>
  <link name="hip"><inertial><origin xyz="0 0.03 -0.02"/><mass value="0.7"/>
    <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial></link>
  <link name="thigh"><inertial><origin xyz="0 0 -0.12"/><mass value="1.2"/>
    <inertia ixx="0.008" ixy="0" ixz="0" iyy="0.008" iyz="0" izz="0.001"/></inertial></link>
  <link name="shank"><inertial><origin xyz="0 0 -0.11"/><mass value="0.5"/>
    <inertia ixx="0.003" ixy="0" ixz="0" iyy="0.003" iyz="0" izz="0.0003"/></inertial></link>
  <joint name="abduction" type="continuous"><parent link="trunk"/><child link="hip"/><origin xyz="0 0 0"/><axis xyz="1 0 0"/>
    <dynamics damping="0.2"/></joint>
  <joint name="flexion" type="continuous"><parent link="hip"/><child link="thigh"/><origin xyz="0 0.08 -0.06"/><axis xyz="0 1 0"/>
    <dynamics damping="0.2" friction="0.3"/></joint>
  <joint name="knee" type="continuous"><parent link="thigh"/><child link="shank"/><origin xyz="0 0 -0.25"/><axis xyz="0 1 0"/>
    <dynamics damping="0.1" friction="0.1"/></joint>
</robot>
"""
    with TemporaryDirectory() as folder:
        (Path(folder) / "leg.urdf").write_text(urdf)
        text = import_file(Path(folder) / "leg.urdf").text
    motors = "".join(f"  {joint}_motor: {{kind: joint_force, joint: {joint}, law: {law}}}\n" for joint, law in (
        ("abduction", "2*sin(9*t)"), ("flexion", "4*sin(6*t)"), ("knee", "1.5*sin(14*t)")))  # fmt: skip
    text = text.replace("outputs: [", f"{motors}outputs: [", 1).replace("carried: false}", "carried: false, presliding: 5 mm}")
    true = {
        "knee.at.z": -0.31, "flexion.at.z": -0.06, "thigh.mass": 1.2, "shank.mass": 0.5, "thigh.inertia.1": 0.008,
        "abduction.spring.damping": 0.2, "flexion.spring.damping": 0.2, "knee.spring.damping": 0.1, "flexion_friction.preload": 0.3,
        "knee_friction.preload": 0.1,
    }  # fmt: skip
    return Case(text=text, true=true, signals=("abduction.angle", "flexion.angle", "knee.angle"), dt=2e-3, end=1.2, every=4)


_CASES = {"press": _press, "delta": _delta, "corner": _corner, "leg": _leg}


class _Bench:
    """The solver of a case, whose data are replaced in place."""

    def __init__(self, case: Case, folder: Path, *, adaptive: bool = False) -> None:
        text = case.text
        if adaptive:
            scene = text.index("{end:", text.index("\nscenes:")) + 1
            text = f"{text[:scene]}numerics: {{solver_tolerance: {_TOLERANCE}}}, {text[scene:]}"
        (folder / "model.yaml").write_text(text)
        t = np.arange(0.0, case.end + case.dt / 2, case.dt * case.every)
        blank = np.column_stack([t, np.zeros((len(t), len(case.signals)))])
        np.savetxt(folder / "d.csv", blank, delimiter=",", header=",".join(["t", *map(str, range(len(case.signals)))]), comments="")
        signals = {name: {"column": str(i)} for i, name in enumerate(case.signals)}
        study = {
            "cutjoint_fit": 1, "model": str(folder / "model.yaml"), 
            **({"integrator": "dop853"} if adaptive else {"integrator": "rk4", "dt": case.dt}),
            "parameters": {n: {"start": x, "from": min(_LOW * x, _HIGH * x), "to": max(_LOW * x, _HIGH * x)} for n, x in case.true.items()},
            "experiments": {"run": {"data": str(folder / "d.csv"), "signals": signals, **case.experiment}},
        }  # fmt: skip
        self.notes: list[str] = []
        self.solver = Solver(read_fit(study), self.notes.append)
        self.true = self.solver.start.copy()
        self.clean = [p.values.copy() for p in self.solver.runs.predict(self.true)]

    def fit(self, start: Array, rng: Any = None) -> Fit:
        """The fit from a start to clean data, or to data with noise of 1 %."""
        solver = self.solver
        for signal, values in zip(solver.signals, self.clean, strict=True):
            signal.values[:] = values if rng is None else values + 0.01 * np.std(values) * rng.normal(size=len(values))
        solver.start, solver.sizes, solver.kept = start, np.abs(start), (b"", (np.zeros(0), np.zeros((0, 0))))
        solver.deviations = np.array([np.std(s.values) for s in solver.signals])
        solver.runs.share = 1.0
        return solver.solve(Path())


def main() -> None:
    """Print the figures of models."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("models", nargs="+", choices=_CASES)
    parser.add_argument("--sets", type=int, default=100)
    parser.add_argument("--other", action="store_true", help="data by other simulators")
    given = parser.parse_args()
    print(provenance(), flush=True)
    for name in given.models:
        with TemporaryDirectory() as folder:
            case = _CASES[name]()
            bench = _Bench(case, Path(folder), adaptive=given.other)
            _other(name, case, bench, given.sets) if given.other else _study(name, bench, given.sets)


def _study(name: str, bench: _Bench, sets: int) -> None:
    rng, true = np.random.default_rng(0), bench.true
    _recover(name, bench, [true * (1 + 0.2 * rng.choice([-1, 1], size=len(true))) for _ in range(10)], "20 % off")
    _recover(name, bench, [true * (1 + rng.uniform(-_REACH, _REACH, size=len(true))) for _ in range(sets)], "up to 50 % off")
    covered, verdicts, begin = [], list[str](), process_time()
    for _ in range(sets):
        found = bench.fit(true * (1 + 0.1 * rng.choice([-1, 1], size=len(true))), rng)
        covered.append((found.intervals[:, 0] <= true) & (true <= found.intervals[:, 1]))
        verdicts.append(found.verdict)
    each = ", ".join(f"{name} {100 * x:.3g}" for name, x in zip(found.names, np.mean(covered, axis=0), strict=True))
    print(f"{name}: 95 % intervals cover in {100 * np.mean(covered):.3g} of 100 over {sets} data sets with 1 % noise; {each}", flush=True)
    counted = ", ".join(f"{verdict} {verdicts.count(verdict)}" for verdict in sorted(set(verdicts)))
    print(f"  {counted}; CPU time {process_time() - begin:.3g} s", flush=True)


def _other(name: str, case: Case, bench: _Bench, sets: int) -> None:
    """Fits to another simulator's run."""
    from cutjoint_bench.studies.recovery_peers import other_run

    times = np.arange(0.0, case.end + case.dt / 2, case.dt * case.every)
    simulator, data, own, gap = other_run(name, case.true, times)
    beside = max(float(np.abs(a - b).max() / np.std(b)) for a, b in zip(bench.clean, data, strict=True))
    print(f"{name}: {simulator}: signals change by {own.max():.2g} of their standard deviations by its own refinement, loops gape by "
          f"{gap:.1g} m; ours at the true values differ by {beside:.2g}", flush=True)  # fmt: skip
    bench.clean, rng = [*data], np.random.default_rng(0)
    found = []
    for _ in range(sets):
        try:
            found.append(bench.fit(bench.true * (1 + 0.2 * rng.choice([-1, 1], size=len(bench.true)))))
        except CutjointError as error:
            print(f"  failed: {error}", flush=True)
    apart = np.abs([fit.values / bench.true - 1 for fit in found])
    iterations = sorted(fit.iterations for fit in found)
    print(f"  {len(found)} of {sets} starts 20 % off: largest relative error {apart.max():.2g}; iterations {iterations}; "
          f"{', '.join(f'{n} {x:.1g}' for n, x in zip(found[0].names, apart.max(axis=0), strict=True))}", flush=True)  # fmt: skip


def _recover(name: str, bench: _Bench, starts: list[Array], words: str) -> None:
    """Fits to clean data."""
    iterations, errors, begin = [], [], process_time()
    for start in starts:
        try:
            found = bench.fit(start)
        except CutjointError as error:
            errors.append(np.inf)
            print(f"  failed: {error}", flush=True)
            continue
        iterations.append(found.iterations)
        errors.append(float(np.abs(found.values / bench.true - 1).max()))
        if errors[-1] > _FOUND:
            shares = zip(found.names, start / bench.true, found.values / bench.true, strict=True)
            print(f"  {found.verdict}, {', '.join(f'{n} {a:.2f} {b:.2f}' for n, a, b in shares)}", flush=True)
    reached = [error for error in errors if error < _FOUND]
    print(f"{name}: starts {words}: {len(reached)} of {len(starts)} end at the true values, with relative errors up to {max(reached):.2g}; "
          f"iterations: median {np.median(iterations):g}, 95 of 100 at most {np.quantile(iterations, 0.95):.3g}, all {max(iterations)}; "
          f"CPU time {process_time() - begin:.3g} s", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
