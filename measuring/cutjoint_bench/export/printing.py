"""Printing of exports: their templates, and lists of numbers in C++."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from pathlib import Path

import jinja2

from cutjoint.emit.source import make_environment

#: Their folder, with the files that are the same for all models.
TEMPLATES = Path(__file__).resolve().parent.parent / "templates" / "export"


@cache
def environment() -> jinja2.Environment:
    """The environment in which they are rendered."""
    return make_environment(TEMPLATES)


def vector(values: Iterable[float]) -> str:
    """Numbers as a braced list."""
    return f"{{{', '.join(repr(float(v)) for v in values)}}}"
