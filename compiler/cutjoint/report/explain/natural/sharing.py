"""The reasons for so few coordinates: from four nodes of each body to the remaining ones."""

from __future__ import annotations

from dataclasses import dataclass

from cutjoint.formulate.natural.layout import Layout
from cutjoint.model.records import GROUND
from cutjoint.report.explain.natural.derivation import Derivation
from cutjoint.report.explain.views import Table, make_table, plural


@dataclass(frozen=True, kw_only=True)
class Sharing:
    """From four nodes of each body to the coordinates: each field but the first is what is saved."""

    unshared: int
    rigid: int
    unasked: int
    shared: int
    ground: int
    combined: int

    @property
    def left(self) -> int:
        """Points and vectors that are coordinates."""
        return self.unshared - self.rigid - self.unasked - self.shared - self.ground - self.combined


def count_sharing(layout: Layout, bodies: int) -> Sharing:
    """The counts of coordinates that sharing, the ground and combinations save."""
    groups = list(layout.groups.values())
    places = [node for g in groups for node in g.basis]
    nodes = list(dict.fromkeys(places))
    return Sharing(
        unshared=4 * bodies, rigid=4 * (bodies - len(groups)), unasked=sum(4 - len(g.basis) for g in groups),
        shared=len(places) - len(nodes), ground=sum(n.body == GROUND for n in nodes), combined=sum(n.parts is not None for n in nodes),
    )  # fmt: skip


def sharing_table(layout: Layout, bodies: int) -> Table:
    """The count as a sum."""
    s = count_sharing(layout, bodies)
    saved = (
        ("bodies fixed to others or to the ground", s.rigid), ("directions that nothing asks a body for", s.unasked),
        ("shared with a body laid out before", s.shared), ("constants of the ground", s.ground),
        ("combinations of another body's basis", s.combined),
    )  # fmt: skip
    rows = [("a point and three directions of each body", str(s.unshared)), *((name, f"-{n}") for name, n in saved if n)]
    return make_table(("points and vectors", "count"), [*rows, ("**coordinates**", f"**{s.left}**")])


def saving(d: Derivation) -> str:
    """The saving by shared points and vectors, in a sentence."""
    n, nodes = len(d.model.bodies), [node for node in d.full.layout.coordinates if node.size == 3]
    angles = len(d.full.layout.coordinates) - len(nodes)
    left = f"{plural(len(nodes), 'point or vector', 'points and vectors')} with {3 * len(nodes)} coordinates are left"
    return (
        f"Were nothing shared, each of the {plural(n, 'body', 'bodies')} would have a point and three directions of its own, "
        f"{4 * n} points and vectors with {12 * n} coordinates; {left}" + (f", besides {plural(angles, 'angle')}." if angles else ".")
    )
