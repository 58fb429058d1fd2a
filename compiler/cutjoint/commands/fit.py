"""`cutjoint fit`."""

from pathlib import Path

import click

from cutjoint.commands import options, table
from cutjoint.package.errors import RunError
from cutjoint.report import tables
from cutjoint.run.outputs import require_apart
from cutjoint.run.result_files import write_whole


@table.command("fit")
def command(
    fit_study: Path, out: Path | None, model_out: Path | None, view: Path | None, design: Path | None, scheduler: str | None,
) -> None:  # fmt: skip
    """Fit numbers of models to measurements as STUDY asks, and report what the data do not determine.

    A repeated call continues starts, a bootstrap and profiles that were interrupted.
    Exit status: 0 identified, 3 not converged, 4 not identified, 5 residual not white.
    """
    from cutjoint.fits.fit import Solver
    from cutjoint.fits.page import make_page
    from cutjoint.fits.reading import read_fit
    from cutjoint.fits.writing import as_json, rewrite_model
    from cutjoint.sweeps.cluster import require_scheduler

    files = [("--out", out), ("--model", model_out), ("--view", view), ("--scheduler", scheduler)]
    if design is not None:
        if given := [option for option, path in files if path is not None]:
            raise click.UsageError(f"{given[0]} is of a fit; --design makes none")
        _design(fit_study, design)
        return
    out = Path(f"{fit_study.stem}.json") if out is None else out
    study = read_fit(fit_study)
    if scheduler is not None:
        if not study.tries:
            raise RunError("--scheduler is for starts, a bootstrap and profiles: the study has none of them")
        require_scheduler(scheduler)
    models = {e.model.span.file: e.model for e in study.experiments}
    ends = ["", *(f"-{i}" for i in range(2, len(models) + 1))]
    written = [] if model_out is None else [("--model", model_out.with_name(f"{model_out.stem}{end}{model_out.suffix}")) for end in ends]
    read = {"the study": fit_study, **{f"the model {file}": Path(file) for file in models}}
    require_apart(read, documents=[("--out", out), ("--view", view), *written])
    found = Solver(study, lambda text: options.err.print(text)).solve(out, scheduler)
    write_whole(out, as_json(found))
    parameters = (
        (name, unit, f"{start:.6g}", f"{value:.8g}", f"{low:.6g} to {high:.6g}")
        for name, unit, start, value, (low, high) in zip(found.names, found.units, found.start, found.values, found.intervals, strict=True)
    )
    headings = ("parameter", "unit", "start", "value", "95 % interval")
    options.out.print(tables.table("parameters", headings, parameters, numbers=("start", "value"), no_wrap=True))
    signals = (
        (s.experiment + ", validation" * s.validation, s.signal, str(s.samples), f"{s.rms:.4g}", f"{s.explained:.4f}",
         "-" if s.p_value is None else f"{s.p_value:.3g}")
        for s in found.signals
    )  # fmt: skip
    figures = ("samples", "RMS of residual", "explained", "white noise: p")
    options.out.print(tables.table("signals, SI units", ("experiment", "signal", *figures), signals, numbers=figures, no_wrap=True))
    for (_, path), model in zip(written, models.values(), strict=False):
        options.out.print(f"model: {write_whole(path, rewrite_model(model, found.numbers))}")
    if view is not None:
        options.out.print(f"view: {write_whole(view, make_page(found))}")
    options.out.print(f"verdict: {found.verdict}, {found.iterations} iterations, {found.runs} runs; results: {out}")
    options.out.print_each(f"  {fault}: {words}" for fault, words in found.faults.items())
    if found.status:
        raise SystemExit(found.status)


def _design(study: Path, file: Path) -> None:
    from cutjoint.fits.design import design_experiment
    from cutjoint.fits.fit import describe

    found = design_experiment(study, lambda text: options.err.print(text))
    for names, before, after in found.weak:
        options.out.print(f"information (1/variance, shares of sizes) {before:.4g} before, {after:.4g} after: {describe(names)}")
    options.out.print_each(f"no such inputs determine: {describe(names)}" for names in found.open)
    lines = zip(*(map(repr, column.tolist()) for column in found.table.values()), strict=True)
    write_whole(file, "\n".join(map(",".join, [tuple(found.table), *lines])) + "\n")
    options.out.print(f"smallest eigenvalue: {found.before:.4g} before, {found.after:.4g} after; inputs: {file}")
