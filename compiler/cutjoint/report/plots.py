"""Plots of a run and of other runs as files: those that its scene defines, else one file for each dimension."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from cutjoint.model.records import Plot
from cutjoint.package.errors import RunError
from cutjoint.run.binary_tables import BINARY
from cutjoint.run.display import in_units
from cutjoint.run.figures import Line, as_png, draw, labelled
from cutjoint.run.result_files import write_whole
from cutjoint.run.results import TIME, Array, Trajectory, read_table

_DIMENSIONS = {"m": "position", "m/s": "velocity", "m/s^2": "acceleration", "rad": "angle", "rad/s": "angular velocity", "N": "force",
               "N*m": "torque", "": "without unit"}  # fmt: skip

#: Columns of other runs by name, the time among them, by the names of the runs.
Others = Mapping[str, Mapping[str, Array]]


def plot_run(
    run: Trajectory, title: str, folder: Path, plots: Sequence[Plot] = (), beside: Others | None = None, display: Sequence[str] = ()
) -> list[Path]:  # fmt: skip
    """Write the pictures of a run as PNG files and return their paths; other runs have lines ``beside`` its own.

    Axes have the units of ``display`` where these fit, else those of the columns.
    Without ``plots`` there is a picture for each dimension, a panel a quantity; elements of one name in several instances share a panel.
    """
    others = {name: (other, {n: unit for n, unit in run.units.items() if n in other}) for name, other in (beside or {}).items()}
    beside = {name: in_units(other, units, display)[0] for name, (other, units) in others.items()}
    columns, units = in_units(run.columns, run.units, display)
    own, run = run.units, replace(run, columns=columns, units=units)
    if plots:
        return [_chosen(run, title, plot, folder, beside) for plot in plots]
    groups: dict[str, dict[str, list[str]]] = {}
    for column, unit in own.items():
        *_, instance_or_element, quantity = ["", *column.rsplit(".", 2)]  # an input's name has no dot
        panel = f"{instance_or_element}.{quantity}" if column.count(".") > 1 else quantity
        groups.setdefault(unit, {}).setdefault(panel, []).append(column)
    return [_picture(run, title, unit, quantities, folder, beside) for unit, quantities in groups.items()]


def read_others(paths: Iterable[Path]) -> Others:
    """The tables of other runs, by the names of their files without endings. Raises RunError: a file is no table of a run."""
    found: dict[str, Mapping[str, Array]] = {}
    for path in paths:
        try:
            _require_table(path)
            t, columns = read_table(path)
        except (ValueError, LookupError, OSError) as error:
            raise RunError(f"--compare {path}: this is no table of a run: {error}") from None
        found[path.stem if path.stem not in found else str(path)] = {TIME: t, **columns}
    return found


def _require_table(path: Path) -> None:
    """Check that a file begins as the table of a run; ValueError otherwise."""
    if path.suffix in BINARY:
        return
    with path.open("rb") as file:
        if file.read(2) not in (b"t,", b"t\n"):
            raise ValueError("its first column is not t")


def _chosen(run: Trajectory, title: str, plot: Plot, folder: Path, beside: Others) -> Path:
    """A plot that a scene defines: a panel for each unit."""
    lines = [line for name in plot.y for line in _lines(run, name, plot.x, name, beside)]
    figure = draw(lines, x_label=labelled(plot.x, run.unit_of(plot.x)), title=f"{title}: {plot.name}")
    return write_whole(folder / f"{plot.name}.png", as_png(figure))


def _picture(run: Trajectory, title: str, unit: str, quantities: dict[str, list[str]], folder: Path, beside: Others) -> Path:
    dimension = _DIMENSIONS.get(unit, unit)
    lines = [
        line for quantity, columns in quantities.items() for column in columns
        for line in _lines(run, column, TIME, column.removesuffix(f".{quantity}"), beside, panel=quantity)
    ]  # fmt: skip
    figure = draw(lines, x_label="t [s]", title=f"{title}: {dimension}")
    path = folder / f"{dimension.replace(' ', '_').replace('/', '_').replace('*', '_').replace('^', '')}.png"
    return write_whole(path, as_png(figure))


def _lines(run: Trajectory, y: str, x: str, label: str, beside: Others, *, panel: str = "") -> Iterator[Line]:
    """The line of a column over another, and those of other runs that have both."""
    runs: Others = {"": run, **beside}
    for name, columns in runs.items():
        if x in columns and y in columns:
            yield Line(x=columns[x], y=columns[y], label=f"{label}, {name}" if name else label, unit=run.unit_of(y), panel=panel)
