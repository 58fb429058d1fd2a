"""Figures of the Iltis: records, and the functions that fill them.  Nothing here prints, nothing asserts."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cutjoint.analysis.mobility import Mobility, find_mobility
from cutjoint.compile.pipeline import compile_model
from cutjoint.model.read import read_model
from cutjoint.model.records import Output
from cutjoint.package.locations import __version__
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint.run.roads import profile_pieces
from cutjoint.run.simulation import simulate
from cutjoint.tasks.states import find_equilibrium
from cutjoint_bench.generic.artifact import compile_generic_model
from cutjoint_bench.generic.build import measuring_digest
from cutjoint_bench.machine import machine
from cutjoint_bench.studies.checkout import DATA, MODELS

MODEL = MODELS / "iltis.yaml"
GRAVITY = 9.81
CORNERS = ("front_left", "front_right", "rear_left", "rear_right")

#: The scenes of Cuadrado et al. (2000) and their steps in the recursive method, s.
SCENES: Mapping[str, float] = {"simul1": 0.0075, "simul1s": 0.0025, "simul2": 0.0075, "simul3": 0.0075}

#: The contenders: generated code as it is by default, the same without lanes, the generic solver.
GENERATED, SCALAR, GENERIC = IMPLEMENTATIONS = ("generated", "without lanes", "generic solver")

#: Step for peak values that have settled, s.
FINE = 0.0005

#: Static equilibrium of the IAVSD benchmark (Robotran model, 18c4286): column, unit, factor to the unit, published value.
EQUILIBRIUM: Sequence[tuple[str, str, float, float]] = (
    ("chassis.z", "mm", 1e3, -7.083),
    ("chassis.pitch", "deg", 180 / math.pi, 0.1465),
    ("front_left.tyre.Fz", "N", 1, 3831.31),
    ("rear_left.tyre.Fz", "N", 1, 3591.91),
    ("front_left.shock.force", "N", 1, -335.29),
    ("rear_left.shock.force", "N", 1, -241.64),
    ("front_left.leaf.force", "N", -1, -3068.62),  # published in tension, ours is a push
    ("rear_left.leaf.force", "N", -1, -2885.51),
    ("front_left.leaf_axial.force", "N", 1, -1408.51),
    ("rear_left.leaf_axial.force", "N", 1, -1335.52),
)

#: Height of the chassis' centre of mass in the design position, m.
DESIGN_HEIGHT = 0.570

#: Scenes of the IAVSD benchmark and their trajectories.
REFERENCES: Mapping[str, str] = {"iavsd_inphase_5": "iavsd_inphase_5ms.csv", "iavsd_sine_2mm": "iavsd_sine_steer_2mm.csv"}

#: The reference's wheels: front a is the right one, rear a the left one.
WHEELS = {"front_right": "Fz_front_a", "front_left": "Fz_front_b", "rear_left": "Fz_rear_a", "rear_right": "Fz_rear_b"}


@dataclass(frozen=True, kw_only=True)
class Compared:
    """One value beside the published one, both in ``unit``."""

    quantity: str
    unit: str
    found: float
    published: float


@dataclass(frozen=True, kw_only=True)
class Difference:
    """The largest difference from a published trajectory, and the range of the reference itself."""

    scene: str
    quantity: str
    unit: str
    difference: float
    range: float


@dataclass(frozen=True, kw_only=True)
class Race:
    """Runs of one scene in turns, A B C A B C: seconds of the steps by implementation.

    ``apart`` is the largest difference of the chassis' height from that of the generated code, m; ``peak_az`` and ``peak_ay`` are in g at
    the scene's step, ``fine_az`` at 0.5 ms.
    """

    scene: str
    dt: float
    simulated: float
    steps: int
    evaluations: Mapping[str, int]
    operations: int
    instructions: int
    source: str
    seconds: Mapping[str, tuple[float, ...]]
    apart: Mapping[str, float]
    peak_az: float
    peak_ay: float
    fine_az: float

    def evaluation_times(self, implementation: str) -> list[float]:
        """Seconds an evaluation, run by run; the integrator's share is in it."""
        return [x / self.evaluations[implementation] for x in self.seconds[implementation]]

    def real_time_factors(self, implementation: str) -> list[float]:
        """Simulated over computing time, run by run."""
        return [self.simulated / x for x in self.seconds[implementation]]

    def ratios(self, implementation: str) -> list[float]:
        """Its time over that of the generated code, turn by turn."""
        return [b / a for a, b in zip(self.seconds[GENERATED], self.seconds[implementation], strict=True)]

    def ratio_of_least(self, implementation: str) -> float:
        """Its least time over the least of the generated code: what other work on the machine disturbs least."""
        return min(self.seconds[implementation]) / min(self.seconds[GENERATED])


@dataclass(frozen=True, kw_only=True)
class Peak:
    """Peak vertical acceleration of the chassis in g, and the place of the centre of mass where it occurs, m."""

    speed: float
    dt: float
    peak_az: float
    x: float


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """Provenance of the figures."""

    cutjoint: str
    machine: str
    compiler: str
    flags: str
    runtime: str
    repetitions: int


def measure_equilibrium() -> list[Compared]:
    """The static equilibrium beside the published one."""
    found = find_equilibrium(MODEL, scene="iavsd_equilibrium")
    return [
        Compared(
            quantity="chassis dz" if column == "chassis.z" else column, unit=unit,
            found=factor * (found[column] - (DESIGN_HEIGHT if column == "chassis.z" else 0)), published=published,
        )
        for column, unit, factor, published in EQUILIBRIUM
    ]  # fmt: skip


def compare_with_references() -> list[Difference]:
    """The largest differences from the published trajectories."""
    return [d for scene, file in REFERENCES.items() for d in _compare(scene, _read_reference(DATA / file))]


def _read_reference(path: Path) -> dict[str, np.ndarray]:
    lines = [x for x in path.read_text(encoding="utf-8").splitlines() if not x.startswith("#")]
    table = np.array([[float(x) for x in line.split(",")] for line in lines[1:]])
    return {name: table[:, i] for i, name in enumerate(lines[0].split(","))}


def _compare(scene: str, reference: Mapping[str, np.ndarray]) -> Iterator[Difference]:
    run, slope = _run_with_derivatives(scene)
    found = {f"chassis.{axis}": (run[f"chassis.{axis}"], axis, "mm", 1e3) for axis in "yz"}
    found |= {f"chassis.{name}": (angle, name, "deg", 180 / math.pi) for name, angle in _turned_about_x_first(run).items()}
    for corner, column in WHEELS.items():
        found[f"{corner}.tyre.Fz"] = (run[f"{corner}.tyre.Fz"] / np.sqrt(1 + slope[corner] ** 2), column, "N", 1.0)
    for quantity, (ours, theirs, unit, factor) in found.items():
        difference = np.interp(reference["t"], run.t, ours) - reference[theirs]
        yield Difference(
            scene=scene, quantity=quantity, unit=unit, difference=factor * float(np.abs(difference).max()),
            range=factor * float(np.ptp(reference[theirs])),
        )  # fmt: skip


def _run_with_derivatives(name: str) -> tuple[Trajectory, dict[str, np.ndarray]]:
    """A run, and the road's slope under each wheel: the reference has vertical wheel loads, ours are along the road's normal."""
    model = read_model(MODEL)
    scene = model.scenes[name]
    hubs = [Output(element=f"{corner}.carrier", quantity="x", span=scene.span) for corner in CORNERS]
    run = completed(simulate(compile_model(MODEL, scene=name, outputs=[*scene.outputs, *hubs])))
    pieces = profile_pieces(scene.road.left, scene.road.start)

    def height(x: float) -> float:
        return next((p for p in reversed(pieces) if p.start <= x), pieces[0]).height(x)

    def slope(x: float) -> float:
        return (height(x + 1e-6) - height(x - 1e-6)) / 2e-6

    return run, {corner: np.array([slope(x) for x in run[f"{corner}.carrier.x"]]) for corner in CORNERS}


def _turned_about_x_first(run: Trajectory) -> dict[str, np.ndarray]:
    """Roll, pitch, yaw as the reference counts them, R = R_x R_y R_z; ours are those of R = R_z R_y R_x."""
    (sr, cr), (sp, cp), (sy, cy) = ((np.sin(run[f"chassis.{a}"]), np.cos(run[f"chassis.{a}"])) for a in ("roll", "pitch", "yaw"))
    return {
        "roll": np.arctan2(cy * sr - sy * sp * cr, cp * cr),
        "pitch": np.arcsin(cy * sp * cr + sy * sr),
        "yaw": np.arctan2(sy * cr - cy * sp * sr, cy * cp),
    }


def compile_scenes() -> dict[str, dict[str, Artifact]]:
    """All simulators of the paper's scenes, built before anything is timed."""
    return {
        scene: {
            GENERATED: compile_model(MODEL, scene=scene),
            SCALAR: compile_model(MODEL, scene=scene, lanes=False),
            GENERIC: compile_generic_model(MODEL, scene=scene),
        }
        for scene in SCENES
    }


def find_counts(artifact: Artifact) -> Mobility:
    """Coordinates, cut-joint equations and their rank."""
    return find_mobility(artifact.mechanism)


def race(scene: str, artifacts: Mapping[str, Artifact], repetitions: int, tick: Callable[[], None]) -> Race:
    """One run each to warm up, whose results are compared, then the timed turns; ``tick`` is called after each."""
    dt, generated = SCENES[scene], artifacts[GENERATED]
    warm = {name: completed(every_step(artifact, dt)) for name, artifact in artifacts.items()}
    first = warm[GENERATED]
    seconds: dict[str, list[float]] = {name: [] for name in artifacts}
    for _ in range(repetitions):
        for name, artifact in artifacts.items():
            seconds[name].append(completed(simulate(artifact, dt=dt, error=False)).seconds)
        tick()
    return Race(
        scene=scene, dt=dt, simulated=float(first.t[-1] - first.t[0]), steps=first.steps,
        evaluations={name: run.evaluations for name, run in warm.items()},
        operations=generated.program.operations("evaluate"), instructions=generated.program.instructions("evaluate"),
        source=generated.source.digest[:16], seconds={name: tuple(times) for name, times in seconds.items()},
        apart={name: float(np.abs(run["chassis.z"] - first["chassis.z"]).max()) for name, run in warm.items()},
        peak_az=_peak(first, "chassis.az"), peak_ay=_peak(first, "chassis.ay"),
        fine_az=_peak(completed(every_step(generated, FINE)), "chassis.az"),
    )  # fmt: skip


def measure_steps(artifact: Artifact) -> list[Peak]:
    """Peak acceleration of simul1 at 5 m/s over the step."""
    return [_peak_at(artifact, 5.0, dt) for dt in (0.0075, 0.004, 0.002, 0.001, 0.0005, 0.00025)]


def measure_speeds(artifact: Artifact) -> list[Peak]:
    """Peak acceleration of simul1 over the speed that is held; 60 m of road each, from 5 m/s on the flat."""
    return [_peak_at(artifact, float(speed), 0.001) for speed in np.arange(4.0, 6.01, 0.25)]


def _peak_at(artifact: Artifact, speed: float, dt: float) -> Peak:
    run = completed(every_step(artifact, dt, end=12 * 5 / speed, parameters={"speed": speed}))
    row = int(run["chassis.az"].argmax())
    return Peak(speed=speed, dt=dt, peak_az=float(run["chassis.az"][row]) / GRAVITY, x=float(run["chassis.x"][row]))


def every_step(artifact: Artifact, dt: float, *, end: float | None = None, parameters: Mapping[str, float] | None = None) -> Trajectory:
    """A run that reports every step, so that no peak falls between two rows."""
    return simulate(replace(artifact, scene=replace(artifact.scene, output_step=dt)), dt=dt, end=end, parameters=parameters, error=False)


def completed(run: Trajectory) -> Trajectory:
    """The run itself, if it reached its end.

    Raises:
        RuntimeError: it did not.
    """
    if run.failure is not None:
        raise RuntimeError(str(run.failure))
    return run


def _peak(run: Trajectory, column: str) -> float:
    return float(np.abs(run[column]).max()) / GRAVITY


def provenance(artifact: Artifact, repetitions: int) -> Provenance:
    """Machine, compiler, flags and versions; neither date, host nor path."""
    return Provenance(
        cutjoint=__version__, machine=", ".join(machine().values()), compiler=artifact.binary.compiler,
        flags=" ".join(artifact.binary.flags), runtime=measuring_digest()[:16], repetitions=repetitions,
    )  # fmt: skip


def spread(values: Sequence[float]) -> dict[str, float]:
    """Median, least and largest."""
    return {"median": statistics.median(values), "min": min(values), "max": max(values)}
