"""The choice of steps that end at events: the option, the scene's word, the default, and the setting in the run file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from cutjoint.cli import main
from cutjoint.compile.pipeline import compile_model
from cutjoint.methods import INTEGRATORS, METHODS, Events
from cutjoint.package.errors import RunError
from cutjoint.run.artifact import Artifact, make_simulator_run
from cutjoint.run.settings import Options
from cutjoint.run.simulation import simulate
from cutjoint.tasks.realtime import run_in_real_time
from cutjoint_bench.generic.artifact import compile_generic_model
from tests.conftest import MODELS, needs_cpp, with_heavy
from tests.mechanisms.bouncing import bouncing_text
from tests.physics.simulation import with_numerics

pytestmark = needs_cpp

PENDULUM = MODELS / "pendulum.yaml"

#: Simulators without events of their own.
OTHERS: Mapping[str, Callable[[Path], Artifact]] = {
    "augmented": partial(compile_model, method="augmented"), "classical": partial(compile_model, method="classical"),
    "generic": compile_generic_model,
}  # fmt: skip


def reported(artifact: Artifact, **how: Any) -> bool | None:
    """The setting of events in the run file; None for nothing."""
    found: bool | None = make_simulator_run(artifact, Options(**how)).run_file.settings.events
    return found


@pytest.mark.parametrize("method", [m.name for m in METHODS.values() if m.events])
def test_steps_end_at_events_as_is_usual_or_as_asked(method: str) -> None:
    """The option comes before the scene's word, and that before the default of the integrator."""
    usual = compile_model(PENDULUM, method=method)
    for integrator in (i.name for i in INTEGRATORS.values() if method in i.methods and i.events is not None):
        assert reported(usual, integrator=integrator) is (INTEGRATORS[integrator].events is Events.LOCATED)
        for said, other in (("located", "crossed"), ("crossed", "located")):
            scene = with_numerics(usual, events=said)
            assert reported(scene, integrator=integrator) is reported(usual, integrator=integrator, events=said) is (said == "located")
            assert reported(scene, integrator=integrator, events=other) is (other == "located")


@pytest.mark.parametrize("name", with_heavy(OTHERS, "generic"))
def test_a_scenes_events_are_not_meant_for_other_methods_and_generic_solvers(name: str) -> None:
    artifact = OTHERS[name](PENDULUM)
    assert reported(artifact) is reported(artifact, events="crossed") is reported(with_numerics(artifact, events="located")) is None
    with pytest.raises(RunError, match="events are located by generated code of the methods recursive and recursive-newton"):
        simulate(artifact, events="located")


def test_what_else_is_refused() -> None:
    artifact = compile_model(PENDULUM)
    with pytest.raises(RunError, match="no events 'found'; there is located, crossed"):
        simulate(artifact, events="found")
    with pytest.raises(RunError, match="the integrator reference steps across events"):
        simulate(artifact, integrator="reference", events="located")
    with_reference = replace(with_numerics(artifact, events="located"), additions=("reference",))
    assert reported(with_reference, integrator="reference") is None


def test_steps_of_fixed_cost_go_over_events() -> None:
    artifact = compile_model(PENDULUM)
    assert reported(artifact, iterations=3) is reported(with_numerics(artifact, events="located"), iterations=3, events="crossed") is False
    with pytest.raises(RunError, match="a fixed number of iterations needs events: crossed"):
        simulate(artifact, iterations=3, events="located")
    with pytest.raises(RunError, match="a fixed number of iterations needs events: crossed"):
        run_in_real_time(with_numerics(artifact, events="located"), iterations=3)


def test_the_command_counts_events_where_they_are_located(tmp_path: Path) -> None:
    """The second run of each is one that is kept."""
    model = tmp_path / "model.yaml"
    model.write_text(bouncing_text(0, 0.5), encoding="utf-8")
    arguments = ["simulate", str(model), "--integrator", "rk4", "--verbose", "--out", str(tmp_path / "out.csv")]
    for more, events in 2 * (([], True), (["--events", "crossed"], False)):
        done = CliRunner().invoke(main, [*arguments, *more], catch_exceptions=False)
        assert done.exit_code == 0
        assert ("4: floor 4" in done.output) is events
