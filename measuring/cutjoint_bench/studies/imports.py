"""URDF files with loops as imported, beside Pinocchio, which reads them itself.

Each file is imported without its dampers and friction, with a fixed joint for each floating one, and runs for a second each from four
random poses with random speeds.  At rows of these runs Pinocchio has the joints' coordinates and rates.  "place" and "acceleration" are the
largest differences of centres of mass, the latter by the largest acceleration there.  "gap" is the largest distance of two points that a
loop holds together, "slip" the largest speed that breaks a constraint, "energy" the largest change of the mechanical energy as a share of
the largest kinetic one.  Pinocchio has these from the file's numbers.  "by rank" are the freedoms that the rank of its constraints leaves,
"singular" are states near a singular pose, whose accelerations do not count.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from shutil import copy
from tempfile import TemporaryDirectory
from xml.etree import ElementTree

import click
import numpy as np
from rich.console import Console
from rich.table import Table

from cutjoint.analysis.closing import explore
from cutjoint.analysis.mobility import find_mobility
from cutjoint.compile.pipeline import compile_interpreted
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.importing.document import Imported, import_file
from cutjoint.package.errors import CutjointError
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from cutjoint.topology.build import build_topology
from cutjoint.topology.reading import read_model_text
from cutjoint_bench.robots import PinocchioRobot
from cutjoint_bench.studies.provenance import provenance

_HEAD = (
    "file",
    "bodies",
    "joints",
    "freedoms",
    "by rank",
    "states",
    "singular",
    "place, m",
    "acceleration",
    "gap, m",
    "slip",
    "energy",
    "ends",
)


#: States whose constraints are worse conditioned are near a singular pose; their accelerations are not compared.
_CONDITION = 1e4


def files_of(paths: tuple[Path, ...]) -> Iterator[Path]:
    """The URDF files among paths and below folders, sorted."""
    for path in paths:
        yield from sorted(path.rglob("*.urdf")) if path.is_dir() else [path]


def undamped(path: Path, folder: Path) -> Path:
    """A copy of a file without dampers, friction and floating joints, with the YAML of its loops."""
    tree = ElementTree.parse(path)
    for joint in tree.getroot().findall("joint"):
        joint.set("type", "fixed" if joint.get("type") == "floating" else joint.get("type", ""))
        for dynamics in joint.findall("dynamics"):
            joint.remove(dynamics)
    target = folder / path.name
    tree.write(target)
    if path.with_suffix(".yaml").is_file():
        copy(path.with_suffix(".yaml"), target.with_suffix(".yaml"))
    return target


def starts(imported: Imported, rows: int, seed: int) -> Iterator[Artifact]:
    """Interpreted runs of a second from poses that random steps along the free motions reach, with random speeds along these."""
    bare = "\n".join(line for line in imported.text.splitlines() if not line.startswith(("outputs:", "scenes:", "  motion:")))
    model = read_model_text(f"{bare}\nscenes: {{motion: {{end: 1}}}}\n", "model.yaml")
    kinds = {joint.name: joint.element for joint in model.joints}
    names = {name: kinds[name].coordinates[0] for name in imported.joints.values() if len(kinds[name].coordinates) == 1}
    columns = [f"{name}.{c}{suffix}" for name, c in names.items() for suffix in ("", "_rate")]
    columns += [f"{body}.{x}" for body in imported.bodies.values() for x in ("x", "y", "z", "ax", "ay", "az")]
    outputs = f"outputs: [{', '.join(columns)}]"
    model = read_model_text(f"{bare}\n{outputs}\nscenes: {{motion: {{end: 1}}}}\n", "model.yaml")
    equations = formulate_recursive(build_topology(model), model.scenes["motion"], ())
    random = np.random.default_rng(seed)
    for pose in explore(equations)[1:]:
        speeds = pose.free @ random.uniform(-1, 1, pose.free.shape[1])
        charts = equations.charts
        places = ", ".join(f"{c.joint}.{x}: {pose.q[c.q + i]!r}" for c in charts for i, x in enumerate(c.coordinate_names))
        rates = ", ".join(f"{c.joint}.{x}: {speeds[c.v + i]!r}" for c in charts for i, x in enumerate(c.speed_names))
        scene = f"{{end: 1, output_step: {1 / rows!r}, positions: {{{places}}}, rates: {{{rates}}}}}".replace("np.float64", "")
        begun = read_model_text(f"{bare}\n{outputs}\nscenes: {{motion: {scene.replace('(', '').replace(')', '')}}}\n", "model.yaml")
        yield compile_interpreted(begun, begun.scenes["motion"])


@dataclass
class Worst:
    """The largest differences of a file's runs; ``freedom`` is that of the oracle at each state."""

    states: int = 0
    singular: int = 0
    place: float = 0.0
    acceleration: float = 0.0
    gap: float = 0.0
    slip: float = 0.0
    energy: float = 0.0
    freedom: set[int] = field(default_factory=set)
    failures: list[str] = field(default_factory=list)

    def take(self, imported: Imported, oracle: PinocchioRobot, artifact: Artifact, tolerance: float) -> None:
        """Compare the rows of a run."""
        run = simulate(artifact, integrator="dormand-prince", tolerance=tolerance, error=False, check=False)
        if run.failure is not None:
            self.failures.append(str(run.failure)[:90])
        found = [oracle.solve(*oracle.state(coordinates(imported, run, row))) for row in range(len(run.t))]
        for row, solution in enumerate(found):
            largest = max(1.0, *(float(np.abs(a).max()) for a in solution.accelerations.values()))
            self.singular += solution.condition > _CONDITION
            for link, body in imported.bodies.items():
                if link in solution.places:
                    place, acceleration = (np.array([run[f"{body}.{p}{c}"][row] for c in "xyz"]) for p in ("", "a"))
                    self.place = max(self.place, float(np.abs(place - solution.places[link]).max()))
                    apart = float(np.abs(acceleration - solution.accelerations[link]).max()) / largest
                    self.acceleration = max(self.acceleration, apart if solution.condition < _CONDITION else 0.0)
            self.gap, self.slip = max(self.gap, solution.gap), max(self.slip, solution.slip)
            self.freedom.add(solution.freedom)
        self.states += len(found)
        if found:
            self.energy = max(self.energy, float(np.ptp([s.energy for s in found])) / max(s.kinetic for s in found))


def compare(path: Path, rows: int, seed: int, tolerance: float) -> tuple[str, ...]:
    """The figures of a file."""
    with TemporaryDirectory() as folder:
        copied = undamped(path, Path(folder))
        imported, oracle = import_file(copied), PinocchioRobot(copied)
    worst, freedom = Worst(), set[int]()
    for artifact in starts(imported, rows, seed):
        freedom.add(find_mobility(formulate_recursive(artifact.topology, artifact.scene, ())).degrees_of_freedom)
        worst.take(imported, oracle, artifact, tolerance)
    numbers = (worst.place, worst.acceleration, worst.gap, worst.slip, worst.energy)
    freedoms = [" ".join(map(str, sorted(found))) for found in (freedom, worst.freedom)]
    counts = map(str, (len(imported.bodies), len(imported.joints)))
    return (
        *counts,
        *freedoms,
        str(worst.states),
        str(worst.singular),
        *(f"{x:.1e}" for x in numbers),
        "; ".join(dict.fromkeys(worst.failures)),
    )


def coordinates(imported: Imported, run: Trajectory, row: int) -> dict[str, tuple[float, float]]:
    """Coordinates and rates of the file's joints."""
    found = {}
    for name, joint in imported.joints.items():
        c = next((c for c in ("angle", "displacement") if f"{joint}.{c}" in run), "")
        if c:
            found[name] = float(run[f"{joint}.{c}"][row] + imported.zero[name][0]), float(run[f"{joint}.{c}_rate"][row])
    return found


@click.command()
@click.argument("paths", nargs=-1, required=True, type=click.Path(exists=True, path_type=Path))
@click.option("--rows", default=5, show_default=True, help="Of each run, besides the start.")
@click.option("--seed", default=1, show_default=True, help="Of the random speeds.")
@click.option("--tolerance", default=1e-9, show_default=True, help="Of the steps, by dormand-prince.")
def main(paths: tuple[Path, ...], rows: int, seed: int, tolerance: float) -> None:
    """Print the table of URDF files, those named and those below folders."""
    console = Console(highlight=False, width=180)
    console.print(provenance(), markup=False)
    table = Table(*_HEAD)
    for path in files_of(paths):
        try:
            table.add_row(f"{path.parent.name}/{path.name}", *compare(path, rows, seed, tolerance))
        except CutjointError as error:
            table.add_row(f"{path.parent.name}/{path.name}", str(error)[:100])
    console.print(table)


if __name__ == "__main__":
    main()
