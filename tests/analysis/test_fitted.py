"""Functions of loops with open geometry: found anew for other numbers, beside the loops' equations, a fresh compilation and numpy."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import cutjoint
from cutjoint.analysis.embedding.embed import embed_loops
from cutjoint.analysis.embedding.fits import evaluate, refit
from cutjoint.cli import main
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.compile.pipeline import compile_model
from cutjoint.methods import Loops
from cutjoint.model.read import read_model_text
from cutjoint.model.records import Model, Scene
from cutjoint.run.results import Trajectory
from cutjoint.run.scenes import load_model, with_loops
from cutjoint.run.simulation import simulate
from cutjoint.stepping.load import load_scene
from cutjoint.topology.build import build_topology
from tests.analysis.test_assembled import SWING
from tests.conftest import ROOT, needs_cpp, with_heavy
from tests.mechanisms.one_degree import four_bar, spatial

pytestmark = needs_cpp


def tunable(text: str, name: str) -> tuple[Model, Scene, dict[str, float]]:
    """A random model with its points open, and other places of these, 1 % of their distances away."""
    model = read_model_text(text, name, tunable=["?.x", "?.z"])
    scene = model.scenes["fall"]
    rng = np.random.default_rng(0)
    changed = {p.name: p.value + 0.01 * rng.uniform(-1, 1) for p in model.parameters if p.name[0] in "ABCD"}
    assert len(changed) == 8
    return model, scene, changed


def run(model: Model, scene: Scene, parameters: dict[str, float]) -> Trajectory:
    artifact = compile_interpreted(model, scene, method="recursive")
    return simulate(artifact, parameters=parameters, integrator="dormand-prince", tolerance=1e-11, error=False, check=False)


@pytest.mark.parametrize("make", [four_bar, spatial])
@pytest.mark.parametrize("seed", with_heavy(range(50), *range(2, 50)))
def test_random_mechanisms_with_other_points_move_as_by_their_loops_equations(make, seed: int) -> None:  # type: ignore[no-untyped-def]
    model, scene, changed = tunable(make(seed), "random.yaml")
    outcome = embed_loops(model, scene)
    assert [one.functions.open for one in outcome.model.embedded_loops] == [True], [note.text for note in outcome.left]
    exact, fitted = run(model, scene, changed), run(outcome.model, scene, changed)
    assert exact.failure is None
    if fitted.failure is not None:  # reported, never wrong: some ranges are too long for other points
        assert "its loops do not close over the range of their functions with these parameters" in fitted.failure.message
        assert seed > 1
        return
    for name in exact.columns:
        off = float(np.abs(exact[name] - fitted[name]).max() / max(1.0, np.abs(exact[name]).max()))
        assert off < (1e-6 if name.startswith(("pin", "rod.ax")) else 1e-8), (name, off)


def test_functions_by_numpy_are_those_of_a_model_with_these_numbers() -> None:
    """Values and slopes on the range; the series has other ends, since a fresh one is as long as it needs."""
    text = four_bar(1)
    model, scene, changed = tunable(text, "random.yaml")
    outcome = embed_loops(model, scene)
    own = outcome.model.embedded_loops[0]
    found = refit(build_topology(outcome.model), own, changed)
    other = replace(model, parameters=tuple(replace(p, value=changed.get(p.name, p.value)) for p in model.parameters))
    fresh = embed_loops(other, scene).model.embedded_loops[0].functions
    q = np.linspace(max(found.range.lower, fresh.range.lower), min(found.range.upper, fresh.range.upper), 50)
    for joint, series in found.series.items():
        for one, two in zip(series, fresh.series[joint], strict=True):
            for order in range(2):
                values = [evaluate(x, of, q, np.zeros(50), order) for x, of in ((one, found), (two, fresh))]
                assert np.abs(values[0] - values[1]).max() < 1e-9 * max(1.0, np.abs(values[1]).max()), joint


@pytest.mark.parametrize(("file", "pattern", "point"), [("press", "A.*", "A.z"), ("slider_crank", "B.*", "B.z")])
def test_full_turns_by_generated_code(file: str, pattern: str, point: str) -> None:
    """A longer crank: interpreted and generated programs beside the loops' equations."""
    model, scene = load_model(ROOT / "models" / f"{file}.yaml", None, [pattern])
    scene = replace(scene, end=0.5, output_step=0.01)
    fitted = embed_loops(model, scene).model
    assert fitted.embedded_loops[0].functions.is_periodic
    value = {point: next(p.value for p in model.parameters if p.name == point) + 0.01}
    exact, interpreted = run(model, scene, value), run(fitted, scene, value)
    artifact = compile_model(replace(fitted, scenes={scene.name: scene}))
    generated = simulate(artifact, parameters=value, integrator="dormand-prince", tolerance=1e-11, error=False)
    for name in exact.columns:
        size = max(1.0, float(np.abs(exact[name]).max()))
        assert np.abs(interpreted[name] - exact[name]).max() < 1e-8 * size, name
        assert np.abs(interpreted[name] - generated[name]).max() < 1e-9 * size, name


def test_newtons_method_and_poses_have_the_functions_of_the_parameters() -> None:
    """By recursive-newton; bodies of a view stand where the outputs say, which the program itself computes."""
    model, scene, changed = tunable(four_bar(0), "random.yaml")
    compiled = with_loops(scene, Loops.EMBEDDED)
    artifact = compile_interpreted(model, compiled, method="recursive-newton")
    assert not artifact.mechanism.closures
    made = simulate(artifact, parameters=changed, integrator="radau5", tolerance=1e-9)
    known = run(model, scene, changed)
    for name in known.columns:
        assert np.abs(made[name] - known[name]).max() < 1e-6 * max(1.0, np.abs(known[name]).max()), name


def test_a_host_changes_a_point_between_steps() -> None:
    """Coefficients follow the parameter, and only then; a change of a mass finds none anew."""
    model, scene = load_model(ROOT / "models" / "press.yaml", None, ["A.z", "slider.mass"])
    scene = with_loops(scene, Loops.EMBEDDED)
    places = []
    for change in (False, True):
        sim = cutjoint.load(replace(model, scenes={scene.name: scene})).reset()
        sim.parameters["slider.mass"] = 2.0
        if change:
            sim.parameters["A.z"] = 0.11
        for _ in range(10):
            sim.step()
        places.append(sim.outputs["slider.x"])
    # x = r sin + sqrt(l^2 - z^2) of the rod from A to B
    sim = cutjoint.load(replace(model, scenes={scene.name: scene})).reset()
    sim.parameters["A.z"] = 0.11
    sim.step()
    angle = sim.outputs["pin.angle"]
    rod = np.hypot(0.3, 0.11)
    x, z = 0.11 * np.sin(angle), 0.11 * np.cos(angle)
    start = np.sqrt(rod**2 - 0.11**2)
    assert sim.outputs["slider.x"] == pytest.approx(x + np.sqrt(rod**2 - z**2) - start + 0.3, abs=1e-9)
    assert places[0] != places[1]


def test_a_step_is_differentiated_by_a_point() -> None:
    """The fit is differentiated with the step: beside differences of steps, and beside the loops' equations."""
    model, scene = load_model(ROOT / "models" / "press.yaml", None, ["A.z"])
    found = {}
    for loops in (Loops.EXACT, Loops.EMBEDDED):
        chosen = with_loops(scene, loops)
        sim = load_scene(replace(model, scenes={scene.name: chosen}), chosen, integrator="rk4", linearise=True).reset(dt=1e-3)
        for _ in range(5):
            sim.step()
        before = sim.snapshot()
        found[loops] = sim.step_derivatives().by_parameter[:, list(sim.parameters).index("A.z")]
    ends = []
    for way in (-2, -1, 1, 2):
        sim.restore(before)
        sim.parameters["A.z"] += way * 1e-5
        sim.step()
        ends.append(sim.states.array.copy())
    differences = (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / 12e-5
    assert np.abs(found[Loops.EMBEDDED] - differences).max() < 1e-8 * np.abs(differences).max()
    assert np.abs(found[Loops.EMBEDDED] - found[Loops.EXACT]).max() < 1e-7 * np.abs(differences).max()


#: A swing whose point on the left is as high as a parameter says.
_SLOW = SWING.replace("end: 3", "end: 0.2").replace("angle_rate: 4.0", "angle_rate: 0.5")
HIGH = _SLOW.replace("at: [0, 0, 1]", "at: [0, 0, high]").replace(
    "bodies:\n", "parameters: {high: {value: 1, unit: m, binding: param}}\nbodies:\n", 1)  # fmt: skip


def test_loops_that_do_not_close_are_reported_and_left_to_their_equations(tmp_path: Path) -> None:
    rows, words = {}, "its loops do not close over the range of their functions with these parameters"
    for way, loops in (("stop", "embedded"), ("restart", "embedded"), ("restart", "exact")):
        file, out = tmp_path / f"{way}.yaml", tmp_path / f"{way}_{loops}.csv"
        file.write_text(HIGH % f", on_violation: {way}, numerics: {{loops: embedded}}", encoding="utf-8")
        asked = ["simulate", str(file), "--set", "high=2.5", "--loops", loops, "--implementation", "interpreted", "--no-error"]
        result = CliRunner().invoke(main, [*asked, "--out", str(out)])
        assert result.exit_code == (1 if way == "stop" else 0), result.output
        if loops == "embedded":
            assert words in result.output.replace("\n", " ")
        rows[way, loops] = out.read_text(encoding="utf-8") if out.exists() else ""
    assert not rows["stop", "embedded"]
    assert rows["restart", "embedded"] == rows["restart", "exact"]
