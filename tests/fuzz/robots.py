"""Damaged URDF, with a YAML beside it or not, SDF and MJCF: each becomes a model, or is refused with its place; nothing else comes out.

Some URDF are whole: their accelerations are compared with those of an independent reader.
"""

from __future__ import annotations

import json
import os
import random
import re
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from cutjoint.package.errors import CutjointError
from cutjoint.topology.reading import read_model
from tests.importing.test_sdf import FOUR_BAR

from . import whole_robots

_LEG = Path(__file__).parents[1] / "importing" / "leg.urdf"
_TREE = """<mujoco><asset><texture type="2d" file="none.png"/></asset>
<worldbody><body name="a" pos="0 0 1"><joint name="j" axis="0 1 0" armature="0.1"/>
<geom type="box" size="0.1 0.2 0.3"/><body name="b" pos="1 0 0"><joint name="k" type="slide"/><geom type="sphere" size="0.1"/></body></body>
<body name="d" pos="0 0 -1"><joint type="ball" stiffness="2" damping="0.1"/><geom type="sphere" size="0.1" pos="0 0 0.2"/></body>
<body name="c"><freejoint/><geom type="capsule" fromto="0 0 0 0 0 1" size="0.1"/></body></worldbody>
<equality><connect body1="b" body2="c" anchor="0 0 0.1"/><joint joint1="j" joint2="k" polycoef="0 1 0.5 0 0"/></equality>
<actuator><position joint="j" kp="10"/></actuator></mujoco>"""
_WORLD = """<sdf version="1.9"><world name="w"><frame name="here"><pose>0 0 2 0 0 0</pose></frame><model name="a" placement_frame="tip">
<pose relative_to="here">0 0 3 0 0 0</pose><link name="arm"><pose>1 0 0 0 0 0</pose><inertial><mass>1</mass></inertial>
<visual name="v"><material><diffuse>0.2 0.4 1</diffuse></material></visual></link><frame name="tip" attached_to="arm"/>
<model name="inner"><link name="arm"><inertial><mass>1</mass></inertial></link></model>
<joint name="j" type="revolute"><parent>tip</parent><child>inner::arm</child><axis><xyz>0 1 0</xyz></axis></joint></model>
<model name="floor"><static>1</static><link name="slab"/></model>
<joint name="tie" type="ball"><parent>a::arm</parent><child>world</child></joint></world></sdf>"""
_BESIDE = """closed_loop: [["toe", "rod"]]
type: ["3d"]
joint_name: ["knee", "elbow", "sole"]
joint_type: ["SPHERICAL", "UJOINT_ZX", "FIXED"]
name_mot: ["motor"]
"""
#: The share of files without a fault, whose accelerations are compared with an independent reader.
_WHOLE = 0.2
_WORDS = (
    "0", "-1", "1e308", "nan", "1e-300", "", "inf", "1 2 3", "0 0 0", "a", "rod", "thigh", "world", "-0", "1e12", "9" * 20, "fixed",
    "prismatic", "ball", "<", "&", "'", '"', "\0", "\u00e9", "__model__", "../x", "/etc/passwd",
    "1.\u00b2", "1." + "9" * 5000, "x" * 5000, "pipe.xml", "loop.xml", "0 0 1",
)  # fmt: skip


def make(rng: random.Random) -> str:
    """A file's name and content, and that of a YAML beside it, as JSON."""
    if rng.random() < _WHOLE and find_spec("pinocchio"):
        return json.dumps({"name": "whole.urdf", "content": whole_robots.write(rng), "beside": "", "whole": rng.randrange(1000)})
    seeds = {".urdf": _LEG.read_text(encoding="utf-8"), ".sdf": FOUR_BAR, ".world": _WORLD}
    seeds |= {".xml": _TREE} if find_spec("mujoco") else {}
    ending = rng.choice(sorted(seeds))
    text = seeds[ending]
    for _ in range(rng.choice((1, 1, 2, 4))):
        text = _damaged(rng, text)
    beside = _damaged(rng, _BESIDE) if ending == ".urdf" and rng.random() < 0.5 else ""
    return json.dumps({"name": f"robot{ending}", "content": text, "beside": beside})


def _damaged(rng: random.Random, text: str) -> str:
    """A value, a text or a tag is another one, goes, or stands twice."""
    places = [found.span() for found in re.finditer(r'"[^"]*"|>[^<]+<|</?\w+', text)]
    if not places:
        return text
    (start, end), (other, last) = rng.choice(places), rng.choice(places)
    match rng.randrange(10):
        case 0:
            return text[:start] + text[end:]
        case 1:
            low, high = sorted((start, last))
            return text[:high] + text[low:high] + text[high:]
        case 2 | 3:
            return text[:start] + text[other:last] + text[end:]
    closing = text[end - 1] if text[end - 1] in '"<' else ""
    return text[:start] + text[start] + rng.choice(_WORDS) + closing + text[end:]


def check(text: str) -> tuple[str, ...]:
    """The reason why a file was refused."""
    case = json.loads(text)
    with TemporaryDirectory() as folder:
        path = Path(folder) / case["name"]
        os.mkfifo(path.with_name("pipe.xml"))
        path.with_name("loop.xml").symlink_to("loop.xml")
        path.write_text(case["content"], encoding="utf-8", errors="replace")
        if case["beside"]:
            path.with_suffix(".yaml").write_text(case["beside"], encoding="utf-8", errors="replace")
        if "whole" in case:
            whole_robots.require_accelerations(path, case["whole"])
            return ()
        try:
            read_model(path)
        except CutjointError as error:
            first = str(error).splitlines()[0]
            assert re.match(rf"{re.escape(str(path.with_suffix('')))}({re.escape(path.suffix)}|\.yaml)+:\d+:\d+: ", first), first
            return (first.removeprefix(str(path.with_suffix(""))),)
    return ()
