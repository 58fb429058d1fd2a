"""Names of earlier versions in Python: they mean the same, and the new ones are reported."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import cutjoint
from cutjoint.commands.renamed import rename_arguments
from cutjoint.package.renamed import MEMBERS, NAMES
from cutjoint.run.results import FailureReport, MechanismState
from tests.conftest import MODELS


@pytest.mark.parametrize(("old", "new"), NAMES.items())
def test_names_of_the_package(old: str, new: str) -> None:
    with pytest.warns(FutureWarning, match=f"'{old}' is now '{new}'"):
        assert getattr(cutjoint, old) is getattr(cutjoint, new)


def test_keyword_arguments() -> None:
    with pytest.warns(FutureWarning, match="'opened' is now 'tunable'"):
        model = cutjoint.read_model(MODELS / "press.yaml", opened=["*.mass"])
    assert [p.name for p in model.parameters] == [
        p.name for p in cutjoint.read_model(MODELS / "press.yaml", tunable=["*.mass"]).parameters
    ]  # fmt: skip
    assert pickle.loads(pickle.dumps(cutjoint.read_model)) is cutjoint.read_model


def test_members_of_records() -> None:
    one = np.ones((1, 1))
    found = cutjoint.ForwardSensitivities(times=np.zeros(1), values=one, derivatives=one[None], outputs=("x",), by=("p",))
    with pytest.warns(FutureWarning, match="'slopes' is now 'derivatives'"):
        assert found.slopes is found.derivatives
    with pytest.warns(FutureWarning, match="'largest' is now 'maximum'"):
        assert found.largest[0] == found.maximum[0] == 1.0
    report = FailureReport(message="it stopped", time=1.0, step=2, element="pin", residual=1.0, advice="")
    with pytest.warns(FutureWarning, match="'what' is now 'summary'"):
        assert report.what == report.summary
    state = MechanismState(values={}, units={}, locking_forces={"pin.angle": (1.0, "N*m")})
    with pytest.warns(FutureWarning, match="'held' is now 'locking_forces'"):
        assert state.held == state.locking_forces


def test_old_members_have_new_ones() -> None:
    for name, members in MEMBERS.items():
        kind = getattr(cutjoint, name, None)
        for old, new in members.items() if kind is not None else ():
            known = {*dir(kind), *getattr(kind, "__dataclass_fields__", ())}
            assert {old, new} <= known, (name, old, new)


@pytest.mark.parametrize(("old", "new"), [
    ("compile a.yaml --open *.k --push arm --ground=front.*", "compile a.yaml --tunable *.k --external-wrench arm --terrain=front.*"),
    ("gradient a.yaml --objective rest --from-rest", "gradient a.yaml --objective equilibrium --from-equilibrium"),
    ("gradient a.yaml --objective=largest", "gradient a.yaml --objective=maximum"),
    ("kinematics a.yaml --turn 10mm", "kinematics a.yaml --steer-travel 10mm"),
    ("simulate a.yaml --loops compiled --beside b.csv --over c.html", "simulate a.yaml --loops embedded --compare b.csv --ghost c.html"),
])  # fmt: skip
def test_options_and_their_values(old: str, new: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert rename_arguments(old.split()) == new.split()
    assert "is now" in capsys.readouterr().err
