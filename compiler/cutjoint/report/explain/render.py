"""Explanation -> Markdown by a template."""

from __future__ import annotations

import re
from dataclasses import dataclass

from cutjoint.emit.source import environment
from cutjoint.report.explain.latex import DIGITS
from cutjoint.report.explain.views import Table
from cutjoint.version import __version__


@dataclass(frozen=True, kw_only=True)
class Explanation:
    """The head of every explanation."""

    model: str
    scene: str
    method: str
    summary: Table
    version: str = __version__
    digits: int = DIGITS


def render(template: str, explanation: Explanation) -> str:
    """The text of an explanation, without runs of empty lines."""
    text = environment().get_template(template).render(e=explanation)
    return re.sub(r"\n{3,}", "\n\n", text).rstrip("\n") + "\n"
