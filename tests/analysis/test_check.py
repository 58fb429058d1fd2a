"""Messages of ``check`` about redundant equations and the choice of cut joints."""

from __future__ import annotations

from pathlib import Path

from click.testing import CliRunner

from cutjoint.cli import main
from tests.analysis.test_inertia import dead_centre, spherical_tie_rods
from tests.conftest import MODELS
from tests.mechanisms.overconstrained import IN_LINE, parallel_cranks_text


def check(path: Path, status: int = 0) -> str:
    result = CliRunner().invoke(main, ["check", str(path)])
    assert result.exit_code == status, result.output
    return " ".join(result.output.split())


def test_iltis() -> None:
    said = check(MODELS / "iltis.yaml")
    assert "design position rank 32 as in 4 other poses of the motion, condition 31.5" in said
    assert "front_left.leaf_hinge iltis.yaml:66 axis_x in every pose" in said
    assert "choice of the cut joints operations counted once redundant condition" in said
    assert "given by the model: 711 operations more than at front_left.leaf_ball" in said
    assert said.count(" or rear_right.") == 6


def test_a_singular_design_position(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(parallel_cranks_text(2, IN_LINE))
    said = check(path)
    assert "instantaneously singular: rank 1, but 2 in 4 other poses of the motion" in said
    assert "m.yaml:13 x in the design position only" in said


def test_lengths_that_only_nearly_agree(tmp_path: Path) -> None:
    """A third crank that leans by a rounded digit leaves no motion."""
    path = tmp_path / "m.yaml"
    path.write_text(parallel_cranks_text(3).replace("at: [2, 0, 0]", "at: [2.000001, 0, 0]"))
    said = check(path)
    assert "rigid, condition" in said
    assert "some equations are nearly redundant; are the file's numbers rounded?" in said


def test_a_tree_has_no_loops_to_speak_of(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(parallel_cranks_text(1))
    said = check(path)
    assert "redundant" not in said
    assert "choice" not in said


def test_a_motion_without_inertia_is_an_error(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(spherical_tie_rods())
    assert "nothing resists the motion of body 'rear_left.tie_rod'" in check(path, status=1)


def test_a_massless_link_in_line_is_named_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(f"{dead_centre()}scenes: {{turn: {{end: 1}}}}\n")
    assert "m.yaml:5:3: body 'crank': in the design position no mass resists its motion (main_bearing.angle_rate," in check(path)
