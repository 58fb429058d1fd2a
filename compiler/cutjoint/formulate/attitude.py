"""The attitude of a body as three angles."""

from __future__ import annotations

from cutjoint.program.blocks import Block, Builder

#: The angles that a body reports.
ATTITUDE = frozenset({"roll", "pitch", "yaw"})


def attitude(b: Builder, R: Block, angle: str) -> Block:
    """Yaw, pitch or roll, turned about z, y, x in turn, of a rotation R (3, 3); the pitch by its tangent, for its sake on the nose."""
    if angle == "pitch":
        across = b.take(R, (2, 3), (1, 3))
        return b.call("atan2", b.neg(b.element(R, 2, 0)), b.call("sqrt", b.mul(across, b.transpose(across))))
    rows = {"yaw": ((1, 0), (0, 0)), "roll": ((2, 1), (2, 2))}[angle]
    return b.call("atan2", *(b.element(R, i, j) for i, j in rows))
