"""Derivatives at a state: against differences in 113 bits, closed forms, SymPy, and the modes by the exact tangent."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import sympy
from click.testing import CliRunner

import cutjoint
from cutjoint.cli import main
from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.methods import METHODS, linearised_methods
from cutjoint.model.read import read_model_text
from cutjoint.package.errors import RunError
from cutjoint.run.scenes import find_scene
from cutjoint.stepping.load import load_scene
from tests.conftest import MODELS, ROOT, needs_cpp, with_heavy
from tests.fmu.slaves import text_of
from tests.mechanisms.driven import pushed_text
from tests.mechanisms.seeing import SOFT_IN_QUADS, seeing
from tests.mechanisms.switching import MASS, RAMP, STIFFNESS, WHEEL

from .c_exports import HERE, compile_object, folder_of, folder_of_model, foreign_symbols, in_quads, link, run, write

pytestmark = needs_cpp

RELATIVE = linearised_methods()
CART_POLE = ROOT / "examples" / "cart_pole.yaml"

#: Models and scenes, steps before states, and speeds that are chosen there: a loop, balls in one, parts side by side, guides by inputs, and
#: all of it.
STATES = [
    ("press", None, None, [(100,), (100, 2)]), ("spinning", None, None, [(100,), (40, 4, 1, 6, 5)]), ("flyball", None, "rk4", [(100,)]),
    ("press", None, "rk4", [(100,)]), ("driven", "free", None, [(50,)]), ("axle", "chirp", None, [(200,)]),
    ("spinning", None, "rk4", [(50,)]),
]  # fmt: skip


@pytest.mark.parametrize(("name", "scene", "integrator", "states"), with_heavy(STATES, *STATES[-2:]))
def test_derivatives_are_those_of_differences_in_113_bits(
    name: str, scene: str | None, integrator: str | None, states: list[tuple[int, ...]], tmp_path: Path
) -> None:
    compare(write(folder_of(text_of(name), f"{name}.yaml", scene, integrator, linearise=True), tmp_path), name, states)


#: Models, scenes, integrators, and numbers of the file that are parameters too: masses, rates of springs, hardpoints.
RANDOM = [
    ("press", None, "rk4", ("A.z", "rod.mass")), ("press", None, None, ("A.z", "rod.mass")), ("spinning", None, None, ()),
    ("pendulum", None, None, ("bob.mass", "bob.centre_of_mass.x")), ("flyball", None, "rk4", ("slider.mass", "right.side.z")),
    ("flyball", None, None, ("slider.mass", "right.side.z")), ("gantry", None, None, ("rope_length", "load.shapes.0.mass")),
    ("leg", None, "rk4", ("trunk.mass", "K.z")), ("six_bar", None, None, ("ram.shapes.0.mass", "distance", "cutting")),
    ("four_bar", None, None, ("crank_0.bar.mass", "crank_1.x_to", "coupler_2.bar.inertia.principal.z")),
    ("slider_crank", None, None, ("slider.mass", "rod.mass", "B.z", "C.x")), ("slider_crank", None, "rk4", ("slider.mass", "B.z")),
    ("andrews", None, None, ("spring.law.stiffness", "K3.mass", "C.x", "H.y")),
    ("excavator", None, None, ("boom.mass", "B.x", "L2.x", "bc_slide.limits.stiffness")),
    ("delta", None, None, ("plate.mass", "l1.upper.shapes.0.mass", "l2.motor.limits.stiffness")),
    ("stewart", None, None, ("platform.mass", "rb")), ("axle", "chirp", None, ("chassis.mass", "left.UB.z", "left.TO.z")),
    ("car", None, None, ("front_left.stiffness", "chassis.mass", "front_left.upper_outer.z")),
    ("iltis", "iavsd_sine_2mm", "rk4", ("front_left.carrier.mass", "front_left.D1.z")),
]  # fmt: skip


@pytest.mark.parametrize(
    ("name", "scene", "integrator", "tunable", "states"),
    [(*RANDOM[0], "*5"), *(pytest.param(*case, "*100/1" if case[0] == "iltis" else "*100/4", marks=pytest.mark.heavy) for case in RANDOM)],
)
def test_derivatives_at_random_states_and_parameters(
    name: str, scene: str | None, integrator: str | None, tunable: tuple[str, ...], states: str, tmp_path: Path
) -> None:
    """Of accelerations, outputs and steps, by states, inputs and parameters."""
    model = read_model_text(text_of(name), f"{name}.yaml", tunable=tunable)
    place = write(folder_of_model(model, scene, integrator, linearise=True), tmp_path)
    errors = [float(x) for x in run(in_quads(place, name, "derivatives", ""), "1e-9", states).split()]
    assert len(errors) == ERRORS
    assert max(errors) < 1e-9


@pytest.mark.parametrize("closed", with_heavy([False, True], True))
def test_derivatives_of_all_that_laws_see(closed: bool, tmp_path: Path) -> None:
    """Signals, states, samples, a function and friction by loads, in a tree and in a loop; of a step too."""
    folder = folder_of_model(seeing("recursive", closed=closed), linearise=True)
    compare(write(folder, tmp_path), "seeing", [(50,)], SOFT_IN_QUADS, 1e-13)  # bristles are steep over 1e-7 m/s


#: Matrices and vectors that are compared.
ERRORS = 12


def compare(place: Path, name: str, states: list[tuple[int, ...]], functions: str = "", difference: float = 1e-9) -> None:
    """Matrices and vectors of a folder beside differences in 113 bits."""
    program = in_quads(place, name, "derivatives", functions)
    for state in states:
        errors = [float(x) for x in run(program, str(difference), *map(str, state)).split()]
        assert len(errors) == ERRORS
        assert max(errors) < 1e-10  # rounding, times the conditions of penalties and of what dependent coordinates follow from


SANITIZE = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")


@pytest.mark.parametrize(
    ("compiler", "flags"),
    [("g++", ()), pytest.param("g++", SANITIZE, marks=pytest.mark.heavy), pytest.param("clang++", ("-O3",), marks=pytest.mark.heavy)],
    ids=["plain", "sanitized", "clang"],
)
def test_calls_right_and_wrong(compiler: str, flags: tuple[str, ...], tmp_path: Path) -> None:
    place = write(folder_of(text_of("press"), "press.yaml", adjoint=True), tmp_path)
    compile_object(place, "press", compiler=compiler, flags=flags)
    linked = flags if flags == SANITIZE else ()
    assert run(link(place, "calls", ["-I.", HERE / "derivative_calls.c", "press.o"], flags=linked)) == ""


@pytest.mark.parametrize("compiler", ["g++", "clang++"])
@pytest.mark.parametrize(("name", "method"), [("flyball", "recursive"), ("spinning", "recursive"), ("press", "recursive-newton")])
def test_the_code_calls_mathematics_and_nothing_else(name: str, method: str, compiler: str, tmp_path: Path) -> None:
    place = write(folder_of(text_of(name), f"{name}.yaml", method=method, linearise=True, adjoint=method == "recursive"), tmp_path)
    assert not foreign_symbols(compile_object(place, name, compiler=compiler, flags=("-O1",)), name)


def loaded(text: str, name: str, scene: str | None = None, method: str = "recursive") -> cutjoint.Simulation:
    model = read_model_text(text, f"{name}.yaml")
    return load_scene(model, find_scene(model, scene), method=method, linearise=True)


@cache
def cart_pole(method: str) -> cutjoint.Simulation:
    return cutjoint.load(CART_POLE, method=method, linearise=True)


@pytest.mark.parametrize("method", RELATIVE)
def test_a_cart_with_a_pole(method: str) -> None:
    sim = cart_pole(method).reset(coordinates={"pin.angle": 0.0})
    near = sim.linearise()
    M, m, h, inertia, g = 1.0, 0.2, 0.5, 0.2 * 0.5**2 / 3, 9.81  # the pole is a rod of length 2 h
    mass = np.array([[M + m, m * h], [m * h, inertia + m * h**2]])
    K = np.array([[0.0, 0.0], [0.0, -m * g * h]])
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(mass, K), np.zeros((2, 2))]])
    assert near.states == ("rail.displacement", "pin.angle", "rail.displacement_rate", "pin.angle_rate")
    A_found, B_found = near.A, near.B
    assert A_found == pytest.approx(A, rel=1e-13, abs=1e-13)
    assert B_found == pytest.approx(np.concatenate([[0, 0], np.linalg.solve(mass, [1.0, 0.0])])[:, None], rel=1e-13)
    assert near.C.tolist() == [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]]
    assert near.D.tolist() == [[0], [0], [0]]
    assert (near.inputs, near.outputs) == (("push",), ("cart.x", "pin.angle", "pin.angle_rate"))
    sim.set_state(0.0, np.array([0.1, 0.02]), np.array([0.3, -0.1]))
    assert (sim.states.array - near.x).tolist() == [0.1, 0.02, 0.3, -0.1]


def test_a_pendulum_that_swings() -> None:
    sim = cutjoint.load(MODELS / "pendulum.yaml", linearise=True).reset()
    sim.advance(0.7)
    near = sim.linearise()
    angle, rate = near.x
    known = [[0, 1], [-9.81 * np.sin(angle), 0]]  # from the rod along -x
    assert near.A.tolist() == pytest.approx(np.array(known), rel=1e-12, abs=1e-12)
    rows = dict(zip(near.outputs, near.C, strict=True))
    assert rows["bob.y"] == pytest.approx([-np.cos(angle), 0.0], rel=1e-12, abs=1e-12)
    assert rows["bob.vy"] == pytest.approx([np.sin(angle) * rate, -np.cos(angle)], rel=1e-12, abs=1e-12)


#: Functions of laws, with smooth formulas at x = 0.3, x' = -0.8, input 0.4.
LAWS = [
    "tan(x) - 2*sinh(x*v)", "asin(x)*acos(v)", "atan2(v, x) + atan(3*x)", "cosh(v)/tanh(x) + exp(x*v)", "log(2 + x)*sqrt(1 + v**2)",
    "abs(v)*v + abs(x)**1.7", "where(v < 0, x**3, cos(x))", "min(x, v, 1)*max(sin(3*x), v)", "sign(v)*x**2 + (2 + x)**1.3",
]  # fmt: skip


def _where(condition: sympy.Basic, yes: sympy.Expr, no: sympy.Expr) -> sympy.Expr:
    return sympy.Piecewise((yes, condition), (no, True))


@pytest.mark.parametrize("law", [*LAWS, pytest.param(" + ".join(f"({law})" for law in LAWS), id="all")])
def test_laws_have_the_derivatives_of_sympy(law: str) -> None:
    text = re.sub(r"\bv\b", "rate", re.sub(r"\bx\b", "position", law))
    start = {"coordinates": {"slide.displacement": 0.3}, "speeds": {"slide.displacement_rate": -0.8}}
    sim = loaded(pushed_text(f"10*({text})*(1 + push)"), "pushed").reset(**start)
    sim.inputs["push"] = 0.4
    near = sim.linearise()
    x, v, push = symbols = sympy.symbols("x v push", real=True)
    names = {"x": x, "v": v, "abs": sympy.Abs, "min": sympy.Min, "max": sympy.Max, "where": _where}
    acceleration = 5 * sympy.sympify(law, locals=names) * (1 + push)
    known = [float(sympy.diff(acceleration, s).doit().subs({x: 0.3, v: -0.8, push: 0.4})) for s in symbols]
    assert [*near.A[1], *near.B[1]] == pytest.approx(known, rel=1e-12, abs=1e-12)
    assert near.C[2] == pytest.approx(near.A[1], rel=1e-14)
    assert near.D[2] == pytest.approx(near.B[1], rel=1e-14)


def test_where_functions_are_infinitely_steep_what_stays_has_no_derivative() -> None:
    near = loaded(pushed_text("-3*position + 5*sqrt(position**2 + 4*rate**2)"), "pushed").reset().linearise()
    assert near.A.tolist() == [[0, 1], [-1.5, 0]]


def test_a_wheel_on_a_road() -> None:
    sim = loaded(WHEEL, "wheel").reset()
    sim.advance(0.25)
    near = sim.linearise()
    height = dict(zip(near.outputs, near.D[:, 0], strict=True))
    assert near.states == ("lift.displacement", "lift.displacement_rate")
    upward = STIFFNESS / MASS / (1 + RAMP**2)  # the tyre is pressed along the normal of the ramp
    assert near.B[1, 0] == pytest.approx(upward * RAMP, rel=1e-12)
    assert near.A[1, 0] == pytest.approx(-upward, rel=1e-12)
    assert height["tyre.Fz"] == pytest.approx(STIFFNESS * RAMP / np.sqrt(1 + RAMP**2), rel=1e-12)


@pytest.mark.parametrize("method", RELATIVE)
def test_at_rest_eigenvalues_are_those_of_the_modes(method: str) -> None:
    path = MODELS / "press.yaml"
    sim = cutjoint.load(path, method=method, linearise=True).reset(equilibrium=True, speeds={"pin.angle_rate": 0.0})
    known = [mode.eigenvalue for mode in cutjoint.find_modes(path).modes]
    pairs = [x for root in known for x in ([root, root.conjugate()] if root.imag else [root])]
    for speed in sim.speeds:
        sim.choose_independent([speed])
        assert np.sort_complex(np.linalg.eigvals(sim.linearise().A)) == pytest.approx(np.sort_complex(np.array(pairs)), rel=1e-8)


NO_DERIVATIVES = "the state of method 'augmented' has natural coordinates, which have no derivatives; use recursive or recursive-newton"


def test_natural_coordinates_are_not_linearised() -> None:
    with pytest.raises(cutjoint.RunError, match=NO_DERIVATIVES):
        cutjoint.load(CART_POLE, method="augmented", linearise=True)


@pytest.mark.heavy
def test_methods_have_the_same_derivatives() -> None:
    text = text_of("spinning").replace("outputs: [", "reactions: {hold: {joint: far, axes_of: ground}}\noutputs: [hold.Fx, hold.Fz, ")
    first, second = (loaded(text, "spinning", method=method).reset() for method in RELATIVE)
    for sim in (first, second):
        sim.choose_independent()
    first.advance(0.1)
    second.set_state(first.time, first.coordinates.array, first.speeds.array)
    a, b = first.linearise(), second.linearise()
    assert a.states == b.states
    for x, y in ((a.A, b.A), (a.B, b.B), (a.C, b.C), (a.D, b.D)):
        assert x == pytest.approx(y, rel=1e-8, abs=1e-8 * np.abs(y).max())


def test_hosts_choose_states() -> None:
    sim = cutjoint.load(MODELS / "press.yaml", linearise=True).reset()
    assert list(sim.states) == list(sim.linearise().states)
    sim.choose_independent(["pin.angle_rate"])
    assert dict(sim.states) == pytest.approx({"pin.angle": sim.coordinates["pin.angle"], "pin.angle_rate": 10.0}, rel=1e-12)
    copy = sim.copy()
    assert copy.linearise().A.tolist() == sim.linearise().A.tolist()
    with pytest.raises(KeyError, match=r"did you mean 'pin\.angle_rate'"):
        sim.choose_independent(["pin.angle"])
    with pytest.raises(KeyError, match=r"no 'slider\.x'; .*tunable=\['slider\.x'\]"):
        sim.forward_sensitivities(1, [], ["slider.x"])
    with pytest.raises(ValueError, match=r"as degrees of freedom, 1, not pin\.angle_rate, wrist\.angle_rate"):
        sim.choose_independent(["pin.angle_rate", "wrist.angle_rate"])


def test_a_start_keeps_what_was_chosen_by_name_until_another_choice() -> None:
    sim = cutjoint.load(MODELS / "press.yaml", linearise=True).reset()
    usual = list(sim.states)
    other = next(name for name in sim.speeds if name not in usual)
    sim.choose_independent([other])
    assert list(sim.states)[1] == other
    assert list(sim.reset().states)[1] == other
    sim.choose_independent()
    assert list(sim.reset().states) == usual


def test_a_ball_that_has_turned_far_is_ill_conditioned() -> None:
    """Half a turn about one axis; at 2 tan(angle/2) = 1 another choice is better."""
    text = """
cutjoint: 1
name: top
gravity: [0, 0, 0]
bodies: {top: {mass: 1, centre_of_mass: [0, 0, 0], inertia: [1, 1, 1]}}
joints: {ball: {kind: spherical, bodies: [ground, top], at: [0, 0, 0]}}
scenes: {turn: {end: 1, rates: {ball.wx: 1}}}
"""
    sim = loaded(text, "top").reset(dt=1e-3)
    assert next(iter(sim.states)) == "ball.turn_x"
    for angle, poor in ((0.9, False), (1.0, True)):
        sim.advance(angle)
        assert sim.states["ball.turn_x"] == pytest.approx(2 * np.tan(angle / 2), rel=1e-6)
        assert sim.is_ill_conditioned is poor
    sim.choose_independent()
    assert not sim.is_ill_conditioned


STILL = """
cutjoint: 1
name: still
gravity: [0, 0, 0]
bodies: {block: {mass: 1, centre_of_mass: [0.5, 0, 0], inertia: [1, 1, 1]}}
joints: {weld: {kind: fixed, bodies: [ground, block], at: [0, 0, 0]}}
outputs: [block.x]
scenes: {rest: {end: 0.01}}
"""


@pytest.mark.parametrize("method", METHODS)
def test_what_does_not_move_stands_still(method: str) -> None:
    model = read_model_text(STILL, "still.yaml")
    run = cutjoint.simulate(compile_scene(model, find_scene(model, None), CompileOptions(method=method)), error=False)
    assert set(run["block.x"]) == {0.5}


@pytest.mark.parametrize("method", [m for m in METHODS if METHODS[m].has_system])
def test_nothing_to_solve_for_is_reported(method: str) -> None:
    model = read_model_text(STILL, "still.yaml")
    with pytest.raises(RunError, match=f"nothing in the model moves, so that '{method}' has no equation; use recursive"):
        load_scene(model, find_scene(model, None), method=method)


def test_what_cannot_be_linearised_is_reported() -> None:
    with pytest.raises(cutjoint.SimulationError, match=r"not been started; call reset"):
        cutjoint.load(CART_POLE, linearise=True).linearise()
    plain = cutjoint.load(CART_POLE).reset()
    for call in (plain.linearise, plain.choose, lambda: plain.states):
        with pytest.raises(TypeError, match="load the model with linearise=True"):
            call()
    spinning = loaded(text_of("spinning"), "spinning").reset()
    with pytest.raises(cutjoint.SimulationError, match="the pose is singular"):  # the turn of the rod about itself follows from nothing
        spinning.choose_independent(["pin.angle_rate", "pivot.wx", "pivot.wy", "pivot.wz"])


def test_the_command_adds_derivatives(tmp_path: Path) -> None:
    result = CliRunner().invoke(main, ["compile", str(MODELS / "press.yaml"), "--linearise", "--out", str(tmp_path / "press")])
    assert result.exit_code == 0, result.output
    assert "int press_linearise(press_sim* sim" in (tmp_path / "press" / "press.h").read_text(encoding="utf-8")
    refused = CliRunner().invoke(
        main, ["compile", str(MODELS / "press.yaml"), "--method", "augmented", "--linearise", "--out", str(tmp_path / "other")]
    )
    assert refused.exit_code != 0
    assert NO_DERIVATIVES in " ".join(refused.output.split())
