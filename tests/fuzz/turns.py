"""Turns of the kinds of input: what each gets, in seconds and in inputs alike, is in proportion to its share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import sqrt

#: Seconds that a turn takes, where an input takes no longer, and the most inputs of one.
TURN, MANY = 3.0, 1000


@dataclass
class Account:
    """The account of a kind with a share of the time.

    It has inputs begun and ended, seconds in all and those ``checked`` for its inputs alone, and turns under way.
    """

    name: str
    share: float
    count: float
    begun: int = 0
    ended: int = 0
    seconds: float = 0.0
    checked: float = 0.0
    under_way: int = 0

    @property
    def each(self) -> float:
        """Seconds for an input, 0 where none has ended."""
        return self.checked / self.ended if self.ended else 0.0

    @property
    def level(self) -> float:
        """The geometric mean of seconds and inputs by share, with turns under way, so that kinds with dear inputs have some."""
        return sqrt((self.seconds + self.under_way * max(TURN, self.each)) * self.begun) / self.share

    def begin(self, left: float) -> range:
        """The numbers of the inputs of a turn, no more than have ended before and fit into the seconds that are left."""
        size = min(int(min(TURN, left) / self.each), self.ended, MANY) if self.each else 1
        first, self.begun = self.begun, int(min(self.begun + max(1, size), self.count))
        self.under_way += 1
        return range(first, self.begun)

    def end(self, inputs: int, seconds: float, checked: float) -> None:
        """Count a turn; ``seconds`` is more than ``checked`` by what all inputs need, as a simulator that is compiled first."""
        self.under_way -= 1
        self.ended += inputs
        self.seconds += seconds
        self.checked += checked


@dataclass(frozen=True)
class Turns:
    """The turns of kinds, each with seeds from the ``first`` on."""

    first: int
    accounts: Sequence[Account]

    @classmethod
    def of(cls, first: int, shares: Mapping[str, float], counts: Mapping[str, float]) -> Turns:
        """Turns of kinds with shares; those in ``counts`` end after as many inputs."""
        return cls(first, [Account(name, share, counts.get(name, float("inf"))) for name, share in shares.items()])

    def next(self, left: float) -> tuple[str, range] | None:
        """The kind that is the farthest behind its share, and its seeds; None where no input would end in the seconds that are ``left``.

        A kind that was never tried is not held back, since nobody knows how long its inputs take.
        """
        waiting = [account for account in self.accounts if account.begun < account.count and account.each <= left]
        if left <= 0 or not waiting:
            return None
        account = min(waiting, key=lambda a: a.level)
        numbers = account.begin(left)
        return account.name, range(self.first + numbers.start, self.first + numbers.stop)

    def end(self, name: str, inputs: int, *, seconds: float, checked: float) -> None:
        """Count a turn of a kind."""
        next(account for account in self.accounts if account.name == name).end(inputs, seconds, checked)
