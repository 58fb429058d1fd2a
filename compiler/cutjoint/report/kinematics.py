"""Kinematics of an axle: for people tables in mm and degrees and plots, for programs a CSV file in SI units."""

from collections.abc import Iterator
from math import degrees
from pathlib import Path

import numpy as np
from rich.table import Table

from cutjoint.report.tables import facts, table
from cutjoint.run.result_files import write_table, write_whole
from cutjoint.tasks.kinematics.axles import SIDES, Axle
from cutjoint.tasks.kinematics.figures import MOTION_RATIO, STEERING_RATIO
from cutjoint.tasks.kinematics.sweep import CHANGES, LEADING, LOADS, ROLL, STEERING, TRAVEL, AxleCompliance, AxleKinematics

#: The most rows that a table for people has.
_ROWS = 11
#: The scale, the unit and the decimals of numbers for people, by the unit in files.
_FOR_PEOPLE = {"m": (1e3, "mm", 2), "rad": (degrees(1.0), "deg", 3), "1": (1.0, "", 3), "m/rad": (1e3 / degrees(1.0), "mm/deg", 3)}
#: Figures of one wheel in the table of travel; those of the other are equal on a symmetric axle.
_OF_ONE_WHEEL = ("camber", "toe", "caster", "kingpin_inclination", "scrub_radius", "caster_trail")
_OF_BOTH = ("camber", "toe")
#: Figures of the axle in the table of each sweep.
_OF_AXLE = {
    TRAVEL: ("track", "roll_centre_height"), ROLL: ("track", "roll_centre_height", "roll_centre_y"),
    STEERING: ("ackermann", STEERING_RATIO),
}  # fmt: skip
_TITLES = {TRAVEL: "both wheels up and down", ROLL: "roll: one wheel up, the other down", STEERING: "steering"}
_SHOWN_ONCE = ("brake_support_angle", "drive_support_angle", "anti_brake", "anti_drive")


def kinematics_tables(found: AxleKinematics) -> Iterator[Table]:
    """The axle, its figures in the design position, and a table a sweep."""
    yield facts(f"axle {found.axle.name}", _about(found))
    yield _design(found)
    for name in found.sweeps:
        yield _sweep(found, name)


def _about_wheels(axle: Axle) -> Iterator[tuple[str, str]]:
    yield "chassis", axle.chassis
    yield "wheels", ", ".join(f"{w.body}, radius {w.radius * 1e3:.4g} mm" for w in axle.wheels)
    yield "steered by", axle.steering.name if axle.steering is not None else "nothing; --steer names a joint"


def _about(found: AxleKinematics) -> Iterator[tuple[str, str]]:
    axle = found.axle
    yield from _about_wheels(axle)
    if axle.wheelbase is not None:
        yield "wheelbase", f"{axle.wheelbase * 1e3:.4g} mm, centre of mass {axle.height * 1e3:.4g} mm above the road"
    for limit in found.limits:
        yield "limit", limit


def _design(found: AxleKinematics) -> Table:
    """The figures that are known in the design position only, one per row."""
    design, columns = table("design position", ("", *SIDES), numbers=SIDES), found.sweeps[TRAVEL]
    here = int(np.abs(columns[LEADING[TRAVEL]]).argmin())
    names = dict.fromkeys(c.partition(".")[2] for c in columns if c.partition(".")[0] in SIDES and c.partition(".")[2] in _SHOWN_ONCE)
    for name in names:
        unit = found.units[f"{SIDES[0]}.{name}"]
        design.add_row(_heading(name, unit).replace("\n", ", "), *(_number(columns[f"{side}.{name}"][here], unit) for side in SIDES))
    for spring in found.axle.springs:
        design.add_row(f"motion ratio {spring.name}", _number(columns[f"{spring.name}.{MOTION_RATIO}"][here], "1"))
    return design


def _sweep(found: AxleKinematics, name: str) -> Table:
    columns = found.sweeps[name]
    leading = [LEADING[name]]
    wheels = [f"{SIDES[0]}.{c}" for c in _OF_ONE_WHEEL] if name == TRAVEL else [f"{s}.{c}" for c in _OF_BOTH for s in SIDES]
    shown = [c for c in (*leading, *wheels, *_OF_AXLE[name]) if c in columns]
    headings, rows = [_heading(c, found.units[c]).replace(" inclination", "") for c in shown], columns[leading[0]].size
    cells = ([_number(columns[c][i], found.units[c]) for c in shown] for i in range(0, rows, max(1, -(-rows // _ROWS))))
    return table(_TITLES[name], headings, cells, numbers=headings)


def _heading(column: str, unit: str) -> str:
    shown = _FOR_PEOPLE[unit][1]
    return column.replace("_", " ").replace("left.", "left ").replace("right.", "right ") + (f"\n{shown}" if shown else "")


def _number(value: float, unit: str) -> str:
    scale, _, decimals = _FOR_PEOPLE[unit]
    return "-" if np.isnan(value) else f"{round(scale * value, decimals) + 0.0:.{decimals}f}"


def write_kinematics(found: AxleKinematics, path: Path) -> Path:
    """Write all sweeps into one CSV file, each row with its sweep's name; a second file has the units.
    Raises OutputError: it cannot be written."""
    rows = ((name, *row) for name, sweep in found.sweeps.items() for row in zip(*(sweep[c] for c in found.units), strict=True))
    return write_table(path, found.units, rows, "sweep")


def compliance_tables(found: AxleCompliance) -> Iterator[Table]:
    """The axle, and a table a wheel: a row a load, by kN and kN m."""
    yield facts(f"axle {found.axle.name}, compliance", _about_wheels(found.axle))
    for side in SIDES:
        headings, rows = [f"{name}\n{_FOR_PEOPLE[unit][1]}" for name, unit in CHANGES.items()], []
        for load, of in LOADS.items():
            changes = ((name, _FOR_PEOPLE[unit]) for name, unit in CHANGES.items())
            cells = (f"{round(1e3 * scale * found.figures[f'{side}.{load}.{name}'], 3) + 0.0:.3f}" for name, (scale, *_) in changes)
            rows.append((f"{load}, by k{of.replace('*', ' ')}", *cells))
        yield table(f"{side} wheel", ("", *headings), rows, numbers=headings)


def write_compliance(found: AxleCompliance, path: Path) -> Path:
    """Write the figures as a CSV file of one row; a second file has the units. Raises OutputError: it cannot be written."""
    return write_table(path, found.units, [[found.figures[name] for name in found.units]])


def plot_kinematics(found: AxleKinematics, title: str, folder: Path) -> list[Path]:
    """Write a picture a sweep as PNG files and return their paths: a panel a figure, a line a side or a spring."""
    return [_picture(found, name, f"{title}: {_TITLES[name]}", folder / f"{name}.png") for name in found.sweeps]


def _picture(found: AxleKinematics, name: str, title: str, path: Path) -> Path:
    from cutjoint.run.figures import Line, as_png, draw

    columns, leading, lines = found.sweeps[name], LEADING[name], []
    figures: dict[str, list[str]] = {}
    for column in columns:
        if column not in (leading, "left.travel", "right.travel"):
            figures.setdefault(column.rpartition(".")[2], []).append(column)
    x = _FOR_PEOPLE[found.units[leading]][0] * columns[leading]
    for figure, names in figures.items():
        scale, unit, _ = _FOR_PEOPLE[found.units[names[0]]]
        for n, column in enumerate(names if any(_varies(columns[c]) for c in names) else ()):
            style = "--" if 2 * n >= len(names) > 1 else "-"  # equal sides lie on each other
            side, y = column.rpartition(".")[0], scale * columns[column]
            lines.append(Line(x=x, y=y, label=side, unit=unit, panel=figure.replace("_", " "), style=style))
    x_label = _heading(leading, found.units[leading]).replace("\n", ", ")
    return write_whole(path, as_png(draw(lines, x_label=x_label, title=title, columns=3)))


def _varies(values: np.ndarray) -> bool:
    known = values[np.isfinite(values)]
    return known.size > 1 and bool(np.ptp(known) > 1e-9)
