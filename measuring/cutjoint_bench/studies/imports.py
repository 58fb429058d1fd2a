"""URDF files with loops as imported, beside Pinocchio, which reads them itself.

Each file is imported without its dampers and friction, with a fixed joint for each floating one and hinges in a row for the balls and
Cardan joints of a YAML beside it, and put into random poses that close its loops, at random speeds: Pinocchio has the joints' coordinates
and rates there.  "place" and "acceleration" are the largest differences of
centres of mass, the latter by the largest acceleration there.  "by rank" are the degrees_of_freedom that the rank of Pinocchio's
constraints leaves. "singular" are states near a singular pose, where the singular values of the constraints are as 500 to 1 or worse; these
have a column of their own.  "light" and "heavy" are the least and the largest eigenvalue of the mass matrix of the free motions, kg or kg
m2.

From the first state the machine runs for a second.  "gap" is the largest distance of two points that a loop holds together, "slip" the
largest speed that breaks a constraint, "energy" the largest change of the mechanical energy as a share of the largest kinetic one, at the
rows of that run; Pinocchio has these from the file's numbers.  If that is more than 1e-6, it runs again with a bound of the penalties, from
100 down by tens, and "bound" is the first with which it is not.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from xml.etree import ElementTree

import click
import numpy as np
import sympy
import yaml
from numpy.typing import NDArray

from cutjoint.analysis.closing import close_loops, design_coordinates, retract
from cutjoint.analysis.mobility import find_mobility
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.importing.closing import close
from cutjoint.importing.document import Document
from cutjoint.importing.robot import Joint, roll_pitch_yaw
from cutjoint.importing.urdf import read_urdf
from cutjoint.package.errors import CutjointError, RunError
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from cutjoint.topology.reading import read_model_text
from cutjoint_bench.robots import PinocchioRobot, Solution
from cutjoint_bench.studies.provenance import provenance

_HEAD = ("file", "bodies", "joints", "degrees of freedom", "by rank", "states", "place, m", "acceleration", "singular", "there", "light",
         "heavy", "gap, m", "slip", "energy", "bound", "ends")  # fmt: skip

#: States whose constraints are worse conditioned are near a singular pose.
_CONDITION = 500
#: The largest step to a random pose, rad or m, in the coordinate that moves most.
_STEP = 0.25
_TRIALS = 10
#: The change of energy that is wanted, and bounds of the penalties that are tried where it is larger.
_WANTED, _BOUNDS = 1e-6, (100.0, 10.0, 1.0, 0.1)

Array = NDArray[np.float64]
Coordinates = dict[str, tuple[float, float]]


def files_of(paths: tuple[Path, ...]) -> Iterator[Path]:
    """The URDF files among paths and below folders, sorted."""
    for path in paths:
        yield from sorted(path.rglob("*.urdf")) if path.is_dir() else [path]


def undamped(path: Path, folder: Path) -> Path:
    """A copy of a file without dampers, friction and floating joints, with the YAML of its loops, whose joints are hinges in it."""
    tree = ElementTree.parse(path)
    target, beside = folder / path.name, path.with_suffix(".yaml")
    if beside.is_file():
        data = yaml.safe_load(beside.read_text())
        for name, kind in zip(data.pop("joint_name", ()), data.pop("joint_type", ()), strict=True):
            write_out(tree.getroot(), name, "XYZ" if kind == "SPHERICAL" else kind.removeprefix("UJOINT_").replace("FIXED", ""))
        target.with_suffix(".yaml").write_text(yaml.safe_dump(data))
    for joint in tree.getroot().findall("joint"):
        joint.set("type", "fixed" if joint.get("type") == "floating" else joint.get("type", ""))
        for dynamics in joint.findall("dynamics"):
            joint.remove(dynamics)
    tree.write(target)
    return target


def hold(path: Path, joints: Collection[str]) -> None:
    """Make joints of a file fixed ones: those that carry nothing with mass, which the import leaves out."""
    tree = ElementTree.parse(path)
    for joint in tree.getroot().findall("joint"):
        if joint.get("name") in joints:
            joint.set("type", "fixed")
    if joints:
        tree.write(path)


def write_out(root: ElementTree.Element, name: str, axes: str) -> None:
    """Make hinges about ``axes`` of its frame of a joint, with links without mass between them; without axes a fixed joint."""
    joint = next(joint for joint in root.findall("joint") if joint.get("name") == name)
    for old in joint.findall("axis"):
        joint.remove(old)
    joint.set("type", "continuous" if axes else "fixed")
    while len(axes) > 1:
        after = ElementTree.SubElement(root, "joint", name=f"{name}_{axes[1].lower()}", type="continuous")
        between, child = ElementTree.SubElement(root, "link", name=f"{name}_behind_{axes[0].lower()}"), joint.find("child")
        assert child is not None
        ElementTree.SubElement(after, "parent", link=str(between.get("name")))
        ElementTree.SubElement(after, "child", link=str(child.get("link")))
        child.set("link", str(between.get("name")))
        joint.set("name", f"{name}_{axes[0].lower()}" if joint.get("name") == name else str(joint.get("name")))
        ElementTree.SubElement(joint, "axis", xyz=" ".join("01"[c == axes[0]] for c in "XYZ"))
        joint, axes = after, axes[1:]
    if axes:
        ElementTree.SubElement(joint, "axis", xyz=" ".join("01"[c == axes] for c in "XYZ"))


class Subject:
    """A file as imported and compiled, and the same file in Pinocchio, in which joints that carry no mass are made fixed."""

    def __init__(self, path: Path) -> None:
        robot, root = read_urdf(path)
        joints = set(robot.joints)
        robot.leave_out_idle()
        hold(path, joints - robot.joints.keys())
        self.oracle = PinocchioRobot(path)
        robot.join_balls()
        self.robot, self.closed = robot, close(robot)
        self.document = Document(robot, self.closed, path.parent, free=False)
        text = self.document.text(path.name, root.left_out())
        bare = "\n".join(line for line in text.splitlines() if not line.startswith(("outputs:", "scenes:", "  motion:")))
        columns = ", ".join(self._columns())
        model = read_model_text(f"{bare}\noutputs: [{columns}]\nscenes: {{motion: {{end: 1}}}}\n", "model.yaml")
        self.artifact = compile_interpreted(model, model.scenes["motion"])
        self.equations = formulate_recursive(self.artifact.topology, self.artifact.scene, ())
        self.freedom = find_mobility(self.equations).degrees_of_freedom

    def _columns(self) -> Iterator[str]:
        for joint, name in self.document.joints.items():
            if coordinate := COORDINATE.get(self.robot.joints[joint].kind):
                yield from (f"{name}.{coordinate}", f"{name}.{coordinate}_rate")
        for body in self.document.bodies.values():
            yield from (f"{body}.{q}" for q in ("x", "y", "z", "ax", "ay", "az", "roll", "pitch", "yaw", "wx", "wy", "wz"))

    def states(self, count: int, seed: int) -> Iterator[Artifact]:
        """The machine in random poses that close its loops, at random speeds that keep them closed."""
        random, design = np.random.default_rng(seed), design_coordinates(self.equations)
        start = close_loops(self.equations, design)
        for _ in range(count if start else 0):
            assert start is not None
            found = next(filter(None, (self._near(start, random) for _ in range(_TRIALS))), start)
            q, free = found[0].copy(), _free(found[1])
            speeds = free @ random.uniform(-1, 1, free.shape[1])
            charts = self.equations.charts
            for chart in charts:
                if chart.ball and chart.reversed:  # a scene gives the follower's attitude beside the base
                    q[chart.q + chart.scalars + 1 :][:3] *= -1
            places = {f"{c.joint}.{x}": sympy.Float(q[c.q + i]) for c in charts for i, x in enumerate(c.coordinate_names)}
            rates = {f"{c.joint}.{x}": sympy.Float(speeds[c.v + i]) for c in charts for i, x in enumerate(c.speed_names)}
            yield replace(self.artifact, scene=replace(self.artifact.scene, positions=places, rates=rates))

    def _near(self, start: tuple[Array, Array], random: np.random.Generator) -> tuple[Array, Array] | None:
        free = _free(start[1])
        way = free @ random.standard_normal(free.shape[1])
        return close_loops(self.equations, retract(self.equations, start[0], random.uniform(0, _STEP) * way / np.abs(way).max()))

    def coordinates(self, run: Trajectory, row: int) -> Coordinates:
        """Coordinates and rates of the file's joints."""
        found: Coordinates = {}
        for joint, name in self.document.joints.items():
            if joint in self.robot.balls:
                found |= self._hinges(joint, run, row)
            elif coordinate := COORDINATE.get(self.robot.joints[joint].kind):
                place, rate = (float(run[f"{name}.{coordinate}{end}"][row]) for end in ("", "_rate"))
                found[joint] = place + float(self.closed.q[joint][0]), rate
        return found

    def _hinges(self, ball: str, run: Trajectory, row: int) -> Coordinates:
        """The angles and rates of the three hinges of a ball, from the attitudes and spins of its bodies."""
        joint, hinges = self.robot.joints[ball], self.robot.balls[ball]
        first, second = (self._attitude(link, run, row) for link in (joint.parent, joint.child))
        angles = solve_angles(hinges, first[0].T @ second[0])
        axes = axes_of(hinges, angles)
        rates = np.linalg.solve(axes, first[0].T @ (second[1] - first[1]))
        return {hinge.name: (float(x), float(rate)) for hinge, x, rate in zip(hinges, angles, rates, strict=True)}

    def _attitude(self, link: str, run: Trajectory, row: int) -> tuple[Array, Array]:
        body, design = self.document.carriers[link], self.closed.poses[link].rotation
        if body == "ground":
            return design, np.zeros(3)
        turned = roll_pitch_yaw(tuple(float(run[f"{body}.{angle}"][row]) for angle in ("roll", "pitch", "yaw")))
        return turned @ design, np.array([run[f"{body}.w{c}"][row] for c in "xyz"])

    def solve(self, run: Trajectory, row: int) -> Solution:
        """Pinocchio's answer at a row."""
        return self.oracle.solve(*self.oracle.state(self.coordinates(run, row)))


COORDINATE: Mapping[str, str] = {"revolute": "angle", "prismatic": "displacement"}


def _free(jacobian: Array) -> Array:
    """The speeds that equations leave free, as columns."""
    _, values, vectors = np.linalg.svd(jacobian, full_matrices=True)
    return np.asarray(vectors[int((values > 1e-9 * values.max(initial=0.0)).sum()) :].T)


def turned(hinges: list[Joint], angles: Array) -> Array:
    """The rotation (3 by 3) of hinges in a row."""
    rotation = np.eye(3)
    for hinge, angle in zip(hinges, angles, strict=True):
        rotation = rotation @ hinge.moved(np.array([angle])).rotation
    return rotation


def axes_of(hinges: list[Joint], angles: Array) -> Array:
    """The axes of hinges in a row, in the frame before the first, as columns."""
    rotation, axes = np.eye(3), []
    for hinge, angle in zip(hinges, angles, strict=True):
        axes.append(rotation @ hinge.origin.rotation @ hinge.axis)
        rotation = rotation @ hinge.moved(np.array([angle])).rotation
    return np.array(axes).T


def solve_angles(hinges: list[Joint], wanted: Array) -> Array:
    """The angles at which hinges in a row give a rotation (3 by 3), by Newton's method from one of several starts."""
    for start in np.vstack([np.zeros(3), np.random.default_rng(0).uniform(-2, 2, (20, 3))]):
        angles = start
        for _ in range(50):
            apart = wanted @ turned(hinges, angles).T
            vector = np.array([apart[2, 1] - apart[1, 2], apart[0, 2] - apart[2, 0], apart[1, 0] - apart[0, 1]]) / 2
            if np.abs(apart - np.eye(3)).max() < 1e-14:
                break
            angles = angles + np.linalg.lstsq(axes_of(hinges, angles), vector, rcond=None)[0]
        if np.abs(wanted - turned(hinges, angles)).max() < 1e-13:
            return np.asarray(angles)
    raise CutjointError("three hinges are locked")


@dataclass
class Worst:
    """The largest differences at a file's states; degrees of freedom are those of the oracle."""

    singular: int = 0
    place: float = 0.0
    acceleration: float = 0.0
    there: float = 0.0
    light: float = np.inf
    heavy: float = 0.0
    degrees_of_freedom: set[int] = field(default_factory=set)

    def take(self, subject: Subject, run: Trajectory) -> None:
        """Compare the first row of a run."""
        solution = subject.solve(run, 0)
        largest = max(1.0, *(float(np.abs(a).max()) for a in solution.accelerations.values()))
        regular = solution.condition < _CONDITION
        self.singular += not regular
        for link, body in subject.document.bodies.items():
            if link in solution.places:
                place, acceleration = (np.array([run[f"{body}.{p}{c}"][0] for c in "xyz"]) for p in ("", "a"))
                self.place = max(self.place, float(np.abs(place - solution.places[link]).max()))
                apart = float(np.abs(acceleration - solution.accelerations[link]).max()) / largest
                self.acceleration = max(self.acceleration, apart if regular else 0.0)
                self.there = max(self.there, 0.0 if regular else apart)
        self.degrees_of_freedom.add(solution.freedom)
        self.light, self.heavy = min(self.light, solution.light), max(self.heavy, solution.heavy)


def begin(artifact: Artifact, tolerance: float, end: float, rows: int = 1, penalty: float | None = None) -> Trajectory:
    """A run from a state.  Raises RunError where it has no start."""
    scene = replace(artifact.scene, end=end, output_step=end / rows if end else 1.0)
    scene = replace(scene, numerics=replace(scene.numerics, penalty=penalty, closure="solved"))
    run = simulate(replace(artifact, scene=scene), integrator="dormand-prince", tolerance=tolerance, error=False, check=False)
    if not len(run.t):
        raise RunError(f"no start: {run.failure}")
    return run


def energy_of(solutions: list[Solution]) -> float:
    """The largest change of the mechanical energy as a share of the largest kinetic one."""
    return float(np.ptp([s.energy for s in solutions])) / max(s.kinetic for s in solutions)


def compare(path: Path, count: int, rows: int, seed: int, tolerance: float) -> tuple[str, ...]:
    """The figures of a file."""
    with TemporaryDirectory() as folder:
        subject = Subject(undamped(path, Path(folder)))
    if not any(joint.freedom for joint in subject.robot.joints.values()):
        raise CutjointError("has no joint that moves")
    worst, states = Worst(), list(subject.states(count, seed))
    for state in states:
        worst.take(subject, begin(state, tolerance, 0.0))
    runs = []
    for bound in (None, *_BOUNDS):
        run = begin(states[0], tolerance, 1.0, rows, bound)
        solutions = [subject.solve(run, row) for row in range(len(run.t))]
        runs.append(f"{energy_of(solutions):.1e}, {run.steps} steps")
        if energy_of(solutions) < _WANTED:
            break
    return (
        str(len(subject.document.bodies)), str(len(subject.document.joints)), str(subject.freedom),
        " ".join(map(str, sorted(worst.degrees_of_freedom))), str(len(states)), f"{worst.place:.1e}", f"{worst.acceleration:.1e}",
        str(worst.singular), f"{worst.there:.1e}" if worst.singular else "", f"{worst.light:.1e}", f"{worst.heavy:.1e}",
        f"{max(s.gap for s in solutions):.1e}", f"{max(s.slip for s in solutions):.1e}", "; ".join(dict.fromkeys((runs[0], runs[-1]))),
        "" if bound is None else f"{bound:g}", "" if run.failure is None else f"{run.failure}"[:90],
    )  # fmt: skip


@click.command()
@click.argument("paths", nargs=-1, required=True, type=click.Path(exists=True, path_type=Path))
@click.option("--states", default=20, show_default=True, help="Random states of each file.")
@click.option("--rows", default=10, show_default=True, help="Of the run, besides its start.")
@click.option("--seed", default=1, show_default=True, help="Of poses and speeds.")
@click.option("--tolerance", default=1e-10, show_default=True, help="Of the steps, by dormand-prince.")
@click.option("--out", type=click.Path(path_type=Path), help="Markdown file for the table and its provenance.")
def main(paths: tuple[Path, ...], states: int, rows: int, seed: int, tolerance: float, out: Path | None) -> None:
    """Print the table of URDF files, those named and those below folders, in Markdown."""
    lines = [f"| {' | '.join(_HEAD)} |", "|---" * len(_HEAD) + "|"]
    click.echo("\n".join([provenance(), "", *lines]))
    for path in files_of(paths):
        began, name = perf_counter(), f"{path.parent.name}/{path.name}"
        try:
            cells = compare(path, states, rows, seed, tolerance)
        except CutjointError as error:
            cells = (" ".join(str(error).split())[:100],)
        lines.append(f"| {' | '.join((name, *cells))} |")
        click.echo(lines[-1])
        click.echo(f"{name}: {perf_counter() - began:.0f} s", err=True)
    if out is not None:
        out.write_text("\n".join([provenance(), "", *lines, ""]), encoding="utf-8")


if __name__ == "__main__":
    main()
