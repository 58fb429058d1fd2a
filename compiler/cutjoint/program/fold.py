"""Block IR -> block IR: equal parts of the program side by side in lanes.

Given families of corresponding blocks, one block for each member of a class, the pass finds what the members compute by the same
operations and lets lanes of one block do it.  Members may differ in constants, in signs, in a missing term of a sum and in the outside
blocks that they use; otherwise they are computed one by one and their results are gathered.  It knows no mechanics.
"""

from collections import Counter
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from typing import TypeAlias

from cutjoint.program.blocks import BindingTime, Block, Builder, is_zero
from cutjoint.program.lower import reachable_blocks

#: One block for each lane.
Family: TypeAlias = tuple[Block, ...]
#: Operations of blocks in the lanes of a family that no one operation computes; other blocks are terms of themselves.
_PLACED: Mapping[str, tuple[str, ...]] = {"signed": ("neg",), "sum": ("add", "sub")}


@dataclass(frozen=True)
class _Plan:
    """The operation by which a family is computed. It is ``uniform`` by its one block, ``const``, ``gather`` from its members, ``signed``
    by signs times another family, ``sum`` of families, or by the ``same`` operation on families."""

    kind: str
    family: Family
    parts: tuple[Family, ...] = ()
    signs: tuple[float, ...] = ()


class _DependentMembersError(Exception):
    """The members of a ``family`` depend on each other, so that they cannot be computed side by side."""

    def __init__(self, family: Family) -> None:
        self.family = family
        super().__init__()


@dataclass
class _Folding:
    """Families and their blocks in lanes; the members of those ``separate`` are computed one by one."""

    builder: Builder
    separate: Set[Family]
    plans: dict[Family, _Plan] = field(default_factory=dict)
    place: dict[Block, tuple[Family, int]] = field(default_factory=dict)
    folded: dict[Family, Block] = field(default_factory=dict)
    rewritten: dict[Block, Block] = field(default_factory=dict)
    busy: dict[Family, None] = field(default_factory=dict)

    def plan(self, family: Family) -> None:
        """Plan a family and all that it is computed from, without recursion."""
        stack = [family]
        while stack:
            family = stack.pop()
            if family in self.plans:
                continue
            plan = self.plans[family] = self._plan(family)
            for k, block in enumerate(family):
                if plan.kind == "same" or block.op in _PLACED.get(plan.kind, ()):
                    self.place.setdefault(block, (family, k))
            stack.extend(plan.parts)

    def _plan(self, family: Family) -> _Plan:
        first = family[0]
        if all(b is first for b in family):
            return _Plan("uniform", family)
        if all(b.op == "const" for b in family):
            return _Plan("const", family)
        if family in self.separate:
            return _Plan("gather", family)
        spines, bare = [self._spine(b) for b in family], tuple(b.args[0] if b.op == "neg" else b for b in family)
        signs = tuple(-1.0 if b.op == "neg" else 1.0 for b in family)
        if len({len(spine) for spine in spines}) > 1:
            if len({len(self._spine(b)) for b in bare}) == 1:
                return _Plan("signed", family, (bare,), signs)  # a sum, and the negation of one
            return _Plan("sum", family, self._termwise(spines))
        if len({(b.op, b.data, len(b.args), tuple(a.shape for a in b.args)) for b in family}) == 1 and first.op != "symbol":
            return _Plan("same", family, tuple(zip(*(b.args for b in family), strict=True)))
        if any(b.op == "neg" for b in family):
            return _Plan("signed", family, (bare,), signs)
        if len(spines[0]) > 1:
            return _Plan("sum", family, self._termwise(spines))
        if len({(b.op, tuple(a.shape for a in b.args)) for b in family}) == 1 and first.args:
            # each on its own, but from arguments in lanes
            return _Plan("gather", family, tuple(zip(*(b.args for b in family), strict=True)))
        return _Plan("gather", family)

    def _spine(self, block: Block) -> list[Block]:
        """The terms of a sum that was added up from the left; one term of anything else."""
        terms: list[Block] = []
        while block.op in ("add", "sub"):
            terms.append(block.args[1] if block.op == "add" else self.builder.neg(block.args[1]))
            block = block.args[0]
        return [block, *reversed(terms)]

    def _termwise(self, spines: Sequence[list[Block]]) -> tuple[Family, ...]:
        """The first terms of all members, the second ones, and so on; zero where a member has no more."""
        longest = max(len(spine) for spine in spines)
        nothing = self.builder.zero(*spines[0][0].shape)
        return tuple(tuple(spine[i] if i < len(spine) else nothing for spine in spines) for i in range(longest))

    def lanes(self, family: Family) -> Block:
        """The block that computes a planned family."""
        if family not in self.folded:
            if family in self.busy:
                raise _DependentMembersError(self._computed_within(family))
            self.busy[family] = None
            with self.builder.within(family[0].section):
                self.folded[family] = self._make(self.plans[family])
            del self.busy[family]
        return self.folded[family]

    def _computed_within(self, family: Family) -> Family:
        """The first family of a dependency cycle whose blocks are in lanes: gathers come after their members."""
        circle = list(self.busy)
        return next(f for f in circle[circle.index(family) :] if self.plans[f].kind in ("same", *_PLACED))

    def _make(self, plan: _Plan) -> Block:
        b, family = self.builder, plan.family
        if plan.kind == "uniform":
            return self.uniform(family[0])
        if plan.kind == "const":
            return b.lane_const(family)
        if plan.kind == "gather":
            return b.gather([self.uniform(block) for block in family])
        parts = [self.lanes(part) for part in plan.parts]
        if plan.kind == "signed":
            return b.scale(b.lane_const([b.number(s) for s in plan.signs]), parts[0])
        if plan.kind == "sum":
            return b.total(parts)
        block = b.again(family[0], parts)
        if family[0] in b.labels:
            label = b.labels[family[0]]
            b.labels.setdefault(block, replace(label, text=f"{label.text}_x{len(family)}"))
        return block

    def uniform(self, block: Block) -> Block:
        """A block of the folded program with the same value."""
        if block not in self.rewritten:
            with self.builder.within(block.section):
                result = self._uniform(block)
            if block in self.builder.labels and not result.lanes:
                self.builder.labels.setdefault(result, self.builder.labels[block])
            self.rewritten[block] = result
        return self.rewritten[block]

    def _uniform(self, block: Block) -> Block:
        if block in self.place:
            family, k = self.place[block]
            return self.builder.lane(self.lanes(family), k)
        if block.op in ("add", "sub") and self.place:
            terms = self._terms_of(block)
            whole, left = self._whole_families(terms)
            if whole:
                return self._sum(whole, left)
        return self.builder.again(block, [self.uniform(a) for a in block.args])

    def _terms_of(self, block: Block) -> list[tuple[int, Block]]:
        """The terms of a sum with their signs, from the left; a value in a lane is one term."""
        terms: list[tuple[int, Block]] = []
        stack = [(1, block)]
        while stack:
            sign, part = stack.pop()
            if part in self.place or part.op not in ("add", "sub", "neg"):
                terms.append((sign, part))
                continue
            if part.op != "neg":
                stack.append((sign if part.op == "add" else -sign, part.args[1]))
            stack.append((-sign if part.op == "neg" else sign, part.args[0]))
        return terms

    def _whole_families(self, terms: Sequence[tuple[int, Block]]) -> tuple[list[tuple[int, Family]], list[tuple[int, Block]]]:
        """The families all of whose members are terms of a sum, with their signs, and the terms that are left.
        A member may stand in several lanes and in several families, and a term may occur more than once: each occurrence counts once."""
        remaining = Counter(terms)
        found: list[tuple[int, Family]] = []
        for sign, block in terms:
            if block not in self.place:
                continue
            family = self.place[block][0]
            needed = Counter((sign, member) for member in family)
            if needed <= remaining:
                remaining -= needed
                found.append((sign, family))
        left = []
        for term in terms:
            if remaining[term] > 0:
                remaining[term] -= 1
                left.append(term)
        return found, left

    def _sum(self, whole: Sequence[tuple[int, Family]], left: Sequence[tuple[int, Block]]) -> Block:
        """A sum with the whole families of as many lanes added lane by lane first, then across."""
        b = self.builder
        by_width: dict[int, list[Block]] = {}
        for sign, family in whole:
            by_width.setdefault(len(family), []).append(self.lanes(family) if sign > 0 else b.neg(self.lanes(family)))
        result = b.total([b.lane_sum(b.total(families)) for families in by_width.values()])
        for sign, block in left:
            term = self.uniform(block)
            result = b.add(result, term) if sign > 0 else b.sub(result, term)
        return result


def fold(builder: Builder, families: Sequence[Family], results: Mapping[str, Block]) -> dict[str, Block]:
    """The results of a function with the families' common work in lanes; members that depend on each other are computed singly."""
    separate: set[Family] = set()
    while True:
        try:
            return _fold(_Folding(builder, separate), families, results)
        except _DependentMembersError as error:
            separate.add(error.family)


def _fold(folding: _Folding, families: Sequence[Family], results: Mapping[str, Block]) -> dict[str, Block]:
    computed = reachable_blocks(results.values())
    for family in _known_families(families, computed):
        if len(set(family)) == len(family) and not any(is_zero(b) for b in family):
            folding.plan(family)
    for block in computed:
        folding.uniform(block)  # arguments first, so that the recursion stays shallow
    return {target: folding.uniform(block) for target, block in results.items()}


def _known_families(families: Sequence[Family], computed: Sequence[Block]) -> list[Family]:
    """The families that need no input beyond those of a function's own values: others belong to other functions."""
    known = set(computed)
    foreign: set[Block] = set()
    for block in reachable_blocks(b for family in families for b in family if b not in known):
        is_input = block.op == "symbol" and block.binding is BindingTime.ITERATION
        if block not in known and (is_input or not foreign.isdisjoint(block.args)):
            foreign.add(block)
    return [family for family in families if foreign.isdisjoint(family)]
