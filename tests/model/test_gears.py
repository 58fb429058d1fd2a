"""Gears in the file: their ends, their ratio's unit, their mirror images, and their faults."""

from __future__ import annotations

import pytest

from cutjoint.analysis.mobility import GuideError
from cutjoint.compile.pipeline import generate
from cutjoint.model.errors import ModelError
from cutjoint.model.expressions.parse import POSITION
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model
from cutjoint.report.explain.document import explain
from cutjoint.topology.build import build_topology
from cutjoint.topology.spanning_tree import TopologyError
from cutjoint_bench.mechanics_alone import require_mechanics_alone

TEXT = """
cutjoint: 1
name: gears
gravity: [0, 0, -9.81]
parameters:
  teeth: {value: 20, binding: param}
bodies:
  wheel: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}
  bar: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}
  tube: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}
  ball: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}
  shaft: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}
joints:
  pinion: {kind: revolute, bodies: [ground, wheel], at: [0, 0, 0], axis: [0, 1, 0]}
  rack: {kind: prismatic, bodies: [ground, bar], at: [0, 0, 0], axis: [1, 0, 0]}
  slide: {kind: cylindrical, bodies: [ground, tube], at: [0, 0, 0], axis: [1, 0, 0]}
  socket: {kind: spherical, bodies: [ground, ball], at: [0, 0, 0]}
  drive: {kind: revolute, bodies: [ground, shaft], at: [0, 0, 0], axis: [1, 0, 0], guide: "sin(t)"}
  tie: {kind: revolute, bodies: [bar, tube], at: [0, 0, 0], axis: [1, 0, 0], cut: true}
gears:
  mesh: GEAR
"""


def with_gear(gear: str) -> Model:
    return read_model_text(TEXT.replace("GEAR", gear), "gears.yaml")


@pytest.mark.parametrize(
    ("joints", "ratio", "value"),
    [
        ("[pinion, rack]", "2", 2.0), ("[pinion.angle, rack]", "40 1/m", 40.0), ("[rack, pinion]", "25 mm/rad", 0.025),
        ("[slide.angle, pinion]", "-60/teeth", -3.0), ("[slide.displacement, rack.displacement]", "0.5", 0.5),
        ("[pinion, drive]", "1/3", 1 / 3),
    ],
)  # fmt: skip
def test_ratio_is_in_units_of_the_coordinates(joints: str, ratio: str, value: float) -> None:
    model = with_gear(f"{{joints: {joints}, ratio: {ratio}}}")
    values = {p.symbol: p.value for p in model.parameters}
    (gear,) = model.gears
    assert float(gear.ratio.subs(values)) == pytest.approx(value)
    assert [f"{c.joint}.{c.name}" for c in (gear.first, gear.second)] == [
        name if "." in name else f"{name}.{'displacement' if name == 'rack' else 'angle'}" for name in joints[1:-1].split(", ")
    ]


@pytest.mark.parametrize(
    ("gear", "message"),
    [
        ("{joints: [pinion, rake], ratio: 1}", "21:27: gear 'mesh': unknown joint 'rake'; did you mean 'rack'?"),
        ("{joints: [pinion, slide], ratio: 1}",
         "21:27: gear 'mesh': the cylindrical joint 'slide' has 2 coordinates; write slide.displacement or slide.angle"),
        ("{joints: [pinion, slide.turn], ratio: 1}",
         "21:27: gear 'mesh': the cylindrical joint 'slide' has no coordinate 'turn'; coordinates: angle, displacement"),
        ("{joints: [socket, pinion], ratio: 1}",
         "21:19: gear 'mesh': the spherical joint 'socket' has no coordinates; a gear couples the coordinates of two joints in the tree"),
        ("{joints: [tie, pinion], ratio: 1}",
         "21:19: gear 'mesh': the cut joint 'tie' has no coordinates; a gear couples the coordinates of two joints in the tree"),
        ("{joints: [slide.angle, slide.displacement], ratio: 1}",
         "21:18: gear 'mesh': couples the joint 'slide' to itself; name two joints; a screw couples displacement and angle"),
        ("{joints: [pinion, rack], ratio: 1 m}", "21:41: gear 'mesh': ratio needs 1/m, got m"),
        ("{joints: [pinion, drive], ratio: 1 m}", "21:42: gear 'mesh': ratio needs an angle or a plain number, got m"),
        ("{joints: [pinion, rack], ratio: 0}",
         "21:41: gear 'mesh': the ratio is zero; a joint that does not move is of kind fixed, or has guide: 0"),
        ("{joints: [pinion], ratio: 1}", "21:18: gear 'mesh': joints needs two names; write [one, other]"),
        ("{joints: [pinion, rack]}", "21:3: gear 'mesh': needs 'ratio' or 'law', one of them"),
    ],
)  # fmt: skip
def test_problems(gear: str, message: str) -> None:
    with pytest.raises(ModelError) as problem:
        with_gear(gear)
    assert message in str(problem.value)


def test_output_of_a_gear_whose_coordinate_is_wrong() -> None:
    text = TEXT.replace("GEAR", "{joints: [rack.angle, pinion], ratio: 1}") + "outputs: [mesh.force]\n"
    with pytest.raises(ModelError, match="gear 'mesh': the prismatic joint 'rack' has no coordinate 'angle'; coordinates: displacement"):
        read_model_text(text, "gears.yaml")


def test_two_guides_leave_nothing_to_a_gear() -> None:
    text = TEXT.replace("axis: [0, 1, 0]}", "axis: [0, 1, 0], guide: t}").replace("GEAR", "{joints: [pinion, drive], ratio: 1}")
    with pytest.raises(ModelError, match=r"gear 'mesh': both its joints are guided; leave one of them unguided, or remove the gear"):
        read_model_text(text, "gears.yaml")


def test_guides_that_contradict_gears_are_refused() -> None:
    text = TEXT.replace("gears:\n  mesh: GEAR\n", "\n".join((
        "  driven: {kind: revolute, bodies: [ground, other], at: [0, 0, 0], axis: [1, 0, 0], guide: 3*t}", "gears:",
        "  first: {joints: [pinion, drive], ratio: 2}", "  last: {joints: [driven, pinion], ratio: 1}", "scenes: {run: {end: 1}}", "",
    )))  # fmt: skip
    text = text.replace("bodies:\n", "bodies:\n  other: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}\n")
    model = read_model_text(text, "gears.yaml")
    with pytest.raises(GuideError, match=r"the guides of 'drive', 'driven' contradict the gear '(first|last)': no motion of the other"):
        generate(model, model.scenes["run"], ())


def test_mirror_image_turns_with_its_joints() -> None:
    """A displacement across the mirror changes its sign with its axis; an angle about an axis is the image of itself."""
    lines = TEXT.replace("GEAR", "{joints: [pinion, rack], ratio: 2}").splitlines()
    start = next(i for i, line in enumerate(lines) if line == "bodies:")
    inner = "\n".join(f"    {line}" for line in lines[start:])
    text = "\n".join(lines[:start]) + f"\nsubmodels:\n  train:\n{inner}\ninstances:\n  a: {{use: train}}\n  b: {{use: train, mirror: x}}\n"
    a, b = read_model_text(text, "gears.yaml").gears
    assert (a.name, b.name, b.joints) == ("a.mesh", "b.mesh", ("b.pinion", "b.rack"))
    axes = {j.name: j.axes[0] for j in read_model_text(text, "gears.yaml").joints if j.axes}
    # seen in space: a turn about y is reversed by the mirror x, and so is a way along x
    turned = -axes["b.pinion"][1] / axes["a.pinion"][1]
    moved = -axes["b.rack"][0] / axes["a.rack"][0]
    assert b.ratio / a.ratio == turned * moved


@pytest.mark.parametrize(
    ("gear", "said"),
    [
        ("{joints: [rack, pinion]}", "gear 'mesh': needs 'ratio' or 'law', one of them; write ratio: 2"),
        ("{joints: [rack, pinion], ratio: 25 mm, law: position}", "needs 'ratio' or 'law', one of them"),
        ("{joints: [rack, pinion], law: 20 mm}", "its law has no position"),
        ("{joints: [rack, pinion], law: sin(rack.displacement)}", "quantity 'rack.displacement'"),
        ("{joints: [rack, pinion], law: t*position}", "unknown symbol 't'"),
    ],
)
def test_faults_of_laws(gear: str, said: str) -> None:
    with pytest.raises(ModelError) as error:
        with_gear(gear)
    assert said in str(error.value)


def test_programs_that_have_no_laws_of_gears_are_not_given_any() -> None:
    model = with_gear("{joints: [rack, pinion], law: 0.02*position**3}")
    with pytest.raises(ModelError, match="gear 'mesh': only cutjoint has gears with a law; give it a ratio"):
        require_mechanics_alone(model)


def test_the_image_of_a_law_is_its_law() -> None:
    """An odd law of an angle about the mirror's normal counts as before, an even one too: all that counts otherwise is the displacement."""
    lines = TEXT.replace("GEAR", "{joints: [rack, pinion], law: 0.02*(sin(position) + position**2)}").splitlines()
    start = next(i for i, line in enumerate(lines) if line == "bodies:")
    inner = "\n".join(f"    {line}" for line in lines[start:])
    text = "\n".join(lines[:start]) + f"\nsubmodels:\n  train:\n{inner}\ninstances:\n  a: {{use: train}}\n  b: {{use: train, mirror: x}}\n"
    model = read_model_text(text, "gears.yaml")
    axes = {j.name: j.axes[0] for j in model.joints if j.axes}
    turned = -axes["b.pinion"][1] / axes["a.pinion"][1]
    moved = -axes["b.rack"][0] / axes["a.rack"][0]
    a, b = model.gears
    for angle in (0.3, -1.2):
        value = float(a.law.subs(POSITION, angle))
        assert float(b.law.subs(POSITION, turned * angle)) == pytest.approx(moved * value)


def in_a_loop(scenes: str = "") -> Model:
    """A loop of pinion, left and rack, two of them geared."""
    loop = "  left: {kind: revolute, bodies: [bar, wheel], at: [1, 0, 0], axis: [0, 1, 0]}\ngears:\n"
    text = TEXT.replace("gears:\n", loop).replace("GEAR", "{joints: [pinion, left], ratio: 2}")
    return read_model_text(text + scenes, "gears.yaml")


@pytest.mark.parametrize("scenes", ["", "outputs: [rack.displacement]\nscenes: {run: {end: 1}}\n"])
def test_gears_keep_their_joints_in_the_tree(scenes: str) -> None:
    topology = build_topology(in_a_loop(scenes))
    assert {"pinion", "left"} <= {t.joint.name for t in topology.tree}


def test_a_loop_of_geared_and_given_joints_is_refused() -> None:
    model = in_a_loop("scenes: {run: {end: 1, positions: {rack.displacement: 0}}}\n")
    with pytest.raises(TopologyError, match="joint 'left': it closes a loop but must not be cut, since gear 'mesh' couples its coordinate"):
        build_topology(model)


def test_natural_coordinates_refuse_gears_on_coordinates_that_they_do_not_have() -> None:
    text = TEXT.replace("kind: spherical", "kind: constant_velocity, axis: [1, 0, 0]")
    text = text.replace("GEAR", "{joints: [socket.angle_1, pinion], ratio: 2}") + "scenes: {run: {end: 1}}\n"
    model = read_model_text(text, "gears.yaml")
    assert generate(model, model.scenes["run"], ())
    with pytest.raises(ModelError, match="gear 'mesh': natural coordinates do not have the coordinates of a constant_velocity joint"):
        generate(model, model.scenes["run"], (), method="augmented")


@pytest.mark.parametrize("method", ["recursive", "classical"])
def test_explain_has_gears_and_what_follows_from_them(method: str) -> None:
    gears = "  mesh: {joints: [pinion, slide.angle], ratio: 2}\n  again: {joints: [slide.angle, pinion], ratio: 0.5}"
    text = TEXT.replace("  mesh: GEAR", gears)
    model = read_model_text(text + "scenes: {run: {end: 1}}\n", "gears.yaml")
    page = explain(model, model.scenes["run"], method)
    assert "| `mesh` | gears.yaml:21 | `pinion.angle`, `slide.angle` |" in page
    assert ("`again.ratio` |" in page.partition("| left out, since others imply them |")[2]) == (method == "classical")
    assert "`Phi = q_a - ratio q_b" in page
