"""Random vibration of a linear model on a rough road: spectral densities of outputs and root mean squares, also weighted by ISO 2631-1."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from cutjoint.run.road_field import BAND, ROUGHNESS
from cutjoint.stepping.state_space import ComplexArray, StateSpace, need
from cutjoint.stepping.values import Array

#: Corner frequencies (Hz) and qualities of ISO 2631-1's weightings: f3 = f4, Q4, and the upward step's f5, Q5, f6, Q6; what they weight.
WEIGHTINGS: Mapping[str, tuple[float, ...]] = {"Wk": (12.5, 0.63, 2.37, 0.91, 3.35, 0.91), "Wd": (2.0, 0.63), "Wc": (8.0, 0.63)}

#: Reference spatial frequency of the classes of ISO 8608, cycles per metre.
_REFERENCE = 0.1
#: Panels of the quadrature over frequencies, and points of each.
_PANELS, _POINTS = 240, 8


def weighting(name: str, frequencies: Array) -> Array:
    """Gains of a frequency weighting of ISO 2631-1: "Wk" for vertical, "Wd" for horizontal vibration of the seat, "Wc" for its back.
    Raises ValueError: there is no such weighting."""
    if name not in WEIGHTINGS:
        raise ValueError(f"no weighting '{name}'; there is {', '.join(WEIGHTINGS)}")
    s, (corner, quality, *step) = 2j * np.pi * np.asarray(frequencies), WEIGHTINGS[name]

    def second(f: float, q: float) -> ComplexArray:
        w = 2 * np.pi * f
        return np.asarray(1 + s / (q * w) + (s / w) ** 2)

    root, w = np.sqrt(0.5), 2 * np.pi * corner
    gain = (s / (2 * np.pi * 0.4)) ** 2 / second(0.4, root) / second(100.0, root) * (1 + s / w) / second(corner, quality)
    if step:
        gain = gain * second(step[0], step[1]) / second(step[2], step[3]) * (step[0] / step[2]) ** 2
    return np.abs(gain)


@dataclass(frozen=True, kw_only=True)
class RandomVibration:
    """Random vibration of outputs on a rough road; SI units.

    Attributes:
        frequencies: (points,) Hz.
        densities: (points, outputs) one-sided power spectral densities, unit^2/Hz.
        rms: (outputs,) root mean squares over the road's band, without the mean.
        weighted: (outputs,) root mean squares weighted by ISO 2631-1; NaN for outputs that are no accelerations.
        white: (outputs,) root mean squares on a road of unlimited bandwidth, by Lyapunov's equation; NaN without a solution.
        variation: (outputs,) rms/mean, as of wheel loads; NaN where the mean is zero.
        outputs: names.
        units: by the names of outputs.
    """

    frequencies: Array
    densities: Array
    rms: Array
    weighted: Array
    white: Array
    variation: Array
    outputs: tuple[str, ...]
    units: Mapping[str, str]

    def __repr__(self) -> str:
        return f"<RandomVibration: {', '.join(f'{name} {x:.4g}' for name, x in zip(self.outputs, self.rms, strict=True))}>"


def random_vibration(
    model: StateSpace, *, road: str | float, speed: float, places: Mapping[str, tuple[float, float]] = MappingProxyType({}),
    weight: str = "Wk", points: int = 400,
) -> RandomVibration:  # fmt: skip
    """Random vibration of a model whose inputs are heights of a road, at a speed (m/s).

    The road is of a class of ISO 8608 or has a roughness (m^3).  Wheels of a track meet the same road, delayed by
    their distance: ``places`` (x, y in m, by inputs; default: the model's).  Tracks at a distance d have an isotropic
    surface's coherence: x K1(x), x = 2 pi n d, n in 1/m.

    Raises:
        ValueError: there is no such class, the speed is not above zero, or an input is no height.
        MissingPackageError: SciPy is not installed.
    """
    if isinstance(road, str) and road not in ROUGHNESS:
        raise ValueError(f"no class of roads '{road}'; there is {', '.join(ROUGHNESS)}")
    if not speed > 0.0:
        raise ValueError(f"a speed of {speed:g} m/s: a road excites a vehicle at speeds above zero only")
    roughness, model = ROUGHNESS[road] if isinstance(road, str) else float(road), _of_heights(model, speed)
    where = np.array([{**model.places, **places}.get(name, (0.0, 0.0)) for name in model.inputs]).reshape(-1, 2)

    def densities(f: Array) -> Array:
        n = f / speed
        across = 2 * np.pi * n[:, None, None] * np.abs(where[:, 1, None] - where[None, :, 1])
        safe = np.where(across > 0.0, across, 1.0)
        coherence = np.where(across > 0.0, safe * need("scipy.special").k1(safe), 1.0)
        lag = np.exp(2j * np.pi * n[:, None, None] * (where[:, 0, None] - where[None, :, 0]))
        heights = roughness * (n / _REFERENCE) ** -2 / speed
        G = model.evaluate(np.asarray(2j * np.pi * f, dtype=np.complex128))
        found = np.einsum("foi,fij,foj->fo", G, coherence * lag, G.conj(), optimize=True).real
        return np.asarray(np.maximum(found, 0.0) * heights[:, None])

    first, last = BAND[0] * speed, BAND[1] * speed
    nodes, shares = _nodes(first, last, model.poles)
    found = densities(nodes)
    rms = np.sqrt(shares @ found)
    is_acceleration = np.array([model.units.get(name) == "m/s^2" for name in model.outputs])
    weighted = np.where(is_acceleration, np.sqrt((shares * weighting(weight, nodes) ** 2) @ found), np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        variation = np.where(np.abs(model.y) > 1e-9 * rms, rms / np.abs(model.y), np.nan)
    frequencies = np.geomspace(first, last, points)
    return RandomVibration(
        frequencies=frequencies, densities=densities(frequencies), rms=rms, weighted=weighted, variation=variation, outputs=model.outputs,
        white=_white(model, 2 * np.pi**2 * roughness * _REFERENCE**2 * speed, where, speed), units=model.units,
    )  # fmt: skip


def _of_heights(model: StateSpace, speed: float) -> StateSpace:
    """The model with road heights as its only inputs: slopes of terrain are the rates of heights divided by the speed."""
    names, slopes = list(model.inputs), dict[int, int]()
    for j, name in enumerate(names):
        height = name.removesuffix("slope") + "height"
        if name.endswith(".terrain_slope") and height in names:
            slopes[j] = names.index(height)
        elif model.units.get(name, "m") not in ("", "m") or name.endswith((".terrain_slope", ".friction", ".terrain_bank")):
            raise ValueError(f"input '{name}' is no height of a road: name the inputs that are")
    arrays = {key: getattr(model, key).copy() for key in ("B", "B_rate", "B_acceleration", "D", "D_rate", "D_acceleration")}
    for j, place in slopes.items():
        for key in "BD":
            arrays[f"{key}_rate"][:, place] += arrays[key][:, j] / speed
    kept = [j for j in range(len(names)) if j not in slopes]
    return replace(model, inputs=tuple(names[j] for j in kept), **{key: array[:, kept] for key, array in arrays.items()})


def _nodes(first: float, last: float, poles: ComplexArray) -> tuple[Array, Array]:
    """Nodes and weights of a quadrature over frequencies (Hz), with narrower panels near resonances."""
    centres, widths = np.abs(poles.imag) / (2 * np.pi), np.maximum(np.abs(poles.real), 1e-9 * np.abs(poles)) / (2 * np.pi)
    steps = np.concatenate([[0.0], *(sign * 2.0 ** np.arange(16) for sign in (1, -1))])
    edges = np.concatenate([np.geomspace(first, last, _PANELS), (centres[:, None] + widths[:, None] * steps).ravel()])
    edges = np.unique(edges[(edges >= first) & (edges <= last)])
    x, w = np.polynomial.legendre.leggauss(_POINTS)
    half, middle = np.diff(edges)[:, None] / 2, (edges[1:] + edges[:-1])[:, None] / 2
    return (middle + half * x).ravel(), (half * w).ravel()


def _white(model: StateSpace, intensity: float, where: Array, speed: float) -> Array:
    """RMS of outputs if the rate of the road's height is white noise along one track, by Lyapunov's equation; NaN without a solution."""
    none = np.full(len(model.outputs), np.nan)
    if not len(where) or np.ptp(where[:, 1]) > 0.0:
        return none
    try:
        A, B, C, D = model.realise("rate")
    except ValueError:
        return none
    ahead = np.unique(where[:, 0])[::-1]
    B, D = (np.column_stack([of[:, where[:, 0] == x].sum(axis=1) for x in ahead]) for of in (B, D))
    linalg, size = need("scipy.linalg"), np.abs(model.poles).max(initial=1.0)
    T, Q, stable = linalg.schur(A, output="complex", sort=lambda z: z.real < -1e-9 * size)
    B, C = Q.conj().T @ B, C @ Q
    left, right = T[:stable, :stable], T[stable:, stable:]
    Y = linalg.solve_sylvester(left, -right, -T[:stable, stable:]) if 0 < stable < len(T) else np.zeros((stable, len(T) - stable))
    B_stable, B_rest, C_rest = B[:stable] - Y @ B[stable:], B[stable:], C[:, stable:] + C[:, :stable] @ Y
    rest = np.abs(np.hstack([C_rest @ np.linalg.matrix_power(right / size, k) @ B_rest for k in range(3)])).max(axis=1, initial=0.0)
    sizes = [np.abs(c) @ np.abs(b).max(axis=1, initial=0.0) for c, b in ((C[:, :stable], B_stable), (C_rest, B_rest))]
    grows = rest > 1e-8 * np.maximum(*sizes)
    held, total = np.zeros(stable, dtype=complex), np.zeros((stable, stable), dtype=complex)
    for i, column in enumerate(B_stable.T):
        held = held + column
        part = linalg.solve_continuous_lyapunov(left, -np.outer(held, held.conj())) if stable else total
        total = total + part
        if i + 1 < len(ahead):
            flow = linalg.expm(left * (ahead[i] - ahead[i + 1]) / speed)
            total, held = total - flow @ part @ flow.conj().T, flow @ held
    variances = intensity * np.einsum("oi,ij,oj->o", C[:, :stable], total, C[:, :stable].conj()).real
    return np.where(grows | D.any(axis=1), np.nan, np.sqrt(np.maximum(variances, 0.0)))
