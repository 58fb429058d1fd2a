"""The explanation of natural coordinates: its facts, LaTeX that renders, and the same bytes every time."""

from __future__ import annotations

import re
from dataclasses import dataclass

import pytest
import sympy
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.formulate.inputs import TIME
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import Scene
from cutjoint.report.explain.document import explain
from cutjoint.report.explain.natural.derivation import Derivation, derive_natural
from cutjoint.report.explain.natural.document import factorisation_rows
from cutjoint.report.explain.natural.joints import explain_constraints
from cutjoint.report.explain.natural.layout import explain_layout
from cutjoint.report.explain.natural.nodes import count_sharing
from cutjoint.run.scenes import find_scene
from cutjoint.sparse.plan import plan_definite
from tests.conftest import MODELS
from tests.hash_seeds import outputs
from tests.mechanisms import random_models
from tests.model.pendulum import PENDULUM
from tests.report.test_explain import assert_renders

SCENES = {"four_bar": "swing", "iltis": "simul3"}


@dataclass(frozen=True, kw_only=True)
class Explained:
    """A model's explanation beside what it is about."""

    text: str
    derivation: Derivation

    def table(self, heading: str) -> list[list[str]]:
        """The rows of all tables whose headings begin so."""
        tables = self.text.split(f"| {heading} |")[1:]
        lines = [line for below in tables for line in below.split("\n\n")[0].splitlines()[2:]]
        return [[cell.strip().strip("*`") for cell in line.strip("|").split("|")] for line in lines]


def explained(name: str, method: str) -> Explained:
    model = read_model(MODELS / f"{name}.yaml")
    scene = model.scenes[SCENES[name]]
    return Explained(text=explain(model, scene, method), derivation=derive_natural(model, scene, method))


@pytest.fixture(scope="module")
def iltis() -> Explained:
    return explained("iltis", "augmented")


@pytest.fixture(scope="module", params=["augmented", "classical"])
def four_bar(request: pytest.FixtureRequest) -> Explained:
    return explained("four_bar", request.param)


@pytest.fixture(scope="module", params=[("iltis", "augmented"), ("four_bar", "augmented"), ("four_bar", "classical")], ids=" ".join)
def one(request: pytest.FixtureRequest) -> Explained:
    return explained(*request.param)


# Facts


def test_counts_of_the_iltis(iltis: Explained) -> None:
    counts = {row[0]: row[1] for row in iltis.table("what")}
    assert counts["coordinates"] == "75, of 14 points, 11 vectors"
    assert counts["constraint equations"] == "65, 65 of them independent"
    assert counts["degrees of freedom"] == "10"
    assert counts["bodies"] == "18, 9 of them without mass and inertia"
    assert int(counts["entries of the tangent"].split()[0]) == len(iltis.derivation.plan.pattern.row)
    assert f"of {75 * 76 // 2} of the lower triangle" in counts["entries of the tangent"]


def test_counts_of_the_four_bar(four_bar: Explained) -> None:
    counts = {row[0]: row[1] for row in four_bar.table("what")}
    left_out = ", 2 left out" if four_bar.derivation.full.method == "classical" else ""
    assert counts["coordinates"] == "13, of 3 points, 1 vector, 1 angle"
    assert counts["constraint equations"] == f"14, 12 of them independent{left_out}"
    assert counts["degrees of freedom"] == "1"


def test_what_sharing_saves(iltis: Explained) -> None:
    """18 bodies with four nodes of three coordinates each; four tie rods need two nodes, four leaf links three."""
    assert "72 points and vectors with 216 coordinates; 25 points and vectors with 75 coordinates are left." in iltis.text
    sharing = count_sharing(iltis.derivation.full.layout, 18)
    assert (sharing.unshared, sharing.rigid, sharing.unasked, sharing.ground, sharing.left) == (72, 0, 4 * 2 + 4, 0, 25)


def test_the_four_bar_says_which_equations_depend_on_others(four_bar: Explained) -> None:
    """The couplers' points stay in the plane by the cranks: that the couplers do follows."""
    dependent = [row[0] for row in four_bar.table("equation | line")][-2:]
    assert dependent == ["coupler_1.bar.coupler_1.pin*crank_0.pin.axis", "coupler_2.bar.closure_1*crank_0.pin.axis"]
    is_classical = four_bar.derivation.full.method == "classical"
    assert ("They are left out" in four_bar.text) == is_classical
    assert ("Left out, since others imply them: `coupler_1.bar.coupler_1.pin*crank_0.pin.axis`" in four_bar.text) == is_classical
    assert ("They are held like all others" in four_bar.text) == (not is_classical)


def test_rods_and_idle_joints_of_the_iltis(iltis: Explained) -> None:
    corners = ("front_left", "front_right", "rear_left", "rear_right")
    rods, joints = (", ".join(f"`{c}.{name}`" for c in corners) for name in ("tie_rod", "tie_rod_joint"))
    assert f"neither a mass off their line nor a joint or force: {rods}." in iltis.text
    assert f"turning about itself, and have no equation: {joints}." in iltis.text
    assert "hold them to functions of time: `rack_slide`." in iltis.text


def test_every_coordinate_constant_and_combination_has_a_row(one: Explained) -> None:
    layout = one.derivation.full.layout
    kinds = {"coordinate": "is_coordinate", "node": "parts"}
    for heading, attribute in kinds.items():
        assert [row[0] for row in one.table(f"{heading} | kind")] == [n.name for n in layout.nodes if getattr(n, attribute)]
    assert [row[0] for row in one.table("constant | kind")] == [n.name for n in layout.nodes if n.body == "ground"]


def test_every_equation_is_named(one: Explained) -> None:
    d = one.derivation
    joints = {j.name for j in d.model.joints}
    named = [name for row in one.table("equation | line | residual") for name in row[0].split("`, `")]
    assert named == [f"{c.element}.{name}" for c in d.full.constraints for name in c.names]
    shared = {row[0]: row[-1] for row in one.table("joint | line | kind")}
    assert shared.keys() == joints
    for c in d.full.constraints:
        if c.element in joints:
            assert shared[c.element] == "`, `".join(c.names)


def test_every_line_belongs_to_its_element(one: Explained) -> None:
    """The file's line starts the element, or, of a short form, has its name."""
    lines = one.derivation.model.text.splitlines()
    found = re.findall(r"^\| ([^|]*) \| (\w+\.yaml):(\d+) \|", one.text, re.MULTILINE)
    assert len(found) > 20
    elements = {e.name for e in (*one.derivation.model.bodies, *one.derivation.model.joints, *one.derivation.model.forces)}
    for cell, _, line in found:
        name = cell.strip("`")
        owner = max((e for e in elements if name == e or name.startswith(f"{e}.")), key=len, default=None)
        assert owner is not None, cell
        assert f"{owner.rpartition('.')[2]}:" in lines[int(line) - 1], (cell, line)


def test_the_table_of_operations_adds_up_to_the_program(one: Explained) -> None:
    *rows, total = one.table("element | line")
    assert sum(int(row[-1]) for row in rows) == int(total[-1]) == one.derivation.program.operations("linearise")


def test_what_the_factorisation_takes(iltis: Explained) -> None:
    plan = plan_definite(iltis.derivation.plan.pattern)
    (_, orders), (_, work) = factorisation_rows(plan)
    assert orders.startswith(f"`{plan.trials[0].name}` with {plan.trials[0].operations} operations in four lanes; ")
    assert sorted(re.findall(r"`(\w+)` with \d+", orders)) == ["amd", "metis", "symamd"]
    assert int(work) == plan.multiply_adds


def test_explaining_does_not_change_the_layout(iltis: Explained) -> None:
    d = iltis.derivation
    before = list(d.full.layout.nodes)
    explain_layout(d)
    explain_constraints(d)
    assert d.full.layout.nodes == before


# Rendering


def random_scene() -> Scene:
    return random_models.scene({"drive": 0.1 + sympy.sin(2 * TIME) / 5})


def test_formulas_render(one: Explained) -> None:
    assert_renders(one.text)


def test_formulas_of_a_random_model_render() -> None:
    model = random_models.random_loops(1)
    text = explain(model, random_scene(), "classical")
    assert_renders(text)
    assert [e.name for e in (*model.bodies, *model.joints, *model.forces) if f"`{e.name}`" not in text] == []


def test_the_methods_say_what_their_tangents_have() -> None:
    model = read_model_text(PENDULUM, "pendulum.yaml")
    scene = find_scene(model, None)
    augmented, classical = (explain(model, scene, method) for method in ("augmented", "classical"))
    assert "formulation augmented." in augmented
    assert "symmetric parts of damping and stiffness alone" in augmented
    assert "formulation classical." in classical
    assert "The tangent has damping and stiffness whole." in classical
    assert_renders(augmented)
    assert_renders(classical)


_DIGESTS = """
import hashlib, pathlib
from cutjoint.model.read import read_model
from cutjoint.report.explain.document import explain
for name, scene in (("four_bar", "swing"), ("iltis", "simul3"), ("flyball", "govern")):
    model = read_model(pathlib.Path("models") / f"{name}.yaml")
    print(hashlib.sha256(explain(model, model.scenes[scene], "classical").encode()).hexdigest())
"""


def test_the_same_bytes_under_any_hash_seed() -> None:
    first, second = outputs(_DIGESTS, "1", "2")
    assert first == second
    assert len(set(first.split())) == 3


# The command


def run(*arguments: str) -> tuple[int, str]:
    result = CliRunner().invoke(main, ["explain", *arguments])
    return result.exit_code, result.output


def test_an_unknown_method_is_an_error() -> None:
    code, text = run(str(MODELS / "four_bar.yaml"), "--method", "newton")
    assert code == 2
    assert "'newton' is not one of 'recursive', 'augmented', 'classical'" in text
