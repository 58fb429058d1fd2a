"""References against exact and published values; the same simulator in four number types."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.model.read import read_model_text
from cutjoint.package.errors import RunError
from cutjoint.run.results import read_table
from cutjoint.run.simulation import simulate
from cutjoint_bench.cases import make_case
from cutjoint_bench.cutjoint_contenders import TOLERANCES
from cutjoint_bench.errors import measure_errors
from cutjoint_bench.reference import find_reference
from tests.conftest import DATA, MODELS
from tests.physics.simulation import read_reference

#: A mass of 1 kg that 1 N pushes from rest until it has gone 0.25 m, at sqrt(0.5) s.
SWITCHED = """\
cutjoint: 1
name: switched
gravity: [0, 0, 0]
bodies: {block: {mass: 1, centre_of_mass: [0, 0, 0]}}
joints: {rail: {kind: prismatic, bodies: [ground, block], at: [0, 0, 0], axis: [1, 0, 0]}}
forces: {push: {kind: joint_force, joint: rail, law: "where(position < 0.25, 1, -1)"}}
outputs: [block.x]
scenes: {run: {end: 1, output_step: 1}}
"""


@pytest.mark.heavy
def test_the_pendulum_is_where_elliptic_functions_put_it() -> None:
    """benchmarks: A01, exact x and y to twelve digits."""
    case = make_case(MODELS / "pendulum.yaml", row=0.1)
    reference = find_reference(case)
    body = next(b.name for b in case.model.bodies if b.mass != 0)
    exact = {1.0: (0.986291751132, -0.165010853126), 5.0: (-0.942305435044, -0.334754338414), 10.0: (-0.275087462577, -0.961419205099)}
    for t, place in exact.items():
        row = int(np.flatnonzero(np.isclose(reference.t, t))[0])
        assert [reference.columns[f"{body}.{x}"][row] for x in "xy"] == pytest.approx(place, abs=2e-12)


@pytest.mark.heavy
def test_two_routes_agree_on_a_closed_loop() -> None:
    """They share neither formulation nor integrator; asked are 1e-10."""
    case = make_case(MODELS / "slider_crank.yaml", end=1.0, row=0.05)
    reference = find_reference(case)
    assert reference.position_apart < 1e-12
    assert reference.velocity_apart < 1e-11
    assert reference.provenance["routes"] == ["Runge-Kutta", "extrapolation"]


@pytest.mark.heavy
def test_a_route_that_needs_endlessly_short_steps_ends() -> None:
    """A force that jumps needs steps of about the relative error that is asked for, below a millionth of a row."""
    model = read_model_text(SWITCHED, "switched.yaml")
    options = CompileOptions(method="classical", precision="extended", additions=["reference"])
    artifact = compile_scene(model, model.scenes["run"], options)
    run = simulate(artifact, integrator="reference", dt=1.0, tolerance=1e-12, check=False)
    assert run.failure is not None
    assert run.failure.message == "no step is small enough for the tolerance"
    assert run.failure.time == pytest.approx(np.sqrt(0.5), abs=1e-5)  # a step that fails is followed by one of a tenth, at the shortest


@pytest.mark.heavy
@pytest.mark.heavy
def test_two_routes_agree_on_the_stiff_governor() -> None:
    """A05, eigenvalue -8075 1/s: 64 bits do, and are affordable where 113 are not; the published slider has 13 digits."""
    case = make_case(MODELS / "flyball.yaml", end=0.2)
    reference = find_reference(case, precision="extended")
    assert reference.position_apart < 1e-13
    assert reference.velocity_apart < 1e-11
    published = read_reference(DATA / "ref_a05_flyball.csv")
    rows = len(reference.t)
    assert reference.t == pytest.approx(published["t"][:rows], abs=1e-12)
    assert reference.columns["slider.z"] == pytest.approx(published["s"][:rows], abs=1e-12)


@pytest.mark.heavy
def test_a_reference_is_found_again(monkeypatch: pytest.MonkeyPatch) -> None:
    case = make_case(MODELS / "pendulum.yaml", end=1.0, row=0.1)
    made = find_reference(case)
    monkeypatch.setattr("cutjoint_bench.reference._integrate", lambda *_: pytest.fail("it was in the cache"))
    kept = find_reference(case)
    assert kept.provenance == made.provenance
    assert all((kept.columns[name] == made.columns[name]).all() for name in made.columns)


@pytest.mark.heavy
def test_rounding_falls_with_the_precision(tmp_path: Path) -> None:
    """Rates of the equations after the classical method's last step: rounding of the number type, of bodies of 1 m and 1 m/s."""
    case = make_case(MODELS / "slider_crank.yaml", end=0.2, row=0.01)
    residuals = {}
    for precision in ("double", "quad"):
        artifact = compile_scene(case.model, case.scene, CompileOptions(method="classical", outputs=case.outputs, precision=precision))
        run = simulate(artifact, dt=1e-3, tolerance=TOLERANCES[precision], steps=tmp_path / "steps.csv")
        assert run.failure is None, precision
        residuals[precision] = read_table(tmp_path / "steps.csv")[1]["velocity"][-1]
    assert 1e-18 < residuals["double"] < 1e-13
    assert residuals["quad"] < 1e-26


@pytest.mark.heavy
def test_factors_in_double_do_for_a_longer_balance() -> None:
    """Newton's iteration corrects what rounded factors leave: the motion is that of factors in the longer type."""
    case = make_case(MODELS / "slider_crank.yaml", end=0.2, row=0.01)
    artifact = compile_scene(case.model, case.scene, CompileOptions(method="augmented", outputs=case.outputs, precision="quad"))
    runs = [simulate(artifact, dt=1e-3, tolerance=1e-16, solver=solver) for solver in ("emitted", "double-ldlt")]
    assert all(run.failure is None for run in runs)
    for name in runs[0].columns:
        assert runs[0][name] == pytest.approx(runs[1][name], abs=1e-13)


@pytest.mark.heavy
def test_errors_of_a_run_fall_with_the_square_of_its_step() -> None:
    case = make_case(MODELS / "pendulum.yaml", end=2.0, row=0.1)
    reference = find_reference(case)
    artifact = compile_scene(case.model, case.scene, CompileOptions(outputs=case.outputs))
    coarse, fine = (measure_errors(case, simulate(artifact, dt=dt, tolerance=1e-10), reference) for dt in (2e-3, 1e-3))
    assert coarse.position / fine.position == pytest.approx(4.0, rel=0.02)
    assert coarse.velocity / fine.velocity == pytest.approx(4.0, rel=0.02)


def test_a_precision_that_there_is_not() -> None:
    case = make_case(MODELS / "pendulum.yaml")
    with pytest.raises(RunError, match="no precision 'half'; there is double, single, extended, quad"):
        compile_scene(case.model, case.scene, CompileOptions(precision="half"))


def test_what_the_reference_integrator_takes() -> None:
    case = make_case(MODELS / "pendulum.yaml", end=0.1)
    artifact = compile_scene(case.model, case.scene, CompileOptions(method="augmented"))
    with pytest.raises(RunError, match="is for the method recursive or classical, not for augmented"):
        simulate(artifact, integrator="reference")
