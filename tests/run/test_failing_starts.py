"""Runs that fail before their first row have no rows, neither theirs nor those of an earlier run, whose files stay as they are."""

from __future__ import annotations

from contextlib import chdir
from functools import cache
from math import hypot, sqrt
from pathlib import Path

import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.compile.pipeline import compile_scene
from cutjoint.model.read import read_model_text
from cutjoint.run.artifact import Artifact
from cutjoint.run.simulation import simulate
from cutjoint.tasks.realtime import run_in_real_time
from tests.conftest import MODELS, needs_cpp

pytestmark = needs_cpp

#: A pendulum on a spring that has no force where its length is the parameter's, as it is at the start for 2.
PENDULUM = """
cutjoint: 1
name: pendulum
gravity: [0, 0, -9.81]
parameters: {gap: {value: 1, unit: m, binding: param}}
bodies: {bob: {mass: 1, centre_of_mass: [0, 0, -1], inertia: [0.1, 0.1, 0.1]}}
joints: {pin: {kind: revolute, bodies: [ground, bob], at: [0, 0, 0], axis: [0, 1, 0]}}
forces: {spring: {kind: point_spring, bodies: [ground, bob], from: [0, 0, 1], to: [0, 0, -1], law: "1/(length - gap)"}}
outputs: [pin.angle]
scenes: {rest: {end: 0.02, output_step: 0.01, numerics: {dt: 0.01}}}
"""
NO_START, FAILURE = {"gap": 2.0}, "the law of 'spring' (pendulum.yaml:8) has no finite value: the divisor leaves its domain"


@cache
def pendulum() -> Artifact:
    model = read_model_text(PENDULUM, "pendulum.yaml")
    return compile_scene(model, model.scenes["rest"])


def test_a_run_without_a_start_has_no_rows_of_an_earlier_run(tmp_path: Path) -> None:
    places = {name: tmp_path / "new" / name / "rows" for name in ("out", "steps")}
    how = {"integrator": "trapezoidal", "events": "crossed"}
    assert simulate(pendulum(), **places, **how).t.size == 3  # type: ignore[arg-type]
    before = {place: place.read_bytes() for place in places.values()}
    run = simulate(pendulum(), parameters=NO_START, **places, **how, check=False)  # type: ignore[arg-type]
    assert run.failure is not None
    assert run.failure.message == FAILURE
    assert run.t.size == run["pin.angle"].size == 0
    assert {place: place.read_bytes() for place in places.values()} == before
    assert [p.name for p in sorted((tmp_path / "new").rglob("*.*"))] == ["rows.units.json"]


def test_steps_against_the_clock_of_a_run_without_a_start(tmp_path: Path) -> None:
    out = tmp_path / "times.csv"
    for place in (None, out, out):
        times = run_in_real_time(pendulum(), parameters=NO_START, out=place, check=False)
        assert times.failure is not None
        assert times.failure.message == FAILURE
        assert times.durations.size == times.lateness.size == 0
        assert run_in_real_time(pendulum(), out=out).durations.size == 2


def test_the_command_says_why_a_run_against_the_clock_has_no_start(tmp_path: Path) -> None:
    model, out = tmp_path / "pendulum.yaml", tmp_path / "times.csv"
    model.write_text(PENDULUM, encoding="utf-8")
    done = CliRunner().invoke(main, ["realtime", str(model), "--set", "gap=2", "--out", str(out)])
    assert done.exit_code == 1
    assert FAILURE in done.output
    assert [p.name for p in tmp_path.iterdir()] == ["pendulum.yaml"]


def test_links_stay_links_and_devices_stay(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "run.csv")
    simulate(pendulum(), out=tmp_path / "link", steps=Path("/dev/null"))
    simulate(pendulum(), out=tmp_path / "link", steps=Path("/dev/null"))
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "run.csv").read_text().startswith("t,pin.angle\n")
    assert Path("/dev/null").is_char_device()


#: An arm on a strut, whose length at the start is an input's by a guide, or else a parameter's.
STRUT = """\
cutjoint: 1
name: strut
gravity: [0, 0, -9.81]
parameters: {reach: {value: 0, unit: m, binding: param}}
points: {A: [0, 0, 0], B: [0.5, 0, 0.4], C: [0.6, 0, 0]}
bodies:
  arm: {mass: 1, centre_of_mass: {midpoint: [A, B]}, inertia: [0.01, 0.01, 0.01]}
  tube: {mass: 1, centre_of_mass: C, inertia: [0.01, 0.01, 0.01]}
  rod: {mass: 1, centre_of_mass: B, inertia: [0.01, 0.01, 0.01]}
joints:
  a: {kind: revolute, bodies: [ground, arm], at: A, axis: [0, 1, 0]}
  foot: {kind: revolute, bodies: [ground, tube], at: C, axis: [0, 1, 0]}
  slide: {kind: prismatic, bodies: [tube, rod], at: C, axis: {from: C, to: B}, spring: {stiffness: 1000, damping: 10}}
  head: {kind: revolute, bodies: [rod, arm], at: B, axis: [0, 1, 0], cut: true}
outputs: [a.angle]
scenes:
  out: {end: 0.01, positions: {slide.displacement: reach}}
"""
DRIVEN = STRUT.replace("binding: param", "binding: input").replace("spring: {stiffness: 1000, damping: 10}", "guide: reach").replace(
    ", positions: {slide.displacement: reach}", ""
)  # fmt: skip
COMMANDS = ("simulate --no-error --dt 1ms --out run.csv", "modes", "modes --at 0.01", "equilibrium", "view --out page.html")


@pytest.mark.parametrize(("text", "place"), [(STRUT, "strut.yaml:17:32"), (DRIVEN, "strut.yaml:13:3")], ids=["positions", "guide"])
def test_a_loop_that_cannot_close_is_reported_in_the_same_words_everywhere(text: str, place: str, tmp_path: Path) -> None:
    """The circle that the strut's head reaches leaves the arm's, of radius |AB|: the gap is what is left between the two at least."""
    (tmp_path / "strut.yaml").write_text(text, encoding="utf-8")
    reported = set()
    with chdir(tmp_path):
        for command in COMMANDS:
            done = CliRunner(env={"COLUMNS": "300"}).invoke(main, [*command.split(), "strut.yaml", "--set", "reach=3"])
            assert done.exit_code == 1
            (line,) = (line for line in done.output.splitlines() if "cannot close" in line)
            reported.add(line.removesuffix("; no results were written"))
    (line,) = reported
    begin = f"{place}: scene 'out': the loop cannot close from the given coordinates with reach = 3: "
    assert line.startswith(begin)
    gap, _, rest = line.removeprefix(begin).partition(" ")
    apart = 3 + hypot(0.1, 0.4) - hypot(0.5, 0.4) - 0.6
    assert apart / sqrt(2) < float(gap) < apart * 1.1
    possible = f"the nearest pose has slide.displacement = {3 - apart:.6g} in place of 3 m; " if text == STRUT else ""
    assert rest.startswith(f"m or rad are left at 'head.x' (strut.yaml:14:3), which closes it; {possible}check the joints' points, guides,")


def test_the_nearest_pose_may_differ_from_guesses(tmp_path: Path) -> None:
    """The slider reaches as far as crank and rod in one line; the crank's angle is a first guess only."""
    press = (MODELS / "press.yaml").read_text(encoding="utf-8")
    start = "positions: {pin.angle: 0.3, rail.displacement: 0.5}, near: [pin.angle]"
    (tmp_path / "press.yaml").write_text(press.replace("rates: {pin.angle_rate: 10}", start), encoding="utf-8")
    words = ["simulate", str(tmp_path / "press.yaml"), "--implementation", "interpreted", "--no-error"]
    done = CliRunner(env={"COLUMNS": "300"}).invoke(main, words)
    assert done.exit_code == 1
    reach = 0.1 + hypot(0.3, 0.1) - 0.3
    assert f"; the nearest pose has rail.displacement = {reach:.6g} in place of 0.5 m; check " in done.output
