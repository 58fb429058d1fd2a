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

    Attributes:
        method: recursive, recursive-newton, augmented or classical; ``precision``: double, or single,
            extended, quad of cutjoint-bench; the start is always found in double.
        outputs: instead of those of the scene.
        lanes: whether isomorphic subtrees are evaluated side by side.
        additions: solvers and integrators of other packages to build in.
        out: folder of a C export; the choices below are for it alone; ``integrator``: in place of the scene's.
        linearise, adjoint, poses: whether it has derivatives, adjoint sensitivities, poses of bodies, markers and wheels.
        external_wrenches, terrain: patterns of bodies and markers with a force and a torque as inputs; of wheels whose ground is an input.
        reproducible: whether it brings its own mathematical library, for the same bits on all processors.
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
        """Return whether the choices allow runs without a compiler."""
        return self.precision == DEFAULT_PRECISION and not self.additions and self.out is None


DEFAULT = CompileOptions()  #: the default choices
