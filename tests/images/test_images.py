"""Images of mechanisms move as these do: turned, mirrored, with other names, orders, cuts and units.  `make images` tries all of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.model.read import read_model, read_model_text
from cutjoint.model.records import Model, Numerics
from cutjoint.run.results import Trajectory
from cutjoint.run.simulation import simulate
from tests.conftest import MODELS
from tests.images.images import TRANSFORMATIONS, Array, Image, original, outputs, scaled
from tests.mechanisms import one_degree, overconstrained
from tests.mechanisms.rods import rods_text
from tests.mechanisms.sources import TEXTS

#: The tolerance of steps, relative and absolute, and the share of the mechanism's extent by which places may differ: those of coarse steps
#: near a start at rest gather a hundred times the tolerance.
TOLERANCE, APART = 1e-8, 2e-6

_TEXTS: dict[str, Callable[[], str]] = {
    **TEXTS, **{f"spatial {seed}": partial(one_degree.spatial, seed) for seed in range(4)}, "rods": partial(rods_text, mass=0.1),
    "massless rods": rods_text, "light rods": partial(rods_text, 3, mass=1e-6),
    "Bennett": partial(overconstrained.skew_chain_text, overconstrained.BENNETT, "{end: 1, output_step: 0.1}"),
}  # fmt: skip
SUBJECTS = (*(path.stem for path in sorted(MODELS.glob("*.yaml"))), *_TEXTS)

#: What `make test` tries.
SAMPLE = {
    ("andrews", "turned"), ("four_bar", "mirrored"), ("slider_crank", "shifted"), ("gantry", "split"), ("four_bar", "renamed"),
    ("rods", "scaled by 1e-05"), ("rods", "scaled by 1000"), ("rods", "recut"), ("spatial 1", "permuted"), ("flyball", "swapped"),
    ("Bennett", "scaled by 10000"), ("spatial 2", "other time"), ("massless rods", "scaled by 0.0001"),
    ("axle", "scaled by 1e-05"), ("excavator", "scaled by 10000"),
}  # fmt: skip


def _read(subject: str) -> Model:
    return read_model_text(_TEXTS[subject](), "model.yaml") if subject in _TEXTS else read_model(Path(MODELS / f"{subject}.yaml"))


@cache
def _image(subject: str) -> Image | None:
    """A model in its first scene, as far as 0.3 s."""
    model = _read(subject)
    if not model.scenes:
        return None
    image = original(model, next(iter(model.scenes.values())))
    end = 0.3 if image is None else min(0.3, image.scene.end)
    return image and replace(image, scene=replace(image.scene, end=end, output_step=end / 10))


def _run(image: Image, base: Image, method: str = "recursive", **how: Any) -> tuple[Array, Trajectory]:
    """The places (rows, bodies, 3) of the original's bodies, as the run of an image has them."""
    columns = outputs(base.model, image.names)
    scene = replace(image.scene, outputs=columns, numerics=Numerics())
    run = simulate(compile_interpreted(image.model, scene, outputs=columns, method=method), check=False, **how)
    assert run.failure is None, str(run.failure)
    places = np.array([run.columns[output.column] for output in columns]).reshape(-1, 3, len(run.t))
    return image.back(places.transpose(2, 0, 1)), run


@cache
def _original(subject: str) -> tuple[Array, Trajectory]:
    image = _image(subject)
    assert image is not None
    return _run(image, image, integrator="dormand-prince", tolerance=TOLERANCE)


def _cases() -> list[Any]:
    cases = [(subject, name) for subject in SUBJECTS for name in TRANSFORMATIONS]
    return [case if case in SAMPLE else pytest.param(*case, marks=pytest.mark.heavy) for case in cases]


@pytest.mark.parametrize(("subject", "transformation"), _cases())
def test_an_image_moves_as_its_original(subject: str, transformation: str) -> None:
    """Where a transformation knows how the model looks in its image, as it does in all cases of the sample."""
    base = _image(subject)
    image = None if base is None else TRANSFORMATIONS[transformation](base)
    if base is None or image is None:
        assert (subject, transformation) not in SAMPLE
        return
    places, run = _original(subject)
    there, of_image = _run(image, base, integrator="dormand-prince", tolerance=TOLERANCE)
    extent = max(1.0, float(np.ptp(places, axis=(0, 1)).max()))
    assert np.abs(there - places).max() < APART * extent
    assert of_image.evaluations < (2 if transformation.startswith("scaled") else 3) * run.evaluations + 100


@pytest.mark.parametrize("length", [1e-5, 1e-2, 1e4])
@pytest.mark.parametrize("method", ["recursive", "recursive-newton", "augmented", "classical"])
def test_equal_steps_are_the_same_in_all_units_of_length(method: str, length: float) -> None:
    """Weights of equations, ends of iterations and penalties that steps limit follow the mechanism's arm."""
    base = _image("four_bar")
    assert base is not None
    image = scaled(base, length=length)
    assert image is not None
    (places, run), (there, of_image) = (
        _run(one, base, method, integrator="trapezoidal", dt=one.scene.end / 100, error=False) for one in (base, image)
    )
    assert np.abs(there - places).max() < 1e-8
    assert of_image.evaluations < 2 * run.evaluations


@pytest.mark.parametrize("length", [1e-5, 100, 1e4])
@pytest.mark.parametrize("subject", ["gantry", "light rods"])
def test_adaptive_steps_are_the_same_in_all_units_of_length(subject: str, length: float) -> None:
    """Absolute tolerances, the first step, multipliers that end passes and closed loops follow the mechanism's arm."""
    base = _image(subject)
    assert base is not None
    image = scaled(base, length=length)
    assert image is not None
    (places, run), (there, of_image) = (_run(one, base, integrator="dormand-prince", tolerance=TOLERANCE) for one in (base, image))
    assert np.abs(there - places).max() < APART * max(1.0, float(np.ptp(places, axis=(0, 1)).max()))
    assert of_image.evaluations < 2 * run.evaluations
