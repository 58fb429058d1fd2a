"""From a study to what runs it: a library for each scene."""

from __future__ import annotations

from cutjoint.compile.folders import Standalone, lanes_break_even, make_standalone
from cutjoint.compile.pipeline import generate
from cutjoint.emit.classes import LANES
from cutjoint.formulate.inputs import input_parameters
from cutjoint.model.records import Scene
from cutjoint.program.records import Program
from cutjoint.run.errors import RunError
from cutjoint.sweeps.code import with_runs
from cutjoint.sweeps.kernel import Kernel, find_target
from cutjoint.sweeps.records import Study


def build_kernels(study: Study, *, lanes: bool | None = None) -> tuple[Kernel, ...]:
    """Compile a study for each of its scenes, or find the libraries in the cache.

    Runs go in ``lanes`` where steps can and there are so many runs that these pay (`lanes_break_even`), or as is said, unless those side by
    side have too many rows.

    Raises:
        TopologyError, NoInertiaError, GuideError, RunError: the model is wrong, or the study asks for what its library does not have.
        ToolchainError: the C++ side failed.
    """
    return tuple(_build(study, scene, lanes) for scene in study.scenes)


def _build(study: Study, scene: Scene, lanes: bool | None) -> Kernel:
    generated = generate(study.model, scene, study.outputs, method=study.method)
    alone = make_standalone(generated, integrator=study.integrator)
    rows, row_step = _count_rows(scene, alone)
    may = alone.fits_lanes and rows * LANES <= _MOST_ROWS
    if may and (_pays(study, generated.program, alone) if lanes is None else lanes):
        alone = make_standalone(generated, integrator=study.integrator, side_by_side=True)
    equations = generated.equations
    start = equations.mechanism
    names = {
        "parameter": [p.name for p in equations.parameters], "input": [p.name for p in input_parameters(study.model)],
        "coordinate": start.coordinate_names, "speed": start.speed_names,
    }  # fmt: skip
    ready = with_runs(alone, study, scene, equations.columns, names)
    return Kernel(
        model=alone.name, scene=scene.name, source=ready.library.digest,
        content=ready.build_library(study.flags).read_bytes(), target=find_target(study.flags), lanes=max(1, ready.lanes),
        series=len(study.series), rows=rows, row_step=row_step, steps=alone.settings,
    )  # fmt: skip


#: Rows of a run at most, and of all that go side by side: a chunk of runs holds them all in memory.
_MOST_ROWS = 10_000_000


def _count_rows(scene: Scene, alone: Standalone) -> tuple[int, float]:
    """The number of rows of a run, and their distance, s."""
    row_step, end, rows = float(alone.run_file.output_step), float(alone.run_file.end), 1
    while (rows - 1) * row_step < end * (1 - 1e-12):
        rows += 1
    if rows > _MOST_ROWS:
        raise RunError(f"{scene.span}: scene '{scene.name}': {rows} rows are more than {_MOST_ROWS}; give the study a longer output_step")
    return rows, row_step


def _pays(study: Study, program: Program, alone: Standalone) -> bool:
    """Return whether a study has so many steps in a scene that lanes pay."""
    steps = float(alone.run_file.end) / float(alone.run_file.settings.dt)
    return lanes_break_even(program.operations("evaluate"), steps * study.runs / len(study.scenes))
