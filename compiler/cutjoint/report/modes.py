"""Eigenvalues and mode shapes for people, as tables, and for programs, as JSON."""

from __future__ import annotations

import json
from cmath import phase
from collections.abc import Iterator, Mapping
from math import degrees
from typing import Any

from rich.table import Table

from cutjoint.analysis.modes import Mode, Modes, Participant

#: The least share of a mode's kinetic energy with which a coordinate is listed, and the number of listed ones.
_LISTED, _MOST = 0.05, 4


def mode_tables(modes: Modes) -> Iterator[Table | str]:
    """The eigenvalues, the frequencies without dampers, and the directions that nothing brings back."""
    about = "the static equilibrium" if modes.at_rest else f"the motion at {modes.time:.6g} s, coefficients frozen"
    if modes.modes:
        yield _table(f"modes about {about}", modes.modes)
    else:
        yield f"no modes about {about}: {modes.freedoms} degrees of freedom, {len(modes.indifferent)} of them indifferent"
    if modes.undamped:
        yield _table("without dampers", modes.undamped, damped=False)
    if modes.zeros:
        yield f"indifferent, with {modes.zeros} eigenvalue{'s' * (modes.zeros != 1)} of zero: {', '.join(modes.indifferent)}"


def _table(title: str, modes: tuple[Mode, ...], *, damped: bool = True) -> Table:
    table = Table(title=title, title_justify="left", box=None)
    for heading in ("eigenvalue\n1/s", "frequency\nHz", *(("damping\nratio", "time\nconstant s") if damped else ())):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("moves\n(share of the kinetic energy)")
    for mode in modes:
        value, frequency, *figures = (text for _, text in mode_figures(mode))
        table.add_row(value, frequency, *(figures if damped else ()), _listed(mode.shape))
    return table


def mode_figures(mode: Mode) -> tuple[tuple[str, str], ...]:
    """The values of a mode for people, each with its name."""
    return (
        ("eigenvalue, 1/s", _eigenvalue(mode.eigenvalue)),
        ("frequency, Hz", f"{mode.frequency:.4f}" if mode.frequency else "-"),
        ("damping ratio", f"{mode.damping_ratio:.4f}"),
        ("time constant, s", "-" if mode.time_constant is None else f"{mode.time_constant:.4g}"),
    )


def _eigenvalue(value: complex) -> str:
    sign = "±" if value.imag else ""
    real = f"{value.real:.5g}" if value.real or not value.imag else ""
    return f"{real} {sign}{value.imag:.5g}i".strip() if value.imag else real


def _listed(shape: Mapping[str, Participant]) -> str:
    return ", ".join(f"{name} {amplitude}" for name, amplitude in participants(shape))


def participants(shape: Mapping[str, Participant]) -> tuple[tuple[str, str], ...]:
    """The coordinates with the largest shares, the first of amplitude one, each with its amplitude and share."""
    order = sorted(shape.items(), key=lambda item: -round(abs(item[1].share), 6))
    shown = [order[0], *(item for item in order[1:_MOST] if abs(item[1].share) >= _LISTED)]
    return tuple((name, f"{_amplitude(p.amplitude)} ({100 * p.share:.0f} %)") for name, p in shown)


def _amplitude(value: complex) -> str:
    """Signed where in phase or opposite, else with the phase in degrees."""
    if abs(value.imag) <= 1e-3 * abs(value):
        return f"{value.real:.3g}"
    return f"{abs(value):.3g} at {degrees(phase(value)):.0f} deg"


def modes_json(modes: Modes, model: str, scene: str) -> str:
    """All numbers; complex numbers are [real, imaginary]."""
    content = {
        "model": model, "scene": scene, "about": "static equilibrium" if modes.at_rest else "motion", "t": modes.time,
        "degrees_of_freedom": modes.freedoms, "modes": [_plain_mode(m) for m in modes.modes],
        "undamped": [_plain_mode(m) for m in modes.undamped], "zero_eigenvalues": modes.zeros,
        "indifferent": {name: _plain_shape(shape) for name, shape in modes.indifferent.items()},
    }  # fmt: skip
    return json.dumps(content, indent=2) + "\n"


def _plain_mode(mode: Mode) -> dict[str, Any]:
    value = mode.eigenvalue
    return {
        "eigenvalue": [value.real, value.imag], "frequency": mode.frequency, "damping_ratio": mode.damping_ratio,
        "time_constant": mode.time_constant, "shape": _plain_shape(mode.shape),
    }  # fmt: skip


def _plain_shape(shape: Mapping[str, Participant]) -> dict[str, Any]:
    return {name: {"amplitude": [p.amplitude.real, p.amplitude.imag], "share": p.share} for name, p in shape.items()}
