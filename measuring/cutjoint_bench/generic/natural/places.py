"""Carriers of coordinates, for the kinematics that finds the start of a run."""

from __future__ import annotations

from collections.abc import Sequence

from cutjoint.formulate.natural.equations import LagrangianEquations
from cutjoint.formulate.natural.nodes import Node, NodeKind
from cutjoint.model.records import Joint, Scalar
from cutjoint_bench.generic.trees import Json, Trees


class Marks:
    """Points and directions of bodies by number: ``described`` collects them."""

    def __init__(self, equations: LagrangianEquations, trees: Trees) -> None:
        self.described: list[Json] = []
        self._trees = trees
        self._tree = {t.joint.name: t.child for t in equations.topology.tree}
        self._joints = {j.name: j for j in equations.topology.model.joints}
        self._angles = {node: key for key, node in equations.layout.angles.items()}

    def place(self, node: Node) -> Json:
        """The place of a coordinate: a mark, the coordinate of the joint that carries a body, or an angle that advances, by the way."""
        if node.kind is not NodeKind.ANGLE:
            return {"mark": self._mark(node.kind, node.body, node.place)}
        name, coordinate = self._angles[node]
        joint = self._joints[name]
        if joint.element.is_screw:
            return self._advance(joint)
        return {"body": self._tree[name], "index": joint.element.coordinates.index(coordinate)}

    def _advance(self, joint: Joint) -> Json:
        return {
            "axis": self._mark(NodeKind.VECTOR, joint.base, joint.axes[0]),
            "end": self._mark(NodeKind.POINT, joint.follower, joint.at),
            "start": self._mark(NodeKind.POINT, joint.base, joint.at),
            "pitch": self._trees.one(joint.pitch),
        }

    def _mark(self, kind: NodeKind, body: str, place: Sequence[Scalar]) -> int:
        self.described.append({"kind": str(kind), "body": body, "place": self._trees.all(place)})
        return len(self.described) - 1
