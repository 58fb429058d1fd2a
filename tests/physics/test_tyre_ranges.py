"""Wheels at the ends of what their files cover: limits, low speed and little load beside the printed equations, edges, lift and landing."""

from __future__ import annotations

import json

import numpy as np
import pytest
import yaml

from cutjoint.model.read import read_model_text
from cutjoint.package.locations import library_folder
from cutjoint.run.results import Trajectory
from cutjoint.run.scenes import find_case
from cutjoint.run.simulation import simulate
from tests.physics.simulation import compile_scene, completed
from tests.physics.test_turn_slip import EQUATIONS, TURNING, bench, coefficients, motions, printed
from tests.physics.test_wheels import CORNER, DATA, KINDS, LEVEL, MASSES, SLOPE, of_formula, run

#: Ranges narrower than those of the file, so that most of the motions are beyond them.
RANGES = {"KPUMIN": -0.1, "KPUMAX": 0.15, "ALPMIN": -0.12, "ALPMAX": 0.1, "CAMMIN": -0.03, "CAMMAX": 0.05, "FZMAX": 5000.0}


def limited(rows: dict[str, np.ndarray], limits: int) -> Trajectory:
    """The library's formula over rows of motion, behind its limits."""
    text = of_formula(
        "mf62s", ("vy", "turn"), f"turn_slip: 1, limits: {limits}, {TURNING}, {', '.join(f'{k}: {v}' for k, v in RANGES.items())}, "
    )
    part = yaml.safe_load((library_folder() / "formulas/limits.yaml").read_text())
    within = json.dumps({key: value for key, value in part.items() if key != "cutjoint"})
    text = text.replace("    submodels: {f: ", f"    submodels: {{within: {within}, f: ")
    text = text.replace(
        "    instances: {f: {use: f, with: {",
        "    instances: {within: {use: within, with: {slip: kappa, angle: alpha, lean: gamma, pressed: load}}, f: {use: f, with: {",
    )
    for name in ("kappa", "alpha", "gamma", "load"):
        head, middle, tail = text.partition("f: {use: f, with: {")
        text = head + middle + tail.replace(f"{name}: {name}", f"{name}: within.{name}", 1)
    text = text.replace("    parameters: [", f"    parameters: [limits, {', '.join(RANGES)}, ")
    model = read_model_text(text, "m.yaml", folder=DATA)
    times = np.arange(len(rows["kappa"]), dtype=float)
    inputs = {name: {"t": times, "value": values, "interpolation": "linear"} for name, values in rows.items()}
    return completed(simulate(compile_scene(model, model.scenes["run"]), inputs=inputs, end=times[-1], error=False))


def at(rows: dict[str, np.ndarray], number: int) -> dict[str, float]:
    return {name: float(values[number]) for name, values in rows.items()}


def test_limits_are_those_of_the_printed_equations() -> None:
    """Slips, camber and load end where the file's ranges do; the road's motion goes on."""
    rows = motions(12)
    ends = {"kappa": ("KPUMIN", "KPUMAX"), "alpha": ("ALPMIN", "ALPMAX"), "gamma": ("CAMMIN", "CAMMAX"), "load": (None, "FZMAX")}
    inside = {
        name: np.clip(rows[name], -np.inf if low is None else RANGES[low], RANGES[high]) for name, (low, high) in ends.items()
    }  # fmt: skip
    assert all((inside[name] != rows[name]).any() for name in ends)
    for limits, motion in ((1, rows | inside), (0, rows)):
        found, expected = limited(rows, limits), [printed(at(motion, i)) for i in range(12)]
        for name in ("Fx", "Fy", "Mz"):
            values = np.array([each[name] for each in expected])
            assert found[f"bench.f.{name}.value"] == pytest.approx(values, rel=0, abs=1e-9 * np.abs(values).max()), name


def test_turn_slip_below_the_low_speed_is_that_of_the_printed_equations(monkeypatch: pytest.MonkeyPatch) -> None:
    """With VXLOW for the speed that turn slip is divided by, and the share of it for the sign of the speed, of which two cancel."""
    low = coefficients()["VXLOW"]
    equations = (
        EQUATIONS.replace("Vc = sqrt(Vx**2 + Vy**2)", "Vc = VXLOW").replace("dfz)*sign(Vx)", "dfz)").replace("*sign(Vx)", "*Vx/VXLOW")
    )
    monkeypatch.setattr("tests.physics.test_turn_slip.EQUATIONS", equations)
    rows = motions(8)
    share = 0.6 * low / rows["vx"]
    rows |= {name: rows[name] * share for name in ("vx", "vy", "spin")} | {"turn": rows["turn"] / 3}
    assert np.hypot(rows["vx"], rows["vy"]).max() < low
    found, expected = bench(rows, f"turn_slip: 1, {TURNING}, "), [printed(at(rows, i)) for i in range(8)]
    for name in ("Fx", "Fy", "Mz"):
        values = np.array([each[name] for each in expected])
        assert found[f"bench.f.{name}.value"] == pytest.approx(values, rel=0, abs=1e-9 * np.abs(values).max()), name


def test_forces_below_the_least_load_are_those_of_the_printed_equations() -> None:
    """Below FZMIN they fade out with the load, and without load there are none."""
    rows = motions(8) | {"load": np.array([0.0, 1e-3, 0.1, 1.0, 10.0, 30.0, 60.0, 90.0])}
    found = bench(rows, f"turn_slip: 1, {TURNING}, ")
    expected = [printed(at(rows, i)) for i in range(1, 8)]
    for name in ("Fx", "Fy", "Mz"):
        values = np.array([each[name] for each in expected])
        assert abs(found[f"bench.f.{name}.value"][0]) < 1e-4
        assert found[f"bench.f.{name}.value"][1:] == pytest.approx(values, rel=1e-9, abs=1e-9), name


CRAWL = """end: 12, output_step: 0.5, numerics: {{dt: 0.001}}, states: {{w.rolling.rolled: 1}}, drive: {{slide: {speed}*t}},
    rates: {{w.rolling.bearing.angle_rate: {speed}/0.3}}"""


@pytest.mark.parametrize("speed", [0.3, 2.0])
def test_steady_slip_at_low_speed_has_the_force_of_the_printed_equations(speed: float) -> None:
    """A driven wheel at 2 m/s, and at 0.3 m/s, below VXLOW."""
    reported = "w.rolling.contact.loaded_radius, w.formula.Re.value, w.rolling.kappa.value, "
    scene = CRAWL.format(speed=speed)
    text = CORNER.replace("outputs: [", f"outputs: [{reported}").replace("mf%s.tir", "mf%ss.tir")
    model, chosen = find_case(
        read_model_text(text % (*LEVEL, "62", f", drive: 700, INFLPRES: {coefficients()['NOMPRES']}", "62", scene), "m.yaml", folder=DATA),
        "run",
    )
    found = completed(simulate(compile_scene(model, chosen), integrator="trapezoidal", error=False))
    last = {name: float(values[-1]) for name, values in found.items()}
    kappa = last["w.formula.Re.value"] * last["w.rolling.contact.spin"] / speed - 1
    assert 0.02 < kappa < 0.06
    assert last["w.rolling.kappa.value"] == pytest.approx(kappa, rel=1e-6)
    motion = {"kappa": kappa, "alpha": 0.0, "gamma": 0.0, "load": last["w.rolling.contact.Fz"], "vx": speed, "vy": 0.0, "turn": 0.0}
    expected = printed(motion | {"spin": last["w.rolling.contact.spin"]})["Fx"]
    assert last["w.rolling.contact.Fx"] == pytest.approx(expected, rel=1e-6)


def on(kind: str, gravity: tuple[str, str], scene: str) -> Trajectory:
    text = CORNER.replace("bodies:\n", "  lifting: {value: 0, unit: N, binding: input}\nbodies:\n", 1)
    text = text.replace("[pull, 0, 0]", "[pull, 0, lifting]").replace("outputs: [", "outputs: [w.rolling.contact.deflection, ")
    return run(read_model_text(text % (*gravity, kind, MASSES[kind], kind, scene), "m.yaml", folder=DATA), integrator="trapezoidal")


@pytest.mark.parametrize("begins", [-0.05, 0.0, 0.05])
@pytest.mark.parametrize("kind", KINDS)
def test_a_wheel_rests_on_the_edge_of_a_step(kind: str, begins: float) -> None:
    """Behind, above and before the edge of a step of 2 cm, shaken as on the slope: after whole periods it is where it was."""
    road = f"road: {{contact: disc, start: {begins}, profile: [{{step: 0.02}}]}}"
    scene = f"end: 8, output_step: 1, numerics: {{dt: 0.001}}, {road}, inputs: {{brake: 1500, pull: '400*sin(2*pi*t)'}}"
    text = CORNER % (*LEVEL, kind, MASSES[kind], kind, scene)
    found = run(read_model_text(text, "m.yaml", folder=DATA), integrator="trapezoidal")
    assert np.ptp(found["cart.x"][5:]) < 1e-6
    assert np.abs(found["cart.x"]).max() < 0.02


@pytest.mark.parametrize("kind", KINDS)
def test_a_wheel_lifts_and_lands(kind: str) -> None:
    """Braked on the slope, lifted for a second: no force in the air, and that of the slope afterwards."""
    lifts = "{table: {t: [0, 3, 3.2, 3.5, 3.7, 9], value: [0, 0, 4500, 4500, 0, 0]}, interpolation: linear}"
    scene = f"end: 7, output_step: 0.001, numerics: {{dt: 0.0005}}, inputs: {{brake: 5000, lifting: {lifts}}}"
    found = on(kind, SLOPE, scene)
    air = found["w.rolling.contact.deflection"] < 0
    assert 0.2 < 0.001 * air[1000:].sum() < 2
    for name in ("Fx", "Fz"):
        assert not np.any(found[f"w.rolling.contact.{name}"][air])
    weight = (20 + 330 + (20 if kind == "52" else 9.4)) * 9.81
    assert found["w.rolling.contact.Fx"][-1] == pytest.approx(weight * 0.19611613513818404, rel=1e-4)
    assert abs(found["cart.vx"][-1]) < 1e-5
