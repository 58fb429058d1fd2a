"""Files that are unusual, as strangers write them: each becomes the mechanism that it says, or is refused with its place."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cutjoint.importing.document import Imported, import_file
from cutjoint.model.errors import ModelError
from cutjoint.model.records import Model
from cutjoint.topology.reading import read_model
from tests.importing.test_mjcf import hinged, wrapped
from tests.importing.test_urdf import hinge, link, robot

BASE = '<link name="base"/>'


def written(tmp_path: Path, text: str, ending: str) -> Path:
    path = tmp_path / f"strange.{ending}"
    path.write_text(text)
    return path


def taken(tmp_path: Path, text: str, ending: str = "urdf") -> tuple[Model, Imported]:
    path = written(tmp_path, text, ending)
    return read_model(path), import_file(path)


def fixed(name: str, parent: str, child: str) -> str:
    return f'<joint name="{name}" type="fixed"><parent link="{parent}"/><child link="{child}"/><origin xyz="1 0 0"/></joint>'


def ball(first: str, second: str) -> str:
    ends = f'<predecessor link="{first}"/><successor link="{second}"><origin xyz="2 0 0"/></successor>'
    return f'<loop name="tie" type="spherical">{ends}</loop>'


IDLE = BASE + link("a") + '<link name="idle"/>' + hinge("j", "base", "a", "1 0 0") + hinge("k", "a", "idle", "1 0 0")
ON_IDLE = '<link name="tip"/>' + fixed("m", "idle", "tip")


def test_what_hangs_on_an_idle_link_goes_with_it(tmp_path: Path) -> None:
    drive = '<transmission name="t"><joint name="k"/></transmission>'
    model, imported = taken(tmp_path, robot(IDLE + ON_IDLE, drive))
    assert ([body.name for body in model.bodies], [joint.name for joint in model.joints], model.markers) == (["a"], ["j"], ())
    assert "left out, since nothing resists their motion: idle, tip, k_drive" in imported.notes


@pytest.mark.parametrize(
    ("more", "bodies"),
    [
        (link("heavy") + fixed("n", "tip", "heavy"), ["a", "idle", "heavy"]),
        (link("c") + hinge("l", "base", "c", "1 0 0") + ball("tip", "c"), ["a", "idle", "c"]),
        (ball("tip", "idle"), ["a"]),
    ],
)
def test_an_idle_link_stays_where_something_that_resists_hangs_on_it(tmp_path: Path, more: str, bodies: list[str]) -> None:
    model, _ = taken(tmp_path, robot(IDLE + ON_IDLE, more))
    assert [body.name for body in model.bodies] == bodies


def test_a_mimic_of_a_mimic_turns_by_both_ratios(tmp_path: Path) -> None:
    links = BASE + "".join(map(link, "abc"))
    follow = '<mimic joint="{}" multiplier="{}"/>'
    joints = hinge("j", "base", "a", "1 0 0") + hinge("k", "a", "b", "1 0 0", follow.format("j", 2))
    model, _ = taken(tmp_path, robot(links, joints + hinge("l", "b", "c", "1 0 0", follow.format("k", 3))))
    assert {gear.joints: float(gear.ratio) for gear in model.gears} == {("k", "j"): 2, ("l", "j"): 6}


def test_names_with_line_breaks_stay_in_their_comment(tmp_path: Path) -> None:
    _, imported = taken(tmp_path, robot(IDLE.replace('"idle"', '"x&#10;outputs: [bad.angle]"'), ""))
    assert "# Left out, since nothing resists their motion: x\\noutputs: [bad.angle]." in imported.text


@pytest.mark.parametrize("word", ["true", "Null", "FALSE"])
def test_names_that_are_no_text_in_yaml(tmp_path: Path, word: str) -> None:
    model, _ = taken(tmp_path, robot(BASE + link(word), hinge("j", "base", word, "0 0 0")).replace('"r"', f'"{word}"'))
    assert (model.name, [body.name for body in model.bodies]) == (f"{word}_0", [f"{word}_0"])


def test_pictures_outside_the_folder_are_not_drawn(tmp_path: Path) -> None:
    inside = tmp_path / "inside"
    inside.mkdir()
    (tmp_path / "a.stl").write_bytes(b"")
    (inside / "b.stl").symlink_to(tmp_path / "a.stl")
    for file in ("../a.stl", "file:///a.stl", str(tmp_path / "a.stl"), "b.stl", "package://x/../a.stl"):
        visual = f'<visual><geometry><mesh filename="{file}"/></geometry></visual></link>'
        _, imported = taken(inside, robot(BASE + link("a").replace("</link>", visual), hinge("j", "base", "a", "0 0 0")))
        assert "visual" not in imported.text


def test_a_moment_beside_which_all_others_are_rounding(tmp_path: Path) -> None:
    moments = 'ixx="1e12" iyy="1" izz="1"'
    model, _ = taken(tmp_path, robot(BASE + link("a", inertia=moments), hinge("j", "base", "a", "0 0 0")))
    assert [[float(x) for x in body.inertia] for body in model.bodies] == [[0] * 6, [999999999998, 0, 0, 0, 0, 0]]


def test_paths_that_no_file_has_are_not_drawn(tmp_path: Path) -> None:
    visual = f'<visual><geometry><mesh filename="{"x" * 5000}.stl"/></geometry></visual></link>'
    _, imported = taken(tmp_path, robot(BASE + link("a").replace("</link>", visual), hinge("j", "base", "a", "0 0 0")))
    assert "visual" not in imported.text


@pytest.mark.parametrize("joint", [fixed("j", "base", "a"), hinge("j", "base", "a", "1 0 0")])
def test_a_loop_that_nothing_can_close_is_refused(tmp_path: Path, joint: str) -> None:
    loop = '<loop name="far" type="spherical"><predecessor link="a"/><successor link="base"><origin xyz="1 0 7"/></successor></loop>'
    with pytest.raises(ModelError, match="loop 'far': does not close: in the position found it is violated by 7 m or rad"):
        read_model(written(tmp_path, robot(BASE + link("a"), joint + loop), "urdf"))


def test_quaternions_and_limits_of_a_urdf(tmp_path: Path) -> None:
    turned = hinge("j", "base", "a", "0 0 0", '<limit lower="0.3" upper="0.3"/>').replace("/><axis", ' quat_xyzw="1 0 0 1"/><axis', 1)
    model, imported = taken(tmp_path, robot(BASE + link("a"), turned))
    assert [float(x) for x in model.joints[0].axes[0]] == pytest.approx([0, -1, 0])
    assert "j moves, though its limits are equal: limits are not heeded" in imported.notes


def test_transmissions_name_joints_that_are_there(tmp_path: Path) -> None:
    wrong = '<transmission name="t"><joint name="z"/></transmission>'
    with pytest.raises(ModelError, match="joint 'z': is of a transmission, and no joint of the robot"):
        read_model(written(tmp_path, robot(IDLE, wrong), "urdf"))


LINK = '<link name="a"><pose {}</pose><inertial><mass>1</mass></inertial></link>'
TURN = '<joint name="j" type="revolute"><parent>world</parent><child>a</child><axis><xyz>1 0 0</xyz>{}</axis></joint>'


def sdf(inside: str, version: str = "1.9") -> str:
    return f'<sdf version="{version}"><model name="m">{inside}</model></sdf>'


@pytest.mark.parametrize(
    ("text", "axis", "at"),
    [
        (sdf(LINK.format('degrees="true">1 0 0 0 0 90') + TURN), [0, 1, 0], [1, 0, 0]),
        (sdf(LINK.format('rotation_format="quat_xyzw">1 0 0 0 0 2 2') + TURN), [0, 1, 0], [1, 0, 0]),
        (sdf('<pose degrees="true">0 0 5 0 90 0</pose>' + LINK.format(">1 0 0 0 0 0") + TURN), [0, 0, -1], [0, 0, 4]),
        (sdf(LINK.format('degrees="true">1 0 0 0 0 90') + TURN, "1.4"), [1, 0, 0], [1, 0, 0]),
    ],
)
def test_poses_and_axes_of_an_sdf(tmp_path: Path, text: str, axis: list[float], at: list[float]) -> None:
    model, _ = taken(tmp_path, text.replace("{}", ""), "sdf")
    (joint,) = model.joints
    assert np.array([*joint.axes[0], *joint.at], float) == pytest.approx([*axis, *at], abs=1e-12)


def test_a_static_model_stands_and_a_mimic_follows(tmp_path: Path) -> None:
    both = LINK.format(">1 0 0 0 0 0") + TURN.format("") + LINK.format(">2 0 0 0 0 0").replace('"a"', '"b"')
    mimic = '<mimic joint="j"><multiplier>-3</multiplier><offset>0</offset></mimic>'
    second = TURN.format(mimic).replace(">a<", ">b<").replace('"j"', '"k"', 1)
    model, _ = taken(tmp_path, sdf(both + second), "sdf")
    assert (model.gears[0].joints, float(model.gears[0].ratio)) == (("k", "j"), -3)
    model, _ = taken(tmp_path, sdf("<static>true</static>" + both), "sdf")
    assert {joint.name: joint.kind for joint in model.joints} == {"a_weld": "fixed", "b_weld": "fixed"}
    with pytest.raises(ModelError, match="joint 'j': has the name of another"):
        read_model(written(tmp_path, sdf(both + second.replace('"k"', '"j"')), "sdf"))


class TestMjcf:
    """A compiled model of MuJoCo, and what it does not say by itself."""

    @pytest.fixture(autouse=True)
    def _mujoco(self) -> None:
        pytest.importorskip("mujoco")

    def test_names_that_are_made_up_are_nobody_elses(self, tmp_path: Path) -> None:
        two = '<body name="a"><joint name="j"/><joint name="k" axis="1 0 0"/><geom size="0.1"/></body>'
        plain = '<body><joint/><geom size="0.1"/>' + hinged("body_2", "0 0 0") + "</body>"
        model, _ = taken(tmp_path, wrapped(two + plain + hinged("a_1", "0 0 0"), ""), "xml")
        parents = {joint.name: (joint.base, joint.follower) for joint in model.joints}
        assert [body.name for body in model.bodies if body.mass != 0] == ["a", "body_2_2", "body_2", "a_1"]
        assert (parents["j"][1], parents["k"]) == (parents["k"][0], (parents["j"][1], "a"))
        assert parents["a_1_j"] == ("ground", "a_1")

    def test_flags_switch_parts_off(self, tmp_path: Path) -> None:
        flags = " ".join(f'{name}="disable"' for name in ("gravity", "spring", "damper", "frictionloss", "equality", "actuation"))
        arms = hinged("a", "0 0 0", hinged("b", "1 0 0")).replace("<joint", '<joint damping="1" stiffness="2" frictionloss="3"')
        more = '<equality><joint joint1="a_j" joint2="b_j"/></equality><actuator><motor name="m" joint="a_j"/></actuator>'
        model, imported = taken(tmp_path, wrapped(arms, f"{more}<option><flag {flags}/></option>"), "xml")
        assert (model.forces, model.gears, model.parameters, [float(x) for x in model.gravity]) == ((), (), (), [0, 0, 0])
        assert "the actuator m is left out: it is switched off" in imported.notes

    def test_rotors_and_dampers_of_actuators_are_the_joints(self, tmp_path: Path) -> None:
        import mujoco

        motor = '<actuator><motor joint="a_j" gear="3" armature="0.1" damping="2"/></actuator>'
        path = written(tmp_path, wrapped(hinged("a", "0 0 0"), motor), "xml")
        (joint,) = read_model(path).joints
        m = mujoco.MjModel.from_xml_path(str(path))
        data, mass = mujoco.MjData(m), np.zeros((1, 1))
        data.qvel[:] = 1
        mujoco.mj_forward(m, data)
        mujoco.mj_fullM(m, data, mass)
        (body,) = read_model(path).bodies
        assert float(joint.armature) + float(body.inertia[1]) + float(body.mass) * 0.2**2 == pytest.approx(mass[0, 0], rel=1e-10)
        assert f"spring: {{damping: {-int(data.qfrc_passive[0])}}}" in import_file(path).text

    def test_keys_say_what_they_do_not_set(self, tmp_path: Path) -> None:
        free = '<body name="f" pos="0 0 3"><freejoint/><geom size="0.1"/></body>'
        key = '<keyframe><key name="motion" qpos="0.5 0 0 2 1 0 0 0" qvel="1 0 0 0 0 0 0"/></keyframe>'
        model, imported = taken(tmp_path, wrapped(hinged("a", "0 0 0") + free, key), "xml")
        assert list(model.scenes) == ["motion", "motion_scene"]
        assert "of the key motion are left out: positions of free bodies and balls, speeds" in imported.notes

    @pytest.mark.parametrize(
        ("joint", "more", "message"),
        [
            ('damping="1 2"', "", "a spring or a damper that is not linear"),
            ('stiffness="1 2"', "", "a spring or a damper that is not linear"),
            ("", '<tendon><fixed armature="1"><joint joint="a_j" coef="1"/></fixed></tendon>', "a tendon with friction, armature"),
            ("", '<equality><connect name="p" site1="s" site2="w"/><connect site1="t" site2="v"/></equality>', "not as far apart on both"),
        ],
    )
    def test_what_is_refused(self, tmp_path: Path, joint: str, more: str, message: str) -> None:
        sites = '<site name="s"/><site name="t" pos="0 0 1"/>'
        arm = hinged("a", "0 0 0", sites).replace("<joint", f"<joint {joint}") + '<site name="w"/><site name="v" pos="0 0 1.1"/>'
        with pytest.raises(ModelError, match=message):
            read_model(written(tmp_path, wrapped(arm, more), "xml"))

    @pytest.mark.parametrize("place", ["1e300 0 0", "0 nan 0", "-2e12 0 0"])
    def test_large_numbers_have_their_line(self, tmp_path: Path, place: str) -> None:
        with pytest.raises(ModelError, match="body 'b': has numbers that are not finite, or very large"):
            read_model(written(tmp_path, wrapped(hinged("a", "0 0 0", hinged("b", place)), ""), "xml"))

    def test_a_world_does_not_float(self, tmp_path: Path) -> None:
        with pytest.raises(ModelError, match="its first link is the world"):
            import_file(written(tmp_path, wrapped(hinged("a", "0 0 0"), ""), "xml"), free=True)
