"""The trimmed start of a scene, without a run."""

from collections.abc import Mapping, Sequence

from cutjoint.analysis.trims import Trimmed
from cutjoint.package.errors import RunError
from cutjoint.run import run_file
from cutjoint.run.scenes import ModelLike, load_model


def find_trim(
    model: ModelLike, *, scene: str | None = None, tunable: Sequence[str] = (), parameters: Mapping[str, float] | None = None,
    by: Sequence[str] = (),
) -> Trimmed:  # fmt: skip
    """Unknowns of a scene's trim, with gradients by tunable parameters.

    * ``tunable``: as of `compile_model`.
    * ``parameters``: values (SI units) of parameters and inputs.
    * ``by``: names of parameters.  The gradients follow from the conditions by the implicit function theorem; nothing is solved again.

    Raises:
        RunError: the scene has no trim, there is no such start, or it is not determined.
    """
    read, of = load_model(model, scene, tunable)
    if of.trim is None:
        raise RunError(f"{of.span}: scene '{of.name}' has no 'trim'; write one, or use find_equilibrium")
    return run_file.find_trim(read, of, parameters or {}, by)[2]
