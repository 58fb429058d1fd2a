"""Licences: what carries code of others or of the runtime has their notices, and the wheel says so."""

from __future__ import annotations

import re
import tomllib

import numpy as np
import pytest

from cutjoint.view.page import Drive, make_page
from tests.conftest import ROOT
from tests.fmu.slaves import fmu_of
from tests.standalone.c_exports import standalone_of

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
LICENCES = [(ROOT / name).read_text(encoding="utf-8") for name in PROJECT["license-files"]]
APACHE, MUSL = ((ROOT / name).read_text(encoding="utf-8") for name in ("LICENSE", "runtime/libm/COPYRIGHT"))


def test_the_wheel_names_all_licences_and_has_their_texts() -> None:
    assert PROJECT["license"].split(" AND ") == ["Apache-2.0", "MIT"]
    assert "Apache License" in LICENCES[0]
    assert all(re.search("MIT [Ll]icense", text) for text in LICENCES[1:])


_OWNER = re.compile(r"Copyright (?:\(c\)|©)[ \d,-]*(?:by )?([A-Z][\w.]+(?: [A-Z][\w.]+)?)")


@pytest.mark.parametrize("folder", ["compiler", "runtime", "templates"])
def test_owners_of_code_of_others_are_named_in_a_licence(folder: str) -> None:
    """Whoever a file names as an owner stands in a text that the wheel has."""
    known = " ".join(LICENCES)
    for file in (ROOT / folder).rglob("*"):
        if file.is_file() and file.suffix in (".c", ".h", ".hpp", ".js", ".css", ".py", ".jinja", ".txt"):
            for owner in _OWNER.findall(file.read_text(encoding="utf-8")):
                assert owner.rstrip(".") in known, (file, owner)


def test_exported_code_has_the_licence_of_the_runtime() -> None:
    alone = standalone_of("pendulum")
    assert alone.files["LICENSE"] == APACHE
    assert alone.module_files["LICENSE.musl"] == MUSL
    assert fmu_of("pendulum", 2).license.endswith(APACHE)


@pytest.mark.parametrize("drive", [None, Drive(module=b"", facts={})])
def test_pages_with_a_module_have_the_notice_of_musl(drive: Drive | None) -> None:
    camera = {"direction": [1, 1, 1], "extent": 2.0, "floor": -1.0, "road": False, "follow": ""}
    page = make_page(title="a", scene="b", note="", bodies=[], glb=b"", t=np.zeros(1), columns=[], camera=camera, drive=drive)
    assert (MUSL in page) == (drive is not None)
