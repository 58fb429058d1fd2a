"""Starts at rest of random machines on contacts with friction, each verified by a run of a second.  `make starts`.

A machine has 1 to 20 contacts of stiffness 1e3 to 1e10 N/m^exponent, exponents 1 to 1.5, and gaps 1 um to 0.3 m between what is drawn and
the ground.  Its parts are masses on slides, arms, stacks on springs, and free bodies on three or four feet of different lengths.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from time import process_time

import click
import numpy as np

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.model.read import read_model_text
from cutjoint.package.errors import CutjointError
from cutjoint.run.run_file import find_trim
from cutjoint.run.simulation import simulate
from cutjoint_bench.studies.provenance import provenance

#: A run stays where no body moves further, m; each part is about a metre large.
STAYS = 1e-6

_G = 9.81
_LEG = """
submodels:
  contact_law: {include: library/contact_law}
  foot:
    connectors: [body]
    parameters: [x, y, z, k, n, mu]
    points: {P: [x, y, z]}
    forces: {sole: {kind: contact, bodies: [ground, body], at: [0, 0, 0], normal: z, centre: P, force: [grip.Fx, grip.Fy, grip.Fz]}}
    instances:
      grip:
        use: contact_law
        with: {deflection: sole.deflection, deflection_rate: sole.deflection_rate, vx: sole.vx, vy: sole.vy, stiffness: k, exponent: n,
          damping: 0.5, friction: mu}
"""


class _Machine:
    """The text of a random machine, part by part."""

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng([70, seed])
        lists: list[list[str]] = [[] for _ in range(5)]
        self._bodies, self._joints, self._forces, self._feet, self._outputs = lists
        self.contacts = int(self._rng.integers(1, 21))
        self.parts: list[str] = []
        while len(self._feet) < self.contacts:
            left = self.contacts - len(self._feet)
            kinds = [self._slide, self._arm, self._stack, *([self._table] if left > 2 else [])]
            kinds[self._rng.integers(len(kinds))](left)

    def text(self) -> str:
        """The model file."""
        sections = {"bodies": self._bodies, "joints": self._joints, "forces": self._forces, "instances": self._feet}
        listed = "".join(f"{name}:\n{''.join(lines)}" for name, lines in sections.items() if lines)
        outputs = f"outputs: [{', '.join(self._outputs)}]\n"
        return f"cutjoint: 1\nname: machine\ngravity: [0, 0, -{_G}]{_LEG}{listed}{outputs}scenes: {{rest: {{end: 1, trim: {{}}}}}}\n"

    def _log(self, least: float, largest: float) -> float:
        return float(np.exp(self._rng.uniform(np.log(least), np.log(largest))))

    def _begin(self, kind: str) -> tuple[str, float]:
        self.parts.append(kind)
        return f"p{len(self.parts)}", 5.0 * len(self.parts)

    def _foot(self, body: str, name: str, at: tuple[float, float, float], mass: float) -> None:
        """A foot that a mass presses in by 50 mm at most."""
        n = self._rng.uniform(1.0, 1.5)
        k = self._log(max(1e3, mass * _G / 0.05**n), 1e10)
        x, y, z = (f"{value:.9g}" for value in at)
        numbers = f"x: {x}, y: {y}, z: {z}, k: {k:.6g}, n: {n:.4f}, mu: {self._rng.uniform(0.2, 1.0):.3f}"
        self._feet.append(f"  {name}: {{use: foot, connect: {{body: {body}}}, with: {{{numbers}}}}}\n")

    def _body(self, name: str, mass: float, at: tuple[float, float, float]) -> None:
        x, y, z = (f"{value:.9g}" for value in at)
        size = ", ".join(f"{0.1 * mass * factor:.6g}" for factor in (1.0, 1.2, 1.4))
        self._bodies.append(f"  {name}: {{mass: {mass:.6g}, centre_of_mass: [{x}, {y}, {z}], inertia: [{size}]}}\n")
        self._outputs += [f"{name}.{axis}" for axis in "xyz"]

    def _joint(self, name: str, bodies: str, kind: str, at: tuple[float, float, float], axis: str = "") -> None:
        x, y, z = (f"{value:.9g}" for value in at)
        self._joints.append(f"  {name}: {{kind: {kind}, bodies: [{bodies}], at: [{x}, {y}, {z}]{axis and f', axis: {axis}'}}}\n")

    def _slide(self, _: int) -> None:
        name, x = self._begin("slide")
        mass, gap = self._log(0.1, 1e3), self._log(1e-6, 0.3)
        self._body(name, mass, (x, 0, 0.5 + gap))
        self._joint(f"{name}_j", f"ground, {name}", "prismatic", (x, 0, 0.5), "z")
        self._foot(name, f"{name}_f", (x, 0, gap), mass)

    def _arm(self, _: int) -> None:
        name, x = self._begin("arm")
        mass, gap, length = self._log(0.1, 1e3), self._log(1e-6, 0.3), self._rng.uniform(0.5, 2.0)
        self._body(name, mass, (x + length / 2, 0, 0.3 + gap))
        self._joint(f"{name}_j", f"ground, {name}", "revolute", (x, 0, 0.3 + gap), "y")
        self._foot(name, f"{name}_f", (x + length, 0, gap), mass)

    def _stack(self, _: int) -> None:
        """A platform on a contact, and a mass on a spring on the platform."""
        name, x = self._begin("stack")
        low, high, gap = self._log(0.1, 1e3), self._log(0.1, 1e3), self._log(1e-6, 0.3)
        stiffness = high * _G / self._log(1e-3, 0.1)
        self._body(name, low, (x, 0, 0.5 + gap))
        self._body(f"{name}_b", high, (x, 0, 1.5 + gap))
        self._joint(f"{name}_j", f"ground, {name}", "prismatic", (x, 0, 0.5), "z")
        self._joint(f"{name}_k", f"{name}, {name}_b", "prismatic", (x, 0, 1.0), "z")
        damping = 0.4 * np.sqrt(stiffness * high)
        law = f"{{stiffness: {stiffness:.6g}, damping: {damping:.6g}, free_position: drawn}}"
        self._forces.append(f"  {name}_s: {{kind: joint_force, joint: {name}_k, law: {law}}}\n")
        self._foot(name, f"{name}_f", (x, 0, gap), low + high)

    def _table(self, left: int) -> None:
        """A free body on three or four feet, whose lengths differ by up to a hundredth of its width."""
        name, x = self._begin("table")
        mass, gap, feet = self._log(0.1, 1e3), self._log(1e-6, 0.3), int(self._rng.integers(3, min(left, 4) + 1))
        width = self._rng.uniform(0.4, 1.5)
        shift = self._rng.uniform(-0.1, 0.1, 2) * width
        self._body(name, mass, (x + shift[0], shift[1], self._rng.uniform(0.2, 0.8) * width + gap))
        self._joint(f"{name}_j", f"ground, {name}", "free", (x, 0, gap))
        turned = self._rng.uniform(0, 2 * np.pi)
        for i in range(feet):
            angle, longer = turned + 2 * np.pi * i / feet, width * self._rng.uniform(0, 0.01)
            self._foot(name, f"{name}_f{i}", (x + 0.7 * width * np.cos(angle), 0.7 * width * np.sin(angle), gap + longer), mass)


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What came of a machine: ``kind`` is "stays", "moves", "fails" (its run) or "not found"; ``moved`` in m."""

    seed: int
    contacts: int
    parts: str
    kind: str
    said: str = ""
    moved: float = 0.0
    found_seconds: float = 0.0
    run_seconds: float = 0.0


def machine_text(seed: int) -> str:
    """The model file of a random machine."""
    return _Machine(seed).text()


def try_machine(seed: int) -> Outcome:
    """Find the rest of a machine, and run it for a second from there."""
    machine = _Machine(seed)
    parts = ", ".join(f"{count} {kind}" for kind, count in Counter(machine.parts).items())
    outcome = Outcome(seed=seed, contacts=machine.contacts, parts=parts, kind="not found")
    model, begun = read_model_text(machine.text(), f"machine_{seed}.yaml"), process_time()
    try:
        model, start, _ = find_trim(model, model.scenes["rest"], {})
    except CutjointError as error:
        return replace(outcome, said=str(error), found_seconds=process_time() - begun)
    found, begun = process_time() - begun, process_time()
    run = simulate(compile_interpreted(model, start), error=False, tolerance=1e-9)
    outcome = replace(outcome, found_seconds=found, run_seconds=process_time() - begun)
    if run.failure is not None:
        return replace(outcome, kind="fails", said=str(run.failure))
    moved = max(float(np.ptp(run[name])) for name in run.columns)
    return replace(outcome, kind="stays" if moved < STAYS else "moves", moved=moved)


def _before(path: Path) -> dict[int, Outcome]:
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    return {outcome.seed: outcome for outcome in (Outcome(**json.loads(line)) for line in lines)}


def study(count: int, out: Path) -> Iterator[Outcome]:
    """The outcomes of the first machines; those in the file are not tried again."""
    done = _before(out)
    out.parent.mkdir(parents=True, exist_ok=True)
    for seed in range(count):
        if seed not in done:
            done[seed] = try_machine(seed)
            with out.open("a", encoding="utf-8") as file:
                file.write(json.dumps(asdict(done[seed])) + "\n")
        yield done[seed]


def _said(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{kind} {count}" for kind, count in counts.items())


@click.command()
@click.option("--count", default=500, show_default=True, help="Number of machines.")
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), default=Path("results/starts.jsonl"), show_default=True,
              help="File of outcomes; an interrupted study goes on there.")
def main(count: int, out: Path) -> None:
    """Count the machines whose rest is found and stays."""
    click.echo(str(provenance(())))
    outcomes = list(study(count, out))
    for outcome in outcomes:
        if outcome.kind != "stays":
            click.echo(f"{outcome.seed} ({outcome.parts}): {outcome.kind} {outcome.moved:.1e} {outcome.said}")
    click.echo(f"{len(outcomes)} machines: {_said(Counter(outcome.kind for outcome in outcomes))}")
    click.echo(f"CPU: found in {np.median([o.found_seconds for o in outcomes]):.2f} s, run in "
               f"{np.median([o.run_seconds for o in outcomes]):.2f} s, medians")


if __name__ == "__main__":
    main()
