"""Forms, linear combinations of nodes, and the table of those that a description uses."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field
from typing import Any

import sympy

from cutjoint.formulate.natural.layout import Layout
from cutjoint.formulate.natural.nodes import Form, Use, Uses, total
from cutjoint.kernels.joints import slide_axis
from cutjoint.model.records import GROUND, Joint, Vector
from cutjoint_bench.generic.trees import Trees


@dataclass(kw_only=True)
class FormTable:
    """Forms by number, in the order in which they are asked for; equal ones are one."""

    layout: Layout
    forms: list[Form] = field(default_factory=list)
    _numbers: dict[Hashable, int] = field(default_factory=dict)

    def point(self, body: str, place: Vector) -> Uses:
        """A point of a body."""
        return (self.layout.use(body, self.layout.point(body, place)),)

    def direction(self, body: str, place: Vector) -> Uses:
        """A direction of a body."""
        return (self.layout.use(body, self.layout.direction(body, place)),)

    def way(self, end: tuple[str, Vector], start: tuple[str, Vector]) -> Uses:
        """The way from one point to another."""
        return self.point(*end) + tuple(Use(-u.sign, u.group, u.form) for u in self.point(*start))

    def slide(self, joint: Joint, coordinate: str) -> tuple[Uses, Uses]:
        """The way between a joint's points and the direction along which a displacement counts."""
        base, follower = self.layout.slide_ends(joint)
        return self.way((follower, joint.at), (base, joint.at)), self.direction(base, slide_axis(joint, coordinate))

    def number(self, uses: Uses) -> int:
        """The number of a sum."""
        return self.number_of(total(uses))

    def numbers(self, several: tuple[Uses, ...]) -> list[int]:
        """The numbers of several sums."""
        return [self.number(uses) for uses in several]

    def number_of(self, form: Form) -> int:
        """The number of a form."""
        key = tuple((node, sympy.sympify(c)) for node, c in form.items())
        if key not in self._numbers:
            self._numbers[key] = len(self.forms)
            self.forms.append(form)
        return self._numbers[key]

    def described(self, trees: Trees) -> list[Any]:
        """Each form as pairs of node and coefficient; nodes count in the order of the layout."""
        return [described_form(self.layout, trees, form) for form in self.forms]


def described_form(layout: Layout, trees: Trees, form: Form) -> list[Any]:
    """A form as pairs of node and coefficient."""
    return [[layout.nodes.index(node), trees.one(c)] for node, c in form.items()]


def is_ground(layout: Layout, body: str) -> bool:
    """True if a body stands still."""
    return layout.group_of[body] == GROUND
