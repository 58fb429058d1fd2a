"""Questions that tests ask of pages: the place at which a point is seen, and that nothing complains."""

from __future__ import annotations

import re
from zlib import crc32

import numpy as np

from tests.conftest import ROOT
from tests.view.browser import Page
from tests.view.files import Array

#: The folder in which a person finds the pictures that tests have seen.
PICTURES = ROOT / "results" / "view"


def projected(page: Page, place: Array) -> Array:
    """The pixel of a place in a model whose up is z, from where the page's eye is."""
    eye = page.run("cutjoint.eye()")
    start, target = np.array(eye["from"]), np.array(eye["to"])
    width, height = eye["size"]
    back = (start - target) / np.linalg.norm(start - target)
    right = np.cross([0.0, 1.0, 0.0], back)
    right /= np.linalg.norm(right)
    x, y, z = place
    way = np.array([x, z, -y]) - start
    focal = height / 2 / np.tan(np.radians(eye["angle"]) / 2)
    depth = -way @ back
    return np.array([width / 2 + focal * (way @ right) / depth, height / 2 - focal * (way @ np.cross(back, right)) / depth])


def require_silence(page: Page) -> None:
    """Nothing complained, and nothing was asked for but the page itself and what it holds."""
    assert page.complaints == []
    assert page.requests
    assert [r for r in page.requests if not r.startswith(("file:", "data:", "blob:"))] == []
    assert {r for r in page.requests if r.startswith("file:")} <= {r for r in page.requests if r.endswith(".html")}


def part_of(page: str, name: str) -> str:
    """The text of an element with data."""
    begin, end = _place(page, name)
    return page[begin:end]


def with_part(page: str, name: str, text: str, *, is_sealed: bool = True) -> str:
    """A page with another text in an element with data, and its check sum if it is sealed."""
    begin, end = _place(page, name)
    page = page[:begin] + text + page[end:]
    return re.sub(f'(id="{name}" data-crc)="\\d+"', f'\\1="{crc32(text.encode())}"', page) if is_sealed else page


def _place(page: str, name: str) -> tuple[int, int]:
    found = re.search(f'<script type="[^"]*" id="{name}"[^>]*>([^<]*)</script>', page)
    assert found is not None
    return found.span(1)
