"""Components of reactions that are determined where cut joints have more equations than they need."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from cutjoint.analysis.redundancy import find_indeterminate, reaction_outputs
from cutjoint.cli import main
from cutjoint.model.read import read_model_text
from cutjoint.run.scenes import find_scene
from cutjoint.topology.build import build_topology
from tests.conftest import MODELS, needs_cpp
from tests.mechanisms.overconstrained import parallel_cranks_text

PRESS = (MODELS / "press.yaml").read_text()
SLIDER_CRANK = (MODELS / "slider_crank.yaml").read_text()


def with_reactions(text: str, *joints: str) -> str:
    """A model that reports the reactions of some joints along global axes."""
    return f"{text}\nreactions:\n" + "".join(f"  of_{joint}: {{joint: {joint}, axes_of: ground}}\n" for joint in joints)


def indeterminate(text: str) -> set[str]:
    model = read_model_text(text, "m.yaml")
    return set(find_indeterminate(build_topology(model), find_scene(model, next(iter(model.scenes), None)), reaction_outputs(model)))


@pytest.mark.parametrize("cut", ["", "pin", "elbow", "wrist"])
def test_a_plane_loop_of_hinges_determines_what_is_in_its_plane(cut: str) -> None:
    """x and z are the plane's, whichever joint is cut."""
    text = PRESS.replace(f"  {cut}: {{kind: revolute,", f"  {cut}: {{kind: revolute, cut: true,") if cut else PRESS
    hinges = ("pin", "elbow", "wrist", "rail")
    expected = {f"of_{joint}.{component}" for joint in hinges for component in ("Fy", "Mx", "Mz")}
    assert indeterminate(with_reactions(text.replace("rates: {pin.angle_rate: 10}", ""), *hinges)) == expected


def test_a_loop_without_redundant_equations_determines_all() -> None:
    text = SLIDER_CRANK.replace("rates: {crank_pin.angle_rate: 6}, ", "")
    assert indeterminate(with_reactions(text, "crank_pin", "slide", "cross", "ball")) == set()


def test_a_third_crank_of_a_parallelogram_leaves_forces_in_the_plane_open() -> None:
    """Three parallel cranks share the forces along them; moments about their axes are determined as ever."""
    found = indeterminate(with_reactions(parallel_cranks_text(3), *(f"pin_{i}" for i in range(3))))
    for i in range(3):
        assert {f"of_pin_{i}.Fy", f"of_pin_{i}.Fz"} <= found
        assert f"of_pin_{i}.Mz" not in found


def test_what_is_determined_stays_so_where_nothing_else_is_asked() -> None:
    """The force along a leaf of the vehicle, which published values have, beside redundant equations elsewhere."""
    assert indeterminate((MODELS / "iltis.yaml").read_text()) == set()
    text = with_reactions(PRESS.replace("rates: {pin.angle_rate: 10}", ""), "elbow")
    model = read_model_text(text, "m.yaml")
    alone = [output for output in reaction_outputs(model) if output.column == "of_elbow.Fx"]
    assert find_indeterminate(build_topology(model), find_scene(model, next(iter(model.scenes), None)), alone) == ()


def test_a_tree_determines_all() -> None:
    text = with_reactions((MODELS / "pendulum.yaml").read_text(), "pin")
    assert indeterminate(text) == set()


@needs_cpp
def test_check_and_simulate_mark_them(tmp_path: Path) -> None:
    path = tmp_path / "press.yaml"
    outputs = "outputs: [pin.angle, slider.x, slider.vx, spring.force]"
    assert outputs in PRESS
    path.write_text(with_reactions(PRESS.replace(outputs, "outputs: [slider.x, of_elbow.Fx, of_elbow.Fy]"), "elbow"))
    said = " ".join(CliRunner().invoke(main, ["check", str(path)]).output.split())
    assert "indeterminate reactions: of_elbow.Fy, of_elbow.Mx, of_elbow.Mz" in said
    said = " ".join(CliRunner().invoke(main, ["simulate", str(path), "--out", str(tmp_path / "x.csv"), "--no-error"]).output.split())
    assert "indeterminate: of_elbow.Fy" in said
    assert "of_elbow.Fx" not in said
