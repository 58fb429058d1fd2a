"""The generated source: readable, reproducible, without traces of where it was made."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from hashlib import sha256

import pytest

from cutjoint.compile.derivation import derive
from cutjoint.compile.pipeline import generate
from cutjoint.emit.simulator import emit
from cutjoint.emit.source import Source
from cutjoint.formulate.lanes import schedule_recursive
from cutjoint.formulate.records import CHECKS
from cutjoint.model.read import read_model, read_model_text
from cutjoint.program.blocks import BindingTime
from cutjoint.run.scenes import find_scene
from cutjoint.toolchain.compiler import find_compiler
from cutjoint.toolchain.drivers import Kind
from cutjoint.toolchain.objects import find_objects
from tests.conftest import MODELS, ROOT
from tests.hash_seeds import outputs


@cache
def source(model: str, scene: str) -> Source:
    read = read_model(MODELS / f"{model}.yaml")
    chosen = find_scene(read, scene)
    return generate(read, chosen, chosen.outputs)[2]


@pytest.mark.parametrize(("model", "scene"), [("four_bar", "swing"), ("iltis", "simul1s")])
def test_same_bytes_under_any_hash_seed(model: str, scene: str) -> None:
    script = f"from tests.emit.test_source import source; print(source({model!r}, {scene!r}).digest)"
    assert set(outputs(script, "0", "12345")) == {source(model, scene).digest}


def test_no_folder_and_no_date_in_the_source() -> None:
    for name, text in source("iltis", "simul1").files.items():
        assert str(ROOT) not in text, name
        assert not re.search(r"\b20[0-9]{2}-[0-9]{2}-[0-9]{2}\b", text), name


def test_no_two_sections_of_a_function_have_one_heading() -> None:
    """A second pass over the bodies says what it is for."""
    for name, text in source("four_bar", "swing").files.items():
        headings = re.findall(r"^  // \w+: .*\n(?:  //   .*\n)*", text, re.MULTILINE)
        assert len(headings) == len(set(headings)), name
    evaluate = source("four_bar", "swing").files["evaluate.cpp"]
    assert evaluate.index("// accelerations: crank_0.pin\n") < evaluate.index("// accelerations: crank_0.pin, pass 2: errors of pass 1\n")
    assert "// accelerations: crank_0.pin, of gaps alone\n" in source("four_bar", "swing").files["project.cpp"]


@pytest.mark.cpp  # its name is in the keys of objects
def test_a_banner_has_the_digest_of_the_model_file_and_its_code_is_that_of_a_file_with_another_comment() -> None:
    text = (MODELS / "four_bar.yaml").read_text()
    made = []
    for written in (text, f"{text}# a comment\n"):
        read = read_model_text(written, str(MODELS / "four_bar.yaml"))
        scene = find_scene(read, "swing")
        made.append(generate(read, scene, scene.outputs)[2])
        digest = sha256(written.encode()).hexdigest()[:12]
        assert all(f"from model 'four_bar' (sha256 {digest}), " in code.partition("\n")[0] for code in made[-1].files.values())
    one, other = made
    assert [name for name in one.files if one.files[name].partition("\n")[2] != other.files[name].partition("\n")[2]] == []
    assert one.digest == other.digest
    assert find_objects(one, find_compiler(), (), Kind()) == find_objects(other, find_compiler(), (), Kind())


def test_scenes_that_differ_in_road_only_share_their_source() -> None:
    assert source("iltis", "simul1").digest == source("iltis", "simul2").digest
    assert source("iltis", "simul1").digest != source("iltis", "simul1s").digest


def test_quantities_keep_the_names_of_the_literature() -> None:
    """Rotation, motion subspace, mass and inverse of D of chassis and suspensions can be found by name, with the line of the model."""
    text = source("iltis", "simul1").files["evaluate.cpp"]
    suspension = "R_front_left_carrier_x4_yy", "b_front_left_tie_rod_x4_wx_angle_1_rate", "Dinv_front_left_arm_x4_arm_hinge"
    for name in (*suspension, "Mc_front_left_carrier_x4_wx_wx"):
        assert f"const Lanes4 {name} = " in text
    for name in ("R_global_xx", "M_chassis_vx_wy", "Dinv_chassis_vx"):
        assert f"const Real {name} = " in text
    line = next(i for i, x in enumerate((MODELS / "iltis.yaml").read_text().splitlines(), 1) if "carrier_ball: {" in x)
    assert "// condensation: front_left.carrier_ball\n  //   M^c = M + sum M^c" in text
    assert f"  //   iltis.yaml:{line}\n" in text


def test_a_rotation_is_not_named_after_its_negative() -> None:
    """1 - 2 (y^2 + z^2) is R_xx, whatever sign the compiler's normal form prefers."""
    text = source("iltis", "simul1").files["evaluate.cpp"]
    assert "const Lanes4 R_front_left_carrier_ball_x4_xx = Real(1.0) - " in text


@pytest.mark.parametrize("value", [0.1 + 0.2, 1e-300, 5e-324, 123456789.123456789])
def test_numbers_are_printed_by_shortest_round_trip(value: float) -> None:
    from cutjoint.emit.printer import Printer
    from cutjoint.program.scalars import Graph

    graph = Graph()
    printer = Printer(graph=graph, names={}, known={}, prefixes=[], used_names=frozenset(), roads={})
    text = printer.text(graph.const(value))
    assert float(text.removeprefix("Real(").removesuffix(")")) == value
    assert text == f"Real({value!r})"


def test_operands_of_operators_that_bind_no_tighter_are_in_parentheses() -> None:
    """Python reads what is printed as C++ does."""
    from cutjoint.emit.printer import Printer
    from cutjoint.program.scalars import Graph

    graph = Graph()
    x, y, z = (graph.symbol("q", i, BindingTime.STEP) for i in range(3))
    printer = Printer(graph=graph, names={}, known={x: "x", y: "y", z: "z"}, prefixes=[], used_names=frozenset(), roads={})
    cases = {
        graph.div(x, graph.mul(y, z)): 7 / (3 * 5), graph.div(x, graph.div(y, z)): 7 / (3 / 5), graph.sub(x, graph.sub(y, z)): 7 - (3 - 5),
        graph.mul(x, graph.add(y, z)): 7 * (3 + 5), graph.div(graph.add(x, y), z): (7 + 3) / 5, graph.sub(x, graph.add(y, z)): 7 - (3 + 5),
    }  # fmt: skip
    for node, value in cases.items():
        assert eval(printer.text(node), {"x": 7, "y": 3, "z": 5}) == value, printer.text(node)


def test_a_check_of_the_run_leaves_the_other_functions_as_they_are() -> None:
    """Lanes too, which ``energy`` does without."""
    read = read_model(MODELS / "iltis.yaml")
    chosen = find_scene(read, "simul1")
    equations = derive(read, chosen, chosen.outputs)
    without = replace(equations, functions=tuple(f for f in equations.functions if f.name not in CHECKS))
    made, before = (emit(schedule_recursive(e, lanes=True), e).files for e in (equations, without))
    assert set(made) - set(before) == {"energy.cpp"}
    assert [name for name in before if name.endswith(".cpp") and made[name] != before[name]] == []
