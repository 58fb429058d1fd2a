"""Eigenvalues and mode shapes of a linearised mechanism."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import pi

import numpy as np
from numpy.typing import NDArray

from cutjoint.analysis.closing import Array
from cutjoint.analysis.linearise import Linearisation, ReducedSystem, reduce_system
from cutjoint.package.errors import plural
from cutjoint.package.renamed import with_old_members

Complex = NDArray[np.complex128]

_ZERO = 1e-12  #: a singular value below this share of the largest belongs to an eigenvalue of zero
_PART = 1e-9  #: a real or imaginary part below this share of an eigenvalue is rounding
_SPRINGS = 1e-6  #: the share of the fastest eigenvalue below which the rate of springs is rounding
_NAMED = 6  #: the number of eigenvalues in a `repr`
_ALIKE = 1e-6  #: shares that differ by less than this part are equal


@dataclass(frozen=True, kw_only=True)
class Participant:
    """The part of one coordinate in a mode. ``amplitude`` is relative to that of the coordinate with the largest share, in SI units (m,
    rad), its phase that by which the coordinate is ahead; ``share`` is its part of the mode's kinetic energy, coordinate times momentum, to
    which squares of first-order states over their sizes are added: shares add up to one, and one may be negative."""

    amplitude: complex
    share: float


@dataclass(frozen=True, kw_only=True)
class Mode:
    """An eigenvalue (1/s), of a conjugate pair that with the positive imaginary part, and its shape by coordinate."""

    eigenvalue: complex
    shape: Mapping[str, Participant]

    @property
    def frequency(self) -> float:
        """The frequency of the oscillation, Hz; zero without one."""
        return self.eigenvalue.imag / (2 * pi)

    @property
    def damping_ratio(self) -> float:
        """Damping as a share of critical damping: 1 for a decay without oscillation, negative for growth."""
        return 0.0 - self.eigenvalue.real / abs(self.eigenvalue)

    @property
    def time_constant(self) -> float | None:
        """The time in which the mode falls to 1/e, s; negative where it grows, None where its amplitude is constant."""
        return -1 / self.eigenvalue.real if self.eigenvalue.real else None


@with_old_members
@dataclass(frozen=True, kw_only=True)
class Modes:
    """The modes by the size of their eigenvalues.

    ``rigid_body_modes`` are the directions without restoring force, each named by its largest coordinate: rigid-body motions and
    coordinates without spring; those in which a first-order state changes are named by the state. ``zeros`` counts the eigenvalues of
    zero, two for a direction with constant drift, one where a damper stops it. ``undamped`` are the modes of mass and stiffness alone,
    of a state at rest; a positive real one there means that the state is unstable. ``q`` are the tree's coordinates of the state.
    ``frozen_controllers`` names controllers; their discrete states are frozen. A ``steady`` state has constant coefficients, in axes
    that turn with free bodies.
    """

    time: float
    at_rest: bool
    degrees_of_freedom: int
    modes: tuple[Mode, ...]
    undamped: tuple[Mode, ...]
    rigid_body_modes: Mapping[str, Mapping[str, Participant]]
    zeros: int
    q: Array = field(repr=False, compare=False)
    frozen_controllers: tuple[str, ...] = ()
    steady: bool = False

    @property
    def growth_rate(self) -> float:
        """The rate (1/s) at which the fastest growing mode grows; 0 without one whose growth exceeds rounding."""
        fastest = max((abs(mode.eigenvalue) for mode in self.modes), default=0.0)
        growth = max((mode.eigenvalue.real for mode in self.modes), default=0.0)
        return growth if growth > _SPRINGS * fastest else 0.0

    def __repr__(self) -> str:
        where = "at rest" if self.at_rest else "of a steady motion" if self.steady else f"at t = {self.time:g} s"
        values = [f"{mode.eigenvalue:.3g}" for mode in self.modes[:_NAMED]] + ["..."] * (len(self.modes) > _NAMED)
        return f"<Modes {where}: {plural(self.degrees_of_freedom, 'degree')} of freedom, eigenvalues {', '.join(values) or 'none'} 1/s>"


def find_mode_shapes(of: Linearisation, time: float, zero: float = _ZERO) -> Modes:
    """The modes of a linearisation about a state at ``time`` (s); singular values below the share ``zero`` of the largest count as zero.
    Raises NoMassError: a direction that the loops leave free moves no mass."""
    system = reduce_system(of)
    n = system.basis.shape[1]
    values, vectors, null, zeros = eigenpairs(_scaled(system), zero)
    scale = _rate(system)
    modes = [
        Mode(eigenvalue=_cleaned(scale * v), shape=_shape(of, _speeds(of, system, z, scale), abs(scale * v)))
        for v, z in zip(values, vectors.T, strict=True)
    ]
    undamped: list[Mode] = []
    if of.at_rest:
        squares, shapes, _, _ = eigenpairs(system.stiffness)
        undamped = [
            Mode(eigenvalue=_cleaned(np.sqrt(-square + 0j)), shape=_shape(of, _speeds(of, system, z, scale)))
            for square, z in zip(squares, shapes.T, strict=True)
        ]
    speeds = np.array([_speeds(of, system, z, scale) for z in null.T]).reshape(null.shape[1], len(of.M))
    return Modes(
        time=time, at_rest=of.at_rest, degrees_of_freedom=n, modes=_ordered(modes), undamped=_ordered(undamped), zeros=zeros,
        rigid_body_modes=dict(_rigid_body_modes(of, speeds.T)), q=of.q,
    )  # fmt: skip


def eigenpairs(A: Array, zero: float = _ZERO) -> tuple[Complex, Complex, Array, int]:
    """Eigenvalues other than zero, their eigenvectors as columns, the null space, and how many eigenvalues are zero.
    The null space is deflated repeatedly before: each rigid-body motion is a defective double zero, which rounding would split into a
    pair of about its square root."""
    size = len(A)
    _, singular, right = np.linalg.svd(A)
    rank = int(np.sum(singular > zero * singular.max(initial=0.0)))
    kept, null = right[:rank].T, right[rank:].T
    if rank == size:
        values, vectors = np.linalg.eig(A)
        return values.astype(complex), vectors.astype(complex), null, 0
    values, inner, _, zeros = eigenpairs(kept.T @ A @ kept, zero) if rank else (np.zeros(0, complex), np.zeros((0, 0), complex), null, 0)
    vectors = kept @ inner + null @ ((null.T @ A @ kept @ inner) / values)
    return values, vectors, null, zeros + size - rank


def _rate(system: ReducedSystem) -> float:
    """A rate (1/s) that makes z and w/rate alike in size: that of springs, else, if it is rounding, that of the fastest eigenvalue."""
    springs = float(np.sqrt(np.linalg.norm(system.stiffness, 2)))
    fastest = float(np.abs(np.linalg.eigvals(system.first_order)).max(initial=0.0))
    return springs if springs > _SPRINGS * fastest else fastest or 1.0


def _speeds(of: Linearisation, system: ReducedSystem, z: Array | Complex, rate: float) -> Array | Complex:
    """The speeds of independent unknowns (z, w/rate, x/rate), states last; of z alone, states do not move."""
    n = system.basis.shape[1]
    return np.concatenate([system.basis @ z[:n], rate * of.sizes * (z[2 * n :] if len(z) > n else 0.0)])


def _scaled(system: ReducedSystem) -> Array:
    """The matrix of (z, w/rate, x/rate), by the rate."""
    rate, n = _rate(system), system.basis.shape[1]
    sizes = np.repeat([1.0, rate, rate], [n, n, len(system.first_order) - 2 * n])
    return np.asarray(system.first_order * sizes / sizes[:, np.newaxis] / rate)


def _cleaned(value: complex) -> complex:
    """Without the parts that are rounding."""
    real, imaginary = (part if abs(part) > _PART * abs(value) else 0.0 for part in (float(value.real), float(value.imag)))
    return complex(real, imaginary)


def _ordered(modes: list[Mode]) -> tuple[Mode, ...]:
    once = [mode for mode in modes if mode.eigenvalue.imag >= 0]
    return tuple(
        sorted(once, key=lambda m: (float(f"{abs(m.eigenvalue):.9e}"), m.eigenvalue.real, max(m.shape, key=lambda n: m.shape[n].share)))
    )


def _shape(of: Linearisation, x: Complex | Array, rate: float = 1.0) -> Mapping[str, Participant]:
    shares = np.real(np.conj(x) * (of.M @ x)) / np.concatenate([np.ones(len(of.M) - of.states), (rate * of.sizes) ** 2])
    # unknowns that no other depends on, such as bristles of inactive friction, make no mode
    first = len(of.M) - of.states
    affects = np.array([i < first or bool(np.delete(of.C[:, i], i).any()) for i in range(len(of.M))])
    followed = np.where(affects, shares, 0.0)
    shares = followed if followed.any() else shares
    shares /= shares.sum()
    dominant = int(np.flatnonzero(shares > (1 - _ALIKE) * shares.max())[0])
    amplitudes = x / x[dominant]
    return {
        name: Participant(amplitude=complex(a), share=float(share)) for name, a, share in zip(of.names, amplitudes, shares, strict=True)
    }


def _rigid_body_modes(of: Linearisation, x: Array) -> Iterator[tuple[str, Mapping[str, Participant]]]:
    """Combinations of the columns of x (speeds, directions) of which each has a coordinate of its own, or a state where states change."""
    directions, first = x.shape[1], len(of.M) - of.states
    sizes, rest, dominants = np.sqrt(of.M.diagonal().clip(0.0)), x.copy(), []
    sizes[first:] /= of.sizes
    for _ in range(directions):
        lengths = np.linalg.norm(rest, axis=1) * sizes
        with_states = lengths[first:].max(initial=0.0) > _PART * lengths.max()
        dominant = int(first + lengths[first:].argmax() if with_states else lengths[:first].argmax())
        dominants.append(dominant)
        along = rest[dominant] / np.linalg.norm(rest[dominant])
        rest -= np.outer(rest @ along, along)
    basis = x @ np.linalg.inv(x[dominants]) if directions else x
    for dominant, column in sorted(zip(dominants, basis.T, strict=True)):
        yield of.names[dominant], _shape(of, np.where(np.abs(column) > _PART, column, 0.0))
