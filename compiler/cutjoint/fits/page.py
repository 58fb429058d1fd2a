"""The page of a fit: parameters, the verdict, and of each signal the data beside the model, residuals and their autocorrelation."""

import base64
from collections.abc import Iterator

import jinja2
import numpy as np

from cutjoint.fits.fit import Fit, SignalResult, describe
from cutjoint.package.locations import templates_folder
from cutjoint.run.figures import Line, as_png, draw


def make_page(fit: Fit) -> str:
    """The page as HTML, which holds its pictures."""
    loader = jinja2.FileSystemLoader(templates_folder() / "fit")
    environment = jinja2.Environment(loader=loader, undefined=jinja2.StrictUndefined, autoescape=True, trim_blocks=True, lstrip_blocks=True)
    values = zip(fit.names, fit.units, fit.start, fit.values, fit.intervals, strict=True)
    page: str = environment.get_template("page.html.jinja").render(
        title=f"fit of {fit.study.file}", verdict=fit.verdict, faults=fit.faults,
        parameters=[(n, u, f"{a:.6g}", f"{x:.8g}", f"{low:.6g}", f"{high:.6g}") for n, u, a, x, (low, high) in values],
        open=[describe(x) for x in (*fit.after.open, *fit.after.nearly_open)], names=fit.names,
        correlations=[[f"{x:.2f}" for x in row] for row in fit.correlations], signals=fit.signals,
        pictures=[base64.b64encode(picture).decode() for picture in _pictures(fit.signals)],
    )  # fmt: skip
    return page


def _pictures(signals: tuple[SignalResult, ...]) -> Iterator[bytes]:
    for s in signals:
        lines = [Line(x=s.times, y=s.measured, label="measured", unit=s.unit, panel=s.signal)]
        lines.append(Line(x=s.times, y=s.predicted, label="model", unit=s.unit, panel=s.signal))
        lines.append(Line(x=s.times, y=s.measured - s.predicted, label="residual", unit=s.unit, panel="residual"))
        yield as_png(draw(lines, x_label="t [s]", title=f"{s.experiment}{', validation' * s.validation}"))
        lags = np.arange(1.0, len(s.autocorrelation) + 1)
        if len(lags):
            bound, panel = np.full(len(lags), 1.96 / np.sqrt(s.samples)), "autocorrelation of the residual"
            bounds, both = np.concatenate([bound, [np.nan], -bound]), np.concatenate([lags, [np.nan], lags])
            lines = [Line(x=lags, y=s.autocorrelation, label="residual", unit="", panel=panel)]
            lines.append(Line(x=both, y=bounds, label="95 % of white noise", unit="", panel=panel))
            yield as_png(draw(lines, x_label="lag, samples"))
