"""Loops as functions of one coordinate, beside the loops' equations and beside equations that are derived by hand."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.integrate import solve_ivp

from cutjoint.analysis.closing import design_coordinates, retract
from cutjoint.analysis.embedding.embed import embed_loops
from cutjoint.analysis.natural import call, evaluate_results
from cutjoint.cli import main
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.compile.pipeline import compile_model, generate
from cutjoint.export.fmu.archive import make_fmu
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import Model, Scene
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from cutjoint.sweeps.reading import read_study
from cutjoint.sweeps.run import perform_study
from cutjoint.tasks.batch import compile_batch, simulate_batch
from cutjoint.tasks.states import find_scene_equilibrium
from tests.analysis.linearised import implicit
from tests.conftest import ROOT, needs_cpp, with_heavy
from tests.mechanisms.one_degree import four_bar, spatial
from tests.standalone.test_c_export import check_table

pytestmark = needs_cpp


def run(model: Model, scene: Scene, tolerance: float = 1e-11) -> Trajectory:
    artifact = compile_interpreted(model, scene, method="recursive")
    return simulate(artifact, integrator="dormand-prince", tolerance=tolerance, error=False, check=False)


def apart(model: Model, scene: Scene, *, joints: int = 1) -> dict[str, float]:
    """The largest differences of the columns beside their sizes, between both ways to close the loops."""
    outcome = embed_loops(model, scene)
    assert len(outcome.model.embedded_loops) == joints, [note.text for note in outcome.left]
    exact, compiled = run(model, scene), run(outcome.model, scene)
    assert exact.failure is None
    assert compiled.failure is None, compiled.failure.message
    return {
        name: float(np.abs(exact[name] - compiled[name]).max() / max(1.0, np.abs(exact[name]).max())) for name in exact.columns
    }  # fmt: skip


@pytest.mark.parametrize("make", [four_bar, spatial])
@pytest.mark.parametrize("seed", with_heavy(range(100), *range(4, 100)))
def test_random_mechanisms_move_as_by_their_loops_equations(make, seed: int) -> None:  # type: ignore[no-untyped-def]
    """Bodies that hang on a body of the block, a free carrier, a force inside, and reactions of a joint that functions close."""
    model = read_model_text(make(seed), "random.yaml")
    for name, difference in apart(model, model.scenes["fall"]).items():
        # accelerations and reactions feel the bends of functions whose slopes are good to 1e-10
        assert difference < (1e-6 if name.startswith(("pin", "rod.ax")) else 1e-8), (name, difference)


def test_a_slider_crank_is_one_equation() -> None:
    """The press turns as the equation of its crank's angle by SciPy, with the rod's motion in closed form."""
    model = read_model(ROOT / "models" / "press.yaml")
    scene = model.scenes["turn"]
    outcome = embed_loops(model, scene)
    embedded_loop = outcome.model.embedded_loops[0]
    assert embedded_loop.functions.is_periodic
    assert embedded_loop.functions.violation < 1e-10
    assert embedded_loop.functions.violation_rate < 1e-9
    made = run(outcome.model, replace(scene, end=1.0, numerics=scene.numerics))
    r, length = 0.1, np.hypot(0.3, 0.1)

    def places(angle: float) -> np.ndarray:
        """x of the crank's end, of the rod's middle and of the slider, with z of these, and the rod's angle."""
        x, z = r * np.sin(angle), r * np.cos(angle)
        slide = x + np.sqrt(length**2 - z**2)
        return np.array([x / 2, z / 2, (x + slide) / 2, z / 2, slide, 0.0, np.arcsin(z / length), angle])

    weights = np.array([2, 2, 1, 1, 3, 3, 0.008, 0.002])

    def rates(_: float, state: np.ndarray) -> np.ndarray:
        angle, speed = state
        h = 1e-4
        steps = np.array([places(angle + k * h) for k in (-2, -1, 0, 1, 2)])
        slope = (steps[0] - 8 * steps[1] + 8 * steps[3] - steps[4]) / (12 * h)
        bend = (-steps[0] + 16 * steps[1] - 30 * steps[2] + 16 * steps[3] - steps[4]) / (12 * h * h)
        slide, rate = steps[2][4], slope[4] * speed
        spring = 2000 * (0.8 - slide - 0.48) - 20 * rate
        weight = -9.81 * (2 * slope[1] + slope[3])
        force = weight + spring * slope[4] - (weights * slope * bend).sum() * speed**2
        return np.array([speed, force / (weights * slope * slope).sum()])

    truth = solve_ivp(rates, (0, 1), [0.0, 10.0], rtol=1e-10, atol=1e-10, t_eval=made.t, method="DOP853")
    assert np.abs(made["pin.angle"] - truth.y[0]).max() < 2e-6  # differences of the second order divide rounding by h^2 = 1e-8


def test_coarse_functions_keep_the_energy() -> None:
    """Every derivative is that of the same function, so that work and energy agree however coarse it is."""
    model = read_model_text(four_bar(2), "random.yaml")
    scene = model.scenes["fall"]
    made: dict[float, Trajectory] = {}
    for tolerance in (1e-10, 1e-3):
        compiled = replace(scene, numerics=replace(scene.numerics, loops="embedded", loop_tolerance=tolerance))
        artifact = compile_interpreted(model, compiled, method="recursive")
        made[tolerance] = simulate(artifact, integrator="dormand-prince", tolerance=1e-10)
        energy = made[tolerance].energy
        assert energy is not None
        assert energy.share < 1e-7
    assert np.abs(made[1e-10]["rod.x"] - made[1e-3]["rod.x"]).max() > 1e-7  # the functions do differ


STEERED = """
cutjoint: 1
name: corner
gravity: [0, 0, -9.81]
parameters: {steer: {value: 0, unit: m, binding: input}}
bodies:
  chassis: {mass: 300, centre_of_mass: [0, 0, 0.5], inertia: [50, 50, 50]}
  rack: {massless: true}
  arm: {mass: 6, centre_of_mass: [0, 0.4, 0.3], inertia: [0.1, 0.05, 0.1]}
  hub: {mass: 40, centre_of_mass: [0, 0.62, 0.35], inertia: [1, 1.5, 1]}
  link: {massless: true}
  rod: {massless: true}
joints:
  free: {kind: free, bodies: [ground, chassis], at: [0, 0, 0.5]}
  slide: {kind: prismatic, bodies: [chassis, rack], at: [-0.15, 0.1, 0.45], axis: [0, 1, 0], guide: steer}
  hinge: {kind: revolute, bodies: [chassis, arm], at: [0, 0.25, 0.3], axis: [1, 0, 0]}
  ball: {kind: spherical, bodies: [arm, hub], at: [0, 0.57, 0.23]}
  top: {kind: revolute, bodies: [chassis, link], at: [0, 0.2, 0.6], axis: [1, 0, 0]}
  top_ball: {kind: spherical, bodies: [link, hub], at: [0, 0.5, 0.53]}
  inner: {kind: spherical, bodies: [rack, rod], at: [-0.15, 0.1, 0.45]}
  outer: {kind: universal, bodies: [hub, rod], at: [-0.15, 0.45, 0.45], axis: [1, 0, 0], axis_2: [0, 0, 1]}
forces:
  spring: {kind: point_spring, bodies: [chassis, arm], from: [0, 0.3, 0.65], to: [0, 0.5, 0.25],
           law: {stiffness: 3.0e+4, damping: 900, free_length: 0.45}}
  tyre: {kind: point_spring, bodies: [ground, hub], from: [0.1, 0.7, -0.6], to: [0, 0.65, 0.1],
         law: {stiffness: 4000, damping: 50, free_length: 0.6}}
outputs: [chassis.z, chassis.roll, hub.x, hub.yaw, hub.ax, spring.force, slide.displacement]
scenes:
  steer: {end: 0.5, output_step: 25 ms, inputs: {steer: "0.015*(1 - cos(7*t))"}}
  straight: {end: 0.2, output_step: 25 ms}
"""


def test_a_guided_coordinate_moves_an_assembly(monkeypatch: pytest.MonkeyPatch) -> None:
    model = read_model_text(STEERED, "corner.yaml")
    left = embed_loops(model, model.scenes["steer"]).left
    assert left[0].text.startswith("stays exact: its guide moves, and functions of two numbers with 9")
    monkeypatch.setattr("cutjoint.analysis.embedding.embed.DEAREST", 10_000)
    monkeypatch.setattr("cutjoint.analysis.embedding.embed._KEPT", {})
    differences = apart(model, model.scenes["steer"])
    for name, difference in differences.items():
        assert difference < (1e-6 if name == "hub.ax" else 1e-8), (name, difference)


def test_a_guide_that_stands_still_is_watched() -> None:
    """Functions for one place of the guide do not serve another: the run says so."""
    model = read_model_text(STEERED, "corner.yaml")
    scene = model.scenes["straight"]
    outcome = embed_loops(model, scene)
    moved = replace(scene, inputs=model.scenes["steer"].inputs, on_violation="stop")
    made = run(outcome.model, moved)
    assert made.failure is not None
    assert "the functions of its loops end there" in made.failure.message


SWING = """
cutjoint: 1
name: swing
gravity: [0, 0, -9.81]
bodies:
  left: {mass: 1, centre_of_mass: [0, 0, 0.5], inertia: [0.1, 0.1, 0.1]}
  bar: {mass: 1, centre_of_mass: [0.5, 0, 1.1], inertia: [0.1, 0.1, 0.1]}
  right: {mass: 1, centre_of_mass: [1, 0, 0.6], inertia: [0.1, 0.1, 0.1]}
joints:
  a: {kind: revolute, bodies: [ground, left], at: [0, 0, 0], axis: [0, 1, 0]}
  b: {kind: revolute, bodies: [left, bar], at: [0, 0, 1], axis: [0, 1, 0]}
  c: {kind: revolute, bodies: [bar, right], at: [1, 0, 1.2], axis: [0, 1, 0]}
  d: {kind: revolute, bodies: [ground, right], at: [1, 0, 0], axis: [0, 1, 0]}
outputs: [a.angle, bar.x]
scenes:
  fall: {end: 3, output_step: 50 ms, rates: {a.angle_rate: 4.0}%s}
"""


def test_a_run_that_leaves_the_range_stops_or_starts_again(tmp_path: Path) -> None:
    """The swing falls towards a pose that the functions do not reach; a view needs the coordinates of one tree."""
    ways = {"stop": ", on_violation: stop", "restart": ""}
    for way, words in ways.items():
        file = tmp_path / f"{way}.yaml"
        file.write_text(SWING % words, encoding="utf-8")
        rows = {}
        for loops in ("exact", "embedded"):
            out = tmp_path / f"{way}_{loops}.csv"
            asked = ["simulate", str(file), "--loops", loops, "--implementation", "interpreted", "--no-error", "--out", str(out)]
            result = CliRunner().invoke(main, [*asked, "--view", str(tmp_path / "view.html")])
            rows[loops] = out.read_text(encoding="utf-8") if out.exists() else ""
        if way == "stop":
            assert result.exit_code == 1
            output = result.output.replace("\n", " ")
            assert "the functions of its loops end there" in output
            assert "run with loops: exact, with on_violation: restart, or with more loop_terms" in output
        else:
            assert result.exit_code == 0, result.output
            assert "repeated with the loop equations" in result.output.replace("\n", " ")
            assert rows["embedded"] == rows["exact"]


def test_tables_that_slide_along_parallel_rails_have_functions() -> None:
    """Two parallel rails leave one coordinate and no joint that follows: the table falls as a mass on a slope."""
    outcome = embed_loops(model := read_model_text(RAILS, "rails.yaml"), model.scenes["fall"])
    (embedded_loop,) = outcome.model.embedded_loops
    assert not embedded_loop.functions.series
    made = run(outcome.model, outcome.scene)
    assert np.abs(made["table.x"] - 0.3 - 0.5 * 9.81 * 0.6 * 0.8 * made.t**2).max() < 1e-9


RAILS = """
cutjoint: 1
name: rails
gravity: [0, 0, -9.81]
bodies:
  table: {mass: 2, centre_of_mass: [0.3, 0, 0.1], inertia: [0.3, 0.3, 0.3]}
joints:
  near: {kind: prismatic, bodies: [ground, table], at: [0, 0, 0], axis: [0.8, 0, -0.6]}
  far: {kind: prismatic, bodies: [table, ground], at: [0, 1, 0], axis: [-0.8, 0, 0.6]}
outputs: [table.x]
scenes:
  fall: {end: 0.3, output_step: 50 ms, rates: {near.displacement_rate: 0}}
"""


def test_a_guide_of_two_coordinates_leaves_a_block_in_its_loops() -> None:
    text = SWING.replace("ground, right]", "slide, right]").replace("joints:\n", """
  slide: {mass: 1, centre_of_mass: [1, 0, 0], inertia: [0.1, 0.1, 0.1]}
joints:
  e: {kind: cylindrical, bodies: [ground, slide], at: [1, 0, 0], axis: [0, 1, 0], guide: [0.01*t, 0.1*t]}
""")  # fmt: skip
    model = read_model_text(text % "", "swing.yaml")
    outcome = embed_loops(model, model.scenes["fall"])
    assert not outcome.model.embedded_loops
    assert any("'e' moves it by several guided coordinates" in str(note) for note in outcome.left)


FIVE_BAR = SWING.replace("  c: {kind: revolute, bodies: [bar, right], at: [1, 0, 1.2], axis: [0, 1, 0]}", """
  c: {kind: revolute, bodies: [bar, more], at: [1, 0, 1.2], axis: [0, 1, 0]}
  e: {kind: revolute, bodies: [more, right], at: [1.2, 0, 0.8], axis: [0, 1, 0]}""").replace(
    "joints:", "  more: {mass: 1, centre_of_mass: [1.1, 0, 1], inertia: [0.1, 0.1, 0.1]}\njoints:")  # fmt: skip

#: A four-bar on a link of the five-bar, which is eliminated at once with all that it carries.
CARRIED = FIVE_BAR.replace("joints:", """  up: {mass: 1, centre_of_mass: [0.3, 0, 1.3], inertia: [0.1, 0.1, 0.1]}
  over: {mass: 1, centre_of_mass: [0.5, 0, 1.6], inertia: [0.1, 0.1, 0.1]}
  down: {mass: 1, centre_of_mass: [0.8, 0, 1.4], inertia: [0.1, 0.1, 0.1]}
joints:
  f: {kind: revolute, bodies: [bar, up], at: [0.2, 0, 1.05], axis: [0, 1, 0]}
  g: {kind: revolute, bodies: [up, over], at: [0.3, 0, 1.6], axis: [0, 1, 0]}
  h: {kind: revolute, bodies: [over, down], at: [0.8, 0, 1.7], axis: [0, 1, 0]}
  i: {kind: revolute, bodies: [bar, down], at: [0.8, 0, 1.1], axis: [0, 1, 0]}""")  # fmt: skip


def test_a_block_in_a_branch_of_other_loops_stays() -> None:
    model = read_model_text((CARRIED % "").replace("rates: {a.angle_rate: 4.0}", "switches: {}"), "carried.yaml")
    outcome = embed_loops(model, model.scenes["fall"])
    assert not outcome.model.embedded_loops
    assert [note.text.partition(": ")[2] for note in outcome.left] == [
        "it has 2 degrees of freedom relative to 'ground' instead of one", "it hangs on other loops that are eliminated at once",
    ]  # fmt: skip
    assert [joint.cut for joint in outcome.model.joints] == [joint.cut for joint in model.joints]


OPENED_GUIDE = STEERED.replace("at: [-0.15, 0.1, 0.45]", "at: [behind, 0.1, 0.45]").replace(
    "parameters: {", "parameters: {behind: {value: -0.15, unit: m, binding: param}, ", 1)  # fmt: skip


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (FIVE_BAR % "", "it has 2 degrees of freedom relative to 'ground' instead of one"),
        (OPENED_GUIDE, "its geometry has tunable parameters, and its guide moves"),
        (SWING.replace("joints:", "gears: {g: {joints: [a.angle, d.angle], ratio: 1}}\njoints:") % "", "a gear couples its joints"),
        (SWING % ", positions: {d.angle: 0.1}", "the scene gives a and d, of which only one can be independent"),
    ],
)  # fmt: skip
def test_blocks_that_stay_say_why(text: str, reason: str) -> None:
    model = read_model_text(text, "swing.yaml")
    outcome = embed_loops(model, next(iter(model.scenes.values())))
    assert not outcome.model.embedded_loops
    assert [note.text for note in outcome.left] == [f"stays exact: {reason}"]


@pytest.mark.parametrize("text", [four_bar(0), spatial(0), STEERED], ids=["plane", "spatial", "steered"])
def test_the_tangent_is_that_of_the_residual(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """All entries beside differences, with accelerations, speeds and coordinates that change at once."""
    monkeypatch.setattr("cutjoint.analysis.embedding.embed.DEAREST", 10_000)
    monkeypatch.setattr("cutjoint.analysis.embedding.embed._KEPT", {})
    model = read_model_text(text, "model.yaml")
    scene = next(iter(model.scenes.values()))
    found = embed_loops(model, scene).model
    assert found.embedded_loops
    equations = implicit(found, scene)
    n, random = equations.unknowns, np.random.default_rng(1)
    q = retract(equations.start, design_coordinates(equations.start), 0.02 * random.standard_normal(n))
    v, vdot = random.standard_normal(n), 3 * random.standard_normal(n)
    damping, stiffness = weights = np.array([0.3, 0.2])
    known = {"t": np.full(1, 0.1), "motion": np.ones(1), "penalty": np.zeros(1), "weights": np.array([*weights, 0.0])}
    known["weights.ball_tangents"] = np.tile(np.eye(3).ravel(), sum(chart.ball for chart in equations.start.charts))
    entries = {name: block for name, block in equations.function("linearise").results.items() if name.startswith("tangent:")}
    tangent = np.zeros((n, n))
    for name, entry in evaluate_results(equations, entries, {**known, "q": q, "v": v, "vdot": vdot}).items():
        row, column = map(int, name.removeprefix("tangent:").split(","))
        tangent[row, column] = entry[0]
    step = 1e-5 * np.eye(n)
    ends = [
        call(equations, "dynamic_residual", {
            **known, "q": retract(equations.start, np.tile(q, (n, 1)), stiffness * delta), "v": v + damping * delta, "vdot": vdot + delta,
        })["force_residual"] for delta in (step, -step)
    ]  # fmt: skip
    differences = (ends[0] - ends[1]).T / 2e-5
    assert np.abs(tangent - differences).max() < 1e-8 * np.abs(tangent).max()


@pytest.mark.parametrize("make", [four_bar, spatial])
def test_newtons_method_has_functions(make) -> None:  # type: ignore[no-untyped-def]
    """The motion is that of the method recursive, reactions too, and no loop is left."""
    model = read_model_text(make(1), "random.yaml")
    scene = replace(model.scenes["fall"], numerics=replace(model.scenes["fall"].numerics, loops="embedded"))
    artifact = compile_interpreted(model, scene, method="recursive-newton")
    assert not artifact.mechanism.closures
    made, known = simulate(artifact, integrator="radau5", tolerance=1e-9), run(model, scene)
    assert made.energy is not None
    assert made.energy.share < 1e-6
    for name in made.columns:
        assert np.abs(made[name] - known[name]).max() < 1e-6 * max(1.0, np.abs(known[name]).max()), name


def test_other_methods_have_no_functions(tmp_path: Path) -> None:
    file = tmp_path / "swing.yaml"
    file.write_text(SWING % "", encoding="utf-8")
    asked = ["simulate", str(file), "--loops", "embedded", "--method", "augmented", "--out", str(tmp_path / "x.csv")]
    result = CliRunner().invoke(main, asked)
    assert result.exit_code == 1
    words = "--loops embedded: only generated and interpreted programs of the methods recursive and recursive-newton have it"
    assert words in result.output.replace("\n", " ")


#: The swing with a mass that stays open and an input, in equal steps of 1 ms, whose numbers all hosts have to the last bit.
HELD = SWING.replace("bodies:\n", """parameters: {heavy: {value: 1, unit: kg, binding: param}, push: {value: 0, unit: N, binding: input}}
bodies:
""", 1).replace("left: {mass: 1,", "left: {mass: heavy,").replace(
    "outputs:", "forces: {push: {kind: joint_force, joint: a, law: push - 30*position}}\noutputs:"
) % ", numerics: {loops: embedded, integrator: trapezoidal, dt: 1 ms}"  # fmt: skip


def test_a_scene_compiles_its_loops() -> None:
    """The equations from which folders, FMUs, batches and sweeps follow have no loop; those of other methods have theirs."""
    model = read_model_text(HELD, "swing.yaml")
    scene = model.scenes["fall"]
    assert not generate(model, scene, scene.outputs).equations.topology.cuts
    assert not compile_interpreted(model, scene).mechanism.closures
    assert not generate(model, scene, scene.outputs, method="recursive-newton").equations.topology.cuts
    assert generate(model, scene, scene.outputs, method="classical").equations.topology.cuts


#: A point that stays open, in place of the mass.
HIGH = HELD.replace("heavy: {value: 1, unit: kg", "heavy: {value: 1, unit: m").replace("mass: heavy", "mass: 1").replace(
    "at: [0, 0, 1]", "at: [0, 0, heavy]"
)  # fmt: skip


@pytest.mark.heavy
@pytest.mark.parametrize(("text", "other"), [(HELD, 3.0), (HIGH, 1.01)], ids=["mass", "point"])
def test_every_host_has_the_table_of_the_command_line(text: str, other: float, tmp_path: Path) -> None:
    """An FMU, exported C++, and a sweep of few runs, which go one by one, have the table of the command line; lanes of a batch round."""
    fmpy = pytest.importorskip("fmpy")
    file = tmp_path / "swing.yaml"
    file.write_text(text.replace("end: 3", "end: 0.5").replace("a.angle_rate: 4.0", "a.angle_rate: 0.5"), encoding="utf-8")
    artifact = compile_model(file, out=tmp_path / "folder")
    assert not artifact.mechanism.closures
    known, changed = (simulate(artifact, error=False, parameters={"heavy": x}, inputs={"push": 0.0}) for x in (1.0, other))
    check_table(artifact, tmp_path / "folder")
    model = read_model(file)
    written = tmp_path / "swing.fmu"
    written.write_bytes(make_fmu(model, model.scenes["fall"], version=3).pack(sources=False, binary=True, picture=b""))
    table = fmpy.simulate_fmu(str(written), stop_time=0.5, output_interval=0.05)
    batch = simulate_batch(compile_batch(file), [{"heavy": 1.0}, {"heavy": other}])
    study = tmp_path / "study.yaml"
    variables = f"{{heavy: [1, {other}], push: [0]}}"
    study.write_text(
        f"cutjoint_study: 1\nmodel: swing.yaml\nparameters: {variables}\ndesign: grid\nobjectives: {{place: {{end: bar.x}}}}\n",
        encoding="utf-8",
    )  # fmt: skip
    swept = perform_study(read_study(study), tmp_path / "table.parquet").table["place"].to_pylist()
    for column in known.columns:
        assert np.array_equal(table[column], known[column]), column
        ends = [known[column][-1], changed[column][-1]]
        assert ends[0] != ends[1]
        assert batch.end[column] == pytest.approx(ends, abs=1e-12 * np.abs(known[column]).max())  # 500 steps' rounding
    assert swept == [known["bar.x"][-1], changed["bar.x"][-1]]


def test_check_says_what_becomes_of_loops(tmp_path: Path) -> None:
    file = tmp_path / "swing.yaml"
    file.write_text(HELD, encoding="utf-8")
    said = CliRunner().invoke(main, ["check", str(file)]).output.replace("\n", " ")
    reported = re.search(r"'a' embeds 3 other joints as functions of its coordinate, violation \S+; (.*)", said)
    assert reported is not None, said
    off = re.match(r"at 1000 random coordinates speeds are (\S+) off at q' = 1, accelerations (\S+) ", reported[1])
    assert off is not None, said
    assert float(off[1]) < 1e-10
    assert float(off[2]) < 1e-8


def test_poses_and_modes_keep_the_loops_equations() -> None:
    """An equilibrium lies anywhere, and modes have all coordinates."""
    model = read_model_text(HELD, "swing.yaml")
    scene = model.scenes["fall"]
    exact = replace(scene, numerics=replace(scene.numerics, loops="exact"))
    one, other = (find_scene_equilibrium(model, chosen).values["bar.x"] for chosen in (scene, exact))
    assert one == other
