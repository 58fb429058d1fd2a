"""Linear models: state spaces and sampled loops, their frequency responses, poles, zeros and margins."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from math import gcd, lcm
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from cutjoint.package.extensions import MissingPackageError, find_package
from cutjoint.stepping.values import Array, find_place

ComplexArray: TypeAlias = NDArray[np.complex128]

#: The meaning of a system's inputs: values, or rates or accelerations that are integrated first.
ORDERS = ("value", "rate", "acceleration")
#: Relative sizes: of matrix entries that are rounding, and of poles that count as zero.
_ROUNDING, _NOUGHT = 1e-10, 1e-7
#: A gain so many times that at frequencies beside it, which are off by this share, is that of a pole without damping.
_UNDAMPED, _BESIDE = 1e3, 1e-6
#: The largest number of samples in the common period of a loop's controllers.
_MOST_SAMPLES = 10_000


def need(module: str) -> Any:
    """A module of SciPy, or python-control. Raises MissingPackageError: it is not installed."""
    words = f"this needs {module.partition('.')[0]}: pip install 'cutjoint[control]'"
    return find_package(module, otherwise=MissingPackageError(words))


class Margins(NamedTuple):
    """Margins of a loop with negative unity feedback: gain factor and phase lag (deg), infinity without one, and their frequencies (Hz)."""

    gain: float
    gain_at: float
    phase: float
    phase_at: float


class Peak(NamedTuple):
    """The largest gain and its frequency (Hz)."""

    gain: float
    at: float


@dataclass(frozen=True, kw_only=True)
class FrequencyResponse:
    """Frequency response of a linear model; SI units.

    Attributes:
        frequencies: (points,) Hz.
        values: (points, outputs, inputs) complex.
        inputs, outputs: names.
        units: by the names of inputs and outputs.
    """

    frequencies: Array
    values: ComplexArray
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    units: Mapping[str, str]

    @property
    def magnitude(self) -> Array:
        """Gains (points, outputs, inputs)."""
        return np.abs(self.values)

    @property
    def phase(self) -> Array:
        """Phases (points, outputs, inputs) in deg, without jumps over the frequency."""
        return np.degrees(np.unwrap(np.angle(self.values), axis=0))

    def __repr__(self) -> str:
        return f"<FrequencyResponse: {len(self.frequencies)} frequencies, {len(self.outputs)} outputs by {', '.join(self.inputs)}>"


class LinearModel:
    """A linear model with a frequency response; `StateSpace` and `SampledStateSpace` are two."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    units: Mapping[str, str]
    poles: ComplexArray

    evaluate: Callable[[ComplexArray], ComplexArray]
    realise: Callable[..., tuple[Array, Array, Array, Array]]
    _alone: Callable[[str, str], tuple[int, tuple[Array, Array, Array, Array]]]
    _dt: float | None = None

    @property
    def rates(self) -> ComplexArray:
        """The poles in continuous time, 1/s; of sampled models log(pole)/period."""
        return self.poles

    @property
    def is_stable(self) -> bool:
        """Whether all poles decay."""
        return bool(np.all(self.rates.real < 0.0))

    @property
    def _highest(self) -> float:
        """The upper end of the default range of frequencies, Hz."""
        return 10 * float(np.abs(self.rates).max(initial=0.2)) / (2 * np.pi)

    def frequencies(self, points: int = 400, from_: float | None = None, to: float | None = None) -> Array:
        """Frequencies (points,) in Hz at equal ratios, by default over a range that covers the poles.

        Raises:
            ValueError: the range is empty.
        """
        sizes = np.abs(self.rates[np.isfinite(self.rates)]) / (2 * np.pi)
        slowest = sizes[sizes > _NOUGHT * sizes.max(initial=0.0)].min(initial=self._highest)
        last = self._highest if to is None else to
        first = min(10 ** np.floor(np.log10(slowest / 3)), last / 10) if from_ is None else from_
        if not 0.0 < first < last:
            raise ValueError(f"the range from {first:g} to {last:g} Hz is empty")
        return np.geomspace(first, last, points)

    def frequency_response(self, frequencies: Sequence[float] | Array | None = None) -> FrequencyResponse:
        """Frequency response at ``frequencies`` (Hz), by default over a range that covers the poles.

        Raises:
            MissingPackageError: of a sampled loop: SciPy is not installed.
        """
        at = self.frequencies() if frequencies is None else np.asarray(frequencies, dtype=np.float64)
        values = self.evaluate(np.asarray(2j * np.pi * at, dtype=np.complex128))
        return FrequencyResponse(frequencies=at, values=values, inputs=self.inputs, outputs=self.outputs, units=self.units)

    def zeros(self, output: str, input: str) -> ComplexArray:
        """Zeros of the transfer function from an input to an output in 1/s; of a sampled loop those z of its discrete model."""
        order, (A, column, row, D) = self._alone(output, input)
        linalg, n = need("scipy.linalg"), len(A)
        _, (scale, _) = linalg.matrix_balance(A, permute=False, separate=True)
        A, row, column = A * scale / scale[:, None], row * scale, column / scale[:, None]
        out, into = (np.abs(of).max(initial=0.0) or 1.0 for of in (row, column))
        row, column, D = row / out, column / into, D / (out * into)
        found = linalg.eigvals(np.block([[A, column], [row, D]]), np.diag([1.0] * n + [0.0]))
        found, sizes = found[np.isfinite(found)], np.abs(np.linalg.eigvals(A))
        least = sizes[sizes > _NOUGHT * sizes.max(initial=0.0)].min(initial=1.0 if not sizes.any() else np.inf)

        def values(by: float) -> ComplexArray:
            return np.array([(z**order * (row @ np.linalg.solve(z * np.eye(n) - A, column) + D))[0, 0] for z in found + by * ways])

        # towards a zero gains fall, not so towards infinite ones and those that poles cancel; no round number, which could meet a pole
        ways = 1.1**0.5 * np.maximum(np.abs(found), least)
        for _ in range(5):  # Newton's iteration: eigenvalues are accurate to the norm of the pencil
            with np.errstate(divide="ignore", invalid="ignore"):
                steps = 1e-7 * ways - 1e-6 * ways * values(1e-7) / (values(1.1e-6) - values(1e-7))
            last, gains = found, np.abs(values(1e-12))
            found = np.where(np.abs(steps) < 1e-2 * ways, found + steps, found)
            found = np.where(np.abs(values(1e-12)) < 10 * gains, found, last)  # the secant is biased at double zeros
        kept = np.abs(values(1e-6)) < 1e-3 * np.abs(values(1e-2))
        return np.sort_complex(np.where(np.abs(found) < 1e-6 * least, 0.0, found)[kept].astype(np.complex128))

    def peak(self, output: str, input: str, frequencies: Array | None = None) -> Peak:
        """Largest gain from an input to an output, by default over a range from 0 that covers the poles.

        It is the H-infinity norm of a stable model whose gain falls towards infinite frequencies, and infinite at a pole without damping.
        """
        nodes = self._usual if frequencies is None else np.asarray(frequencies)
        own = np.concatenate([np.abs(self.rates), np.abs(self.rates.imag)]) / (2 * np.pi)
        grid = np.union1d(nodes, own[(own > nodes[0]) & (own < nodes[-1])])
        gain = self._gain(output, input)
        with np.errstate(divide="ignore", invalid="ignore"):
            gains = np.abs(gain(grid))
        gains = np.where(np.isfinite(gains), gains, np.abs(gain(grid * (1 + _BESIDE / 1e4))))  # at poles without damping
        best = int(gains.argmax())
        found = Peak(float(gains[best]), float(grid[best]))
        for i in np.argsort(-gains)[:3]:
            low, high = grid[max(i - 1, 0)], grid[min(i + 1, len(grid) - 1)]
            refined = need("scipy.optimize").minimize_scalar(lambda f: -abs(gain(np.array([f]))[0]), bounds=(low, high), method="bounded",
                options={"xatol": 1e-10 * high})
            found = Peak(-float(refined.fun), float(refined.x)) if -refined.fun > found.gain * (1 + 1e-12) else found
        beside = np.abs(gain(found.at * np.array([1 - _BESIDE, 1 + _BESIDE]))).max()
        return Peak(np.inf, found.at) if found.at > 0 and found.gain > _UNDAMPED * beside else found

    def bandwidth(self, output: str, input: str, frequencies: Array | None = None) -> float:
        """Lowest frequency (Hz) at which the gain is 3 dB below that at the first one, by default 0; infinity if it never is."""
        grid, gain = self._usual if frequencies is None else np.asarray(frequencies), self._gain(output, input)
        below = np.abs(gain(grid)) ** 2 * 2 - np.abs(gain(grid[:1])) ** 2
        if not (below < 0.0).any():
            return float("inf")
        i, first = int(np.argmax(below < 0.0)), abs(gain(grid[:1])[0])
        found = need("scipy.optimize").brentq(lambda f: abs(gain(np.array([f]))[0]) - first / 2**0.5, grid[i - 1], grid[i], rtol=1e-13)
        return float(found)

    def margins(self, output: str, input: str, frequencies: Array | None = None) -> Margins:
        """Gain and phase margin of the loop that feeds an output back to an input with the factor -1, by default at any frequency."""
        gain, margins = self._gain(output, input), Margins(np.inf, np.nan, np.inf, np.nan)
        grid = np.asarray(frequencies if frequencies is not None else self._towards_unity(gain, self.zeros(output, input)))
        values = gain(grid)
        values = np.where(np.abs(values.imag) > _ROUNDING * np.abs(values), values, values.real)

        def crossings(of: Callable[[ComplexArray], Array]) -> list[float]:
            signs = np.sign(of(values))
            at, solve = np.flatnonzero(signs), need("scipy.optimize").brentq  # a crossing can lie on a node
            return [float(solve(lambda f: float(of(gain(np.array([f])))[0]), grid[i], grid[k], xtol=1e-14 * grid[k], rtol=1e-14))
                    for i, k in pairwise(at) if signs[i] * signs[k] < 0]  # fmt: skip

        for f in crossings(lambda g: np.asarray(g.imag)):
            value = complex(gain(np.array([f]))[0])
            if value.real < 0.0 and abs(value.imag) < 1e-3 * abs(value) and abs(np.log(-value.real)) < abs(np.log(margins.gain)):
                margins = margins._replace(gain=-1 / value.real, gain_at=f)
        for f in crossings(lambda g: np.log(np.maximum(np.abs(g), 1e-300))):  # 0 without effect
            lag = (np.degrees(np.angle(complex(gain(np.array([f]))[0]))) + 360.0) % 360.0 - 180.0
            if abs(lag) < abs(margins.phase):
                margins = margins._replace(phase=float(lag), phase_at=f)
        return margins

    @property
    def _usual(self) -> Array:
        """The default range of frequencies (Hz), from 0 on if no pole is there, from nearly 0 on if only a sampled plant has one."""
        grid, (own, held) = self.frequencies(), (np.abs(of[np.isfinite(of)]) for of in (self.rates, getattr(self, "plant", self).poles))
        at_zero = [bool((sizes <= _NOUGHT * sizes.max(initial=0.0)).any()) for sizes in (own, held)]
        return np.append([] if at_zero[0] else [0.1 * grid[0] if at_zero[1] else 0.0], grid)

    def _towards_unity(self, gain: Callable[[Array], ComplexArray], zeros: ComplexArray) -> Array:
        """The default range of frequencies (Hz) with that of zeros, extended by asymptotes to a gain of 1."""
        grid, sizes = self.frequencies(), np.abs(zeros[(zeros != 0.0) & (self._dt is None)]) / (2 * np.pi)
        grid = np.union1d(grid, np.geomspace(sizes.min() / 10, 10 * sizes.max(), 200)) if len(sizes) else grid
        for end, inner, margin in ((0, 1, 0.5), *(((-1, -2, 2.0),) if self._dt is None else ())):
            for _ in range(8):  # zeros and small poles beyond an end change the slope there
                last, before = np.log(np.maximum(np.abs(gain(grid[[end, inner]])), 1e-300))
                slope = (last - before) / np.log(grid[end] / grid[inner])
                way = -last / slope if abs(slope) > 0.5 else 0.0
                if not way * (margin - 1.0) > 0.0:
                    break
                grid = np.union1d(grid, np.geomspace(grid[end], grid[end] * margin * np.exp(np.clip(way, -30.0, 30.0)), 60))
        return grid

    def to_scipy(self, by: str = "value") -> Any:
        """The model as ``scipy.signal.StateSpace``, by values, rates or accelerations of all inputs; sampled loops are discrete.

        Raises:
            ValueError: an output depends on input derivatives higher than ``by``.
            MissingPackageError: SciPy is not installed.
        """
        more = {} if self._dt is None else {"dt": self._dt}
        return need("scipy.signal").StateSpace(*self.realise(by), **more)

    def to_control(self, by: str = "value") -> Any:
        """The model as ``control.StateSpace``, as of `to_scipy`; dots in names become underscores.

        Raises:
            ValueError: as of `to_scipy`.
            MissingPackageError: python-control is not installed.
        """
        names = {key: [name.replace(".", "_") for name in of] for key, of in (("inputs", self.inputs), ("outputs", self.outputs))}
        return need("control").ss(*self.realise(by), 0 if self._dt is None else self._dt, **names)

    def _pair(self, output: str, input: str) -> tuple[int, int]:
        rows, columns = ({name: i for i, name in enumerate(names)} for names in (self.outputs, self.inputs))
        return find_place(rows, output), find_place(columns, input)

    def _gain(self, output: str, input: str) -> Callable[[Array], ComplexArray]:
        i, j = self._pair(output, input)
        return lambda f: self.evaluate(np.asarray(2j * np.pi * f, dtype=np.complex128))[:, i, j]


@dataclass(frozen=True, kw_only=True)
class StateSpace(LinearModel):
    """Linear model dx' = A dx + B du, dy = C dx + D du about a state of a simulation; SI units.

    Attributes:
        A, B, C, D: (n, n), (n, inputs), (outputs, n), (outputs, inputs); n is twice the degrees of freedom plus first-order states.
        x, y: (n,), (outputs,) the states and outputs about which it holds; `simulation.states.array - x` is the change.
        states, inputs, outputs: names; states are independent coordinates, their rates, and first-order states.
        units: by the names of inputs and outputs.
        places: x and y (m) of inputs that are the height under one wheel or move one joint.
    """

    A: Array
    B: Array
    B_rate: Array
    B_acceleration: Array
    C: Array
    D: Array
    D_rate: Array
    D_acceleration: Array
    x: Array
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    units: Mapping[str, str] = field(default_factory=dict)
    y: Array = field(default_factory=lambda: np.zeros(0))
    places: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"<StateSpace: states {', '.join(self.states)}, inputs {', '.join(self.inputs) or 'none'}, {len(self.outputs)} outputs>"

    def transfer(self, s: complex) -> ComplexArray:
        """The transfer matrix (outputs, inputs) at a complex frequency s (1/s): y = transfer(s) u for u that goes with exp(s t)."""
        return np.asarray(self.evaluate(np.array([s], dtype=np.complex128))[0])

    def choose(self, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None) -> "StateSpace":
        """The model with the named inputs and outputs in the order given; None: all.

        Raises:
            KeyError: there is no such input or output.
        """
        choices = ((self.inputs, inputs), (self.outputs, outputs))
        columns, rows = ([find_place({n: i for i, n in enumerate(of)}, name) for name in (of if to is None else to)] for of, to in choices)
        parts = {key: getattr(self, key)[:, columns] for key in ("B", "B_rate", "B_acceleration")}
        parts |= {key: getattr(self, key)[np.ix_(rows, columns)] for key in ("D", "D_rate", "D_acceleration")}
        parts |= {"C": self.C[rows], "y": self.y[rows]}
        return replace(self, **parts, inputs=tuple(self.inputs[j] for j in columns), outputs=tuple(self.outputs[i] for i in rows))

    @cached_property
    def poles(self) -> ComplexArray:  # type: ignore[override]
        """Eigenvalues of A, 1/s."""
        return np.asarray(np.linalg.eigvals(self.A), dtype=np.complex128)

    def evaluate(self, s: ComplexArray) -> ComplexArray:
        """Transfer matrices (points, outputs, inputs) at complex frequencies s (points,); infinite at poles."""
        n, parts = len(self.A), list[ComplexArray]()
        for part in np.array_split(np.asarray(s, dtype=np.complex128), 1 + len(s) * n * n // 500_000):
            at = part[:, None, None]
            M, B = at * np.eye(n) - self.A, self.B + at * self.B_rate + at * at * self.B_acceleration
            poles = np.zeros(len(part), dtype=bool)
            try:  # LU: triangular forms of A lose what is small beside its norm
                X = np.linalg.solve(M, B)
            except np.linalg.LinAlgError:
                poles = np.linalg.slogdet(M)[0] == 0.0
                X = np.linalg.solve(np.where(poles[:, None, None], np.eye(n), M), B)
            parts.append(np.where(poles[:, None, None], np.inf, self.C @ X + self.D + at * self.D_rate + at * at * self.D_acceleration))
        return np.concatenate(parts)

    def _reduced(self, order: int) -> tuple[list[Array], list[Array]]:
        """Input matrices of values, rates and accelerations in x' and y; states are changed so that x' has no derivative above an order."""
        P, Q = [self.B, self.B_rate, self.B_acceleration], [self.D, self.D_rate, self.D_acceleration]
        for k in range(2, order, -1):
            P[k - 1], Q[k - 1] = P[k - 1] + self.A @ P[k], Q[k - 1] + self.C @ P[k]
            size = np.abs(self.C) @ np.abs(P[k]) + np.abs([self.D, self.D_rate, self.D_acceleration][k - 1])
            Q[k - 1] = np.where(np.abs(Q[k - 1]) <= _ROUNDING * size, 0.0, Q[k - 1])
            P[k] = np.zeros_like(P[k])
        return P, Q

    def _alone(self, output: str, input: str) -> tuple[int, tuple[Array, Array, Array, Array]]:
        """For one output and one input: the highest derivative order of the input in y, and a realisation by that derivative."""
        one = self.choose([input], [output])
        order = next(k for k in range(len(ORDERS)) if not any(q.any() for q in one._reduced(k)[1][k + 1 :]))
        return order, one.realise(ORDERS[order])

    def realise(self, by: str = "value") -> tuple[Array, Array, Array, Array]:
        """A, B, C, D of a proper realisation driven by values, rates or accelerations of all inputs, with integrators.

        Raises:
            ValueError: an output depends on higher input derivatives.
        """
        if by not in ORDERS:
            raise ValueError(f"by: '{by}' is not one of {', '.join(ORDERS)}")
        order, n, m = ORDERS.index(by), len(self.A), len(self.inputs)
        P, Q = self._reduced(order)
        for k in range(order + 1, 3):
            for i, j in np.argwhere(Q[k]):
                words = f"take by='{ORDERS[k]}', or other outputs"
                raise ValueError(f"'{self.outputs[i]}' follows the {ORDERS[k]} of '{self.inputs[j]}': {words}")
        A, B = np.zeros((n + order * m, n + order * m)), np.zeros((n + order * m, m))
        A[:n, :n], B[:n] = self.A, P[order]
        for k in range(order):
            A[:n, n + k * m : n + (k + 1) * m] = P[k]
            (A[n + k * m : n + k * m + m, n + k * m + m : n + k * m + 2 * m] if k + 1 < order else B[n + k * m :])[:] = np.eye(m)
        return A, B, np.hstack([self.C, *Q[:order]]), Q[order]


@dataclass(frozen=True, kw_only=True)
class Sampler:
    """A controller's sample times ``offset`` + k ``every`` (s), and the ``number`` of its sampled values."""

    every: float
    offset: float
    number: int


@dataclass(frozen=True, kw_only=True)
class SampledStateSpace(LinearModel):
    """Linear model of a loop with sampled controllers, exact for zero-order hold.

    Inputs of the ``plant`` are the loop's inputs, then the controllers' sampled values.  Its outputs are the loop's outputs, then the
    next sampled values.  ``held`` are the sampled values at the state of linearisation.  A frequency response is the component at the
    input's frequency; a sampled loop also responds at other frequencies.
    """

    plant: StateSpace
    samplers: tuple[Sampler, ...]
    held: Array

    @property
    def unsteady(self) -> dict[str, tuple[float, float]]:
        """Sampled values that the next sample would change, by name: the values before and after."""
        pairs = zip(self.plant.inputs[len(self.inputs) :], self.held, self.plant.y[len(self.outputs) :], strict=True)
        return {name: (float(a), float(b)) for name, a, b in pairs if abs(a - b) > 1e-6 * max(abs(a), abs(b), 1e-3)}

    def __repr__(self) -> str:
        return f"<SampledStateSpace: period {self.period:g} s, inputs {', '.join(self.inputs) or 'none'}, {len(self.outputs)} outputs>"

    @property
    def _held(self) -> int:
        return sum(each.number for each in self.samplers)

    @property
    def inputs(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of the inputs."""
        return self.plant.inputs[: len(self.plant.inputs) - self._held]

    @property
    def outputs(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of the outputs."""
        return self.plant.outputs[: len(self.plant.outputs) - self._held]

    @property
    def units(self) -> Mapping[str, str]:  # type: ignore[override]
        """Units by the names of inputs and outputs."""
        return self.plant.units

    @cached_property
    def period(self) -> float:
        """The common period of all controllers, s."""
        times = [Fraction(f"{each.every:.12g}") for each in self.samplers]
        common = Fraction(lcm(*(t.numerator for t in times)), gcd(*(t.denominator for t in times)))
        if sum(common / t for t in times) > _MOST_SAMPLES:
            raise ValueError(f"the controllers have no common period below {_MOST_SAMPLES} samples; take intervals that divide each other")
        return float(common)

    @cached_property
    def _samples(self) -> list[tuple[float, slice, float]]:
        """Samples of a common period in order: time, indices of the values, time until the next sample."""
        ends = np.cumsum([each.number for each in self.samplers])
        found = sorted(
            (round((each.offset + k * each.every) % self.period, 12) % self.period, i, slice(int(end) - each.number, int(end)))
            for i, (each, end) in enumerate(zip(self.samplers, ends, strict=True)) for k in range(round(self.period / each.every))
        )  # fmt: skip
        times = [t for t, *_ in found]
        return [(t, places, end - t) for (t, _, places), end in zip(found, [*times[1:], times[0] + self.period], strict=True)]

    def _flow(self, B: Array, seconds: float) -> Array:
        """Transition matrix of states and inputs over a time in which inputs are constant (zero-order hold)."""
        n, m = B.shape
        return np.asarray(need("scipy.linalg").expm(np.vstack([np.hstack([self.plant.A, B]), np.zeros((m, n + m))]) * seconds))

    def _over_period(self, B: Array, follow: Array) -> tuple[Array, Array]:
        """States, sampled values and constant inputs at the end of a period and after its first samples, by those at its start."""
        n, width = len(self.plant.A), follow.shape[1]
        M, first = np.eye(width), self._samples[0][0]
        seen, flows = M, {seconds: self._flow(B, seconds) for _, _, seconds in self._samples}
        for t, places, seconds in self._samples:
            M[n + places.start : n + places.stop] = follow[places] @ M
            seen = M.copy() if t == first else seen
            M = flows[seconds] @ M
        return M, seen

    @cached_property
    def _discrete(self) -> tuple[Array, Array, Array, Array]:
        A, B, C, D = self.plant.realise()
        n, u, y = len(A) + self._held, len(self.inputs), len(self.outputs)
        rows = np.hstack([C, D[:, u:], D[:, :u]])
        M, seen = self._over_period(np.hstack([B[:, u:], B[:, :u]]), rows[y:])
        Y = rows[:y] @ seen
        return M[:n, :n], M[:n, n:], Y[:, :n], Y[:, n:]

    def _alone(self, output: str, input: str) -> tuple[int, tuple[Array, Array, Array, Array]]:
        i, j = self._pair(output, input)
        A, B, C, D = self._discrete
        return 0, (A, B[:, j : j + 1], C[i : i + 1], D[i : i + 1, j : j + 1])

    @cached_property
    def poles(self) -> ComplexArray:  # type: ignore[override]
        """Eigenvalues z of the loop over its period; it is stable if all are below 1 in magnitude."""
        u, y = len(self.inputs), len(self.outputs)
        M, _ = self._over_period(self.plant.B[:, u:], np.hstack([self.plant.C[y:], self.plant.D[y:, u:]]))
        return np.asarray(np.linalg.eigvals(M), dtype=np.complex128)

    @property
    def rates(self) -> ComplexArray:
        """Logarithms of the poles divided by the period, 1/s; minus infinity for a pole at zero."""
        size = np.abs(self.poles)
        with np.errstate(divide="ignore"):
            return np.asarray(np.log(np.where(size < 1e-9, 0.0, size)) / self.period + 1j * np.angle(self.poles) / self.period)

    @property
    def _dt(self) -> float:  # type: ignore[override]
        return self.period

    @property
    def _highest(self) -> float:
        return 0.5 / min(each.every for each in self.samplers)

    def realise(self, by: str = "value") -> tuple[Array, Array, Array, Array]:
        """Matrices A, B, C, D of the discrete model over the period, with held inputs, and outputs right after the samples at its start.

        Raises:
            ValueError: an output depends on input derivatives, or ``by`` is not "value".
        """
        if by != "value":
            raise ValueError(f"by: the inputs of a sampled loop have a zero-order hold, and no {by}; leave it out")
        return self._discrete

    def evaluate(self, s: ComplexArray) -> ComplexArray:
        """Transfer matrices (points, outputs, inputs): the component exp(s t) of each output for an input exp(s t)."""
        plant, at = self.plant, np.asarray(s, dtype=np.complex128)[:, None, None]
        n, u, y, h = len(plant.A), len(self.inputs), len(self.outputs), self._held
        G, follow = plant.evaluate(s), np.hstack([plant.C[y:], plant.D[y:, u:]])
        flows = {seconds: self._flow(plant.B[:, u:], seconds) for _, _, seconds in self._samples}
        M, forced = np.eye(n + h), np.zeros((len(G), n + h, u), dtype=np.complex128)
        held = list[tuple[Array, ComplexArray, Any]]()
        start = self._samples[0][0]
        for t, places, seconds in self._samples:  # free motion in addition to the plant's own response
            rows, wave = slice(n + places.start, n + places.stop), np.exp(at * (t - start))
            forced[:, rows] = follow[places] @ forced + wave * G[:, y:, :u][:, places]
            M[rows] = follow[places] @ M
            with np.errstate(divide="ignore", invalid="ignore"):
                weight = np.where(at == 0, seconds, -np.expm1(-at * seconds) / at) / wave / self.period
            held.append((M[n:].copy(), forced[:, n:].copy(), weight))
            M, forced = flows[seconds] @ M, flows[seconds] @ forced
        begin = np.linalg.solve(np.exp(at * self.period) * np.eye(n + h) - M, forced)
        H = sum(weight * (by_begin @ begin + own) for by_begin, own, weight in held)
        return np.asarray(G[:, :y, :u] + G[:, :y, u:] @ H)
