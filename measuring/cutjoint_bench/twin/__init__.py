"""The former place of `generic`, for installations that have not been set up again."""

import sys

from cutjoint_bench.generic import backend

sys.modules[f"{__name__}.backend"] = backend
