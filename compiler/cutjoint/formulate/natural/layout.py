"""Model -> the layout of natural coordinates: the points and unit vectors that are coordinates, and the nodes that follow from them.

Bodies are laid out from the ground outwards. A body is spanned by up to four nodes, a point first: those that a joint shares with a body
laid out before, then points and directions of its own, then unit vectors across these. Equivalent joints on a body supply no basis node
before the others, so that all are computed in the same way. All other points and directions are linear combinations of these. A massless
body has the span of its points and directions only: a rod needs two points, and no attitude. Joints that keep the relative attitude (fixed,
prismatic) share all directions; bodies joined by a fixed joint are one group.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, count

import numpy as np
import sympy
from numpy.typing import NDArray

from cutjoint.elements.joint import SameAttitude, SameDistance, SamePoint
from cutjoint.formulate.natural.needs import Collector, Need, Needs, requested_angles
from cutjoint.formulate.natural.nodes import Form, Node, NodeKind, NodeName, Use, is_zero
from cutjoint.formulate.quantities import needs_place
from cutjoint.kernels.joints import direction_of
from cutjoint.model.elements.geometry import GLOBAL_AXES
from cutjoint.model.records import GROUND, Joint, Model, Output, Reaction, Scalar, Scene, Vector
from cutjoint.topology.records import Topology, grouped

#: The least part that a candidate adds to the span, as a share of its own length: of nodes that a joint shares, of a body's own.
_SHARED, _OWN = 1e-3, 0.5
_SPAN = 1e-7  #: rounding of a span


@dataclass(frozen=True, kw_only=True)
class Group:
    """Rigidly joined bodies: ``basis`` spans them, a point of the group is ``inverse`` (k, 4) times [place; 1] of it. ``pairs`` are the
    displacements from the first node whose products this group must keep, ``surplus`` shared nodes that the basis does not have."""

    name: str
    bodies: tuple[str, ...]
    basis: tuple[Node, ...]
    inverse: sympy.Matrix
    pairs: tuple[tuple[Form, Form], ...]
    surplus: tuple[Node, ...]


@dataclass(kw_only=True)
class Layout:
    """The nodes in the order of their layout, the groups, and the carriers of each node.
    ``angles`` are nodes by joint and coordinate, ``idle`` the joints that need no equation, ``outwards`` inner and outer body of each
    tree joint, ``arm`` (m) that of the topology, in which places count."""

    nodes: list[Node] = field(default_factory=list)
    groups: dict[str, Group] = field(default_factory=dict)
    group_of: dict[str, str] = field(default_factory=dict)
    carriers: dict[Node, set[str]] = field(default_factory=dict)
    angles: dict[tuple[str, str], Node] = field(default_factory=dict)
    idle: frozenset[str] = frozenset()
    outwards: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    _places: dict[tuple[str, NodeKind, tuple[Scalar, ...]], Node] = field(default_factory=dict, repr=False)
    _names: set[str] = field(default_factory=set, repr=False)
    value: Callable[[Scalar], float] = float
    arm: float = 1.0

    @property
    def coordinates(self) -> list[Node]:
        """The nodes that are coordinates."""
        return [n for n in self.nodes if n.is_coordinate]

    def point(self, body: str, place: Vector) -> Form:
        """A point of a body as a combination of nodes."""
        return self._form(body, NodeKind.POINT, place)

    def direction(self, body: str, place: Vector) -> Form:
        """A direction of a body as a combination of nodes."""
        return self._form(body, NodeKind.VECTOR, place)

    def _form(self, body: str, kind: NodeKind, place: Vector) -> Form:
        known = self.find(body, kind, place)
        if known is not None:
            return {known: 1}
        if self.group_of[body] == GROUND:
            return {self.node(body, kind, place, NodeName(GROUND, f"{kind}_{len(self.nodes)}")): 1}
        return combination(self.groups[self.group_of[body]], kind, place)

    def _key(self, body: str, kind: NodeKind, place: Vector) -> tuple[str, NodeKind, tuple[Scalar, ...]]:
        """The key of a node: nodes of a body with equal keys are one; places that depend on a tunable parameter must do so alike."""
        unit = self.arm if kind is NodeKind.POINT else 1.0
        exact = (sympy.sympify(x) / unit if unit != 1 else sympy.sympify(x) for x in place)
        return self.group_of[body], kind, tuple(round(float(x), 11) + 0.0 if x.is_number else x for x in exact)

    def find(self, body: str, kind: NodeKind, place: Vector) -> Node | None:
        """The node of a body there."""
        return self._places.get(self._key(body, kind, place))

    def node(self, body: str, kind: NodeKind, place: Vector, title: NodeName) -> Node:
        """The node of a body that is laid out: the one it carries there, or a new combination of its basis."""
        known = self.find(body, kind, place)
        if known is not None:
            return known
        group = self.group_of[body]
        parts = None if group == GROUND else combination(self.groups[group], kind, place)
        return self.add(Node(title=self.free_title(title, group), kind=kind, body=group, place=place, parts=parts))

    def shared(self, body: str, need: Need) -> Node:
        """The node of a body that another is to have as well; of a direction the opposite one is as good."""
        x, y, z = need.place
        opposite = self.find(body, need.kind, (-x, -y, -z)) if need.kind is NodeKind.VECTOR else None
        return opposite or self.node(body, need.kind, need.place, need.title)

    def add(self, node: Node) -> Node:
        """A new node, whose name no other must have: two bodies may meet a joint at points of their own."""
        assert node.name not in self._names, node
        self._names.add(node.name)
        self.nodes.append(node)
        self.carry(node.body, node)
        return node

    def free_title(self, title: NodeName, group: str, chosen: Iterable[Node] = ()) -> NodeName:
        """A title as whose text no node is called, nor one of the ``chosen`` that are not laid out yet."""
        used_names = self._names | {node.name for node in chosen}
        candidates = chain([title], (replace(title, group=group, number=i) for i in count(1)))
        return next(c for c in candidates if str(c) not in used_names)

    def carry(self, body: str, node: Node) -> None:
        """A further body carries the node."""
        self.carriers.setdefault(node, set()).add(self.group_of[body])
        self._places.setdefault(self._key(body, node.kind, node.place), node)

    def use(self, body: str, form: Form, sign: int = 1) -> Use:
        """A form as a body has it."""
        return Use(sign, self.group_of[body], form)

    def slide_ends(self, joint: Joint) -> tuple[str, str]:
        """The bodies from and to which a displacement counts: base and follower, or inner and outer body."""
        return self.outwards[joint.name] if joint.element.from_inner else (joint.base, joint.follower)

    def settled(self, nodes: Iterable[Node], group: str) -> bool:
        """Return whether a group other than this one carries all nodes, so that their distances and angles are settled."""
        return bool(set.intersection(*(self.carriers.get(n, set()) - {group} for n in nodes)))


def homogeneous(kind: NodeKind, place: Vector) -> list[Scalar]:
    """[place; 1] of a point, [place; 0] of a direction."""
    return [*place, sympy.Integer(int(kind is NodeKind.POINT))]


def combination(group: Group, kind: NodeKind, place: Vector) -> dict[Node, Scalar]:
    """A point or direction of a group over its basis."""
    coefficients = [_clean(c) for c in group.inverse * sympy.Matrix(homogeneous(kind, place))]
    return {n: c for n, c in zip(group.basis, coefficients, strict=True) if not is_zero(c)}


def _clean(c: Scalar) -> Scalar:
    """A number as a float, and as a whole one if it is whole but for rounding."""
    if not c.is_number:
        return c
    number = float(c)
    return float(round(number)) if abs(number - round(number)) < 1e-13 else number


def lay_out(topology: Topology, scene: Scene, outputs: Sequence[Output]) -> Layout:
    """The natural coordinates of a model for a scene's forces and outputs."""
    model = topology.model
    builder = _Builder(model, topology, _evaluator(model))
    builder.collect(scene, outputs)
    for body in _outwards(topology):
        if builder.group_of[body] == body:
            builder.lay_out(body)
    for joint, coordinate in requested_angles(model, scene, outputs):
        body = joint.base if joint.follower == GROUND else joint.follower
        node = Node(title=NodeName(joint.name, coordinate), kind=NodeKind.ANGLE, body=body, place=(sympy.Integer(0),) * 3)
        builder.layout.nodes.append(node)
        builder.layout.angles[joint.name, coordinate] = node
    return builder.layout


def _outwards(topology: Topology) -> list[str]:
    """The ground and all bodies, by their number of joints from the ground."""
    depth = {GROUND: 0}
    for t in topology.tree:
        depth[t.child] = depth[t.parent] + 1
    return sorted(depth, key=depth.__getitem__)


def _evaluator(model: Model) -> Callable[[Scalar], float]:
    """Numbers from expressions, parameters at their defaults."""
    defaults = {p.symbol: p.value for p in model.parameters}

    def value(expression: Scalar) -> float:
        expression = sympy.sympify(expression)
        return float(expression if expression.is_number else expression.subs(defaults))

    return value


class _Builder:
    def __init__(self, model: Model, topology: Topology, value: Callable[[Scalar], float]) -> None:
        self._model = model
        self._value = value
        order = _outwards(topology)
        self.group_of = grouped(order, ((j.base, j.follower) for j in model.joints if j.element.is_rigid))
        keep_attitude = (j for j in model.joints if any(isinstance(c, SameAttitude) for c in j.element.conditions))
        self._attitude_of = grouped(order, ((j.base, j.follower) for j in keep_attitude))
        self._done: set[str] = set()
        self._first_of_attitude: dict[str, str] = {}
        self._bodies_of: dict[str, list[str]] = defaultdict(list)
        for body, group in self.group_of.items():
            self._bodies_of[group].append(body)
        self._joints_at: dict[str, list[Joint]] = defaultdict(list)
        for joint in model.joints:
            for group in dict.fromkeys((self.group_of[joint.base], self.group_of[joint.follower])):
                self._joints_at[group].append(joint)
        self._alike = frozenset(name for c in topology.classes if c.independent for member in c.members for name in member)
        outwards = {t.joint.name: (t.parent, t.child) for t in topology.tree}
        self.layout = Layout(group_of=self.group_of, value=value, outwards=outwards, arm=topology.arm)
        self._needs: dict[str, Needs] = {}

    def collect(self, scene: Scene, outputs: Sequence[Output]) -> None:
        """Collect the needs of every group from joints, forces, gears and outputs."""
        collector = Collector(self._model, self.group_of.__getitem__, self._value)
        reactions = {r.name: r.joint for r in self._model.reactions if isinstance(r, Reaction)}
        first = {reactions[o.element] for o in outputs if o.element in reactions}
        joints = sorted((j for j in self._model.joints if not j.element.is_rigid), key=lambda j: j.name not in first)
        for joint, _ in requested_angles(self._model, scene, outputs):
            collector.angles(joint)
        for joint in joints:
            collector.joint(joint, idle=joint.element.constrains_one_rotation)
        for force in self._model.force_elements:
            if needs_place(force, self._model, scene, outputs):
                collector.force(force)
        for gear in self._model.gears:
            for end in gear.coordinates:
                collector.coordinate(end.joint, end.name)
        for output in outputs:
            collector.output(output)
        self.layout.idle = frozenset(j.name for j in joints if self._is_idle(j, collector))
        for joint in joints:
            if joint.element.constrains_one_rotation and joint.name not in self.layout.idle:
                collector.joint(joint, idle=False)
        self._needs = collector.needs

    def _is_idle(self, joint: Joint, collector: Collector) -> bool:
        """Return whether the only rotation that a joint constrains is that of a massless rod about its own axis."""
        if not joint.element.constrains_one_rotation or joint.guide is not None:
            return False
        for body in {self.group_of[joint.base], self.group_of[joint.follower]} - {GROUND}:
            needs = collector.needs[body]
            around = (j for j in self._model.joints if j is not joint and body in (self.group_of[j.base], self.group_of[j.follower]))
            balls = all(j.element.closes and all(isinstance(c, SamePoint | SameDistance) for c in j.element.conditions) for j in around)
            span = _span([self._column(n) for n in (*needs.shared, *needs.spanned)])
            if balls and span <= 2 and all(n.kind is NodeKind.POINT for n in (*needs.shared, *needs.spanned)):
                return True
        return False

    def lay_out(self, group: str) -> None:
        """Choose the basis of a group and its shared nodes."""
        if group != GROUND:
            bodies = tuple(self._bodies_of[group])
            existing = self._given(group)
            basis, surplus = self._choose(group, existing, self._needs[group])
            pairs = [
                (_displacement(basis, i), _displacement(basis, j)) for i in range(1, len(basis)) for j in range(i, len(basis))
                if not self.layout.settled([*_displacement(basis, i), *_displacement(basis, j)], group)
            ]  # fmt: skip
            surplus = [n for n in surplus if not self.layout.settled([n, *basis], group)]
            self.layout.groups[group] = Group(
                name=group, bodies=bodies, basis=tuple(basis), inverse=self._inverse(basis), pairs=tuple(pairs), surplus=tuple(surplus)
            )
            for node in existing:
                self.layout.carry(group, node)
            for node in basis:
                if node not in existing:
                    self.layout.add(node)
        self._done.add(group)
        self._first_of_attitude.setdefault(self._attitude_of[group], group)

    def _given(self, group: str) -> list[Node]:
        """The nodes that joints share with groups laid out before, points first."""
        existing: dict[Node, None] = {}
        mate = self._first_of_attitude.get(self._attitude_of[group])
        if mate is not None:
            needs = [Need(kind=NodeKind.VECTOR, place=axis, title=NodeName(mate, "xyz"[i])) for i, axis in enumerate(GLOBAL_AXES)]
            existing |= dict.fromkeys(self.layout.shared(mate, need) for need in needs)
        for joint in self._joints_at[group]:
            base, follower = self.group_of[joint.base], self.group_of[joint.follower]
            other = follower if base == group else base
            if other in self._done and other != group:
                for need in self._shared(joint):
                    existing.setdefault(self.layout.shared(other, need))
        return sorted(existing, key=lambda n: n.kind is not NodeKind.POINT)

    def _shared(self, joint: Joint) -> list[Need]:
        """The point and the direction that a joint's two bodies share."""
        shared = []
        if joint.element.shares_point:
            shared.append(Need(kind=NodeKind.POINT, place=joint.at, title=NodeName(joint.name)))
        direction = joint.element.shared_direction
        if direction is not None:
            shared.append(Need(kind=NodeKind.VECTOR, place=direction_of(joint, direction), title=NodeName(joint.name, direction)))
        return shared

    def _choose(self, group: str, existing: list[Node], needs: Needs) -> tuple[list[Node], list[Node]]:
        """The basis of a group and the shared nodes that are left over."""
        selection = _Selection(self._column, self.layout.free_title)
        items: list[Node | Need] = [*existing, *needs.shared, *needs.spanned]
        rank = _span([self._column(item) for item in items])
        points = sorted(needs.shared, key=lambda n: n.kind is not NodeKind.POINT)
        if rank == 4 and group not in self._alike:
            points = [need for need in points if need.title.element not in self._alike]  # joints alike are side by side in lanes
        if not existing and rank == 4:
            self._free(group, needs, selection)
        if existing and existing[0].kind is not NodeKind.POINT:
            selection.offer(group, self._first_point(group, points, needs), 0.0)
        surplus = [node for node in existing if not selection.take(node, _SHARED)]
        for need in points:
            if len(selection.nodes) < rank:
                selection.offer(group, need, _OWN if selection.nodes else _SHARED)
        self._complete(group, needs, selection, rank)
        return selection.nodes, surplus

    def _first_point(self, group: str, points: Sequence[Need], needs: Needs) -> Need:
        known = [n for n in (*points, *needs.spanned) if n.kind is NodeKind.POINT]
        return known[0] if known else Need(kind=NodeKind.POINT, place=(sympy.Integer(0),) * 3, title=NodeName(group, "point"))

    def _free(self, group: str, needs: Needs, selection: "_Selection") -> None:
        """A body that nothing carries: its centre of mass and the global axes."""
        centre = next((n for n in needs.spanned if n.kind is NodeKind.POINT), None)
        if centre is not None:
            selection.offer(group, Need(kind=NodeKind.POINT, place=centre.place, title=NodeName(group, "centre")), _SHARED)
            for name, axis in zip("xyz", GLOBAL_AXES, strict=True):
                selection.offer(group, Need(kind=NodeKind.VECTOR, place=axis, title=NodeName(group, name)), _OWN)

    def _complete(self, group: str, needs: Needs, selection: "_Selection", rank: int) -> None:
        """Unit vectors across the chosen nodes, or badly placed needs, until the span is whole."""
        if not selection.nodes:
            selection.offer(group, self._first_point(group, (), needs), 0.0)
        rest = [*needs.shared, *needs.spanned]
        while len(selection.nodes) < rank:
            if rank == 4:
                selection.across(group)
            else:
                best = max(rest, key=selection.share)
                selection.offer(group, best, 0.0)

    def _column(self, item: Node | Need) -> NDArray[np.float64]:
        unit = self.layout.arm if item.kind is NodeKind.POINT else 1.0
        return np.array([*(self._value(x) / unit for x in item.place), float(item.kind is NodeKind.POINT)])

    def _inverse(self, basis: Sequence[Node]) -> sympy.Matrix:
        """The left inverse of the basis' homogeneous places."""
        columns = sympy.Matrix([homogeneous(n.kind, n.place) for n in basis]).T
        if not columns.free_symbols:
            numbers = np.array(columns.tolist(), dtype=float)
            inverse = np.linalg.inv(numbers) if numbers.shape == (4, 4) else np.linalg.pinv(numbers)
            return sympy.Matrix(inverse.tolist())
        return columns.inv() if columns.is_square else (columns.T * columns).inv() * columns.T


def _displacement(basis: Sequence[Node], i: int) -> Form:
    """The displacement from the first node to node i, or that node's direction."""
    return {basis[i]: 1, basis[0]: -1} if basis[i].kind is NodeKind.POINT else {basis[i]: 1}


def _span(columns: Sequence[NDArray[np.float64]]) -> int:
    return int(np.linalg.matrix_rank(np.array(columns), tol=_SPAN)) if columns else 0


class _Selection:
    """Nodes that are independent: the directions from the first point to the others, and the directions among them."""

    def __init__(
        self, column: Callable[[Node | Need], NDArray[np.float64]], free_title: Callable[[NodeName, str, Iterable[Node]], NodeName]
    ) -> None:
        self.nodes: list[Node] = []
        self._column = column
        self._free_title = free_title

    def _displacements(self) -> NDArray[np.float64]:
        """The directions that the nodes span, (k, 3)."""
        columns = [self._column(n) for n in self.nodes]
        return np.array([self._displacement(c, columns) for c in columns[1:]]).reshape(-1, 3)

    @staticmethod
    def _displacement(column: NDArray[np.float64], columns: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
        return np.asarray(column[:3] - columns[0][:3] if column[3] else column[:3])

    def share(self, item: Node | Need) -> float:
        """The new share of a candidate, 0 to 1."""
        column = self._column(item)
        if not self.nodes:
            return float(column[3])
        if self.nodes[0].kind is not NodeKind.POINT:
            return 0.0
        displacement = self._displacement(column, [self._column(self.nodes[0])])
        length = float(np.linalg.norm(displacement))
        if length < _SPAN:
            return 0.0
        displacements = self._displacements()
        if displacements.size:
            basis = np.linalg.svd(displacements, full_matrices=False)[2]
            displacement = displacement - basis.T @ (basis @ displacement)
        return float(np.linalg.norm(displacement)) / length

    def take(self, node: Node, least: float) -> bool:
        """Take a node that adds enough."""
        if self.share(node) <= least:
            return False
        self.nodes.append(node)
        return True

    def offer(self, group: str, need: Need, least: float) -> None:
        """Take a new node of the group for a need that adds enough."""
        title = self._free_title(need.title, group, self.nodes)
        self.take(Node(title=title, kind=need.kind, body=group, place=need.place), least)

    def across(self, group: str) -> None:
        """Take a unit vector across all chosen."""
        displacements = self._displacements()
        basis = np.linalg.svd(displacements, full_matrices=True)[2] if displacements.size else np.eye(3)
        normal = basis[-1] if displacements.size else basis[0]
        largest = int(np.argmax(np.abs(np.round(normal, 9))))
        normal = normal * np.sign(normal[largest])
        place = tuple(sympy.Float(float(np.round(x, 15))) + 0 for x in normal)
        count = sum(n.title.element == group and n.title.which.startswith("across") for n in self.nodes)
        self.nodes.append(Node(title=NodeName(group, f"across_{count + 1}"), kind=NodeKind.VECTOR, body=group, place=place))
