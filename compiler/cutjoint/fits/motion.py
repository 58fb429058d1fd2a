"""Measured motions: joints that follow smoothed columns, and the forces of the drives that these motions need."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import sympy
from scipy.interpolate import BSpline
from scipy.sparse import csr_matrix, diags_array
from scipy.sparse.linalg import spsolve

from cutjoint.elements.gear import FORCE_UNITS
from cutjoint.fits.records import Array
from cutjoint.model.expressions.operations import Term
from cutjoint.model.expressions.parse import quantity_symbol
from cutjoint.model.expressions.units import measure
from cutjoint.model.records import Binding, Joint, Model, Output, Parameter, Scene
from cutjoint.package.errors import RunError
from cutjoint.run.scenes import in_scene
from cutjoint.tasks.inverse import guide_terms, with_guide_forces

#: The weight of third differences, which carries a spline over gaps without samples, as a share of that of a sample.
_BRIDGE = 1e-6

#: Intervals of a spline before the first and after the last sample.
_MARGIN = 2


@dataclass(frozen=True, kw_only=True)
class Followed:
    """A model whose joints follow inputs, by joint, and their drives' forces: terms, with outputs of which these consist."""

    model: Model
    scene: Scene
    inputs: Mapping[str, Parameter]
    drives: Mapping[str, tuple[Term, tuple[Output, ...]]]


def follow(model: Model, scene: Scene, names: tuple[str, ...]) -> Followed:
    """Let joints follow inputs in a scene. Raises RunError: a joint is not in the model, or has not just one coordinate."""
    joints = {joint.name: joint for joint in model.joints}
    for name in names:
        if name not in joints or len(joints[name].element.coordinates) != 1:
            raise RunError(f"'{name}' is no joint with one coordinate" if name in joints else f"there is no joint '{name}'")
    inputs = {}
    for joint in map(joints.__getitem__, names):
        own, unit = f"motion_of_{joint.name.replace('.', '_')}", joint.element.units[joint.element.coordinates[0]]
        symbol = sympy.Symbol(f"p_{own}", real=True)
        inputs[joint.name] = Parameter(name=own, symbol=symbol, value=0.0, unit=unit, binding=Binding.INPUT, span=joint.span)
    scene = replace(scene, guides={**scene.guides, **{name: (p.symbol,) for name, p in inputs.items()}})
    model = with_guide_forces(in_scene(replace(model, parameters=(*model.parameters, *inputs.values())), scene), names)
    return Followed(model=model, scene=scene, inputs=inputs, drives={f"{name}.drive": _drive(model, joints[name]) for name in names})


def _drive(model: Model, joint: Joint) -> tuple[Term, tuple[Output, ...]]:
    terms = guide_terms(model, joint)
    value = sympy.Add(*(factor * quantity_symbol(o.element, o.quantity) for o, factor in terms))
    unit = FORCE_UNITS[joint.element.units[joint.element.coordinates[0]]]
    return Term(value, measure(1.0, unit).dimension), tuple(o for o, _ in terms)


def smooth(t: Array, values: Array, rates: Array | None, spacing: float) -> tuple[BSpline, Array]:
    """The cubic spline of least squares with even knots, through values, NaN where missing, and rates; and the RMS of both residuals.
    Values and rates are weighed by their noise, which the residuals show."""
    knots = t.min() + spacing * np.arange(-3 - _MARGIN, np.ceil(np.ptp(t) / spacing) + 4 + _MARGIN)
    rows = [(values, BSpline.design_matrix(t, knots, 3, extrapolate=True))]
    if rates is not None:
        fewer = BSpline.design_matrix(t, knots[1:-1], 2, extrapolate=True)
        rows.append((rates, fewer @ diags_array([-1.0, 1.0], offsets=[0, 1], shape=(fewer.shape[1], fewer.shape[1] + 1)) / spacing))
    seen = [(y[np.isfinite(y)], csr_matrix(a)[np.isfinite(y)]) for y, a in rows]
    n = seen[0][1].shape[1]
    third = diags_array([-1.0, 3.0, -3.0, 1.0], offsets=[0, 1, 2, 3], shape=(n - 3, n))
    noise = np.array([1.0, np.inf][: len(seen)])
    for _ in range(len(seen) + 1):
        weights = (noise[0] / noise) ** 2
        normal = _BRIDGE * (third.T @ third) + sum(w * (a.T @ a) for w, (_, a) in zip(weights, seen, strict=True))
        found = spsolve(csr_matrix(normal).tocsc(), sum(w * (a.T @ y) for w, (y, a) in zip(weights, seen, strict=True)))
        noise = np.array([np.sqrt(np.mean((y - a @ found) ** 2)) + 1e-12 for y, a in seen])
    return BSpline(knots, found, 3), noise
