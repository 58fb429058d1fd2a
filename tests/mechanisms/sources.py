"""The generated code of all models, scenes, methods and number types here, as digests: what `scripts/same-code` compares.

    python -m tests.mechanisms.sources [--all] [--only PATTERN] [--jobs N] [--kinds KINDS] [--list | --write FOLDER]

prints JSON: the kinds of joints, and a record for each case.  It is run in two trees, each with its own version of this file, and is the
only part of the comparison that imports the compiler.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from functools import partial
from hashlib import sha256
from itertools import product
from pathlib import Path
from typing import Any

import cutjoint
from cutjoint.compile.c_export import make_standalone
from cutjoint.compile.pipeline import generate
from cutjoint.emit.source import Source
from cutjoint.methods import METHODS, PRECISIONS
from cutjoint.model.expressions.quantities import quantities
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import JointKind, Model, Numerics, Output, Scene
from cutjoint.program.records import Program
from cutjoint.reduce.sequence import STEPS
from cutjoint.run.scenes import find_scene, with_closure
from cutjoint.tasks.batch_library import with_batch
from cutjoint.toolchain.build import write_source
from tests.mechanisms import bouncing, chains, four_bar, overconstrained, planar, random_models, swaying, switching

ROOT = Path(__file__).resolve().parent.parent.parent

#: The kinds of code of a model and a scene: the methods, the recursive one with its other closure, batches.
VARIANTS = (*METHODS, "proximal", "batch")

Subjects = list[tuple[str, Model, Scene]]


@dataclass(frozen=True, kw_only=True)
class Case:
    """One generated program: ``group`` and ``subject`` say which model and scene."""

    group: str
    subject: str
    variant: str
    precision: str

    @property
    def name(self) -> str:
        """As in iltis/simul1/recursive/double."""
        return "/".join((self.group, self.subject, self.variant, self.precision))


# Models and scenes


def _scenes(model: Model, *, names: Sequence[str] = ()) -> Subjects:
    """The scenes of a model, by default all; one in which nothing happens where there are none."""
    return [(name or "none", model, find_scene(model, name or None)) for name in names or model.scenes or ("",)]


def _file(stem: str, names: Sequence[str] = ()) -> Subjects:
    return _scenes(read_model(ROOT / "models" / f"{stem}.yaml"), names=names)


def _text(make: Callable[[], str]) -> Subjects:
    return _scenes(read_model_text(make(), "m.yaml"))


def _reduced(read: Callable[[], Subjects], *, every: bool) -> Subjects:
    """The remains of the first subject after each exact pass, or after all."""
    [(name, model, scene), *_] = read()
    subjects = []
    for step in (step for step in STEPS if step.motion == "exact"):
        outcome = step.reduce(model, scene)
        if outcome.done:
            model, scene = outcome.model, outcome.scene
            subjects.append((f"{name}, {step.name}", model, scene))
    return subjects if every else subjects[-1:]


def _random(make: Callable[..., Model], *how: Any) -> Subjects:
    """A random model that reports what all methods know of its bodies, markers and forces."""
    model = make(*how)
    elements = (*model.bodies, *model.markers, *model.forces)
    outputs = tuple(Output(element=e.name, quantity=q, span=e.span) for e in elements for q in quantities(e))
    return [("try", model, replace(random_models.scene(), outputs=outputs, numerics=Numerics(penalty=1e4, closure="penalty")))]


#: Texts of model files.
TEXTS: dict[str, Callable[[], str]] = {
    "bounce": partial(bouncing.bouncing_text, 3.0, 0.2),
    "chain": partial(chains.pendulums_in_a_row, 12),
    "chain of springs": partial(chains.pendulums_in_a_row, 12, stiffnesses=True, masses=True),
    "chain of balls": partial(chains.pendulums_in_a_row, 8, joint="spherical"),
    "four-bar 8": partial(four_bar.four_bar_text, 8),
    "parallel cranks": partial(overconstrained.parallel_cranks_text, 4),
    "parallel cranks, chosen": partial(overconstrained.parallel_cranks_text, 3, cut=""),
    "planar swing": lambda: planar.SWING,
    "swaying": swaying.swaying_text,
    "table": lambda: switching.TABLE,
    "wheel": lambda: switching.WHEEL,
    "pulses": lambda: switching.PULSES,
}


def groups(every: bool) -> dict[str, Callable[[], Subjects]]:
    """Models by name, each with what reads or builds it and its scenes; without ``every`` a few of them, quick to generate."""
    found: dict[str, Callable[[], Subjects]] = {
        path.stem: partial(_file, path.stem, () if every or path.stem != "iltis" else ("simul1",))
        for path in sorted((ROOT / "models").glob("*.yaml"))
    }
    texts = {name: partial(_text, make) for name, make in TEXTS.items()}
    simul1 = partial(_file, "iltis", ("simul1",))
    reducible = {"iltis": simul1, "planar swing": texts["planar swing"]}
    reduced = {f"{name} reduced": partial(_reduced, read, every=every) for name, read in reducible.items()}
    return found | texts | reduced | (_all_random() if every else _some_random())


def _some_random() -> dict[str, Callable[[], Subjects]]:
    return {
        "random tree 1": partial(_random, random_models.random_tree, 1),
        "random loops 1": partial(_random, random_models.random_loops, 1),
        "chosen loops 1": partial(_random, random_models.chosen_loops, 1),
    }


def _all_random() -> dict[str, Callable[[], Subjects]]:
    """Trees of all kinds of joints both ways round, loops closed by all kinds in two ways each, and models of any kinds."""
    found: dict[str, Callable[[], Subjects]] = {}
    closings = random_models.CLOSINGS
    for kind, is_reversed in product(random_models.TREE_KINDS, (False, True)):
        found[f"tree {kind}{' reversed' * is_reversed}"] = partial(_random, random_models.tree_with, kind, is_reversed, 1)
    for n, kind in enumerate(random_models.CUT_KINDS):
        for closing in (closings[n % len(closings)], closings[(n + 2) % len(closings)]):
            found[f"loop {kind} {closing}"] = partial(_random, random_models.loop_with, kind, closing, n)
    makers = (random_models.random_tree, random_models.random_loops, random_models.chosen_loops, random_models.floating_loops)
    for make, seed in product(makers, range(3)):
        found[f"{make.__name__.replace('_', ' ')} {seed}"] = partial(_random, make, seed)
    return found


# Code


def source_of_batch(model: Model, scene: Scene, outputs: Sequence[Output]) -> tuple[Program, Source]:
    """Program of several instances and source of the library of a batch."""
    standalone = make_standalone(generate(model, scene, outputs), integrator="trapezoidal", side_by_side=True)
    assert standalone.parts.side_by_side is not None
    return standalone.parts.side_by_side, with_batch(standalone).library


def generate_case(model: Model, scene: Scene, variant: str, precision: str) -> tuple[Any, Any]:
    """Program and source."""
    if variant == "batch":
        return source_of_batch(model, with_closure(scene, "penalty"), scene.outputs)
    if variant == "proximal":
        scene, variant = replace(scene, numerics=replace(scene.numerics, closure="proximal")), "recursive"
    _, program, source = generate(model, scene, scene.outputs, method=variant, lanes=True, precision=precision)
    return program, source


def _cases_of(group: str, subject: str, every: bool) -> list[Case]:
    """With ``every``, all number types of models/ and a scalar one of the others; batches are in double."""
    some = PRECISIONS.names() if (ROOT / "models" / f"{group}.yaml").exists() else ["double", "quad"]
    precisions = some if every else ["double"]
    pairs = [(v, p) for v, p in product(VARIANTS, precisions) if v != "batch" or p == "double"]
    return [Case(group=group, subject=subject, variant=variant, precision=precision) for variant, precision in pairs]


def _record(case: Case, model: Model, scene: Scene, folder: Path | None) -> dict[str, Any]:
    """Digests of the files and, of each function, operations and instructions; or why there is no code."""
    try:
        program, source = generate_case(model, scene, case.variant, case.precision)
    except Exception as error:
        return {"refused": f"{type(error).__name__}: {error}"}
    if folder is not None:
        write_source(source, folder / case.name)
    return {
        "files": {name: sha256(text.encode()).hexdigest()[:16] for name, text in source.files.items()},
        "operations": {f.name: program.operations(f.name) for f in program.functions},
        "instructions": {f.name: program.instructions(f.name) for f in program.functions},
        "earlier": len(program.loaded) + len(program.stepped),
    }


def _run(group: str, pattern: str, every: bool, folder: Path | None, lists: bool) -> list[tuple[str, dict[str, Any]]]:
    """All records of a group."""
    try:
        subjects = groups(every)[group]()
    except Exception as error:
        return [(f"{group}/", {"refused": f"{type(error).__name__}: {error}"})]
    return [
        (case.name, {} if lists else _record(case, model, scene, folder))
        for subject, model, scene in subjects for case in _cases_of(group, subject, every) if fnmatch(case.name, pattern)
    ]  # fmt: skip


def _may_match(group: str, pattern: str) -> bool:
    """True if a case of a group may match: the part of a pattern before its first slash, if it has one, is that of the group."""
    first, slash, _ = pattern.partition("/")
    return not slash or fnmatch(group, first)


def records(pattern: str, every: bool, jobs: int, folder: Path | None, lists: bool) -> Iterator[tuple[str, dict[str, Any]]]:
    """Records by the names of cases, in order."""
    names = [group for group in groups(every) if _may_match(group, pattern)]
    work = partial(_run, pattern=pattern, every=every, folder=folder, lists=lists)
    if jobs == 1:
        for name in names:
            yield from work(name)
        return
    with ProcessPoolExecutor(jobs) as pool:
        for found in pool.map(work, names):
            yield from found


def restrict_kinds(kinds: Sequence[str]) -> None:
    """Let random models choose from these kinds of joints only: from more, they would choose otherwise."""
    random_models.TREE_KINDS = tuple(k for k in random_models.TREE_KINDS if k in kinds)
    random_models.CUT_KINDS = tuple(k for k in random_models.CUT_KINDS if k in kinds)


def main() -> None:
    """Print the manifest of the tree in which this file stands."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--all", action="store_true")
    parser.add_argument("--only", default="*")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--kinds", default=",".join(JointKind))
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--write", type=Path)
    asked = parser.parse_args()
    if not Path(cutjoint.__file__).is_relative_to(ROOT):
        sys.exit(f"{cutjoint.__file__} is not the compiler of {ROOT}")
    restrict_kinds(asked.kinds.split(","))
    found = dict(records(asked.only, asked.all, asked.jobs, asked.write, asked.list))
    json.dump({"kinds": list(JointKind), "cases": found}, sys.stdout)


if __name__ == "__main__":
    main()
