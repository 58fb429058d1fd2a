"""The former place of `generic.backend`."""

from cutjoint_bench.generic.backend import BACKEND

__all__ = ["BACKEND"]
