"""Pages that are damaged after they were written: each says so in words, and no script fails."""

from __future__ import annotations

import base64
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.view.browser import Page
from tests.view.pages import part_of, with_part
from tests.view.test_page import hostile_page

Damage = Callable[[str], str]


def flipped(name: str, *, is_sealed: bool = False) -> Damage:
    """Another letter in the middle of an element's text."""

    def damage(page: str) -> str:
        text = part_of(page, name)
        middle = len(text) // 2
        return with_part(page, name, text[:middle] + ("B" if text[middle] == "A" else "A") + text[middle + 1 :], is_sealed=is_sealed)

    return damage


def gltf(old: bytes, new: bytes) -> Damage:
    """A .glb file in which something stands for something else of the same length; its check sum fits."""

    def damage(page: str) -> str:
        glb = base64.b64decode(part_of(page, "glb"))
        assert old in glb
        return with_part(page, "glb", base64.b64encode(glb.replace(old, new, 1)).decode())

    return damage


@pytest.mark.parametrize(("damage", "said"), [
    (flipped("about"), "its file is damaged, in 'about'"),
    (flipped("glb"), "its file is damaged, in 'glb'"),
    (flipped("table"), "its file is damaged, in 'table'"),
    (lambda page: with_part(page, "glb", part_of(page, "glb")[:1000], is_sealed=False), "its file is damaged, in 'glb'"),
    (lambda page: page.replace('id="glb"', 'id="gl"'), "its file is damaged, in 'glb'"),
    (lambda page: with_part(page, "about", "{"), "SyntaxError"),
    (lambda page: with_part(page, "glb", "!"), "InvalidCharacterError"),
    (lambda page: page.replace('id="picture"', 'id="pict"'), "TypeError"),
    (gltf(b'"glTF'[1:], b"glTX"), "Error"),
    (gltf(b'"children":[1,', b'"children":[0,'), "RangeError"),
    (gltf(b'"bufferView":0', b'"bufferView":Z'), "Error"),
    (gltf(b'"componentType":5126', b'"componentType":9999'), "Error"),
])  # fmt: skip
def test_a_page_says_what_is_wrong_with_it(damage: Damage, said: str, browser: Page, tmp_path: Path) -> None:
    file = hostile_page(tmp_path / "page.html")
    file.write_text(damage(file.read_text(encoding="utf-8")), encoding="utf-8")
    assert not browser.try_to_open(file)
    assert browser.errors == []
    notice = browser.run("document.querySelector('[role=alert]#notice').innerText")
    assert notice.startswith("This page cannot be shown: ")
    assert said in notice
    assert notice.endswith(". Write it anew.")


@pytest.mark.parametrize("damage", [
    lambda page: page[: page.index("<main>")], lambda page: page[: page.rindex("<script>") + 400],
    lambda page: page.replace("'use strict';", "'use strict' ;"),
], ids=["cut off", "cut in its script", "another script"])  # fmt: skip
def test_a_page_whose_script_cannot_say_it_has_the_notice(damage: Damage, browser: Page, tmp_path: Path) -> None:
    file = hostile_page(tmp_path / "page.html")
    file.write_text(damage(file.read_text(encoding="utf-8")), encoding="utf-8")
    assert not browser.try_to_open(file)
    assert browser.errors == []
    notice = browser.run("document.getElementById('notice').innerText")
    assert notice == "This page is being read. If this line stays, no script runs here, or the file is damaged: write it anew."
    browser.complaints.clear()


def test_a_sound_page_has_no_notice(browser: Page, tmp_path: Path) -> None:
    assert browser.try_to_open(hostile_page(tmp_path / "page.html"))
    assert browser.run("getComputedStyle(document.getElementById('notice')).display") == "none"


def test_an_event_that_is_no_scripts_error_is_none(browser: Page, tmp_path: Path) -> None:
    browser.open(hostile_page(tmp_path / "page.html"))
    browser.run("window.dispatchEvent(new ErrorEvent('error', { message: 'ResizeObserver loop completed' }))")
    assert browser.run("document.body.dataset.ready") == "yes"


def test_an_error_later_is_said_too(browser: Page, tmp_path: Path) -> None:
    browser.open(hostile_page(tmp_path / "page.html"))
    browser.run("requestAnimationFrame(() => { throw new Error('much later.'); })")
    browser.settle()
    assert browser.run("document.getElementById('notice').innerText") == "This page cannot be shown: Error: much later. Write it anew."
    assert browser.errors == []
