"""Runs that fail before their first row have no rows, neither theirs nor those of an earlier run, whose files stay as they are."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.model.read import read_model_text
from cutjoint.pipeline import compile_scene, simulate
from cutjoint.realtime import run_in_real_time
from cutjoint.run.artifact import Artifact

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
    places = {name: tmp_path / "new" / name / "rows" for name in ("out", "steps", "tangents")}
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
        assert times.took.size == times.late.size == 0
        assert run_in_real_time(pendulum(), out=out).took.size == 2


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
