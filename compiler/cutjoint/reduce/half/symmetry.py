"""Scenes that are symmetric about a plane: half of the model does for the whole.

Where a reflection maps a model and all that a scene does to it onto itself, the motion is its own image.  Bodies in the plane move in
it, with half their mass and half the forces on them; of everything else, one side is enough, and the other side's columns are its own
but for signs.  The half has the whole one's motion to rounding, and cannot leave the plane where the whole one is unstable.
Only a start that the scene leaves open may differ: where loops close from positions or speeds that contradict them, the change is the
smallest one in the coordinates there are.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from cutjoint.model.records import Body, Force, Joint, Model, Scene
from cutjoint.reduce.half.images import require_images
from cutjoint.reduce.half.in_plane import in_plane_words
from cutjoint.reduce.half.model import Half, cut_in_half, half_model
from cutjoint.reduce.half.pairs import Pairs, find_pairs, settle
from cutjoint.reduce.half.plane import AsymmetryError, Plane, require_gravity
from cutjoint.reduce.half.scene import half_scene
from cutjoint.reduce.half.sides import PlaneDistances, find_removed, join_sides
from cutjoint.reduce.records import Note, Outcome


def halve(model: Model, scene: Scene) -> Outcome:
    """Cut a model in half that is symmetric in a scene about one of the planes y = 0, x = 0, z = 0.

    A pass.  It leaves a model without pairs of elements; ``left`` says why one with pairs is not cut.
    """
    left: list[Note] = []
    for plane in (Plane(axis=axis) for axis in "yxz"):
        elements = settle(model, scene)
        pairs = find_pairs(elements, plane)
        if not pairs.any:
            continue
        try:
            return _cut(model, scene, pairs)
        except AsymmetryError as error:
            left.append(error.note)
    return Outcome(model=model, scene=scene, left=tuple(left[:1]))


def _cut(model: Model, scene: Scene, pairs: Pairs) -> Outcome:
    """The half, or the reason why there is none.

    Raises:
        AsymmetryError: the scene is not symmetric, or what is left is not a model.
    """
    require_gravity(model, pairs.plane)
    groups = join_sides(pairs)
    images = require_images(pairs)
    distances = PlaneDistances(plane=pairs.plane, values={p.symbol: p.value for p in model.parameters})
    half = cut_in_half(model, pairs.plane, images, find_removed(pairs, images, distances, groups))
    changed = half_scene(half, scene)
    return Outcome(model=half_model(half, changed), scene=changed, done=tuple(_notes(half)))


def _notes(half: Half) -> Iterator[Note]:
    model = half.model
    groups: dict[str, Sequence[Body | Joint | Force]] = {"bodies": model.bodies, "joints": model.joints, "forces": model.forces}
    counts = [f"{sum(e.name in half.removed for e in group)} {name}" for name, group in groups.items()]
    words = f"is symmetric about the plane {half.plane}: {', '.join(counts)} are left out as images of others"
    yield Note(element=model.name, words=words, span=model.span)
    for joint in model.joints:
        kind = half.in_plane[joint.name].joint.kind if joint.name in half.in_plane else joint.kind
        if kind is not joint.kind:
            yield Note(element=joint.name, words=in_plane_words(half.plane, kind, joint.kind), span=joint.span)
