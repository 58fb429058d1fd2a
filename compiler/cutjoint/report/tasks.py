"""Reports of equilibria, of modes, of reduced models and of steps against the clock: tables for people, and for programs JSON."""

import json
from cmath import phase
from collections.abc import Collection, Iterator, Mapping, Sequence
from math import degrees, floor, inf, isnan, log10
from pathlib import Path
from typing import Any

import numpy as np
from rich.bar import Bar
from rich.table import Table

from cutjoint.analysis.modes import Mode, Modes, Participant
from cutjoint.methods import join_and
from cutjoint.model.expressions.quantities import POSE
from cutjoint.model.records import VALUE, Model, Scene
from cutjoint.package.errors import plural
from cutjoint.reduce.choose import DEARER, FULL, LEFT, Candidate, Choice
from cutjoint.reduce.measure import Cost, asked_of
from cutjoint.reduce.sequence import ReducedModel
from cutjoint.report.tables import facts, largest_by_unit, table
from cutjoint.run.result_files import write_table
from cutjoint.run.results import MechanismState
from cutjoint.tasks.inverse import Drives
from cutjoint.tasks.realtime import StepTimes

# Equilibria

#: Smaller values (m, rad) are rounding errors.
_NOTHING = 1e-12
#: The share of a tyre's load above which its side force is named.
_SIDE = 1e-3
_PERCENTILES = (50.0, 90.0, 99.0, 99.9)
#: Classes of the histogram per power of ten.
_CLASSES = 5
#: The smallest share of a mode's kinetic energy for which a coordinate is listed, and the largest number of listed coordinates.
_LISTED, _MOST = 0.05, 4
#: The words of `modes` and their meaning.
_MODE_WORDS = (
    ("eigenvalue", "real part: growth rate, negative if the mode decays; imaginary part: angular frequency"),
    ("moves", "coordinates with amplitudes (m, rad) relative to the first; signs and angles are phases;  in brackets the "
     "share of the kinetic energy, negative if a coordinate moves against its base, so that others "
     "exceed 100 %; states have none; wx is a rotation about x"),
    ("without dampers", "the same without damping; a real eigenvalue means an unstable equilibrium"),
    ("rigid-body modes", "motions without restoring force, each by its leading coordinate"),
)  # fmt: skip


def pose_table(state: MechanismState) -> Table:
    """The pose of each body, a row each."""
    bodies = _posed(state)
    columns = [_decimals([state.values[f"{body}.{quantity}"] for body in bodies]) for quantity in POSE]
    units = dict.fromkeys(state.units[f"{bodies[0]}.{quantity}"] if bodies else unit for quantity, unit in POSE.items())
    made = table(f"poses, {' and '.join(units)}", ("body", *POSE), zip(bodies, *columns, strict=True), numbers=POSE)
    made.pad_edge, made.collapse_padding = False, True
    return made


def force_table(state: MechanismState, hidden: Collection[str]) -> Table:
    """A table of all values except the poses of bodies and the ``hidden`` columns, a row a quantity."""
    bodies, rows = _posed(state), []
    for column, value in state.values.items():
        element, _, quantity = column.rpartition(".")
        if element not in bodies and column not in hidden:
            rows.append((element, quantity, "undefined" if isnan(value) else f"{value + 0.0:.7g}", state.units[column]))
    return table("forces", ("element", "quantity", "value", "unit"), rows, numbers=("value",))


def standing_tyre_lines(model: Model, state: MechanismState) -> Iterator[str]:
    """A line if wheels with first-order states hold side forces where they stand: these are friction, which may have other values."""
    stuck = {inner for s in model.states if (inner := s.name.rpartition(".")[0])}
    held = {f.name: state.values[f"{f.name}.Fy"] for f in model.forces if f.element.kind == "wheel" and f.name.rpartition(".")[0] in stuck}
    most = max(held, key=lambda name: abs(held[name]), default="")
    if held and abs(held[most]) > _SIDE * abs(state.values[f"{most}.Fz"]):
        yield (
            f"standing tyres hold side forces, the largest {held[most]:.4g} N at {most}: friction allows other values too, each with a "
            "ride height of its own; for that of a rolling car use a trim"
        )


# Drives


def drive_table(found: Drives) -> Table:
    """The largest force of each drive, and its root mean square over the samples."""
    figures, rows = ("largest", "at, s", "root mean square"), []
    for name, force in found.forces.items():
        row, mean = int(np.abs(force).argmax()), float(np.sqrt(np.mean(force**2)))
        rows.append((name, f"{force[row] + 0.0:.6g}", f"{found.t[row]:g}", f"{mean:.6g}", found.units[name]))
    return table("drives", ("joint", *figures, "unit"), rows, numbers=figures)


def write_drives(found: Drives, path: Path) -> Path:
    """Write the forces over time as a CSV file, and a file of units; raises OutputError if it cannot be written."""
    return write_table(path, {"t": "s", **found.units}, zip(found.t, *found.forces.values(), strict=True))


def _decimals(values: Sequence[float]) -> list[str]:
    """Numbers with as many decimals as give the largest five digits, but at least five."""
    largest = max(map(abs, values), default=0.0)
    decimals = max(5, 4 - floor(log10(largest))) if largest > _NOTHING else 5
    return [f"{round(value, decimals) + 0.0:.{decimals}f}" for value in values]


def _posed(state: MechanismState) -> list[str]:
    """The elements whose complete pose is known."""
    elements = dict.fromkeys(column.rpartition(".")[0] for column in state.values)
    return [e for e in elements if all(f"{e}.{quantity}" in state.values for quantity in POSE)]


# Steps against the clock


def time_tables(times: StepTimes) -> Iterator[Table]:
    """Percentiles and missed deadlines, and the histogram."""
    if times.durations.size:
        yield facts("step times", _facts(times))
        yield _histogram(times)


def _facts(times: StepTimes) -> Iterator[tuple[str, str]]:
    yield "steps", f"{times.durations.size}, {times.period * 1e3:g} ms apart"
    for share in _PERCENTILES:
        yield f"p{share:g}", _share_of_period(times.percentile(share), times.period)
    yield "largest", _share_of_period(float(times.durations.max()), times.period)
    latest = f" in {times.stalls} stalls, by {_short(float(times.lateness.max()))} at most" if times.missed else ""
    yield "missed deadlines", f"{times.missed}{latest}"
    if times.missed:
        yield "", f"{times.missed_by_steps} of them by the duration of the step, the others because it began late"
    yield "wake-up latency", _share_of_period(float(times.wakeup_latency.max()), times.period)


def _share_of_period(seconds: float, period: float) -> str:
    return f"{_short(seconds)}, {100 * seconds / period:.2g} % of the step"


def _short(seconds: float) -> str:
    return f"{seconds * 1e6:.3g} us" if seconds < 1e-3 else f"{seconds * 1e3:.3g} ms"


def _histogram(times: StepTimes) -> Table:
    """Classes of equal width on a logarithmic scale; bars have logarithmic lengths, so that single late steps are visible."""
    classes = np.floor(_CLASSES * np.log10(np.maximum(times.durations, 1e-9))).astype(int)
    counts = np.bincount(classes - classes.min())
    headings = ("from", "to", "steps")
    histogram = table("histogram", headings, numbers=headings, no_wrap=True)
    histogram.add_column("(logarithmic)", width=40)
    for i, count in enumerate(counts):
        low, high = (_short(10 ** ((classes.min() + i + k) / _CLASSES)) for k in (0, 1))
        histogram.add_row(low, high, str(count), Bar(float(np.log(1 + counts.max())), 0, float(np.log(1 + count))))
    return histogram


def mode_tables(modes: Modes) -> Iterator[Table | str]:
    """Eigenvalues, undamped frequencies, rigid-body modes, and a legend."""
    about = _state(modes)
    if modes.modes:
        yield _table(f"modes about {about}", modes.modes)
    else:
        rigid = sum(not _is_state(name) for name in modes.rigid_body_modes)
        yield f"no modes about {about}: {plural(rigid, 'rigid-body mode')}, {plural(modes.degrees_of_freedom, 'degree')} of freedom"
    if modes.undamped:
        yield _table("without dampers", modes.undamped, damped=False)
    if modes.zeros:
        kinds = {"rigid-body modes": False, "states that nothing restores": True}
        named = {kind: [n for n in modes.rigid_body_modes if _is_state(n) is of_states] for kind, of_states in kinds.items()}
        found = {kind: ", ".join(names) for kind, names in named.items() if names}
        yield f"{' and '.join(found)}, with {modes.zeros} eigenvalue{'s' * (modes.zeros != 1)} of zero: {'; '.join(found.values())}"
    if modes.frozen_controllers or (modes.growth_rate and (modes.at_rest or modes.steady)):
        yield describe_stability(modes)
    modes_by_word = {"eigenvalue": modes.modes, "moves": modes.modes, "without dampers": modes.undamped, "rigid-body modes": modes.zeros}
    yield facts("words", [(word, meaning) for word, meaning in _MODE_WORDS if modes_by_word[word]])


def _is_state(name: str) -> bool:
    """Whether an entry of a mode shape is a first-order state, which has no kinetic energy."""
    return name.endswith(f".{VALUE}")


def _state(modes: Modes) -> str:
    moving = "the steady motion" if modes.steady else f"the motion at {modes.time:.6g} s, coefficients frozen"
    return "the static equilibrium" if modes.at_rest else moving


def describe_stability(modes: Modes) -> str:
    """Whether small disturbances grow, or why the modes do not say it."""
    if modes.frozen_controllers:
        names = join_and([f"'{name}'" for name in modes.frozen_controllers])
        return f"{names}: sampled values are held constant: these are not the modes of the sampled loop; a run shows whether it is stable"
    if not (modes.at_rest or modes.steady):
        return f"stability not known: modes are about {_state(modes)}; a run shows whether disturbances grow"
    if modes.growth_rate:
        return f"unstable: small disturbances of {_state(modes)} grow as exp({modes.growth_rate:.4g} t), t in s"
    free = f", and none restores {', '.join(modes.rigid_body_modes)}" if modes.rigid_body_modes else ""
    return f"stable: no small disturbance of {_state(modes)} grows{free}"


def _table(title: str, modes: tuple[Mode, ...], *, damped: bool = True) -> Table:
    headings = ("eigenvalue\n1/s", "frequency\nHz", *(("damping\nratio", "time\nconstant s") if damped else ()))
    made = table(title, headings, numbers=headings, no_wrap=True)
    made.add_column("moves\n(share of the kinetic energy)", overflow="fold")
    for mode in modes:
        value, frequency, *figures = (text for _, text in mode_figures(mode))
        made.add_row(value, frequency, *(figures if damped else ()), ", ".join(" ".join(each) for each in participants(mode.shape)))
    return made


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


def participants(shape: Mapping[str, Participant]) -> tuple[tuple[str, str], ...]:
    """The coordinates with the largest shares, the first of amplitude one, each with its amplitude and share."""
    order = sorted(shape.items(), key=lambda item: -round(abs(item[1].share), 6))
    shown = [order[0], *(item for item in order[1:_MOST] if abs(item[1].share) >= _LISTED)]
    energy = sum(p.share for name, p in shape.items() if not _is_state(name)) or 1.0
    return tuple((name, _amplitude(p.amplitude) + ("" if _is_state(name) else f" ({100 * p.share / energy:.0f} %)")) for name, p in shown)


def _amplitude(value: complex) -> str:
    """A signed number if in phase or opposite, else magnitude and phase in degrees."""
    if abs(value.imag) <= 1e-3 * abs(value):
        return f"{value.real:.3g}"
    return f"{abs(value):.3g} at {degrees(phase(value)):.0f} deg"


def modes_json(modes: Modes, model: str, scene: str) -> str:
    """All numbers; complex numbers are [real, imaginary]."""
    content = {
        "model": model, "scene": scene, "t": modes.time,
        "about": "static equilibrium" if modes.at_rest else "steady motion" if modes.steady else "motion",
        "degrees_of_freedom": modes.degrees_of_freedom, "modes": modes.modes,
        "undamped": modes.undamped, "zero_eigenvalues": modes.zeros, "frozen_controllers": modes.frozen_controllers,
        "rigid_body_modes": modes.rigid_body_modes,
    }  # fmt: skip
    return json.dumps(content, indent=2, default=_plain) + "\n"


def _plain(value: complex | Mode | Participant) -> Any:
    if isinstance(value, complex):
        return [value.real, value.imag]
    names = ("eigenvalue", "frequency", "damping_ratio", "time_constant", "shape") if isinstance(value, Mode) else vars(value)
    return {name: getattr(value, name) for name in names}


# Reductions


def reduction_table(variants: Sequence[ReducedModel], costs: Sequence[Cost]) -> Table:
    """A table with one row for each model: its size, its cost, and its distance from the full model."""
    full = variants[0]
    figures = ("unknowns", "equations", "ops", "share", "ms", "faster", "error")
    rows = (
        (
            variant.name, variant.motion, str(variant.unknowns), str(variant.equations), str(variant.operations),
            f"{100 * variant.operations / max(full.operations, 1):.0f} %", f"{1e3 * cost.seconds:.2f}",
            "-" if cost.failure else f"{costs[0].seconds / cost.seconds:.2f}",
            cost.failure or (f"{cost.error:.1e}" if variant is not full else "-"),
        )
        for variant, cost in zip(variants, costs, strict=True)
    )  # fmt: skip
    title = f"{full.model.name}, scene {full.scene.name}, method {full.method}"
    return table(title, ("model", "motion", *figures), rows, numbers=figures)


def reduction_errors(variants: Sequence[ReducedModel], costs: Sequence[Cost]) -> Iterator[Table]:
    """For each approximate model the output of each unit that differs most from the full model's."""
    for variant, cost in zip(variants, costs, strict=True):
        if variant.motion == "approximate" and cost.differences:
            found = largest_by_unit(cost.differences, cost.units)
            yield facts(f"{variant.name}: largest differences of outputs from the full model", [
                (unit or "1", f"{value:.1e} ({name})") for unit, (value, name) in found.items()
            ])  # fmt: skip


def choice_tables(choice: Choice, scene: Scene) -> Iterator[Table | str]:
    """The candidates that ran, within 80 characters, the reasons of those that did not, and a legend."""
    ran = [c for c in choice.evidence if c.error < inf or c.failure in LEFT]
    within = "the errors asked, whose multiples 'error' has" if scene.targets else f"{asked_of(scene):g} m and rad"
    figures, title = ("steps", "error", "work"), f"scene {scene.name}: the least work within {within}"
    made = table(title, ("method", "model", "loops", "integrator", *figures), (_cells(c, choice.chosen) for c in ran), numbers=figures)
    made.pad_edge, made.collapse_padding = False, True
    yield made
    for c in (c for c in choice.evidence if c.failure not in ("", *LEFT)):
        yield f"{c.method}, {c.variant}, {c.loops}, {c.steps.integrator}: {c.failure}"
    yield (
        f"work: estimated instructions of a run, as multiples of {choice.chosen.work:.2g}; >: given up, since\n"
        "coarser steps take more work already; -: no steps keep the accuracy, or see above;\n"
        f"x: steps cross events; error of the reference: {_scientific(choice.reference_change)}"
    )
    settings = {"method": choice.chosen.method, "loops": choice.chosen.loops, **choice.chosen.steps.options}
    words = " ".join(f"--{name} {value}".replace("--tol", "--solver-tol") for name, value in settings.items() if value is not None)
    yield f"without auto: {words if choice.chosen.variant == FULL else 'no option has the reduced model'}"


def _cells(candidate: Candidate, chosen: Candidate) -> tuple[str, ...]:
    steps, work = candidate.steps, "chosen" if candidate == chosen else f"{candidate.work / chosen.work:.3g}"
    work = f"> {work}" if candidate.failure == DEARER else "-" if candidate.failure else work
    integrator = steps.integrator + (" x" if steps.events else "")
    return candidate.method, candidate.variant.split()[0], candidate.loops, integrator, str(steps), _scientific(candidate.error), work


def _scientific(number: float) -> str:
    return f"{number:.1e}".replace("e-0", "e-")
