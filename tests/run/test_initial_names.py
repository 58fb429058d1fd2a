"""A name of an initial value that is no parameter: the message names the constant of the file."""

from __future__ import annotations

import pytest

from cutjoint.package.errors import RunError
from cutjoint.run.run_file import parameter_values
from cutjoint.topology.reading import read_model_text
from tests.conftest import ROOT

TEXT = (ROOT / "models/press.yaml").read_text(encoding="utf-8")


def test_the_message_names_the_constant_of_the_scene() -> None:
    with pytest.raises(RunError) as error:
        parameter_values(read_model_text(TEXT, "press.yaml"), {"pin.angle_rate": 1.0})
    name = str(error.value).partition("--tunable ")[2].split()[0]
    assert name == "turn.rates.pin.angle_rate"
    assert parameter_values(read_model_text(TEXT, "press.yaml", tunable=[name]), {name: 1.0})[name] == 1.0
