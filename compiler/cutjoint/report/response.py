"""Frequency responses and random vibration: tables for people, CSV files for programs, plots."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.table import Table

from cutjoint.report.tables import facts, table
from cutjoint.run.display import in_units
from cutjoint.run.result_files import write_table, write_whole
from cutjoint.stepping.state_space import FrequencyResponse, LinearModel, SampledStateSpace
from cutjoint.stepping.values import Array
from cutjoint.stepping.vibration import RandomVibration

#: The largest numbers of poles and zeros in a table.
_POLES, _ZEROS = 40, 3

#: Numbers smaller than this share of the largest of their kind are rounding: they are shown as 0.
_ROUNDING = 1e-14


def response_tables(model: LinearModel, frequencies: Array | None, about: str) -> Iterator[Table]:
    """The state that the model is ``about``, its poles, and a row for each input and output with peak, margins and zeros."""
    yield facts("linear model", _about(model, about))
    sampled = isinstance(model, SampledStateSpace)
    headings = ("z" if sampled else "pole\n1/s", "frequency\nHz", "damping\nratio")
    poles = table("poles", headings, numbers=headings, no_wrap=True)
    largest = max(np.abs(model.poles), default=0.0)
    order = np.lexsort((model.poles.real, np.abs(model.rates)))
    for pole, rate in ((model.poles[i], model.rates[i]) for i in order if model.poles[i].imag >= 0.0 and len(poles.rows) < _POLES):
        size = abs(rate)
        rings = bool(rate.imag) and np.isfinite(size)
        poles.add_row(_complex(pole, largest), f"{size / (2 * np.pi):.4f}" if rings else "-", f"{-rate.real / size:z.4f}" if rings else "-")
    yield poles
    figures = ("peak gain", "at\nHz", "gain\nmargin", "at\nHz", "phase\nmargin deg", "at\nHz")
    responses = table("responses: outputs in their units, inputs in SI units", ("output", "input", *figures), numbers=figures, no_wrap=True)
    responses.add_column("zeros\nz" if sampled else "zeros\n1/s", overflow="fold")
    peaks = {(o, i): model.peak(o, i, frequencies) for o in model.outputs for i in model.inputs}
    for output in model.outputs:
        for name in model.inputs:
            peak, margins = peaks[output, name], model.margins(output, name, frequencies)
            of_unit = [p.gain for (other, _), p in peaks.items() if model.units.get(other) == model.units.get(output)]
            alike = max(filter(np.isfinite, of_unit), default=0.0)
            if peak.gain <= _ROUNDING * alike:
                responses.add_row(output, name, "0", *"------")
                continue
            numbers = (_number(x) for x in (peak.at, margins.gain, margins.gain_at, margins.phase, margins.phase_at))
            responses.add_row(output, name, f"{peak.gain:.4g}", *numbers, _zeros(model, output, name))
    yield responses


def _about(model: LinearModel, about: str) -> Iterator[tuple[str, str]]:
    yield "about", about
    yield "poles", f"{len(model.poles)}, {'stable' if model.is_stable else 'not all decay'}"
    if isinstance(model, SampledStateSpace):
        yield "controllers", f"sampled; common period {model.period:g} s, poles and zeros of the discrete model over it"
        for name, (before, after) in [*model.unsteady.items()][:1]:
            yield "unsteady", f"'{name}' is {before:.4g} and becomes {after:.4g} at the next sample: if laws are nonlinear, take --at"


def _zeros(model: LinearModel, output: str, name: str) -> str:
    try:
        found = [z for z in model.zeros(output, name) if z.imag >= 0.0]
    except ValueError:  # of a sampled loop whose output follows the input's rate
        return "-"
    largest = max(map(abs, [*found, *model.poles]), default=0.0)
    more = f", {len(found) - _ZEROS} more" if len(found) > _ZEROS else ""
    return ", ".join(_complex(z, largest) for z in found[:_ZEROS]) + more or "none"


def _complex(value: complex, largest: float) -> str:
    least = max(1e-9 * abs(value), _ROUNDING * largest)
    real = 0.0 if abs(value.real) <= least else value.real
    return f"{real:.4g} ±{value.imag:.4g}i" if abs(value.imag) > least else f"{real + 0.0:.4g}"


def _number(value: float) -> str:
    return f"{value:.4g}" if np.isfinite(value) else "-"


def in_display_units(found: RandomVibration, display: Sequence[str]) -> RandomVibration:
    """Random vibration in the units for display of its outputs."""
    scales, units = in_units(dict.fromkeys(found.outputs, 1.0), {n: found.units.get(n, "") for n in found.outputs}, display)
    by = np.array([scales[n] for n in found.outputs])
    return replace(found, densities=found.densities * by**2, rms=found.rms * by, white=found.white * by, weighted=found.weighted * by,
        units=units)  # fmt: skip


def vibration_table(found: RandomVibration, title: str, weight: str) -> Table:
    """A row for each output: root mean squares in the band of the road and without its limits, weighted, and over the mean."""
    rows = []
    for name, rms, *numbers in zip(found.outputs, found.rms, found.white, found.weighted, 100 * found.variation, strict=True):
        alike = max(r for other, r in zip(found.outputs, found.rms, strict=True) if found.units.get(other) == found.units.get(name))
        rows.append((name, found.units.get(name, ""), *("0---" if rms <= _ROUNDING * alike else map(_number, (rms, *numbers)))))
    figures = ("rms", "white noise\n(Lyapunov)", f"{weight} weighted\n(ISO 2631-1)", "over mean\n%")
    return table(f"{title}: root mean squares", ("output", "unit", *figures), rows, numbers=figures, no_wrap=True)


def write_response(response: FrequencyResponse, path: Path) -> Path:
    """Write gains and phases (rad) over the frequency as a CSV file; a second file has the units.
    Raises OutputError: it cannot be written."""
    pairs = [(i, j) for i in range(len(response.outputs)) for j in range(len(response.inputs))]
    columns, units = [response.frequencies], {"f": "Hz"}
    for i, j in pairs:
        above, below = (response.units.get(n, "") for n in (response.outputs[i], response.inputs[j]))
        name = f"{response.outputs[i]}/{response.inputs[j]}"
        units |= {f"{name}.gain": f"({above or 1})/({below})" if below else above, f"{name}.phase": "rad"}
        columns += [response.magnitude[:, i, j], np.radians(response.phase[:, i, j])]
    return write_table(path, units, zip(*columns, strict=True))


def write_densities(found: RandomVibration, path: Path) -> Path:
    """Write power spectral densities over the frequency as a CSV file; a second file has the units.
    Raises OutputError: it cannot be written."""
    units = {"f": "Hz", **{f"{name}.psd": f"({found.units.get(name) or 1})^2/Hz" for name in found.outputs}}
    return write_table(path, units, zip(found.frequencies, *found.densities.T, strict=True))


def plot_response(response: FrequencyResponse, title: str, folder: Path) -> list[Path]:
    """Write a Bode and a Nyquist plot of each output as PNG files, a line for each input, and return their paths."""
    from cutjoint.run.figures import Line, as_png, draw

    written, f = [], response.frequencies
    for i, output in enumerate(response.outputs):
        unit, of, gains, phases, values = response.units.get(output, ""), f"{title}: {output}", [], [], []
        for j, name in enumerate(response.inputs):
            at = response.values[:, i, j]
            gains.append(Line(x=f, y=response.magnitude[:, i, j], label=name, unit=unit, panel=f"{output} by input", scale="loglog"))
            phases.append(Line(x=f, y=response.phase[:, i, j], label=name, unit="deg", panel="phase", scale="semilogx"))
            values.append(Line(x=at.real, y=at.imag, label=name, unit="", panel="imaginary part"))
        nyquist = draw(values, x_label="real part", title=of)
        (axes,) = nyquist.axes
        for line in axes.get_lines():
            axes.plot(line.get_xdata(), -np.asarray(line.get_ydata()), "--", linewidth=0.8, color=line.get_color())
        axes.plot(-1.0, 0.0, "+", color="black")
        axes.set_aspect("equal", adjustable="datalim")
        nyquist.set_figheight(6.2)
        bode = draw([*gains, *phases], x_label="frequency [Hz]", title=of)
        written += [write_whole(folder / f"{kind}_{output}.png", as_png(x)) for kind, x in (("bode", bode), ("nyquist", nyquist))]
    return written


def plot_densities(found: RandomVibration, title: str, folder: Path) -> list[Path]:
    """Write the spectral densities as a PNG file with a panel for each unit, and return its path."""
    from cutjoint.run.figures import Line, as_png, draw

    lines = [
        Line(x=found.frequencies, y=y, label=name, unit=f"({found.units.get(name) or 1})²/Hz", panel="density", scale="loglog")
        for name, y in zip(found.outputs, found.densities.T, strict=True) if y.any()
    ]  # fmt: skip
    return [write_whole(folder / "densities.png", as_png(draw(lines, x_label="frequency [Hz]", title=title)))]
