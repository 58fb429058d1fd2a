"""The export command, the common part of all peers, and refusals."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest
import sympy
from click.testing import CliRunner, Result

from cutjoint.cli import main
from cutjoint.model.elements.link_masses import with_link_masses
from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model, Output
from cutjoint.run.scenes import find_scene
from cutjoint_bench.export.columns import known_outputs, make_columns
from cutjoint_bench.export.laws import Numbers, expression
from cutjoint_bench.export.mechanism import build_mechanism
from cutjoint_bench.export.peers import PEERS
from tests.conftest import MODELS
from tests.export.own import case_of
from tests.hash_seeds import outputs

FOUR_BAR, ILTIS = str(MODELS / "four_bar.yaml"), str(MODELS / "iltis.yaml")

each_peer = pytest.mark.parametrize("peer", PEERS)


def export(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["export", *(str(a) for a in arguments)])


@each_peer
def test_the_command_writes_a_program_and_says_what_differs(peer: str, tmp_path: Path) -> None:
    result = export(FOUR_BAR, "--to", peer, "--out", tmp_path)
    assert result.exit_code == 0, result.output
    names = {path.name for path in tmp_path.iterdir()}
    assert any(name.startswith("four_bar.") for name in names)
    said = " ".join(result.output.split())
    assert "outputs left out: crank_0.pin.angle, crank_0.pin.angle_rate" in said
    assert "the first of them says how to run it" in said


def test_mujoco_is_reported_to_differ_in_closed_loops(tmp_path: Path) -> None:
    assert "Loops are closed by soft constraints" in export(FOUR_BAR, "--to", "mujoco", "--out", tmp_path).output


SEEDED = """
import hashlib
from cutjoint_bench.export.peers import PEERS
from cutjoint.model.elements.link_masses import with_link_masses
from tests.export.own import case_of
case = case_of("iltis", "simul3")
model = with_link_masses(case.model, {"*.leaf_link": 2, "*.tie_rod": 1, "rack": 0.5})
for peer in PEERS.values():
    files = peer.export(model, case.scene, {"chassis_mass": 1248}, case.outputs).files
    print(hashlib.sha256(repr(list(files.items())).encode()).hexdigest())
"""


@pytest.mark.heavy
def test_the_same_bytes_under_any_hash_seed() -> None:
    first, second = outputs(SEEDED, "1", "2")
    assert first == second


@each_peer
def test_no_trace_of_the_model_files_place(peer: str) -> None:
    text = Path(FOUR_BAR).read_text(encoding="utf-8")
    digests = set()
    for file in ("four_bar.yaml", "/somewhere/else.yaml\n#include <nothing>"):
        model = read_model_text(text, file)
        files = PEERS[peer].export(model, find_scene(model, None), {}, ()).files
        digests.add(hashlib.sha256(repr(files).encode()).hexdigest())
    assert len(digests) == 1


@each_peer
def test_parameters_are_put_in(peer: str) -> None:
    case = case_of("flyball")
    plain, faster = (PEERS[peer].export(case.model, case.scene, p, case.outputs).files for p in ({}, {"spin": 7.0}))
    assert plain != faster


@each_peer
def test_massless_bodies_are_refused_all_at_once(peer: str, tmp_path: Path) -> None:
    result = export(ILTIS, "--scene", "simul3", "--to", peer, "--link-mass", "*.leaf_link=2", "--out", tmp_path)
    assert result.exit_code == 1
    lines = result.output.strip().splitlines()
    assert len(lines) == 5
    assert lines[0] == f"{ILTIS}:21:3: body 'rack': other simulators need mass, and it is massless; give it some by --link-mass 'rack=KG'"
    assert all("tie_rod" in line for line in lines[1:])


def test_a_shaft_without_mass_is_refused_and_becomes_no_rod(tmp_path: Path) -> None:
    shaft = "{massless: true, inertia: {axial: 0.1, axis: [0, 0, 1]}}"
    hinge = "{kind: revolute, bodies: [ground, shaft], at: [0, 0, 0], axis: [0, 0, 1]}"
    head = "cutjoint: 1\nname: drive\ngravity: [0, 0, 0]\n"
    text = f"{head}bodies: {{shaft: {shaft}}}\njoints: {{pin: {hinge}}}\nscenes: {{run: {{end: 1}}}}\n"
    path = tmp_path / "drive.yaml"
    path.write_text(text, encoding="utf-8")
    message = f"{path}:4:10: body 'shaft': other simulators need mass, and it is massless; give it some in the model file"
    assert export(path, "--to", "mujoco", "--out", tmp_path / "out").output.strip() == message
    assert refusal(read_model_text(text, "drive.yaml"), {"shaft": 1}) == (
        "drive.yaml:2:1: link mass 'shaft': no massless body of the model has this name; it has none"
    )


def test_outputs_that_peers_do_not_report() -> None:
    case = case_of("four_bar")
    mechanism, numbers = build_mechanism(case.model, case.scene, {}), Numbers.of(case.model, case.scene, {})
    with pytest.raises(ModelError) as refused:
        make_columns(case.model, mechanism, numbers, case.scene.outputs)
    assert str(refused.value).splitlines() == [
        f"{FOUR_BAR}:{place}: output 'crank_0.pin.{quantity}': other simulators do not report it; "
        "ask for x y z vx vy vz of bodies and markers and wx wy wz of bodies"
        for place, quantity in (("36:41", "angle"), ("36:60", "angle_rate"))
    ]


def test_an_output_that_is_asked_for_must_be_known(tmp_path: Path) -> None:
    result = export(FOUR_BAR, "--to", "mujoco", "--output", "crank_0.bar.wz", "--output", "crank_0.pin.angle", "--out", tmp_path)
    assert result.exit_code == 1
    assert "output 'crank_0.pin.angle': other simulators do not report it" in result.output
    assert "wz'" not in result.output


def test_places_of_all_bodies_where_no_output_is_known() -> None:
    model = case_of("pendulum").model
    asked = [Output(element="pin", quantity="angle", span=model.span)]
    assert [output.column for output in known_outputs(model, asked)] == ["bob.x", "bob.y", "bob.z"]


LINKS = """
cutjoint: 1
name: links
gravity: [0, 0, -9.81]
parameters: {reach: {value: 3, binding: param}}
bodies:
  block: {mass: 1, centre_of_mass: [reach, 0, 4], inertia: [1, 1, 1]}
  rod: {massless: true}
  knot: {massless: true}
joints:
  foot: {kind: spherical, bodies: [ground, rod], at: [0, 0, 0]}
  head: {kind: universal, bodies: [rod, block], at: [reach, 0, 4], axis: [0, 1, 0], axis_2: [1, 0, 0]}
  one: {kind: revolute, bodies: [block, knot], at: [1, 1, 1], axis: [0, 1, 0]}
  two: {kind: revolute, bodies: [ground, knot], at: [1, 1, 1], axis: [1, 0, 0]}
"""


def test_a_massless_link_becomes_a_slender_rod() -> None:
    model = with_link_masses(read_model_text(LINKS, "links.yaml"), {"r*": 6})
    rod = next(b for b in model.bodies if b.name == "rod")
    numbers = Numbers.of(model, find_scene(model, None), {"reach": 3.0})
    assert numbers.number(rod.mass) == 6
    assert numbers.triple(rod.centre_of_mass) == (1.5, 0, 2)
    xx, yy, zz, xy, xz, yz = (numbers.number(e) for e in rod.inertia)
    moments, axes = np.linalg.eigh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    np.testing.assert_allclose(moments, [0.0125, 12.5, 12.5], rtol=1e-12)
    np.testing.assert_allclose(np.abs(axes[:, 0]), [0.6, 0, 0.8], atol=1e-12)


def test_a_links_length_may_stay_open() -> None:
    rod = next(b for b in with_link_masses(read_model_text(LINKS, "links.yaml"), {"rod": 1}).bodies if b.name == "rod")
    assert {str(s) for s in rod.inertia[1].free_symbols} == {"p_reach"}


def test_the_last_mass_counts() -> None:
    model = with_link_masses(case_of("iltis", "simul1").model, {"*.leaf_link": 2, "rear_*": 3})
    masses = {b.name: float(b.mass) for b in model.bodies if not b.mass.free_symbols}
    assert (masses["front_left.leaf_link"], masses["rear_left.leaf_link"], masses["rear_left.tie_rod"]) == (2, 3, 3)
    assert masses["front_left.tie_rod"] == 0


def refusal(model: Model, masses: dict[str, float]) -> str:
    with pytest.raises(ModelError) as refused:
        with_link_masses(model, masses)
    return str(refused.value)


def test_masses_that_cannot_be_given() -> None:
    model = read_model_text(LINKS, "links.yaml")
    assert refusal(model, {"rof": 1}) == "links.yaml:3:1: link mass 'rof': no massless body of the model has this name; did you mean 'rod'?"
    assert refusal(model, {"block": 1}) == (
        "links.yaml:3:1: link mass 'block': no massless body of the model has this name; choose from: knot, rod"
    )
    assert refusal(model, {"rod": -1}) == "links.yaml:3:1: link mass 'rod': mass needs a positive number of kg, got -1"
    assert refusal(model, {"knot": 1}) == (
        "links.yaml:9:3: body 'knot': its joints are at one point, so it cannot become a rod; give it mass and inertia in the model file"
    )


def test_a_link_mass_that_is_no_number(tmp_path: Path) -> None:
    result = export(ILTIS, "--scene", "simul1", "--to", "mujoco", "--link-mass", "rack=heavy", "--out", tmp_path)
    assert result.exit_code == 1
    assert result.output.strip() == "--link-mass rack=heavy: unknown symbol 'heavy'; write NAME=NUMBER, with a unit or without"


def test_laws_in_cpp() -> None:
    x, y = sympy.symbols("x y", real=True)
    choice = sympy.Piecewise((x, x < -0.1), (2 * y, sympy.And(x > 0, y <= 1)), (0, True))
    texts = {
        0.1 + sympy.Float(0.2): "0.30000000000000004",
        x**3 / 3: "(1.0/3.0)*power<3>(x)",
        sympy.pi * sympy.sqrt(x): "3.141592653589793*std::sqrt(x)",
        sympy.Abs(x) ** sympy.Float(1.5): "std::pow(std::fabs(x), 1.5)",
        choice: "((x < (-0.1)) ? ( x ) : ((y <= 1.0 && x > 0.0) ? ( 2.0*y ) : ( 0.0 )))",
    }
    assert {law: expression(law) for law in texts} == texts
