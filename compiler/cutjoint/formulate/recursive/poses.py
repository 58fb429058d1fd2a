"""The function ``poses``: q, v -> where all bodies and markers are, how they stand and how they move, for what draws or sounds them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from hashlib import sha256

from cutjoint.formulate.layout import Slot
from cutjoint.formulate.records import POSES, Function
from cutjoint.formulate.recursive.kinematics import Kinematics, halves
from cutjoint.model.records import Model, Vector
from cutjoint.program.blocks import Block

#: The numbers of one: a point's position, the rotation by columns, the point's velocity, the angular velocity, all in global axes, and
#: the point in the design position.
LENGTH = 3 + 9 + 3 + 3 + 3

#: The numbers of a pose that hosts get: position, attitude, velocity, angular velocity, and the point in the design position.
NUMBERS_PER_POSE = 16


def digest_of_poses(model: str, names: Sequence[str]) -> int:
    """A number of 64 bits that tells the poses of a model, of bodies and markers with these names, from those of others."""
    return int.from_bytes(sha256("\n".join((model, *names)).encode()).digest()[:8], "little")


def posed_points(model: Model) -> Mapping[str, tuple[str, Vector]]:
    """Body and point of each element that has a pose: bodies with their centres of mass, then markers."""
    bodies = {body.name: (body.name, body.centre_of_mass) for body in model.bodies}
    return bodies | {marker.name: (marker.body, marker.point) for marker in model.markers}


def poses_function(k: Kinematics, model: Model) -> tuple[Function, ...]:
    """The function, for the model's bodies and markers in that order."""
    results = {f"pose:{name}": _pose(k, body, point) for name, (body, point) in posed_points(model).items()}
    return (Function(name=POSES, arguments=("const Real* q", "const Real* v", "Real* pose"), results=results),)


def pose_slots(model: Model) -> dict[str, Slot]:
    """The places of the results."""
    names = tuple(str(i) for i in range(LENGTH))
    return {f"pose:{name}": Slot(array="pose", offset=i * LENGTH, names=names) for i, name in enumerate(posed_points(model))}


def _pose(k: Kinematics, body: str, point: Vector) -> Block:
    b, frame, at = k.builder, k.frames[body], k.point(body, point)
    R, (_, spin) = k.in_global(frame.R), halves(b, frame.Z)
    columns = [b.take(R, (0, 3), (j, j + 1)) for j in range(3)]
    velocity, turning = k.in_global(k.velocity(body, at)), k.in_global(spin)
    return b.stack([[part] for part in (k.absolute(body, at), *columns, velocity, turning, k.vector(point))])
