"""The choices of a compilation."""

from collections.abc import Sequence
from dataclasses import dataclass

from cutjoint.methods import DEFAULT_METHOD, DEFAULT_PRECISION
from cutjoint.model.records import Output
from cutjoint.package.locations import AnyPath
from cutjoint.toolchain.build import FLAGS


@dataclass(frozen=True, kw_only=True)
class CompileOptions:
    """The choices of a compilation besides a model and its scene.

    ``outputs`` are instead of the scene's.  With ``lanes``, isomorphic subtrees are evaluated side by side.  ``precision`` is one of
    PRECISIONS, the number type of the run; the start is found in double.  ``additions`` are solvers and integrators of other packages that
    the simulator has too.  ``out`` receives a folder (`folders.Delivery`), which may have steps by another ``integrator`` than the scene's,
    with ``linearise`` derivatives at a state, with ``adjoint`` also those from the end of a run, and with ``poses`` those of all bodies,
    markers and wheels.  Bodies and markers that are ``external_wrenches`` have inputs of a force and a torque, wheels that are ``terrain``,
    by patterns of their names, those of a ground (`model.tunable`).  A folder that is ``reproducible`` has its own mathematical library.
    """

    method: str = DEFAULT_METHOD
    precision: str = DEFAULT_PRECISION
    flags: Sequence[str] = FLAGS
    outputs: Sequence[Output] | None = None
    lanes: bool = True
    additions: Sequence[str] = ()
    out: AnyPath | None = None
    integrator: str | None = None
    linearise: bool = False
    adjoint: bool = False
    poses: bool = False
    external_wrenches: Sequence[str] = ()
    terrain: Sequence[str] = ()
    reproducible: bool = False

    @property
    def can_be_interpreted(self) -> bool:
        """Return whether they say nothing that only generated code has: other number types, additions and folders."""
        return self.precision == DEFAULT_PRECISION and not self.additions and self.out is None


#: The choices where none is made.
DEFAULT = CompileOptions()
