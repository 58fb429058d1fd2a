"""`cutjoint couple`: a controller that is an FMU drives a model, and what is refused."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from scipy.integrate import solve_ivp

import cutjoint
from cutjoint.cli import main
from cutjoint.export.fmu.archive import make_fmu
from cutjoint.methods import METHODS
from cutjoint.model.read import read_model_text
from cutjoint.run.results import read_table
from cutjoint.run.scenes import find_scene
from tests.conftest import ROOT, needs_cpp
from tests.mechanisms.driven import DRIVEN
from tests.mechanisms.steered import LAW, steered_text

pytest.importorskip("fmpy")
pytestmark = needs_cpp

EXAMPLES = ROOT / "examples"
POLE = EXAMPLES / "cart_pole.yaml"
NAMES = ("--connect", "position=cart.x", "--connect", "angle=pin.angle", "--connect", "force=push")

#: A mass that hangs by a spring on a point whose place is an input, or that a force pushes, which is one too.
MASS = """
cutjoint: 1
name: {name}
gravity: [0, 0, 0]
parameters: {{ given: {{value: 0, unit: {unit}, binding: input}} }}
bodies: {{ mass: {{mass: {mass}, centre_of_mass: [0, 0, 0]}} }}
joints: {{ rail: {{kind: prismatic, bodies: [ground, mass], at: [0, 0, 0], axis: [1, 0, 0]}} }}
forces: {{ pull: {{kind: joint_force, joint: rail, law: "{law}"}} }}
outputs: [mass.x, pull.force]
scenes: {{ run: {{end: 0.5, output_step: 10 ms, rates: {{rail.displacement_rate: 1.0}}, numerics: {{dt: 1 ms}}}} }}
"""
HANGING = MASS.format(name="hanging", unit="m", mass=2, law="100*(given - position)")
PUSHED = MASS.format(name="pushed", unit="N", mass=3, law="-given")


@pytest.fixture(scope="module")
def controller(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The controller of the examples."""
    file = tmp_path_factory.mktemp("controller") / "pole_controller.fmu"
    subprocess.run([sys.executable, EXAMPLES / "pole_controller" / "build.py", file], check=True, capture_output=True)
    return file


def simulate(model: Path, fmu: Path, out: Path, *more: object) -> Result:
    words = ["couple", str(model), str(fmu), "--out", str(out), *map(str, more)]
    return CliRunner().invoke(main, words)


def words_of(result: Result) -> str:
    return " ".join(result.output.split())


def balanced(times: np.ndarray) -> np.ndarray:
    """Places of cart and pole by SciPy: equations by hand, the push of a sampled controller a step late."""

    def move(_: float, x: np.ndarray, push: float) -> list[float]:
        (s, c), turning = (np.sin(x[1]), np.cos(x[1])), x[3]
        masses = [[1.2, 0.1 * c], [0.1 * c, 0.2 * 0.25 * 4 / 3]]
        return [x[2], turning, *np.linalg.solve(masses, [push + 0.1 * s * turning**2, 0.1 * 9.81 * s])]

    x, push, last, rows = np.array([0.0, 0.1, 0.0, 0.0]), 0.0, np.array([0.0, 0.1]), []
    for _ in times:
        rows.append(x[:2])
        rates = (x[:2] - last) / 0.01
        later = 3.0 * x[0] + 5.0 * rates[0] + 45.0 * x[1] + 14.0 * rates[1]
        last = x[:2]
        x = solve_ivp(move, (0.0, 0.01), x, args=(push,), method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        push = later
    return np.array(rows)


def test_the_controller_of_the_examples_balances_the_pole_as_equations_by_hand_say(controller: Path, tmp_path: Path) -> None:
    out = tmp_path / "balanced.csv"
    how = ("--integrator", "dormand-prince", "--solver-tolerance", 1e-9)
    result = simulate(POLE, controller, out, *NAMES, *how, "--plots", tmp_path / "plots")
    assert result.exit_code == 0, result.output
    for words in (
        "scene balance with pole_controller.fmu, FMI 2", "500 steps of 0.01 s", "driven push by force",
        "read cart.x as position, pin.angle as angle", "converged yes", "4 outputs, 501 rows",
    ):  # fmt: skip
        assert words in words_of(result)
    t, columns = read_table(out)
    assert list(columns) == ["cart.x", "pin.angle", "pin.angle_rate", "push"]
    found, known = np.column_stack([columns["cart.x"], columns["pin.angle"]]), balanced(t)
    assert np.abs(found - known).max() < 1e-7  # the tolerance times what the regulator makes of it
    assert np.abs(found[-1]).max() < 0.01
    assert (tmp_path / "balanced.error.json").exists()
    assert list((tmp_path / "plots").glob("*.png"))


def test_inputs_that_jump_leave_the_trapezoidal_rule_its_order(controller: Path, tmp_path: Path) -> None:
    errors = []
    for dt in (2e-3, 1e-3):
        out = tmp_path / f"{dt}.csv"
        assert simulate(POLE, controller, out, *NAMES, "--dt", dt, "--no-error").exit_code == 0
        t, columns = read_table(out)
        errors.append(np.abs(columns["pin.angle"] - balanced(t)[:, 1]).max())
    assert 3.5 < errors[0] / errors[1] < 4.5


@pytest.mark.parametrize("version", [2, 3])
def test_two_models_step_side_by_side_as_by_hand(version: int, tmp_path: Path) -> None:
    paths = {name: tmp_path / f"{name}.yaml" for name in ("hanging", "pushed")}
    for path, text in zip(paths.values(), (HANGING, PUSHED), strict=True):
        path.write_text(text)
    fmu = made(HANGING, tmp_path / "hanging.fmu", version)
    out, step = tmp_path / "pushed.csv", 0.004
    connections = ("--connect", "given=mass.x", "--connect", "pull.force=given")
    result = simulate(paths["pushed"], fmu, out, *connections, "--communication-step", step, "--integrator", "rk4", "--no-error")
    assert result.exit_code == 0, result.output
    _, columns = read_table(out)
    other, one = (cutjoint.load(path, integrator="rk4").reset() for path in paths.values())
    for i in range(125):
        place, force = one.outputs["mass.x"], other.outputs["pull.force"]
        one.inputs["given"], other.inputs["given"] = force, place
        if i % 5 == 0:  # a row and an exchange at once
            assert (columns["mass.x"][2 * i // 5], columns["given"][2 * i // 5]) == (place, force)
        one.advance((i + 1) * step)
        other.advance((i + 1) * step)


def made(text: str, file: Path, version: int = 2) -> Path:
    """The FMU of a model's text, with steps of the classical Runge-Kutta rule, in a file of a folder that need not be there."""
    model = read_model_text(text, f"{file.stem}.yaml")
    fmu = make_fmu(model, find_scene(model, None), version=version, integrator="rk4")
    file.parent.mkdir(exist_ok=True)
    file.write_bytes(fmu.pack(sources=False, binary=True, target="baseline"))
    return file


def test_several_fmus_step_side_by_side_as_by_hand(tmp_path: Path) -> None:
    """The first hangs on the model, the second on the first, with steps of communication twice as long."""
    external_wrenches = PUSHED.replace("{ given:", "{ other: {value: 0, unit: N, binding: input}, given:").replace('"-given"',
        '"-given + 0.5*other"')
    paths = {name: tmp_path / f"{name}.yaml" for name in ("pushed", "hanging")}
    for path, text in zip(paths.values(), (external_wrenches, HANGING), strict=True):
        path.write_text(text)
    fast = changed(made(HANGING, tmp_path / "made" / "hanging.fmu"), tmp_path, ('stepSize="0.01"', 'stepSize="0.002"'))
    slow = changed(made(HANGING, tmp_path / "made" / "second.fmu"), tmp_path, ('stepSize="0.01"', 'stepSize="0.004"'))
    out = tmp_path / "pushed.csv"
    pairs = ("hanging:given=mass.x", "hanging:pull.force=given", "second:given=hanging:mass.x", "second:pull.force=other")
    connections = [word for pair in pairs for word in ("--connect", pair)]
    view = tmp_path / "pushed.html"
    result = simulate(paths["pushed"], fast, out, slow, *connections, "--integrator", "rk4", "--no-error", "--view", view)
    assert result.exit_code == 0, result.output
    for words in ("hanging.fmu, FMI 2, second.fmu, FMI 2", "read hanging:mass.x as given", "communication second.fmu 125 steps of 0.004 s"):
        assert words in words_of(result)
    assert view.stat().st_size > 100_000
    _, columns = read_table(out)
    assert list(columns) == ["mass.x", "pull.force", "given", "other"]
    one, first, second = (cutjoint.load(path, integrator="rk4").reset() for path in (paths["pushed"], paths["hanging"],
        paths["hanging"]))
    other = 0.0
    for i in range(250):
        place, force = one.outputs["mass.x"], first.outputs["pull.force"]
        if i % 2 == 0:
            other, there = second.outputs["pull.force"], first.outputs["mass.x"]
            second.inputs["given"] = there
        one.inputs["given"], one.inputs["other"], first.inputs["given"] = force, other, place
        if i % 5 == 0:
            assert [columns[name][i // 5] for name in ("mass.x", "given", "other")] == [place, force, other]
        one.advance((i + 1) * 0.002)
        first.advance((i + 1) * 0.002)
        if i % 2:
            second.advance((i + 1) * 0.002)


SEVERAL = [
    (("given=mass.x",), "several FMUs have 'given'; write hanging:given or second:given"),
    (("third:given=mass.x",), "the FMUs have no such input or output"),
    (("hanging:given=second:given",), "both are inputs; connect an output with an input"),
    (("hanging:mass.x=hanging:given",), "both are ports of"),
    (("hanging:pull.force=given", "second:pull.force=given"), "would drive input 'given'; connect another input of the model"),
    (("hanging:mass.x=second:given", "second:given=mass.x"), "input 'given' would be driven twice; connect it once"),
    (("hanging:pull.force=second:given",), "no unit of the same kind"),
]


@pytest.fixture(scope="module")
def hanging(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two FMUs with the same ports."""
    folder = tmp_path_factory.mktemp("hanging")
    return [made(HANGING, folder / f"{name}.fmu") for name in ("hanging", "second")]


@pytest.mark.parametrize(("pairs", "message"), SEVERAL)
def test_ports_of_several_fmus_are_reported_apart(pairs: tuple[str, ...], message: str, hanging: list[Path], tmp_path: Path) -> None:
    model = tmp_path / "pushed.yaml"
    model.write_text(PUSHED)
    result = simulate(model, hanging[0], tmp_path / "out.csv", hanging[1], *(word for pair in pairs for word in ("--connect", pair)))
    assert result.exit_code == 1
    assert message in words_of(result)


def changed(fmu: Path, place: Path, *changes: tuple[str, str]) -> Path:
    """An FMU with other texts in its description, and in the names of its files."""
    file = place / fmu.name
    with zipfile.ZipFile(fmu) as source, zipfile.ZipFile(file, "w") as target:
        for name in source.namelist():
            content = source.read(name)
            for old, new in changes:
                name = name.replace(old, new)
                content = content.replace(old.encode(), new.encode()) if name.endswith(".xml") else content
            target.writestr(name, content)
    return file


REFUSED = [
    (("--connect", "speed=cart.x"), "--connect speed: {fmu} has no such input or output; it has: angle, force, position"),
    (("--connect", "force=pull"), "--connect force=pull: 'pull' is no input of model 'cart_pole'; there is: push"),
    (("--connect", "angle=pin.angel"), "--connect angle=pin.angel: 'pin.angel' is no output of scene 'balance'; did you mean 'pin.angle'?"),
    (("--connect", "angle=cart.x"), "{fmu}: 'angle' is in deg and 'cart.x' in m, which is no unit of the same kind"),
    (("--connect", "angle"), "--connect angle: write PORT=NAME"),
    ((), "{fmu}: none of its inputs and outputs (position, angle, force) has the name of one of the model's outputs"),
    ((*NAMES, "--set", "push=1"), "--set push: output 'force' of {fmu} drives this input; leave out one of the two"),
    ((*NAMES, "--set", "pull=1"), "--set pull: model 'cart_pole' has no such tunable parameter or input; it has: push"),
    ((*NAMES, "--solver-tolerance", "1e-6"), "--solver-tolerance: beside an FMU only dormand-prince, dop853 or radau5 has one"),
]


@pytest.mark.parametrize(("words", "message"), REFUSED)
def test_what_does_not_go_together_is_said(words: tuple[str, ...], message: str, controller: Path, tmp_path: Path) -> None:
    result = simulate(POLE, controller, tmp_path / "out.csv", *words)
    assert result.exit_code == 1
    assert message.format(fmu=controller) in words_of(result)
    assert not (tmp_path / "out.csv").exists()


_OUTPUT = 'causality="output" variability="continuous" initial="calculated"><Real unit="N"/>'
BROKEN = [
    ((("CoSimulation", "ModelExchange"), (' canHandleVariableCommunicationStepSize="false"', "")),
     "the FMU has no co-simulation but model exchange; export it for co-simulation"),
    ((("linux64", "win64"),), "the FMU has no binary for linux64 (it has win64); 'fmpy compile {fmu}' builds one from its sources"),
    (((' stepSize="0.01"', ""),), "the FMU has no default step size; set --communication-step"),
    (((_OUTPUT, _OUTPUT.replace("continuous", "discrete").replace('Real unit="N"', "Integer")),),
     "'force' cannot be connected with 'push': its type is Integer, and only real numbers are connected"),
    ((('fmiVersion="2.0"', 'fmiVersion="9.0"'),), "this is no FMU that can be read"),
    ((('name="angle"', 'name="pin.angle"'), ('valueReference="2"', 'valueReference="7"')), "outputs force cannot be read"),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "message"), BROKEN)
def test_fmus_that_cannot_be_coupled(changes: tuple[tuple[str, str], ...], message: str, controller: Path, tmp_path: Path) -> None:
    fmu = changed(controller, tmp_path, *changes)
    names = NAMES if "pin.angle" not in str(changes) else NAMES[-2:]
    result = simulate(POLE, fmu, tmp_path / "out.csv", *names)
    assert result.exit_code == 1
    assert message.format(fmu=fmu) in words_of(result)


def test_a_model_without_inputs_has_none_to_drive(controller: Path, tmp_path: Path) -> None:
    model = tmp_path / "still.yaml"
    model.write_text(PUSHED.replace("-given", "-position").replace("parameters: { given: {value: 0, unit: N, binding: input} }\n", ""))
    result = simulate(model, controller, tmp_path / "out.csv", "--connect", "force=push")
    assert "--connect force=push: 'push' is no input of model 'pushed'; it has none" in words_of(result)


def test_a_file_that_is_no_archive(tmp_path: Path) -> None:
    assert f"{POLE}: this is no FMU, which is a ZIP archive" in words_of(simulate(POLE, POLE, tmp_path / "out.csv"))


@pytest.mark.heavy
def test_all_methods_of_a_scene_balance_the_pole(controller: Path, tmp_path: Path) -> None:
    """Forces that jump at exchanges change accelerations and multipliers of each method alike."""
    rows = {}
    for method in METHODS:
        model, out = tmp_path / f"{method}.yaml", tmp_path / f"{method}.csv"
        model.write_text(POLE.read_text(encoding="utf-8").replace("{end: 5,", f"{{end: 0.5, method: {method},", 1), encoding="utf-8")
        result = simulate(model, controller, out, *NAMES, "--no-error")
        assert result.exit_code == 0, result.output
        rows[method] = read_table(out)[1]
    for method, columns in rows.items():
        for name, values in rows["recursive"].items():
            assert np.allclose(columns[name], values, rtol=1e-3, atol=1e-3), (method, name)


@pytest.mark.parametrize("rows", [1e-3, 2e-3, 0.01])
def test_a_controller_steers_a_guide_as_a_law_does(rows: float, tmp_path: Path) -> None:
    """A swinging mass steers the rack, a step of communication late; rows between exchanges change nothing."""
    hanging, steered, fmu, step = tmp_path / "hanging.yaml", tmp_path / "steered.yaml", tmp_path / "hanging.fmu", 2e-3
    hanging.write_text(HANGING.replace("rates: {rail.displacement_rate: 1.0}", "positions: {rail.displacement: 0.01 m}"))
    late = f"0.01*cos({np.sqrt(50)}*max(t - {step}, 0))"
    steered.write_text(steered_text().replace(LAW, late).replace("end: 1, output_step: 0.01", f"end: 0.4, output_step: {rows}"))
    made(hanging.read_text(), fmu)
    out = tmp_path / "out.csv"
    words = ("--connect", "mass.x=rack", "--communication-step", step, "--dt", 1e-3, "--no-error", "--scene", "free")
    result = simulate(steered, fmu, out, *words)
    assert result.exit_code == 0, result.output
    _, columns = read_table(out)
    lawful = cutjoint.load(steered, scene="lawful", integrator="dormand-prince").reset()
    lawful.advance(0.4)
    assert abs(lawful.outputs["rail.displacement"]) > 1e-3
    for name in ("rail.displacement", "pivot.angle", "cart.y"):
        assert columns[name][-1] == pytest.approx(lawful.outputs[name], abs=5e-6), name


def test_inputs_are_driven_once(controller: Path, tmp_path: Path) -> None:
    twice = ('causality="input" variability="continuous"><Real unit="m" start="0"/>', 'causality="output" variability="continuous"><Real/>')
    both = changed(controller, tmp_path, twice, ('<Unknown index="3" dependencies=""/>', '<Unknown index="1"/><Unknown index="3"/>'))
    result = simulate(POLE, both, tmp_path / "out.csv", "--connect", "force=push", "--connect", "position=push")
    assert "both 'position' and 'force' would drive input 'push'; connect one of them" in words_of(result)


def test_what_nothing_drives_follows_the_scene_and_is_named(controller: Path, tmp_path: Path) -> None:
    path, out = tmp_path / "driven.yaml", tmp_path / "out.csv"
    path.write_text(DRIVEN)
    result = simulate(path, controller, out, "--scene", "lawful", "--connect", "position=slider.x", "--no-error")
    assert result.exit_code == 0, result.output
    assert "follow the scene lift, push" in words_of(result)
    assert "stay at their start angle of the FMU" in words_of(result)
    alone = cutjoint.load(path, scene="lawful").reset()
    alone.advance(1.0)
    _, columns = read_table(out)
    assert [columns[name][-1] for name in alone.outputs] == alone.outputs.array.tolist()


def test_a_motion_that_cannot_go_on_leaves_its_rows(tmp_path: Path, controller: Path) -> None:
    mad = changed(controller, tmp_path, ('unit="deg"', 'unit="tiny"'), ("</UnitDefinitions>", TINY))
    result = simulate(POLE, mad, tmp_path / "out.csv", *NAMES)
    assert result.exit_code == 1
    assert "scene 'balance': cart_pole, at 0.0" in words_of(result)
    assert f"the rows up to then are in {tmp_path / 'out.partial.csv'}" in words_of(result)


#: Degrees of which a radian has so many that the push has no end.
TINY = '<Unit name="tiny"><BaseUnit rad="1" factor="1e-200"/></Unit></UnitDefinitions>'
