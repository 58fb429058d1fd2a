"""Explanation -> Markdown by a template."""

from __future__ import annotations

import re
from dataclasses import dataclass

import jinja2

from cutjoint.locations import templates_folder
from cutjoint.report.explain.latex import DIGITS
from cutjoint.report.explain.views import Table
from cutjoint.version import __version__


@dataclass(frozen=True, kw_only=True)
class Explanation:
    """What every explanation prints first."""

    model: str
    scene: str
    method: str
    summary: Table
    version: str = __version__
    digits: int = DIGITS


def render(template: str, explanation: Explanation) -> str:
    """The text of an explanation, without runs of empty lines."""
    text = _environment().get_template(template).render(e=explanation)
    return re.sub(r"\n{3,}", "\n\n", text).rstrip("\n") + "\n"


def _environment() -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(templates_folder()), undefined=jinja2.StrictUndefined, trim_blocks=True,
        lstrip_blocks=True, keep_trailing_newline=True, autoescape=False,
    )  # fmt: skip
