"""The explanation says what the compiler derived: names, numbers, LaTeX that renders, and the same bytes every time."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import Model, Scene
from cutjoint.program.blocks import Section
from cutjoint.program.records import Program
from cutjoint.program.scalars import FREE
from cutjoint.report.explain.document import derive, explain, explain_equations, parameter_costs, printed
from cutjoint.report.explain.views import find_counterparts
from cutjoint.run.scenes import find_scene
from cutjoint.topology.build import build_topology
from cutjoint.topology.records import eliminate
from tests.conftest import MODELS
from tests.hash_seeds import outputs
from tests.mechanisms import random_models
from tests.model.pendulum import PENDULUM, varied
from tests.oracles.scalars import interpret_scalars


@dataclass(frozen=True, kw_only=True)
class Explained:
    """A model's explanation beside what it is about."""

    text: str
    model: Model
    equations: RecursiveEquations
    program: Program

    def table(self, heading: str) -> list[list[str]]:
        """The rows of the first table whose headings begin so."""
        _, _, below = self.text.partition(f"| {heading} |")
        lines = below.split("\n\n")[0].splitlines()[2:]
        return [[cell.strip().strip("*`") for cell in line.strip("|").split("|")] for line in lines]

    def chapter(self, title: str) -> str:
        """A chapter of section 4."""
        return re.split(r"\n##+ (?!#)", self.text.partition(f"\n### {title}\n")[2].replace("\n####", "\n****"))[0]

    def entries(self, title: str) -> list[str]:
        """The titles of a chapter's entries."""
        return re.findall(r"^\*\*\*\* (.*)$", self.chapter(title), re.MULTILINE)


def explained(model: Model, scene: Scene) -> Explained:
    equations, program = derive(build_topology(model), scene)
    return Explained(text=explain(model, scene), model=model, equations=equations, program=program)


@pytest.fixture(scope="module", params=["four_bar", "iltis"])
def one(request: pytest.FixtureRequest) -> Explained:
    return request.getfixturevalue(request.param)


@pytest.fixture(scope="module")
def four_bar() -> Explained:
    model = read_model(MODELS / "four_bar.yaml")
    return explained(model, find_scene(model, None))


@pytest.fixture(scope="module")
def iltis() -> Explained:
    model = read_model(MODELS / "iltis.yaml")
    return explained(model, find_scene(model, "simul3"))


# Structure


def test_every_element_is_explained_with_its_line(one: Explained) -> None:
    model = one.model
    for chapter, elements in (("Bodies", model.bodies), ("Forces", model.forces)):
        text = one.chapter(chapter)
        assert [e.name for e in elements if f"| `{e.name}` | {e.span.place} |" not in text] == []
    joints = one.chapter("Joints")
    assert [j.name for j in model.joints if f"| `{j.name}` | {j.span.place} |" not in joints] == []


def test_counts_of_the_iltis(iltis: Explained) -> None:
    """42 speeds, 36 equations of rank 32, 10 degrees of freedom (Cuadrado et al. 2000)."""
    counts = {row[0]: row[1] for row in iltis.table("what")}
    assert counts["bodies"] == "18, 9 of them without mass and inertia"
    assert counts["joints"] == "18 in the tree (1 guided), 8 cut"
    assert (counts["speeds"], counts["cut-joint equations"], counts["degrees of freedom"]) == ("42", "36, rank 32", "10")
    assert counts["forces"] == "13 act, 4 switched off"


def test_counts_of_the_four_bar(four_bar: Explained) -> None:
    counts = {row[0]: row[1] for row in four_bar.table("what")}
    assert (counts["speeds"], counts["cut-joint equations"], counts["degrees of freedom"]) == ("5", "12, rank 4", "1")


def test_the_tree_is_a_list_indented_by_depth(one: Explained) -> None:
    found = re.findall(r"^( *)- `([^`]+)` by `([^`]+)`", one.text, re.MULTILINE)
    depth = {"ground": 0}
    for t in one.equations.topology.tree:
        depth[t.child] = depth[t.parent] + 1
    assert [(len(i) // 2, child, joint) for i, child, joint in found] == [
        (depth[t.child], t.child, t.joint.name) for t in one.equations.topology.tree
    ]


def test_every_loop_is_listed(one: Explained) -> None:
    rows = one.table("loop of")
    expected = [[x.cut, x.base, "`, `".join(x.bodies), str(x.width)] for x in one.equations.topology.loops]
    assert rows == expected


def test_elimination_goes_from_the_leaves_to_the_ground(one: Explained) -> None:
    topology = one.equations.topology
    coupled = eliminate(topology.tree, topology.cuts)
    *steps, total = one.table("step")
    bodies = [re.findall(r"[\w.]+", row[1]) for row in steps]
    assert sorted(b for row in bodies for b in row) == sorted(topology.order)
    place = {body: i for i, row in enumerate(bodies) for body in row}
    assert all(place[t.child] <= place[t.parent] for t in topology.tree if t.parent in place)
    assert {tuple(row) for row in bodies if len(row) > 1} == {branch.bodies for branch in topology.branches if len(branch.bodies) > 1}
    for row, (body, *others) in zip(steps, bodies, strict=True):
        assert others or set(re.findall(r"[\w.]+", row[4])) == set(coupled[body])
    operations: Counter[str] = Counter()
    for section, count in operations_by_section(one.program).items():
        operations[section.element] += count * (section.stage == "condensation")
    spent = [sum(operations.get(topology.joint_of[body].joint.name, 0) for body in row) for row in bodies]
    assert [int(row[6]) for row in steps] == spent
    assert int(total[6]) == sum(operations.values())


def test_counterparts_of_the_suspensions_stand_side_by_side(iltis: Explained) -> None:
    (found,) = iltis.equations.topology.classes
    rows = find_counterparts(found)
    assert len(rows) == 4 + 4 + 2 + 4
    for row in rows:
        assert [name.split(".")[0] for name in row] == [root.split(".")[0] for root in found.roots]
        assert len({name.split(".")[1] for name in row}) == 1


def test_what_is_alike_is_explained_once(iltis: Explained) -> None:
    assert iltis.entries("Body") == ["`chassis`", "`front_left.arm`", "`front_left.carrier`"]
    assert iltis.entries("Force") == ["`speed_controller`", "`front_left.shock`", "`front_left.leaf`", "`front_left.tyre`"]
    others = ", ".join(f"`{corner}.tyre`" for corner in ("front_right", "rear_left", "rear_right"))
    assert f"Of the same form, with other names, numbers or signs: {others}." in iltis.chapter("Force")


def test_what_is_printed_for_all_has_one_form(one: Explained) -> None:
    """Elements that are explained by another one's formulas, and have no part of their own in a subtree, have the same formulas."""
    sections, formulas = one.equations.builder.sections, printed(one.equations)
    entries = explain_equations(one.equations, ())
    for stage, forms in entries.items():
        for entry in forms:
            names = re.findall(r"`([\w.]+)`", " ".join((entry.title, *entry.notes[1:])))
            lines = {
                name: sum(sections[x.section].stage == stage and sections[x.section].element == name for x in formulas.defined)
                for name in names
            }
            assert all(lines.values())


def test_laws(iltis: Explained) -> None:
    text = iltis.chapter("Force")
    assert "52796000 " in text
    assert "67061000" in text
    assert r"\lt -0.2" in text


# Numbers


def operations_by_section(program: Program) -> Counter[Section]:
    """The operations of an evaluation, without lanes, by the section that introduced them; an element may have several sections alike."""
    nodes = [program.graph.nodes[n] for n in program.function("evaluate").statements]
    return Counter(program.sections[node.section] for node in nodes if node.op not in FREE)


def test_the_table_of_operations_adds_up_to_the_program(one: Explained) -> None:
    *rows, total = one.table("element")
    headings = re.search(r"\| element \| line \| (.*) \|", one.text)
    assert headings is not None
    stages = headings[1].split(" | ")[:-1]
    sections = operations_by_section(one.program).items()
    for row in rows:
        expected = [sum(n for s, n in sections if (s.stage, s.element) == (stage, row[0])) for stage in stages]
        assert [int(cell or 0) for cell in row[2:]] == [*expected, sum(expected)]
    columns = [sum(n for s, n in sections if s.stage == stage) for stage in stages]
    assert [int(cell) for cell in total[2:]] == [*columns, one.program.operations("evaluate")]
    assert sum(int(row[-1]) for row in rows) == one.program.operations("evaluate")


def test_a_body_is_explained_with_its_numbers(iltis: Explained) -> None:
    row = next(r for r in iltis.table("body | line") if r[0] == "chassis")
    assert row[1:] == ["iltis.yaml:17", "chassis_mass", "(0, 0, 0.57)", "(130, 1620, 1670, 0, 0, 0)"]


OPEN = varied("  arm_length:", "  side: {value: 0, binding: param}\n  arm_length:", varied("[1, 0, 0], inertia", "[1, 0, side], inertia"))


def open_pendulum(text: str = OPEN) -> tuple[RecursiveEquations, Program]:
    model = read_model_text(text, "pendulum.yaml")
    return derive(build_topology(model), find_scene(model, None))


def count(program: Program) -> int:
    """Operations of an evaluation, counted over what its results reach."""
    graph = program.graph
    reached = graph.reachable([r.scalar for r in program.function("evaluate").results])
    early = {*program.loaded, *program.stepped}
    return sum(graph.nodes[n].op not in ("const", "symbol", "neg") and n not in early for n in reached)


def test_the_cost_of_a_parameter_is_what_closing_it_in_the_file_saves() -> None:
    equations, program = open_pendulum()
    costs = {c.parameter.name: c for c in parameter_costs(equations, program)}
    assert list(costs) == ["arm_mass", "side"]
    for name, old in (("arm_mass", "{value: 2, unit: kg, binding: param}"), ("side", "{value: 0, binding: param}")):
        _, closed = open_pendulum(varied(f"{name}: {old}", f"{name}: {old.replace('param', 'const')}", OPEN))
        assert costs[name].operations == count(program) - count(closed)
    assert costs["side"].operations > 0


def test_the_scalars_that_a_parameter_keeps_are_those_that_change_with_it() -> None:
    equations, program = open_pendulum()
    kept = sorted(set(program.loaded) & program.stored)
    numerics = np.array([1e9, 1.0, 10.0])
    before, *changed = (
        interpret_scalars(program.graph, kept, {"parameters": np.array(p), "numerics": numerics}, {})
        for p in ((2.1, 0.3), (2.7, 0.3), (2.1, 0.4))
    )
    found = [sum(before[n] != after[n] for n in kept) for after in changed]
    assert found == [c.stored for c in parameter_costs(equations, program)]
    assert all(found)


def test_the_table_of_parameters(iltis: Explained) -> None:
    rows = iltis.table("parameter")
    assert [row[0] for row in rows] == [p.name for p in iltis.equations.parameters]
    assert rows[0] == ["chassis_mass", "iltis.yaml:9", "1260", "kg", "0", "2"]


# LaTeX


def formulas(text: str) -> Iterator[str]:
    """Displayed formulas, then those in lines."""
    displayed = re.compile(r"^\$\$\n(.*)\n\$\$$", re.MULTILINE)
    yield from displayed.findall(text)
    yield from re.findall(r"\$([^$]*)\$", displayed.sub("", text))


def assert_renders(text: str) -> None:
    """Dollars and braces pair, and Markdown takes nothing of a formula for its own."""
    assert text.count("\n$$\n") % 2 == 0
    rest = re.sub(r"^\$\$\n.*\n\$\$$", "", text, flags=re.MULTILINE)
    assert "$$" not in rest
    assert all(line.count("$") % 2 == 0 for line in rest.splitlines())
    for formula in formulas(text):
        assert formula.count("{") == formula.count("}")
        assert formula.count(r"\begin") == formula.count(r"\end")
        assert formula.count(r"\left") - formula.count(r"\leftarrow") == formula.count(r"\right")
        assert not re.search(r"\\[^A-Za-z]", formula), formula
        assert not re.search(r"[^A-Za-z0-9]_|[*<>]", formula), formula
        assert not re.match(r"[-+=#>]", formula), formula


def test_formulas_render(one: Explained) -> None:
    assert_renders(one.text)


def random_scene() -> Scene:
    return random_models.scene()


def test_formulas_of_a_random_model_render() -> None:
    model = random_models.random_loops(0)
    text = explain(model, random_scene())
    assert_renders(text)
    assert [e.name for e in (*model.bodies, *model.joints, *model.forces) if f"| `{e.name}` |" not in text] == []


# The same every time


_DIGESTS = """
import hashlib, pathlib
from cutjoint.model.read import read_model
from cutjoint.model.records import JointKind
from cutjoint.report.explain.document import explain
from tests.mechanisms import random_models
for name, scene in (("four_bar", "swing"), ("iltis", "iavsd_sine_2mm")):
    model = read_model(pathlib.Path("models") / f"{name}.yaml")
    print(hashlib.sha256(explain(model, model.scenes[scene]).encode()).hexdigest())
model = random_models.tree_with(JointKind.UNIVERSAL, False, 3)
print(hashlib.sha256(explain(model, random_models.scene()).encode()).hexdigest())
"""


def test_the_same_bytes_under_any_hash_seed() -> None:
    first, second = outputs(_DIGESTS, "1", "2")
    assert first == second
    assert len(set(first.split())) == 3


# The command


def run(*arguments: str) -> tuple[int, str]:
    result = CliRunner().invoke(main, ["explain", *arguments])
    return result.exit_code, result.output


def test_the_command_prints_the_named_scene(tmp_path: Path) -> None:
    path = tmp_path / "pendulum.yaml"
    path.write_text(PENDULUM.replace("scenes:", "scenes:\n  rise: {end: 1}"))
    for arguments, scene in (((), "rise"), (("--scene", "fall"), "fall")):
        code, text = run(str(path), *arguments)
        assert code == 0
        assert f"from model `pendulum`, scene `{scene}`" in text
        assert str(tmp_path) not in text


def test_an_unknown_scene_is_an_error() -> None:
    code, text = run(str(MODELS / "four_bar.yaml"), "--scene", "fly")
    assert code == 1
    assert "no scene 'fly'; the model has swing" in text.replace("\n", " ")


def test_a_model_without_loops_forces_or_parameters() -> None:
    model = random_models.tree_with(random_models.K.REVOLUTE, False, 1)
    bare = replace(model, forces=(), reactions=(), scenes={})
    text = explain(replace(bare, parameters=bare.parameters), random_scene())
    assert "| cut joint |" not in text
    assert "### Force" not in text
    assert_renders(text)


def test_names_of_files_mean_nothing_to_markdown(tmp_path: Path) -> None:
    path = tmp_path / "a`|<b>_[x](y)$\n#.yaml"
    path.write_text((MODELS / "pendulum.yaml").read_text(encoding="utf-8"), encoding="utf-8")
    model = read_model(path)
    text = explain(model, find_scene(model, None))
    assert "a\\`\\|\\<b\\>_\\[x\\]\\(y\\)\\$\\\\n\\#.yaml:" in text
    assert "a`|" not in text
    assert "<b>" not in text
