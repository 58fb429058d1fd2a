"""Method auto's choices, fresh and cached, run as their trials did; by the interpreter."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from shutil import rmtree
from uuid import uuid4

import numpy as np
import pytest

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.methods import INTEGRATORS
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import Model, Scene
from cutjoint.package.errors import RunError
from cutjoint.reduce import choose as choose_module
from cutjoint.reduce.choose import Candidate, Choice, Search, _begun, _cache_path, choose, chosen_model
from cutjoint.reduce.measure import Cost, distance, find_reference
from cutjoint.reduce.sequence import reduction_sequence, started
from cutjoint.reduce.trials import Steps, Trials
from cutjoint.run.artifact import make_simulator_run
from cutjoint.run.results import Trajectory
from cutjoint.run.run_file import fitting_interval
from cutjoint.run.scenes import find_case
from cutjoint.run.settings import Options
from cutjoint.run.simulation import simulate
from cutjoint.run.simulator import _SLOW
from cutjoint.toolchain.cache import cache_folder
from tests.analysis.test_aims import CRANK
from tests.conftest import MODELS, needs_cpp
from tests.reduce.test_choose import PENDULUM as SWING

pytestmark = needs_cpp

PENDULUM = SWING.replace("end: 4", "end: 1")
SAMPLED = PENDULUM.replace("outputs:", "controllers: {watch: {every: 15 ms, signals: {seen: pin.angle}}}\noutputs:")


@pytest.fixture(autouse=True)
def choices(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A cache of choices of its own; drivers are those of the common cache."""
    own = cache_folder() / f"test-{uuid4().hex}"
    monkeypatch.setattr(choose_module, "cache_folder", lambda: own)
    yield own / "choices"
    rmtree(own, ignore_errors=True)


def swing(text: str = PENDULUM) -> tuple[Model, Scene]:
    model = read_model_text(text, "pendulum.yaml")
    return model, model.scenes["swing"]


def run_of(choice: Choice, **parameters: float) -> Trajectory:
    model, scene = chosen_model(choice)
    run = simulate(compile_interpreted(model, scene, method=choice.chosen.method), parameters=parameters, error=False)
    assert run.failure is None
    return run


def by_hand(rows: np.ndarray) -> np.ndarray:
    """Angles of the pendulum from rest at the horizontal, by Runge-Kutta steps of 0.1 ms."""
    angle, rate, h, found, step = 0.0, 0.0, 1e-4, [], 0
    for row in np.rint(rows / h):
        while step < row:
            k1 = rate, 9.81 * np.cos(angle)
            k2 = rate + h / 2 * k1[1], 9.81 * np.cos(angle + h / 2 * k1[0])
            k3 = rate + h / 2 * k2[1], 9.81 * np.cos(angle + h / 2 * k2[0])
            k4 = rate + h * k3[1], 9.81 * np.cos(angle + h * k3[0])
            angle, rate = (x + h / 6 * (a + 2 * b + 2 * c + d) for x, a, b, c, d in zip((angle, rate), k1, k2, k3, k4, strict=True))
            step += 1
        found.append(angle)
    return np.array(found)


def test_a_chosen_run_keeps_the_accuracy_fresh_and_cached(choices: Path) -> None:
    fresh = choose(*swing())
    assert len(list(choices.iterdir())) == 1
    for choice in (fresh, choose(*swing())):
        assert choice == fresh
        run = run_of(choice)
        angle = by_hand(run.t)
        assert np.abs(run["bob.x"] - np.cos(angle)).max() < 1e-3
        assert np.abs(run["bob.z"] + np.sin(angle)).max() < 1e-3


def place() -> tuple[Model, Scene]:
    model, scene = find_case(read_model_text(CRANK, "lift.yaml"), "place")
    return model, replace(scene, output_step=1e-3, end=0.02, method="auto", accuracy=1e-3)


def test_all_models_begin_where_the_parameters_say() -> None:
    """Not where those of the file do; the same fresh and cached."""
    (model, scene), parameters = place(), {"away": 0.33}
    for choice in (choose(model, scene, parameters=parameters), choose(model, scene, parameters=parameters)):
        assert run_of(choice, **parameters)["tip.x"][0] == pytest.approx(0.33, abs=1e-9)
    for reduced in reduction_sequence(*started(model, scene, parameters)):
        run = simulate(compile_interpreted(reduced.model, reduced.scene), parameters=parameters, error=False)
        assert run["tip.x"][0] == pytest.approx(0.33, abs=1e-9)


@pytest.mark.parametrize(("known", "made"), [(True, 1), (False, 2)])
def test_a_kept_reduced_model_is_found_again(known: bool, made: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also of a scene with embedded loops; a choice whose model is made no longer is made again."""
    model, scene = find_case(read_model(MODELS / "flyball.yaml"), None)
    scene, calibrated = replace(scene, numerics=replace(scene.numerics, loops="embedded")), []

    def calibrate(model: Model, scene: Scene, parameters: object) -> Choice:
        last = reduction_sequence(model, scene)[-1]
        calibrated.append(last.model)
        chosen = Candidate(variant=last.name if known else "gone", method="recursive", steps=Steps(integrator="trapezoidal", dt=1e-3))
        return Choice(chosen=chosen, evidence=(chosen,), reference_change=0.0, reduced=(last.model, last.scene))

    monkeypatch.setattr(choose_module, "_calibrate", calibrate)
    first, again = (choose(model, scene) for _ in range(2))
    assert first.chosen.variant != "full"
    assert len(calibrated) == made
    assert (again, again.reduced[0].joints) == (first, first.reduced[0].joints)
    assert chosen_model(again)[1].numerics.loops == "exact"


def test_equal_steps_fit_the_samples_of_controllers() -> None:
    model, scene = swing(SAMPLED)
    assert fitting_interval(model, scene) == pytest.approx(0.005, rel=1e-12)
    search, (full, *_) = Search(scene, {}, find_reference(model, scene, {})), reduction_sequence(model, scene)
    tried = search.try_steps(full, scene, "recursive", "trapezoidal")
    assert tried.failure == ""
    assert round(0.005 / tried.steps.dt) == pytest.approx(0.005 / tried.steps.dt, rel=1e-9)


def test_samples_that_no_steps_fit_are_named() -> None:
    model, scene = swing(SAMPLED.replace("15 ms", "15.000001 ms"))
    assert fitting_interval(model, scene) == scene.output_step
    search, (full, *_) = Search(scene, {}, find_reference(model, scene, {})), reduction_sequence(model, scene)
    assert "do not divide every" in search.try_steps(full, scene, "recursive", "trapezoidal").failure


@pytest.mark.parametrize(("unit", "size"), [("mm", 1e-3), ("deg", np.pi / 180)])
def test_places_count_in_any_unit(unit: str, size: float) -> None:
    t = np.array([0.0, 0.1])
    truth = Trajectory(
        t=t, columns={"a": np.zeros(2)}, units={"a": unit}, steps=1, evaluations=1, seconds=0.0, undetermined=(), failure=None
    )  # fmt: skip
    assert distance(replace(truth, columns={"a": np.array([0.0, -2.0])}), truth) == pytest.approx(2 * size, rel=1e-12)


@pytest.mark.parametrize(("time", "stiff", "by"), [(0.1, 900, "radau5"), (0.9, 900, "dop853"), (0.1, 100, "dop853")])
def test_a_long_explicit_reference_of_a_stiff_model_gives_way(
    time: float, stiff: int, by: str, monkeypatch: pytest.MonkeyPatch
) -> None:  # fmt: skip
    """The simulator's report after ten seconds is a stand-in's."""

    def run(trials: Trials, steps: Steps, parameters: object) -> Trajectory:
        if steps.integrator == "dop853" and (tell := _SLOW.get()) is not None:
            tell({"steps": 1000, "stiff_steps": stiff, "time": time})
        return original(trials, steps, {})

    original = Trials.run
    monkeypatch.setattr(Trials, "run", run)
    assert find_reference(*swing(), {}).steps.integrator == by


def test_a_run_that_stops_keeps_no_budget(monkeypatch: pytest.MonkeyPatch) -> None:
    model, scene = swing()
    monkeypatch.setattr(choose_module, "compile_scene", lambda *_: None)
    monkeypatch.setattr(choose_module, "time_run", lambda *_: Cost(seconds=1e-9, error=0.0, failure="it stops at 1 s"))
    with pytest.raises(RunError, match="budget 1: it stops at 1 s"):
        choose(model, replace(scene, budget=1.0))


def test_a_budget_is_kept_by_a_processor(monkeypatch: pytest.MonkeyPatch) -> None:
    model, scene = swing()
    for budget, number in ((1.0, 2), (None, 1)):
        places = set()
        for name in ("one", "another"):
            monkeypatch.setattr(choose_module, "processor", lambda name=name: (name,))
            places.add(_cache_path(model, replace(scene, budget=budget), {}))
        assert len(places) == number


LAWS = ", numerics: {dt: 2 ms, frequency: 0.1/dt, methods: {recursive: {dt: 1 ms}}}"


@pytest.mark.parametrize("steps", [Steps(integrator="trapezoidal", dt=5e-4), Steps(integrator="dop853", tolerance=1e-5)])
@pytest.mark.parametrize("own", ["", LAWS])
def test_trials_have_the_closure_and_the_settings_of_the_chosen_run(own: str, steps: Steps) -> None:
    """Also where these are expressions of dt, and the scene has steps of its own."""
    model, scene = find_case(read_model_text(CRANK.replace("{tip.x: away}}", f"{{tip.x: away}}{own}}}"), "lift.yaml"), "place")
    model, scene = _begun(model, replace(scene, output_step=1e-3, method="auto", accuracy=1e-3), {})
    full, search = reduction_sequence(model, scene)[0], Search(scene, {}, find_reference(model, scene, {}))
    trials = search._trials(full, scene, "recursive", steps.integrator)
    chosen = Candidate(variant="full", method="recursive", steps=steps)
    choice = Choice(chosen=chosen, evidence=(), reference_change=0.0, reduced=(full.model, full.scene))
    executed = compile_interpreted(*chosen_model(choice), method="recursive")
    tried, ran = make_simulator_run(trials.artifact, Options(**steps.options)), make_simulator_run(executed, Options())
    assert tried.run_file == ran.run_file
    stabilisation = ran.run_file.settings.stabilisation
    assert stabilisation.closure == ("penalty" if own else INTEGRATORS[steps.integrator].closure)
    assert not own or stabilisation.frequency == pytest.approx(0.1 / (steps.dt or 2e-3), rel=1e-12)
