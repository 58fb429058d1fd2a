"""Runs of a batch are those of the same parameters alone."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from cutjoint.analysis.inertia import NoInertiaError
from cutjoint.cli import main
from cutjoint.model.expressions.functions import supply
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model, Scene
from cutjoint.package.errors import RunError
from cutjoint.reduce.guards import guard_forces
from cutjoint.run.cases import read_cases
from cutjoint.run.results import Batch, Trajectory
from cutjoint.run.scenes import with_closure
from cutjoint.run.simulation import simulate
from cutjoint.run.simulator import SimulatorError
from cutjoint.tasks.batch import BatchArtifact, compile_scene_batch, simulate_batch
from tests.conftest import MODELS, needs_cpp
from tests.physics.simulation import compile_scene

pytestmark = needs_cpp

#: A quarter of a car on a road: two arms of a loop, a tyre, a spring with a stop, and a spring that is no number beyond its length.
TEXT = """
cutjoint: 1
name: quarter
gravity: [0, 0, -9.81]
parameters:
  load: {value: 300, unit: kg, binding: param}
  stiffness: {value: 2.0e+4, unit: N/m, binding: param}
  speed: {value: 5, unit: m/s, binding: param}
  slack: {value: 10, unit: m, binding: param}
  along: {value: 0, unit: m, binding: input}
bodies:
  carriage: {massless: true}
  chassis: {mass: load, centre_of_mass: [0, 0, 0.5]}
  lower: {mass: 4, centre_of_mass: [0, 0.5, 0.25], inertia: [0.05, 0.05, 0.05]}
  upper: {mass: 3, centre_of_mass: [0, 0.5, 0.45], inertia: [0.05, 0.05, 0.05]}
  hub: {mass: 20, centre_of_mass: [0, 0.75, 0.3], inertia: [1, 1, 1]}
joints:
  drive: {kind: prismatic, bodies: [ground, carriage], at: [0, 0, 0], axis: [1, 0, 0], guide: along}
  heave: {kind: prismatic, bodies: [carriage, chassis], at: [0, 0, 0.5], axis: [0, 0, 1]}
  lower_pin: {kind: revolute, bodies: [chassis, lower], at: [0, 0.3, 0.25], axis: [1, 0, 0]}
  upper_pin: {kind: revolute, bodies: [chassis, upper], at: [0, 0.3, 0.45], axis: [1, 0, 0]}
  knuckle: {kind: revolute, bodies: [lower, hub], at: [0, 0.7, 0.25], axis: [1, 0, 0]}
  ball: {kind: spherical, bodies: [upper, hub], at: [0, 0.7, 0.42], cut: true}
forces:
  spring: {kind: joint_force, joint: lower_pin, law: {stiffness: "stiffness*0.16", damping: 150, free_position: -0.1}}
  bumper: {kind: joint_force, joint: lower_pin, law: {stop: {at: 0.07, side: above, stiffness: 2.0e+4, damping: 20}}}
  rope: {kind: joint_force, joint: heave, law: "1.0e-6*sqrt(slack - position)"}
  rail: {kind: joint_force, joint: heave, law: "where(position > 0.01, -1000*(position - 0.01), 0)", active: false}
  tyre:
    kind: tyre
    body: hub
    centre: [0, 0.75, 0.3]
    axis: [0, 1, 0]
    radius: 0.3
    stiffness: 2.0e+5
    calspan: {A0: 2625, A1: 14.47, A2: 12930, A3: 2.29, A4: 18175, B1: -4.64e-5, B3: 1.216, B4: 2.18e-11,
              SN: 1.0274, AF1: -1.71e-5, AF2: 1.71e-5}
outputs: [chassis.z, chassis.vz, hub.z, tyre.Fz, bumper.force]
scenes:
  ride:
    end: 0.8
    output_step: 0.01
    pose: equilibrium
    inputs: {along: "speed*t"}
    road: {start: 1.03, profile: [{ramp: 0.7, rise: 0.1}, {flat: 0.4}, {ramp: 0.9, rise: -0.05}]}
    numerics: {dt: 0.002, solver_tolerance: 1.0e-8, penalty: 1.0e+6}
"""

CASES = [{"load": 200.0 + 20 * k, "stiffness": 1.5e4 + 1e3 * k, "speed": 4.0 + 0.3 * k} for k in range(11)]


@cache
def model() -> Model:
    return read_model_text(TEXT, "quarter.yaml")


def ride() -> Scene:
    return model().scenes["ride"]


@cache
def compiled() -> BatchArtifact:
    return compile_scene_batch(model(), ride())


def alone(case: Mapping[str, float]) -> Trajectory:
    return simulate(compile_scene(model(), ride()), parameters=case, check=False)


def check_same(batch: Batch, i: int, run: Trajectory, *left_out: str) -> None:
    for name, column in run.columns.items():
        if name in left_out:
            continue
        size = 1.0 + float(np.abs(column).max())
        for table, value in ((batch.end, column[-1]), (batch.minimum, column.min()), (batch.maximum, column.max())):
            assert table[name][i] == pytest.approx(value, abs=1e-8 * size), name


def test_each_run_is_that_of_its_parameters_alone() -> None:
    batch = simulate_batch(compiled(), CASES, threads=1)
    assert batch.failures == (None,) * len(CASES)
    for i, case in enumerate(CASES):
        run = alone(case)
        assert run.failure is None
        check_same(batch, i, run)
        assert batch.evaluations[i] == pytest.approx(run.evaluations, rel=0.02)  # those of a step end by rounding's leave
    assert batch.maximum["bumper.force"].max() == 0.0 > batch.minimum["bumper.force"].min()  # the stop acted
    assert len({round(x, 6) for x in batch.end["chassis.z"]}) == len(CASES)


def test_the_closure_is_that_of_the_scene() -> None:
    """Runs with projecting steps, beside single ones with the same closure."""
    scene = with_closure(replace(ride(), pose="design"), "proximal")
    batch = simulate_batch(compile_scene_batch(model(), scene), CASES[:3], threads=1)
    single = compile_scene(model(), scene)
    for i, case in enumerate(CASES[:3]):
        run = simulate(single, parameters=case)
        check_same(batch, i, run)
        # sines of a register differ from others in the last digits, by which an iteration may end one evaluation later
        assert batch.evaluations[i] == pytest.approx(run.evaluations, abs=2)


@pytest.mark.parametrize(
    "how", [{"threads": 0}, {"dt": float("inf")}, {"end": -1.0}, {"solver_tolerance": 0.0}], ids=lambda how: next(iter(how))
)  # fmt: skip
def test_figures_that_no_run_has_are_refused(how: dict[str, Any]) -> None:
    with pytest.raises(RunError, match=f"^{next(iter(how))}: .*; write a "):
        simulate_batch(compiled(), CASES, **how)
    with pytest.raises(RunError, match=r"^parameter 'load': inf is not a finite number; write a plain number in SI units"):
        simulate_batch(compiled(), [{"load": float("inf")}])


def has_wide_vectors() -> bool:
    """True if this machine has the registers of AVX-512, in which eight runs fit."""
    described = Path("/proc/cpuinfo")
    return described.exists() and "avx512f" in described.read_text(encoding="utf-8").split()


@pytest.mark.heavy
@pytest.mark.skipif(not has_wide_vectors(), reason="needs a machine with AVX-512")
def test_each_run_is_that_of_its_parameters_alone_in_wide_registers() -> None:
    """Instructions of this very machine, as users have them by default; the runs alone have the plain ones of all tests."""
    batch = simulate_batch(compile_scene_batch(model(), ride(), flags=("-O1", "-march=native")), CASES, threads=2)
    assert batch.failures == (None,) * len(CASES)
    for i, case in enumerate(CASES):
        check_same(batch, i, alone(case))


def test_threads_change_nothing() -> None:
    one, two = (simulate_batch(compiled(), CASES, threads=threads) for threads in (1, 100))
    for name in one.end:
        assert np.array_equal(one.end[name], two.end[name])
        assert np.array_equal(one.maximum[name], two.maximum[name])


def test_runs_in_lanes_are_done_soon_after_each_other() -> None:
    """Progress is reported and rows are kept: long runs are not held back until many others have ended."""
    shares: list[float] = []
    simulate_batch(compiled(), CASES * 3, threads=1, progress=shares.append)
    assert shares == [8 / 33, 16 / 33, 24 / 33, 32 / 33, 1.0]  # eight runs at a time, as many as the widest registers have


def test_a_function_that_crashes_leaves_this_process(tmp_path: Path) -> None:
    """Its runs are of simulators, whose end is an error; the table has what was done before."""
    place = tmp_path / "pull.cpp"
    law = "(void)partials; *result = 1; if (arguments[0] > 0.3) __builtin_trap();"
    place.write_text(f'extern "C" void cutjoint_pull(const double* arguments, double* result, double* partials) {{ {law} }}')
    text = (MODELS / "pendulum.yaml").read_text(encoding="utf-8").replace("end: 10,", "end: 0.1,").replace("outputs:", """
functions: {pull: {arguments: [load]}}
parameters: {load: {value: 0, binding: param}}
forces: {motor: {kind: joint_force, joint: pin, law: pull(load)}}
outputs:""")  # fmt: skip
    model = supply(read_model_text(text, "pendulum.yaml"), place)
    artifact, cases = compile_scene_batch(model, model.scenes["swing"]), [{"load": k / 10} for k in range(6)]
    with pytest.raises(SimulatorError, match=r"^the simulator ended with status -") as crash:
        simulate_batch(artifact, cases, threads=1, out=tmp_path / "o.csv")
    assert crash.value.__notes__ == [f"the results of 4 of 6 runs are in {tmp_path / 'o.partial.csv'}"]


def test_a_run_that_fails_does_not_stop_the_others() -> None:
    """In the second run a force is soon no number; in the fourth it is none from the start."""
    cases = [{"slack": slack} for slack in (10.0, 0.02, 10.0, -1.0)]
    batch = simulate_batch(compiled(), cases, check=False)
    run = alone({})
    for i in (0, 2):
        assert batch.failures[i] is None
        check_same(batch, i, run)
    stopped, failure = alone(cases[1]), batch.failures[1]
    assert failure is not None
    assert stopped.failure is not None
    assert (failure.step, failure.element, failure.time) == (stopped.failure.step, stopped.failure.element, stopped.failure.time)
    assert 0.1 < failure.time < 0.8
    check_same(batch, 1, stopped, "tyre.Fz")  # the road lies under the wheel where it was in the failed step, in the table of a single run
    start = batch.failures[3]
    assert start is not None
    assert np.isnan(batch.end["chassis.z"][3])


@pytest.mark.parametrize("closure", ["penalty", "proximal"])
def test_a_law_without_a_value_is_named_as_in_a_single_run(closure: str) -> None:
    """The rope's law has none at a step, and none at the start."""
    scene, cases = with_closure(ride(), closure), [{"slack": slack} for slack in (0.02, -1.0)]
    batch, single = simulate_batch(compile_scene_batch(model(), scene), cases, check=False), compile_scene(model(), scene)
    for failure, case in zip(batch.failures, cases, strict=True):
        run = simulate(single, parameters=case, check=False)
        assert failure is not None
        assert run.failure is not None
        assert (failure.message, failure.element, failure.step) == (run.failure.message, run.failure.element, run.failure.step)
        assert failure.element == "rope"


def test_guards_stop_the_runs_whose_forces_would_act() -> None:
    """The rail acts above a height that a heavy load does not reach."""
    scene = replace(ride(), switches={"rail": True}, pose="design")
    guarded = guard_forces(model(), scene, ("rail",)).model
    cases = [{"speed": speed} for speed in (0.5, 5.0)]
    batch = simulate_batch(compile_scene_batch(guarded, scene), cases, check=False)
    single = compile_scene(guarded, scene)
    for i, case in enumerate(cases):
        run, failure = simulate(single, parameters=case, check=False), batch.failures[i]
        assert (failure and (failure.message, failure.guards, failure.step)) == (
            run.failure and (run.failure.message, run.failure.guards, run.failure.step)
        )
        check_same(batch, i, run)
    assert batch.failures[0] is None
    assert batch.failures[1] is not None


def test_what_a_batch_does_not_have() -> None:
    lacks = (
        ({"integrator": "rk4"}, "integrator: trapezoidal"), ({"events": "located"}, "events: crossed"),
    )  # fmt: skip
    for change, words in lacks:
        scene = replace(ride(), numerics=replace(ride().numerics, **change))  # type: ignore[arg-type]
        with pytest.raises(RunError, match=rf"quarter\.yaml:\d+:\d+: scene 'ride': batches have {words} only"):
            compile_scene_batch(model(), scene)
    with pytest.raises(RunError, match="the same parameters"):
        simulate_batch(compiled(), [{"load": 1.0}, {"speed": 1.0}])


#: Laws with conditions on time, on parameters, and on both: they are decided before an evaluation.
DECIDED = """
cutjoint: 1
name: decided
gravity: [0, 0, -9.81]
parameters:
  k: {value: 5, unit: N*m/rad, binding: param}
bodies:
  arm: {mass: 1, centre_of_mass: [0.5, 0, 0], inertia: [0.1, 0.1, 0.1]}
joints:
  hinge: {kind: revolute, bodies: [ground, arm], at: [0, 0, 0], axis: [0, 1, 0]}
forces:
  late: {kind: joint_force, joint: hinge, law: "where(t > 0.3, -k*position, 0)"}
  strong: {kind: joint_force, joint: hinge, law: "where(k > 6, -k*position, -position)"}
  both: {kind: joint_force, joint: hinge, law: {sum: ["where(t > 0.2, where(k > 5.5, 1, 2), 0)", "max(k - 6, 0)*min(t, 0.1)"]}}
outputs: [arm.x, hinge.angle_rate]
scenes:
  swing: {end: 0.6, output_step: 0.01, positions: {hinge.angle: 0.1}, numerics: {dt: 0.002, solver_tolerance: 1.0e-10}}
"""


def test_conditions_on_time_and_parameters() -> None:
    model = read_model_text(DECIDED, "decided.yaml")
    scene = model.scenes["swing"]
    cases = [{"k": k} for k in (4.0, 5.7, 6.5, 8.0)]
    batch, single = simulate_batch(compile_scene_batch(model, scene), cases), compile_scene(model, scene)
    for i, case in enumerate(cases):
        check_same(batch, i, simulate(single, parameters=case))
    assert len({round(x, 9) for x in batch.end["arm.x"]}) == len(cases)


def test_a_motion_without_mass_is_refused_as_in_a_single_run() -> None:
    text = DECIDED.replace("{mass: 1, centre_of_mass: [0.5, 0, 0], inertia: [0.1, 0.1, 0.1]}", "{massless: true}")
    model = read_model_text(text, "decided.yaml")
    with pytest.raises(NoInertiaError, match="joint 'hinge'"):
        compile_scene_batch(model, model.scenes["swing"])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "cases.csv: no runs"),
        ("load,speed\n", "cases.csv: no runs"),
        ("load,sped\n1,2\n", "cases.csv:1: model 'quarter' has no parameter 'sped'; did you mean 'speed'?"),
        ("load,load\n1,2\n", "cases.csv:1: parameter 'load' stands above two columns"),
        ("load,speed\n1,2\n\n3\n", "cases.csv:4: 1 value for 2 columns"),
        ("load,speed\n1,fast\n", "cases.csv:2: column 'speed': 'fast' is not a finite number"),
        ("load,speed\n1,inf\n", "cases.csv:2: column 'speed': 'inf' is not a finite number"),
        ("load,speed\n1,1_0\n", "cases.csv:2: column 'speed': '1_0' is not a finite number"),
        ("load,\n1,\n", "cases.csv:1: column 2 has no name"),
        ("\n\nload,speed\n1\n", "cases.csv:4: 1 value for 2 columns"),
    ],
)
def test_wrong_tables_are_refused_with_their_place(text: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("cases.csv").write_text(text, encoding="utf-8")
    with pytest.raises(RunError) as error:
        read_cases(Path("cases.csv"), model())
    assert str(error.value).startswith(words)


def test_tables_of_spreadsheets(tmp_path: Path) -> None:
    """A mark of the byte order, lines of Windows, blank lines; another encoding is refused."""
    table = tmp_path / "cases.csv"
    table.write_bytes(b'\xef\xbb\xbf\r\n"load", speed\r\n250,"6"\r\n \r\n300,7\r\n')
    assert read_cases(table, model()) == [{"load": 250.0, "speed": 6.0}, {"load": 300.0, "speed": 7.0}]
    table.write_bytes("load\n250\n".encode("utf-16"))
    with pytest.raises(RunError, match=r"cases\.csv: not a table in UTF-8"):
        read_cases(table, model())


def test_the_command_writes_a_row_for_each_run(tmp_path: Path) -> None:
    (tmp_path / "quarter.yaml").write_text(TEXT, encoding="utf-8")
    (tmp_path / "cases.csv").write_text("load, slack\n250, 10\n300, 0.02\n", encoding="utf-8")
    out = tmp_path / "results" / "table.csv"
    arguments = ["batch", str(tmp_path / "quarter.yaml"), str(tmp_path / "cases.csv"), "--set", "speed=6", "--out", str(out)]
    done = CliRunner().invoke(main, arguments)
    assert done.exit_code == 1, done.output
    assert "run 2: the law of 'rope' (quarter.yaml:27) has no finite value: the argument of sqrt leaves its domain" in done.output
    assert "1 of 2 runs failed" in done.output
    with out.open(encoding="utf-8", newline="") as stream:
        first, second = csv.DictReader(stream)
    assert (first["speed"], first["load"], first["slack"], first["run.failure"]) == ("6.0", "250.0", "10.0", "")
    assert second["run.failure"].startswith("the law of 'rope' (quarter.yaml:27) has no finite value")
    run = alone({"load": 250.0, "speed": 6.0})
    assert float(first["chassis.z.max"]) == pytest.approx(run["chassis.z"].max(), abs=1e-8)
    units = json.loads(out.with_suffix(".units.json").read_text(encoding="utf-8"))
    assert (units["chassis.z.max"], units["tyre.Fz.end"]) == ("m", "N")


def test_what_did_not_start_has_no_values(tmp_path: Path) -> None:
    batch = simulate_batch(compiled(), [{"slack": -1.0}], out=tmp_path / "table.csv", check=False)
    header, row = (tmp_path / "table.csv").read_text(encoding="utf-8").splitlines()
    assert header.startswith("slack,run.failure,run.evaluations,chassis.z.end,chassis.z.min,chassis.z.max,")
    assert row.endswith(",0" + "," * 3 * len(batch.units))


def test_batches_go_with_their_own_options_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("quarter.yaml").write_text(TEXT, encoding="utf-8")
    Path("cases.csv").write_text("load\n250\n", encoding="utf-8")
    others = ("--method", "augmented"), ("--integrator", "rk4"), ("--events", "located"), ("--precision", "single"), ("--iterations", "3")
    for more in others:
        done = CliRunner().invoke(main, ["batch", "quarter.yaml", "cases.csv", "--out", "x.csv", *more])
        assert done.exit_code == 2
        assert more[0] in done.output


def test_the_method_of_a_scene_is_one_of_batches(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("quarter.yaml").write_text(TEXT.replace("    end: 0.8", "    end: 0.8\n    method: augmented"), encoding="utf-8")
    Path("cases.csv").write_text("load\n250\n", encoding="utf-8")
    done = CliRunner().invoke(main, ["batch", "quarter.yaml", "cases.csv", "--out", "x.csv"])
    assert done.exit_code == 1
    assert "batches have no method augmented; use --method recursive" in done.output


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--out", "cases.csv"], "--out cases.csv: that is the table of parameters"),
        (["--out", "x.csv", "--set", "load=3"], "--set load: the table cases.csv has it too"),
    ],
)
def test_contradictions_are_refused(more: list[str], words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("quarter.yaml").write_text(TEXT, encoding="utf-8")
    Path("cases.csv").write_text("load\n250\n", encoding="utf-8")
    done = CliRunner().invoke(main, ["batch", "quarter.yaml", "cases.csv", *more])
    assert done.exit_code == 1
    assert words in done.output
    assert Path("cases.csv").read_text(encoding="utf-8") == "load\n250\n"


@pytest.mark.parametrize("more", [["--dt", "0.001"], []], ids=["in lanes", "one by one"])
def test_a_batch_is_found_in_the_cache(more: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the same numbers, and also for another end; another model is derived."""
    monkeypatch.chdir(tmp_path)
    text = (MODELS / "press.yaml").read_text(encoding="utf-8").replace("end: 2", "end: 0.2")
    Path("press.yaml").write_text(text, encoding="utf-8")
    Path("cases.csv").write_text("stiffness\n2000\n3000\n", encoding="utf-8")
    words = ["batch", "press.yaml", "cases.csv", "--out", "out.csv", *more]
    tables, said = [], []
    for changed, other in ((text, []), (text, []), (text, ["--end", "0.1"]), (text.replace("end: 0.2", "end: 0.3"), [])):
        Path("press.yaml").write_text(changed, encoding="utf-8")
        said.append(CliRunner().invoke(main, [*words, *other]).output)
        tables.append(Path("out.csv").read_text(encoding="utf-8"))
    assert ["generate found in the cache" in " ".join(each.split()) for each in said[1:]] == [True, True, False], said
    assert tables[0] == tables[1]
    assert len(set(tables)) == 3


@pytest.mark.heavy
def test_a_wheel_that_changes_the_shape_of_the_road(tmp_path: Path) -> None:
    """Each run has a road of its own; the library has that of the scene alone, so that runs go one by one, in the same steps."""
    text = TEXT.replace("  load: {", "  wheel: {value: 0.3, unit: m, binding: param}\n  load: {").replace("radius: 0.3", "radius: wheel")
    text = text.replace("road: {start: 1.03, profile: [{ramp: 0.7, rise: 0.1}", "road: {contact: disc, start: 1.03, profile: [{step: 0.02}")
    model = read_model_text(text, "quarter.yaml")
    artifact, single = compile_scene_batch(model, model.scenes["ride"]), compile_scene(model, model.scenes["ride"])
    for cases, side_by_side in (([{"wheel": 0.28}, {"wheel": 0.3}], False), ([{"load": 250.0}, {"load": 300.0}], True)):
        batch = simulate_batch(artifact, cases)
        assert batch.side_by_side is side_by_side
        assert batch.settings.integrator == "trapezoidal"
        for i, case in enumerate(cases):
            check_same(batch, i, simulate(single, parameters=case))
