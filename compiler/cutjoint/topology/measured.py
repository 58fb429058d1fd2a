"""The coordinates of a cut joint that can be measured from the pose of its bodies.

A displacement is a distance.  An angle counts turns, which no pose shows.  It is the sum of the turns around its loop where all of them are
about one direction, as in a planar loop.  Where the turns of a loop are about one direction and then about a second one, as in a Sarrus
linkage, both sums vanish, since no turn about one undoes one about the other.  A screw's angle is its advance.  A rate needs the velocities
only.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile

from cutjoint.elements.joint import ABOUT_AXIS, rate_name
from cutjoint.model.expressions.parse import POSITION
from cutjoint.model.expressions.quantities import readings_of
from cutjoint.model.records import Joint, Model, Scalar
from cutjoint.topology.records import TreeJoint

_PARALLEL = 1e-9  #: unit vectors are parallel if their components differ by less


@dataclass(frozen=True, kw_only=True)
class Use:
    """A use of a joint's coordinate, or of its rate alone, as a reason: "force 'x' acts on its coordinate"."""

    coordinate: str
    rate_alone: bool
    is_force: bool
    reason: str


@dataclass(frozen=True, kw_only=True)
class SignedRotation:
    """A tree joint whose ``coordinate`` contributes to an angle with a ``sign``."""

    joint: Joint
    coordinate: str
    sign: int


def uses_of_coordinates(model: Model) -> Mapping[str, tuple[Use, ...]]:
    """The uses of joints' coordinates by forces, by what reads quantities and by outputs, by the joints' names."""
    joints = {joint.name: joint for joint in model.joints}
    uses: dict[str, list[Use]] = {}
    for force in model.force_elements:
        if force.joint_of:
            rate_alone = all(POSITION not in law.free_symbols for law in force.expressions)
            uses.setdefault(force.joint_of, []).append(Use(
                coordinate=force.coordinate_of, rate_alone=rate_alone, is_force=True,
                reason=f"force '{force.name}' acts on its coordinate",
            ))  # fmt: skip
    requested = [
        (output, f"scene '{scene.name}' has its coordinate among the outputs")
        for scene in model.scenes.values() for output in scene.outputs
    ]  # fmt: skip
    requested += [
        (reading, f"a law, a rate, a signal or an output in {reading.span.seen_from(model.span)} reads its coordinate")
        for reading in readings_of(model)
    ]  # fmt: skip
    for output, reason in requested:
        if output.element in joints:
            rates = {rate_name(c): c for c in joints[output.element].element.coordinates}
            uses.setdefault(output.element, []).append(Use(
                coordinate=rates.get(output.quantity, output.quantity), rate_alone=output.quantity in rates, is_force=False, reason=reason,
            ))  # fmt: skip
    return {name: tuple(of_joint) for name, of_joint in uses.items()}


def reason_not_to_measure(cut: Joint, uses: Iterable[Use], around: Sequence[TreeJoint]) -> str:
    """The reason that a used coordinate of a cut joint cannot be measured, or "".  ``around`` are the tree joints of its loop."""
    for use in uses:
        if use.coordinate not in cut.element.measurable:
            return f"{use.reason}, which a cut {cut.kind} joint does not have"
        is_angle = use.coordinate in cut.element.angles and not cut.element.is_screw
        if is_angle and not use.rate_alone and angles_around(cut, around) is None:
            return f"{use.reason}, an angle whose full turns no pose shows in a loop with more than two directions of axes"
    return ""


def angles_around(cut: Joint, around: Sequence[TreeJoint]) -> tuple[SignedRotation, ...] | None:
    """The joint angles whose signed sum is the angle of a cut joint: those next to it in its loop about its direction.
    None if the others are not all about one other direction."""
    turning = [(t, is_inwards) for t, is_inwards in directed(cut, around) if not t.joint.element.keeps_attitude]
    before = list(takewhile(lambda turn: _sign(cut, turn[0].joint), turning))
    after = list(takewhile(lambda turn: _sign(cut, turn[0].joint), reversed(turning[len(before) :])))
    others = [t.joint for t, _ in turning[len(before) : len(turning) - len(after)]]
    if not all(_sign(others[0], joint) for joint in others):
        return None
    return tuple(
        SignedRotation(
            joint=t.joint, coordinate=t.joint.element.angles[0],
            sign=_sign(cut, t.joint) * (1 if is_inwards else -1) * (-1 if t.reversed else 1),
        )
        for t, is_inwards in (*before, *after)
    )  # fmt: skip


def directed(cut: Joint, around: Sequence[TreeJoint]) -> Iterator[tuple[TreeJoint, bool]]:
    """The joints of a loop from the cut joint's follower on, and whether each leads inwards on the follower's side."""
    body = cut.follower
    for t in around:
        is_inwards = body == t.child
        body = t.parent if is_inwards else t.child
        yield t, is_inwards


def _sign(cut: Joint, other: Joint) -> int:
    """1 or -1 if another joint rotates only about the cut joint's axis, in the same or the opposite sense; else 0."""
    element = other.element
    if tuple(element.measures.values()) != (ABOUT_AXIS,) or element.has_ball:
        return 0
    mine, its = cut.axes[0], other.axes[0]
    for sign in (1, -1):
        if all(_vanishes(x - sign * y) for x, y in zip(mine, its, strict=True)):
            return sign
    return 0


def _vanishes(x: Scalar) -> bool:
    return abs(float(x)) < _PARALLEL if x.is_number else bool(x == 0)
