"""The topology of a model as a picture: bodies from left to right, parents first, cut joints as return lines on the right."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from cutjoint.elements.terms import Span
from cutjoint.model.records import GROUND, Joint
from cutjoint.topology.records import Topology

#: Sizes in pixels: of a letter, between rows, of a body beside its name, between columns beside joints' names, between cut joints' ways.
_LETTER, _ROW, _PADDING, _GAP, _LANE = 7.0, 40.0, 20.0, 34.0, 16.0
_MARGIN = 24.0
#: Heights are tried in such steps, and keep so far from the middle of bodies.
_STEP, _CLEAR = 4.0, 18.0


@dataclass(frozen=True, kw_only=True)
class GraphBody:
    """A body with the middle of its left side and its width; ``family`` is the number of its class of isomorphic parts, -1 for none.

    ``short`` is its name without the instance if the body that carries it has that too; ``is_removed`` is whether a reduction left it out.
    """

    name: str
    short: str
    x: float
    y: float
    width: float
    family: int
    about: Sequence[str]
    is_removed: bool = False


@dataclass(frozen=True, kw_only=True)
class GraphLink:
    """A joint or a gear between two bodies, with the elements of its loop as ``members``.

    ``short`` is its name without the instance if the body that it carries has that too.  The way of a cut one leaves base and follower at
    ``heights``, and goes up and down at ``lane``.
    """

    name: str
    short: str
    kind: str
    base: str
    follower: str
    cut: bool
    lane: float
    heights: tuple[float, float]
    members: Sequence[str]
    about: Sequence[str]
    is_noted: bool
    is_removed: bool = False


@dataclass(frozen=True, kw_only=True)
class Graph:
    """The picture with its size, and what is said of the whole."""

    width: float
    height: float
    bodies: Sequence[GraphBody]
    links: Sequence[GraphLink]
    families: Sequence[str]
    facts: Sequence[tuple[str, str]]


def draw_graph(
    topology: Topology, facts: Sequence[tuple[str, str]], notes: Mapping[str, Sequence[str]], gone: frozenset[str] = frozenset()
) -> Graph:  # fmt: skip
    """The graph of a topology; ``notes`` are texts about elements, by name, ``gone`` the elements that a reduction left out."""
    return _Layout(topology=topology, facts=facts, notes=notes, gone=gone).graph()


@dataclass(frozen=True, kw_only=True)
class _Layout:
    topology: Topology
    facts: Sequence[tuple[str, str]]
    notes: Mapping[str, Sequence[str]]
    gone: frozenset[str]

    def graph(self) -> Graph:
        bodies = [self._body(name) for name in (GROUND, *self.topology.order)]
        links = [*(self._link(t.joint, _short(t.joint.name, t.child)) for t in self.topology.tree), *self._cut_links(), *self._gear_links()]
        labels = max((len(link.name) for link in links if link.cut), default=0)
        return Graph(
            width=self._right + _LANE * (len(self.topology.closing) + 1) + _LETTER * labels + _MARGIN,
            height=_ROW * (max(self._rows.values()) + 1) + _MARGIN, bodies=bodies, links=links,
            families=[f"{len(c.roots)} x {c.size} bodies: {', '.join(c.roots)}" for c in self.topology.classes], facts=self.facts,
        )  # fmt: skip

    @cached_property
    def _children(self) -> Mapping[str, Sequence[str]]:
        children: dict[str, list[str]] = defaultdict(list)
        for t in self.topology.tree:
            children[t.parent].append(t.child)
        return children

    @cached_property
    def _depths(self) -> Mapping[str, int]:
        depths = {GROUND: 0}
        for t in self.topology.tree:
            depths[t.child] = depths[t.parent] + 1
        return depths

    @cached_property
    def _rows(self) -> Mapping[str, float]:
        """Leaf bodies stand below each other, every other body in the middle of its children."""
        rows: dict[str, float] = {}
        count = 0
        for name in reversed((GROUND, *self._outwards())):
            below = [rows[child] for child in self._children.get(name, ())]
            if not below:
                rows[name] = float(-count)
                count += 1
            else:
                rows[name] = (below[0] + below[-1]) / 2
        return {name: row + count - 1 for name, row in rows.items()}

    def _outwards(self) -> Iterator[str]:
        stack = [*reversed(self._children.get(GROUND, ()))]
        while stack:
            name = stack.pop()
            yield name
            stack += reversed(self._children.get(name, ()))

    @cached_property
    def _columns(self) -> Sequence[tuple[float, float]]:
        """Left side and width of the bodies of each depth; the joints' names stand before them."""
        columns, right = [], _MARGIN
        for depth in range(max(self._depths.values()) + 1):
            names = [self._short_body(name) for name, d in self._depths.items() if d == depth]
            joints = [_short(t.joint.name, t.child) for t in self.topology.tree if self._depths[t.child] == depth]
            left = right + (_GAP + _LETTER * max(map(len, joints)) if joints else 0.0)
            width = _PADDING + _LETTER * max(map(len, names))
            columns.append((left, width))
            right = left + width
        return columns

    @property
    def _right(self) -> float:
        return sum(self._columns[-1])

    def _body(self, name: str) -> GraphBody:
        left, width = self._columns[self._depths[name]]
        about = [] if name == GROUND else self._about(next(b.span for b in self.topology.model.bodies if b.name == name))
        return GraphBody(
            name=name, short=self._short_body(name), x=left, y=self._height(name), width=width, family=self._family(name),
            about=[*about, *self.notes.get(name, ())], is_removed=name in self.gone,
        )  # fmt: skip

    def _family(self, body: str) -> int:
        """The largest class of isomorphic parts that has the body."""
        classes = [i for i, c in enumerate(self.topology.classes) if any(body in member for member in c.members)]
        return max(classes, key=lambda i: self.topology.classes[i].size, default=-1)

    def _about(self, span: Span) -> list[str]:
        """The place of an element, and its line in the model file."""
        model = self.topology.model
        lines = model.files.get(span.file, model.text).splitlines()
        text = lines[span.line - 1].strip() if 0 < span.line <= len(lines) else ""
        return [f"{Path(span.file).name}:{span.line}", text]

    def _link(self, joint: Joint, short: str, *, cut: int | None = None, members: Sequence[str] = ()) -> GraphLink:
        """A joint of the tree, or the cut joint of a number."""
        kind = joint.kind + (", guided" if joint.guide is not None else "")
        return GraphLink(
            name=joint.name, short=short, kind=kind, base=joint.base, follower=joint.follower, cut=cut is not None, members=members,
            lane=self._lane(cut or 0), heights=self._heights(joint.base, joint.follower, cut or 0),
            about=[*self._about(joint.span), *self.notes.get(joint.name, ())], is_noted=joint.name in self.notes,
            is_removed=joint.name in self.gone,
        )  # fmt: skip

    def _cut_links(self) -> Iterator[GraphLink]:
        loops = {loop.cut: loop for loop in self.topology.loops}
        for i, joint in enumerate(self.topology.cuts):
            members = list[str]()
            if loop := loops.get(joint.name):
                members = [loop.base, *loop.bodies, *(t.joint.name for t in self.topology.tree if t.child in loop.bodies)]
            yield self._link(joint, joint.name, cut=i, members=members)

    def _gear_links(self) -> Iterator[GraphLink]:
        joints = {joint.name: joint for joint in self.topology.model.joints}
        for i, gear in enumerate(self.topology.model.gears, len(self.topology.cuts)):
            first, second = (joints[name] for name in gear.joints[:2])
            yield GraphLink(
                name=gear.name, short=gear.name, kind="gear", base=first.follower, follower=second.follower, cut=True, lane=self._lane(i),
                heights=self._heights(first.follower, second.follower, i), members=[first.name, second.name],
                about=[*self._about(gear.span), *self.notes.get(gear.name, ())],
                is_noted=gear.name in self.notes, is_removed=gear.name in self.gone,
            )  # fmt: skip

    def _height(self, body: str) -> float:
        return _ROW * (self._rows[body] + 0.5) + _MARGIN / 2

    def _heights(self, base: str, follower: str, number: int) -> tuple[float, float]:
        """Heights at leaf bodies, or, for other bodies, where nothing stands to their right."""
        shift = 3.0 * (number % 5) - 6.0

        def leaves_at(body: str) -> float:
            return self._free_height(body) + shift / 2 if self._children.get(body) else self._height(body) + shift

        return leaves_at(base), leaves_at(follower)

    def _free_height(self, body: str) -> float:
        """The height nearest to a body's at which no deeper body stands, nor the name of its joint."""
        start, depth = self._height(body), self._depths[body]
        others = [self._height(other) for other, d in self._depths.items() if d > depth]
        near = sorted((start + _STEP * n for n in range(-200, 201)), key=lambda height: abs(height - start))
        return next((height for height in near if all(abs(height - other) >= _CLEAR for other in others)), start)

    def _short_body(self, body: str) -> str:
        return _short(body, next((t.parent for t in self.topology.tree if t.child == body), ""))

    def _lane(self, number: int) -> float:
        return self._right + _LANE * (number + 1)


def _short(name: str, beside: str) -> str:
    """A name without its instance, if a name beside it has the same one."""
    instance, dot, short = name.rpartition(".")
    return short if dot and beside.startswith(f"{instance}.") else name
