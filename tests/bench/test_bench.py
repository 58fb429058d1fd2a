"""The harness: steps, errors, resuming, findings and the page."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from cutjoint.methods import METHODS, names_of
from cutjoint.package.errors import RunError
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import FailureReport, Trajectory
from cutjoint.run.simulation import simulate
from cutjoint_bench import cutjoint_contenders
from cutjoint_bench.cases import falling_steps, make_case
from cutjoint_bench.command import command
from cutjoint_bench.contenders import CONTENDERS, choose
from cutjoint_bench.cutjoint_contenders import OwnRunner
from cutjoint_bench.errors import measure_errors
from cutjoint_bench.findings import breakdown, order, time_at
from cutjoint_bench.measure import largest_step, shared_steps
from cutjoint_bench.records import Case
from cutjoint_bench.reference import Reference
from cutjoint_bench.report.page import describe
from cutjoint_bench.report.precisions import describe_precisions
from cutjoint_bench.report.tables import tabulate_configurations, tabulate_stiff
from cutjoint_bench.steps import common_step
from cutjoint_bench.store import Store
from tests.conftest import MODELS
from tests.toolchain.damage import damaged_records


def test_steps_have_rows_in_common() -> None:
    assert common_step(0.0075, 0.0025) == 0.0075
    assert common_step(0.0175, 0.01) == 0.07
    assert common_step(1e-4, 0.01) == 0.01
    assert falling_steps(0.01, 0.02, 1e-3) == [0.02, 0.01, 0.005, 0.002, 0.001]


def test_rows_of_a_case_are_few(tmp_path: Path) -> None:
    case = make_case(MODELS / "iltis.yaml", "simul1")
    assert case.scene.end / case.scene.output_step <= 2000
    assert {o.element for o in case.outputs} == {b.name for b in case.model.bodies if b.mass != 0}


def run_of(case: Case, shift: float, end: float, failure: FailureReport | None = None) -> Trajectory:
    """A body that moves along x by a metre a second, and a shift."""
    t = np.arange(0.0, end + 1e-9, case.scene.output_step)
    columns = {o.column: t + shift if o.quantity == "x" else np.ones_like(t) * (o.quantity == "vx") for o in case.outputs}
    return Trajectory(t=t, columns=columns, units={}, steps=1, evaluations=1, seconds=1.0, undetermined=(), failure=failure)


def reference_of(case: Case) -> Reference:
    run = run_of(case, 0.0, case.scene.end)
    return Reference(t=run.t, columns=run.columns, position_apart=0.0, velocity_apart=0.0, provenance={})


def test_an_error_is_a_distance() -> None:
    case = make_case(MODELS / "pendulum.yaml", end=1.0, row=0.1)
    errors = measure_errors(case, run_of(case, 0.25, 1.0), reference_of(case))
    assert (errors.position, errors.mean_position, errors.velocity) == (pytest.approx(0.25), pytest.approx(0.25), 0.0)


@dataclass(frozen=True)
class Breaks:
    """A contender that fails above a step, and is wrong above another."""

    case: Case
    fails: float
    lies: float

    @property
    def configuration(self) -> Mapping[str, str]:
        return {}

    def __call__(self, dt: float, *, measured: bool = False) -> Trajectory:
        failure = FailureReport(message="too long", time=0.5, step=1, element="x", residual=1.0, advice="less")
        return run_of(self.case, 1.0 if dt > self.lies else 0.0, 1.0, failure if dt > self.fails else None)


@pytest.mark.parametrize(("fails", "lies"), [(0.02, 1.0), (1.0, 0.02)])
def test_the_largest_step_is_neither_failing_nor_wrong(fails: float, lies: float) -> None:
    case = make_case(MODELS / "pendulum.yaml", end=1.0, row=0.1)
    found = largest_step(case, Breaks(case, fails, lies), reference_of(case), low=1e-3, high=0.5)
    assert found == 0.02
    assert largest_step(case, Breaks(case, 1e-4, 1.0), None, low=1e-3, high=0.5) == 0.0


def test_steps_of_the_bisection_have_rows_in_common() -> None:
    """Else a run would be compared nowhere but at its start, and any step seem right."""
    case = make_case(MODELS / "pendulum.yaml", end=2.0, row=0.01)
    steps = shared_steps(case, 1e-3, 0.5)
    assert steps == sorted(steps)
    assert (steps[0], steps[-1]) == (0.001, 0.5)
    assert all(common_step(dt, 0.01) <= 0.5 for dt in steps)
    assert max(b / a for a, b in pairwise(steps)) <= 2.0


def line_of(points: list[tuple[float, float, float]]) -> dict[str, Any]:
    """Of step, error, seconds."""
    return {"points": [{"dt": dt, "errors": {"position": e}, "seconds": [s], "failure": ""} for dt, e, s in points]}


def test_order_and_time_at_an_accuracy() -> None:
    line = line_of([(2.0**-k, 4.0**-k, 2.0**k) for k in range(8)])
    assert order(line) == pytest.approx(2.0)
    assert time_at(line, 4.0**-2.5) == pytest.approx(2.0**2.5)
    assert time_at(line, 1e-9) is None
    assert time_at(line, 5.0) == 1.0
    floored = line_of([(2.0**-k, 4.0**-k + 3e-5, 1.0) for k in range(10)])
    assert order(floored) == pytest.approx(2.0, abs=0.1)
    mixed = line_of([(2.0**-k, abs(4.0**-k - 3 * 8.0**-k), 1.0) for k in range(14)])  # cancels between the larger steps
    assert order(mixed) == pytest.approx(2.0, abs=0.01)
    flat = line_of([(2.0**-k, max(4.0**-k, 4.0**-5), 2.0**k) for k in range(10)])
    assert order(flat) == pytest.approx(2.0, abs=0.1)


def test_integrators_are_generated_code_and_have_orders_where_they_have_steps() -> None:
    def named(contender: str, order: int, seconds: float) -> dict[str, Any]:
        line = line_of([(2.0**-k, 2.0 ** (-order * k), seconds * 2.0**k) for k in range(6)])
        return {**line, "contender": contender, "label": contender, "group": "integrators" if "/" in contender else "generated"}

    said = describe({"lines": [named("recursive", 2, 1.0), named("recursive/rk4", 4, 2.0), named("recursive/dormand-prince", 5, 4.0)]})
    assert said[0] == "Orders of convergence in position: recursive 2.00, recursive/rk4 4.00."
    assert any("At an error of 1e-03 m the fastest generated code is recursive/rk4" in x for x in said)


def precision_line(kind: str, points: list[tuple[float, float | None, float]]) -> dict[str, Any]:
    """Of step, error (None where it fails) and seconds."""
    found = [
        {"dt": dt, "errors": {"position": e}, "seconds": [] if e is None else [s], "failure": "it stopped" if e is None else ""}
        for dt, e, s in points
    ]
    return {"contender": f"augmented/{kind}", "group": "precision", "points": found}


def test_words_on_more_digits() -> None:
    double = precision_line("double", [(1e-2, None, 1), (1e-3, 1e-6, 1), (1e-4, 1e-8, 10), (1e-5, None, 100)])
    extended = precision_line("extended", [(1e-3, 1e-6, 5), (1e-4, 1e-8, 50), (1e-5, 1e-10, 500)])
    mixed = precision_line("mixed", [(1e-3, 1e-6, 3), (1e-4, 1e-8, 30), (1e-5, 2e-8, 300)])
    assert [breakdown(line) for line in (double, extended, mixed)] == [1e-5, None, 1e-5]
    assert describe_precisions([double, extended, mixed]) == [
        "augmented, small steps: double breaks down from 0.01 ms on, extended holds down to 0.01 ms, the smallest step tried, "
        "mixed breaks down from 0.01 ms on. "
        "More digits cure it at that step: extended (down to the smallest step tried: extended).",
        "Time of augmented at equal steps, over that in double: extended 5, mixed 3.",
    ]
    assert describe_precisions([double, {**mixed, "contender": "augmented/quad"}])[0].endswith("More digits do not cure it.")
    whole = {**extended, "contender": "augmented/double"}
    assert describe_precisions([whole])[0].endswith("Double leaves nothing for more digits to cure.")


def test_words_on_digits_that_never_do() -> None:
    """A number type no run of which ends does not hold, and cures nothing."""
    double = precision_line("double", [(1e-3, 1e-6, 1), (1e-4, None, 10)])
    single = precision_line("single", [(1e-3, None, 1), (1e-4, None, 1)])
    quad = precision_line("quad", [(1e-3, None, 1), (1e-4, None, 1)])
    said = describe_precisions([double, single, quad])[0]
    assert "single fails at every step tried, 1 ms to 0.1 ms" in said
    assert said.endswith("More digits do not cure it.")


def test_an_order_is_reported_by_steps_that_agree_on_it() -> None:
    """Not by rounding, and not where errors pass zero."""
    noisy = [(2.0**-k, max(2.0 ** (-4 * k), 1e-9 * (2 + (-1) ** k)), 1.0) for k in range(12)]
    assert order(line_of(noisy)) == pytest.approx(4, abs=0.2)
    crossing = [(2.0**-k, abs(4.0**-k - 3e-3 * 2.0**-k) * (1 + 0.9 * (-1) ** k), 1.0) for k in range(8)]
    assert np.isnan(order(line_of(crossing)))


def test_what_bumpers_cost_beside_table_3() -> None:
    def case(scene: str, seconds: float, limit: float) -> dict[str, Any]:
        point = {"dt": 1.0, "errors": {"position": 1e-3}, "seconds": [seconds], "failure": ""}
        line = {"contender": "recursive", "label": "recursive", "group": "generated", "dt": 1.0, "points": [point], "largest_step": limit}
        return {"name": f"iltis/{scene}", "lines": [line]}

    table = tabulate_stiff([case("simul1", 2.0, 9e-3), case("simul1s", 3.0, 3e-3)])
    assert table is not None
    assert next(row for row in table.rows if row[0] == "recursive") == ("recursive", "1.70", "1.50", "0.33", "0.33")
    assert tabulate_stiff([case("simul1", 2.0, 9e-3)]) is None


def test_configurations_that_differ_name_their_cases() -> None:
    def case(name: str, differences: str) -> dict[str, Any]:
        configuration = {"version": "3", "differences": differences, "digest": "x"}
        return {"name": name, "lines": [{"label": "mujoco, rk4", "configuration": configuration}]}

    found = tabulate_configurations([case("a", ""), case("b", "loops are soft"), case("c", "")])
    assert found == [("mujoco, rk4 (a, c)", "version 3, differences "), ("mujoco, rk4 (b)", "version 3, differences loops are soft")]


def test_a_store_goes_on_where_it_was_broken_off(tmp_path: Path) -> None:
    path = tmp_path / "measurements.jsonl"
    assert Store(path).get({"dt": 1}, lambda: {"x": 1}) == {"x": 1}
    with path.open("a") as stream:
        stream.write('{"key": "bro')
    again = Store(path)
    assert again.get({"dt": 1}, lambda: pytest.fail("it was measured")) == {"x": 1}
    assert again.get({"dt": 2}, lambda: {"x": 2}) == {"x": 2}
    assert Store(path).get({"dt": 2}, lambda: pytest.fail("it was measured")) == {"x": 2}


def test_a_line_of_a_store_that_came_to_harm_is_measured_again(tmp_path: Path) -> None:
    path = tmp_path / "measurements.jsonl"
    Store(path).get({"dt": 1}, lambda: {"seconds": [0.5, 0.25], "failure": ""})
    for harmed in damaged_records(path.read_bytes().rstrip(b"\n")):
        path.write_bytes(harmed + b"\n")
        assert Store(path).get({"dt": 1}, lambda: {"x": 1}) == {"x": 1}
        assert Store(path).get({"dt": 1}, lambda: pytest.fail("it was measured")) == {"x": 1}


def test_every_method_is_a_contender() -> None:
    assert [c.name for c in choose(["generated"])] == list(METHODS)
    assert {f"{m}/generic" for m in names_of(METHODS, lambda m: m.has_generic)} < set(CONTENDERS)
    implicit = ("radau5", "radau5-fixed", "generalised-alpha")
    explicit = ("rk4", "dormand-prince", "dop853")
    others = [*(f"recursive/{i}" for i in explicit), *(f"recursive-newton/{i}" for i in implicit)]
    assert [c.name for c in choose(["integrators"])] == [*others, "recursive/events", "recursive-newton/events"]
    with pytest.raises(RunError, match="no contender 'gauss'; there is recursive, augmented, classical"):
        choose(["gauss"])


def test_every_contender_has_an_input_to_be_known_by() -> None:
    """Peers have no settings of steps here; theirs are those of the default method."""
    case = make_case(MODELS / "pendulum.yaml")
    digests = {name: case.input_digest(name.partition("/")[0]) for name in CONTENDERS}
    assert digests["mujoco/rk4"] == digests["recursive"] != digests["augmented"]


def test_contenders_have_the_events_of_their_names_whatever_the_scene_says(monkeypatch: pytest.MonkeyPatch) -> None:
    case = make_case(MODELS / "pendulum.yaml", end=0.1)
    asked: list[object] = []
    monkeypatch.setattr("cutjoint_bench.cutjoint_contenders.simulate", lambda *_, **how: asked.append((how["integrator"], how["events"])))
    for events in ("located", "crossed"):
        scene = replace(case.scene, numerics=replace(case.scene.numerics, events=events))
        for name in ("recursive", "recursive/events", "recursive/rk4"):
            CONTENDERS[name].prepare(replace(case, scene=scene))(0.01)
    assert asked == 2 * [("trapezoidal", "crossed"), ("trapezoidal", "located"), ("rk4", "located")]


@pytest.mark.heavy
def test_a_bench_and_its_page(tmp_path: Path) -> None:
    arguments = [str(MODELS / "pendulum.yaml"), "--methods", "generated", "--end", "0.5", "--steps", "0.01,0.005,0.002",
                 "--repetitions", "2", "--no-limits", "--drift", "--out", str(tmp_path)]  # fmt: skip
    done = CliRunner().invoke(command, arguments, catch_exceptions=False)
    assert done.exit_code == 0, done.output
    data = json.loads((tmp_path / "bench.json").read_text())
    (case,) = data["cases"]
    for line in case["lines"]:
        errors = [p["errors"]["position"] for p in line["points"]]
        assert errors[0] > 3.5 * errors[1] > 15 * errors[2] > 0, line["label"]
        assert line["configuration"]["digest"]
    assert data["drifts"][0]["energy"]
    page = (tmp_path / "bench.html").read_text()
    assert page.count("<svg") == 2, "one of all points, one of what is kept"
    assert "src=" not in page
    assert "the two routes, which share neither formulation nor integrator" in page
    before = (tmp_path / "measurements.jsonl").read_text()
    assert CliRunner().invoke(command, arguments).exit_code == 0
    assert (tmp_path / "measurements.jsonl").read_text() == before


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--scenes", "swung"], "no scene 'swung'; there is swing"),
        (["--methods", "euler"], "no contender 'euler'; there is recursive,"),
        (["--steps", "0.01,x"], "'0.01,x': write seconds with commas between, such as 0.01,0.005"),
        (["--steps", "0.01,nan"], "'0.01,nan': write seconds with commas between, such as 0.01,0.005"),
        (["--precisions", "double,half"], "no number type 'half'; there is single, double, extended, quad"),
        (["--row", "inf"], "'inf' is not a plain decimal number"),
    ],
)
def test_bad_requests(arguments: list[str], message: str, tmp_path: Path) -> None:
    done = CliRunner().invoke(command, [str(MODELS / "pendulum.yaml"), "--out", str(tmp_path), *arguments])
    assert done.exit_code != 0
    assert message in " ".join(done.output.split())


def test_each_run_is_of_a_copy_of_the_simulator(monkeypatch: pytest.MonkeyPatch) -> None:
    """Copies lie elsewhere in memory, so that repetitions show what that changes."""
    case = make_case(MODELS / "pendulum.yaml", end=0.5, row=0.1)
    runner = CONTENDERS["recursive"].prepare(case)
    assert isinstance(runner, OwnRunner)
    kept = runner.artifact.binary.path
    used: list[Path] = []

    def run(artifact: Artifact, **how: Any) -> Trajectory:
        used.append(artifact.binary.path)
        assert artifact.binary.path.read_bytes() == kept.read_bytes()
        return simulate(artifact, **how)

    monkeypatch.setattr(cutjoint_contenders, "simulate", run)
    one, other = runner(0.01), runner(0.01)
    assert one.columns["bob.x"].tolist() == other.columns["bob.x"].tolist()
    assert len({kept, *used}) == 3
    assert not any(path.exists() for path in used)
