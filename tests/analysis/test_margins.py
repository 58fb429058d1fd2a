"""Peaks, bandwidths and margins of linear models beside python-control and closed forms, over ranges that nobody names."""

from __future__ import annotations

import control
import numpy as np
import pytest

from cutjoint.stepping.state_space import SampledStateSpace, Sampler, StateSpace

_S = control.tf("s")
#: A motor whose gain is 1 far above its pole, integrators that cross 1 far below their poles, a washout, masses, and two lags.
_LOOPS = [
    1000 / (_S + 1), 1 / (0.32 * _S), 5e-4 / (_S * (_S + 3) * (_S + 50)), 1e6 / ((_S + 3) * (_S + 50) * (_S + 9)), 1e3 * _S / (_S + 1),
    1 / _S**2, 1e-3 * (_S + 1) / _S**2, 0.5 / (_S + 1), (1e4 * _S + 1e6) / (_S + 1)**2,
    0.01 * (_S + 0.01) / (_S * (_S + 1)), 300 / ((_S + 1) * (_S**2 + 2 * _S + 400)),
]  # fmt: skip


def _state_space(A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray) -> StateSpace:
    inputs, outputs = (tuple(f"{letter}{i}" for i in range(n)) for letter, n in (("u", B.shape[1]), ("y", C.shape[0])))
    return StateSpace(
        A=A, B=B, B_rate=0 * B, B_acceleration=0 * B, C=C, D=D, D_rate=0 * D, D_acceleration=0 * D, x=np.zeros(len(A)),
        states=tuple(f"x{i}" for i in range(len(A))), inputs=inputs, outputs=outputs, y=np.zeros(len(C)),
    )  # fmt: skip


def _model(loop: control.TransferFunction) -> StateSpace:
    system = control.ss(loop)
    return _state_space(system.A, system.B, system.C, system.D)


@pytest.mark.parametrize("loop", _LOOPS)
def test_margins_are_found_at_any_frequency(loop: control.TransferFunction) -> None:
    found = _model(loop).margins("y0", "u0")
    gain, phase, _, gain_at, phase_at, _ = control.stability_margins(loop)
    assert found.gain == pytest.approx(gain, rel=1e-6)
    assert found.phase == pytest.approx(phase, rel=1e-6, abs=1e-6)
    assert 2 * np.pi * np.array([found.gain_at, found.phase_at]) == pytest.approx(np.array([gain_at, phase_at]), rel=1e-6, nan_ok=True)


def test_named_ranges_limit_margins() -> None:
    found = _model(_LOOPS[0]).margins("y0", "u0", np.geomspace(1.0, 10.0, 50))
    assert found.phase == np.inf


def test_a_lag_has_its_peak_and_the_reference_of_its_bandwidth_at_0() -> None:
    model = _model(7 / (_S + 3))
    assert model.peak("y0", "u0") == (pytest.approx(7 / 3, rel=1e-12), 0.0)
    assert model.bandwidth("y0", "u0") == pytest.approx(3 / (2 * np.pi), rel=1e-9)


def test_a_sampled_loop_has_its_peak_at_0() -> None:
    """x' = -x + held, held = 0.5*(u - x) at each sample: 1/3 at rest."""
    plant = _state_space(np.array([[-1.0]]), np.array([[0.0, 1.0]]), np.array([[1.0], [-0.5]]), np.array([[0.0, 0.0], [0.5, 0.0]]))
    loop = SampledStateSpace(plant=plant, samplers=(Sampler(every=0.01, offset=0.0, number=1),), held=np.zeros(1))
    assert loop.peak("y0", "u0") == (pytest.approx(1 / 3, rel=1e-9), 0.0)


@pytest.mark.parametrize(("damping", "peak"), [(0.0, np.inf), (1e-6, 1 / (1e-6 * 150**0.5)), (0.3, 1 / (0.3 * (150 - 0.3**2 / 4) ** 0.5))])
def test_the_gain_at_a_resonance_is_infinite_only_without_damping(damping: float, peak: float) -> None:
    """Of 1/(s^2 + d s + 150), where d is small or 0; another mode does not change it, nor one that the input does not move."""
    model = _model(1 / (_S**2 + damping * _S + 150))
    found = model.peak("y0", "u0")
    assert found == (pytest.approx(peak, rel=1e-9), pytest.approx((150 - damping**2 / 2) ** 0.5 / (2 * np.pi), rel=1e-7))
    apart = _state_space(np.array([[0.0, 1.0], [-150.0, 0.0]]), np.array([[0.0], [0.0]]), np.array([[1.0, 0.0]]), np.array([[2.0]]))
    assert apart.peak("y0", "u0").gain == pytest.approx(2.0, rel=1e-12)


def test_crossings_on_a_node_are_found() -> None:
    """Of three equal poles with a gain margin of 0.4 at 1 Hz, and of 2 pi/s, whose gain is 1 at 1 Hz."""
    nodes = np.geomspace(0.1, 10.0, 401)
    a = 2 * np.pi / 3**0.5
    found = _model(20 * a**3 / (_S + a) ** 3).margins("y0", "u0", nodes)
    assert (found.gain, found.gain_at) == (pytest.approx(0.4, rel=1e-9), pytest.approx(1.0, rel=1e-9))
    found = _model(2 * np.pi / _S).margins("y0", "u0", nodes)
    assert (found.phase, found.phase_at) == (pytest.approx(90.0, rel=1e-9), pytest.approx(1.0, rel=1e-9))


def test_a_sampled_cart_has_its_peak_near_0() -> None:
    """x'' = u + c, c = -4 x - 4 v sampled at 20 ms: the plant alone has no gain at 0, the loop 1/4."""
    A, B, C = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0, 0.0], [1.0, 1.0]]), np.array([[1.0, 0.0], [-4.0, -4.0]])
    plant = _state_space(A, B, C, np.zeros((2, 2)))
    loop = SampledStateSpace(plant=plant, samplers=(Sampler(every=0.02, offset=0.0, number=1),), held=np.zeros(1))
    peak = loop.peak("y0", "u0")
    assert peak.gain == pytest.approx(0.25, rel=1e-4)
    assert peak.at < 2e-3
    assert loop.bandwidth("y0", "u0") == pytest.approx(0.2064, rel=1e-2)


def test_double_zeros_stay() -> None:
    found = _model((_S + 1) ** 2 / ((_S + 2) * (_S + 3) * (_S + 5) * (_S + 7))).zeros("y0", "u0")
    assert found == pytest.approx(-np.ones(2), abs=1e-7)


def test_a_coordinate_that_only_rounding_couples_spoils_no_other_number() -> None:
    """A mass of stiffness 1e6 1/s^2 pulls another one, whose place acts on nothing but for 2e-12: its column must not be scaled up."""
    A = np.array([[0, 1, 0, 0], [-1e6, -50, 2e-12, 0], [0, 0, 0, 1], [1e-3, 0, 1e-16, -5]], dtype=float)
    model = _state_space(A, np.eye(4)[:, 1:2], np.eye(4)[2:3], np.zeros((1, 1)))
    s = 2j * np.pi * np.array([0.01, 0.1, 1.0, 10.0, 1000.0])
    expected = 1e-3 / (s**2 + 50 * s + 1e6) / (s**2 + 5 * s)
    assert np.abs(model.evaluate(s)[:, 0, 0] / expected - 1).max() < 1e-12


def test_a_frequency_response_at_an_undamped_pole_is_infinite_there_alone() -> None:
    model = _model(1 / (_S**2 + 4))
    values = model.evaluate(np.array([1j, 2j, 3j]))[:, 0, 0]
    assert values[[0, 2]] == pytest.approx([1 / 3, -1 / 5], rel=1e-12)
    assert np.isinf(values[1])


def test_zeros_of_a_small_gain_are_as_accurate_as_those_of_a_large_one() -> None:
    """Two masses on springs, 1e-9 of their difference observed: the sum of two resonances has the zeros of its numerator."""
    A = np.array([[0, 1, 0, 0], [-1e4, -4, 0, 0], [0, 0, 0, 1], [0, 0, -3e4, -9]], dtype=float)
    for size in (1.0, 1e-9):
        model = _state_space(A, np.array([[0], [3e4], [0], [1e4]]), size * np.array([[1.0, 0, 2.0, 0]]), np.zeros((1, 1)))
        zeros = np.roots(3e4 * np.array([1, 9, 3e4]) + 2e4 * np.array([1, 4, 1e4]))
        assert np.sort_complex(model.zeros("y0", "u0")) == pytest.approx(np.sort_complex(zeros), rel=1e-9)


def test_many_frequencies_of_a_large_model_are_those_of_few() -> None:
    random = np.random.default_rng(1)
    A = random.standard_normal((30, 30)) - 9 * np.eye(30)
    model = _state_space(A, random.standard_normal((30, 2)), random.standard_normal((3, 30)), np.zeros((3, 2)))
    s = 1j * np.linspace(0.1, 50, 1501)
    assert np.array_equal(model.evaluate(s)[::300], np.concatenate([model.evaluate(s[i : i + 1]) for i in range(0, 1501, 300)]))
