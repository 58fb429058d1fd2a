"""Ill-conditioned loops, and axes nearly parallel or perpendicular, where exact ones would give a mechanism more degrees of freedom.
Rounded numbers in a file cause such axes: a planar loop is then not planar, and rigid. Points that are slightly off barely lock a mechanism
without degrees of freedom.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import degrees

import numpy as np
import sympy

from cutjoint.analysis.closing import close_loops, design_coordinates
from cutjoint.analysis.mobility import Mobility, find_mobility
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.model.records import Joint, Model
from cutjoint.topology.build import build_topology
from cutjoint.topology.geometry import TOLERANCE, Array, JointGeometry, design_jacobian, evaluate, loop_condition
from cutjoint.topology.records import Topology, TreeJoint
from cutjoint.topology.search import Choice, Option
from cutjoint.topology.spanning_tree import loops_of

#: Axes closer than the first angle (rad) to parallel or perpendicular may have been meant so; those closer than the second one are.
_NEAR, _SAME = 0.01, 1e-10
_SHOWN = 3  #: the number of named axes

Loops = Sequence[tuple[Joint, Sequence[TreeJoint]]]
#: A rate of violation below this share of the mechanism's size (at most 1 m) at a speed of 1 m/s or rad/s barely locks it.
_BARELY = 0.01


@dataclass(frozen=True, kw_only=True)
class SkewAxis:
    """An axis that is ``angle`` (rad) from parallel, or perpendicular, to that of ``other``; ``intended`` (3,) is exactly so."""

    joint: Joint
    other: Joint
    is_square: bool
    angle: float
    intended: Array

    def __str__(self) -> str:
        wanted = "square" if self.is_square else "parallel"
        return f"'{self.joint.name}' ({self.joint.span}) is {degrees(self.angle):.2g} deg from {wanted} to '{self.other.name}'"

    @property
    def advice(self) -> str:
        """The line to write."""
        x, y, z = self.intended
        if np.abs(self.intended).max() == 1.0:
            return f"axis: [{x:g}, {y:g}, {z:g}] at '{self.joint.name}'"
        return f"an axis at '{self.joint.name}' that is {'square to' if self.is_square else 'just'} that of '{self.other.name}'"


def describe_skew(equations: RecursiveEquations, mobility: Mobility) -> str:
    """The axes whose small errors reduce the degrees of freedom, with a remedy; "" where there are none."""
    topology = equations.topology
    geometry, found = JointGeometry(model=topology.model), list[SkewAxis]()
    for loops in _groups(list(loops_of(topology.tree, topology.cuts).items()), topology.cuts):
        skew = list(_find_skew(topology.model, loops))
        if skew and _rank(JointGeometry(model=topology.model), loops, skew) < _rank(geometry, loops, ()):
            found += skew
    if not found:
        return ""
    exact = replace(topology.model, joints=tuple(_exact(j, found) for j in topology.model.joints))
    freedom = find_mobility(formulate_recursive(build_topology(exact), equations.scene, ())).degrees_of_freedom
    if not freedom > mobility.degrees_of_freedom:
        return ""
    more = f", and {len(found) - _SHOWN} more" if len(found) > _SHOWN else ""
    return (
        f"axes are slightly off: {'; '.join(map(str, found[:_SHOWN]))}{more}; exact axes give mobility {freedom} instead of "
        f"{mobility.degrees_of_freedom}: write {'; '.join(axis.advice for axis in found[:_SHOWN])}"
    )


def _groups(around: Iterable[tuple[str, Sequence[TreeJoint]]], cuts: Iterable[Joint]) -> list[list[tuple[Joint, Sequence[TreeJoint]]]]:
    """The loops, those that share a joint together."""
    cut_of, groups = {cut.name: cut for cut in cuts}, list[list[tuple[Joint, Sequence[TreeJoint]]]]()
    for name, tree in around:
        mine = {t.joint.name for t in tree}
        near = [group for group in groups if any(t.joint.name in mine for _, others in group for t in others)]
        groups = [group for group in groups if group not in near]
        groups.append([*(loop for group in near for loop in group), (cut_of[name], tree)])
    return groups


def _rank(geometry: JointGeometry, loops: Loops, skew: Sequence[SkewAxis]) -> int:
    """Independent equations of loops in the design position, where the axes are as they were meant."""
    exact = [(_exact(cut, skew), [replace(t, joint=_exact(t.joint, skew)) for t in tree]) for cut, tree in loops]
    jacobian = design_jacobian(geometry, exact)
    values = np.linalg.svd(jacobian, compute_uv=False) if jacobian.size else np.zeros(0)
    return int(np.sum(values > TOLERANCE * values.max(initial=0.0)))


def _exact(joint: Joint, skew: Sequence[SkewAxis]) -> Joint:
    """A joint with its axis as it was meant, where it is one of the ``skew`` axes."""
    for axis in (axis for axis in skew if axis.joint.name == joint.name):
        x, y, z = (sympy.Float(float(c)) if c else sympy.Integer(0) for c in axis.intended)
        joint = replace(joint, axes=((x, y, z),))
    return joint


def _find_skew(model: Model, loops: Loops) -> Iterator[SkewAxis]:
    """The axes of loops that are slightly off: nearly parallel ones from the mean of most, then those from perpendicular to it."""
    joints = {joint.name: joint for cut, tree in loops for joint in (cut, *(t.joint for t in tree)) if len(joint.axes) == 1}
    ordered = sorted(joints.values(), key=lambda joint: joint.span)
    axes = {joint.name: evaluate(model, joint.axes[0]) for joint in ordered}
    exact: list[tuple[Joint, Array]] = []
    for bundle in sorted(_bundles(ordered, axes), key=len, reverse=True):
        first = max(bundle, key=lambda joint: sum(_angle(axes[joint.name], axes[other.name]) < _SAME for other in bundle))
        intended, across = axes[first.name], None
        for other, direction in exact:
            if _SAME < abs(intended @ direction) < _NEAR:
                intended, across = intended - (intended @ direction) * direction, other
                intended = intended / np.linalg.norm(intended)
        exact.append((first, intended))
        for joint in bundle:
            angle = _angle(axes[joint.name], intended)
            if angle > _SAME:
                towards = np.where(np.abs(intended) < _SAME, 0.0, intended if axes[joint.name] @ intended > 0 else -intended)
                yield SkewAxis(joint=joint, other=across or first, is_square=across is not None, angle=angle, intended=towards)


def _bundles(joints: Sequence[Joint], axes: Mapping[str, Array]) -> list[list[Joint]]:
    """The joints, those with nearly parallel axes together."""
    bundles: list[list[Joint]] = []
    for joint in joints:
        near = (bundle for bundle in bundles if _angle(axes[bundle[0].name], axes[joint.name]) < _NEAR)
        bundle = next(near, None)
        if bundle is None:
            bundles.append(bundle := [])
        bundle.append(joint)
    return bundles


def _angle(a: Array, b: Array) -> float:
    """The angle (rad) between two lines along unit vectors."""
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), abs(a @ b)))


def describe_geometry(equations: RecursiveEquations, mobility: Mobility) -> str:
    """The fault in a mechanism's geometry that is slightly off, and its remedy; "" without one."""
    rigid = mobility.closed and not mobility.degrees_of_freedom
    return describe_skew(equations, mobility) or (describe_rigidity(equations) if rigid else "")


def describe_rigidity(equations: RecursiveEquations) -> str:
    """The speed that the loops of a rigid mechanism barely lock, and joints to check; "" where they lock all speeds well."""
    if any(joint.guide for joint in equations.topology.model.joints):
        return ""  # guides prescribe it, near dead centres too
    start = close_loops(equations, design_coordinates(equations))
    if start is None or not start[1].size:
        return ""
    opening, values, speeds = np.linalg.svd(start[1], full_matrices=False)
    if values[-1] > _BARELY * min(1.0, _extent(equations)):
        return ""
    speed, row = int(np.abs(speeds[-1]).argmax()), int(np.abs(opening[:, -1]).argmax())
    rate = values[-1] / abs(speeds[-1, speed])
    return (
        f"barely rigid: at a speed of 1 of '{equations.speed_names[speed]}' the rate of violation is {rate:.2g} m/s or rad/s, "
        f"most at '{equations.equation_names[row]}'; hinges nearly on one line, or points nearly in one plane, cause that: "
        f"check the points and axes of these joints"
    )


def _extent(equations: RecursiveEquations) -> float:
    """The largest distance (m) along an axis between joints."""
    model = equations.topology.model
    points = np.array([evaluate(model, joint.at) for joint in model.joints])
    return float((points.max(axis=0) - points.min(axis=0)).max())


@dataclass(frozen=True, kw_only=True)
class RatedOption:
    """A choice of the cut joint of a loop. ``condition`` is that of the equations of this loop and of those that share a joint with it, in
    the design position: the largest singular value by the smallest that is not zero."""

    option: Option
    condition: float


@dataclass(frozen=True, kw_only=True)
class RatedChoice:
    """The cut joint in use and the best of its alternatives, the best first."""

    used: RatedOption
    alternatives: tuple[RatedOption, ...]

    @property
    def reason(self) -> str:
        """The reason that the cut joint in use is preferred to the best alternative."""
        is_cut = self.used.option.joint.cut is True
        if not self.alternatives:
            return "given by the model" if is_cut else "no other joint of the loop may be cut"
        return f"{'given by the model' if is_cut else 'chosen'}: {_difference(self.used, self.alternatives[0])}"


def _difference(used: RatedOption, other: RatedOption) -> str:
    for attribute, counted in (("counted_once", "operations"), ("redundant", "redundant equations")):
        if less := getattr(other.option.cost, attribute) - getattr(used.option.cost, attribute):
            return f"{abs(less)} {counted} {'fewer' if less > 0 else 'more'} than at {other.option.joint.name}"
    return f"the same cost as at {other.option.joint.name}"


def rate_choices(topology: Topology, choices: Sequence[Choice], limit: int = 3) -> tuple[RatedChoice, ...]:
    """The choices with at most ``limit`` alternatives each; of equal cost, the better conditioned one comes first."""
    geometry = JointGeometry(model=topology.model)
    rated = []
    for choice in choices:
        worst = [o.cost for o in choice.alternatives[:limit]][-1:]
        options = [_rate(geometry, o) for o in choice.alternatives if o.cost <= worst[0]]
        options.sort(key=lambda r: (r.option.cost, float(f"{r.condition:.2e}")))
        rated.append(RatedChoice(used=_rate(geometry, choice.used), alternatives=tuple(options[:limit])))
    return tuple(rated)


def _rate(geometry: JointGeometry, option: Option) -> RatedOption:
    return RatedOption(option=option, condition=loop_condition(geometry, option.tree, option.cuts, option.joint))
